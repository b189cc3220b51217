//! Tensor trees as functions of two directions: the concentric map of the disk to the square, and the tree's cells.

use super::super::acquisition::{Angles, AzimuthExtent, Azimuths, DirectionalFunction, Modelled, ParseReport, Samples};
use super::super::error::{FormatError, FormatErrorKind};
use super::super::lit_side::LitSide;
use super::super::text::{Source, snippet};
use super::blocks::Block;
use super::choice::Choice;
use super::tree::Tree;
use crate::domain::Direction;
use crate::notes::{Brief, ScatteringNote, ValueNote};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};
use std::sync::Arc;

/// Name of the only basis of trees.
const BASIS: &str = "LBNL/Shirley-Chiu";

/// Least sine of an incident polar angle in a tree of rank 3, whose cells are those below the middle of an axis.
const LEAST_SINE: f64 = 1e-6;

/// Functions of reflected and of transmitted light as trees.
#[derive(Debug)]
struct Trees {
    rank: usize,
    /// Side from which light comes.
    side: LitSide,
    reflection: Option<Tree>,
    transmission: Option<Tree>,
}

/// Reads the chosen trees as a function; also returns a description of their cells.
pub(super) fn samples(
    rank: usize,
    choice: &Choice<'_>,
    source: &Source,
    report: &mut ParseReport,
) -> Result<(String, Samples), FormatError> {
    let read = |block: Option<&Block<'_>>| block.map(|block| tree(rank, block, source)).transpose();
    let side = choice.side();
    let trees = Trees { rank, side, reflection: read(choice.reflection)?, transmission: read(choice.transmission)? };
    let all = || trees.reflection.iter().chain(&trees.transmission);
    let numbers = all().map(|tree| tree.values().len()).sum();
    let negative = all().flat_map(Tree::values).filter(|value| **value < 0.0).count();
    if negative > 0 {
        let lowest = all().flat_map(Tree::values).copied().fold(0.0, f32::min);
        report.note(ValueNote::NegativeOf { values: negative, of: numbers, lowest });
    }
    let finest = all().map(|tree| tree.halvings).max().unwrap_or(0);
    let coarsest = all().map(|tree| tree.coarsest).min().unwrap_or(0);
    let cells = |halvings: u32| 1_usize << halvings;
    // Width of a cell of the disk about the normal.
    let width = |halvings: u32| (2.0 / cells(halvings) as f64).to_degrees();
    report.note(ScatteringNote::CellsOfTree {
        values: numbers,
        narrowest_degrees: Brief(libm::round(100.0 * width(finest)) / 100.0),
        widest_degrees: Brief(libm::round(100.0 * width(coarsest).min(180.0)) / 100.0),
    });
    let layout = format!("tensor tree of rank {rank}, {numbers} values, cells down to 1/{}", cells(finest));
    let modelled = Modelled {
        incoming: incoming(rank, cells(finest)),
        outgoing_spacing: width(finest).min(90.0),
        spectral: None,
        numbers,
        missing: 0,
        stated: None,
        function: Arc::new(trees),
    };
    Ok((layout, Samples::Function(modelled)))
}

fn tree(rank: usize, block: &Block<'_>, source: &Source) -> Result<Tree, FormatError> {
    let element = block.element.child("AngleBasis");
    let name = element.map_or("", |element| &element.text);
    if !name.eq_ignore_ascii_case(BASIS) {
        let offset = element.unwrap_or(block.element).offset;
        let message = format!("AngleBasis {} of a tensor tree, expected {BASIS}", snippet(name));
        return Err(source.error(FormatErrorKind::Unsupported, offset, message));
    }
    Tree::read(source, block.data.content.clone(), rank)
}

/// Returns the incoming angles of a tree with `side` cells along a side: polar angles at the middles of cells, and for
/// rank 4 azimuths that are about as dense.
fn incoming(rank: usize, side: usize) -> Angles {
    let rings = (side / 2).max(1);
    let sine = |ring: usize| if side < 2 { 0.5 } else { (2 * ring + 1) as f64 / side as f64 };
    let theta = (0..rings).map(|ring| libm::round(libm::asin(sine(ring)).to_degrees() * 1e6) / 1e6).collect();
    let count = 4 * rings;
    let phi = (0..count).map(|k| 360.0 * k as f64 / count as f64).collect();
    let phi = (rank == 4).then_some(Azimuths { phi, extent: AzimuthExtent::Circle });
    Angles { theta, covers: (0.0, 90.0), phi }
}

impl DirectionalFunction for Trees {
    fn evaluate(&self, wi: Direction, wo: Direction, values: &mut [f64]) {
        let ([xi, yi, _], [xo, yo, zo]) = (wi.xyz(), wo.xyz());
        // Seen from the front, WINDOW's x points to the left.
        let [xi, xo] = match self.side {
            LitSide::Front => [-xi, -xo],
            LitSide::Back => [xi, xo],
        };
        let tree = if zo >= 0.0 { &self.reflection } else { &self.transmission };
        let position = if self.rank == 3 {
            let sine = libm::hypot(xi, yi).min(1.0);
            // Turned so that the direction opposite to the light has azimuth 0.
            let [cos, sin] = if sine > 0.0 { [-xi / sine, -yi / sine] } else { [-1.0, 0.0] };
            let [x, y] = square(cos * xo + sin * yo, cos * yo - sin * xo);
            [0.5 - 0.5 * sine.max(LEAST_SINE), x, y, 0.0]
        } else {
            let ([a, b], [c, d]) = (square(-xi, -yi), square(xo, yo));
            [a, b, c, d]
        };
        let value = tree.as_ref().map_or(f64::NAN, |tree| f64::from(tree.at(position)));
        values.fill(value);
    }
}

/// Maps a point of the unit disk to the unit square, concentric circles to concentric squares (P. Shirley and K. Chiu,
/// "A Low Distortion Map Between Disk and Square", 1997).
fn square(x: f64, y: f64) -> [f64; 2] {
    let radius = libm::hypot(x, y);
    let angle = libm::atan2(y, x);
    let angle = if angle < -FRAC_PI_4 { angle + TAU } else { angle };
    let along = |middle: f64| (angle - middle) * radius / FRAC_PI_4;
    let [a, b] = match angle {
        angle if angle < FRAC_PI_4 => [radius, along(0.0)],
        angle if angle < 3.0 * FRAC_PI_4 => [-along(FRAC_PI_2), radius],
        angle if angle < 5.0 * FRAC_PI_4 => [-radius, -along(PI)],
        _ => [along(3.0 * FRAC_PI_2), -radius],
    };
    [0.5 + 0.5 * a, 0.5 + 0.5 * b]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn circles_become_squares() {
        let near =
            |[a, b]: [f64; 2], [c, d]: [f64; 2]| assert!((a - c).abs() + (b - d).abs() < 1e-12, "{a} {b} {c} {d}");
        near(square(0.0, 0.0), [0.5, 0.5]);
        near(square(1.0, 0.0), [1.0, 0.5]);
        near(square(0.0, 1.0), [0.5, 1.0]);
        near(square(-0.5, 0.0), [0.25, 0.5]);
        near(square(0.0, -0.5), [0.5, 0.25]);
        let half = 0.5_f64.sqrt();
        near(square(half, half), [1.0, 1.0]);
        near(square(-half, -half), [0.0, 0.0]);
        near(square(0.5 * half, -0.5 * half), [0.75, 0.25]);
        // An eighth of the circle: half way along the side.
        let (sin, cos) = (PI / 8.0).sin_cos();
        near(square(cos, sin), [1.0, 0.75]);
        near(square(-sin, cos), [0.25, 1.0]);
    }
}
