//! Nodes of one line of a level: its entries after some halvings are left out.

/// Axis of polar angles or azimuths of a coarser grid.
pub(super) struct Nodes {
    /// Number of decoded values along this axis of a coarser grid; each is a mean over merged neighbouring angles.
    pub(super) count: usize,
    /// Polar angles or azimuths on this axis of a lower-resolution grid, in degrees.
    pub(super) positions: Vec<f64>,
    /// Index of the decoded value (mean over merged neighbouring angles) that each entry of this axis of a coarser grid
    /// takes.
    pub(super) entries: Vec<u32>,
    /// Number of times that neighbouring angles of the full grid were merged in pairs to make this axis of a
    /// lower-resolution grid. With 0, all angles that the file states remain.
    pub(super) halvings: u32,
}
