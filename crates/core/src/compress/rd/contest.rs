//! Contest of schemes: each is searched, or discarded after one trial, and the best is kept.

use super::super::compressed::Ranked;
use super::super::error::CompressError;
use super::super::refusal;
use super::super::search::Until;
use super::super::target::Target;
use super::super::unreachable_error::UnreachableError;
use super::candidate::Candidate;
use super::layer::{FirstLayer, chunk_bytes};
use super::levels;
use super::schemes::Scheme;
use super::sized::{exponent, room, settled, sized_steps};
use super::steps::Steps;
use super::target_steps::{find_steps, refined, risk};
use crate::domain::Progress;

/// Smallest number of samples per byte of the best file so far at which a measurement counts as free of noise. Bases
/// that do not depend on the data, which win on noise, are then not tried.
const FEW: f64 = 128.0;
/// Largest number of coding schemes for each of which a search finds the best quantiser step. From more, one trial of
/// each may first select a few. Raising it costs trials.
const FEW_SCHEMES: usize = 6;
/// Largest number of samples for which coding schemes are shortlisted by one trial each. In larger noisy measurements
/// one trial misjudges a scheme, whose error hardly changes over a wide range of file sizes.
const SMALL: usize = 1 << 13;
/// Number of coding schemes that are fully searched after one trial of each. Raising it costs trials, and seldom finds
/// a better one.
const SEARCHED: usize = 2;

/// Returns the best of the competing coding schemes with its quantiser steps, and the ranking of all. Best means fewest
/// bytes at a wanted error, least error at a wanted size.
///
/// At a wanted error, wavelets of one measurement need nearly the same step, so the search of the first serves the
/// others for the comparison. They compete only where the data's own basis follows noise, which costs bits for each
/// sample. At a wanted size, the search of each scheme starts at the step of the best scheme so far.
///
/// `refused` has the schemes that missed the target before: the error or size that each reached, and the failure.
pub(super) fn best_of<'a>(
    work: &impl Fn(&Scheme) -> Result<Candidate<'a>, CompressError>,
    (schemes, mut refused): (&[Scheme], Vec<(f64, UnreachableError)>),
    (target, samples): (Target, usize),
    progress: &dyn Progress,
) -> Result<(Candidate<'a>, Steps, Vec<Ranked>), CompressError> {
    let by_size = matches!(target, Target::Ratio(_) | Target::Bytes(_));
    let by_error = by_size || target == Target::Auto;
    let mut ranking: Vec<(f64, Ranked)> = Vec::new();
    let mut best: Option<(f64, &Scheme, Option<Steps>)> = None;
    // The best candidate itself, kept if it needs little memory.
    let mut best_work = None;
    let mut shared = None;
    let (schemes, start) = match target {
        Target::Bytes(_) if schemes.len() > FEW_SCHEMES && samples <= SMALL => looked_at(work, schemes, progress)?,
        _ => (schemes.iter().collect(), None),
    };
    for (i, &scheme) in schemes.iter().enumerate() {
        let fixed = matches!(scheme, Scheme::Fixed(_));
        if fixed && !by_error && best.is_some_and(|(bytes, _, _)| bytes * FEW <= samples as f64) {
            continue;
        }
        let candidate = work(scheme)?;
        let near = best.filter(|_| by_size).map_or(start, |(_, _, steps)| steps);
        let own = match shared {
            Some(_) if fixed && !by_error => None,
            _ => match if by_size {
                sized_steps(&candidate, near, Until::Near, progress)
            } else {
                find_steps(&candidate, progress)
            } {
                Ok(found) => Some(found),
                // A basis of few vectors cannot follow noise, and its own bytes may not fit; another basis may.
                Err(CompressError::Unreachable(error)) => {
                    refused.push((candidate.closest.get(), error));
                    continue;
                }
                Err(other) => return Err(other),
            },
        };
        if fixed {
            shared = shared.or(own);
        }
        let Some(steps) = own.or(shared) else { continue };
        let levels = if candidate.has_levels() { levels::usual_bytes(candidate.measurement) } else { 0 };
        let bytes = chunk_bytes(&candidate.layer.chunks(steps.first)) + levels;
        let errors = if by_error {
            let error = candidate.relative_error(steps.first, progress)?;
            if !error.is_finite() {
                refused.push((f64::INFINITY, UnreachableError::Overflow));
                continue;
            }
            // The file nearest to the truth is not the one nearest to the noisy measurement.
            let risk = if target == Target::Auto { risk(&candidate, steps, progress)?.sqrt() } else { error };
            Some((error, risk))
        } else {
            None
        };
        let score = errors.map_or(bytes as f64, |(_, score)| score);
        let er_l2 = errors.map(|(error, _)| error);
        // The ranking is by size at a wanted error, by error at a wanted size.
        let place = er_l2.unwrap_or(bytes as f64);
        ranking.push((place, Ranked { basis: scheme.name().to_owned(), bytes: bytes as u64, er_l2 }));
        if best.is_none_or(|(least, _, _)| score < least) {
            best = Some((score, scheme, own));
            best_work = (candidate.layer.is_predicted() || candidate.layer.is_gridded()).then_some(candidate);
        }
        progress.step(0.05 + 0.5 * (i + 1) as f64 / schemes.len() as f64)?;
    }
    let Some((_, scheme, steps)) = best else { return Err(refusal::nothing_reaches(refused)) };
    let chosen = best_work.map_or_else(|| work(scheme), Ok)?;
    let steps = steps.map_or_else(|| find_steps(&chosen, progress), Ok)?;
    let steps = refined(&chosen, settled(&chosen, steps, progress)?, progress)?;
    ranking.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok((chosen, steps, ranking.into_iter().map(|(_, ranked)| ranked).collect()))
}

/// Selects the coding schemes with the least expected error at a wanted size, and the quantiser step to start from. The
/// first scheme is searched. The others are tried once at its step, and their errors are extrapolated to the allowed
/// bytes.
fn looked_at<'a, 's>(
    work: &impl Fn(&Scheme) -> Result<Candidate<'a>, CompressError>,
    schemes: &'s [Scheme],
    progress: &dyn Progress,
) -> Result<(Vec<&'s Scheme>, Option<Steps>), CompressError> {
    let mut schemes_left = schemes.iter();
    let (mut first, mut found) = (None, None);
    for scheme in schemes_left.by_ref() {
        let leader = work(scheme)?;
        match sized_steps(&leader, None, Until::Near, progress) {
            Ok(steps) => {
                (first, found) = (Some(scheme), Some((steps, exponent(&leader, steps))));
                break;
            }
            Err(CompressError::Unreachable(_)) => {}
            Err(other) => return Err(other),
        }
    }
    let Some((steps, exponent)) = found else { return Ok((schemes.iter().take(SEARCHED).collect(), None)) };
    let mut others = Vec::new();
    for scheme in schemes_left {
        let candidate = work(scheme)?;
        let room = room(&candidate, steps, progress)?;
        let error = candidate.relative_error(steps.first, progress)?;
        others.push((error * libm::pow(room, exponent), scheme));
    }
    others.sort_by(|a, b| a.0.total_cmp(&b.0));
    let best = first.into_iter().chain(others.into_iter().map(|(_, scheme)| scheme));
    Ok((best.take(SEARCHED).collect(), Some(steps)))
}
