//! Report on the interpolation between incidences: leave-one-out errors, and the error expected between incidences.

use super::left_out::left_out;
use super::notes::IncidenceNote;
use super::tables::Tables;
use crate::domain::Note;
use crate::evaluate::material::Material;

/// Factor from the leave-one-out error to the error expected between measured incoming directions. Leaving one out
/// doubles the gap; the resulting error was found three to six times too large.
const BETWEEN: f64 = 0.25;

/// Leave-one-out errors: each inner incoming direction is predicted from those around it. They are measured on the mean
/// of three wavelengths, over outgoing directions to 80° from the normal.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct LeftOut {
    /// Root mean square relative error er(L2) of the predictions at the left-out incoming directions.
    pub er_l2: f64,
    /// Root mean square relative error er(L2) expected between measured incoming directions: a quarter of the
    /// leave-one-out error, without the noise of the samples.
    pub between: f64,
    /// Largest share of light expected in the wrong place between measured incoming directions: a quarter of the share
    /// that leave-one-out predictions misplace.
    pub moved: f64,
}

/// Multiple of the promised relative error beyond which the error expected between measured incoming directions causes
/// a warning.
const PROMISES: f64 = 3.0;
/// Share of the light of an incoming direction expected in the wrong place beyond which a warning is given.
const MOVED: f64 = 0.05;

impl LeftOut {
    /// Returns a warning if the measured incoming directions are too sparse. That is, the error expected between them
    /// exceeds three times the relative error `promised` at them, or more than 5 % of the light of an incoming
    /// direction is misplaced.
    pub fn warning(&self, promised: f64) -> Option<Note> {
        if self.moved > MOVED {
            return Some(IncidenceNote::LightMoved { light_percent: 100.0 * self.moved }.into());
        }
        (self.between > PROMISES * promised).then(|| {
            let (expected_percent, promised_percent) = (100.0 * self.between, 100.0 * promised);
            IncidenceNote::ErrorBetween { expected_percent, promised_percent }.into()
        })
    }
}

impl Material {
    /// Measures the leave-one-out errors of an opened material. `noise` is the relative standard deviation of the
    /// samples. `None` if no measured incoming direction lies between others.
    pub fn left_out(&self, noise: f64) -> Option<LeftOut> {
        let tables = Tables::of(self)?;
        let [errors] = left_out(&tables, tables.alignment(), &[tables.between()], noise)?[..] else { return None };
        Some(LeftOut { er_l2: errors.er_l2, between: BETWEEN * errors.without_noise, moved: BETWEEN * errors.moved })
    }
}
