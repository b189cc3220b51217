//! Uncertainties stated in a file: their size, and the fraction of material values within twice their uncertainty.

use super::error::PipelineError;
use super::request::Request;
use crate::domain::Tensor;
use crate::formats::{Acquisition, AngleGrid, ParseReport, Samples};
use crate::projection;

/// Number of values with a standard uncertainty in the file, and number of those that the material matches within twice
/// that uncertainty.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Within {
    kept: u64,
    stated: u64,
}

impl Within {
    /// Counts the values of a file that have a standard uncertainty, and those of them that the material matches within
    /// twice that uncertainty. A value at which the material cannot be evaluated counts as not matched.
    pub(super) fn add(&mut self, original: &[f32], found: &[f32], sigma: &[f32]) {
        for ((&original, &found), &sigma) in original.iter().zip(found).zip(sigma) {
            if is_stated(original, sigma) {
                self.stated += 1;
                let off = (f64::from(found) - f64::from(original)).abs();
                self.kept += u64::from(off <= 2.0 * f64::from(sigma));
            }
        }
    }

    /// Returns the fraction (0 to 1) of the values that the material matches within twice their standard uncertainty;
    /// `None` if no value has one.
    pub(super) fn share(self) -> Option<f64> {
        (self.stated > 0).then(|| self.kept as f64 / self.stated as f64)
    }
}

fn is_stated(value: f32, sigma: f32) -> bool {
    !value.is_nan() && sigma > 0.0 && sigma.is_finite()
}

/// Returns the root mean square of the relative standard uncertainties in a file: 0.01 is 1 %. Values below their own
/// uncertainty are skipped. Returns `None` if no value is left.
pub(super) fn relative(acquisition: &Acquisition) -> Option<f64> {
    let (values, sigma) = match &acquisition.samples {
        Samples::Scattered(scattered) => (&scattered.values, scattered.sigma.as_ref()?),
        Samples::Grid(grid) => (&*grid.values, &*grid.sigma.as_ref()?.values),
        Samples::OnAxes { .. } | Samples::Function(_) => return None,
    };
    let (mut sum, mut count) = (0.0, 0_u64);
    for (&value, &sigma) in values.iter().zip(sigma).filter(|(value, sigma)| is_stated(**value, **sigma)) {
        if sigma < value {
            sum += (f64::from(sigma) / f64::from(value)).powi(2);
            count += 1;
        }
    }
    (count > 0).then(|| (sum / count as f64).sqrt())
}

/// Returns the fraction of the values of a file that the decoded material matches within twice their standard
/// uncertainty. `None` if the file states none, or if the material is not on the grid of the file.
pub(super) fn within_on_grid(
    acquisition: &Acquisition,
    request: &Request,
    decoded: &Tensor,
) -> Result<Option<f64>, PipelineError> {
    let Samples::Grid(grid) = &acquisition.samples else { return Ok(None) };
    let Some(sigma) = grid.sigma.as_deref() else { return Ok(None) };
    // An infinite uncertainty says nothing, and is no sample of a tensor.
    let finite = sigma.values.iter().map(|sigma| if sigma.is_finite() { *sigma } else { f32::NAN }).collect();
    let sigma = AngleGrid { values: finite, ..sigma.clone() };
    let on_grid = |grid: AngleGrid| on_axes_of(acquisition, grid, request, decoded);
    let (Some(values), Some(sigma)) = (on_grid(grid.clone())?, on_grid(sigma)?) else { return Ok(None) };
    let mut within = Within::default();
    within.add(values.samples(), decoded.samples(), sigma.samples());
    Ok(within.share())
}

/// Projects `grid`, the values or the uncertainties of a file, onto the axes of `request`, as the samples of the
/// material were projected. Returns `None` unless the result is on a grid of directions and has the axes of `decoded`,
/// the decoded material.
fn on_axes_of(
    acquisition: &Acquisition,
    grid: AngleGrid,
    request: &Request,
    decoded: &Tensor,
) -> Result<Option<Tensor>, PipelineError> {
    let numbers = Acquisition {
        format: acquisition.format,
        dialect: String::new(),
        quantity: acquisition.quantity,
        unit: acquisition.unit,
        samples: Samples::Grid(grid),
        spectral_factor: acquisition.spectral_factor.clone(),
        instrument: acquisition.instrument,
        report: ParseReport::default(),
    };
    let tensor = projection::project(&numbers, &request.axes()?)?.measurement.tensor;
    let is_on_grid = tensor.axes().iter().any(|axis| matches!(axis, crate::domain::Axis::Grid(_)));
    Ok((is_on_grid && tensor.axes() == decoded.axes()).then_some(tensor))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::{self, Interpretation};
    use crate::pipeline::Source;
    use std::fmt::Write as _;

    #[test]
    fn only_values_with_an_uncertainty_count() {
        let mut within = Within::default();
        assert_eq!(within.share(), None);
        let original = [1.0, 1.0, 1.0, f32::NAN, 1.0, 1.0, 1.0];
        let found = [1.19, 0.79, f32::NAN, 1.0, 5.0, 5.0, 5.0];
        within.add(&original, &found, &[0.1, 0.1, 0.1, 0.1, 0.0, f32::NAN, f32::INFINITY]);
        assert_eq!(within, Within { kept: 1, stated: 3 });
        assert!((within.share().unwrap() - 1.0 / 3.0).abs() < 1e-12);
    }

    fn read(rows: &str) -> Acquisition {
        let head = "# radiometric-csv: 1\n# quantity: brdf\n# value_unit: 1/sr\n# cosine_included: false\n# angle_unit: deg\n\
                    theta_i,theta_o,phi_o,value,sigma\n";
        formats::read(format!("{head}{rows}").as_bytes(), &Interpretation::default()).unwrap()
    }

    #[test]
    fn relative_uncertainties_are_those_of_values_above_them() {
        let found = relative(&read("0,10,0,1,0.03\n0,20,0,2,0.08\n0,30,0,1,\n0,40,0,0.01,0.5\n0,50,0,-1,0.1\n"));
        assert!((found.unwrap() - (0.5_f64 * (0.0009 + 0.0016)).sqrt()).abs() < 1e-7, "{found:?}");
        assert_eq!(relative(&read("0,10,0,0.1,0.3\n0,20,0,-0.2,0.8\n")), None);
    }

    #[test]
    fn values_on_a_grid_are_compared_with_the_decoded_ones() {
        let mut rows = String::new();
        for theta_i in [0, 30, 60] {
            for theta_o in (0..90).step_by(10) {
                for phi_o in [0, 60, 120, 180] {
                    // The uncertainty of half of the values is next to 0.
                    let (value, sigma) = (1.0 + 0.01 * f64::from(theta_o), if theta_o < 40 { 1e-9 } else { 0.1 });
                    let _ = writeln!(rows, "{theta_i},{theta_o},{phi_o},{value},{sigma}");
                }
            }
        }
        let acquisition = read(&rows);
        let source = Source { acquisition, content_digest: String::new(), spectrum_digest: None };
        let outcome = source.compress(&Request::er_l2(0.02)).unwrap();
        let share = outcome.report.within_2u.unwrap();
        assert!((5.0 / 9.0..=1.0).contains(&share), "{share}");
        let coarse = source.compress(&Request::er_l2(0.3)).unwrap().report.within_2u;
        assert!(coarse.unwrap() < 1.0, "{coarse:?}");
    }
}
