//! Tests of scattered samples: identities first, then the ways in which instruments scan.

use super::super::{AxesRequest, Projected, ProjectionError, Rejected, project};
use super::cloud::slope;
use crate::domain::vector::Vector;
use crate::domain::{Axis, AxisError, Direction, Domain, Quantity, TensorError, TriangleMesh, WavelengthGrid};
use crate::formats::{Acquisition, Instrument, ParseReport, Samples, Scattered};

pub(super) fn acquisition(quantity: Quantity, scattered: Scattered) -> Acquisition {
    Acquisition {
        format: "test",
        dialect: String::new(),
        quantity,
        unit: quantity.default_unit(),
        samples: Samples::Scattered(scattered),
        spectral_factor: None,
        instrument: Instrument::default(),
        report: ParseReport::default(),
    }
}

/// Returns evenly distributed points with coordinates between 0 and 1 (the R2 sequence, Roberts 2018).
fn square(i: usize) -> [f64; 2] {
    [0.754_877_666_246_693, 0.569_840_290_998_053].map(|step| (0.5 + i as f64 * step).fract())
}

/// Returns pseudo-random noise with a standard deviation of about 1.
pub(super) fn noise(i: usize) -> f64 {
    let even = |k: u32| {
        let mixed = (i as u32).wrapping_mul(0x9e37_79b9).wrapping_add(k).wrapping_mul(0x85eb_ca6b);
        f64::from((mixed ^ (mixed >> 13)).wrapping_mul(0xc2b2_ae35) >> 8) / f64::from(1 << 24)
    };
    (0..12).map(even).sum::<f64>() - 6.0
}

/// Returns outgoing directions uniform in solid angle from the normal down to the polar angle `lowest`, in degrees.
pub(super) fn uniform(count: usize, lowest: f64) -> Vec<[f64; 2]> {
    let low = lowest.to_radians().cos();
    let angles = |[u, v]: [f64; 2]| [(low + (1.0 - low) * u).acos().to_degrees(), 360.0 * v];
    (0..count).map(|i| angles(square(i))).collect()
}

/// Test data: an isotropic BRDF `f(wi, wo)` at the `outgoing` directions under each incoming polar angle.
pub(super) fn isotropic(elevations: &[f64], outgoing: &[[f64; 2]], f: impl Fn(Vector, Vector) -> f64) -> Acquisition {
    let mut scattered =
        Scattered { incoming: vec![], outgoing: vec![], isotropic: true, spectral: None, values: vec![], sigma: None };
    for &theta in elevations {
        for &[theta_o, phi_o] in outgoing {
            scattered.incoming.push([theta, 0.0]);
            scattered.outgoing.push([theta_o, phi_o]);
            let wi = Direction::from_degrees(theta, 0.0).xyz();
            scattered.values.push(f(wi, Direction::from_degrees(theta_o, phi_o).xyz()) as f32);
        }
    }
    acquisition(Quantity::Brdf, scattered)
}

pub(super) fn scattered(acquisition: &mut Acquisition) -> &mut Scattered {
    match &mut acquisition.samples {
        Samples::Scattered(scattered) => scattered,
        _ => panic!("scattered samples"),
    }
}

fn level(level: u8) -> AxesRequest {
    AxesRequest { outgoing_level: Some(level), ..AxesRequest::default() }
}

fn mesh(projected: &Projected) -> TriangleMesh {
    match projected.measurement.tensor.axes().iter().rfind(|axis| matches!(axis, Axis::Triangles(_))) {
        Some(Axis::Triangles(mesh)) => *mesh,
        other => panic!("{other:?}"),
    }
}

/// Test BRDF: a glossy lobe on a diffuse base.
fn gloss(wi: Vector, wo: Vector) -> f64 {
    let [x, y] = slope(wi, wo);
    let lobe = if x.is_nan() { 0.0 } else { (1.0 + (x * x + y * y) / 0.09).powi(-2) };
    0.1 + lobe
}

/// Returns the root mean square of the relative errors of triangle values against the means of the BRDF `f` over the
/// triangles, under the incoming polar angles `wi`. Masked triangles do not count.
fn error(projected: &Projected, wi: &[f64], f: impl Fn(Vector, Vector) -> f64, wanted: impl Fn(usize) -> bool) -> f64 {
    let mesh = mesh(projected);
    let samples = projected.measurement.tensor.samples();
    let (mut sum, mut count) = (0.0, 0.0_f64);
    for (i, &sample) in samples.iter().enumerate().filter(|(i, s)| !s.is_nan() && wanted(*i)) {
        let wi = Direction::from_degrees(wi[i / mesh.len()], 0.0).xyz();
        let finer = TriangleMesh::new(mesh.domain(), mesh.level() + 2).unwrap();
        let cell = i % mesh.len();
        let parts = 16 * cell..16 * (cell + 1);
        let truth = parts.map(|part| f(wi, finer.centroid(part).xyz())).sum::<f64>() / 16.0;
        sum += (f64::from(sample) / truth - 1.0).powi(2);
        count += 1.0;
    }
    (sum / count).sqrt()
}

fn refusal(acquisition: &Acquisition, request: &AxesRequest) -> ProjectionError {
    project(acquisition, request).unwrap_err()
}

#[test]
fn constants_stay_exactly() {
    let acquired = isotropic(&[0.0, 40.0], &uniform(1500, 90.0), |_, _| f64::from(0.3_f32));
    let projected = project(&acquired, &AxesRequest::default()).unwrap();
    assert!(projected.measurement.tensor.samples().iter().all(|&s| s == 0.3));
    assert_eq!(projected.measurement.tensor.axes()[0], Axis::Elevation(vec![0.0, 40.0]));
    let report = projected.coverage.scatter.unwrap();
    assert_eq!((report.samples, report.noise, report.rejected), (3000, Some(0.0), Rejected::default()));
}

#[test]
fn exponentials_of_quadratics_in_slopes_are_fitted_exactly() {
    let f = |wi: Vector, wo: Vector| {
        let [x, y] = slope(wi, wo);
        (0.3 + 0.7 * x - 0.2 * y - 2.0 * x * x + 0.4 * x * y - 1.1 * y * y).exp()
    };
    let acquired = isotropic(&[30.0], &uniform(3000, 60.0), f);
    let projected = project(&acquired, &level(4)).unwrap();
    let mesh = mesh(&projected);
    let wi = Direction::from_degrees(30.0, 0.0).xyz();
    let finer = TriangleMesh::new(Domain::Hemisphere, 5).unwrap();
    for (cell, &sample) in projected.measurement.tensor.samples().iter().enumerate() {
        if sample.is_nan() || mesh.centroid(cell).theta_degrees() > 55.0 {
            continue;
        }
        let parts = 4 * cell..4 * cell + 4;
        let area: f64 = parts.clone().map(|part| finer.solid_angle(part)).sum();
        let truth: f64 = parts.map(|part| finer.solid_angle(part) * f(wi, finer.centroid(part).xyz())).sum();
        assert!((f64::from(sample) * area / truth - 1.0).abs() < 2e-5, "{cell}");
    }
    let report = projected.coverage.scatter.unwrap();
    assert!(report.noise < Some(1e-5), "{report:?}");
}

#[test]
fn scans_in_a_plane_fill_nothing_beside_it() {
    let plane: Vec<[f64; 2]> = (-80..=80_i32).map(|t| [f64::from(t.abs()), if t < 0 { 180.0 } else { 0.0 }]).collect();
    let acquired = isotropic(&[0.0, 30.0, 60.0], &plane, gloss);
    let projected = project(&acquired, &level(5)).unwrap();
    let mesh = mesh(&projected);
    let coverage = &projected.coverage;
    assert!(coverage.measured > 150 && coverage.empty > 10 * coverage.measured, "{coverage:?}");
    for (i, sample) in projected.measurement.tensor.samples().iter().enumerate().filter(|(_, s)| !s.is_nan()) {
        let wo = mesh.centroid(i % mesh.len());
        let beside = wo.xyz()[1].abs();
        assert!((0.09..1.2).contains(sample), "{i}: {sample}");
        // At normal incidence all azimuths are one plane: reciprocity may turn it.
        if beside >= 0.15 {
            let wi = Direction::from_degrees([0.0, 30.0, 60.0][i / mesh.len()], 0.0).xyz();
            let truth = gloss(wi, wo.xyz());
            assert!((f64::from(*sample) / truth - 1.0).abs() < 0.15, "{i}: {sample} at {beside}, not {truth}");
        }
    }
}

#[test]
fn spirals_are_interpolated_between_their_turns() {
    let spiral: Vec<[f64; 2]> = (0..6000)
        .map(|i| {
            let t = f64::from(i) / 6000.0;
            [89.5 * t.sqrt(), (t.sqrt() * 28.0 * 360.0) % 360.0]
        })
        .collect();
    let elevations = [20.0];
    let projected = project(&isotropic(&elevations, &spiral, gloss), &level(4)).unwrap();
    let coverage = &projected.coverage;
    assert!(coverage.filled < coverage.cells / 20, "{coverage:?}");
    let error = error(&projected, &elevations, gloss, |_| true);
    assert!(error < 0.02, "{error}");
}

#[test]
fn adaptive_grids_are_finer_where_they_are_dense() {
    let mut directions = uniform(1200, 90.0);
    // A cap of 12° around the mirror direction at 40°.
    let mirror = Direction::from_degrees(40.0, 180.0);
    directions.extend(
        uniform(30_000, 90.0)
            .into_iter()
            .skip(1200)
            .filter(|&[t, p]| Direction::from_degrees(t, p).dot(mirror) > 12_f64.to_radians().cos()),
    );
    let sharp = |wi: Vector, wo: Vector| {
        let [x, y] = slope(wi, wo);
        let lobe = if x.is_nan() { 0.0 } else { (1.0 + (x * x + y * y) / 0.01).powi(-2) };
        0.1 + lobe
    };
    let projected = project(&isotropic(&[40.0], &directions, sharp), &level(5)).unwrap();
    let mesh = mesh(&projected);
    let near = |i: usize| mesh.centroid(i).dot(mirror) > 10_f64.to_radians().cos();
    let (inside, outside) = (error(&projected, &[40.0], sharp, near), error(&projected, &[40.0], sharp, |i| !near(i)));
    assert!(inside < 0.01 && outside < 0.05, "{inside} {outside}");
}

#[test]
fn blind_spots_are_filled_and_marked() {
    let wi = Direction::from_degrees(40.0, 0.0);
    let away = |degrees: f64| move |wo: Direction| wo.dot(wi) < degrees.to_radians().cos();
    let outgoing: Vec<[f64; 2]> =
        uniform(8000, 90.0).into_iter().filter(|&[t, p]| away(5.0)(Direction::from_degrees(t, p))).collect();
    let acquired = isotropic(&[40.0], &outgoing, gloss);
    let projected = project(&acquired, &level(5)).unwrap();
    let (mesh, coverage) = (mesh(&projected), &projected.coverage);
    assert_eq!(projected.filled.len() as u64, coverage.cells);
    assert_eq!(projected.filled.iter().filter(|filled| **filled).count() as u64, coverage.filled);
    assert_eq!(coverage.measured + coverage.interpolated + coverage.filled + coverage.empty, coverage.cells);
    for cell in (0..mesh.len()).filter(|&cell| !away(2.0)(mesh.centroid(cell))) {
        assert!(projected.filled[cell], "{cell}");
    }
    assert!(projected.filled.iter().filter(|filled| **filled).count() < 120, "{coverage:?}");
    assert!(error(&projected, &[40.0], gloss, |cell| projected.filled[cell]) < 0.02);
    // The mirror image of a hole on one side of the plane is no hole.
    let beside = Direction::from_degrees(30.0, 90.0);
    let outgoing: Vec<[f64; 2]> = uniform(8000, 90.0)
        .into_iter()
        .filter(|&[t, p]| Direction::from_degrees(t, p).dot(beside) < 12_f64.to_radians().cos())
        .collect();
    let projected = project(&isotropic(&[40.0], &outgoing, gloss), &level(5)).unwrap();
    assert!(
        projected.coverage.notes.iter().any(|note| note.message.contains("mirror images")),
        "{:?}",
        projected.coverage.notes
    );
    assert_eq!(projected.coverage.empty, 0);
    assert!(error(&projected, &[40.0], gloss, |cell| projected.filled[cell]) < 0.01);
}

#[test]
fn bilateral_data_are_unfolded() {
    let half: Vec<[f64; 2]> = uniform(8000, 90.0).into_iter().filter(|[_, phi]| *phi <= 180.0).collect();
    let elevations = [10.0, 50.0];
    let projected = project(&isotropic(&elevations, &half, gloss), &level(4)).unwrap();
    assert!(projected.coverage.notes.iter().any(|note| note.message.contains("mirror image")));
    assert_eq!(projected.coverage.empty, 0);
    assert!(error(&projected, &elevations, gloss, |_| true) < 0.01);
}

#[test]
fn outliers_do_not_count() {
    let mut acquired = isotropic(&[25.0], &uniform(4000, 90.0), gloss);
    for (i, value) in scattered(&mut acquired).values.iter_mut().enumerate() {
        *value *= 1.0 + 0.01 * noise(i) as f32;
        if i % 50 == 7 {
            *value *= if i % 100 == 7 { 10.0 } else { 0.05 };
        }
    }
    let projected = project(&acquired, &level(4)).unwrap();
    let found = error(&projected, &[25.0], gloss, |_| true);
    assert!(found < 0.012, "{found}");
    let report = projected.coverage.scatter.unwrap();
    // Every fiftieth sample, each far from the others, and no other.
    assert!(report.rejected.values == 80 && (report.rejected.samples - 0.02).abs() < 1e-9, "{report:?}");
    assert!(report.noise.is_some_and(|noise| (noise / 0.01 - 1.0).abs() < 0.25), "{report:?}");
}

#[test]
fn stated_uncertainties_weigh() {
    let mut acquired = isotropic(&[25.0], &uniform(4000, 90.0), gloss);
    let mut sigma = Vec::new();
    for (i, value) in scattered(&mut acquired).values.iter_mut().enumerate() {
        let relative = if i % 3 == 0 { 0.002 } else { 0.1 };
        sigma.push(*value * relative);
        *value *= 1.0 + relative * noise(i) as f32;
    }
    let plain = error(&project(&acquired, &level(4)).unwrap(), &[25.0], gloss, |_| true);
    scattered(&mut acquired).sigma = Some(sigma);
    let weighed = error(&project(&acquired, &level(4)).unwrap(), &[25.0], gloss, |_| true);
    assert!(weighed < 0.01 && weighed < 0.4 * plain, "{weighed} {plain}");
}

#[test]
fn the_same_relative_uncertainty_everywhere_says_nothing() {
    let mut acquired = isotropic(&[25.0], &uniform(3000, 90.0), gloss);
    let plain = project(&acquired, &level(4)).unwrap().measurement.tensor;
    let sigma = scattered(&mut acquired).values.iter().map(|value| 0.25 * value).collect();
    scattered(&mut acquired).sigma = Some(sigma);
    let weighed = project(&acquired, &level(4)).unwrap().measurement.tensor;
    let apart = plain.samples().iter().zip(weighed.samples()).map(|(a, b)| (a - b).abs() / a).fold(0.0, f32::max);
    assert!(apart < 1e-4, "{apart}");
}

#[test]
fn missing_bands_are_left_out_and_negative_values_kept() {
    let outgoing = uniform(2000, 90.0);
    let mut acquired = isotropic(&[20.0], &outgoing, gloss);
    let data = scattered(&mut acquired);
    data.spectral = Some(Axis::Wavelength(WavelengthGrid::even(400.0, 100.0, 3).unwrap()));
    let one = std::mem::take(&mut data.values);
    for (i, value) in one.iter().enumerate() {
        let second = if i % 7 == 3 { f32::NAN } else { 2.0 * value };
        data.values.extend([*value, second, 1e-3 * noise(i) as f32]);
    }
    let projected = project(&acquired, &level(3)).unwrap();
    let report = projected.coverage.scatter.as_ref().unwrap();
    assert!(report.missing == 286 && report.negative > 900, "{report:?}");
    for spectrum in projected.measurement.tensor.samples().chunks(3) {
        assert!((spectrum[1] / spectrum[0] - 2.0).abs() < 0.02, "{spectrum:?}");
        assert!(spectrum[2].abs() < 1e-3, "{spectrum:?}");
    }
    assert!(projected.measurement.tensor.samples().iter().any(|&s| s < 0.0));
}

#[test]
fn reciprocal_directions_fill_what_is_out_of_reach() {
    let elevations: Vec<f64> = (0..=16).map(|i| 5.0 * f64::from(i)).collect();
    let projected = project(&isotropic(&elevations, &uniform(1500, 50.0), gloss), &level(4)).unwrap();
    assert!(
        projected.coverage.notes.iter().any(|note| note.message.contains("reciprocity")),
        "{:?}",
        projected.coverage.notes
    );
    let mesh = mesh(&projected);
    let far = |i: usize| projected.filled[i] && mesh.centroid(i % mesh.len()).theta_degrees() > 60.0;
    assert!((0..projected.filled.len()).any(far));
    let found = error(&projected, &elevations, gloss, far);
    assert!(found < 0.05, "{found}");
}

#[test]
fn many_incoming_directions_are_fitted_together() {
    let (ins, outs) = (uniform(20_000, 80.0), uniform(20_000, 85.0));
    let mut scattered = Scattered {
        incoming: (0..20_000).map(|i| ins[i * 7919 % 20_000]).collect(),
        outgoing: outs,
        isotropic: false,
        spectral: None,
        values: vec![],
        sigma: None,
    };
    let smooth = |wi: Vector, wo: Vector| {
        let [x, y] = slope(wi, wo);
        0.2 + 0.5 * (-x * x - 2.0 * y * y).exp() * (1.0 + 0.2 * wi[0])
    };
    let d = |[theta, phi]: [f64; 2]| Direction::from_degrees(theta, phi).xyz();
    scattered.values =
        scattered.incoming.iter().zip(&scattered.outgoing).map(|(&i, &o)| smooth(d(i), d(o)) as f32).collect();
    let mut acquired = acquisition(Quantity::Brdf, scattered);
    let projected = project(&acquired, &AxesRequest::default()).unwrap();
    let [Axis::Triangles(incoming), Axis::Triangles(outgoing)] = projected.measurement.tensor.axes() else { panic!() };
    let (mut sum, mut count) = (0.0, 0.0_f64);
    for (i, &sample) in projected.measurement.tensor.samples().iter().enumerate().filter(|(_, s)| !s.is_nan()) {
        let truth = smooth(incoming.centroid(i / outgoing.len()).xyz(), outgoing.centroid(i % outgoing.len()).xyz());
        sum += (f64::from(sample) / truth - 1.0).powi(2);
        count += 1.0;
    }
    let cells = projected.measurement.tensor.len() as f64;
    assert!((sum / count).sqrt() < 0.1 && count > 0.5 * cells, "{} of {count} of {cells}", (sum / count).sqrt());
    // Like isotropic data with a separate elevation for each.
    let data = self::scattered(&mut acquired);
    data.isotropic = true;
    let projected = project(&acquired, &level(3)).unwrap();
    assert!(matches!(&projected.measurement.tensor.axes()[0], Axis::Elevation(values) if values.len() > 5));
    assert!(projected.measurement.tensor.samples().iter().all(|s| s.is_nan() || (0.1..0.9).contains(s)));
}

#[test]
fn intensities_are_scattered_over_the_sphere() {
    let data = Scattered {
        incoming: vec![],
        outgoing: uniform(3000, 180.0),
        isotropic: false,
        spectral: None,
        values: uniform(3000, 180.0).iter().map(|[t, _]| (2.0 + t.to_radians().cos()) as f32).collect(),
        sigma: None,
    };
    let projected = project(&acquisition(Quantity::Edf, data), &level(3)).unwrap();
    let mesh = mesh(&projected);
    assert_eq!((mesh.domain(), projected.coverage.empty), (Domain::Sphere, 0));
    for (cell, &sample) in projected.measurement.tensor.samples().iter().enumerate() {
        assert!((f64::from(sample) - 2.0 - mesh.centroid(cell).cos_theta()).abs() < 0.02, "{cell}: {sample}");
    }
}

#[test]
fn threads_do_not_change_a_bit() {
    let mut acquired = isotropic(&[0.0, 30.0], &uniform(900, 80.0), gloss);
    for (i, value) in scattered(&mut acquired).values.iter_mut().enumerate() {
        *value *= 1.0 + 0.05 * noise(i) as f32;
    }
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let projected = project(&acquired, &AxesRequest::default()).unwrap();
            let bits: Vec<u32> = projected.measurement.tensor.samples().iter().map(|s| s.to_bits()).collect();
            (bits, projected.coverage, projected.filled)
        })
    };
    assert!(run(1) == run(2));
}

#[test]
fn few_samples_and_one_place_are_no_reason_to_fail() {
    for count in [1, 2, 3, 5, 9] {
        let projected = project(&isotropic(&[10.0], &uniform(count, 60.0), gloss), &level(2)).unwrap();
        assert!(projected.coverage.measured > 0);
    }
    let projected = project(&isotropic(&[10.0], &[[20.0, 30.0]; 40], gloss), &AxesRequest::default()).unwrap();
    // The sample and its mirror image.
    assert_eq!(projected.coverage.measured, 2);
}

#[test]
fn what_makes_no_sense_is_refused() {
    let good = || isotropic(&[10.0], &uniform(50, 60.0), gloss);
    let unfit = |change: &dyn Fn(&mut Scattered), word: &str| {
        let mut bad = good();
        change(scattered(&mut bad));
        match refusal(&bad, &AxesRequest::default()) {
            ProjectionError::Scattered(error) => assert!(error.to_string().contains(word), "{error}"),
            other => panic!("{other}"),
        }
    };
    unfit(&|data| data.incoming.truncate(3), "3 incoming directions, expected 50 or none");
    unfit(&|data| data.outgoing[7] = [f64::NAN, 0.0], "outgoing theta NaN, phi 0 degrees of sample 7");
    unfit(&|data| data.outgoing.iter_mut().for_each(|wo| wo[0] = 120.0), "no sample of the 50 lies on the hemisphere");
    unfit(&|data| data.values.fill(f32::NAN), "no sample of the 50");
    unfit(
        &|data| (data.incoming, data.outgoing, data.values) = (vec![], vec![], vec![]),
        "the file contains no sample, expected at least one",
    );
    let mut bad = good();
    scattered(&mut bad).values.pop();
    let error = refusal(&bad, &AxesRequest::default());
    assert!(matches!(error, ProjectionError::Tensor(TensorError::Count { found: 49, expected: 50, .. })));
    scattered(&mut bad).values.push(f32::INFINITY);
    let error = refusal(&bad, &AxesRequest::default());
    assert!(matches!(error, ProjectionError::Tensor(TensorError::Infinite { index: 49 })));
    scattered(&mut bad).values[49] = 1.0;
    scattered(&mut bad).sigma = Some(vec![1.0; 3]);
    let error = refusal(&bad, &AxesRequest::default());
    assert!(matches!(error, ProjectionError::Tensor(TensorError::Count { found: 3, expected: 50, .. })));
    let levels = AxesRequest { incoming_level: Some(1), ..AxesRequest::default() };
    assert!(refusal(&good(), &levels).to_string().contains("isotropic (1 elevation)"));
    assert!(refusal(&good(), &level(9)).to_string().contains("above the limit of 8"));
    let mut lamp = good();
    (lamp.quantity, scattered(&mut lamp).incoming) = (Quantity::Edf, vec![]);
    assert!(refusal(&lamp, &levels).to_string().contains("no incoming directions"));
    let mut lone = good();
    scattered(&mut lone).incoming = vec![];
    assert!(matches!(refusal(&lone, &AxesRequest::default()), ProjectionError::Axes(AxisError::Unfit { .. })));
}
