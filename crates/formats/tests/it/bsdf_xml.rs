//! BSDFs of WINDOW and Radiance on the axes onto which they are projected.

use super::root;
use wavelume_core::domain::{Axis, Domain, Quantity};
use wavelume_formats::formats::{Acquisition, Interpretation, read};
use wavelume_formats::projection::{AxesRequest, plausibility, project};

/// Tensor trees of rank 3, one for each `(direction, values)`.
fn trees(functions: &[(&str, &str)]) -> Acquisition {
    let block = |&(direction, values): &(&str, &str)| {
        format!(
            "<WavelengthData><Wavelength>Visible</Wavelength><WavelengthDataBlock><WavelengthDataDirection>{direction}\
             </WavelengthDataDirection><AngleBasis>LBNL/Shirley-Chiu</AngleBasis><ScatteringData>{values}</ScatteringData>\
             </WavelengthDataBlock></WavelengthData>"
        )
    };
    let blocks: String = functions.iter().map(block).collect();
    let text = format!(
        "<WindowElement><Optical><Layer><DataDefinition><IncidentDataStructure>TensorTree3</IncidentDataStructure>\
         </DataDefinition>{blocks}</Layer></Optical></WindowElement>"
    );
    read(text.as_bytes(), &Interpretation::default()).unwrap()
}

#[test]
fn albedos_are_sums_over_patches() {
    let bytes = std::fs::read(root().join("tests/fixtures/bsdf_xml/quarter.xml")).unwrap();
    let text = String::from_utf8(bytes.clone()).unwrap();
    let data = text.split("<ScatteringData>").nth(1).unwrap().split("</").next().unwrap();
    let values: Vec<f64> = data.split([',', ' ', '\n']).filter_map(|word| word.parse().ok()).collect();
    let rings = [(0.0, 9.0, 1), (9.0, 27.0, 8), (27.0, 45.0, 12), (45.0, 63.0, 12), (63.0, 90.0, 8)];
    let solid_angles: Vec<f64> = rings
        .iter()
        .flat_map(|&(low, high, count): &(f64, f64, usize)| {
            let square = |angle: f64| angle.to_radians().cos().powi(2);
            vec![std::f64::consts::PI * (square(low) - square(high)) / count as f64; count]
        })
        .collect();
    let albedo = |i: usize| solid_angles.iter().enumerate().map(|(o, solid)| values[41 * o + i] * solid).sum::<f64>();
    let wanted = (0..41).map(albedo).fold(0.0, f64::max);
    let acquisition = read(&bytes, &Interpretation::default()).unwrap();
    let largest = plausibility(&acquisition).albedo.unwrap().albedo;
    assert!((largest / wanted - 1.0).abs() < 1e-4, "{largest} {wanted}");
}

#[test]
fn isotropic_trees_become_averages_over_triangles() {
    // One halving: of 0.5 - 0.5 sin theta, and the quadrants of the outgoing direction.
    let found = trees(&[("Transmission Front", "{0 1 2 3 4 5 6 7}")]);
    let request = AxesRequest { outgoing_level: Some(3), ..AxesRequest::default() };
    let projected = project(&found, &request).unwrap();
    let tensor = &projected.measurement.tensor;
    let [Axis::Elevation(elevations), Axis::Triangles(mesh)] = tensor.axes() else { panic!("{:?}", tensor.axes()) };
    assert_eq!((elevations.len(), mesh.domain()), (1, Domain::Lower));
    for (sample, cell) in tensor.samples().iter().zip(0..) {
        // Light comes from azimuth 0; seen from outdoors, azimuths run the other way.
        let wo = mesh.centroid(cell).xyz();
        let expected = 2 * i32::from(-wo[0] >= 0.0) + i32::from(wo[1] >= 0.0);
        assert!((f64::from(*sample) - f64::from(expected)).abs() < 1e-6, "{cell}: {sample} {expected}");
    }
}

#[test]
fn trees_of_both_kinds_make_one_function() {
    let found = trees(&[("Transmission Front", "{0.25}"), ("Reflection Front", "{0.0625}")]);
    assert_eq!(found.quantity, Quantity::Bsdf);
    let tensor = project(&found, &AxesRequest::default()).unwrap().measurement.tensor;
    let (above, below) = tensor.samples().split_at(tensor.len() / 2);
    assert!(above.iter().all(|&x| x == 0.0625) && below.iter().all(|&x| x == 0.25));
}
