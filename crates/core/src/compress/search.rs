//! Searches for the parameter of a promise: the coarsest one that keeps an error, the finest one that fits a size.

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

/// Steps to try where rounding misleads a search by halves: powers of two from `start` down, then `finest`. They are the same
/// for any start, so that an error which one search found is found by another that asks for a little more.
pub(crate) fn powers_of_two(start: f64, finest: f64) -> impl Iterator<Item = f64> {
    /// The most powers: more than rounding spans.
    const MOST: usize = 12;
    let first = libm::exp2(libm::floor(libm::log2(start.max(finest))));
    let powers = std::iter::successors(Some(first), |step| Some(0.5 * step));
    powers.take_while(move |&step| step > finest).take(MOST).chain([finest])
}

/// Watches an error while a step is halved: what has not fallen twice in a row never will. Once says little where the error is
/// near to that of rounding.
#[derive(Default)]
pub(crate) struct Falling {
    /// The last step, and the smallest error so far.
    last: Option<(f64, f64)>,
    stood: u32,
}

impl Falling {
    /// Halvings in a row that may leave the error as it was before the search ends.
    const MOST: u32 = 2;

    /// Whether `error` at `step` still falls with the step.
    pub(crate) fn falls(&mut self, step: f64, error: f64) -> bool {
        let least = self.last.map_or(f64::INFINITY, |(_, least)| least);
        if self.last.is_some_and(|(before, _)| step <= 0.51 * before) {
            self.stood = if error > 0.98 * least { self.stood + 1 } else { 0 };
        }
        self.last = Some((step, error.min(least)));
        self.stood < Self::MOST
    }
}

/// A step or threshold on the lattice of f32 numbers with 8 significant bits, the steps that a header can hold: 128 of them
/// to a doubling, in the order of the numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Notch(u32);

impl Notch {
    /// The smallest normal f32.
    pub(crate) const FINEST: Self = Self(f32::MIN_POSITIVE.to_bits() >> 16);
    /// The largest finite number on the lattice.
    pub(crate) const COARSEST: Self = Self(f32::MAX.to_bits() >> 16);

    /// The largest notch at or below `value`, within the lattice.
    pub(crate) fn below(value: f32) -> Self {
        Self(value.clamp(f32::MIN_POSITIVE, f32::MAX).to_bits() >> 16)
    }

    /// The number at this notch.
    pub(crate) fn value(self) -> f32 {
        f32::from_bits(self.0 << 16)
    }

    /// Doublings from `other` to this step.
    pub(crate) fn octaves_from(self, other: Self) -> f64 {
        (f64::from(self.0) - f64::from(other.0)) / DOUBLING
    }

    /// The notch `by` places coarser, or finer if negative, within the lattice.
    pub(crate) fn moved(self, by: f64) -> Self {
        let moved = (f64::from(self.0) + by).clamp(f64::from(Self::FINEST.0), f64::from(Self::COARSEST.0));
        Self(moved as u32)
    }
}

/// Notches to a doubling of the step.
pub(crate) const DOUBLING: f64 = 128.0;
/// Sizes of at least this part of what is allowed end a search of [`Until::Close`]: the rest buys less than a step on the
/// lattice does.
const CLOSE: f64 = 0.998;
/// Notches between the two sides that end a search of [`Until::Near`].
pub(crate) const NEAR: f64 = 4.0;
/// Sizes from which a search may end so. Smaller ones stand still over many steps, of which the finest is wanted.
const LARGE: f64 = 1000.0;
/// Fall of the logarithm of the size per doubling of the step (in octaves), before two sizes tell it.
const USUAL_SLOPE: f64 = 0.8;
/// Largest move of the step in one trial before both sides of the answer are known, in notches: a factor of 256.
const FARTHEST: f64 = 8.0 * DOUBLING;

/// When a search has found enough.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Until {
    /// The step is within 2 % of the answer, or as in `Close`: to compare bases with each other.
    Near,
    /// The size is large and nearly the one allowed, or the next finer notch does not fit.
    Close,
    /// The next finer notch does not fit: for sizes that cost nothing to tell, or that must not be missed.
    Exact,
}

/// Finds the finest notch, from `finest` on, whose size is at most `most`, where sizes fall as steps grow; `None` if even the coarsest does
/// not fit. The notch returned was itself tried.
///
/// Sizes are nearly powers of the step, so the next trial is where a straight line through the logarithms of the last
/// ones meets `most`: a handful of trials instead of one for each bit of the answer.
pub(crate) fn finest_fitting<E>(
    (start, finest): (Notch, Notch),
    (most, until): (f64, Until),
    mut size: impl FnMut(Notch) -> Result<f64, E>,
) -> Result<Option<Notch>, E> {
    let octaves = |size: f64| libm::log2(size.max(0.5));
    let wanted = octaves(most * (1.0 + CLOSE) / 2.0);
    let (mut fits, mut exceeds) = (None::<(Notch, f64)>, None::<(Notch, f64)>);
    let mut slope = USUAL_SLOPE;
    let mut same_side = 0_u32;
    let mut at = start.max(finest);
    loop {
        let found = size(at)?;
        let here = (at, octaves(found));
        let fitted = found <= most;
        let (side, other) = if fitted { (&mut fits, &exceeds) } else { (&mut exceeds, &fits) };
        if let Some((before, then)) = side.replace(here)
            && before != at
        {
            let fall = (then - here.1) / at.octaves_from(before);
            // A plateau or a rise says nothing of the way: take larger strides.
            slope = if fall.is_finite() && fall > 0.0 { fall.clamp(0.1, 4.0) } else { (slope / 2.0).max(0.05) };
            same_side += 1;
        } else {
            same_side = 0;
        }
        let close = until != Until::Exact && most >= LARGE && found >= CLOSE * most;
        let done = fitted && (close || at == finest);
        let hopeless = !fitted && at == Notch::COARSEST;
        if done || hopeless {
            return Ok(fitted.then_some(at));
        }
        let Some(&(end, size_there)) = other.as_ref() else {
            // Towards the size that is wanted, and a little beyond it, so that the other side is known next.
            let way = (here.1 - wanted) / slope * DOUBLING;
            let beyond = 4.0 * libm::exp2(f64::from(same_side.min(8)));
            let way = if fitted { way.min(0.0) - beyond } else { way.max(0.0) + beyond };
            at = at.moved(way.clamp(-FARTHEST, FARTHEST)).max(finest);
            continue;
        };
        let width = f64::from(at.0.abs_diff(end.0));
        if width <= if until == Until::Near { NEAR } else { 1.0 } {
            return Ok(fits.map(|(at, _)| at));
        }
        // Between the two: by a straight line, in the middle where one side stays for long.
        let part = if same_side % 3 == 2 { 0.5 } else { (here.1 - wanted) / (here.1 - size_there) };
        let part = if part.is_finite() { part.clamp(0.05, 0.95) } else { 0.5 };
        let inner = libm::round(part * width).clamp(1.0, width - 1.0);
        at = at.moved(if at < end { inner } else { -inner });
        same_side = if same_side % 3 == 2 { 0 } else { same_side };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;

    /// The notch that a search finds for sizes `size_of(step)`, and the trials it took.
    fn fitted(start: f32, most: f64, size_of: impl Fn(f64) -> f64) -> (Option<Notch>, u32) {
        let mut trials = 0;
        let size = |at: Notch| {
            trials += 1;
            Ok::<f64, Infallible>(size_of(f64::from(at.value())))
        };
        (finest_fitting((Notch::below(start), Notch::FINEST), (most, Until::Close), size).unwrap(), trials)
    }

    #[test]
    fn the_finest_step_that_fits_takes_few_trials() {
        for start in [1e-6, 0.05, 3.0, 1e20] {
            for most in [60.0, 1000.0, 3e5] {
                for size in [
                    &(|step: f64| 50.0 + 400.0 / step) as &dyn Fn(f64) -> f64,
                    &|step: f64| 40.0 + 3e4 * libm::log2(1.0 + 1.0 / step),
                    &|step: f64| (45.0 + 900.0 * libm::pow(step, -0.3)).floor(),
                ] {
                    let (found, trials) = fitted(start, most, size);
                    let found = found.unwrap();
                    let finer = found.moved(-1.0);
                    let (here, next) = (size(f64::from(found.value())), size(f64::from(finer.value())));
                    assert!(here <= most && (next > most || here >= CLOSE * most), "{most}: {here}, {next}");
                    assert!(trials <= 32, "{start} {most}: {trials}");
                }
            }
        }
        let (_, trials) = fitted(0.05, 2000.0, |step| 50.0 + 400.0 / step);
        assert!(trials <= 8, "{trials}");
    }

    #[test]
    fn what_never_or_always_fits_is_answered() {
        assert_eq!(fitted(0.05, 10.0, |_| 11.0).0, None);
        assert_eq!(fitted(0.05, 10.0, |_| 9.0).0, Some(Notch::FINEST));
        assert_eq!(fitted(0.05, 10.0, |_| f64::INFINITY).0, None);
        // Steps of a staircase, and sizes that go up and down a little.
        let (found, _) = fitted(0.05, 10.0, |step| if step < 0.3 { 12.0 } else { 7.0 });
        assert!(found.is_some_and(|at| at.value() >= 0.3 && at.moved(-1.0).value() < 0.3));
        let rough = |step: f64| 100.0 / step * (1.0 + 0.02 * (step * 1e4).sin());
        let (found, _) = fitted(0.05, 1000.0, rough);
        assert!(found.is_some_and(|at| rough(f64::from(at.value())) <= 1000.0));
    }

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
