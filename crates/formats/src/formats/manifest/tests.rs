//! Manifests: their forms, their round trips, cosines, and every refusal.

use super::*;
use crate::domain::{Axis, Azimuths, DirectionGrid, Domain, Frame, Measurement, Outside, TriangleMesh};
use crate::formats::{AngleGrid, AzimuthExtent, FormatErrorKind};
use serde_json::json;

fn read(manifest: &Value, shape: &[usize], how: &Interpretation) -> Result<Acquisition, FormatError> {
    let samples = (0..shape.iter().product()).map(|i| i as f32).collect();
    interpret(manifest, shape, samples, how, ParseReport::default())
}

fn plain(manifest: &Value, shape: &[usize]) -> Result<Acquisition, FormatError> {
    read(manifest, shape, &Interpretation::default())
}

fn axes_of(acquisition: &Acquisition) -> Vec<Axis> {
    match &acquisition.samples {
        Samples::OnAxes { tensor, .. } => tensor.axes().to_vec(),
        _ => Vec::new(),
    }
}

fn grid_of(manifest: &Value, shape: &[usize]) -> (AngleGrid, ParseReport) {
    let acquisition = plain(manifest, shape).unwrap();
    let Samples::Grid(grid) = acquisition.samples else { panic!("expected a grid") };
    (grid, acquisition.report)
}

fn hemisphere(level: u8) -> Axis {
    Axis::Triangles(TriangleMesh::new(Domain::Hemisphere, level).unwrap())
}

#[test]
fn short_and_full_forms_are_the_same_axes() {
    let full = json!({"quantity": "brdf", "axes": [
        {"kind": "triangles", "domain": "hemisphere", "level": 0},
        {"kind": "triangles", "domain": "hemisphere", "level": 1},
        {"kind": "wavelength", "start": 380, "step": 5, "count": 3}]});
    let lambda = Axis::Wavelength(WavelengthGrid::even(380.0, 5.0, 3).unwrap());
    let expected = vec![hemisphere(0), hemisphere(1), lambda];
    assert_eq!(axes_of(&plain(&full, &[4, 16, 3]).unwrap()), expected);
    for axes in [
        json!(["hemi:0", "hemisphere:1", "lambda:380:5:3"]),
        json!(["hemi:0", "hemi:1", {"name": "wavelength", "unit": "nm", "values": [380, 385, 390]}]),
        json!(["hemi:0", "hemi:1", {"kind": "lambda", "unit": "um", "values": [0.38, 0.385, 0.39]}]),
    ] {
        let short = json!({"quantity": "brdf", "axes": axes});
        assert_eq!(axes_of(&plain(&short, &[4, 16, 3]).unwrap()), expected, "{short}");
    }
}

#[test]
fn a_bare_lambda_needs_as_many_wavelengths_as_the_array_has() {
    let manifest = json!({"axes": ["hemi:0", "hemi:0", "lambda"], "note": "as generated"});
    let how = |quantity: Option<Quantity>, wavelengths: Option<&str>| Interpretation {
        quantity: quantity.map(Into::into),
        wavelengths: wavelengths.map(str::to_owned),
        ..Interpretation::default()
    };
    let brdf = Some(Quantity::Brdf);
    let read_with = |how: &Interpretation| read(&manifest, &[4, 4, 2], how);
    let acquisition = read_with(&how(brdf, Some("400:500:100"))).unwrap();
    assert_eq!(axes_of(&acquisition)[2].len(), 2);
    assert_eq!(acquisition.report.metadata, [("note".to_owned(), "as generated".to_owned())]);
    for (how, word) in [
        (how(None, Some("400:500:100")), "quantity"),
        (how(brdf, None), "wavelengths"),
        (how(brdf, Some("400:500:10")), "has 11 wavelengths"),
        (how(brdf, Some("500:400")), "START:STOP:STEP"),
    ] {
        let error = read_with(&how).unwrap_err();
        assert_eq!(error.kind, FormatErrorKind::NeedsOption);
        assert!(error.message.contains(word), "{error}");
    }
}

#[test]
fn a_manifest_may_state_angles_of_the_instrument() {
    let of = |key: &str, value: serde_json::Value| {
        let mut manifest = json!({"quantity": "reflectance", "value_unit": "1", "axes": ["lambda:400:100:2"]});
        manifest[key] = value;
        plain(&manifest, &[2])
    };
    let found = of("detector_aperture", json!(0.5)).unwrap();
    assert_eq!((found.instrument.detector_aperture, found.instrument.source_divergence), (Some(0.5), None));
    assert!(found.report.metadata.is_empty());
    assert!(of("source_divergence", json!(null)).unwrap().instrument.is_unknown());
    for bad in [json!("0.5"), json!(-0.5), json!(180.5), json!([1]), json!({"deg": 1}), json!(true)] {
        let error = of("source_divergence", bad).unwrap_err();
        let expected = "expected a full angle in degrees, from 0 to 180";
        assert!(error.message.contains("manifest: source_divergence") && error.message.contains(expected), "{error}");
    }
    let misspelt = of("detector-apertur", json!(1)).unwrap_err();
    assert!(misspelt.message.contains("expected `detector_aperture`"), "{misspelt}");
}

#[test]
fn manifests_round_trip_through_text() {
    let labels = vec!["a".to_owned(), "b".to_owned()];
    let uneven = WavelengthGrid::listed(vec![199.997_970_581_054_7, 200.167_633_056_640_63]).unwrap();
    let sphere = Axis::Triangles(TriangleMesh::new(Domain::Sphere, 0).unwrap());
    let lower = Axis::Triangles(TriangleMesh::new(Domain::Lower, 0).unwrap());
    let even = Axis::Wavelength(WavelengthGrid::even(380.0, 0.1, 2).unwrap());
    for (quantity, axes) in [
        (Quantity::Spectrum, vec![Axis::Index { count: 2, labels }, Axis::Wavelength(uneven)]),
        (Quantity::Edf, vec![sphere, Axis::Rgb]),
        (Quantity::Btdf, vec![Axis::Elevation(vec![0.0, 33.3]), lower, even]),
        (Quantity::Reflectance, vec![Axis::Index { count: 3, labels: vec![] }]),
    ] {
        let shape: Vec<usize> = axes.iter().map(Axis::len).collect();
        let tensor = Tensor::new(axes.clone(), vec![1.0; shape.iter().product()]).unwrap();
        let measurement = Measurement::new(quantity, Unit::Relative, Sampling::Point, tensor).unwrap();
        let text = manifest_of(&measurement).to_string();
        let back = plain(&serde_json::from_str(&text).unwrap(), &shape).unwrap();
        assert_eq!((back.quantity, back.unit), (quantity, Unit::Relative));
        assert!(back.report.notes.is_empty());
        assert_eq!(axes_of(&back), axes);
        assert!(matches!(back.samples, Samples::OnAxes { sampling: Sampling::Point, .. }));
    }
}

#[test]
fn the_users_word_goes_before_the_manifests() {
    let manifest = json!({"quantity": "brdf", "value_unit": "1/sr", "axes": ["index", "rgb"]});
    let how = Interpretation {
        quantity: Some(Quantity::Reflectance.into()),
        unit: Some(Unit::One),
        ..Interpretation::default()
    };
    let acquisition = read(&manifest, &[2, 3], &how).unwrap();
    assert_eq!((acquisition.quantity, acquisition.unit), (Quantity::Reflectance, Unit::One));
    assert_eq!(acquisition.report.notes.len(), 2);
}

#[test]
fn a_cosine_is_divided_out_and_an_unstated_one_is_told() {
    let manifest = |cosine: Option<bool>| {
        let mut manifest = json!({"quantity": "brdf", "value_unit": "1/sr", "note": "kept", "axes": ["index",
            {"kind": "theta_i", "values": [0, 30]}, {"kind": "theta_o", "values": [0, 60, 90]},
            {"kind": "phi_o", "values": [0, 90, 180]}, "rgb"]});
        if let Some(cosine) = cosine {
            manifest["cosine_included"] = json!(cosine);
        }
        manifest
    };
    let shape = [2, 2, 3, 3, 3];
    let (plain, report) = grid_of(&manifest(None), &shape);
    assert!(report.notes.iter().any(|note| note.message.contains("`cosine_included` is not stated")));
    assert_eq!(report.metadata, [("note".to_owned(), "kept".to_owned())]);
    let (stated, report) = grid_of(&manifest(Some(false)), &shape);
    assert!(stated.values == plain.values && !report.notes.iter().any(|note| note.message.contains("cosine")));
    let (divided, report) = grid_of(&manifest(Some(true)), &shape);
    assert!(report.notes.iter().any(|note| note.message.starts_with("36 values at theta_o of 90 degrees")));
    for (i, (a, b)) in divided.values.iter().zip(&plain.values).enumerate() {
        match i / 9 % 3 {
            0 => assert_eq!(a, b),
            1 => assert!((a - 2.0 * b).abs() <= 1e-6 * b, "{i}: {a} {b}"),
            _ => assert!(a.is_nan()),
        }
    }
}

#[test]
fn negative_values_are_counted_and_kept() {
    let spectrum = json!({"quantity": "spectrum", "value_unit": "relative", "axes": ["lambda:400:10:3"]});
    let samples = vec![-0.5, 1.0, -2.0];
    let read = interpret(&spectrum, &[3], samples, &Interpretation::default(), ParseReport::default()).unwrap();
    assert!(read.report.notes.iter().any(|note| note.message == "2 values are negative, down to -2; kept as they are"));
}

#[test]
fn unfit_manifests_are_refused_with_their_reason() {
    use FormatErrorKind::{NeedsOption, OverLimit};
    let brdf = |axes: Value| json!({"quantity": "brdf", "axes": axes});
    let angles = |name: &str, values: &[f64]| json!({"name": name, "values": values});
    for (manifest, shape, kind, word) in [
        (json!("brdf"), vec![3], NeedsOption, "expected"),
        (json!({"quantity": "brdf"}), vec![3], NeedsOption, "`axes`"),
        (json!({"quantity": "brd", "axes": ["rgb"]}), vec![3], NeedsOption, "unknown quantity"),
        (json!({"quantity": 3, "axes": ["rgb"]}), vec![3], NeedsOption, "expected text"),
        (json!({"quantity": "edf", "value_unit": "lm", "axes": ["rgb"]}), vec![3], NeedsOption, "unknown unit"),
        (json!({"quantity": "edf", "sampling": "x", "axes": ["rgb"]}), vec![3], NeedsOption, "unknown sampling"),
        (json!({"quantity": "edf", "cosine_included": true, "axes": ["rgb"]}), vec![3], NeedsOption, "expected false"),
        (
            json!({"quantity": "brdf", "cosine_included": "yes", "axes": ["rgb"]}),
            vec![3],
            NeedsOption,
            "found `\"yes\"`",
        ),
        (
            json!({"quantity": "brdf", "cosine_included": true, "axes": ["hemi:0", "hemi:0"]}),
            vec![4, 4],
            NeedsOption,
            "averages over triangles",
        ),
        (
            json!({"quantity": "brdf", "cosin_included": true, "axes": ["rgb"]}),
            vec![3],
            NeedsOption,
            "expected `cosine_included`",
        ),
        (
            json!({"quantity": "brdf", "includes_cosine": 1, "axes": ["rgb"]}),
            vec![3],
            NeedsOption,
            "expected `cosine_included`",
        ),
        (
            json!({"quantity": "brdf", "Value-Unit": "1/sr", "axes": ["rgb"]}),
            vec![3],
            NeedsOption,
            "expected `value_unit`",
        ),
        (brdf(json!(["rgb"])), vec![3, 3], NeedsOption, "1 axes, expected 2"),
        (brdf(json!(["hemi:2"])), vec![63], NeedsOption, "64 entries"),
        (brdf(json!(["hemi:9"])), vec![3], OverLimit, "level 9"),
        (brdf(json!(["hemi:x"])), vec![3], NeedsOption, "expected"),
        (brdf(json!(["ball:1"])), vec![3], NeedsOption, "expected"),
        (brdf(json!([7])), vec![3], NeedsOption, "expected"),
        (brdf(json!([{"level": 1}])), vec![3], NeedsOption, "expected"),
        (brdf(json!([{"kind": "triangles", "level": 1}])), vec![3], NeedsOption, "domain"),
        (brdf(json!([{"kind": "triangles", "domain": "hemisphere"}])), vec![3], NeedsOption, "level"),
        (brdf(json!([{"kind": "triangles", "domain": "hemisphere", "lvl": 1}])), vec![3], NeedsOption, "`lvl`"),
        (brdf(json!(["lambda:380:5"])), vec![3], NeedsOption, "expected"),
        (brdf(json!(["lambda:380:0:3"])), vec![3], NeedsOption, "increasing"),
        (brdf(json!(["lambda:380:5:99999999999"])), vec![3], OverLimit, "limit"),
        (brdf(json!([{"kind": "wavelength", "values": [400, 390, 380]}])), vec![3], NeedsOption, "increasing"),
        (brdf(json!([{"kind": "wavelength", "values": "lambda.npy"}])), vec![3], NeedsOption, "not opened"),
        (brdf(json!([{"kind": "wavelength", "unit": "ft", "values": [1]}])), vec![1], NeedsOption, "unit"),
        (brdf(json!([{"kind": "elevation", "values": [0, 30, 100]}, "hemi:0"])), vec![3, 4], NeedsOption, "100"),
        (brdf(json!([{"kind": "directions", "polar": [0, 30]}])), vec![2], NeedsOption, "`frame`"),
        (brdf(json!([directions(&json!({"polar": [0, 200]}))])), vec![2], NeedsOption, "0 to 180"),
        (brdf(json!([directions(&json!({"azimuths": [0, 90]}))])), vec![4], NeedsOption, "`extent`"),
        (brdf(json!([directions(&json!({"covers": [1, 90]}))])), vec![2], NeedsOption, "covers 1 to 90 degrees"),
        (brdf(json!([directions(&json!({"outside": "black"}))])), vec![2], NeedsOption, "masked, dark"),
        (brdf(json!([directions(&json!({"mirrored": 1}))])), vec![2], NeedsOption, "true or false"),
        (brdf(json!([{"kind": "index", "count": 3, "labels": ["a"]}])), vec![3], NeedsOption, "labels"),
        (brdf(json!(["hemi:0", "rgb"])), vec![4, 3], NeedsOption, "directions"),
        (brdf(json!([angles("theta_i", &[0.0, 30.0]), "hemi:0"])), vec![2, 4], NeedsOption, "beside angles"),
        (brdf(json!([angles("theta_o", &[0.0, 30.0])])), vec![2], NeedsOption, "theta_i and theta_o"),
        (
            brdf(json!([angles("theta_o", &[0.0]), angles("theta_i", &[0.0])])),
            vec![1, 1],
            NeedsOption,
            "expected the order",
        ),
        (brdf(json!([angles("theta_i", &[30.0, 0.0])])), vec![2], NeedsOption, "increasing"),
        (
            brdf(json!([angles("theta_i", &[0.0]), angles("theta_o", &[91.0])])),
            vec![1, 1],
            NeedsOption,
            "within 0° to 90°",
        ),
    ] {
        let error = plain(&manifest, &shape).unwrap_err();
        assert_eq!(error.kind, kind, "{manifest}: {error}");
        assert!(error.message.contains(word), "{manifest}: {error}");
    }
}

/// Returns the manifest axis of a grid of two polar angles, with `fields` in place of or beside its own fields.
fn directions(fields: &Value) -> Value {
    let mut axis = json!({"kind": "directions", "frame": "surface", "polar": [0, 30]});
    for (key, value) in fields.as_object().unwrap() {
        axis[key] = value.clone();
    }
    axis
}

#[test]
fn grids_of_directions_read_back_as_they_were_described() {
    let azimuths =
        |angles: &[f64], extent: &str| Some(Azimuths { angles: angles.to_vec(), extent: extent.parse().unwrap() });
    let lamp = DirectionGrid::new(Frame::TypeC, vec![0.0, 22.5, 90.0], azimuths(&[0.0, 45.0, 90.0], "quadrant"));
    let beam = DirectionGrid::new(Frame::TypeB, vec![0.0, 0.1, 30.0], azimuths(&[-20.0, 20.0], "sector"));
    for grid in [
        lamp.unwrap().with_outside(Outside::Dark),
        beam.unwrap().mirrored().unwrap().covering(0.0, 90.0).unwrap(),
        DirectionGrid::new(Frame::Surface, vec![5.0, 50.0], None).unwrap(),
    ] {
        let samples = (0..grid.len()).map(|i| i as f32).collect();
        let tensor = Tensor::new(vec![Axis::Grid(grid.clone())], samples).unwrap();
        let measurement = Measurement::new(Quantity::Edf, Unit::Candela, Sampling::Point, tensor).unwrap();
        let manifest = manifest_of(&measurement);
        assert_eq!(axes_of(&plain(&manifest, &[grid.len()]).unwrap()), [Axis::Grid(grid)], "{manifest}");
    }
}

#[test]
fn angle_grids_know_what_their_azimuths_stand_for() {
    let brdf = |phi: Value| {
        json!({"quantity": "brdf", "cosine_included": false, "axes": [
            {"name": "theta_i", "unit": "deg", "values": [0, 30]},
            {"name": "theta_o", "unit": "deg", "values": [0, 40, 80], "covers": [0, 90]}, phi, "rgb"]})
    };
    let extent = |phi: Value, n: usize| {
        let (grid, report) = grid_of(&brdf(phi), &[2, 3, n, 3]);
        let azimuths = grid.outgoing.unwrap().phi.unwrap();
        assert_eq!(grid.values.len(), 18 * azimuths.phi.len());
        (azimuths.extent, azimuths.phi.len(), report.notes.len())
    };
    // One note is the unit assumed.
    let phi = |values: &[f64]| json!({"name": "phi_o", "values": values});
    assert_eq!(extent(phi(&[0.0, 90.0, 180.0]), 3), (AzimuthExtent::Mirrored, 3, 2));
    assert_eq!(extent(phi(&[0.0, 90.0, 180.0, 270.0]), 4), (AzimuthExtent::Circle, 4, 1));
    assert_eq!(extent(phi(&[0.0, 180.0, 360.0]), 3), (AzimuthExtent::Circle, 2, 2));
    assert_eq!(extent(phi(&[0.0, 10.0]), 2), (AzimuthExtent::Sector, 2, 2));
    let stated = |extent: &str| json!({"name": "phi_o", "values": [0, 90, 180], "extent": extent});
    assert_eq!(extent(stated("sector"), 3), (AzimuthExtent::Sector, 3, 1));
    assert_eq!(extent(stated("circle"), 3), (AzimuthExtent::Circle, 3, 1));
    let (grid, _) = grid_of(&brdf(phi(&[0.0, 90.0, 180.0])), &[2, 3, 3, 3]);
    assert_eq!(grid.outgoing.unwrap().covers, (0.0, 90.0));
    assert_eq!(grid.incoming.unwrap().covers, (0.0, 30.0));
}

#[test]
fn both_circles_close_without_mixing_their_columns() {
    let manifest = json!({"quantity": "brdf", "axes": [
        {"kind": "theta_i", "values": [10]}, {"kind": "phi_i", "values": [0, 180, 360]},
        {"kind": "theta_o", "values": [20, 30]}, {"kind": "phi_o", "values": [0, 120, 240, 360]}]});
    let shape = [1, 3, 2, 4];
    // A value that tells its two azimuths apart, equal at 0° and 360°.
    let samples = (0..24).map(|i| (10 * (i / 8 % 2) + 100 * (i / 4 % 2) + i % 4 % 3) as f32).collect();
    let acquisition =
        interpret(&manifest, &shape, samples, &Interpretation::default(), ParseReport::default()).unwrap();
    let Samples::Grid(grid) = acquisition.samples else { panic!("expected a grid") };
    assert_eq!(grid.values, [0.0, 1.0, 2.0, 100.0, 101.0, 102.0, 10.0, 11.0, 12.0, 110.0, 111.0, 112.0]);
    // The circle, and the cosine that is not stated.
    assert_eq!(acquisition.report.notes.len(), 2);
}
