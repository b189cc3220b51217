//! Tensor trees: nested braces, whose innermost hold grids of values over cubes of three or four dimensions.

use super::super::error::{FormatError, FormatErrorKind};
use super::super::text::{Source, number, snippet};
use super::matrix::value;
use std::ops::Range;

/// Upper bound on the halvings of a side from the whole cube to a cell. Radiance writes up to 8. Raising it accepts
/// finer trees, and deeper recursion.
const MAX_HALVINGS: usize = 12;
/// Number of dimensions that a tree can have at most.
pub(super) const MOST_DIMENSIONS: usize = 4;

/// Function on a cube that is constant over cells, which differ in size.
#[derive(Debug)]
pub(super) struct Tree {
    rank: usize,
    nodes: Vec<Node>,
    values: Vec<f32>,
    root: u32,
    /// Number of halvings of the cube's side that gives the smallest cells.
    pub(super) halvings: u32,
    /// Number of halvings of the cube's side that gives the largest cells.
    pub(super) coarsest: u32,
}

#[derive(Debug)]
enum Node {
    /// One child for each half of each dimension; bit k of a child's number selects the half of dimension k.
    Branches(Vec<u32>),
    /// Cells of equal size, with the last dimension varying fastest: halvings of the side, and place of the first
    /// value.
    Cells { halvings: u32, first: usize },
}

impl Tree {
    /// Reads a tree of `rank` dimensions from a part of the source.
    pub(super) fn read(source: &Source, content: Range<usize>, rank: usize) -> Result<Self, FormatError> {
        let tree = Self { rank, nodes: Vec::new(), values: Vec::new(), root: 0, halvings: 0, coarsest: u32::MAX };
        let mut reader = Reader { source, at: content.start, end: content.end, tree };
        let root = reader.node(0)?;
        if let Some(next) = reader.peek() {
            let message = format!("found {} after the tree, expected nothing", snippet(&String::from(next)));
            return Err(source.malformed(reader.at, message));
        }
        Ok(Self { root, ..reader.tree })
    }

    /// Returns all values of the tree.
    pub(super) fn values(&self) -> &[f32] {
        &self.values
    }

    /// Returns the value of the cell that contains a position in the unit cube.
    pub(super) fn at(&self, position: [f64; MOST_DIMENSIONS]) -> f32 {
        let mut position = position.map(|x| x.clamp(0.0, BELOW_ONE));
        let mut node = self.root;
        loop {
            match self.nodes.get(node as usize) {
                Some(Node::Branches(children)) => {
                    let mut child = 0;
                    for (k, x) in position.iter_mut().enumerate().take(self.rank) {
                        *x *= 2.0;
                        if *x >= 1.0 {
                            child |= 1 << k;
                            *x -= 1.0;
                        }
                    }
                    node = children[child];
                }
                Some(&Node::Cells { halvings, first }) => {
                    let side = 1_usize << halvings;
                    let cell = position[..self.rank]
                        .iter()
                        .fold(0, |cell, x| cell * side + ((x * side as f64) as usize).min(side - 1));
                    return self.values.get(first + cell).copied().unwrap_or(f32::NAN);
                }
                None => return f32::NAN,
            }
        }
    }
}

/// Largest coordinate in the unit cube, whose sides at 1 belong to no cell.
const BELOW_ONE: f64 = 1.0 - f64::EPSILON;

struct Reader<'a> {
    source: &'a Source,
    at: usize,
    end: usize,
    tree: Tree,
}

impl Reader<'_> {
    /// Skips blanks and returns the next character, without consuming it.
    fn peek(&mut self) -> Option<char> {
        let rest = self.source.text().get(self.at..self.end)?;
        let trimmed = rest.trim_start();
        self.at += rest.len() - trimmed.len();
        trimmed.chars().next()
    }

    fn expect(&mut self, wanted: char) -> Result<(), FormatError> {
        match self.peek() {
            Some(found) if found == wanted => {
                self.at += wanted.len_utf8();
                Ok(())
            }
            found => {
                let found = found.map(String::from).unwrap_or_default();
                let message = format!("found {} in a tensor tree, expected `{wanted}`", snippet(&found));
                Err(self.source.malformed(self.at, message))
            }
        }
    }

    /// Reads one node, which is `depth` halvings inside the whole cube, and returns its number.
    fn node(&mut self, depth: usize) -> Result<u32, FormatError> {
        let start = self.at;
        if depth > MAX_HALVINGS {
            let message = format!("a tensor tree inside {MAX_HALVINGS} others, expected fewer nested braces");
            return Err(self.source.error(FormatErrorKind::OverLimit, start, message));
        }
        self.expect('{')?;
        let node = if self.peek() == Some('{') {
            let children = (0..1_usize << self.tree.rank).map(|_| self.node(depth + 1)).collect::<Result<_, _>>()?;
            Node::Branches(children)
        } else {
            self.cells(depth)?
        };
        self.expect('}')?;
        let number = u32::try_from(self.tree.nodes.len()).map_err(|_| {
            self.source.error(FormatErrorKind::OverLimit, start, "more nodes in a tensor tree than can be numbered")
        })?;
        self.tree.nodes.push(node);
        Ok(number)
    }

    /// Reads the values of a node without children, up to the closing brace.
    fn cells(&mut self, depth: usize) -> Result<Node, FormatError> {
        let (start, first, rank) = (self.at, self.tree.values.len(), self.tree.rank);
        while let Some(next) = self.peek() {
            if next == '}' {
                break;
            }
            let rest = self.source.text().get(self.at..self.end).unwrap_or_default();
            let word =
                rest.split(|c: char| c.is_whitespace() || matches!(c, ',' | '{' | '}')).next().unwrap_or_default();
            let number = number(word).ok_or_else(|| {
                let found = if word.is_empty() { snippet(&String::from(next)) } else { snippet(word) };
                self.source.malformed(self.at, format!("found {found}, expected a value in 1/sr"))
            })?;
            self.tree.values.push(value(number, self.at, self.source)?);
            self.at += word.len();
            if self.peek() == Some(',') {
                self.at += 1;
            }
        }
        let count = self.tree.values.len() - first;
        let halvings = (0..=MAX_HALVINGS.saturating_sub(depth)).find(|k| count == 1 << (rank * k));
        let Some(halvings) = halvings.and_then(|halvings| u32::try_from(halvings).ok()) else {
            let sizes: Vec<String> = (0..3).map(|k| (1_usize << (rank * k)).to_string()).collect();
            let message = format!("{count} values in one node of a tensor tree, expected {} …", sizes.join(", "));
            return Err(self.source.malformed(start, message));
        };
        let in_all = depth as u32 + halvings;
        self.tree.halvings = self.tree.halvings.max(in_all);
        self.tree.coarsest = self.tree.coarsest.min(in_all);
        Ok(Node::Cells { halvings, first })
    }
}
