//! Documents in, acquisitions out: identities of the models on axes, and every refusal by name.

use super::*;
use crate::domain::{Domain, TriangleMesh, Unit};
use crate::formats::NoteKind;
use crate::formats::{self, Samples};

fn read(json: &str) -> Result<Acquisition, FormatError> {
    formats::read(json.as_bytes(), &Interpretation::default())
}

fn document(quantity: &str, model: &str, axes: &str, rest: &str) -> String {
    format!("{{\"wavelume\":\"virtual\",\"quantity\":\"{quantity}\",\"model\":{model},\"axes\":{axes}{rest}}}")
}

fn samples(json: &str) -> Vec<f32> {
    match read(json).unwrap().samples {
        Samples::OnAxes { tensor, .. } => tensor.into_samples(),
        Samples::Grid(grid) => grid.values.into_vec(),
        Samples::Scattered(scattered) => scattered.values,
        Samples::Function(_) => Vec::new(),
    }
}

#[test]
fn a_lambertian_surface_is_the_same_everywhere() {
    let json =
        document("brdf", "{\"lambert\":{\"reflectance\":0.5}}", "[\"hemi:1\",\"hemi:2\",\"lambda:400:100:4\"]", "");
    let read = read(&json).unwrap();
    assert_eq!((read.format, read.quantity, read.unit), ("virtual", Quantity::Brdf, Unit::PerSteradian));
    let Samples::OnAxes { tensor, sampling } = read.samples else { panic!("on axes") };
    assert_eq!((tensor.shape(), sampling), (vec![16, 64, 4], Sampling::Average));
    assert!(tensor.samples().iter().all(|s| (s - 0.5 / std::f32::consts::PI).abs() < 1e-7));
}

#[test]
fn phase_functions_integrate_to_one() {
    let mesh = TriangleMesh::new(Domain::Sphere, 4).unwrap();
    for (model, tolerance) in [
        ("\"rayleigh\"", 1e-4),
        ("\"hazy\"", 2e-3),
        ("\"murky\"", 3e-2),
        ("{\"henyey_greenstein\":{\"g\":0.6}}", 2e-3),
        ("{\"double_henyey_greenstein\":{\"weight\":0.7,\"g1\":0.6,\"g2\":-0.3}}", 2e-3),
        ("{\"schlick\":{\"r\":0.5,\"k1\":-0.46,\"k2\":0.46}}", 1e-3),
        ("{\"sum\":[{\"scale\":0.25,\"lobe\":\"rayleigh\"},{\"scale\":0.75,\"lobe\":\"hazy\"}]}", 2e-3),
    ] {
        let values = samples(&document("phase", model, "[\"sphere:0\",\"sphere:4\"]", ""));
        for row in values.chunks(mesh.len()) {
            let total: f64 = row.iter().enumerate().map(|(i, &p)| f64::from(p) * mesh.solid_angle(i)).sum();
            assert!((total - 1.0).abs() < tolerance, "{model}: {total}");
        }
    }
}

#[test]
fn forward_scattering_leaves_opposite_to_the_source() {
    let model = "{\"henyey_greenstein\":{\"g\":0.8}}";
    let values = samples(&document("phase", model, "[\"sphere:1\",\"sphere:1\"]", ",\"sampling\":\"point\""));
    let mesh = TriangleMesh::new(Domain::Sphere, 1).unwrap();
    for (i, row) in values.chunks(mesh.len()).enumerate() {
        let brightest = row.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)).unwrap().0;
        assert!(mesh.centroid(i).dot(mesh.centroid(brightest)) < -0.999);
    }
}

#[test]
fn physical_surfaces_reflect_no_more_than_arrives() {
    let metal = "{\"ggx\":{\"alpha\":{\"anisotropic\":[0.2,0.5]},\"fresnel\":{\"conductor\":{\"n\":0.2,\"k\":3.9}},\"frame\":{\"turn\":30}}}";
    let mirror = "{\"ggx\":{\"alpha\":{\"isotropic\":0.4},\"fresnel\":\"mirror\"}}";
    let velvet = "{\"asperity\":{\"albedo\":1,\"depth\":0.3,\"back\":0.6,\"g_back\":0.55,\"g_forward\":0.3}}";
    let rough = "{\"oren_nayar\":{\"reflectance\":1,\"sigma\":0.6}}";
    for model in [metal, mirror, velvet, rough] {
        let read = read(&document("brdf", model, "[\"hemi:0\",\"hemi:0\",\"lambda:500:10:1\"]", "")).unwrap();
        assert!(
            read.report.notes.iter().all(|note| note.kind != NoteKind::Warning),
            "{model}: {:?}",
            read.report.notes
        );
        let lobes = model::lobes(&serde_json::from_str(model).unwrap(), Quantity::Brdf, &[500.0]).unwrap();
        for theta in [0.0, 20.0, 45.0, 70.0, 85.0] {
            let albedo = albedo(&lobes, theta, 1)[0];
            assert!(albedo > 0.01 && albedo < 1.005, "{model} at {theta}: {albedo}");
        }
    }
    let both =
        "{\"sum\":[{\"lobe\":{\"lambert\":{\"reflectance\":0.9}}},{\"lobe\":{\"lambert\":{\"reflectance\":0.4}}}]}";
    let read = read(&document("brdf", both, "[\"hemi:0\",\"hemi:0\"]", ",\"wavelength\":500")).unwrap();
    assert!(read.report.notes.iter().any(|n| n.kind == NoteKind::Warning && n.message.contains("more than arrives")));
}

#[test]
fn averages_tend_to_the_integral_and_points_are_centroids() {
    // The mean of cos² over the nadir's octants, in closed form ∫cos²dω/∫dω = 1/3.
    let axes = "[\"sphere:0\"]";
    let lobe = "{\"cosine_power\":{\"theta\":180,\"exponent\":2}}";
    let averages = samples(&document("edf", lobe, axes, ",\"wavelength\":500"));
    assert!((averages[5] - 1.0 / 3.0).abs() < 2e-3 && averages[0] == 0.0, "{averages:?}");
    let points = samples(&document("edf", lobe, axes, ",\"wavelength\":500,\"sampling\":\"point\""));
    assert!((points[5] - 1.0 / 3.0).abs() < 1e-6);
    let narrow = "{\"cosine_power\":{\"theta\":180,\"exponent\":20}}";
    let averages = samples(&document("edf", narrow, axes, ",\"wavelength\":500"));
    assert!((averages[5] - 1.0 / 21.0).abs() < 2e-3, "{averages:?}");
}

#[test]
fn spectra_and_interfaces_need_no_directions() {
    let spectrum =
        samples(&document("spectrum", "{\"spectrum\":{\"planck\":{\"kelvin\":5000}}}", "[\"lambda:560:10:1\"]", ""));
    assert!((spectrum[0] - 1.0).abs() < 1e-6);
    let fresnel = "{\"fresnel\":{\"cauchy\":{\"a\":1.5}}}";
    let axes = "[{\"kind\":\"elevation\",\"values\":[0,90]},\"lambda:500:10:2\"]";
    let reflectance = samples(&document("reflectance", fresnel, axes, ",\"sampling\":\"point\""));
    assert!((reflectance[0] - 0.04).abs() < 1e-6 && reflectance[3] > 0.999);
}

#[test]
fn the_same_document_gives_the_same_bytes_and_noise_its_share() {
    let axes = "[\"hemi:1\",\"hemi:3\",\"lambda:400:10:9\"]";
    let model = "{\"lambert\":{\"reflectance\":0.5}}";
    let clean = samples(&document("brdf", model, axes, ""));
    let noisy =
        |seed| samples(&document("brdf", model, axes, &format!(",\"noise\":{{\"relative\":0.01,\"seed\":{seed}}}")));
    assert_eq!(noisy(3), noisy(3));
    assert_ne!(noisy(3), noisy(4));
    let n = clean.len() as f64;
    let square: f64 = clean.iter().zip(noisy(3)).map(|(&c, d)| f64::from((d - c) / c).powi(2)).sum();
    // The standard error of a standard deviation is σ/√(2n).
    assert!(((square / n).sqrt() - 0.01).abs() < 5.0 * 0.01 / (2.0 * n).sqrt());
}

#[test]
fn angles_make_a_virtual_goniometer() {
    let axes = "[{\"kind\":\"theta_i\",\"values\":[0,20,40,60,80],\"covers\":[0,90]},{\"kind\":\"phi_i\",\"values\":[0,90,180,270]},\
                 {\"kind\":\"theta_o\",\"values\":[0,15,30,45,60,75],\"covers\":[0,90]},{\"kind\":\"phi_o\",\"values\":[0,60,120,180,240,300]},\
                 \"lambda:400:100:3\"]";
    let model = "{\"oren_nayar\":{\"reflectance\":0.8,\"sigma\":0.3}}";
    let read = read(&document("brdf", model, axes, ",\"noise\":{\"relative\":0.002,\"seed\":5}")).unwrap();
    assert!(matches!(&read.samples, Samples::Grid(grid) if grid.values.len() == 5 * 4 * 6 * 6 * 3));
}

#[test]
fn refusals_say_where_and_what() {
    use FormatErrorKind::{Malformed, NeedsOption, OverLimit};
    let lambert = "{\"lambert\":{\"reflectance\":0.5}}";
    let axes = "[\"hemi:0\",\"hemi:0\",\"lambda:500:10:2\"]";
    let cases = [
        (
            Malformed,
            document("brdf", "{\"lambert\":{\"reflectence\":0.5}}", axes, ""),
            "line 1, column 73: unknown field `reflectence`",
        ),
        (Malformed, document("brdf", "{\"phong\":{}}", axes, ""), "unknown variant `phong`"),
        (
            Malformed,
            document("brdf", "{\"lambert\":{\"reflectance\":1.5}}", axes, ""),
            "model.lambert.reflectance is 1.5 at 500 nm, expected 0 to 1",
        ),
        (Malformed, document("brdf", lambert, axes, ",\"colour\":1"), "unknown field `colour`"),
        (
            Malformed,
            document("brdf", "\"rayleigh\"", axes, ""),
            "model.rayleigh is of quantity phase, expected brdf as the document states",
        ),
        (
            Malformed,
            document("brdf", "{\"ggx\":{\"alpha\":{\"isotropic\":0},\"fresnel\":\"mirror\"}}", axes, ""),
            "model.ggx.alpha is 0, expected 0.001 to 1",
        ),
        (
            Malformed,
            document(
                "brdf",
                "{\"ggx\":{\"alpha\":{\"isotropic\":0.1},\"fresnel\":{\"cauchy\":{\"a\":0.5}}}}",
                axes,
                "",
            ),
            "the index is 0.5 at 500 nm",
        ),
        (Malformed, document("brdf", "{\"sum\":[]}", axes, ""), "expected at least one"),
        (
            Malformed,
            document(
                "brdf",
                "{\"sum\":[{\"lobe\":{\"asperity\":{\"albedo\":1,\"depth\":1,\"back\":2,\"g_back\":0,\"g_forward\":0}}}]}",
                axes,
                "",
            ),
            "model.sum[0].asperity.back is 2",
        ),
        (
            Malformed,
            document("brdf", lambert, "[\"hemi:0\",\"sphere:0\",\"lambda:500:10:2\"]", ""),
            "on the sphere, expected the hemisphere",
        ),
        (Malformed, document("brdf", lambert, "[\"hemi:0\",\"hemi:0\",\"rgb\"]", ""), "expected wavelengths"),
        (Malformed, document("brdf", lambert, "[\"index\",\"hemi:0\",\"hemi:0\"]", ""), "an index has no meaning"),
        (
            Malformed,
            document("phase", "{\"sum\":[{\"scale\":2,\"lobe\":\"rayleigh\"}]}", "[\"sphere:0\",\"sphere:0\"]", ""),
            "the weights add to 2",
        ),
        (
            Malformed,
            document("phase", "{\"henyey_greenstein\":{\"g\":1}}", "[\"sphere:0\",\"sphere:0\"]", ""),
            "g is 1, expected between -1 and 1",
        ),
        (Malformed, document("brdf", lambert, axes, ",\"noise\":{\"relative\":2,\"seed\":1}"), "noise.relative is 2"),
        (Malformed, document("brdf", lambert, axes, ",\"noise\":{\"absolute\":-1,\"seed\":1}"), "noise.absolute is -1"),
        (Malformed, document("brdf", lambert, axes, ",\"wavelength\":500"), "beside an axis of wavelengths"),
        (Malformed, document("brdf", lambert, "[\"hemi:0\",\"hemi:0\"]", ",\"wavelength\":-1"), "wavelength is -1"),
        (NeedsOption, document("brdf", lambert, "[\"hemi:0\",\"moon:0\"]", ""), "axis 1: found `\"moon:0\"`"),
        (NeedsOption, document("brdf", lambert, "[\"hemi:0\",\"hemi:0\",\"lambda\"]", ""), "does not say which"),
        (OverLimit, document("brdf", lambert, "[\"hemi:8\",\"hemi:8\",\"lambda:500:1:2\"]", ""), "more than the limit"),
        (
            OverLimit,
            document(
                "brdf",
                "{\"sum\":[{\"lobe\":{\"ggx\":{\"alpha\":{\"isotropic\":0.1},\"fresnel\":{\"cauchy\":{\"a\":1.5}}}}}]}",
                "[\"hemi:5\",\"hemi:6\",\"lambda:500:1:1000\"]",
                "",
            ),
            "more than the limit",
        ),
        (
            OverLimit,
            document(
                "brdf",
                "{\"sum\":[{\"lobe\":{\"ggx\":{\"alpha\":{\"isotropic\":0.1},\"fresnel\":{\"cauchy\":{\"a\":1.5}}}}}]}",
                "[\"hemi:0\",\"hemi:0\",\"lambda:500:0.01:65536\"]",
                "",
            ),
            "too many evaluations",
        ),
        (Malformed, "{\"wavelume\":\"virtual\",".to_owned(), "line 1"),
        (Malformed, "{\"wavelume\":1,\"virtual\":1}".to_owned(), "invalid type"),
    ];
    for (kind, json, expected) in cases {
        let error = read(&json).map(|_| ()).unwrap_err();
        assert!(error.to_string().contains(expected), "{json}: {error}");
        assert_eq!((error.kind, error.format), (kind, "virtual"), "{json}: {error}");
    }
}

#[test]
fn values_of_a_model_hold_no_cosine() {
    let json = document("brdf", "{\"lambert\":{\"reflectance\":0.5}}", "[]", "");
    let axes = json!({"cosine_included": true, "axes": ["hemi:0", "hemi:1", "lambda:400:100:4"]});
    let how = Interpretation { axes: Some(axes), ..Interpretation::default() };
    let error = formats::read(json.as_bytes(), &how).map(|_| ()).unwrap_err();
    assert!(error.kind == FormatErrorKind::NeedsOption && error.message.contains("expected false"), "{error}");
}

#[test]
fn every_document_of_the_examples_reads() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data/virtual");
    let mut found = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let bytes = std::fs::read(&path).unwrap();
        // On coarse axes: what is tested is the document, not the arithmetic.
        let quantity = serde_json::from_slice::<Value>(&bytes).unwrap()["quantity"].as_str().unwrap().to_owned();
        let axes = match quantity.as_str() {
            "brdf" => json!(["hemi:0", "hemi:1", "lambda:400:100:4"]),
            "phase" => json!(["sphere:0", "sphere:1"]),
            _ => json!(["sphere:1", "lambda:400:100:4"]),
        };
        let how = Interpretation { axes: Some(axes), ..Interpretation::default() };
        let read = formats::read(&bytes, &how).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        assert!(read.report.notes.iter().all(|n| n.kind != NoteKind::Warning), "{path:?}: {:?}", read.report.notes);
        assert_eq!(read.report.metadata[0].0, "name");
        assert!(read.report.notes.iter().all(|n| !n.message.contains("cosine")), "{:?}", read.report.notes);
        found += 1;
    }
    assert!(found >= 10);
}
