//! Analytic surfaces and lamps, and directions of queries.

use wavelume_core::compress::{Settings, compress};
use wavelume_core::domain::{
    Axis, Direction, Domain, Measurement, Quantity, Sampling, Silent, Tensor, TriangleMesh, Unit, WavelengthGrid,
};
use wavelume_core::evaluate::Material;

pub(crate) type Vector = [f64; 3];

pub(crate) fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Returns the BRDF of GGX with Schlick's Fresnel factor over a coloured diffuse base, in sr⁻¹.
pub(crate) fn gloss(alpha: f64, diffuse: f64, wi: Vector, wo: Vector, lambda: f64) -> f64 {
    let h = [wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]];
    let length = dot(h, h).sqrt();
    let (ch, cd) = (h[2] / length, dot(wi, h) / length);
    let aa = alpha * alpha;
    let d = aa / (std::f64::consts::PI * (ch * ch * (aa - 1.0) + 1.0).powi(2));
    let shadow = |c: f64| 0.5 * ((1.0 + aa * (1.0 / (c * c) - 1.0)).sqrt() - 1.0);
    let (ci, co) = (wi[2].max(1e-4), wo[2].max(1e-4));
    let g = 1.0 / (1.0 + shadow(ci) + shadow(co));
    let f = 0.04 + 0.96 * (1.0 - cd).powi(5);
    let colour = 0.6 + 0.4 / (1.0 + (-(lambda - 520.0) / 30.0).exp());
    diffuse * colour / std::f64::consts::PI + d * f * g / (4.0 * ci * co)
}

pub(crate) fn mesh(domain: Domain, level: u8) -> TriangleMesh {
    TriangleMesh::new(domain, level).unwrap_or_else(|| unreachable!("level {level}"))
}

/// Returns centroid and solid angle of all triangles of the mesh `below` levels finer than `mesh`.
pub(crate) fn parts(mesh: TriangleMesh, below: u8) -> Vec<(Vector, f64)> {
    let fine = TriangleMesh::new(mesh.domain(), mesh.level() + below).unwrap_or_else(|| unreachable!());
    (0..fine.len()).map(|i| (fine.centroid(i).xyz(), fine.solid_angle(i))).collect()
}

pub(crate) fn measurement(
    incoming: Axis,
    level: u8,
    lambdas: &WavelengthGrid,
    f: impl Fn(Vector, Vector, f64) -> f64,
) -> Measurement {
    let directions: Vec<Vector> = match &incoming {
        Axis::Elevation(values) => values.iter().map(|&t| Direction::from_degrees(t, 0.0).xyz()).collect(),
        Axis::Triangles(mesh) => (0..mesh.len()).map(|i| mesh.centroid(i).xyz()).collect(),
        _ => unreachable!("an axis of directions"),
    };
    let out = mesh(Domain::Hemisphere, level);
    let parts = parts(out, 2);
    let mut samples = Vec::new();
    for &wi in &directions {
        for cell in parts.chunks_exact(16) {
            for lambda in lambdas.values() {
                let (sum, area) =
                    cell.iter().fold((0.0, 0.0), |(s, a), &(wo, da)| (s + da * f(wi, wo, lambda), a + da));
                samples.push((sum / area) as f32);
            }
        }
    }
    let axes = vec![incoming, Axis::Triangles(out), Axis::Wavelength(lambdas.clone())];
    let tensor = Tensor::new(axes, samples).unwrap_or_else(|e| unreachable!("{e}"));
    Measurement::new(Quantity::Brdf, Unit::PerSteradian, Sampling::Average, tensor)
        .unwrap_or_else(|e| unreachable!("{e}"))
}

/// Returns point `i` of a low-discrepancy sequence in the unit square (R2, Roberts 2018).
pub(crate) fn point(i: usize) -> [f64; 2] {
    [(0.5 + i as f64 * 0.754_877_666_246_693).fract(), (0.5 + i as f64 * 0.569_840_290_998_053).fract()]
}

pub(crate) fn uniform(i: usize, lowest: f64) -> Vector {
    let [u, v] = point(i);
    let z = lowest + (1.0 - lowest) * u;
    let r = (1.0 - z * z).max(0.0).sqrt();
    let phi = std::f64::consts::TAU * v;
    [r * phi.cos(), r * phi.sin(), z]
}

pub(crate) fn compressed(measurement: &Measurement) -> Vec<u8> {
    compress(measurement, &Settings::default(), &Silent).unwrap_or_else(|e| unreachable!("{e}")).bytes
}

pub(crate) fn direction(v: Vector) -> Option<Direction> {
    Direction::new(v[0], v[1], v[2])
}

pub(crate) fn grid(start: f64, step: f64, count: usize) -> WavelengthGrid {
    WavelengthGrid::even(start, step, count).unwrap_or_else(|e| unreachable!("{e}"))
}

/// Compresses a measurement to er(L2) 1 % and opens the result.
pub(crate) fn opened(measurement: &Measurement) -> Material {
    Material::open(&compressed(measurement)).unwrap_or_else(|e| unreachable!("{e}"))
}

/// Returns GGX with roughness 0.2 over a coloured base, 16 × 1024 × 75 samples.
pub(crate) fn brdf() -> Measurement {
    let f = |wi, wo, lambda| gloss(0.2, 0.5, wi, wo, lambda);
    measurement(Axis::Triangles(mesh(Domain::Hemisphere, 1)), 4, &grid(380.0, 5.0, 75), f)
}

/// Returns the surface of [`brdf`] as an isotropic one: 10 elevations × 1024 × 75 samples.
pub(crate) fn isotropic_brdf() -> Measurement {
    let f = |wi, wo, lambda| gloss(0.2, 0.5, wi, wo, lambda);
    let elevations = (0..10).map(|k| 9.0 * f64::from(k)).collect();
    measurement(Axis::Elevation(elevations), 4, &grid(380.0, 5.0, 75), f)
}

/// Returns a lamp with equal spectra in all directions, 2048 × 91 samples, and that spectrum alone.
pub(crate) fn lamp() -> [Measurement; 2] {
    let (sphere, lambdas) = (mesh(Domain::Sphere, 4), grid(380.0, 5.0, 91));
    let sample = |i: usize| (1.1 + sphere.centroid(i / 91).cos_theta()) * (1.0 + 0.5 * ((i % 91) as f64 / 9.0).sin());
    let of = |quantity, axes: Vec<Axis>| {
        let samples = (0..axes.iter().map(Axis::len).product()).map(|i| sample(i) as f32).collect();
        let tensor = Tensor::new(axes, samples).unwrap_or_else(|e| unreachable!("{e}"));
        Measurement::new(quantity, Unit::Relative, Sampling::Average, tensor).unwrap_or_else(|e| unreachable!("{e}"))
    };
    [
        of(Quantity::Edf, vec![Axis::Triangles(sphere), Axis::Wavelength(lambdas.clone())]),
        of(Quantity::Spectrum, vec![Axis::Wavelength(lambdas)]),
    ]
}

/// Returns lobes of many colours, 256 × 4096 × 75 samples, which take more than 128 MiB when opened.
pub(crate) fn large() -> Measurement {
    let (wi, wo, lambdas) = (mesh(Domain::Hemisphere, 3), mesh(Domain::Hemisphere, 5), grid(380.0, 5.0, 75));
    let colours: Vec<Vec<f64>> = (0..7)
        .map(|k| lambdas.values().iter().map(|l| 0.3 * (l / (25.0 + 9.0 * f64::from(k))).sin()).collect())
        .collect();
    let directions = |mesh: TriangleMesh| (0..mesh.len()).map(|i| mesh.centroid(i).xyz()).collect::<Vec<Vector>>();
    let (incoming, outgoing) = (directions(wi), directions(wo));
    let mut samples = Vec::with_capacity(wi.len() * wo.len() * lambdas.len());
    for &i in &incoming {
        for &o in &outgoing {
            let brightness = gloss(0.3, 0.5, i, o, 555.0).ln();
            let shares = [o[0], o[1], i[0], i[1], o[0] * i[0], o[1] * i[1], o[2] * i[2]];
            samples.extend((0..lambdas.len()).map(|l| {
                let colour: f64 = colours.iter().zip(shares).map(|(colour, share)| colour[l] * share).sum();
                (brightness + colour).exp() as f32
            }));
        }
    }
    let axes = vec![Axis::Triangles(wi), Axis::Triangles(wo), Axis::Wavelength(lambdas)];
    let tensor = Tensor::new(axes, samples).unwrap_or_else(|e| unreachable!("{e}"));
    Measurement::new(Quantity::Brdf, Unit::PerSteradian, Sampling::Average, tensor)
        .unwrap_or_else(|e| unreachable!("{e}"))
}
