//! Virtual goniometer: measures a material at scattered directions with noise, and projects it onto triangles.
//!
//! The paper's BRDF tables score against the samples of the instrument. Even without dropping coefficients they include
//! the error of projecting the samples onto triangles (its 1:1 rows). There L2 is 4 to 7 times L1: most readings are
//! reproduced and few are not, so most triangles contained one reading. Here the instrument aims at the middle of every
//! triangle and misses by up to 1.8°, so that some triangles contain two readings and some none.

use super::data;
use super::error::PaperError;
use crate::domain::vector::{add, cross, scale, unit};
use crate::domain::{Axis, Direction, Domain, ErrorReport, TriangleMesh, WavelengthGrid};
use crate::formats::{Acquisition, Samples};
use rayon::prelude::*;
use serde_json::{Value, json};

/// BRDF measured by a simulated goniometer, on triangles of directions as in the paper by Claustres et al. (2006): 16
/// incoming and 1024 outgoing ones.
pub(super) struct Goniometer {
    /// Axes of the BRDF: `[16 incoming triangles, 1024 outgoing triangles, 75 wavelengths]`.
    pub(super) axes: Vec<Axis>,
    /// Samples of the BRDF projected onto triangles of directions and wavelengths, row-major.
    pub(super) projected: Vec<f32>,
    /// Readings of the simulated goniometer (BRDF values in sr⁻¹ with noise),
    /// `[16 incoming triangles, 1024 outgoing directions, 75 wavelengths]`.
    pub(super) readings: Vec<f32>,
    /// Index of the outgoing triangle that contains each measured outgoing direction.
    cells: Vec<usize>,
}

const DIRECTIONS: usize = 1024;
/// Largest angle in degrees by which the simulated goniometer misses the centroid of the triangle at which it aims. The
/// triangles are 4 to 8 degrees wide. Raising it leaves more triangles without a reading.
const AIM: f64 = 1.8;
const LAMBDAS: usize = 75;
/// Number of nearest readings from which the value of a triangle without reading is interpolated.
const NEIGHBOURS: usize = 3;

impl Goniometer {
    /// Measures the virtual material that the JSON text `document` describes.
    pub(super) fn measure(document: &str) -> Result<Self, PaperError> {
        let document: Value = serde_json::from_str(document).map_err(|e| PaperError::Data(e.to_string()))?;
        let lost = || PaperError::Data("a triangle mesh is above the limit on subdivision levels".to_owned());
        let incoming = TriangleMesh::new(Domain::Hemisphere, 1).ok_or_else(lost)?;
        let outgoing = TriangleMesh::new(Domain::Hemisphere, 4).ok_or_else(lost)?;
        let directions = directions(outgoing);
        let parts: Vec<Result<Vec<f32>, PaperError>> = (0..incoming.len())
            .into_par_iter()
            .map(|i| readings(&document, incoming.centroid(i), &directions, i))
            .collect();
        let mut samples = Vec::with_capacity(incoming.len() * DIRECTIONS * LAMBDAS);
        for part in parts {
            samples.extend(part?);
        }
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

    /// Returns the errors of `decoded` values of triangles, compared with the instrument readings: each reading with
    /// the value of the triangle that contains its direction.
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

/// Returns one measured direction for each triangle: its centroid, missed by up to [`AIM`] degrees.
fn directions(mesh: TriangleMesh) -> Vec<Direction> {
    (0..mesh.len())
        .map(|triangle| {
            // Evenly over a disc: the first DIRECTIONS points of the sequence R2 of Roberts (2018).
            let at = triangle as f64 + 0.5;
            let (sin, cos) = libm::sincos(std::f64::consts::TAU * (at * 0.569_840_290_998_053_2).fract());
            let miss = (AIM * (at * 0.754_877_666_246_692_8).fract().sqrt()).to_radians();
            let z = mesh.centroid(triangle).xyz();
            // No middle of a triangle lies along this vector.
            let x = unit(cross([0.36, 0.48, 0.8], z));
            let aside = add(scale(x, cos), scale(cross(z, x), sin));
            let [x, y, z] = add(scale(z, libm::cos(miss)), scale(aside, libm::sin(miss)));
            // Directions below the horizon are reflected above it.
            Direction::from_unit(unit([x, y, z.abs()]))
        })
        .collect()
}

fn readings(document: &Value, wi: Direction, wos: &[Direction], incoming: usize) -> Result<Vec<f32>, PaperError> {
    let mut samples = Vec::with_capacity(DIRECTIONS * LAMBDAS);
    let mut document = document.clone();
    for (j, wo) in wos.iter().enumerate() {
        document["axes"] = json!([
            {"kind": "theta_i", "values": [wi.theta_degrees()]},
            {"kind": "phi_i", "values": [wi.phi_degrees()], "extent": "sector"},
            {"kind": "theta_o", "values": [wo.theta_degrees()]},
            {"kind": "phi_o", "values": [wo.phi_degrees()], "extent": "sector"},
            "lambda:380:5:75"]);
        // Each reading has independent noise.
        document["noise"]["seed"] = json!(incoming * DIRECTIONS + j);
        let Acquisition { samples: Samples::Grid(grid), .. } = data::acquire(document.to_string().as_bytes())? else {
            return Err(PaperError::Data("a goniometer without angles".to_owned()));
        };
        samples.extend(grid.values.iter());
    }
    Ok(samples)
}

/// Returns, for each triangle, the instrument readings that determine its value, as pairs (index of the reading,
/// weight). The value is the mean of the readings inside or, without any, the mean of the nearest readings weighted by
/// inverse distance.
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
    fn most_triangles_hold_one_reading() {
        let measured = Goniometer::measure(data::MATERIALS[0].1).unwrap();
        assert_eq!(measured.projected.len(), 1_228_800);
        let mut counts = vec![0; DIRECTIONS];
        measured.cells.iter().for_each(|&cell| counts[cell] += 1);
        let with = |readings: usize| counts.iter().filter(|&&n| n == readings).count();
        assert!(with(1) > 900 && with(0) > 0 && with(2) > 0 && counts.iter().all(|&n| n < 4));
        let errors = measured.errors(&measured.projected);
        assert!(errors.er_l2 > 1e-4 && errors.er_l2 < 0.02, "{errors:?}");
        assert!(errors.er_l2 > 3.0 * errors.er_l1, "{errors:?}");
        assert_eq!(errors.scored_samples, 1_228_800);
    }

    #[test]
    fn readings_lie_within_the_aim_and_above_the_horizon() {
        let mesh = TriangleMesh::new(Domain::Hemisphere, 4).unwrap();
        let found = directions(mesh);
        let misses: Vec<f64> =
            found.iter().enumerate().map(|(i, wo)| wo.dot(mesh.centroid(i)).min(1.0).acos().to_degrees()).collect();
        assert!(misses.iter().all(|&miss| miss < AIM + 1e-6));
        // Evenly over a disc: the mean square is half the largest.
        let square = misses.iter().map(|miss| miss * miss).sum::<f64>() / misses.len() as f64;
        assert!((square / (AIM * AIM) - 0.5).abs() < 0.02, "{square}");
        assert!(found.iter().all(|wo| wo.cos_theta() >= 0.0 && (wo.dot(*wo) - 1.0).abs() < 1e-12));
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
        let request = AxesRequest { incoming_level: Some(1), outgoing_level: Some(2), ..AxesRequest::default() };
        let projected = project(&read, &request).unwrap().measurement;
        assert_eq!(projected.tensor.shape(), [16, 64, 3]);
        let errors = error_at_samples(&read, &projected).unwrap();
        assert!(errors.er_l2 > 0.001 && errors.er_l2 < 0.2, "{errors:?}");
    }
}
