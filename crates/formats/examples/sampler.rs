//! Checks importance samples against quadrature: the mean of their weights must be the integral of the evaluated
//! function.
//!
//! `cargo run --release -p wavelume-formats --example sampler -- 100000 24 75 1`; the numbers are those of samples per
//! incoming direction, 100,000 by default, of incoming directions, 24 by default, and of the wavelengths from 380 to
//! 750 nm of the glosses, 75 by default. A fourth number n takes one in n materials.
//!
//! The materials are BRDFs, BTDFs and a BSDF, from data/virtual and built here, each at incoming directions from 0 to
//! 85°. The mean of f · |cos θo| / pdf over independent samples is compared with A = ∫ f |cos θo| dωo by quadrature
//! of the smooth function. f is the mean over wavelengths (0 if that is negative). Quadrature uses the centroids of two
//! meshes, one a level finer, refined until they agree to 3e-5 of A. Columns:
//!
//! * `chi²`: Σ z² over the incoming directions, z = (mean − A) / √(se² + (1e-4 A)²), with its degrees of freedom; `z`
//!   is its standard normal deviate (Wilson and Hilferty 1931), which must be below 3.09 (p > 0.001);
//! * `off`: the largest |mean − A| / A;
//! * `weight`: the largest weight over A, which must be at most 100;
//! * `variance`: the relative variance of one weight, the mean over the incoming directions to 77°;
//! * `floor`: the least pdf over ε |cos θo| / π where f > 0 (a BSDF of both sides: / 2π), ε the default defensive part,
//!   at as many uniform pairs of directions; it must be at least 0.9. For a luminaire it is the pdf over ε / Ω, with Ω
//!   the solid angle of the cells that emit light; for a phase function over ε / 4π;
//! * `ns`: the time of a sample with its weight at 4 wavelengths, in batches, on one thread, after the trees are built.
//!
//! It fails (exit code 1) if one of these does not hold.

mod common;
mod gloss;

use gloss::{Gloss, dot};
use rand::RngExt;
use rand_pcg::Pcg32;
use rayon::prelude::*;
use std::error::Error;
use std::f64::consts::{PI, TAU};
use std::io::Write;
use std::process::ExitCode;
use std::sync::OnceLock;
use std::time::Instant;
use wavelume_core::compress::Target;
use wavelume_core::domain::limits::MAX_LEVEL;
use wavelume_core::domain::{
    Axis, Direction, Domain, Measurement, Quantity, Sampling, Silent, Tensor, TriangleMesh, Unit, WavelengthGrid,
};
use wavelume_core::evaluate::{Beyond, Directions, Drawings, Interpolation, Material, Place, SampleOptions};
use wavelume_formats::formats::Interpretation;
use wavelume_formats::pipeline::{self, Input, Request};
use wavelume_formats::projection::DirectionDomain;

/// Number of incoming directions, unless the second argument states another.
const INCIDENCES: usize = 24;
/// Number of wavelengths of the glosses, unless the third argument states another.
const BANDS: usize = 75;
const LARGEST_THETA: f64 = 85.0;
/// Largest incidence angle in degrees at which variances are compared.
const VARIANCE_THETA: f64 = 77.0;
const AGREEMENT: f64 = 3e-5;
const QUADRATURE: f64 = 1e-4;
const MOST_DEVIATE: f64 = 3.09;
const MOST_WEIGHT: f64 = 100.0;
const LEAST_FLOOR: f64 = 0.9;
/// Level of the coarser mesh at which quadrature starts.
const COARSE: u8 = 6;
/// Number of levels beyond the finest mesh.
const FINER: u8 = 3;
const BATCH: usize = 1 << 14;
const WAVELENGTHS: [f64; 4] = [450.0, 510.0, 570.0, 630.0];

const VIRTUAL: [(&str, &str); 6] = [
    ("spectralon", include_str!("../../../data/virtual/spectralon.json")),
    ("velvet", include_str!("../../../data/virtual/velvet.json")),
    ("wood", include_str!("../../../data/virtual/wood.json")),
    ("cloth", include_str!("../../../data/virtual/cloth.json")),
    ("plastic", include_str!("../../../data/virtual/plastic.json")),
    ("brushed copper", include_str!("../../../data/virtual/brushed_copper.json")),
];
const PAINT: &[u8] = include_bytes!("../../../data/carpaint_blue.mbsdf");
const WITHOUT_COSINE: [(&str, &str); 4] = [
    ("LED luminaire", include_str!("../../../data/virtual/led_luminaire.json")),
    ("Rayleigh", include_str!("../../../data/virtual/rayleigh.json")),
    ("hazy", include_str!("../../../data/virtual/hazy.json")),
    ("murky", include_str!("../../../data/virtual/murky.json")),
];

fn main() -> ExitCode {
    common::main("sampler", run)
}

/// Prints the tables with `count` samples per incoming direction; returns true if all checks pass.
pub(crate) fn run(count: Option<&str>, out: &mut impl Write) -> Result<bool, Box<dyn Error>> {
    let count: usize = count.map_or(Ok(100_000), str::parse)?;
    let number = |k: usize, usual: usize| std::env::args().nth(k).map_or(Ok(usual), |text| text.parse());
    let (directions, bands, apart) = (number(2, INCIDENCES)?, number(3, BANDS)?, number(4, 1)?);
    if directions < 2 || bands < 2 || apart == 0 {
        let found = format!("{directions} incoming directions, {bands} wavelengths, one in {apart} materials");
        return Err(format!("found {found}; expected at least 2, 2 and 1").into());
    }
    let mut holds = true;
    writeln!(
        out,
        "{count} samples for each of {directions} incoming directions, defensive part {}",
        SampleOptions::DEFENSIVE
    )?;
    writeln!(
        out,
        "  {:<18}{:>8}{:>5}{:>7}{:>10}{:>8}{:>10}{:>8}{:>6}",
        "", "chi²", "of", "z", "off", "weight", "variance", "floor", "ns"
    )?;
    for (name, make) in scattering(bands).into_iter().step_by(apart) {
        let row = Row::of(&make()?, directions, count)?;
        holds &= row.holds();
        writeln!(
            out,
            "  {name:<18}{:>8.1}{directions:>5}{:>7.2}{:>10.2e}{:>8.1}{:>10.5}{:>8.2}{:>6.0}{}",
            row.chi2,
            row.deviate,
            row.off,
            row.weight,
            row.variance,
            row.floor,
            row.nanoseconds,
            if row.holds() { "" } else { "  DOES NOT HOLD" }
        )?;
        out.flush()?;
    }
    for (name, document) in WITHOUT_COSINE.into_iter().step_by(apart) {
        let material = Material::open(&common::material(None, document)?)?;
        let floor = floor(&material, count)?;
        let is_enough = floor >= LEAST_FLOOR;
        holds &= is_enough;
        writeln!(out, "  {name:<56}{floor:>8.2}{}", if is_enough { "" } else { "  DOES NOT HOLD" })?;
    }
    writeln!(out, "  {}", if holds { "samples agree with quadrature" } else { "SAMPLES DISAGREE WITH QUADRATURE" })?;
    Ok(holds)
}

/// Figures of a material.
struct Row {
    chi2: f64,
    deviate: f64,
    off: f64,
    weight: f64,
    variance: f64,
    floor: f64,
    nanoseconds: f64,
}

impl Row {
    fn of(material: &Material, directions: usize, count: usize) -> Result<Self, Box<dyn Error>> {
        let quadrature = Quadrature::of(material)?;
        let found = incidences(directions)
            .into_par_iter()
            .enumerate()
            .map(|(k, wi)| Estimate::of(material, &quadrature, wi, count, k as u64).map_err(|error| error.to_string()))
            .collect::<Result<Vec<Estimate>, String>>()?;
        let chi2 = found
            .iter()
            .map(|e| (e.mean - e.integral).powi(2) / (e.error.powi(2) + (QUADRATURE * e.integral).powi(2)))
            .sum();
        let near: Vec<f64> = found.iter().filter(|e| e.theta <= VARIANCE_THETA).map(|e| e.variance).collect();
        Ok(Self {
            chi2,
            deviate: deviate(chi2, found.len() as f64),
            off: largest(found.iter().map(|e| (e.mean / e.integral - 1.0).abs())),
            weight: largest(found.iter().map(|e| e.weight / e.integral)),
            variance: near.iter().sum::<f64>() / near.len() as f64,
            floor: floor(material, count)?,
            nanoseconds: nanoseconds(material)?,
        })
    }

    fn holds(&self) -> bool {
        self.deviate < MOST_DEVIATE && self.weight <= MOST_WEIGHT && self.floor >= LEAST_FLOOR
    }
}

fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, f64::max)
}

/// The standard normal deviate of a chi² with `k` degrees of freedom.
fn deviate(chi2: f64, k: f64) -> f64 {
    let share = 2.0 / (9.0 * k);
    ((chi2 / k).cbrt() - 1.0 + share) / share.sqrt()
}

/// Returns incoming directions from 0 to 85°, evenly spaced in angle, each at another azimuth.
fn incidences(count: usize) -> Vec<Direction> {
    let golden = 180.0 * (3.0 - 5.0_f64.sqrt());
    let theta = |k: usize| LARGEST_THETA * k as f64 / (count - 1) as f64;
    (0..count).map(|k| Direction::from_degrees(theta(k), (23.0 + golden * k as f64).rem_euclid(360.0))).collect()
}

/// Mean of the weights at one incoming direction, and the integral that it estimates.
struct Estimate {
    theta: f64,
    mean: f64,
    /// Standard error of the mean.
    error: f64,
    integral: f64,
    weight: f64,
    /// Variance of one weight over the square of the mean.
    variance: f64,
}

impl Estimate {
    fn of(
        material: &Material,
        quadrature: &Quadrature,
        wi: Direction,
        count: usize,
        stream: u64,
    ) -> Result<Self, Box<dyn Error>> {
        let mut rng = Pcg32::new(0x5eed, stream);
        let (mut sum, mut squares, mut weight) = (0.0, 0.0, 0.0_f64);
        for _ in 0..count {
            let u = [rng.random(), rng.random()];
            if let Some(sample) = material.sample(&[], Some(wi), u, SampleOptions::default())? {
                sum += sample.weight;
                squares += sample.weight * sample.weight;
                weight = weight.max(sample.weight);
            }
        }
        let mean = sum / count as f64;
        let variance = squares / count as f64 - mean * mean;
        let integral = quadrature.integral(material, wi)?;
        let error = (variance / count as f64).sqrt();
        Ok(Self { theta: wi.theta_degrees(), mean, error, integral, weight, variance: variance / (mean * mean) })
    }
}

/// Points and measures of quadrature over a material's outgoing directions, computed once for all incoming ones.
struct Quadrature {
    outgoing: TriangleMesh,
    /// Points of each level down to the finest mesh, computed on first use.
    levels: [OnceLock<Vec<(Direction, f64)>>; MAX_LEVEL as usize + 1],
}

impl Quadrature {
    fn of(material: &Material) -> Result<Self, Box<dyn Error>> {
        let Some(Axis::Triangles(outgoing)) = material.axes().iter().filter(|axis| axis.is_directional()).nth(1) else {
            return Err("no outgoing triangles".into());
        };
        Ok(Self { outgoing: *outgoing, levels: [const { OnceLock::new() }; MAX_LEVEL as usize + 1] })
    }

    /// ∫ f |cos θo| dωo of the smooth function.
    fn integral(&self, material: &Material, wi: Direction) -> Result<f64, Box<dyn Error>> {
        let mut coarse = None;
        for level in COARSE.max(self.outgoing.level() + 1)..=MAX_LEVEL + FINER {
            let sum = self.sum(level, |wo| mean(material, Some(wi), wo))?;
            if coarse.is_some_and(|coarse: f64| (coarse - sum).abs() <= AGREEMENT * sum) {
                return Ok(sum);
            }
            coarse = Some(sum);
        }
        Err(format!("quadrature does not settle at {:.1} degrees", wi.theta_degrees()).into())
    }

    fn sum(&self, level: u8, f: impl Fn(Direction) -> Result<f64, Box<dyn Error>>) -> Result<f64, Box<dyn Error>> {
        let mesh = TriangleMesh::new(self.outgoing.domain(), level.min(MAX_LEVEL)).ok_or("no such mesh")?;
        let finer = level.saturating_sub(MAX_LEVEL);
        let mut sum = 0.0;
        let mut add = |(wo, measure): (Direction, f64)| -> Result<(), Box<dyn Error>> {
            sum += measure * f(wo)?;
            Ok(())
        };
        if finer == 0 {
            let all = || (0..mesh.len()).flat_map(|i| places(mesh, i, 0)).collect();
            self.levels[usize::from(level)].get_or_init(all).iter().try_for_each(|&place| add(place))?;
        } else {
            (0..mesh.len()).try_for_each(|i| places(mesh, i, finer).into_iter().try_for_each(&mut add))?;
        }
        Ok(sum)
    }
}

/// Returns the centroids of the parts of a triangle, and their projected solid angles.
fn places(mesh: TriangleMesh, i: usize, finer: u8) -> Vec<(Direction, f64)> {
    let mut parts = Vec::new();
    cut(mesh.vertices(i), finer, &mut parts);
    let whole: f64 = parts.iter().map(|(_, cosine)| cosine).sum();
    let measure = mesh.projected_solid_angle(i);
    parts.into_iter().map(|(wo, cosine)| (wo, measure * cosine / whole)).collect()
}

/// Computes the centroids of a triangle's parts, `finer` levels down, and the proportions of their projected solid
/// angles.
fn cut(corners: [[f64; 3]; 3], finer: u8, parts: &mut Vec<(Direction, f64)>) {
    let between = |a: usize, b: usize| [0, 1, 2].map(|axis| 0.5 * (corners[a][axis] + corners[b][axis]));
    if finer > 0 {
        let [ab, bc, ca] = [between(0, 1), between(1, 2), between(2, 0)];
        let [a, b, c] = corners;
        for part in [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]] {
            cut(part, finer - 1, parts);
        }
        return;
    }
    let [x, y, z] = [0, 1, 2].map(|axis| corners.iter().map(|corner| corner[axis]).sum());
    // Parts of a plane triangle, alike in area: |p|³ turns it into solid angle.
    let length = f64::sqrt(x * x + y * y + z * z);
    if let Some(direction) = Direction::new(x, y, z) {
        parts.push((direction, direction.cos_theta().abs() / length.powi(3)));
    }
}

/// The mean over wavelengths of the smooth function.
fn mean(material: &Material, wi: Option<Direction>, wo: Direction) -> Result<f64, Box<dyn Error>> {
    let place = Place { index: &[], wi, wo: Some(wo) };
    let mut weights = [0.0; 256];
    let weights = weights.get_mut(..material.lambdas()).ok_or("more than 256 wavelengths")?;
    weights.fill(1.0 / material.lambdas() as f32);
    Ok(f64::from(material.weighted(place, Interpolation::Smooth, weights)?).max(0.0))
}

/// Returns the least ratio of the pdf to that of the defensive part alone, at uniform pairs of directions.
fn floor(material: &Material, count: usize) -> Result<f64, Box<dyn Error>> {
    let axes: Vec<&Axis> = material.axes().iter().filter(|axis| axis.is_directional()).collect();
    let outgoing = match axes.last() {
        Some(Axis::Triangles(mesh)) => *mesh,
        _ => return Err("no outgoing triangles".into()),
    };
    let incoming = (axes.len() > 1).then(|| match axes[0] {
        Axis::Triangles(mesh) => mesh.domain(),
        _ => Domain::Hemisphere,
    });
    let has_cosine = material.quantity().has_cosine();
    // A luminaire's light.
    let lit: f64 = if incoming.is_none() {
        let mut total = 0.0;
        for i in 0..outgoing.len() {
            total += if is_lit(material, outgoing, i)? { outgoing.solid_angle(i) } else { 0.0 };
        }
        total
    } else {
        2.0 * TAU
    };
    let both = if outgoing.domain() == Domain::Sphere { 0.5 } else { 1.0 };
    let mut rng = Pcg32::new(0xf100, 1);
    let mut least = f64::INFINITY;
    for _ in 0..count {
        let wi = incoming.map(|domain| uniform(domain, &mut rng));
        let wo = uniform(outgoing.domain(), &mut rng);
        if mean(material, wi, wo)? > 0.0 {
            let expected = if has_cosine { both * wo.cos_theta().abs() / PI } else { 1.0 / lit };
            let pdf = material.pdf(&[], wi, wo, SampleOptions::default())?;
            least = least.min(pdf / (SampleOptions::DEFENSIVE * expected));
        }
    }
    Ok(least)
}

/// Returns true if the smooth function is positive at one of four points of a cell.
fn is_lit(material: &Material, outgoing: TriangleMesh, cell: usize) -> Result<bool, Box<dyn Error>> {
    let corners = outgoing.vertices(cell);
    for step in [[4.0, 1.0, 1.0], [1.0, 4.0, 1.0], [1.0, 1.0, 4.0], [1.0, 1.0, 1.0]] {
        let at = |axis: usize| corners.iter().zip(step).map(|(corner, share)| share * corner[axis]).sum();
        let wo = Direction::new(at(0), at(1), at(2)).ok_or("a cell without a middle")?;
        if mean(material, None, wo)? > 0.0 {
            return Ok(true);
        }
    }
    Ok(false)
}

fn uniform(domain: Domain, rng: &mut Pcg32) -> Direction {
    let height: f64 = rng.random();
    let z = match domain {
        Domain::Hemisphere => height,
        Domain::Lower => -height,
        Domain::Sphere => 2.0 * height - 1.0,
    };
    Direction::from_radians(z.acos(), TAU * rng.random::<f64>())
}

/// Returns the time per sample in a batch, in nanoseconds.
fn nanoseconds(material: &Material) -> Result<f64, Box<dyn Error>> {
    let wavelengths = if material.wavelengths().is_some() { &WAVELENGTHS[..] } else { return Ok(f64::NAN) };
    let chosen = material.choose(wavelengths, Beyond::Nearest)?;
    let mut rng = Pcg32::new(0x71e, 1);
    let mut coordinates = [(); 3].map(|()| Vec::with_capacity(BATCH));
    let u = [(); 2].map(|()| (0..BATCH).map(|_| rng.random::<f32>()).collect::<Vec<f32>>());
    for _ in 0..BATCH {
        let xyz = uniform(Domain::Hemisphere, &mut rng).xyz();
        coordinates.iter_mut().zip(xyz).for_each(|(to, x)| to.push(x as f32));
    }
    let [mut x, mut y, mut z, mut pdf] = [(); 4].map(|()| vec![0.0; BATCH]);
    let mut weights = vec![0.0; 4 * BATCH];
    let mut best = f64::INFINITY;
    for _ in 0..8 {
        let start = Instant::now();
        let [wx, wy, wz] = &coordinates;
        let out = Drawings { x: &mut x, y: &mut y, z: &mut z, pdf: &mut pdf, weights: &mut weights };
        let wi = Directions::new(wx, wy, wz);
        chosen.samples(&[], Some(wi), [&u[0], &u[1]], SampleOptions::default(), out)?;
        best = best.min(start.elapsed().as_secs_f64());
    }
    Ok(1e9 * best / BATCH as f64)
}

/// Makes a material.
type Make = Box<dyn FnOnce() -> Result<Material, Box<dyn Error>>>;

fn virtual_material(document: String) -> Make {
    Box::new(move || Ok(Material::open(&common::material(None, &document)?)?))
}

/// Returns BRDFs, BTDFs and a BSDF, each to be made when its turn comes. Glosses have `bands` wavelengths from 380 to
/// 750 nm.
fn scattering(bands: usize) -> Vec<(&'static str, Make)> {
    let mut materials: Vec<(&str, Make)> =
        VIRTUAL.map(|(name, document)| (name, virtual_material(document.to_owned()))).into();
    let paint = || {
        let paint = Input { bytes: PAINT, spectrum: None, interpretation: &Interpretation::default() };
        // The quadrature is over triangles.
        let request = Request { domain: Some(DirectionDomain::Triangles), ..Request::to(Target::ErL2(0.05)) };
        Ok(Material::open(&pipeline::compress(&pipeline::read(&paint)?, &request, &Silent)?.bytes)?)
    };
    materials.push(("blue car paint", Box::new(paint)));
    let mut add = |name, document: String| materials.push((name, virtual_material(document)));
    let step = 370.0 / (bands - 1) as f64;
    let gloss = |alpha: &str, frame: &str, axes: &str| {
        format!(
            r#"{{"wavelume": "virtual", "quantity": "brdf", "axes": [{axes}, "lambda:380:{step}:{bands}"], "model": {{"sum": [
                {{"lobe": {{"lambert": {{"reflectance": "red"}}}}}},
                {{"lobe": {{"ggx": {{"alpha": {alpha}, "fresnel": {{"cauchy": {{"a": 1.46, "b": 0.0085}}}}{frame}}}}}}}]}}}}"#
        )
    };
    let elevations = |step: usize| {
        let values: Vec<String> = (0..90).step_by(step).chain([88]).map(|theta| theta.to_string()).collect();
        format!(r#"{{"kind": "elevation", "values": [{}]}}, "hemi:5""#, values.join(","))
    };
    add("GGX 0.3", gloss(r#"{"isotropic": 0.3}"#, "", &elevations(10)));
    add("GGX 0.15", gloss(r#"{"isotropic": 0.15}"#, "", &elevations(5)));
    add("GGX 0.5/0.3", gloss(r#"{"anisotropic": [0.5, 0.3]}"#, "", r#""hemi:3", "hemi:4""#));
    let turned = r#", "frame": {"turn": 23, "tilt": 0, "toward": 0}"#;
    add("GGX 0.2/0.4 turned", gloss(r#"{"anisotropic": [0.2, 0.4]}"#, turned, r#""hemi:2", "hemi:4""#));
    let tilted = r#", "frame": {"turn": 70, "tilt": 6, "toward": 110}"#;
    add("GGX 0.3/0.1 tilted", gloss(r#"{"anisotropic": [0.3, 0.1]}"#, tilted, r#""hemi:3", "hemi:4""#));
    let sheet = r#"{"wavelume": "virtual", "quantity": "btdf", "axes": ["hemi:1", "lower:3", "lambda:400:50:7"],
        "model": {"lambert_transmission": {"transmittance": 0.6}}}"#;
    add("diffuse sheet", sheet.to_owned());
    materials.push(("rough slab", Box::new(|| Ok(Material::of(slab(Quantity::Btdf, Domain::Lower)?)?))));
    materials.push(("slab, both sides", Box::new(|| Ok(Material::of(slab(Quantity::Bsdf, Domain::Sphere)?)?))));
    materials
}

/// Returns a slab that transmits light around its direction and, over both sides, also reflects a gloss.
fn slab(quantity: Quantity, domain: Domain) -> Result<Measurement, Box<dyn Error>> {
    let mesh = |domain, level| TriangleMesh::new(domain, level).ok_or("no such mesh");
    let (incoming, outgoing) = (mesh(Domain::Hemisphere, 2)?, mesh(domain, 4)?);
    let surface = Gloss { alpha: 0.3, diffuse: 0.2 };
    let value = |wi: [f64; 3], wo: [f64; 3], lambda: f64| {
        if wo[2] >= 0.0 {
            return surface.value(wi, wo, lambda);
        }
        let width = 0.15 + 1e-4 * (lambda - 400.0);
        (0.02 + ((-dot(wi, wo) - 1.0) / width).exp()) / (1.0 + wi[2])
    };
    let mut samples = Vec::new();
    for i in 0..incoming.len() {
        for o in 0..outgoing.len() {
            let (wi, wo) = (incoming.centroid(i).xyz(), outgoing.centroid(o).xyz());
            samples.extend((0..4).map(|k| value(wi, wo, 400.0 + 100.0 * f64::from(k)) as f32));
        }
    }
    let grid = WavelengthGrid::even(400.0, 100.0, 4)?;
    let axes = vec![Axis::Triangles(incoming), Axis::Triangles(outgoing), Axis::Wavelength(grid)];
    Ok(Measurement::new(quantity, Unit::PerSteradian, Sampling::Average, Tensor::new(axes, samples)?)?)
}
