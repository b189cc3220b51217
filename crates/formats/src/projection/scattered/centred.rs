//! Lobes that too few samples see: outliers of several incidences that are the nearest samples to one likely centre.
//!
//! Two samples far above their neighbours prove no lobe and are rejected. They suggest one if they belong to different
//! incidences (unless there is only one) and are the nearest of all samples to the mirror direction, to the slope 0 of
//! the half vector, or to the direction back to the source. Chance hardly explains that. Each incidence has one nearest
//! sample; if a fraction p of the samples are outliers, those of two incidences both are with a probability of p².

use super::plan::Plan;
use super::relative::{ORIGINS, places};
use super::report::UnresolvedLobe;
use super::together::{Company, FACTOR, Off, SAME, has_one_incidence};
use crate::domain::vector::{norm, sub};
use crate::domain::{CENTRES, Quantity};

/// Largest distance from the centre, in sample spacings. Raising it warns of more lobes and of more outliers.
const REACH: f64 = 1.0;

/// Sample near a centre.
#[derive(Clone, Copy)]
struct Near {
    distance: f64,
    row: u32,
    /// Cosine of the incoming polar angle.
    height: f64,
}

/// Finds outliers among `offs` that the `companies` do not classify as light and that stand about one likely centre.
pub(super) fn unresolved(
    quantity: Quantity,
    plan: &Plan,
    offs: &[Off],
    companies: &[Company],
) -> Option<UnresolvedLobe> {
    let of_one = has_one_incidence(plan);
    let found = CENTRES.into_iter().enumerate().filter_map(|(coordinate, centre)| {
        let place = |row: u32| places(quantity, plan.directions[row as usize])[coordinate];
        let near = |row: u32| Near {
            distance: norm(sub(place(row), ORIGINS[coordinate])),
            row,
            height: plan.directions[row as usize].0[2],
        };
        let is_outlier =
            |(off, company): &(&Off, &Company)| !off.is_high && off.excess() > 0.0 && **company != Company::Light;
        let outliers = offs.iter().zip(companies).filter(is_outlier).map(|(off, _)| (near(off.row), off));
        let mut outliers: Vec<(Near, &Off)> =
            outliers.filter(|(near, off)| near.distance <= REACH * off.spacing).collect();
        outliers.sort_by(|a, b| a.0.distance.total_cmp(&b.0.distance));
        let farthest = outliers.last().filter(|_| outliers.len() > 1)?.0.distance;
        let rows = plan.clouds.iter().flat_map(|cloud| &cloud.rows[..cloud.own()]);
        let all: Vec<Near> = rows.map(|&row| near(row)).filter(|near| near.distance <= farthest).collect();
        let mut pairs = outliers.windows(2).filter(|pair| is_peak((plan, of_one), offs, &all, [pair[0], pair[1]]));
        let radius = pairs.next_back()?[1].0.distance;
        let within = outliers.iter().take_while(|(near, _)| near.distance <= radius);
        Some(UnresolvedLobe { centre, values: within.map(|(_, off)| off.channels.len() as u64).sum() })
    });
    // The first centre wins ties.
    found.reduce(|most, next| if next.values > most.values { next } else { most })
}

/// Returns true if two outliers of different incidences (of the same if the plan is `of_one`) fall off from the centre,
/// to within a factor of two, and `all` other samples as near to it are like them. Only incidences from that of one
/// outlier to that of the other count.
fn is_peak(
    (plan, of_one): (&Plan, bool),
    offs: &[Off],
    all: &[Near],
    [(near, inner), (far, outer)]: [(Near, &Off); 2],
) -> bool {
    let wi = |near: Near| plan.directions[near.row as usize].0;
    let is_same = norm(sub(wi(near), wi(far))) < SAME;
    if is_same != of_one || inner.excess() < outer.excess() - FACTOR {
        return false;
    }
    let [low, high] = [near.height.min(far.height) - SAME, near.height.max(far.height) + SAME];
    let is_between = |other: &&Near| other.distance <= far.distance && (low..=high).contains(&other.height);
    let is_alike = |other: &Near| {
        let number = offs.binary_search_by_key(&other.row, |off| off.row);
        number.is_ok_and(|number| offs[number].excess() > 0.0 && offs[number].agrees(outer))
    };
    all.iter().filter(is_between).all(is_alike)
}
