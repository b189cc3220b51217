//! Extent and density of samples: domains, sides, and distances between neighbours.

use super::cloud::{Cloud, Incoming};
use super::withheld::trials;
use crate::domain::vector::Vector;
use crate::domain::{Domain, Quantity};

/// Number of nearest neighbours of a sample: the distance to the farthest of them gives the sample density.
const DENSITY: usize = 16;
/// Tolerance of the test for one-sided scans: a sample may lie this far (on the unit sphere) beyond the plane of
/// incidence. Raising it takes more scans for one-sided.
const ON_PLANE: f64 = 1e-3;

/// Incoming directions of samples that are fitted together: their number and spacing.
pub(super) struct Joint {
    pub(super) count: usize,
    /// Angle between neighbouring incoming directions, in radians.
    pub(super) spacing: f64,
}

impl Joint {
    pub(super) fn of(groups: &Incoming, samples: usize) -> Option<Self> {
        match groups {
            Incoming::None | Incoming::Elevations(..) => None,
            Incoming::AllElevations(elevations) => {
                let range = elevations.last().zip(elevations.first()).map_or(0.0, |(high, low)| high - low);
                let count = elevations.len();
                Some(Self { count, spacing: (range / (count.max(2) - 1) as f64).to_radians().max(1e-3) })
            }
            Incoming::Directions(count) => {
                let count = (*count).min((samples as f64).sqrt().ceil() as usize).max(1);
                Some(Self { count, spacing: (std::f64::consts::TAU / count as f64).sqrt() })
            }
        }
    }
}

/// Returns true if all samples lie on one side of the plane of incidence, and not all of them within that plane.
pub(super) fn is_one_sided(live: &[u32], directions: &[(Vector, Vector)]) -> bool {
    let beside = live.iter().map(|&row| directions[row as usize].1[1]);
    let (low, high) = beside.fold((0.0_f64, 0.0_f64), |(l, h), y| (l.min(y), h.max(y)));
    (low >= -ON_PLANE || high <= ON_PLANE) && high - low > 10.0 * ON_PLANE
}

pub(super) fn outgoing_domain(quantity: Quantity) -> Domain {
    match quantity {
        Quantity::Brdf | Quantity::Reflectance => Domain::Hemisphere,
        Quantity::Btdf => Domain::Lower,
        _ => Domain::Sphere,
    }
}

pub(super) fn incoming_domain(live: &[u32], directions: &[(Vector, Vector)]) -> Domain {
    let heights = live.iter().map(|&row| directions[row as usize].0[2]);
    let (low, high) = heights.fold((1.0_f64, -1.0_f64), |(l, h), z| (l.min(z), h.max(z)));
    match (low, high) {
        (low, _) if low >= -1e-9 => Domain::Hemisphere,
        (_, high) if high <= 1e-9 => Domain::Lower,
        _ => Domain::Sphere,
    }
}

/// Returns the spacing of neighbouring samples in degrees: the median over many samples, from the distance of their
/// sixteenth neighbour.
pub(super) fn spacing(clouds: &[Cloud]) -> f64 {
    let mut found = Vec::new();
    let mut all: Vec<f64> = trials(clouds, 200)
        .into_iter()
        .filter_map(|trial| {
            let cloud = &clouds[trial.cloud];
            let count = DENSITY.min(cloud.len() - 1);
            cloud.nearest(&cloud.place(trial.point), count + 1, |_| true, &mut found);
            let square = found.first()?.0;
            (count > 0 && square > 0.0).then(|| (std::f64::consts::PI * square / count as f64).sqrt().to_degrees())
        })
        .collect();
    if all.is_empty() {
        return 90.0;
    }
    let middle = all.len() / 2;
    *all.select_nth_unstable_by(middle, f64::total_cmp).1
}
