//! One-parameter searches: the coarsest value that keeps an error, the finest value that fits a size.

/// Searches on a logarithmic scale, from `start`, for the largest parameter that `keeps` accepts. `None` if none down
/// to `start / 2^40` is accepted. The returned value was itself tried; if `keeps` is not monotone, it is the largest
/// accepted trial.
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

/// Lists quantiser steps to try where rounding misleads a search by halving: powers of two from `start` down, then
/// `finest`. The powers do not depend on `start`, so that searches with slightly different targets find each other's
/// results.
pub(crate) fn powers_of_two(start: f64, finest: f64) -> impl Iterator<Item = f64> {
    /// Upper bound on the number of powers of two tried as quantiser steps. Together they span more than the range of
    /// steps in which rounding errors mislead a search by halving.
    const MOST: usize = 12;
    let first = libm::exp2(libm::floor(libm::log2(start.max(finest))));
    let powers = std::iter::successors(Some(first), |step| Some(0.5 * step));
    powers.take_while(move |&step| step > finest).take(MOST).chain([finest])
}

/// Watches an error while a quantiser step is halved, and gives up after two halvings in a row without a fall. One
/// halving is too little evidence where the error is close to rounding.
#[derive(Default)]
pub(crate) struct Falling {
    /// Last quantiser step tried while steps are halved, and smallest error of all steps tried; `None` before the
    /// first.
    last: Option<(f64, f64)>,
    stood: u32,
}

impl Falling {
    /// Number of halvings of the quantiser step in a row without a smaller error after which the search ends.
    const MOST: u32 = 2;

    /// Takes the error found at a quantiser step, and returns true while it may still fall as the step shrinks.
    pub(crate) fn falls(&mut self, step: f64, error: f64) -> bool {
        let least = self.last.map_or(f64::INFINITY, |(_, least)| least);
        if self.last.is_some_and(|(before, _)| step <= 0.51 * before) {
            self.stood = if error > 0.98 * least { self.stood + 1 } else { 0 };
        }
        self.last = Some((step, error.min(least)));
        self.stood < Self::MOST
    }
}

/// Notch: a quantiser step or threshold among the f32 numbers with 8 significant bits, those that a header can hold.
/// There are 128 notches to a doubling, in ascending order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Notch(u32);

impl Notch {
    /// Smallest possible quantiser step: the smallest normal f32.
    pub(crate) const FINEST: Self = Self(f32::MIN_POSITIVE.to_bits() >> 16);
    /// Largest possible quantiser step: the largest finite f32 of 8 significant bits.
    pub(crate) const COARSEST: Self = Self(f32::MAX.to_bits() >> 16);

    /// Returns the largest quantiser step of 8 significant bits that is not above `value`, or the smallest one of all.
    pub(crate) fn below(value: f32) -> Self {
        Self(value.clamp(f32::MIN_POSITIVE, f32::MAX).to_bits() >> 16)
    }

    /// Quantiser step that this notch (place on the logarithmic scale of possible steps) stands for.
    pub(crate) fn value(self) -> f32 {
        f32::from_bits(self.0 << 16)
    }

    /// Number of doublings (octaves) from the step `other` to this quantiser step; negative if this one is finer.
    pub(crate) fn octaves_from(self, other: Self) -> f64 {
        (f64::from(self.0) - f64::from(other.0)) / DOUBLING
    }

    /// Returns the quantiser step that lies `by` places after this one (before it if negative) in the ascending list of
    /// possible steps, 128 to a doubling. The result is clamped to the first and last of the list.
    pub(crate) fn moved(self, by: f64) -> Self {
        let moved = (f64::from(self.0) + by).clamp(f64::from(Self::FINEST.0), f64::from(Self::COARSEST.0));
        Self(moved as u32)
    }
}

/// Number of notches (possible quantiser steps) to a doubling of the step.
pub(crate) const DOUBLING: f64 = 128.0;
/// Fraction of the allowed file size above which a search for the quantiser step ends; the remainder would refine the
/// step by less than 1/128 of a doubling.
const CLOSE: f64 = 0.998;
/// Distance, in 128ths of a doubling, between a quantiser step whose file fits and one whose file does not, at which an
/// approximate search ends.
pub(crate) const NEAR: f64 = 4.0;
/// Smallest allowed size (bytes or coefficients) for which a nearly reached size ends a search. Below it a size stays
/// equal over many quantiser steps, and the finest of them is wanted.
const LARGE: f64 = 1000.0;
/// Assumed octaves by which a file shrinks for each octave of its quantiser step, until two sizes give the slope.
const USUAL_SLOPE: f64 = 0.8;
/// Largest change of the quantiser step from one trial to the next: 8 doublings, given in 128ths of a doubling. It
/// holds until both a file within the wanted size and a larger one have been found.
const FARTHEST: f64 = 8.0 * DOUBLING;

/// Condition that ends a search for the finest quantiser step whose file fits a size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Until {
    /// Search that ends when the finest quantiser step whose file fits the allowed size is known within 2 %, or when
    /// the file fills nearly all of a large allowed size. Such a step is precise enough for comparing bases.
    Near,
    /// Search that ends when the file fills nearly all of a large allowed size, or when the next finer quantiser step
    /// would make the file too large.
    Close,
    /// Search that ends only when the next finer quantiser step would make the file too large. It is meant for sizes
    /// that are cheap to compute, or that must be filled as far as possible.
    Exact,
}

/// Finds the finest quantiser step, not below `finest`, at which `size` (bytes of the file, or number of coefficients)
/// is at most `most`; `None` if there is none.
///
/// It assumes that sizes fall as steps grow. The returned step was itself tried.
///
/// Sizes are nearly powers of the step. The next trial is therefore where a straight line through the logarithms of the
/// last sizes meets `most`. A search takes a handful of trials instead of one for each bit of the answer.
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
            // A plateau or a rise gives no slope: take larger strides.
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
            // Aim a little beyond the wanted size, so that the next trial brackets the answer.
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
        // Interpolate linearly between the two sides; bisect if one side has not moved for several trials.
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

    /// Returns the finest quantiser step with `size_of(step)` at most `most`, as a search from `start` finds it, and
    /// the number of steps that it tried.
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
        // A step function, and sizes that fluctuate slightly.
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
