//! Finding the coarsest parameter that keeps a promise, where the promise holds for small parameters.

/// Searches on a logarithmic scale for the largest parameter for which `keeps` answers yes, starting at `start`; `None` if
/// none down to `start / 2^40` does. The answer was itself tried: where `keeps` is not monotone, it is the largest tried.
pub(crate) fn largest<E>(
    start: f64,
    refinements: u32,
    mut keeps: impl FnMut(f64) -> Result<bool, E>,
) -> Result<Option<f64>, E> {
    const DOUBLINGS: u32 = 40;
    let mut good = None;
    let mut bad = None;
    let mut at = start;
    for _ in 0..DOUBLINGS {
        if keeps(at)? {
            good = Some(at);
            if bad.is_some() {
                break;
            }
            at *= 2.0;
        } else {
            bad = Some(at);
            if good.is_some() {
                break;
            }
            at *= 0.5;
        }
    }
    let (Some(mut low), Some(mut high)) = (good, bad) else { return Ok(good) };
    for _ in 0..refinements {
        let middle = (low * high).sqrt();
        if keeps(middle)? {
            low = middle;
        } else {
            high = middle;
        }
    }
    Ok(Some(low))
}

/// Watches an error while a step is halved: what no longer falls never will.
#[derive(Default)]
pub(crate) struct Falling {
    last: Option<(f64, f64)>,
}

impl Falling {
    /// Whether `error` at `step` still falls with the step.
    pub(crate) fn falls(&mut self, step: f64, error: f64) -> bool {
        let stands = self.last.is_some_and(|(before, then)| step <= 0.51 * before && error > 0.98 * then);
        self.last = Some((step, error));
        !stands
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;

    fn find(limit: f64, start: f64) -> Option<f64> {
        largest::<Infallible>(start, 20, |x| Ok(x <= limit)).unwrap()
    }

    #[test]
    fn the_largest_is_found_from_either_side() {
        for limit in [1e-6, 0.3, 1.0, 7.7, 1e5] {
            let found = find(limit, 1.0).unwrap();
            assert!(found <= limit && found > limit * 0.999_99, "{limit}: {found}");
        }
    }

    #[test]
    fn never_and_always_are_answered() {
        assert_eq!(find(0.0, 1.0), None);
        assert!(find(f64::INFINITY, 1.0).unwrap() > 1e11);
    }
}
