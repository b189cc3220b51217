//! Real files through the parsers onto triangles: flux, levels and errors at the files' own samples.

use std::f64::consts::PI;
use std::path::{Path, PathBuf};
use wavelume_core::domain::{Axis, Direction, Domain, Quantity, TriangleMesh};
use wavelume_formats::formats::{
    Acquisition, Angles, AzimuthExtent, Interpretation, Outside, Samples, TEMPLATES, attach_spectrum, read, write_npy,
};
use wavelume_formats::projection::{AxesRequest, DirectionDomain, Projected, error_at_samples, project};

fn acquire(path: &Path) -> Acquisition {
    let bytes = std::fs::read(path).unwrap();
    read(&bytes, &Interpretation::default()).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn bundled(name: &str) -> Acquisition {
    acquire(&crate::root().join("data").join(name))
}

/// Every luminaire of the fixtures and the bundled data that parses.
fn luminaires() -> Vec<(PathBuf, Acquisition)> {
    let root = crate::root();
    let mut files = Vec::new();
    for directory in ["data", "tests/fixtures/ies", "tests/fixtures/ldt"] {
        files.extend(std::fs::read_dir(root.join(directory)).unwrap().map(|entry| entry.unwrap().path()));
    }
    // One of the files that differ in their opening only.
    files.push(root.join("tests/fixtures/ies/photometric-viewer/absolute_photometry_with_multiplier.ies"));
    files.retain(|path| path.extension().is_some_and(|e| e == "ies" || e == "ldt"));
    files.sort();
    let parsed = files.into_iter().filter_map(|path| {
        let bytes = std::fs::read(&path).unwrap();
        Some((path, read(&bytes, &Interpretation::default()).ok()?))
    });
    parsed.collect()
}

/// Files with a grid of angles leave it.
fn on_triangles() -> AxesRequest {
    AxesRequest { domain: Some(DirectionDomain::Triangles), ..AxesRequest::default() }
}

fn mesh(projected: &Projected, axis: usize) -> TriangleMesh {
    match &projected.measurement.tensor.axes()[axis] {
        Axis::Triangles(mesh) => *mesh,
        other => panic!("{other:?}"),
    }
}

/// The share of each azimuth in the mean over the circle.
fn shares(angles: &Angles) -> Vec<f64> {
    let Some(azimuths) = &angles.phi else { return vec![1.0] };
    let (phi, n) = (&azimuths.phi, azimuths.phi.len());
    let (before, after) = match azimuths.extent {
        AzimuthExtent::Circle => (phi[n - 1] - 360.0, phi[0] + 360.0),
        AzimuthExtent::Mirrored => (-phi[0], 360.0 - phi[n - 1]),
        AzimuthExtent::Sector => panic!("a luminaire is measured all round"),
    };
    let all = if azimuths.extent == AzimuthExtent::Circle { 360.0 } else { 180.0 };
    let at = |i: usize| phi.get(i).copied().unwrap_or(after);
    let width = |i: usize| {
        let left = if i == 0 { before } else { phi[i - 1] };
        // A mirrored circle ends half way to the image of its first and last azimuth: that half counts once.
        let (left, right) = if azimuths.extent == AzimuthExtent::Mirrored {
            (left.max(-phi[i]), at(i + 1).min(360.0 - phi[i]))
        } else {
            (left, at(i + 1))
        };
        0.5 * (right - left)
    };
    let widths: Vec<f64> = (0..n).map(width).collect();
    let total: f64 = widths.iter().sum();
    assert!(total <= all + 1e-9);
    widths.iter().map(|w| w / total).collect()
}

/// The flux of a grid by its own quadrature: exact for intensities linear in theta between rows.
fn flux(acquisition: &Acquisition) -> f64 {
    let Samples::Grid(grid) = &acquisition.samples else { panic!("a grid") };
    let angles = grid.outgoing.as_ref().unwrap();
    let shares = shares(angles);
    let n = shares.len();
    let row = |r: usize| -> f64 {
        grid.values[r * n..(r + 1) * n].iter().zip(&shares).map(|(&v, share)| f64::from(v) * share).sum()
    };
    let theta: Vec<f64> = angles.theta.iter().map(|t| t.to_radians()).collect();
    let last = theta.len() - 1;
    let zones = (0..last).map(|r| {
        let (a, b) = (theta[r], theta[r + 1]);
        let slope = (row(r + 1) - row(r)) / (b - a);
        row(r) * a.cos() - row(r + 1) * b.cos() + slope * (b.sin() - a.sin())
    });
    let (low, high) = (angles.covers.0.to_radians(), angles.covers.1.to_radians());
    let held = row(0) * (low.cos() - theta[0].cos()) + row(last) * (theta[last].cos() - high.cos());
    2.0 * PI * (zones.sum::<f64>() + held)
}

#[test]
fn projected_luminaires_keep_their_flux() {
    let luminaires = luminaires();
    assert!(luminaires.len() >= 8, "{}", luminaires.len());
    for (path, acquired) in luminaires {
        let projected = project(&acquired, &on_triangles()).unwrap();
        let mesh = mesh(&projected, 0);
        let samples = projected.measurement.tensor.samples();
        let found: f64 = samples.iter().zip(mesh.solid_angles()).map(|(&s, angle)| f64::from(s) * angle).sum();
        let expected = flux(&acquired);
        assert!((found / expected - 1.0).abs() < 0.002, "{}: {found} vs {expected}", path.display());
        let coverage = &projected.coverage;
        assert_eq!(coverage.measured + coverage.interpolated + coverage.empty, coverage.cells);
        assert_eq!(projected.measurement.tensor.masked(), 0, "{}: outside is 0", path.display());
    }
}

#[test]
fn a_luminaire_and_its_spectrum_become_a_spectral_emission() {
    let mut acquired = bundled("aerolamp.ies");
    attach_spectrum(&mut acquired, &bundled("aerolamp.csv")).unwrap();
    let projected = project(&acquired, &on_triangles()).unwrap();
    let chosen = mesh(&projected, 0);
    assert_eq!((chosen.domain(), chosen.level()), (Domain::Sphere, 5));
    let note = "outgoing level 5 on the sphere: cells of 2.2° for samples every 2.5° × 11.25°";
    assert!(projected.coverage.notes[0].message.starts_with(note), "{:?}", projected.coverage.notes);
    assert_eq!((projected.coverage.cells, projected.coverage.empty), (8192, 4096));
    let lambdas = acquired.spectral_factor.as_ref().unwrap().grid.len();
    assert_eq!(projected.measurement.tensor.shape(), [8192, lambdas]);
    let coarse = error_at_samples(&acquired, &projected.measurement).unwrap();
    assert_eq!((coarse.samples, coarse.mask_mismatches), (37 * 32 * lambdas as u64, 0));
    let request = AxesRequest { outgoing_level: Some(6), ..AxesRequest::default() };
    let fine = error_at_samples(&acquired, &project(&acquired, &request).unwrap().measurement).unwrap();
    assert!(coarse.relative_rmse < 0.06 && fine.relative_rmse < 0.6 * coarse.relative_rmse, "{coarse:?} {fine:?}");
}

#[test]
fn a_measured_car_paint_keeps_its_elevations() {
    let acquired = bundled("carpaint_blue.mbsdf");
    let Samples::Grid(grid) = &acquired.samples else { panic!("a grid") };
    assert_eq!((acquired.quantity, grid.outside), (Quantity::Brdf, Outside::Masked));
    let projected = project(&acquired, &on_triangles()).unwrap();
    let axes = projected.measurement.tensor.axes();
    assert_eq!(axes[0], Axis::Elevation(grid.incoming.as_ref().unwrap().theta.clone()));
    let chosen = mesh(&projected, 1);
    assert_eq!((chosen.domain(), chosen.level()), (Domain::Hemisphere, 5));
    assert_eq!((projected.coverage.cells, projected.coverage.empty), (45 * 4096, 0));
    let errors = error_at_samples(&acquired, &projected.measurement).unwrap();
    assert_eq!((errors.samples, errors.mask_mismatches), (45 * 45 * 90 * 3, 0));
    // The highlight is as narrow as the samples: a cell of 2.2° flattens it.
    assert!(errors.relative_rmse < 0.25, "{errors:?}");

    // The plane of incidence mirrors the data, and the triangles on its two sides mirror each other.
    let brdf = projected.measurement.as_brdf().unwrap();
    for cell in 0..chosen.len() {
        let [x, y, z] = chosen.centroid(cell).xyz();
        let image = chosen.locate(Direction::new(x, -y, z).unwrap()).unwrap();
        for (a, b) in brdf.at(20).at(cell).samples().iter().zip(brdf.at(20).at(image).samples()) {
            assert!((a - b).abs() <= 1e-5 * a.abs().max(1e-3), "{cell} {image}: {a} {b}");
        }
    }
}

#[test]
fn measured_materials_become_averages_of_their_own_function_and_compress() {
    use wavelume_core::compress::Target;
    use wavelume_core::domain::Silent;
    use wavelume_formats::pipeline::{self, Input, Request};
    for (name, shape) in [
        ("isotropic-spectral-jacobian-1", [3, 64, 5]),
        ("anisotropic-spectral-jacobian-1", [16, 64, 5]),
        ("half-turn-rgb-jacobian-1", [16, 64, 3]),
        ("quarter-turn-spectral-jacobian-0", [16, 64, 5]),
    ] {
        let path = crate::root().join(format!("tests/fixtures/rgl/{name}.bsdf"));
        let bytes = std::fs::read(&path).unwrap();
        let interpretation = Interpretation::default();
        let source = pipeline::read(&Input { bytes: &bytes, spectrum: None, interpretation: &interpretation }).unwrap();
        let incoming_level = (shape[0] == 16).then_some(1);
        let request = Request { incoming_level, outgoing_level: Some(2), ..Request::to(Target::ErL2(0.01)) };
        let projected = pipeline::project(&source.acquisition, &request).unwrap();
        let tensor = &projected.measurement.tensor;
        assert_eq!((tensor.shape(), tensor.masked()), (shape.to_vec(), 0), "{name}");
        assert!(tensor.range().unwrap().0 > 0.0);
        let report = pipeline::compress(&source, &request, &Silent).unwrap().report;
        assert!(report.errors.er_l2 <= 0.01 && report.format == "rgl", "{name}");
    }
}

#[test]
fn every_template_that_is_data_projects() {
    let python = |name: &str| name.ends_with("python");
    for template in TEMPLATES.iter().filter(|template| !python(template.name)) {
        let mut how = Interpretation::default();
        let array = write_npy(&[3, 5, 5, 31], &[0.5; 3 * 5 * 5 * 31]);
        let mut bytes = template.text.as_bytes();
        if template.name == "npy-manifest" {
            how.axes = Some(serde_json::from_str(template.text).unwrap());
            bytes = &array;
        }
        let acquisition = read(bytes, &how).unwrap();
        let projected = project(&acquisition, &on_triangles());
        let projected = projected.unwrap_or_else(|error| panic!("{}: {error}", template.name));
        assert!(projected.measurement.tensor.range().is_some(), "{}", template.name);
    }
}
