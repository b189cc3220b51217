//! Tests of measurements that stay on the grid of their file.

use super::super::{Coverage, project};
use super::*;
use crate::domain::NoteValue;
use crate::domain::{AzimuthExtent, Unit, WavelengthGrid};
use crate::formats::{Interpretation, SpectralFactor, read, write_npy};
use serde_json::{Value, json};

fn on_grid() -> AxesRequest {
    AxesRequest { domain: Some(DirectionDomain::Grid), ..AxesRequest::default() }
}

/// Test data: a laterally symmetric lamp (photometry type B) with 3 × 2 intensities, candela multiplier 0.1 and ballast
/// factor 0.7.
fn lamp() -> Acquisition {
    let text = "IESNA:LM-63-2002\nTILT=NONE\n1 -1 0.1 3 2 2 2 0 0 0 0.7 1 0\n-30 0 30\n0 20\n1 2 3 4 5 6\n";
    read(text.as_bytes(), &Interpretation::default()).unwrap()
}

/// Test data: an array with a manifest of angles, whose values count up from 1.
fn array(quantity: Quantity, axes: &Value, shape: &[usize]) -> Acquisition {
    let values: Vec<f32> = (1..=shape.iter().product()).map(|i: usize| i as f32).collect();
    let unit = quantity.default_unit().name();
    let manifest = json!({"quantity": quantity.name(), "value_unit": unit, "axes": axes});
    let how = Interpretation { axes: Some(manifest), ..Interpretation::default() };
    read(&write_npy(shape, &values), &how).unwrap()
}

/// Test data: an isotropic BRDF with three wavelengths, whose azimuths form a closed circle.
fn paint() -> Acquisition {
    let axes = json!([{"name": "theta_i", "values": [0, 30]}, {"name": "theta_o", "values": [0, 40, 80], "covers": [0, 90]},
        {"name": "phi_o", "values": [0, 90, 180, 270, 360]}, "lambda:400:100:3"]);
    array(Quantity::Brdf, &axes, &[2, 3, 5, 3])
}

fn directions(tensor: &Tensor, axis: usize) -> &DirectionGrid {
    let Axis::Grid(grid) = &tensor.axes()[axis] else { panic!("{:?}", tensor.axes()) };
    grid
}

#[test]
fn a_lamp_keeps_its_angles_and_numbers() {
    let projected = project(&lamp(), &on_grid()).unwrap();
    let measurement = &projected.measurement;
    assert_eq!((measurement.unit, measurement.sampling), (Unit::Candela, Sampling::Point));
    let grid = directions(&measurement.tensor, 0);
    assert_eq!((grid.frame(), grid.polar(), grid.is_polar_mirrored()), (Frame::TypeB, &[0.0, 20.0][..], true));
    assert_eq!(measurement.tensor.samples(), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0].map(|n: f64| (n * (0.1 * 0.7)) as f32));
    let numbers = projected.numbers.unwrap();
    assert_eq!((numbers.tensor.samples(), numbers.factor), (&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0][..], 0.1 * 0.7));
    let [note] = &projected.coverage.notes[..] else { panic!("{:?}", projected.coverage.notes) };
    let axis = "grid of 2 × 3 (polar 0..20, azimuth -30..30)";
    assert_eq!(
        (note.code.as_str(), &note.values["axis"]),
        ("projection-axis-as-stated", &NoteValue::Text(axis.into()))
    );
    assert_eq!(note.message, format!("outgoing: {axis}, as the file states it"));
    let counts = Coverage { cells: 6, measured: 6, notes: vec![note.clone()], ..Coverage::default() };
    assert_eq!(projected.coverage, counts);
}

#[test]
fn isotropic_tables_keep_elevations_and_seams() {
    let projected = project(&paint(), &on_grid()).unwrap();
    let tensor = &projected.measurement.tensor;
    assert_eq!((tensor.shape(), &tensor.axes()[0]), (vec![2, 15, 3], &Axis::Elevation(vec![0.0, 30.0])));
    let grid = directions(tensor, 1);
    assert_eq!((grid.covers(), grid.azimuths().unwrap().extent), ((0.0, 90.0), AzimuthExtent::Closed));
    // The numbers of the file, none of them averaged.
    assert!(tensor.samples().iter().enumerate().all(|(i, &sample)| sample == (i + 1) as f32));
    assert_eq!((projected.coverage.cells, projected.numbers), (30, None));
}

#[test]
fn wavelengths_and_spectra_are_those_of_triangles() {
    // Values that are linear in wavelength stay so in averages over bands.
    let request = AxesRequest { wavelengths: Some(WavelengthGrid::parse_range("450:550:50").unwrap()), ..on_grid() };
    let projected = project(&paint(), &request).unwrap();
    let tensor = &projected.measurement.tensor;
    assert_eq!(tensor.shape(), [2, 15, 3]);
    assert!((tensor.samples()[1] - 2.0).abs() < 1e-6 && (tensor.samples()[4] - 5.0).abs() < 1e-6);
    let spectrum = SpectralFactor { grid: WavelengthGrid::even(400.0, 10.0, 2).unwrap(), factors: vec![0.5, 2.0] };
    let lit = Acquisition { spectral_factor: Some(spectrum), unit: Unit::WattPerSteradianNanometre, ..lamp() };
    let projected = project(&lit, &on_grid()).unwrap();
    let tensor = &projected.measurement.tensor;
    let number = f64::from((6.0 * (0.1 * 0.7)) as f32);
    assert_eq!(tensor.shape(), [6, 2]);
    assert_eq!(tensor.samples()[10..], [(0.5 * number) as f32, (2.0 * number) as f32]);
    assert_eq!(projected.numbers, None);
}

#[test]
fn gaps_are_masked_and_counted() {
    let mut acquisition = paint();
    let Samples::Grid(grid) = &mut acquisition.samples else { panic!("a grid") };
    grid.stated = None;
    grid.values[..4].fill(f32::NAN);
    let projected = project(&acquisition, &on_grid()).unwrap();
    let coverage = projected.coverage;
    assert_eq!((coverage.cells, coverage.measured, coverage.empty), (24, 23, 1));
    assert!(coverage.notes[2].message.contains("4 of 72 samples are missing"), "{:?}", coverage.notes);
    assert_eq!(projected.measurement.tensor.masked(), 4);
    // A reader that has counted them says so alone.
    let places = "places of the grid";
    acquisition.report.note(crate::notes::ValueNote::WithoutSample { missing: 4, of: 72, places });
    let notes = project(&acquisition, &on_grid()).unwrap().coverage.notes;
    assert!(!notes.iter().any(|note| note.message.contains("missing")), "{notes:?}");
}

#[test]
fn elevations_behind_the_surface_are_left_out() {
    let axes = |theta_o: &[f64]| json!([{"name": "theta_i", "values": [10]}, {"name": "theta_o", "values": theta_o}]);
    let mut acquisition = array(Quantity::Bsdf, &axes(&[0.0, 60.0, 95.0, 170.0]), &[1, 4]);
    for (quantity, polar, samples) in
        [(Quantity::Brdf, [0.0, 60.0], [1.0, 2.0]), (Quantity::Btdf, [95.0, 170.0], [3.0, 4.0])]
    {
        acquisition.quantity = quantity;
        let projected = project(&acquisition, &on_grid()).unwrap();
        let tensor = &projected.measurement.tensor;
        assert_eq!((directions(tensor, 1).polar(), tensor.samples()), (&polar[..], &samples[..]));
        assert!(projected.coverage.notes[2].message.starts_with("2 of 4 outgoing elevations lie beyond the"));
    }
    let mut below = array(Quantity::Bsdf, &axes(&[95.0, 170.0]), &[1, 2]);
    below.quantity = Quantity::Brdf;
    assert!(matches!(project(&below, &on_grid()), Err(ProjectionError::Angles { role: Role::Outgoing, .. })));
}

#[test]
fn one_incoming_azimuth_is_isotropic() {
    let axes = json!([{"name": "theta_i", "values": [10, 50]}, {"name": "phi_i", "values": [30]},
        {"name": "theta_o", "values": [0, 40]}, {"name": "phi_o", "values": [0, 90, 180, 270, 360]}]);
    let projected = project(&array(Quantity::Brdf, &axes, &[2, 1, 2, 5]), &on_grid()).unwrap();
    let tensor = &projected.measurement.tensor;
    assert_eq!(tensor.axes()[0], Axis::Elevation(vec![10.0, 50.0]));
    let azimuths = directions(tensor, 1).azimuths().unwrap();
    assert_eq!(azimuths.angles, [-30.0, 60.0, 150.0, 240.0, 330.0]);
    assert_eq!((azimuths.extent, tensor.samples()[19]), (AzimuthExtent::Closed, 20.0));
}

#[test]
fn the_grid_is_the_default_and_a_level_asks_for_triangles() {
    let of = |request: AxesRequest| project(&lamp(), &request).unwrap();
    let default = of(AxesRequest::default());
    let named = of(AxesRequest { domain: Some(DirectionDomain::Grid), ..AxesRequest::default() });
    assert_eq!((&default.measurement, &default.coverage), (&named.measurement, &named.coverage));
    assert!(matches!(default.measurement.tensor.axes(), [Axis::Grid(_)]));
    let level = of(AxesRequest { outgoing_level: Some(1), ..AxesRequest::default() });
    let triangles = of(AxesRequest { domain: Some(DirectionDomain::Triangles), ..AxesRequest::default() });
    for projected in [level, triangles] {
        assert!(matches!(projected.measurement.tensor.axes(), [Axis::Triangles(_)]));
    }
}

#[test]
fn domains_that_do_not_fit_are_refused() {
    let refusal = |acquisition: &Acquisition, request: &AxesRequest| match project(acquisition, request) {
        Err(ProjectionError::Domain(error)) => error,
        other => panic!("{other:?}"),
    };
    assert_eq!(refusal(&lamp(), &AxesRequest { outgoing_level: Some(1), ..on_grid() }), DomainError::Level);
    let spectrum = array(Quantity::Spectrum, &json!(["lambda:400:100:3"]), &[3]);
    assert_eq!(refusal(&spectrum, &on_grid()), DomainError::NoGrid);
    let axis = json!([{"kind": "directions", "frame": "type-c", "polar": [0, 90]}]);
    let last = array(Quantity::Edf, &axis, &[2]);
    let triangles = AxesRequest { domain: Some(DirectionDomain::Triangles), ..AxesRequest::default() };
    assert_eq!(refusal(&last, &triangles), DomainError::Final);
    for request in [on_grid(), AxesRequest::default()] {
        assert!(matches!(project(&last, &request).unwrap().measurement.tensor.axes(), [Axis::Grid(_)]));
    }
}

#[test]
fn lists_over_the_scattering_angle_stay_as_they_are_and_moments_do_not() {
    let text = "scattering angle, phase function\n0,0.2\n90,0.1\n170,0.05\n180,0.04\n";
    let how = Interpretation { quantity: Some(Quantity::Phase.into()), ..Interpretation::default() };
    let how = Interpretation { normalization: Some(crate::formats::Normalization::Relative), ..how };
    let acquisition = read(text.as_bytes(), &how).unwrap();
    let projected = project(&acquisition, &AxesRequest::default()).unwrap();
    let tensor = &projected.measurement.tensor;
    assert_eq!(tensor.axes()[0], Axis::Elevation(vec![0.0]));
    // Light from +z that goes straight on leaves towards -z, theta 180.
    let grid = directions(tensor, 1);
    assert_eq!((grid.polar(), grid.azimuths(), grid.covers()), (&[0.0, 10.0, 90.0, 180.0][..], None, (0.0, 180.0)));
    let samples = tensor.samples();
    assert!((samples[3] / samples[0] - 5.0).abs() < 1e-6 && (samples[2] / samples[1] - 2.0).abs() < 1e-6);
    let triangles = AxesRequest { domain: Some(DirectionDomain::Triangles), ..AxesRequest::default() };
    let by_name = project(&acquisition, &triangles).unwrap();
    assert!(matches!(by_name.measurement.tensor.axes(), [Axis::Triangles(_), Axis::Triangles(_)]));
    // Moments are no list over angles.
    let moments = read(b"1\n0.5\n0.25\n0.1\n", &how).unwrap();
    let on_triangles = project(&moments, &AxesRequest::default()).unwrap();
    assert!(matches!(on_triangles.measurement.tensor.axes(), [Axis::Triangles(_), Axis::Triangles(_)]));
    assert!(matches!(project(&moments, &on_grid()), Err(ProjectionError::Domain(DomainError::NoGrid))));
}

#[test]
fn remarks_on_the_unfolded_form_do_not_hold_for_the_grid() {
    let text = "IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 2 3 1 2 0 0 0 1 1 0\n0 90\n0 180 360\n1 2 3 4 1 2\n";
    let report = read(text.as_bytes(), &Interpretation::default()).unwrap().report;
    let notes = |on_grid: bool| report.notes_of(on_grid).count();
    assert_eq!((report.notes.len(), notes(false), notes(true)), (1, 1, 0), "{:?}", report.notes);
}
