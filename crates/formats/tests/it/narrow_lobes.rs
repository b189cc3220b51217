//! Outlier rejection: scans of narrow lobes keep their light or cause a warning; outliers of smooth lobes are rejected.

use wavelume_core::domain::{Direction, Quantity, Unit};
use wavelume_core::evaluate::{Interpolation, Material, Place};
use wavelume_formats::formats::{Acquisition, Instrument, NoteKind, ParseReport, Samples, Scattered};
use wavelume_formats::pipeline::{FitReport, Outcome, PipelineError};
use wavelume_formats::{Request, Source};

/// Generator of independent uniform numbers between 0 and 1 (`SplitMix64`, Steele and others 2014).
struct Random(u64);

impl Random {
    fn even(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Returns a normal deviate of mean 0 and standard deviation 1 (Box and Muller 1958).
    fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.even()).ln()).sqrt() * (std::f64::consts::TAU * self.even()).cos()
    }
}

const ELEVATIONS: [f64; 8] = [0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0];
const BASE: f64 = 0.3 / std::f64::consts::PI;

/// A BRDF of wi and wo.
type Truth = dyn Fn(Direction, Direction) -> f64;

/// Returns a base of albedo 0.3 with a Gaussian lobe about the mirror direction, `width` degrees wide at half its
/// maximum. The lobe reflects 0.3 times the cosine of incidence of the light.
fn gaussian(width: f64) -> impl Fn(Direction, Direction) -> f64 {
    let width = width.to_radians();
    move |wi, wo| {
        let [x, y, z] = wi.xyz();
        let off = Direction::new(-x, -y, z).unwrap().dot(wo).clamp(-1.0, 1.0).acos() / width;
        BASE + 0.3 / (1.1331 * width * width) * (-4.0 * 2_f64.ln() * off * off).exp()
    }
}

/// Returns a GGX lobe of this roughness, without shadowing, over the base.
fn gloss(roughness: f64) -> impl Fn(Direction, Direction) -> f64 {
    move |wi, wo| {
        let [[a, b, c], [x, y, z]] = [wi.xyz(), wo.xyz()];
        let h = Direction::new(a + x, b + y, c + z).unwrap();
        let (square, cosine) = (roughness * roughness, h.cos_theta().powi(2));
        BASE + 0.1 * square / (std::f64::consts::PI * (cosine * (square - 1.0) + 1.0).powi(2))
    }
}

/// BRDF that rises towards grazing directions.
fn velvet(wi: Direction, wo: Direction) -> f64 {
    let off = |d: Direction| (1.0 - d.cos_theta().powi(2)).powi(4);
    0.05 + 0.3 * off(wo) + 0.1 * off(wi) * off(wo)
}

/// Returns samples of `truth` with 1 % noise: a spiral of 4,000 directions at each of eight elevations, rotated from
/// one to the next. The fraction `outliers` of the samples is ten times too high.
fn scan(truth: &Truth, outliers: f64, seed: u64) -> Source {
    let mut random = Random(seed);
    let (mut incoming, mut outgoing, mut values) = (Vec::new(), Vec::new(), Vec::new());
    for theta in ELEVATIONS {
        let turned = 360.0 * random.even();
        for i in 0..4000 {
            let z = 1.0 - (f64::from(i) + 0.5) / 4000.0;
            let wo = [z.acos().to_degrees(), (222.492_235_949 * f64::from(i) + turned) % 360.0];
            if z < 0.02 {
                continue;
            }
            let value = truth(Direction::from_degrees(theta, 0.0), Direction::from_degrees(wo[0], wo[1]));
            let factor = if random.even() < outliers { 10.0 } else { 1.0 };
            values.push((value * (1.0 + 0.01 * random.normal()) * factor) as f32);
            incoming.push([theta, 0.0]);
            outgoing.push(wo);
        }
    }
    source(incoming, outgoing, values)
}

fn source(incoming: Vec<[f64; 2]>, outgoing: Vec<[f64; 2]>, values: Vec<f32>) -> Source {
    let samples = Scattered { incoming, outgoing, isotropic: true, spectral: None, values, sigma: None };
    let acquisition = Acquisition {
        format: "test",
        dialect: String::new(),
        quantity: Quantity::Brdf,
        unit: Unit::PerSteradian,
        samples: Samples::Scattered(samples),
        spectral_factor: None,
        instrument: Instrument::default(),
        report: ParseReport::default(),
    };
    Source { acquisition, content_digest: "b3-0".to_owned(), spectrum_digest: None }
}

/// Returns the signed error of the material's light within 40° of the mirror direction, as a fraction of all light. It
/// is the largest in magnitude over the elevations.
fn astray(outcome: &Outcome, truth: &Truth, elevations: &[f64]) -> f64 {
    let material = Material::open(&outcome.bytes).unwrap();
    let edge = |i: i32| (40.0 * (f64::from(i) / 90.0).powi(3)).to_radians();
    let light = |&theta: &f64| {
        let wi = Direction::from_degrees(theta, 0.0);
        let (sin, cos) = theta.to_radians().sin_cos();
        let (mut found, mut expected, mut base) = (0.0, 0.0, 0.0);
        for (i, k) in (0..90).flat_map(|i| (0..32).map(move |k| (i, k))) {
            let (off, about) = (0.5 * (edge(i) + edge(i + 1)), (11.25 * f64::from(k)).to_radians());
            let (a, b) = (off.sin() * about.cos(), off.sin() * about.sin());
            let wo = Direction::new(-sin * off.cos() + cos * a, b, cos * off.cos() + sin * a).unwrap();
            if wo.cos_theta() < 0.02 {
                continue;
            }
            let mut value = [0.0];
            let place = Place { index: &[], wi: Some(wi), wo: Some(wo) };
            material.evaluate(place, Interpolation::Smooth, &mut value).unwrap();
            let weight = (edge(i).cos() - edge(i + 1).cos()) * 11.25_f64.to_radians() * wo.cos_theta();
            found += weight * f64::from(value[0]);
            expected += weight * truth(wi, wo);
            base += weight * BASE;
        }
        (found - expected) / (0.3 + expected - base)
    };
    elevations.iter().map(light).fold(0.0, |most, off| if off.abs() > f64::abs(most) { off } else { most })
}

fn fit(outcome: &Outcome) -> FitReport {
    outcome.report.fit.unwrap()
}

fn warnings(outcome: &Outcome) -> Vec<String> {
    let of_light = |message: &&String| {
        message.contains(" light than its samples") || message.contains("narrower than the scan resolves")
    };
    let warnings = outcome.report.notes.iter().filter(|note| note.kind == NoteKind::Warning).map(|note| &note.message);
    warnings.filter(of_light).cloned().collect()
}

fn describe(outcome: &Outcome) -> String {
    let found = fit(outcome);
    format!(
        "lobe {}, rejected {} ({} alone), er(L2) {:.4}, with all {:.4}, light {:?}, axes {:?}, {:?}",
        found.lobe,
        found.rejected.values,
        found.isolated.unwrap().values,
        found.fit,
        found.fit_all.unwrap(),
        found.light.unwrap(),
        outcome.report.axes,
        outcome.report.notes.iter().map(|note| note.message.get(..60)).collect::<Vec<_>>()
    )
}

/// Order of the outgoing directions in a random scan.
#[derive(Clone, Copy, Debug)]
enum Way {
    Spiral,
    Random,
    /// Denser about the mirror direction.
    Adaptive,
    /// One side of the plane of incidence.
    Half,
}

/// Random scan with its true BRDF.
struct Case {
    source: Source,
    truth: Box<Truth>,
    elevations: Vec<f64>,
    what: String,
}

fn gaussian_of(width: f64, albedo: f64) -> impl Fn(Direction, Direction) -> f64 {
    let of_one = gaussian(width);
    move |wi, wo| BASE + albedo / 0.3 * (of_one(wi, wo) - BASE)
}

/// Returns a GGX lobe of about this width at half its maximum under normal incidence.
fn microfacets(width: f64, albedo: f64) -> impl Fn(Direction, Direction) -> f64 {
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

/// Returns a scan drawn from a seed. The fraction `outliers` of its samples is ten times too high.
fn random_scan(seed: u64, has_lobe: bool, outliers: f64) -> Case {
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
            (true, _) => Box::new(gaussian_of(width, albedo)),
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
                let is_blind = blind && wo.dot(wi) > 5_f64.to_radians().cos();
                if z < 0.02 || is_left_out || is_blind {
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
            format!(
                "{seed}: {way:?}, kind {kind}, {width:.2}°, albedo {albedo:.2}, noise {noise:.4}, {count} incidences, {seen} seen"
            )
        } else {
            format!("{seed}: {way:?}, kind {kind}, rough {rough:.2}, noise {noise:.4}, {count} incidences")
        };
        return Case { source: source(incoming, outgoing, values), truth, elevations, what };
    }
}

#[test]
#[ignore = "three hundred scans take 15 minutes: tests/nightly lobes"]
fn random_scans_with_lobes_are_warned_of_and_others_are_not() {
    let number = |name: &str, usual: u64| std::env::var(name).ok().and_then(|n| n.parse().ok()).unwrap_or(usual);
    let (from, to) = (number("WAVELUME_SCANS_FROM", 0), number("WAVELUME_SCANS_TO", 100));
    let (mut lost, mut false_ones, mut false_of_outliers) = (Vec::new(), Vec::new(), Vec::new());
    for seed in from..to {
        let Case { source, truth, elevations, what } = random_scan(1000 + seed, true, 0.0);
        let outcome = source.compress(&Request::er_l2(0.01)).unwrap();
        let (off, warned) = (astray(&outcome, &truth, &elevations), warnings(&outcome));
        let kind = warned
            .first()
            .map_or("none", |w| if w.contains("less light") || w.contains("more light") { "sum" } else { "narrow" });
        eprintln!("lobe {what}: astray {:.2} %, warned {kind}; {}", 100.0 * off, describe(&outcome));
        if off.abs() > 0.03 && warned.is_empty() {
            lost.push(what);
        }
    }
    for (seed, outliers) in (from..to).flat_map(|seed| [(5000 + seed, 0.0), (9000 + seed, 0.005)]) {
        let Case { source, what, .. } = random_scan(seed, false, outliers);
        let outcome = source.compress(&Request::er_l2(0.01)).unwrap();
        let warned = warnings(&outcome);
        eprintln!("smooth, outliers {outliers}, {what}: warned {warned:?}; {}", describe(&outcome));
        if !warned.is_empty() {
            if outliers > 0.0 { false_of_outliers.push(what) } else { false_ones.push(what) }
        }
    }
    eprintln!("lost without a warning: {} {lost:#?}", lost.len());
    eprintln!("warned of without a lobe: {} {false_ones:#?}", false_ones.len());
    eprintln!("warned of for outliers: {} {false_of_outliers:#?}", false_of_outliers.len());
    assert!(lost.is_empty() && false_ones.len() <= 3 && false_of_outliers.len() <= 3);
}

#[test]
fn narrow_lobes_keep_their_light_and_unresolved_ones_are_warned_of() {
    for (width, is_resolved) in [(0.5, false), (2.0, true), (8.0, true)] {
        let truth = gaussian(width);
        let source = scan(&truth, 0.0, 7);
        let outcome = source.compress(&Request::er_l2(0.01)).unwrap();
        let (warned, off) = (warnings(&outcome), astray(&outcome, &truth, &ELEVATIONS));
        assert_eq!(warned.is_empty(), is_resolved, "{width}: {warned:?}, {}", describe(&outcome));
        assert!(off.abs() < 0.03, "{width}: {off}");
        // Samples of a lobe are not rejected as outliers.
        let found = fit(&outcome);
        assert_eq!(found.isolated.unwrap().values, 0, "{width}: {}", describe(&outcome));
        assert!(width > 2.0 || found.lobe >= 4, "{width}: {}", describe(&outcome));
        assert_eq!(outcome.report.light_at_samples.len(), ELEVATIONS.len());
        // Cells hold one that is wide enough.
        assert!(outcome.report.lobe.is_some() || width == 8.0, "{width}");
        let Some(carried) = &outcome.report.lobe else { continue };
        assert!(
            (carried.full_width[0] / width - 1.0).abs() < 0.05 && carried.is_resolved == is_resolved,
            "{carried:?}"
        );
        if !is_resolved {
            assert!(warned[0].contains("narrower than the scan resolves"), "{warned:?}");
            // `inspect` repeats what the metadata state.
            let metadata = wavelume_core::compress::inspect(&outcome.bytes).unwrap().metadata.unwrap();
            let metadata: serde_json::Value = serde_json::from_str(&metadata).unwrap();
            assert_eq!(metadata["warnings"], serde_json::json!(warned));
            let [low, high] = carried.light_range.unwrap();
            assert!(low < 0.2294 && high > 0.2294, "{carried:?}");
            let strict = source.compress(&Request { strict: true, ..Request::er_l2(0.01) });
            assert!(
                matches!(&strict, Err(PipelineError::Strict(reason)) if reason.contains("narrower than")),
                "{width}"
            );
        }
    }
}

#[test]
fn lobes_of_other_forms_are_warned_of() {
    let spread = |wi: Direction, wo: Direction| {
        let [x, y, z] = wi.xyz();
        Direction::new(-x, -y, z).unwrap().dot(wo).clamp(-1.0, 1.0).acos().to_degrees()
    };
    let peak = |width: f64| 0.3 / (1.1331 * width.to_radians().powi(2));
    // No Gaussian and no GGX: the fitted lobe has 14 % less light than the first, and 37 % more than the second.
    let cusp = move |wi, wo| BASE + peak(1.5) * (-spread(wi, wo) / 0.8).exp();
    let flat_top = move |wi, wo| BASE + peak(4.5) * (-0.69 * (spread(wi, wo) / 2.25).powi(4)).exp();
    for (name, truth) in [("cusp", Box::new(cusp) as Box<Truth>), ("flat top", Box::new(flat_top))] {
        let outcome = scan(&*truth, 0.0, 91).compress(&Request::er_l2(0.01)).unwrap();
        let warned = warnings(&outcome);
        assert!(astray(&outcome, &truth, &ELEVATIONS).abs() > 0.03, "{name}: {}", describe(&outcome));
        assert!(warned.iter().any(|w| w.contains(" light than its samples")), "{name}: {warned:?}");
    }
}

#[test]
fn outliers_of_smooth_scans_are_rejected_without_a_warning() {
    for (name, truth) in
        [("cosine", Box::new(|_, _| BASE) as Box<Truth>), ("gloss", Box::new(gloss(0.2))), ("velvet", Box::new(velvet))]
    {
        let outcome = scan(&*truth, 0.005, 11).compress(&Request::er_l2(0.01)).unwrap();
        let found = fit(&outcome);
        assert_eq!(warnings(&outcome), Vec::<String>::new(), "{name}: {}", describe(&outcome));
        // 164 outliers, of which next to none lie together by chance.
        assert_eq!((found.rejected.values, found.lobe), (164, 0), "{name}: {}", describe(&outcome));
        assert!(found.isolated.unwrap().values >= 155, "{name}: {}", describe(&outcome));
        let light = found.light.unwrap();
        assert!(light.kept.unwrap().abs() < 0.02 && light.all.unwrap() < -0.04, "{name}: {light:?}");
        assert!(found.fit < 0.015 && found.fit_all.unwrap() > 0.05, "{name}: {found:?}");
    }
}

#[test]
fn the_light_of_samples_is_their_sum_by_area() {
    let outcome = scan(&|_, _| BASE, 0.0, 3).compress(&Request::er_l2(0.01)).unwrap();
    for light in &outcome.report.light_at_samples {
        // The directional albedo of the base, but for the lowest degree.
        assert!((light.light / 0.3 - 1.0).abs() < 0.003, "{light:?}");
        assert!((light.noise - 0.01 / 4000_f64.sqrt()).abs() < 1e-4 && light.values == 3920, "{light:?}");
        assert!(
            light.by_area && light.kept.is_some() && light.kept == light.together && light.kept == light.all,
            "{light:?}"
        );
    }
}

#[test]
fn scans_of_few_samples_have_a_light_or_none() {
    let of = |incoming: &[[f64; 2]], outgoing: &[[f64; 2]], value: f32| {
        let values = vec![value; outgoing.len()];
        source(incoming.to_vec(), outgoing.to_vec(), values).compress(&Request::er_l2(0.01)).unwrap().report
    };
    let one = of(&[[30.0, 0.0]], &[[30.0, 180.0]], 0.1);
    assert_eq!((one.light_at_samples.len(), one.light_at_samples[0].values), (1, 1));
    assert!(one.light_at_samples[0].kept.unwrap().abs() < 0.01);
    let dark = of(&[[30.0, 0.0]; 3], &[[30.0, 180.0], [30.0, 90.0], [10.0, 180.0]], 0.0);
    // Three samples are no area that stands for all directions.
    assert!(dark.light_at_samples.is_empty(), "{:?}", dark.light_at_samples);
    assert_eq!(dark.fit.unwrap().light.unwrap().all, None);
    // Each sample under an incidence of its own, in a plane.
    let own: Vec<[f64; 2]> = (0..40).map(|i| [2.0 * f64::from(i), 0.0]).collect();
    let back: Vec<[f64; 2]> = own.iter().map(|[theta, _]| [*theta, 180.0]).collect();
    let all = of(&own, &back, 0.1).light_at_samples;
    assert!(all.len() == 1 && all[0].theta_i.is_none() && all[0].values == 40, "{all:?}");
}
