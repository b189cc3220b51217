//! Report on the interpolation between incidences: leave-one-out errors, and the error expected between incidences.

use super::left_out::left_out;
use super::notes::IncidenceNote;
use super::tables::Tables;
use crate::domain::Note;
use crate::evaluate::material::Material;

/// Ratio of the error expected between incidences to the leave-one-out error. Leaving one out doubles the distance; the
/// error was found three to six times too large.
const BETWEEN: f64 = 0.25;

/// Leave-one-out errors: each inner incidence is predicted from those around it. They are measured on the mean of three
/// wavelengths, over outgoing directions to 80° from the normal.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct LeftOut {
    /// er(L2) of the incidences left out: root mean square of the relative error.
    pub er_l2: f64,
    /// er(L2) expected between incidences: a quarter of the leave-one-out error, without the noise of the samples.
    pub between: f64,
    /// Largest share of an incidence's light expected in the wrong place between incidences: a quarter of the
    /// leave-one-out share.
    pub moved: f64,
}

/// Multiple of the promised error beyond which the error expected between incidences causes a warning.
const PROMISES: f64 = 3.0;
/// Share of an incidence's light in the wrong place beyond which a warning is given.
const MOVED: f64 = 0.05;

impl LeftOut {
    /// Returns a warning if the incoming directions are too sparse. That is, the error expected between them exceeds
    /// three times the relative error `promised` at them, or more than 5 % of an incidence's light is misplaced.
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
    /// Measures leave-one-out errors. `noise` is the relative standard deviation of the samples. `None` if no incidence
    /// lies between others.
    pub fn left_out(&self, noise: f64) -> Option<LeftOut> {
        let tables = Tables::of(self)?;
        let [errors] = left_out(&tables, tables.alignment(), &[tables.between()], noise)?[..] else { return None };
        Some(LeftOut { er_l2: errors.er_l2, between: BETWEEN * errors.without_noise, moved: BETWEEN * errors.moved })
    }
}
