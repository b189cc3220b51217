//! Products of lines: the axes that a pyramid of pairs halves, with the positions of their entries.

/// Number of axes of a product of lines.
pub(crate) const AXES: usize = 4;

/// Line axis: positions of its entries, strictly increasing.
#[derive(Clone, Debug)]
pub(crate) struct Line {
    /// Positions, in any unit.
    pub(crate) positions: Vec<f64>,
    /// Circumference of a circle; `None` for an open line.
    pub(crate) period: Option<f64>,
}

impl Line {
    /// Line of evenly spaced entries, closed to a circle or open.
    pub(crate) fn even(length: usize, is_circle: bool) -> Self {
        let positions = (0..length).map(|i| i as f64).collect();
        Self { positions, period: is_circle.then_some(length as f64) }
    }
}

/// Up to four lines, aligned at the end; missing ones in front have one entry.
#[derive(Clone, Debug)]
pub(crate) struct Grid {
    pub(super) lines: [Line; AXES],
}

impl Grid {
    /// Product of at most four lines.
    pub(crate) fn new(lines: &[Line]) -> Self {
        let missing = AXES.saturating_sub(lines.len());
        Self {
            lines: std::array::from_fn(|axis| {
                axis.checked_sub(missing).and_then(|i| lines.get(i)).cloned().unwrap_or_else(|| Line::even(1, false))
            }),
        }
    }

    /// Number of entries of each axis.
    pub(crate) fn lengths(&self) -> [usize; AXES] {
        std::array::from_fn(|axis| self.lines[axis].positions.len())
    }
}
