//! Error bounds at scattered samples: noise, fit and outliers of synthetic scans with known truth.

use wavelume_core::domain::{Axis, Direction, Quantity, Tensor, Unit, WavelengthGrid};
use wavelume_core::evaluate::{Interpolation, Material, Place};
use wavelume_formats::formats::{
    Acquisition, Instrument, Interpretation, NoteKind, ParseReport, Samples, Scattered, SpectralFactor,
};
use wavelume_formats::pipeline::{FitReport, Input, Outcome, PipelineError, read};
use wavelume_formats::projection::{AxesRequest, DirectionDomain, project};
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

/// Directions from the normal to `lowest` degrees.
#[derive(Clone, Copy, Debug)]
enum Way {
    /// Spiral, turn after turn, uniform in solid angle.
    Spiral,
    /// Independent random directions.
    Random,
}

fn directions(way: Way, count: usize, lowest: f64) -> Vec<[f64; 2]> {
    let low = lowest.to_radians().cos();
    let mut random = Random(7);
    let at = |u: f64, phi: f64| [(low + (1.0 - low) * u).acos().to_degrees(), phi];
    let turns = (count as f64 / std::f64::consts::PI).sqrt() * (lowest / 90.0).sqrt();
    let of = |i: usize| match way {
        Way::Spiral => {
            let u = 1.0 - (i as f64 + 0.5) / count as f64;
            let theta = (low + (1.0 - low) * u).acos();
            at(u, (360.0 * turns * theta / lowest.to_radians()).rem_euclid(360.0))
        }
        Way::Random => at(random.even(), 360.0 * random.even()),
    };
    (0..count).map(of).collect()
}

/// Returns a GGX lobe of this roughness, without shadowing, over a diffuse base.
fn gloss(roughness: f64) -> impl Fn(Direction, Direction) -> f64 {
    move |wi, wo| {
        let [[a, b, c], [x, y, z]] = [wi.xyz(), wo.xyz()];
        let h = Direction::new(a + x, b + y, c + z).unwrap();
        let (square, cosine) = (roughness * roughness, h.cos_theta().powi(2));
        0.1 + 0.05 * square / (std::f64::consts::PI * (cosine * (square - 1.0) + 1.0).powi(2))
    }
}

/// Disturbances that the simulated instrument adds to the truth.
#[derive(Clone, Copy, Debug, Default)]
struct Disturbed {
    noise: f64,
    outliers: f64,
}

/// Returns the samples, and true for each outlier.
fn disturbed(truth: &[f64], by: Disturbed) -> (Vec<f32>, Vec<bool>) {
    let mut random = Random(3);
    let sample = |&truth: &f64| {
        let (noise, draw, side) = (random.normal(), random.even(), random.even());
        let factor = if draw >= by.outliers {
            1.0
        } else if side < 0.5 {
            10.0
        } else {
            0.1
        };
        ((truth * (1.0 + by.noise * noise) * factor) as f32, draw < by.outliers)
    };
    truth.iter().map(sample).unzip()
}

fn source(quantity: Quantity, unit: Unit, samples: Scattered) -> Source {
    let acquisition = Acquisition {
        format: "test",
        dialect: String::new(),
        quantity,
        unit,
        samples: Samples::Scattered(samples),
        spectral_factor: None,
        instrument: Instrument::default(),
        report: ParseReport::default(),
    };
    Source { acquisition, content_digest: "b3-0".to_owned(), spectrum_digest: None }
}

/// A BRDF at the same directions under each elevation, and which samples are outliers.
fn scan(way: Way, count: usize, elevations: &[f64], roughness: f64, by: Disturbed) -> (Source, Vec<bool>) {
    let f = gloss(roughness);
    let (mut incoming, mut outgoing, mut truth) = (Vec::new(), Vec::new(), Vec::new());
    for &theta in elevations {
        for wo in directions(way, count, 85.0) {
            incoming.push([theta, 0.0]);
            truth.push(f(Direction::from_degrees(theta, 0.0), Direction::from_degrees(wo[0], wo[1])));
            outgoing.push(wo);
        }
    }
    let (values, is_outlier) = disturbed(&truth, by);
    let samples = Scattered { incoming, outgoing, isotropic: true, spectral: None, values, sigma: None };
    (source(Quantity::Brdf, Unit::PerSteradian, samples), is_outlier)
}

/// A luminaire at scattered directions.
fn lamp(way: Way, count: usize, by: Disturbed) -> (Source, Vec<bool>) {
    let outgoing = directions(way, count, 180.0);
    let f = |&[theta, phi]: &[f64; 2]| {
        let down = -Direction::from_degrees(theta, phi).cos_theta();
        1000.0
            * (0.05 + (4.0 * (down - 1.0)).exp() * (1.0 + 0.2 * (2.0 * phi.to_radians()).cos() * (1.0 - down * down)))
    };
    let truth: Vec<f64> = outgoing.iter().map(f).collect();
    let (values, is_outlier) = disturbed(&truth, by);
    let samples = Scattered { incoming: vec![], outgoing, isotropic: false, spectral: None, values, sigma: None };
    (source(Quantity::Edf, Unit::Candela, samples), is_outlier)
}

fn fit(outcome: &Outcome) -> FitReport {
    outcome.report.fit.unwrap()
}

fn level(outcome: &Outcome) -> u8 {
    let axes = wavelume_core::compress::inspect(&outcome.bytes).unwrap().axes;
    axes.iter().rev().find_map(|a| if let Axis::Triangles(mesh) = a { Some(mesh.level()) } else { None }).unwrap()
}

/// Returns the warnings of a compression to 1 %, after checking everything that is promised of it.
fn checked((source, is_outlier): (Source, Vec<bool>), noise: f64) -> Vec<String> {
    let outcome = source.compress(&Request::er_l2(0.01)).unwrap();
    let fit = fit(&outcome);
    let found = fit.noise.unwrap();
    assert!((found - noise).abs() <= 0.25 * noise.max(0.002), "noise {found}, not {noise}");
    assert_eq!(fit.allowed, f64::max(0.02, 0.5 * found));
    let outliers = is_outlier.iter().filter(|is| **is).count() as u64;
    assert_eq!(fit.rejected.values, outliers);
    assert!((fit.rejected.samples - outliers as f64 / is_outlier.len() as f64).abs() < 1e-12);
    assert!(fit.is_kept(), "{fit:?}");
    outcome.report.notes.iter().filter(|n| n.kind == NoteKind::Warning).map(|n| n.message.clone()).collect()
}

const NOISY: [Disturbed; 4] = [
    Disturbed { noise: 0.0, outliers: 0.0 },
    Disturbed { noise: 0.01, outliers: 0.0 },
    Disturbed { noise: 0.03, outliers: 0.0 },
    Disturbed { noise: 0.01, outliers: 0.005 },
];

#[test]
fn luminaires_end_without_warning() {
    let ways = [(Way::Spiral, 4000), (Way::Random, 4000), (Way::Spiral, 20_000), (Way::Random, 20_000)];
    for (by, (way, count)) in crate::one_in(3, 0, NOISY.into_iter().flat_map(|by| ways.map(|way| (by, way)))) {
        assert_eq!(checked(lamp(way, count, by), by.noise), Vec::<String>::new(), "{way:?} {count} {by:?}");
    }
}

#[test]
fn lobes_over_a_base_end_without_warning() {
    let cases = NOISY.into_iter().flat_map(|by| [Way::Spiral, Way::Random].map(|way| (by, way)));
    for (by, way) in crate::one_in(3, 0, cases) {
        let scan = scan(way, 4000, &[0.0, 30.0, 60.0], 0.3, by);
        assert_eq!(checked(scan, by.noise), Vec::<String>::new(), "{way:?} {by:?}");
    }
}

#[test]
fn dense_scans_of_lobes_end_without_warning() {
    let cases = [(Way::Spiral, NOISY[3]), (Way::Spiral, NOISY[0]), (Way::Random, NOISY[3])];
    for (way, by) in crate::one_in(3, 0, cases) {
        let scan = scan(way, 20_000, &[20.0, 50.0], 0.15, by);
        assert_eq!(checked(scan, by.noise), Vec::<String>::new(), "{way:?} {by:?}");
    }
}

#[test]
fn what_is_stated_of_the_fit_is_what_an_evaluation_finds() {
    let (source, is_outlier) = scan(Way::Random, 4000, &[10.0, 45.0], 0.3, NOISY[3]);
    let outcome = source.compress(&Request::er_l2(0.01)).unwrap();
    let Samples::Scattered(samples) = &source.acquisition.samples else { panic!("scattered samples") };
    let material = Material::open(&outcome.bytes).unwrap();
    let (mut squares, mut count) = (0.0, 0.0_f64);
    for (i, _) in is_outlier.iter().enumerate().filter(|(_, is)| !**is) {
        let direction = |[theta, phi]: [f64; 2]| Direction::from_degrees(theta, phi);
        let (wi, wo) = (direction(samples.incoming[i]), direction(samples.outgoing[i]));
        let mut value = [0.0];
        let place = Place { index: &[], wi: Some(wi), wo: Some(wo) };
        material.evaluate(place, Interpolation::Smooth, &mut value).unwrap();
        squares += (f64::from(value[0]) / f64::from(samples.values[i]) - 1.0).powi(2);
        count += 1.0;
    }
    let (found, fit) = ((squares / count).sqrt(), fit(&outcome));
    assert!((found / fit.fit - 1.0).abs() < 1e-6, "{found}, stated {}", fit.fit);
    let stated = outcome.report.errors;
    assert_eq!(stated.er_l2, fit.fit);
    assert!(outcome.report.cells.unwrap().er_l2 <= 0.01);
    assert_eq!((stated.scored_samples as f64, stated.mask_mismatches), (count, 0));
    // The file states the same to four digits.
    let metadata = wavelume_core::compress::inspect(&outcome.bytes).unwrap().metadata.unwrap();
    let metadata: serde_json::Value = serde_json::from_str(&metadata).unwrap();
    let in_file: FitReport = serde_json::from_value(metadata["scattered"].clone()).unwrap();
    for (stated, found) in [(in_file.fit, fit.fit), (in_file.added, fit.added), (in_file.allowed, fit.allowed)] {
        assert!((stated / found - 1.0).abs() < 5.1e-4, "{stated} {found}");
    }
    assert_eq!(in_file.rejected.values, fit.rejected.values);
}

#[test]
fn planes_of_a_scan_are_compared_at_their_samples() {
    // One azimuth at three elevations, on triangles: directions without a grid, though they are stated as one.
    let mut text = "# radiometric-csv: 1\n# quantity: brdf\n# value_unit: 1/sr\n# cosine_included: false\n\
                    # angle_unit: deg\n# isotropic: true\ntheta_i,theta_o,phi_o,value\n"
        .to_owned();
    for (theta_i, theta_o) in [0, 30, 60].into_iter().flat_map(|i| (0..=80).step_by(10).map(move |o| (i, o))) {
        let value = 0.1 + 0.5 * (-f64::from((theta_o - theta_i) * (theta_o - theta_i)) / 400.0).exp();
        text.extend([format!("{theta_i},{theta_o},180,{value}\n")]);
    }
    let interpretation = Interpretation::default();
    let source = read(&Input { bytes: text.as_bytes(), interpretation: &interpretation, spectrum: None }).unwrap();
    let triangles = Request { domain: Some(DirectionDomain::Triangles), ..Request::er_l2(0.01) };
    let outcome = source.compress(&triangles).unwrap();
    let (errors, fit) = (outcome.report.errors, fit(&outcome));
    assert_eq!((errors.samples, errors.scored_samples), (27, 27));
    assert!(errors.er_l2 > 0.0 && errors.er_l2 == fit.fit);
    assert_eq!(outcome.report.notes.iter().any(|note| note.message.contains(" adds er(L2) ")), !fit.is_kept());
}

#[test]
fn a_scan_in_the_plane_of_incidence_stays_on_its_grid() {
    let truth = gloss(0.2);
    let mut text = "# radiometric-csv: 1\n# quantity: brdf\n# value_unit: 1/sr\n# cosine_included: false\n\
                    # angle_unit: deg\n# isotropic: true\ntheta_i,theta_o,phi_o,value\n"
        .to_owned();
    let angles = (0..=80).step_by(2).flat_map(|theta| [0, 180].map(|phi| (f64::from(theta), f64::from(phi))));
    let angles: Vec<(f64, f64)> = angles.collect();
    for (theta_i, &(theta_o, phi_o)) in
        [5.0, 20.0, 35.0, 50.0, 65.0].into_iter().flat_map(|i| angles.iter().map(move |o| (i, o)))
    {
        let value = truth(Direction::from_degrees(theta_i, 0.0), Direction::from_degrees(theta_o, phi_o));
        text.extend([format!("{theta_i},{theta_o},{phi_o},{value:.6}\n")]);
    }
    let interpretation = Interpretation::default();
    let source = read(&Input { bytes: text.as_bytes(), interpretation: &interpretation, spectrum: None }).unwrap();
    let outcome = source.compress(&Request::er_l2(0.01)).unwrap();
    assert!(
        outcome.report.axes[1].starts_with("grid of 41 × 2 (polar 0..80, azimuth 0..180)"),
        "{:?}",
        outcome.report.axes
    );
    let errors = outcome.report.errors;
    assert!(errors.er_l2 <= 0.01 && errors.samples == 410 && outcome.bytes.len() <= 600, "{}", outcome.bytes.len());
    // The lobe between incidences is that in the plane, not one of values interpolated between its two halves.
    let between = outcome.report.incidences.unwrap();
    assert!(between.left_out_er_l2 < 0.05, "{between:?}");
}

#[test]
fn a_coarse_level_by_name_is_warned_of_and_strict_refuses_it() {
    let (source, _) = scan(Way::Spiral, 4000, &[30.0], 0.15, NOISY[1]);
    let coarse = Request { outgoing_level: Some(2), ..Request::er_l2(0.01) };
    let outcome = source.compress(&coarse).unwrap();
    assert!(!fit(&outcome).is_kept());
    let warnings: Vec<_> = outcome.report.notes.iter().filter(|note| note.kind == NoteKind::Warning).collect();
    let [warning] = &warnings[..] else { panic!("{warnings:?}") };
    assert!(warning.message.starts_with("outgoing level 2 adds er(L2) "), "{}", warning.message);
    assert!(warning.message.ends_with("give a finer outgoing_level, or none"), "{}", warning.message);
    match source.compress(&Request { strict: true, ..coarse }) {
        Err(PipelineError::Strict(reason)) => assert_eq!(reason, warning.message),
        other => panic!("{:?}", other.map(|outcome| outcome.report.fit)),
    }
    let kept = source.compress(&Request { strict: true, ..Request::er_l2(0.01) }).unwrap();
    assert!(fit(&kept).is_kept());
}

#[test]
fn levels_are_refined_until_the_material_fits() {
    // Sparse all over, dense about the mirror direction: the spacing alone asks for coarse cells.
    let truth = gloss(0.03);
    let (wi, mirror) = (Direction::from_degrees(40.0, 0.0), Direction::from_degrees(40.0, 180.0));
    let near = |[theta, phi]: &[f64; 2]| Direction::from_degrees(*theta, *phi).dot(mirror) > 7_f64.to_radians().cos();
    let mut outgoing = directions(Way::Spiral, 4000, 85.0);
    outgoing.extend(directions(Way::Random, 150_000, 85.0).into_iter().filter(near));
    let f = |wo: &[f64; 2]| truth(wi, Direction::from_degrees(wo[0], wo[1]));
    let (values, _) = disturbed(&outgoing.iter().map(f).collect::<Vec<_>>(), NOISY[1]);
    let incoming = vec![[40.0, 0.0]; outgoing.len()];
    let samples = Scattered { incoming, outgoing, isotropic: true, spectral: None, values, sigma: None };
    let source = source(Quantity::Brdf, Unit::PerSteradian, samples);
    let chosen = source.compress(&Request::er_l2(0.01)).unwrap();
    let coarser = Request { outgoing_level: Some(level(&chosen) - 1), ..Request::er_l2(0.01) };
    let coarser = source.compress(&coarser).unwrap();
    assert!(fit(&chosen).is_kept() && !fit(&coarser).is_kept(), "{:?} {:?}", fit(&chosen), fit(&coarser));
    assert!(
        chosen
            .report
            .coverage
            .notes
            .iter()
            .any(|note| note.message.contains("would fit the spacing of the samples, but not represent"))
    );
}

/// Wavelengths from 400 to 700 nm every 10 nm.
fn wavelengths() -> WavelengthGrid {
    WavelengthGrid::parse_range("400:700:10").unwrap()
}

#[test]
fn samples_are_those_after_resampling() {
    let outgoing = directions(Way::Random, 1500, 180.0);
    let mut random = Random(11);
    let bands = wavelengths().len();
    let values = outgoing.iter().flat_map(|&[theta, _]| vec![3.0 + theta.to_radians().cos(); bands]);
    let values = values.map(|truth| (truth * (1.0 + 0.03 * random.normal())) as f32).collect();
    let spectral = Some(Axis::Wavelength(wavelengths()));
    let samples = Scattered { incoming: vec![], outgoing, isotropic: false, spectral, values, sigma: None };
    let source = source(Quantity::Edf, Unit::WattPerSteradianNanometre, samples);
    let plain = source.compress(&Request::er_l2(0.01)).unwrap().report;
    assert!(plain.errors_at.is_none() && (plain.fit.unwrap().noise.unwrap() / 0.03 - 1.0).abs() < 0.25);
    let request = Request { wavelengths: Some("420:680:20".to_owned()), ..Request::er_l2(0.01) };
    let report = source.compress(&request).unwrap().report;
    assert!(report.errors_at.as_ref().is_some_and(|text| text.starts_with("the samples after resampling to 420")));
    assert_eq!(report.errors.samples, 1500 * 14);
    // A band averages its samples by 1/4, 1/2, 1/4; the first and the last by halves.
    let (fit, expected) = (report.fit.unwrap(), 0.03 * ((12.0 * 0.375 + 2.0 * 0.5) / 14.0_f64).sqrt());
    assert!((fit.noise.unwrap() / expected - 1.0).abs() < 0.25 && fit.is_kept(), "{fit:?}");
}

#[test]
fn all_pairs_of_a_direction_and_a_wavelength_are_the_samples_of_a_joined_spectrum() {
    let factors: Vec<f64> = (0..31).map(|i| 0.01 + 0.02 * (-f64::from(i - 12).powi(2) / 20.0).exp()).collect();
    let (mut source, _) = lamp(Way::Spiral, 2000, NOISY[1]);
    source.acquisition.unit = Unit::WattPerSteradianNanometre;
    source.acquisition.spectral_factor = Some(SpectralFactor { grid: wavelengths(), factors: factors.clone() });
    let outcome = source.compress(&Request::er_l2(0.01)).unwrap();
    let report = &outcome.report;
    let expected = "all pairs of a stated direction and a wavelength of the spectrum";
    assert_eq!(report.errors_at.as_deref(), Some(expected));
    assert_eq!(report.errors.samples, 2000 * 31);
    assert!(fit(&outcome).is_kept() && (fit(&outcome).noise.unwrap() / 0.01 - 1.0).abs() < 0.25);
    let Samples::Scattered(samples) = &source.acquisition.samples else { panic!("scattered samples") };
    let material = Material::open(&outcome.bytes).unwrap();
    let (mut squares, mut light, mut wanted) = (0.0, 0.0, 0.0);
    for (&[theta, phi], &sample) in samples.outgoing.iter().zip(&samples.values) {
        let mut found = vec![0.0; 31];
        let place = Place { index: &[], wi: None, wo: Some(Direction::from_degrees(theta, phi)) };
        material.evaluate(place, Interpolation::Smooth, &mut found).unwrap();
        for (&found, factor) in found.iter().zip(&factors) {
            let truth = f64::from(sample) * factor;
            squares += (f64::from(found) / truth - 1.0).powi(2);
            (light, wanted) = (light + f64::from(found), wanted + truth);
        }
    }
    let found = (squares / (2000.0 * 31.0)).sqrt();
    assert!((found / fit(&outcome).fit - 1.0).abs() < 1e-5, "{found}, stated {}", fit(&outcome).fit);
    assert!((light / wanted - 1.0).abs() < 0.003, "{light} {wanted}");
}

#[test]
fn a_luminaire_on_its_grid_shares_the_error_with_its_spectrum() {
    let bytes = |name: &str| std::fs::read(crate::root().join("data").join(name)).unwrap();
    let (lamp, spectrum) = (bytes("aerolamp.ies"), bytes("aerolamp.csv"));
    let made = |bytes: &[u8], spectrum: Option<&[u8]>| {
        let input = Input { bytes, spectrum, interpretation: &Interpretation::default() };
        let request = Request { domain: Some(DirectionDomain::Grid), metadata: false, ..Request::er_l2(0.01) };
        let request = if bytes == lamp { request } else { Request { domain: None, ..request } };
        let source = read(&input).unwrap();
        let outcome = source.compress(&request).unwrap();
        (source, outcome)
    };
    let (source, joined) = made(&lamp, Some(&spectrum));
    let (directions, lambdas) = (37 * 33, source.acquisition.spectral_factor.as_ref().unwrap().grid.len());
    assert_eq!(joined.report.errors.samples, (directions * lambdas) as u64);
    assert!(joined.report.errors.er_l2 <= 0.01 && joined.report.errors_at.is_some());
    let apart = made(&lamp, None).1.bytes.len() + made(&spectrum, None).1.bytes.len();
    // Each of the two has a part of the error only, so that they take more together.
    assert!(5 * joined.bytes.len() < 7 * apart, "{} B joined, {apart} B apart", joined.bytes.len());
    let decoded = wavelume_core::compress::decode(&joined.bytes).unwrap().measurement.tensor;
    let request = AxesRequest { domain: Some(DirectionDomain::Grid), ..AxesRequest::default() };
    let stated = project(&source.acquisition, &request).unwrap().measurement.tensor;
    let sum = |tensor: &Tensor| tensor.samples().iter().map(|&s| f64::from(s)).sum::<f64>();
    let light = sum(&decoded) / sum(&stated) - 1.0;
    // As much as the flux of a luminaire may differ.
    assert!(light.abs() < 0.003, "{light}");
}
