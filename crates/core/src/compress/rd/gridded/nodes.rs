//! Nodes of one line of a level: what is left of its entries after some halvings are left out.

/// One line of a level.
pub(super) struct Nodes {
    /// Nodes that are decoded.
    pub(super) count: usize,
    /// Angles of the entries of the axis.
    pub(super) positions: Vec<f64>,
    /// Node of each entry of the axis.
    pub(super) entries: Vec<u32>,
    /// Halvings that are left out; of a line without any all stated entries remain.
    pub(super) halvings: u32,
}
