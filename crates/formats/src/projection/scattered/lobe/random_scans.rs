//! Random scans with and without a lobe: comparison of the projected light with the true one.

use super::super::super::{AxesRequest, Projected, project};
use super::super::tests::acquisition;
use super::carried::CarriedLobe;
use super::drawn::{BASE, Random, spiral};
use crate::domain::vector::{Vector, add, cross, scale, unit};
use crate::domain::{Axis, Direction, Quantity};
use crate::formats::{Acquisition, Scattered};

/// Function that gives the true BRDF of test data for an incoming and an outgoing direction.
type Truth = dyn Fn(Direction, Direction) -> f64;

/// Pattern in which random test scans sample the outgoing directions.
#[derive(Clone, Copy, Debug)]
enum Way {
    Spiral,
    Random,
    /// The scan samples outgoing directions more densely about the mirror direction than elsewhere.
    Adaptive,
    /// The scan samples outgoing directions on one side of the plane of incidence only.
    Half,
}

pub(super) struct Case {
    pub(super) acquired: Acquisition,
    pub(super) truth: Box<Truth>,
    pub(super) elevations: Vec<f64>,
    pub(super) what: String,
}

/// Test BRDF: a Gaussian lobe about the mirror direction over a constant background; `width` is its full width at half
/// maximum in degrees.
fn gaussian(width: f64, albedo: f64) -> impl Fn(Direction, Direction) -> f64 {
    let width = width.to_radians();
    move |wi, wo| {
        let [x, y, z] = wi.xyz();
        let off = Direction::new(-x, -y, z).unwrap().dot(wo).clamp(-1.0, 1.0).acos() / width;
        BASE + albedo / (1.1331 * width * width) * (-4.0 * 2_f64.ln() * off * off).exp()
    }
}

/// Test BRDF: a GGX lobe over a constant background; `width` is about its full width at half maximum in degrees at
/// normal incidence.
pub(super) fn microfacets(width: f64, albedo: f64) -> impl Fn(Direction, Direction) -> f64 {
    let square = (width.to_radians() / (4.0 * 0.6436)).powi(2);
    move |wi, wo| {
        let [[a, b, c], [x, y, z]] = [wi.xyz(), wo.xyz()];
        let h = Direction::new(a + x, b + y, c + z).unwrap();
        let cosine = h.cos_theta().powi(2);
        let density = square / (std::f64::consts::PI * (cosine * (square - 1.0) + 1.0).powi(2));
        let lambda = |z: f64| 0.5 * ((1.0 + square * (1.0 / (z * z) - 1.0)).sqrt() - 1.0);
        let (ci, co) = (wi.cos_theta().max(1e-3), wo.cos_theta().max(1e-3));
        BASE + albedo * density / (1.0 + lambda(ci) + lambda(co)) / (4.0 * ci * co)
    }
}

/// Test BRDF: a wide glossy lobe of the given roughness over a constant background.
fn gloss(roughness: f64) -> impl Fn(Direction, Direction) -> f64 {
    move |wi, wo| {
        let [[a, b, c], [x, y, z]] = [wi.xyz(), wo.xyz()];
        let h = Direction::new(a + x, b + y, c + z).unwrap();
        let (square, cosine) = (roughness * roughness, h.cos_theta().powi(2));
        BASE + 0.1 * square / (std::f64::consts::PI * (cosine * (square - 1.0) + 1.0).powi(2))
    }
}

/// Test BRDF that rises toward grazing directions, like velvet.
fn velvet(wi: Direction, wo: Direction) -> f64 {
    let off = |d: Direction| (1.0 - d.cos_theta().powi(2)).powi(4);
    0.05 + 0.3 * off(wo) + 0.1 * off(wi) * off(wo)
}

/// Draws a random test scan from a seed. `outliers` is the fraction of samples that are made ten times too high.
pub(super) fn random_scan(seed: u64, has_lobe: bool, outliers: f64) -> Case {
    let mut random = Random(seed);
    loop {
        let mut within = |low: f64, high: f64| low * (high / low).powf(random.even());
        let (width, albedo, noise) = (within(0.5, 8.0), within(0.05, 0.6), within(0.003, 0.03));
        let rough = within(0.2, 0.5);
        let count = 1 + (12.0 * random.even()) as usize;
        let first = 15.0 * random.even();
        let elevations: Vec<f64> = (0..count).map(|i| (first + 6.0 * i as f64).round()).collect();
        let (kind, blind) = ((3.0 * random.even()) as usize, random.even() < 0.5);
        let way = [Way::Spiral, Way::Random, Way::Adaptive, Way::Half][(4.0 * random.even()) as usize];
        let truth: Box<Truth> = match (has_lobe, kind) {
            (true, 0) => Box::new(microfacets(width, albedo)),
            (true, _) => Box::new(gaussian(width, albedo)),
            (false, 0) => Box::new(|_, _| BASE),
            (false, 1) => Box::new(gloss(rough)),
            (false, _) => Box::new(velvet),
        };
        let (mut incoming, mut outgoing, mut values, mut seen) = (Vec::new(), Vec::new(), Vec::new(), 0);
        for &theta in &elevations {
            let wi = Direction::from_degrees(theta, 0.0);
            let mirror = Direction::from_degrees(theta, 180.0);
            let turned = 360.0 * random.even();
            for i in 0..4000 {
                let mut z = 1.0 - (f64::from(i) + 0.5) / 4000.0;
                let mut phi = (222.492_235_949 * f64::from(i) + turned) % 360.0;
                if matches!(way, Way::Random | Way::Adaptive) {
                    (z, phi) = (random.even(), 360.0 * random.even());
                }
                let wo = Direction::from_degrees(z.acos().to_degrees(), phi);
                let is_left_out = match way {
                    Way::Half => phi > 180.0,
                    Way::Adaptive => wo.dot(mirror) < 0.85 && random.even() < 0.6,
                    _ => false,
                };
                if z < 0.02 || is_left_out || blind && wo.dot(wi) > 5_f64.to_radians().cos() {
                    continue;
                }
                let value = truth(wi, wo);
                seen += usize::from(value > BASE * (1.05 + 4.0 * noise));
                let factor = if outliers > 0.0 && random.even() < outliers { 10.0 } else { 1.0 };
                values.push((value * (1.0 + noise * random.normal()) * factor) as f32);
                incoming.push([theta, 0.0]);
                outgoing.push([wo.theta_degrees(), wo.phi_degrees()]);
            }
        }
        if has_lobe && seen < 3 {
            continue;
        }
        let what = if has_lobe {
            let of = format!("{seed}: {way:?}, kind {kind}, {width:.2}°, albedo {albedo:.2}, noise {noise:.4}");
            format!("{of}, {count} incidences, {seen} seen")
        } else {
            format!("{seed}: {way:?}, kind {kind}, rough {rough:.2}, noise {noise:.4}, {count} incidences")
        };
        let samples = Scattered { incoming, outgoing, isotropic: true, spectral: None, values, sigma: None };
        return Case { acquired: acquisition(Quantity::Brdf, samples), truth, elevations, what };
    }
}

/// Integrates the true BRDF times cos θo under the incoming polar angle `theta` in degrees, on a grid that is fine
/// about the mirror direction.
pub(super) fn light(truth: &dyn Fn(Direction, Direction) -> f64, theta: f64) -> f64 {
    let wi = Direction::from_degrees(theta, 0.0);
    let [x, y, z] = wi.xyz();
    let centre: Vector = [-x, -y, z];
    let first = unit(cross(centre, [0.0, 1.0, 0.0]));
    let second = cross(centre, first);
    let (rings, turns) = (600, 96);
    let edge = |i: i32| std::f64::consts::PI * (f64::from(i) / f64::from(rings)).powi(4);
    let mut sum = 0.0;
    for i in 0..rings {
        let middle = 0.5 * (edge(i) + edge(i + 1));
        let area = (edge(i).cos() - edge(i + 1).cos()) * std::f64::consts::TAU / f64::from(turns);
        for k in 0..turns {
            let (s, c) = (std::f64::consts::TAU * (f64::from(k) + 0.5) / f64::from(turns)).sin_cos();
            let across = add(scale(first, c), scale(second, s));
            let d = add(scale(centre, middle.cos()), scale(across, middle.sin()));
            if d[2] > 0.0 {
                sum += area * d[2] * truth(wi, Direction::new(d[0], d[1], d[2]).unwrap());
            }
        }
    }
    sum
}

/// Returns the albedo that a projected scan has under each incoming polar angle: the integral of its values on
/// triangles of outgoing directions, plus the light of the lobe stored beside them. Triangles without a value count as
/// the background.
pub(super) fn kept(projected: &Projected, elevations: &[f64]) -> Vec<f64> {
    let axes = projected.measurement.tensor.axes();
    let mesh = axes.iter().find_map(|axis| if let Axis::Triangles(mesh) = axis { Some(*mesh) } else { None }).unwrap();
    let planes = projected.measurement.tensor.samples().chunks(mesh.len());
    let of = |(plane, &theta): (&[f32], &f64)| {
        let cell = |(i, &value): (usize, &f32)| {
            let value = if value.is_nan() { BASE } else { f64::from(value) };
            mesh.solid_angle(i) * mesh.centroid(i).cos_theta() * value
        };
        let cells: f64 = plane.iter().enumerate().map(cell).sum();
        let under = projected.lobe.as_ref().and_then(|found| found.lobe.under(Direction::from_degrees(theta, 0.0)));
        cells + under.map_or(0.0, |under| under.light())
    };
    planes.zip(elevations).map(of).collect()
}

#[test]
#[ignore = "prints the figures of docs/accuracy.md and takes minutes; nothing is asserted"]
fn random_figures() {
    let number = |name: &str, usual: u64| std::env::var(name).ok().and_then(|n| n.parse().ok()).unwrap_or(usual);
    let (from, to) = (number("FROM", 0), number("TO", 20));
    let (mut lost, mut carried_of_smooth, mut warned_of_smooth, mut outside) = (0, 0, 0, 0);
    for seed in from..to {
        let case = random_scan(1000 + seed, true, 0.0);
        let projected = project(&case.acquired, &AxesRequest::default()).unwrap();
        let expected: Vec<f64> = case.elevations.iter().map(|&theta| light(&*case.truth, theta)).collect();
        let kept = kept(&projected, &case.elevations);
        let off = kept
            .iter()
            .zip(&expected)
            .map(|(k, e)| k / e - 1.0)
            .fold(0.0, |m: f64, o| if o.abs() > m.abs() { o } else { m });
        let mean = kept.iter().sum::<f64>() / expected.iter().sum::<f64>() - 1.0;
        let true_light = expected.iter().map(|e| e - BASE * std::f64::consts::PI).sum::<f64>() / expected.len() as f64;
        let warning = projected.lobe.as_ref().and_then(CarriedLobe::warning);
        let is_lost = off.abs() > 0.03 && warning.is_none();
        lost += u32::from(is_lost);
        let range = projected.lobe.as_ref().and_then(|lobe| lobe.light_range);
        let is_outside = range.is_some_and(|[low, high]| !(low..=high).contains(&true_light));
        outside += u32::from(is_outside);
        eprintln!(
            "{}{}{}: worst {:+.2} %, mean {:+.2} %, lobe's {:.4}; {}",
            if is_lost { "LOST " } else { "" },
            if is_outside { "OUTSIDE " } else { "" },
            case.what,
            100.0 * off,
            100.0 * mean,
            true_light,
            projected.lobe.as_ref().map_or("none".to_owned(), |lobe| format!(
                "{:.4} {:?} {} {}{:?}",
                lobe.light,
                lobe.light_range,
                lobe.samples_within_half,
                lobe.lobe,
                warning.map(|_| "WARNED")
            ))
        );
        for outliers in [0.0, 0.005] {
            let case = random_scan(5000 + seed + if outliers > 0.0 { 4000 } else { 0 }, false, outliers);
            let projected = project(&case.acquired, &AxesRequest::default()).unwrap();
            if let Some(lobe) = &projected.lobe {
                carried_of_smooth += 1;
                warned_of_smooth += u32::from(lobe.warning().is_some());
                eprintln!("FALSE outliers {outliers} {} {}", case.what, lobe.note());
            }
        }
    }
    eprintln!(
        "lost {lost}, carried of smooth {carried_of_smooth}, warned {warned_of_smooth}, outside of the range {outside} of {}",
        to - from
    );
}

/// Prints by how much BRDFs with lobes of many widths reflect too much or too little light after projection onto
/// triangles. The errors are relative to the light of the lobe without the background.
#[test]
#[ignore = "prints the figures of docs/accuracy.md and takes minutes; nothing is asserted"]
fn width_figures() {
    let elevations = [0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0];
    let base = BASE * std::f64::consts::PI;
    for (name, is_gaussian) in [("Gaussian", true), ("GGX", false)] {
        for width in [0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0] {
            let (mut worst, mut means, mut albedo, mut warned) = (0.0_f64, Vec::new(), 0.0_f64, 0);
            for seed in 700..704 {
                let truth: Box<Truth> =
                    if is_gaussian { Box::new(gaussian(width, 0.3)) } else { Box::new(microfacets(width, 0.3)) };
                let data = spiral(&*truth, &elevations, 0.01, seed);
                let projected = project(&acquisition(Quantity::Brdf, data), &AxesRequest::default()).unwrap();
                warned += usize::from(projected.lobe.as_ref().and_then(CarriedLobe::warning).is_some());
                let mut sum = 0.0;
                for (kept, theta) in kept(&projected, &elevations).into_iter().zip(elevations) {
                    let expected = light(&*truth, theta);
                    let off = (kept - base) / (expected - base) - 1.0;
                    worst = worst.max(off.abs());
                    albedo = albedo.max((kept / expected - 1.0).abs());
                    sum += off / 8.0;
                }
                means.push(100.0 * sum);
            }
            eprintln!(
                "{name} {width}: worst of the lobe {:.2} %, of the albedo {:.2} %, means {means:.2?} %, warned {warned} of 4",
                100.0 * worst,
                100.0 * albedo
            );
        }
    }
}

/// Prints by how many per cent BRDFs of unusual form reflect too much or too little light after projection onto
/// triangles: a cusp, two lobes, a long tail, a flat top and others.
#[test]
#[ignore = "prints the figures of docs/accuracy.md and takes minutes; nothing is asserted"]
fn odd_figures() {
    let spread = |wi: Direction, wo: Direction| {
        let [x, y, z] = wi.xyz();
        Direction::new(-x, -y, z).unwrap().dot(wo).clamp(-1.0, 1.0).acos().to_degrees()
    };
    let scale = |width: f64| 0.3 / (1.1331 * width.to_radians().powi(2));
    let (gauss6, gauss8, micro) = (gaussian(6.0, 0.3), gaussian(8.0, 0.3), microfacets(6.0, 0.2));
    let (rough, rough3) = (gloss(0.2), gloss(0.3));
    let list: Vec<(&str, Box<Truth>)> = vec![
        ("gauss 6", Box::new(gauss6)),
        ("gauss 8", Box::new(gauss8)),
        ("cusp", Box::new(move |wi, wo| BASE + scale(1.5) * (-spread(wi, wo) / 0.8).exp())),
        ("two", Box::new(move |wi, wo| micro(wi, wo) + 0.3 * scale(1.0) * (-2.77 * spread(wi, wo).powi(2)).exp())),
        ("on gloss", Box::new(move |wi, wo| rough(wi, wo) + 0.3 * scale(2.0) * (-0.69 * spread(wi, wo).powi(2)).exp())),
        (
            "on gloss .3",
            Box::new(move |wi, wo| rough3(wi, wo) + 0.3 * scale(1.0) * (-2.77 * spread(wi, wo).powi(2)).exp()),
        ),
        ("long tail", Box::new(move |wi, wo| BASE + 0.2 * scale(2.0) / (1.0 + spread(wi, wo).powi(2)).powf(1.5))),
        ("flat top", Box::new(move |wi, wo| BASE + scale(3.0) * (-0.69 * (spread(wi, wo) / 1.5).powi(4)).exp())),
    ];
    for (name, truth) in list {
        let elevations = [0.0, 15.0, 30.0, 45.0, 60.0];
        let data = spiral(&*truth, &elevations, 0.01, 91);
        let projected = project(&acquisition(Quantity::Brdf, data), &AxesRequest::default()).unwrap();
        let kept = kept(&projected, &elevations);
        let off: Vec<f64> =
            kept.iter().zip(elevations).map(|(kept, theta)| 100.0 * (kept / light(&*truth, theta) - 1.0)).collect();
        let note =
            projected.lobe.as_ref().map_or("none".to_owned(), |lobe| format!("{} {:?}", lobe.note(), lobe.warning()));
        eprintln!("{name}: {off:.2?} %; {note}");
    }
}
