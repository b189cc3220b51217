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

/// Largest distance, in sample spacings, of outliers from the direction about which they suggest a lobe. Raising it
/// warns of more lobes and of more outliers.
const REACH: f64 = 1.0;

/// A sample near the direction, such as the mirror direction, about which a narrow lobe may lie.
#[derive(Clone, Copy)]
struct Near {
    distance: f64,
    row: u32,
    /// Cosine of the incoming polar angle.
    height: f64,
}

/// Finds outliers that lie about one likely lobe centre, such as the mirror direction: perhaps a lobe that the scan
/// does not resolve. Samples already classified as part of a lobe are left out.
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

/// Returns true if two outliers near a likely lobe centre, such as the mirror direction, look like samples of one lobe.
///
/// They must belong to different incoming directions, unless the scan has only one (`of_one`). The outlier farther from
/// the centre must not exceed its neighbours by more than twice the factor of the nearer one. All other samples that
/// are as near to the centre must also be brighter than their neighbours, in the same bands. Only samples with incoming
/// polar angles between those of the two outliers count.
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
