//! Intensities of a luminaire as its file lists them: numbers with a common factor, and angles brought into order.

use super::acquisition::ParseReport;
use super::error::FormatError;
use super::stated_grid::{Repeated, StatedGrid, StatedGridError};
use super::text::{Brief, Source};
use super::turned::turned;
use crate::domain::{Axis, DirectionGrid, Tensor};
use crate::notes::LuminaireNote;

/// Intensities of a luminaire and the numbers that its file lists: intensity = `factor` · number.
pub(super) struct Intensities {
    values: Vec<f32>,
    /// Numbers as listed in the luminaire file; empty if the factor to intensities is 1.
    written: Vec<f32>,
    factor: f64,
}

impl Intensities {
    /// Creates an empty list of intensities with capacity for `room` numbers.
    pub(super) fn new(factor: f64, room: usize) -> Self {
        let written = Vec::with_capacity(if factor == 1.0 { 0 } else { room });
        Self { values: Vec::with_capacity(room), written, factor }
    }

    /// Appends a number of the luminaire file, converted to an intensity, and returns the intensity.
    #[inline]
    pub(super) fn push(&mut self, number: f64) -> f32 {
        let value = (number * self.factor) as f32;
        self.values.push(value);
        if self.factor != 1.0 {
            self.written.push(number as f32);
        }
        value
    }

    /// Returns all intensities of the luminaire, row by row of the table in which they are listed.
    pub(super) fn values(&self) -> &[f32] {
        &self.values
    }

    /// Reverses the order of the rows of a table of intensities with `width` columns.
    pub(super) fn reversed(mut self, width: usize) -> Self {
        for table in [&mut self.values, &mut self.written] {
            *table = table.chunks_exact(width).rev().flatten().copied().collect();
        }
        self
    }

    /// Returns the numbers listed in the file and their factor. If a number is too large for a float32, returns the
    /// intensities and the factor 1 instead.
    fn stated(&self) -> (&[f32], f64) {
        let fits = !self.written.is_empty() && self.written.iter().all(|number| number.is_finite());
        if fits { (&self.written, self.factor) } else { (&self.values, 1.0) }
    }
}

/// Angles of a luminaire file (degrees, with their byte offsets in the text) and intensities `[horizontal][vertical]`,
/// in the order of the file.
pub(super) struct Stated {
    pub(super) vertical: Vec<(f64, usize)>,
    pub(super) horizontal: Vec<(f64, usize)>,
    pub(super) intensities: Intensities,
}

/// Angles of a luminaire file in strictly increasing order (degrees), and intensities `[horizontal][vertical]`.
pub(super) struct Ordered {
    pub(super) vertical: Vec<f64>,
    pub(super) horizontal: Vec<f64>,
    pub(super) intensities: Intensities,
    /// Deviations between intensities that the file lists twice for one angle.
    repeated: Repeated,
}

/// Axis of a table of intensities `[horizontal][vertical]` that holds the polar angles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Polar {
    Horizontal,
    Vertical,
}

impl Ordered {
    /// Returns the numbers that the luminaire file lists, on the grid `directions` with polar angles first. The result
    /// includes the factor that converts them to intensities.
    pub(super) fn stated(&self, directions: DirectionGrid, polar: Polar) -> Result<StatedGrid, StatedGridError> {
        let (numbers, factor) = self.intensities.stated();
        let numbers = match polar {
            Polar::Horizontal => numbers.to_vec(),
            Polar::Vertical => turned(numbers, self.vertical.len(), self.horizontal.len()),
        };
        let tensor = Tensor::new(vec![Axis::Grid(directions)], numbers)?;
        Ok(StatedGrid { tensor, factor, repeated: self.repeated })
    }
}

/// Makes the vertical and the horizontal angles of a luminaire strictly increasing. Decreasing angles are reversed and
/// intensities at a repeated angle are averaged; any other order is refused. Angles must lie in the given ranges in
/// degrees.
pub(super) fn ordered(
    stated: Stated,
    vertical_range: (f64, f64),
    horizontal_range: (f64, f64),
    source: &Source,
    report: &mut ParseReport,
) -> Result<Ordered, FormatError> {
    let Stated { vertical, horizontal, mut intensities } = stated;
    let mut repeated = Repeated::default();
    let (planes, listed) = (horizontal.len(), vertical.len());
    let mut axis = |angles, range, what, outer, inner| {
        increasing(Line { angles, range, what, outer, inner }, &mut intensities, &mut repeated, source, report)
    };
    let vertical = axis(vertical, vertical_range, "vertical", planes, 1)?;
    let inner = vertical.len();
    let horizontal = axis(horizontal, horizontal_range, "horizontal", 1, inner)?;
    if vertical.len() < 2 {
        let message = match listed {
            1 => "found one vertical angle, expected at least two".to_owned(),
            _ => format!("all {listed} vertical angles are {}°, expected different ones", Brief(vertical[0])),
        };
        return Err(source.malformed(source.text().len(), message));
    }
    Ok(Ordered { vertical, horizontal, intensities, repeated })
}

/// List of angles of a luminaire file to bring into order, with its place in the table of intensities
/// `[outer, angles, inner]`.
struct Line {
    angles: Vec<(f64, usize)>,
    range: (f64, f64),
    what: &'static str,
    outer: usize,
    inner: usize,
}

fn increasing(
    axis: Line,
    intensities: &mut Intensities,
    repeated: &mut Repeated,
    source: &Source,
    report: &mut ParseReport,
) -> Result<Vec<f64>, FormatError> {
    let Line { angles, range: (low, high), what, outer, inner } = axis;
    let n = angles.len();
    if let Some(&(angle, offset)) = angles.iter().find(|(angle, _)| !(low..=high).contains(angle)) {
        let message = format!("{what} angle {angle}°, expected {low}° to {high}°", angle = Brief(angle));
        return Err(source.malformed(offset, message));
    }
    let falling = angles[n - 1].0 < angles[0].0;
    let order: Vec<usize> = if falling { (0..n).rev().collect() } else { (0..n).collect() };
    for pair in angles.array_windows() {
        let [(a, _), (b, offset)] = *pair;
        if (falling && b > a) || (!falling && b < a) {
            let expected = if falling { "decreasing" } else { "increasing" };
            return Err(source.malformed(
                offset,
                format!("{what} angle {b}° after {a}°, expected {expected} angles", a = Brief(a), b = Brief(b)),
            ));
        }
    }
    if falling {
        report.note(LuminaireNote::AnglesDecrease { angles: what });
    }
    let mut groups: Vec<Vec<usize>> = Vec::with_capacity(n);
    let mut increasing: Vec<f64> = Vec::with_capacity(n);
    for i in order {
        match (increasing.last(), groups.last_mut()) {
            (Some(&last), Some(group)) if last == angles[i].0 => group.push(i),
            _ => {
                increasing.push(angles[i].0);
                groups.push(vec![i]);
            }
        }
    }
    let twice = n - increasing.len();
    if twice > 0 {
        report.note(LuminaireNote::AnglesRepeated { repeated: twice, angles: what });
    }
    if !falling && twice == 0 {
        return Ok(increasing);
    }
    // Calls `each` with the positions of the numbers that are averaged into one.
    let places = |each: &mut dyn FnMut(&mut dyn Iterator<Item = usize>)| {
        for o in 0..outer {
            for group in &groups {
                for k in 0..inner {
                    each(&mut group.iter().map(|&i| (o * n + i) * inner + k));
                }
            }
        }
    };
    places(&mut |of| {
        let found: Vec<f64> = of.map(|place| f64::from(intensities.values[place])).collect();
        repeated.add(found.into_iter());
    });
    for table in [&mut intensities.values, &mut intensities.written].into_iter().filter(|table| !table.is_empty()) {
        let mut rebuilt = Vec::with_capacity(outer * groups.len() * inner);
        places(&mut |of| rebuilt.push(mean(of.map(|place| table[place]))));
        *table = rebuilt;
    }
    Ok(increasing)
}

pub(super) fn mean(values: impl Iterator<Item = f32>) -> f32 {
    let (sum, count) = values.fold((0.0, 0_usize), |(sum, count), value| (sum + f64::from(value), count + 1));
    (sum / count as f64) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Frame;

    #[test]
    fn numbers_stay_beside_their_factor() {
        let list = |angles: &[f64]| angles.iter().map(|&angle| (angle, 0)).collect();
        let mut intensities = Intensities::new(0.3, 6);
        // C90 twice, angles of gamma falling.
        for number in [1.1, 2.0, 3.0, 4.0, 3.0, 6.0] {
            intensities.push(number);
        }
        let stated = Stated { vertical: list(&[90.0, 0.0]), horizontal: list(&[0.0, 90.0, 90.0]), intensities };
        let source = Source::decode(b"", "t");
        let ordered = ordered(stated, (0.0, 180.0), (0.0, 360.0), &source, &mut ParseReport::default()).unwrap();
        assert_eq!((&ordered.vertical[..], &ordered.horizontal[..]), (&[0.0, 90.0][..], &[0.0, 90.0][..]));
        assert_eq!(ordered.intensities.values(), [2.0, 1.1, 5.0, 3.0].map(|number: f64| (number * 0.3) as f32));
        let azimuths =
            crate::domain::Azimuths { angles: vec![0.0, 90.0], extent: crate::domain::AzimuthExtent::Quadrant };
        let directions = DirectionGrid::new(Frame::TypeC, vec![0.0, 90.0], Some(azimuths)).unwrap();
        let grid = ordered.stated(directions, Polar::Vertical).unwrap();
        assert_eq!((grid.tensor.samples(), grid.factor), (&[2.0, 5.0, 1.1, 3.0][..], 0.3));
        // 4 and 6 at one direction: 20 % from their mean; 3 and 3 agree.
        assert_eq!(grid.repeated.values, 4);
        assert!((grid.repeated.rms().unwrap() - 0.2 / 2.0_f64.sqrt()).abs() < 1e-6);
    }

    #[test]
    fn numbers_too_large_for_a_float32_are_left_for_the_intensities() {
        let mut intensities = Intensities::new(1e-3, 2);
        intensities.push(1e39);
        assert_eq!(intensities.stated(), (&[1e36_f32][..], 1.0));
    }
}
