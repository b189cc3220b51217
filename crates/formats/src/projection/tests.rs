//! Tests of whole projections.

use super::*;
use crate::domain::{
    Axis, AxisError, Direction, Domain, Quantity, Sampling, Tensor, TensorError, TriangleMesh, Unit, WavelengthGrid,
};
use crate::formats::{AngleGrid, Angles, AzimuthExtent, Azimuths, Instrument, Outside, ParseReport, SpectralFactor};

fn steps(from: f64, step: f64, count: usize) -> Vec<f64> {
    (0..count).map(|i| from + step * i as f64).collect()
}

fn angles(theta: Vec<f64>, covers: (f64, f64), phi: Option<(Vec<f64>, AzimuthExtent)>) -> Angles {
    Angles { theta, covers, phi: phi.map(|(phi, extent)| Azimuths { phi, extent }) }
}

fn acquisition(quantity: Quantity, samples: Samples) -> Acquisition {
    Acquisition {
        format: "test",
        dialect: String::new(),
        quantity,
        unit: quantity.default_unit(),
        samples,
        spectral_factor: None,
        instrument: Instrument::default(),
        report: ParseReport::default(),
    }
}

fn edf(outgoing: Angles, outside: Outside, f: impl Fn(f64, f64) -> f32) -> Acquisition {
    let phi = outgoing.phi.as_ref().map_or(vec![0.0], |azimuths| azimuths.phi.clone());
    let values = outgoing.theta.iter().flat_map(|&t| phi.iter().map(move |&p| (t, p))).map(|(t, p)| f(t, p)).collect();
    let grid = AngleGrid {
        index: vec![],
        incoming: None,
        outgoing: Some(outgoing),
        spectral: None,
        outside,
        values,
        stated: None,
        sigma: None,
    };
    acquisition(Quantity::Edf, Samples::Grid(grid))
}

/// Test data: an anisotropic BRDF with colour channels, given by `f(wi, wo, channel)`.
fn brdf(f: impl Fn(Direction, Direction, usize) -> f32) -> Acquisition {
    let incoming = angles(steps(0.0, 15.0, 7), (0.0, 90.0), Some((steps(0.0, 30.0, 12), AzimuthExtent::Circle)));
    let outgoing = angles(steps(0.0, 10.0, 10), (0.0, 90.0), Some((steps(0.0, 20.0, 18), AzimuthExtent::Circle)));
    let all = |a: &Angles| -> Vec<Direction> {
        let phi = &a.phi.as_ref().unwrap().phi;
        a.theta.iter().flat_map(|&t| phi.iter().map(move |&p| Direction::from_degrees(t, p))).collect()
    };
    let mut values = Vec::new();
    for &wi in &all(&incoming) {
        for &wo in &all(&outgoing) {
            values.extend((0..3).map(|c| f(wi, wo, c)));
        }
    }
    let grid = AngleGrid {
        index: vec![],
        incoming: Some(incoming),
        outgoing: Some(outgoing),
        spectral: Some(Axis::Rgb),
        outside: Outside::Masked,
        values: values.into(),
        stated: None,
        sigma: None,
    };
    acquisition(Quantity::Brdf, Samples::Grid(grid))
}

fn whole(step: f64) -> Angles {
    let rows = (180.0 / step) as usize + 1;
    angles(steps(0.0, step, rows), (0.0, 180.0), Some((steps(0.0, 2.0 * step, rows - 1), AzimuthExtent::Circle)))
}

fn grid_of(acquisition: &mut Acquisition) -> &mut AngleGrid {
    match &mut acquisition.samples {
        Samples::Grid(grid) => grid,
        _ => panic!("a grid"),
    }
}

/// Axes request that demands triangles of directions.
fn triangles() -> AxesRequest {
    AxesRequest { domain: Some(DirectionDomain::Triangles), ..AxesRequest::default() }
}

fn levels(incoming: Option<u8>, outgoing: Option<u8>) -> AxesRequest {
    AxesRequest { incoming_level: incoming, outgoing_level: outgoing, ..AxesRequest::default() }
}

fn wavelengths(range: &str) -> AxesRequest {
    AxesRequest { wavelengths: Some(WavelengthGrid::parse_range(range).unwrap()), ..triangles() }
}

fn refusal(acquisition: &Acquisition, request: &AxesRequest) -> String {
    match project(acquisition, request) {
        Err(error) => error.to_string(),
        other => panic!("expected a refusal, found {other:?}"),
    }
}

fn mesh(domain: Domain, level: u8) -> TriangleMesh {
    TriangleMesh::new(domain, level).unwrap()
}

#[test]
fn constants_stay_exactly() {
    let projected = project(&edf(whole(10.0), Outside::Zero, |_, _| 0.1), &triangles()).unwrap();
    assert!(projected.measurement.tensor.samples().iter().all(|&s| s == 0.1));
    let projected = project(&brdf(|_, _, c| 0.3 + c as f32), &levels(Some(1), Some(2))).unwrap();
    let samples = projected.measurement.tensor.samples();
    assert_eq!(samples.len(), 16 * 64 * 3);
    assert!(samples.chunks(3).all(|s| s == [0.3, 1.3, 2.3]));
    assert_eq!(projected.measurement.sampling, Sampling::Average);
    assert_eq!(projected.coverage.empty, 0);
    let errors = error_at_samples(&brdf(|_, _, c| 0.3 + c as f32), &projected.measurement).unwrap();
    assert_eq!((errors.samples, errors.max_absolute_error, errors.mask_mismatches), (84 * 180 * 3, 0.0, 0));
}

#[test]
fn both_directions_of_a_brdf_are_averaged() {
    let acquired = brdf(|wi, wo, c| (wi.cos_theta() * wo.xyz()[0] + c as f64) as f32);
    let projected = project(&acquired, &levels(Some(2), Some(2))).unwrap();
    let m = mesh(Domain::Hemisphere, 2);
    let fine = mesh(Domain::Hemisphere, 6);
    let brdf = projected.measurement.as_brdf().unwrap();
    for ti in 0..m.len() {
        let z = m.projected_solid_angle(ti) / m.solid_angle(ti);
        for to in 0..m.len() {
            let children = to * 256..(to + 1) * 256;
            let x: f64 =
                children.map(|i| fine.solid_angle(i) * fine.centroid(i).xyz()[0]).sum::<f64>() / m.solid_angle(to);
            for (c, &value) in brdf.at(ti).at(to).samples().iter().enumerate() {
                // Linear between samples 15° × 30° and 10° × 20° apart.
                assert!((f64::from(value) - (z * x + c as f64)).abs() < 0.04, "{ti} {to} {c}: {value} vs {}", z * x);
            }
        }
    }
}

#[test]
fn mirrored_data_are_the_full_circle() {
    let f = |t: f64, p: f64| (1.0 + (t / 40.0).cos() + 0.3 * p.to_radians().cos()) as f32;
    let full = edf(whole(10.0), Outside::Masked, f);
    let mut half = whole(10.0);
    half.phi = Some(Azimuths { phi: steps(0.0, 20.0, 10), extent: AzimuthExtent::Mirrored });
    let half = edf(half, Outside::Masked, f);
    let request = levels(None, Some(4));
    let (a, b) = (project(&full, &request).unwrap(), project(&half, &request).unwrap());
    for (a, b) in a.measurement.tensor.samples().iter().zip(b.measurement.tensor.samples()) {
        assert!((a - b).abs() <= 1e-6 * a.abs(), "{a} {b}");
    }
    assert_eq!((a.coverage.cells, a.coverage.empty), (2048, 0));
    let counts = |p: &Projected| (p.coverage.cells, p.coverage.measured, p.coverage.interpolated, p.coverage.empty);
    let (a, b) = (counts(&a), counts(&b));
    assert!(a.1.abs_diff(b.1) <= 40 && a.1 + a.2 == 2048 && b.1 + b.2 == 2048, "{a:?} {b:?}");
}

#[test]
fn outside_is_zero_or_masked_as_the_format_says() {
    let downlight = |outside| {
        let phi = Some((steps(0.0, 30.0, 12), AzimuthExtent::Circle));
        edf(angles(steps(90.0, 10.0, 10), (90.0, 180.0), phi), outside, |_, _| 2.0)
    };
    let zero = project(&downlight(Outside::Zero), &triangles()).unwrap();
    let samples = zero.measurement.tensor.samples();
    let half = samples.len() / 2;
    assert!(samples[..half].iter().all(|&s| s == 0.0) && samples[half..].iter().all(|&s| s == 2.0));
    assert_eq!(zero.coverage.empty, half as u64);
    assert!(
        zero.coverage.notes.iter().any(|n| n.message.contains("outside theta 90° to 180° are 0")),
        "{:?}",
        zero.coverage.notes
    );
    let masked = project(&downlight(Outside::Masked), &triangles()).unwrap();
    let samples = masked.measurement.tensor.samples();
    assert!(samples[..half].iter().all(|s| s.is_nan()) && samples[half..].iter().all(|&s| s == 2.0));
    // Samples at theta 90° exactly belong to the lower half, where they were measured.
    let errors = error_at_samples(&downlight(Outside::Zero), &zero.measurement).unwrap();
    assert_eq!((errors.samples, errors.max_absolute_error), (120, 0.0));
    let errors = error_at_samples(&downlight(Outside::Masked), &masked.measurement).unwrap();
    assert_eq!((errors.mask_mismatches, errors.max_absolute_error), (0, 0.0));
}

#[test]
fn a_cell_partly_outside_is_diluted_by_zeros_or_averages_what_is_covered() {
    let cone = |outside| edf(angles(steps(120.0, 10.0, 7), (120.0, 180.0), None), outside, |_, _| 1.0);
    let request = levels(None, Some(3));
    let zero = project(&cone(Outside::Zero), &request).unwrap().measurement;
    let masked = project(&cone(Outside::Masked), &request).unwrap().measurement;
    let angles = mesh(Domain::Sphere, 3).solid_angles();
    let flux: f64 = zero.tensor.samples().iter().zip(&angles).map(|(&s, a)| f64::from(s) * a).sum();
    // The cone of 60° about nadir: 2π(1 − cos 60°) sr, up to the parts that its rim cuts.
    assert!((flux / std::f64::consts::PI - 1.0).abs() < 2e-3, "{flux}");
    let mut diluted = 0;
    for (&z, &m) in zero.tensor.samples().iter().zip(masked.tensor.samples()) {
        assert!(m.is_nan() && z == 0.0 || m == 1.0 && z > 0.0 && z <= 1.0, "{z} {m}");
        diluted += usize::from(z > 0.0 && z < 1.0);
    }
    assert!(diluted > 8);
}

#[test]
fn sectors_are_masked_beyond_their_ends() {
    let sector = angles(steps(0.0, 10.0, 10), (0.0, 90.0), Some((steps(0.0, 10.0, 10), AzimuthExtent::Sector)));
    let mut acquired = edf(sector, Outside::Masked, |_, _| 1.0);
    acquired.quantity = Quantity::Edf;
    let projected = project(&acquired, &levels(None, Some(2))).unwrap();
    let m = mesh(Domain::Sphere, 2);
    for (i, s) in projected.measurement.tensor.samples().iter().enumerate() {
        let inside = i < 16;
        assert_eq!(s.is_nan(), !inside, "{i} {:?}", m.centroid(i));
    }
    let errors = error_at_samples(&acquired, &projected.measurement).unwrap();
    assert_eq!((errors.samples, errors.mask_mismatches), (100, 0));
}

#[test]
fn flux_is_the_grids_own_quadrature() {
    let f = |t: f64, p: f64| (100.0 * (1.0 + t.to_radians().cos()) + 20.0 * p.to_radians().sin() + 30.0) as f32;
    let mut acquired = edf(whole(5.0), Outside::Zero, f);
    let projected = project(&acquired, &triangles()).unwrap();
    let m = mesh(Domain::Sphere, 4);
    let Axis::Triangles(chosen) = &projected.measurement.tensor.axes()[0] else { panic!() };
    assert_eq!(chosen.level(), m.level());
    let samples = projected.measurement.tensor.samples();
    let flux: f64 = samples.iter().zip(m.solid_angles()).map(|(&s, a)| f64::from(s) * a).sum();
    // Linear in theta between rows, constant weight for every azimuth: the integral of t·sin t by parts, numerically.
    let grid = grid_of(&mut acquired);
    let row_mean = |r: usize| grid.values[r * 36..(r + 1) * 36].iter().map(|&v| f64::from(v)).sum::<f64>() / 36.0;
    let n = 18_000;
    let expected: f64 = (0..n)
        .map(|i| {
            let t = (f64::from(i) + 0.5) * 180.0 / f64::from(n);
            let (r, w) = ((t / 5.0) as usize, t / 5.0 % 1.0);
            ((1.0 - w) * row_mean(r) + w * row_mean(r + 1)) * t.to_radians().sin()
        })
        .sum::<f64>()
        * 2.0
        * std::f64::consts::PI
        * (std::f64::consts::PI / f64::from(n));
    assert!((flux / expected - 1.0).abs() < 1e-4, "{flux} vs {expected}");
}

#[test]
fn isotropic_elevations_stay_and_transmission_goes_down() {
    let incoming = angles(vec![0.0, 20.0, 75.0], (0.0, 75.0), None);
    let outgoing = angles(steps(90.0, 10.0, 10), (90.0, 180.0), Some((steps(0.0, 30.0, 7), AzimuthExtent::Mirrored)));
    let values: Vec<f32> = (0..3).flat_map(|i| vec![i as f32; 70]).collect();
    let grid = AngleGrid {
        index: vec![],
        incoming: Some(incoming),
        outgoing: Some(outgoing),
        spectral: None,
        outside: Outside::Masked,
        values: values.into(),
        stated: None,
        sigma: None,
    };
    let acquired = acquisition(Quantity::Btdf, Samples::Grid(grid));
    let projected = project(&acquired, &levels(None, Some(1))).unwrap();
    let axes = projected.measurement.tensor.axes();
    assert_eq!(axes, [Axis::Elevation(vec![0.0, 20.0, 75.0]), Axis::Triangles(mesh(Domain::Lower, 1))]);
    for (row, samples) in projected.measurement.tensor.samples().chunks(16).enumerate() {
        assert!(samples.iter().all(|&s| s == row as f32));
    }
    assert_eq!((projected.coverage.cells, projected.coverage.empty), (48, 0));
    assert_eq!(
        refusal(&acquired, &levels(Some(2), None)),
        "incoming_level does not fit the data: the data are isotropic (3 elevations), no incoming triangles to choose a level for"
    );
    let errors = error_at_samples(&acquired, &projected.measurement).unwrap();
    assert_eq!((errors.samples, errors.max_absolute_error), (210, 0.0));
}

/// Test data: a BRDF lobe around the mirror direction, measured at the incoming azimuth `phi_i` in scan planes at the
/// outgoing azimuths `phi_o`.
fn scan(phi_i: f64, phi_o: Vec<f64>, extent: AzimuthExtent) -> Acquisition {
    let incoming = angles(steps(0.0, 15.0, 5), (0.0, 60.0), Some((vec![phi_i], AzimuthExtent::Sector)));
    let outgoing = angles(steps(0.0, 5.0, 18), (0.0, 90.0), Some((phi_o, extent)));
    let mut values = Vec::new();
    for &theta_i in &incoming.theta {
        let mirror = Direction::from_degrees(theta_i, phi_i + 180.0).xyz();
        for &theta in &outgoing.theta {
            for &phi in &outgoing.phi.as_ref().unwrap().phi {
                let [x, y, z] = Direction::from_degrees(theta, phi).xyz();
                let cosine = mirror[0] * x + mirror[1] * y + mirror[2] * z;
                values.push((0.1 + (10.0 * (cosine - 1.0)).exp()) as f32);
            }
        }
    }
    let (incoming, outgoing) = (Some(incoming), Some(outgoing));
    let grid = AngleGrid {
        index: vec![],
        incoming,
        outgoing,
        spectral: None,
        outside: Outside::Masked,
        values: values.into(),
        stated: None,
        sigma: None,
    };
    acquisition(Quantity::Brdf, Samples::Grid(grid))
}

#[test]
fn one_incident_azimuth_is_isotropic() {
    let turned = project(&scan(30.0, steps(30.0, 20.0, 18), AzimuthExtent::Circle), &levels(None, Some(3))).unwrap();
    let plain = project(&scan(0.0, steps(0.0, 20.0, 18), AzimuthExtent::Circle), &levels(None, Some(3))).unwrap();
    assert!(matches!(plain.measurement.tensor.axes()[0], Axis::Elevation(_)));
    assert!(plain.coverage.notes[0].message.contains("taken as isotropic"), "{:?}", plain.coverage.notes);
    let pairs = turned.measurement.tensor.samples().iter().zip(plain.measurement.tensor.samples());
    assert!(pairs.clone().all(|(a, b)| a.is_nan() && b.is_nan() || (a - b).abs() < 1e-5));
    let errors = error_at_samples(&scan(30.0, steps(30.0, 20.0, 18), AzimuthExtent::Circle), &turned.measurement);
    assert!(errors.unwrap().er_l2 < 0.4);
}

#[test]
fn nothing_is_known_between_the_planes_of_a_scan() {
    let acquired = scan(0.0, vec![0.0, 180.0], AzimuthExtent::Circle);
    let projected = project(&acquired, &levels(None, Some(4))).unwrap();
    assert!(projected.coverage.notes[0].message.contains("more than 90° apart"), "{:?}", projected.coverage.notes);
    let [_, Axis::Triangles(mesh)] = projected.measurement.tensor.axes() else { panic!("elevations and triangles") };
    let samples = projected.measurement.tensor.samples();
    for (cell, &sample) in samples.iter().enumerate() {
        let [_, y, _] = mesh.centroid(cell % mesh.len()).xyz();
        let marked = sample.is_nan() || projected.filled.get(cell) == Some(&true);
        assert!(y.abs() < 0.3 || marked, "cell {cell} beside the plane: {sample}");
    }
    assert!(samples.iter().any(|s| !s.is_nan()));
    // Scattered samples are compared with an evaluated material, not with cells.
    assert!(projected.scattered.is_some() && error_at_samples(&acquired, &projected.measurement).is_none());
    assert_eq!(scattered_samples(&acquired).unwrap().directions(), projected.scattered.unwrap().len());
    // Without a level they stay the file's own grid.
    for planes in [vec![0.0, 180.0], vec![0.0, 120.0, 240.0]] {
        let acquired = scan(0.0, planes, AzimuthExtent::Circle);
        let kept = project(&acquired, &AxesRequest::default()).unwrap();
        assert!(matches!(kept.measurement.tensor.axes()[1], Axis::Grid(_)) && kept.scattered.is_none());
        assert_eq!(kept.measurement.tensor.samples(), &*grid_of(&mut acquired.clone()).values);
    }
}

#[test]
fn a_single_plane_or_ring_stays_on_its_grid() {
    let half = scan(0.0, vec![180.0], AzimuthExtent::Sector);
    let mut ring = scan(0.0, vec![0.0, 60.0, 120.0, 180.0], AzimuthExtent::Mirrored);
    let grid = grid_of(&mut ring);
    let outgoing = grid.outgoing.as_mut().unwrap();
    (outgoing.theta, outgoing.covers) = (vec![45.0], (45.0, 45.0));
    grid.values = grid.values[..4 * grid.incoming.as_ref().unwrap().theta.len()].to_vec().into();
    for (acquired, outgoing) in [(half, [18, 1]), (ring, [1, 4])] {
        let projected = project(&acquired, &AxesRequest::default()).unwrap();
        let [Axis::Elevation(_), Axis::Grid(grid)] = projected.measurement.tensor.axes() else { panic!("a grid") };
        assert_eq!((grid.shape(), projected.scattered.is_none()), (outgoing, true));
        let on_triangles = project(&acquired, &levels(None, Some(3))).unwrap();
        assert!(on_triangles.scattered.is_some());
    }
}

#[test]
fn a_gap_between_azimuths_stays_on_the_grid() {
    let azimuths: Vec<f64> = steps(0.0, 10.0, 13).into_iter().chain(steps(218.75, 10.0, 14)).collect();
    let acquired = scan(0.0, azimuths.clone(), AzimuthExtent::Circle);
    let projected = project(&acquired, &AxesRequest::default()).unwrap();
    let tensor = &projected.measurement.tensor;
    let [Axis::Elevation(_), Axis::Grid(grid)] = tensor.axes() else { panic!("a grid: {:?}", tensor.axes()) };
    assert_eq!(grid.azimuths().unwrap().angles, azimuths);
    assert_eq!(tensor.samples(), &*grid_of(&mut acquired.clone()).values);
    let told = |projected: &Projected| {
        let notes = projected.coverage.notes.iter().map(|note| note.message.clone());
        notes.filter(|note| note.contains("more than 90° apart")).collect::<Vec<_>>()
    };
    let gap = "nothing is known between the azimuths of 120° and 218.75°, which are more than 90° apart: masked";
    assert_eq!(told(&projected), [gap]);
    // Gaps of up to 90 degrees are interpolated, and any gap of a format that defines what lies in it.
    let narrow = scan(0.0, vec![0.0, 90.0, 180.0, 270.0], AzimuthExtent::Circle);
    let of_format = Acquisition { format: "mbsdf", ..acquired };
    for acquired in [narrow, of_format] {
        assert!(told(&project(&acquired, &AxesRequest::default()).unwrap()).is_empty());
    }
}

#[test]
fn cells_coarser_than_the_promise_are_told() {
    let told = |samples: &Acquisition, request: &AxesRequest| {
        let notes = project(samples, request).unwrap().coverage.notes;
        notes.iter().any(|note| note.message.contains("more than half of the 1 % asked for"))
    };
    let steep = brdf(|_, wo, _| (4.0 * wo.xyz()[0]).exp() as f32);
    let flat = brdf(|_, _, c| 0.3 + c as f32);
    assert!(told(&steep, &triangles()) && !told(&flat, &triangles()));
    assert!(!told(&steep, &levels(Some(1), Some(3))));
}

#[test]
fn missing_samples_are_counted_and_holes_masked() {
    let mut acquired = brdf(|_, wo, _| if wo.xyz()[1] < -0.2 { f32::NAN } else { 1.0 });
    let projected = project(&acquired, &levels(Some(0), Some(3))).unwrap();
    let m = mesh(Domain::Hemisphere, 3);
    let brdf = projected.measurement.as_brdf().unwrap();
    for ti in 0..4 {
        for to in 0..m.len() {
            let y = m.centroid(to).xyz()[1];
            let value = brdf.at(ti).at(to).samples()[0];
            assert!(value == 1.0 && y > -0.6 || value.is_nan() && y < -0.2, "{to}: {value} at {y}");
        }
    }
    let coverage = &projected.coverage;
    assert_eq!(coverage.cells, 4 * 256);
    assert_eq!(coverage.measured + coverage.interpolated + coverage.empty, coverage.cells);
    assert!(coverage.empty > 0 && coverage.measured > 0 && coverage.interpolated > 0);
    assert!(coverage.notes.iter().any(|n| n.message.contains("are missing")));
    // A sample that is present is never masked.
    let errors = error_at_samples(&acquired, &projected.measurement).unwrap();
    assert_eq!(errors.max_absolute_error, 0.0);
    grid_of(&mut acquired).values.fill(f32::NAN);
    let projected = project(&acquired, &levels(Some(0), Some(1))).unwrap();
    assert_eq!(projected.coverage.empty, projected.coverage.cells);
}

#[test]
fn a_joined_spectrum_adds_the_wavelength_axis() {
    let mut acquired = edf(whole(15.0), Outside::Zero, |t, _| t as f32);
    let plain = project(&acquired, &triangles()).unwrap();
    let grid = WavelengthGrid::parse_range("400:700:100").unwrap();
    acquired.spectral_factor = Some(SpectralFactor { grid, factors: vec![1.0, 2.0, 0.0, 4.0] });
    acquired.unit = Unit::RelativePerNanometre;
    let projected = project(&acquired, &triangles()).unwrap();
    assert_eq!(projected.measurement.tensor.shape(), [plain.measurement.tensor.len(), 4]);
    for (s, base) in projected.measurement.tensor.samples().chunks(4).zip(plain.measurement.tensor.samples()) {
        assert!((s[1] - 2.0 * base).abs() <= 1e-6 * s[1] && s[2] == 0.0 && (s[3] - 2.0 * s[1]).abs() <= 1e-6 * s[3]);
    }
    let resampled = project(&acquired, &wavelengths("300:600:100")).unwrap();
    let samples = resampled.measurement.tensor.samples();
    assert!(samples.chunks(4).all(|s| s[0].is_nan() && !s[1].is_nan()));
    assert_eq!(resampled.coverage.empty, 0);
    // At the requested wavelengths: 400 to 600 nm can be compared, 300 nm cannot.
    let directions = 13 * 12;
    let errors = error_at_samples(&acquired, &resampled.measurement).unwrap();
    assert_eq!((errors.samples, errors.masked_samples, errors.mask_mismatches), (4 * directions, directions, 0));
    let errors = error_at_samples(&acquired, &projected.measurement).unwrap();
    assert_eq!(errors.samples, 4 * directions);
    let constant = edf(whole(15.0), Outside::Zero, |_, _| 3.0);
    let constant = Acquisition { spectral_factor: acquired.spectral_factor.clone(), ..constant };
    let projected = project(&constant, &triangles()).unwrap();
    assert_eq!(error_at_samples(&constant, &projected.measurement).unwrap().max_absolute_error, 0.0);
}

#[test]
fn final_axes_stay_or_become_coarser() {
    let axes = |level| {
        let lambda = WavelengthGrid::parse_range("400:700:100").unwrap();
        vec![
            Axis::Triangles(mesh(Domain::Hemisphere, 1)),
            Axis::Triangles(mesh(Domain::Hemisphere, level)),
            Axis::Wavelength(lambda),
        ]
    };
    let mut samples: Vec<f32> = (0..16 * 64 * 4).map(|i| (i % 4) as f32).collect();
    samples[8..12].fill(f32::NAN);
    let tensor = Tensor::new(axes(2), samples).unwrap();
    let acquired = acquisition(Quantity::Brdf, Samples::OnAxes { tensor: tensor.clone(), sampling: Sampling::Point });
    let kept = project(&acquired, &levels(Some(1), Some(2))).unwrap();
    assert_eq!(kept.measurement.tensor.axes(), tensor.axes());
    assert_eq!(kept.measurement.sampling, Sampling::Point);
    assert_eq!((kept.coverage.cells, kept.coverage.measured, kept.coverage.empty), (1024, 1023, 1));
    assert_eq!(error_at_samples(&acquired, &kept.measurement), None);

    let coarse = project(&acquired, &levels(Some(0), Some(1))).unwrap();
    assert_eq!(coarse.measurement.tensor.shape(), [4, 16, 4]);
    assert_eq!(coarse.measurement.sampling, Sampling::Average);
    assert!(coarse.measurement.tensor.samples().chunks(4).all(|s| s == [0.0, 1.0, 2.0, 3.0]));
    let errors = error_at_samples(&acquired, &coarse.measurement).unwrap();
    assert_eq!((errors.samples, errors.max_absolute_error, errors.mask_mismatches), (4096, 0.0, 4));

    let resampled = project(&acquired, &wavelengths("450:650:50")).unwrap();
    assert_eq!(resampled.measurement.tensor.shape(), [16, 64, 5]);
    let spectrum = &resampled.measurement.tensor.samples()[16..19];
    for (found, expected) in spectrum.iter().zip([1.0, 1.5, 2.0]) {
        assert!((found - expected).abs() < 1e-6, "{spectrum:?}");
    }
    // Samples after resampling are the tensor's own.
    assert_eq!(error_at_samples(&acquired, &resampled.measurement), None);

    assert!(refusal(&acquired, &levels(None, Some(3))).contains("level 3 was requested, expected at most 2"));
    assert!(refusal(&acquired, &wavelengths("1000:1100:10")).contains("measured 400 to 700 nm"));
}

#[test]
fn requests_that_mean_nothing_are_refused() {
    let spectrum =
        Tensor::new(vec![Axis::Wavelength(WavelengthGrid::even(400.0, 10.0, 2).unwrap())], vec![1.0; 2]).unwrap();
    let spectrum = acquisition(Quantity::Spectrum, Samples::OnAxes { tensor: spectrum, sampling: Sampling::Average });
    assert!(refusal(&spectrum, &levels(Some(1), None)).contains("no incoming directions"));
    assert!(refusal(&spectrum, &levels(None, Some(1))).contains("no outgoing directions"));
    let lamp = edf(whole(30.0), Outside::Zero, |_, _| 1.0);
    assert!(refusal(&lamp, &levels(Some(1), None)).contains("no incoming directions"));
    assert!(refusal(&lamp, &levels(None, Some(9))).contains("above the limit of 8"));
    assert!(refusal(&lamp, &wavelengths("400:700:10")).contains("join a spectrum"));
    let mut upward = edf(angles(steps(0.0, 10.0, 5), (0.0, 60.0), None), Outside::Masked, |_, _| 1.0);
    upward.quantity = Quantity::Btdf;
    assert!(refusal(&upward, &triangles()).contains("does not reach into the lower"));
    upward.quantity = Quantity::Brdf;
    assert!(matches!(project(&upward, &triangles()), Err(ProjectionError::Axes(AxisError::Unfit { .. }))));
}

#[test]
fn broken_grids_are_refused() {
    let mut lamp = edf(whole(30.0), Outside::Zero, |_, _| 1.0);
    grid_of(&mut lamp).values.pop();
    assert!(matches!(
        project(&lamp, &triangles()),
        Err(ProjectionError::Tensor(TensorError::Count { found: 41, expected: 42, .. }))
    ));
    assert_eq!(
        error_at_samples(
            &lamp,
            &project(&edf(whole(30.0), Outside::Zero, |_, _| 1.0), &triangles()).unwrap().measurement
        ),
        None
    );
    grid_of(&mut lamp).values.push(f32::INFINITY);
    assert!(matches!(project(&lamp, &triangles()), Err(ProjectionError::Tensor(TensorError::Infinite { index: 41 }))));
    grid_of(&mut lamp).outgoing = Some(angles(vec![0.0, -1.0], (0.0, 180.0), None));
    assert!(refusal(&lamp, &triangles()).contains("theta -1"));
}

#[test]
fn named_levels_beyond_the_size_limit_are_refused_before_the_work() {
    let acquired = brdf(|_, _, _| 1.0);
    let request = levels(Some(7), Some(7));
    assert!(matches!(project(&acquired, &request), Err(ProjectionError::Axes(AxisError::TooManySamples { .. }))));
}

#[test]
fn opaque_axes_stay_in_front() {
    let mut acquired = edf(whole(30.0), Outside::Zero, |t, _| t as f32);
    let grid = grid_of(&mut acquired);
    grid.index = vec![Axis::Index { count: 3, labels: vec![] }];
    let one = grid.values.clone();
    grid.values = (0..3).flat_map(|k| one.iter().map(move |v| v + 1000.0 * k as f32)).collect();
    let projected = project(&acquired, &levels(None, Some(2))).unwrap();
    assert_eq!(projected.measurement.tensor.shape(), [3, 128]);
    assert_eq!((projected.coverage.cells, projected.coverage.empty), (384, 0));
    let samples = projected.measurement.tensor.samples();
    for cell in 0..128 {
        assert!((samples[256 + cell] - samples[cell] - 2000.0).abs() < 1e-3);
    }
    let errors = error_at_samples(&acquired, &projected.measurement).unwrap();
    assert_eq!(errors.samples, 3 * 42);
    assert!(errors.max_absolute_error < 30.0);
}

#[test]
fn errors_of_another_files_tensor_are_none() {
    let lamp = edf(whole(30.0), Outside::Zero, |_, _| 1.0);
    let surface = project(&brdf(|_, _, _| 1.0), &levels(Some(0), Some(1))).unwrap();
    assert_eq!(error_at_samples(&lamp, &surface.measurement), None);
    let projected = project(&lamp, &triangles()).unwrap();
    let mut coloured = lamp.clone();
    grid_of(&mut coloured).spectral = Some(Axis::Rgb);
    grid_of(&mut coloured).values = vec![1.0; 42 * 3].into();
    assert_eq!(error_at_samples(&coloured, &projected.measurement), None);
}

#[test]
fn errors_shrink_with_the_cells() {
    let acquired =
        edf(whole(5.0), Outside::Zero, |t, p| (2.0 + (3.0 * t.to_radians()).sin() * p.to_radians().cos()) as f32);
    let error = |level| {
        let projected = project(&acquired, &levels(None, Some(level))).unwrap();
        error_at_samples(&acquired, &projected.measurement).unwrap().relative_rmse
    };
    let (coarse, middle, fine) = (error(2), error(4), error(6));
    assert!(middle < 0.4 * coarse && fine < 0.4 * middle, "{coarse} {middle} {fine}");
}

#[test]
fn threads_do_not_change_a_bit() {
    let acquired = brdf(|wi, wo, c| (wi.dot(wo) * 1.7 + c as f64 / 3.0) as f32);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let projected = project(&acquired, &levels(Some(2), Some(4))).unwrap();
            let bits: Vec<u32> = projected.measurement.tensor.samples().iter().map(|s| s.to_bits()).collect();
            (bits, projected.coverage, error_at_samples(&acquired, &projected.measurement))
        })
    };
    assert!(run(1) == run(2));
}
