//! Nodes of one line of a level: its entries after some halvings are left out.

/// Axis of polar angles or azimuths of a coarser grid.
pub(super) struct Nodes {
    /// Number of decoded values along this axis of a coarser grid; each is a mean over merged neighbouring angles.
    pub(super) count: usize,
    /// Angles of the entries of the coarser axis, in degrees.
    pub(super) positions: Vec<f64>,
    /// Index of the decoded value (mean over merged neighbouring angles) that each entry of this axis of a coarser grid
    /// takes.
    pub(super) entries: Vec<u32>,
    /// Number of merges of neighbouring angles that made the coarser axis; with 0 all stated angles remain.
    pub(super) halvings: u32,
}
