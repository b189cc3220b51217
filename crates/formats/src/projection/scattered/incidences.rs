//! Samples grouped by incoming direction, with weights for sums over outgoing directions.

use super::areas::areas;
use super::plan::Plan;
use crate::domain::vector::Vector;
use crate::domain::{Direction, Domain, Quantity};

/// Largest angle in degrees between incoming directions that count as equal.
const SAME: f64 = 0.05;
/// Least mean number of samples per incoming direction at which the light of scattered samples is summed for each
/// incoming direction. With fewer, all samples form one sum.
const FEWEST: usize = 24;

/// Group of scattered samples under one incoming direction, or of all samples if each has its own.
#[derive(Clone, Debug)]
pub struct Incidence {
    /// Polar angle and azimuth in degrees of the common incoming direction; without azimuth for isotropic data, `None`
    /// without a common direction.
    pub(super) angles: Option<(f64, Option<f64>)>,
    pub(super) rows: Vec<u32>,
    /// True if the samples share an incoming direction and are weighted by the solid angles that they represent.
    is_one: bool,
}

impl Incidence {
    /// Returns the polar angle in degrees of the common incoming direction and, unless the data are isotropic, its
    /// azimuth. Returns `None` if there is no incoming direction, or if each sample has its own.
    pub fn angles(&self) -> Option<(f64, Option<f64>)> {
        self.angles
    }

    /// Returns the indices of the samples in this group: those that share one incoming direction, or all samples if
    /// each has its own.
    pub fn rows(&self) -> &[u32] {
        &self.rows
    }

    /// Returns weights for sums over outgoing directions: the solid angle of each sample, times |cos θ| if the quantity
    /// has that factor. In a plane of incidence 1 replaces the solid angle. Also returns true if the weights contain
    /// solid angles.
    pub(super) fn weights(
        &self,
        directions: &[(Vector, Vector)],
        domain: Domain,
        has_cosine: bool,
    ) -> (Vec<f64>, bool) {
        let outgoing: Vec<Vector> = self.rows.iter().map(|&row| directions[row as usize].1).collect();
        let areas = if self.is_one { areas(&outgoing, domain) } else { None };
        let are_areas = areas.is_some();
        let areas = areas.unwrap_or_else(|| vec![1.0; outgoing.len()]);
        let weigh = |(area, d): (f64, &Vector)| if has_cosine { area * d[2].abs() } else { area };
        (areas.into_iter().zip(&outgoing).map(weigh).collect(), are_areas)
    }
}

/// Groups the samples of a scan by incoming direction.
pub(super) fn incidences(quantity: Quantity, plan: &Plan, has_incoming: bool) -> Vec<Incidence> {
    let own = |cloud: usize| plan.clouds[cloud].rows[..plan.clouds[cloud].own()].to_vec();
    let alone = |angles, rows: Vec<u32>| Incidence { angles, rows: sorted(rows), is_one: true };
    if plan.clouds.len() == plan.elevations.len() {
        return plan.elevations.iter().zip(0..).map(|(&theta, i)| alone(Some((theta, None)), own(i))).collect();
    }
    let all: Vec<u32> = (0..plan.clouds.len()).flat_map(own).collect();
    if !has_incoming || quantity == Quantity::Reflectance {
        return vec![alone(None, all)];
    }
    let steps = |degrees: f64| (degrees / SAME).round() as i64;
    let key = |row: u32| {
        let wi = Direction::from_unit(plan.directions[row as usize].0);
        let (theta, phi) = (wi.theta_degrees(), wi.phi_degrees());
        [steps(theta), if theta < SAME { 0 } else { steps(phi) % steps(360.0) }]
    };
    let mut keyed: Vec<([i64; 2], u32)> = all.iter().map(|&row| (key(row), row)).collect();
    keyed.sort_unstable();
    let groups: Vec<&[([i64; 2], u32)]> = keyed.chunk_by(|a, b| a.0 == b.0).collect();
    if groups.len() * FEWEST > keyed.len() {
        return vec![Incidence { angles: None, rows: sorted(all), is_one: false }];
    }
    let degrees = |step: i64| step as f64 / (1.0 / SAME).round();
    let of = |group: &&[([i64; 2], u32)]| {
        let [theta, phi] = group[0].0;
        let phi = (!plan.isotropic).then(|| degrees(phi));
        alone(Some((degrees(theta), phi)), group.iter().map(|keyed| keyed.1).collect())
    };
    groups.iter().map(of).collect()
}

fn sorted(mut rows: Vec<u32>) -> Vec<u32> {
    rows.sort_unstable();
    rows
}
