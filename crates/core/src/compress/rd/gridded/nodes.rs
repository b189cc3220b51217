//! Nodes of one line of a level: its entries after some halvings are left out.

/// Line of a level.
pub(super) struct Nodes {
    /// Number of decoded nodes.
    pub(super) count: usize,
    /// Angles of the entries of the axis.
    pub(super) positions: Vec<f64>,
    /// Node of each entry of the axis.
    pub(super) entries: Vec<u32>,
    /// Number of halvings left out; with 0 all stated entries remain.
    pub(super) halvings: u32,
}
