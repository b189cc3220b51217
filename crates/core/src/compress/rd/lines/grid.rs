//! Products of lines: the axes that a pyramid of pairs halves, with the positions of their entries.

/// Number of axes of a grid of angles: polar angle and azimuth of incoming and outgoing directions.
pub(crate) const AXES: usize = 4;

/// Axis of a grid with the positions of its entries, strictly increasing.
#[derive(Clone, Debug)]
pub(crate) struct Line {
    /// Positions of the axis entries, in any unit.
    pub(crate) positions: Vec<f64>,
    /// Circumference if the axis is a circle, in the unit of the positions; `None` if it has two ends.
    pub(crate) period: Option<f64>,
}

impl Line {
    /// Builds an axis of evenly spaced entries, a circle or a line with two ends.
    pub(crate) fn even(length: usize, is_circle: bool) -> Self {
        let positions = (0..length).map(|i| i as f64).collect();
        Self { positions, period: is_circle.then_some(length as f64) }
    }
}

/// Grid with up to four axes; missing ones are put in front, with one entry each.
#[derive(Clone, Debug)]
pub(crate) struct Grid {
    pub(super) lines: [Line; AXES],
}

impl Grid {
    /// Builds a grid with the axes `lines`, at most four; to fewer, axes of a single entry are added in front.
    pub(crate) fn new(lines: &[Line]) -> Self {
        let missing = AXES.saturating_sub(lines.len());
        Self {
            lines: std::array::from_fn(|axis| {
                axis.checked_sub(missing).and_then(|i| lines.get(i)).cloned().unwrap_or_else(|| Line::even(1, false))
            }),
        }
    }

    /// Number of entries on each of the four axes of the grid.
    pub(crate) fn lengths(&self) -> [usize; AXES] {
        std::array::from_fn(|axis| self.lines[axis].positions.len())
    }
}
