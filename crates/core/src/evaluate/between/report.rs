//! What is said about the interpolation between incidences: errors of those left out, and an estimate of those between.

use super::left_out::left_out;
use super::tables::Tables;
use crate::evaluate::material::Material;

/// Part of the error of an incidence left out that is expected between incidences: it is measured at twice their distance, and was
/// found three to six times too large.
const BETWEEN: f64 = 0.25;

/// Errors where each inner incidence is left out in turn and predicted from those around it, of the mean of three wavelengths over
/// outgoing directions to 80° from the normal.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct LeftOut {
    /// er(L2) of the incidences that are left out: the root mean square of the relative error.
    pub er_l2: f64,
    /// er(L2) that is expected between incidences: a quarter of it, without the noise of the samples.
    pub between: f64,
    /// Share of an incidence's light that is expected to be put elsewhere between incidences, where that is most: a quarter of
    /// that of the incidences left out.
    pub moved: f64,
}

/// Expected errors between incidences beyond this many times the promised one are warned of.
const PROMISES: f64 = 3.0;
/// So are shares of an incidence's light in the wrong place beyond this.
const MOVED: f64 = 0.05;

impl LeftOut {
    /// A warning where incoming directions are too sparse to say what lies between them: where the error expected there is above three
    /// times the relative error that is promised at them, or more than 5 % of an incidence's light is in the wrong place.
    pub fn warning(&self, promised: f64) -> Option<String> {
        let sparse = "incoming directions are too sparse for the lobe: between them";
        if self.moved > MOVED {
            return Some(format!(
                "{sparse} about {:.0} % of its light is expected in the wrong place",
                100.0 * self.moved
            ));
        }
        (self.between > PROMISES * promised).then(|| {
            let (between, promised) = (100.0 * self.between, 100.0 * promised);
            format!("{sparse} er(L2) is expected to be about {between:.1} %, at them it is {promised:.2} %")
        })
    }
}

impl Material {
    /// Errors where each inner incidence is left out in turn, for samples whose noise has this relative standard deviation; `None`
    /// where no incidence stands between others.
    pub fn left_out(&self, noise: f64) -> Option<LeftOut> {
        let tables = Tables::of(self)?;
        let [errors] = left_out(&tables, tables.alignment(), &[tables.between()], noise)?[..] else { return None };
        Some(LeftOut { er_l2: errors.er_l2, between: BETWEEN * errors.without_noise, moved: BETWEEN * errors.moved })
    }
}
