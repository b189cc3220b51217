//! Adaptive rendering of a smooth function: evaluated on every fourth pixel, then interpolated where neighbours agree.

use super::super::error::PreviewError;
use super::lattice::Rgb;
use rayon::prelude::*;

/// Distance in pixels between the pixels that are evaluated first. Raising it interpolates more pixels.
const COARSEST: usize = 4;
/// Tolerances for the interpolation of pixels. A pixel is evaluated if its linear and cubic interpolation differ by
/// more than [`ROUGH`] times the sum of its value and [`OF_THE_PICTURE`] times the picture's mean. The cubic is about
/// five times as accurate as this difference. Raising them interpolates more pixels.
const ROUGH: f32 = 0.008;
const OF_THE_PICTURE: f32 = 0.1;

/// Returns the colours `value(x, y)` of the `wanted` pixels of a picture of `size` × `size`, most of them interpolated.
/// `value` must be continuous for some pixels beyond the wanted ones. Pixels where it is NaN are filled from their
/// neighbours.
pub(super) fn shaded<S>(
    size: usize,
    wanted: &[bool],
    scratch: impl Fn() -> S + Sync,
    value: impl Fn(&mut S, usize, usize) -> Result<Rgb, PreviewError> + Sync,
) -> Result<Vec<Rgb>, PreviewError> {
    let mut image = Image { size, values: vec![[f32::NAN; 3]; size * size] };
    let evaluate = |image: &mut Image, places: &[usize]| {
        let one = |scratch: &mut S, &place: &usize| value(scratch, place % size, place / size);
        let found: Vec<Rgb> = places.par_iter().map_init(&scratch, one).collect::<Result<_, PreviewError>>()?;
        for (&place, rgb) in places.iter().zip(found) {
            image.values[place] = rgb;
        }
        Ok::<(), PreviewError>(())
    };
    let needed = |place: &usize, reach: usize| {
        let (x, y) = (place % size, place / size);
        let across = |row: usize| &wanted[row * size..][x.saturating_sub(reach)..=(x + reach).min(size - 1)];
        (y.saturating_sub(reach)..=(y + reach).min(size - 1)).any(|row| across(row).contains(&true))
    };
    let on =
        |place: &usize, stride: usize| (place % size).is_multiple_of(stride) && (place / size).is_multiple_of(stride);
    let coarse: Vec<usize> = (0..size * size).filter(|p| on(p, COARSEST) && needed(p, COARSEST)).collect();
    evaluate(&mut image, &coarse)?;
    let floor = OF_THE_PICTURE * image.mean(&coarse);
    let mut stride = COARSEST / 2;
    while stride > 0 {
        let reach = if stride == 1 { 0 } else { stride };
        let mut rough = Vec::new();
        let mut even = Vec::new();
        for place in (0..size * size).filter(|p| on(p, stride) && !on(p, 2 * stride) && needed(p, reach)) {
            match image.between(place, stride, floor) {
                Some(rgb) => even.push((place, rgb)),
                None => rough.push(place),
            }
        }
        for (place, rgb) in even {
            image.values[place] = rgb;
        }
        evaluate(&mut image, &rough)?;
        stride /= 2;
    }
    image.fill(wanted);
    Ok(image.values)
}

struct Image {
    size: usize,
    values: Vec<Rgb>,
}

impl Image {
    /// Returns the mean, over the pixels at `places`, of each pixel's largest RGB channel. Pixels where it is not
    /// finite are left out.
    fn mean(&self, places: &[usize]) -> f32 {
        let (mut sum, mut count) = (0.0, 0.0);
        for &place in places {
            let largest = largest(self.values[place]);
            if largest.is_finite() {
                sum += largest;
                count += 1.0;
            }
        }
        if count > 0.0 { sum / count } else { 0.0 }
    }

    fn get(&self, place: usize, [dx, dy]: [isize; 2]) -> Option<Rgb> {
        let x = (place % self.size).checked_add_signed(dx).filter(|x| *x < self.size)?;
        let y = (place / self.size).checked_add_signed(dy).filter(|y| *y < self.size)?;
        let rgb = self.values[y * self.size + x];
        rgb.iter().all(|c| !c.is_nan()).then_some(rgb)
    }

    /// Interpolates a pixel by cubics from pixels at distances of 1 and 3 times `stride`; `None` if linear and cubic
    /// interpolation disagree.
    fn between(&self, place: usize, stride: usize, floor: f32) -> Option<Rgb> {
        let odd = |coordinate: usize| !coordinate.is_multiple_of(2 * stride);
        let lines: &[[isize; 2]] = match (odd(place % self.size), odd(place / self.size)) {
            (true, false) => &[[1, 0]],
            (false, true) => &[[0, 1]],
            _ => &[[1, 1], [1, -1]],
        };
        let mut found = [0.0; 3];
        let mut first = None;
        for line in lines {
            let at = |steps: isize| self.get(place, line.map(|d| d * steps * stride as isize));
            let (a, b, c, d) = (at(-3)?, at(-1)?, at(1)?, at(3)?);
            let cubic = [0, 1, 2].map(|k| (9.0 * (b[k] + c[k]) - (a[k] + d[k])) / 16.0);
            let linear = [0, 1, 2].map(|k| 0.5 * (b[k] + c[k]));
            let allowed = ROUGH * (largest(cubic) + floor);
            let other = *first.get_or_insert(cubic);
            let off = |k: usize| (cubic[k] - linear[k]).abs().max((cubic[k] - other[k]).abs());
            if (0..3).any(|k| off(k) > allowed) {
                return None;
            }
            found = [0, 1, 2].map(|k| found[k] + cubic[k] / lines.len() as f32);
        }
        Some(found)
    }

    /// Fills wanted pixels without a colour (NaN) with the mean of their neighbours, repeatedly from the border inward.
    /// Without any colour they become 0.
    fn fill(&mut self, wanted: &[bool]) {
        let is_empty = |rgb: &Rgb| rgb.iter().any(|c| c.is_nan());
        let mut empty: Vec<usize> = (0..wanted.len()).filter(|&p| wanted[p] && is_empty(&self.values[p])).collect();
        while !empty.is_empty() {
            let around = |&place: &usize| {
                let near = [[1, 0], [-1, 0], [0, 1], [0, -1]].into_iter().filter_map(|step| self.get(place, step));
                let (sum, count) = near
                    .fold(([0.0; 3], 0.0), |(sum, n): (Rgb, f32), rgb| ([0, 1, 2].map(|k| sum[k] + rgb[k]), n + 1.0));
                (count > 0.0).then(|| (place, sum.map(|c| c / count)))
            };
            let found: Vec<(usize, Rgb)> = empty.iter().filter_map(around).collect();
            if found.is_empty() {
                for place in empty {
                    self.values[place] = [0.0; 3];
                }
                return;
            }
            for (place, rgb) in found {
                self.values[place] = rgb;
            }
            empty.retain(|&place| is_empty(&self.values[place]));
        }
    }
}

fn largest(rgb: Rgb) -> f32 {
    rgb.iter().fold(0.0, |most: f32, c| most.max(c.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};

    const SIZE: usize = 96;

    fn disc() -> Vec<bool> {
        let apart = |i: usize| (i as f64 - 47.5).powi(2);
        (0..SIZE * SIZE).map(|p| apart(p % SIZE) + apart(p / SIZE) < 1600.0).collect()
    }

    /// Brightness of a test picture at a pixel: a round highlight on a background that grows linearly from left to
    /// right.
    fn function(x: usize, y: usize) -> f32 {
        let (x, y) = (x as f32 - 40.0, y as f32 - 30.0);
        0.3 + 0.001 * x + 2.0 * (-(x * x + y * y) / 120.0).exp()
    }

    #[test]
    fn what_is_smooth_is_not_evaluated_everywhere_and_looks_the_same() {
        let wanted = disc();
        let calls = AtomicUsize::new(0);
        let value = |(): &mut (), x: usize, y: usize| {
            calls.fetch_add(1, Ordering::Relaxed);
            Ok([function(x, y), 0.5 * function(x, y), 0.1])
        };
        let found = shaded(SIZE, &wanted, || (), value).unwrap();
        let all = wanted.iter().filter(|w| **w).count();
        assert!(calls.load(Ordering::Relaxed) < all / 2, "{calls:?} of {all}");
        for place in (0..SIZE * SIZE).filter(|&p| wanted[p]) {
            let expected = function(place % SIZE, place / SIZE);
            assert!((found[place][0] - expected).abs() < 0.012 * expected, "{place}: {:?} {expected}", found[place]);
        }
    }

    #[test]
    fn holes_are_filled_from_around() {
        let wanted = disc();
        let value = |(): &mut (), x: usize, y: usize| {
            Ok(if (30..50).contains(&x) && y > 20 { [f32::NAN; 3] } else { [0.7; 3] })
        };
        let found = shaded(SIZE, &wanted, || (), value).unwrap();
        assert!((0..SIZE * SIZE).filter(|&p| wanted[p]).all(|p| found[p].iter().all(|c| (c - 0.7).abs() < 1e-5)));
        let nothing = shaded(SIZE, &wanted, || (), |(), _, _| Ok([f32::NAN; 3])).unwrap();
        assert!((0..SIZE * SIZE).filter(|&p| wanted[p]).all(|p| nothing[p] == [0.0; 3]));
    }
}
