//! A virtual goniometer: a material measured at scattered directions with noise, and its projection onto triangles.
//!
//! The paper's BRDF tables score against the samples of the instrument, so that even keeping everything costs the error of
//! projecting them onto triangles (its 1:1 rows). Here 1,024 directions lie on rings of nearly equal spacing, about one
//! a triangle: some triangles hold several, some none.

use super::PaperError;
use super::data;
use crate::domain::{Axis, Direction, Domain, ErrorReport, TriangleMesh, WavelengthGrid};
use crate::formats::{Acquisition, Samples};
use rayon::prelude::*;
use serde_json::{Value, json};

/// A measured material in the layout of the paper's BRDFs.
pub(super) struct Goniometer {
    /// `[16 incoming, 1024 triangles, 75 wavelengths]`.
    pub(super) axes: Vec<Axis>,
    /// The projected samples on these axes.
    pub(super) projected: Vec<f32>,
    /// What the instrument read, `[16 incoming, 1024 directions, 75 wavelengths]`.
    pub(super) readings: Vec<f32>,
    /// The triangle of each direction.
    cells: Vec<usize>,
}

const DIRECTIONS: usize = 1024;
const RINGS: usize = 20;
const LAMBDAS: usize = 75;
/// Samples that the middle of an empty triangle is interpolated from.
const NEIGHBOURS: usize = 3;

/// A ring of directions: its theta and azimuths in degrees.
struct Ring {
    theta: f64,
    phi: Vec<f64>,
}

impl Goniometer {
    /// Measures the material that `document` describes.
    pub(super) fn measure(document: &str) -> Result<Self, PaperError> {
        let document: Value = serde_json::from_str(document).map_err(|e| PaperError::Data(e.to_string()))?;
        let lost = || PaperError::Data("a mesh is over the limit of levels".to_owned());
        let incoming = TriangleMesh::new(Domain::Hemisphere, 1).ok_or_else(lost)?;
        let outgoing = TriangleMesh::new(Domain::Hemisphere, 4).ok_or_else(lost)?;
        let rings = rings();
        let parts: Vec<Result<Vec<f32>, PaperError>> =
            (0..incoming.len()).into_par_iter().map(|i| readings(&document, incoming.centroid(i), &rings, i)).collect();
        let mut samples = Vec::with_capacity(incoming.len() * DIRECTIONS * LAMBDAS);
        for part in parts {
            samples.extend(part?);
        }
        let directions: Vec<Direction> = rings
            .iter()
            .flat_map(|ring| ring.phi.iter().map(|&phi| Direction::from_degrees(ring.theta, phi)))
            .collect();
        let cells: Vec<usize> = directions.iter().filter_map(|&direction| outgoing.locate(direction)).collect();
        if cells.len() != DIRECTIONS || samples.len() != incoming.len() * DIRECTIONS * LAMBDAS {
            return Err(PaperError::Data("the goniometer lost directions".to_owned()));
        }
        let weights = weights(outgoing, &directions, &cells);
        let mut projected = vec![0.0_f32; samples.len()];
        projected.par_chunks_mut(LAMBDAS).enumerate().for_each(|(cell, spectrum)| {
            let (i, triangle) = (cell / DIRECTIONS, cell % DIRECTIONS);
            for (lambda, value) in spectrum.iter_mut().enumerate() {
                let reading = |direction: usize| f64::from(samples[(i * DIRECTIONS + direction) * LAMBDAS + lambda]);
                *value = weights[triangle].iter().map(|&(d, weight)| weight * reading(d)).sum::<f64>() as f32;
            }
        });
        let lambdas = WavelengthGrid::even(380.0, 5.0, LAMBDAS).map_err(|e| PaperError::Data(e.to_string()))?;
        let axes = vec![Axis::Triangles(incoming), Axis::Triangles(outgoing), Axis::Wavelength(lambdas)];
        Ok(Self { axes, projected, readings: samples, cells })
    }

    /// The errors of decoded triangles at the instrument's directions.
    pub(super) fn errors(&self, decoded: &[f32]) -> ErrorReport {
        let mut looked_up = vec![0.0_f32; self.readings.len()];
        looked_up.par_chunks_mut(LAMBDAS).enumerate().for_each(|(at, spectrum)| {
            let (i, direction) = (at / DIRECTIONS, at % DIRECTIONS);
            let cell = i * DIRECTIONS + self.cells[direction];
            spectrum.copy_from_slice(&decoded[cell * LAMBDAS..][..LAMBDAS]);
        });
        ErrorReport::measure(&self.readings, &looked_up, 0.0)
    }
}

/// Rings from the normal to the horizon with directions in proportion to their circumference, 1,024 together.
fn rings() -> Vec<Ring> {
    let theta = |j: usize| 90.0 * (j as f64 + 0.5) / RINGS as f64;
    let around = |j: usize| Direction::from_degrees(theta(j), 0.0).xyz()[0];
    let total: f64 = (0..RINGS).map(around).sum();
    let mut so_far = 0.0;
    let mut given = 0;
    (0..RINGS)
        .map(|j| {
            // Rounding the running sum gives exactly 1,024 in the end.
            so_far += around(j);
            let upto = (DIRECTIONS as f64 * so_far / total).round() as usize;
            let count = upto - given;
            given = upto;
            let step = 360.0 / count as f64;
            // The golden ratio keeps neighbouring rings out of step.
            let offset = step * (j as f64 * 0.618_033_988_749_895).fract();
            Ring { theta: theta(j), phi: (0..count).map(|k| offset + step * k as f64).collect() }
        })
        .collect()
}

fn readings(document: &Value, wi: Direction, rings: &[Ring], incoming: usize) -> Result<Vec<f32>, PaperError> {
    let mut samples = Vec::with_capacity(DIRECTIONS * LAMBDAS);
    for (j, ring) in rings.iter().enumerate() {
        let mut document = document.clone();
        document["axes"] = json!([
            {"kind": "theta_i", "values": [wi.theta_degrees()]},
            {"kind": "phi_i", "values": [wi.phi_degrees()], "extent": "sector"},
            {"kind": "theta_o", "values": [ring.theta]},
            {"kind": "phi_o", "values": ring.phi, "extent": "circle"},
            "lambda:380:5:75"]);
        // Each reading has noise of its own.
        document["noise"]["seed"] = json!(incoming * RINGS + j);
        let Acquisition { samples: Samples::Grid(grid), .. } = data::acquire(document.to_string().as_bytes())? else {
            return Err(PaperError::Data("a goniometer without angles".to_owned()));
        };
        samples.extend(grid.values);
    }
    Ok(samples)
}

/// Which directions a triangle's value comes from: the mean of those inside, else the nearest by inverse distance.
fn weights(mesh: TriangleMesh, directions: &[Direction], cells: &[usize]) -> Vec<Vec<(usize, f64)>> {
    (0..mesh.len())
        .map(|triangle| {
            let inside: Vec<usize> = (0..directions.len()).filter(|&d| cells[d] == triangle).collect();
            if !inside.is_empty() {
                return inside.iter().map(|&d| (d, 1.0 / inside.len() as f64)).collect();
            }
            let middle = mesh.centroid(triangle);
            let mut near: Vec<(f64, usize)> =
                directions.iter().enumerate().map(|(d, direction)| (1.0 - direction.dot(middle), d)).collect();
            near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            near.truncate(NEIGHBOURS);
            let total: f64 = near.iter().map(|(distance, _)| 1.0 / distance).sum();
            near.into_iter().map(|(distance, d)| (d, 1.0 / distance / total)).collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_goniometer_has_about_one_direction_a_triangle() {
        let rings = rings();
        assert_eq!(rings.iter().map(|ring| ring.phi.len()).sum::<usize>(), DIRECTIONS);
        let measured = Goniometer::measure(data::MATERIALS[0].1).unwrap();
        assert_eq!(measured.projected.len(), 1_228_800);
        let mut counts = vec![0; DIRECTIONS];
        measured.cells.iter().for_each(|&cell| counts[cell] += 1);
        assert!(counts.iter().filter(|&&n| n == 1).count() > 400 && counts.iter().all(|&n| n < 6));
        let errors = measured.errors(&measured.projected);
        assert!(errors.er_l2 > 1e-4 && errors.er_l2 < 0.02, "{errors:?}");
        assert_eq!(errors.scored_samples, 1_228_800);
    }

    #[test]
    fn a_grid_of_angles_is_projected_like_that_of_a_real_instrument() {
        use crate::projection::{AxesRequest, error_at_samples, project};
        let document = json!({
            "wavelume": "virtual", "quantity": "brdf", "noise": {"relative": 0.002, "seed": 5},
            "model": {"oren_nayar": {"reflectance": 0.8, "sigma": 0.3}},
            "axes": [
                {"kind": "theta_i", "values": [0, 20, 40, 60, 80], "covers": [0, 90]},
                {"kind": "phi_i", "values": [0, 90, 180, 270]},
                {"kind": "theta_o", "values": [0, 15, 30, 45, 60, 75], "covers": [0, 90]},
                {"kind": "phi_o", "values": [0, 60, 120, 180, 240, 300]},
                "lambda:400:100:3"]});
        let read = data::acquire(document.to_string().as_bytes()).unwrap();
        let request = AxesRequest { incoming_level: Some(1), outgoing_level: Some(2), wavelengths: None };
        let projected = project(&read, &request).unwrap().measurement;
        assert_eq!(projected.tensor.shape(), [16, 64, 3]);
        let errors = error_at_samples(&read, &projected).unwrap();
        assert!(errors.er_l2 > 0.001 && errors.er_l2 < 0.2, "{errors:?}");
    }
}
