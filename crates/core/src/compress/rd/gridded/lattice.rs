//! Tensor with grid directions as planes on a product of lines; repeated slices are dropped, and restored when
//! decoding.
//!
//! ```text
//! even decisions: for each azimuth line whose last angle is the first, 360° later: are both slices equal (then the
//!                 last is dropped, and the line is a circle)
//!                 for each line of more than one entry: does any slice equal the one before it; if so, one adaptive
//!                 decision for each entry but the first: does this one (then it is dropped)
//!                 for each pole among the remaining polar angles, of a grid with more than one remaining azimuth: are
//!                 all its azimuths equal (then the first of them has weight, and the others are copies)
//! ```
//! Lines are those of the incoming axis, then those of the outgoing one, polar angles before azimuths.

use super::super::chart::ChartKind;
use super::super::lines::{AXES, Grid, Line};
use super::nodes::Nodes;
use crate::codec::{BitCoder, ClassGrid, code_flags};
use crate::domain::vector::Vector;
use crate::domain::{Axis, AzimuthExtent, DirectionGrid, Frame};
use std::ops::Range;
use std::slice;

/// Axis of polar angles or azimuths as the file states it.
#[derive(Clone, Debug)]
struct Stated {
    positions: Vec<f64>,
    /// Full turn in degrees if the azimuths go all the way round, so that the first and the last are neighbours; `None`
    /// otherwise.
    period: Option<f64>,
    /// True if the last azimuth is the first plus 360°, so that both are one direction.
    is_closed: bool,
    /// True for a pole at the first and at the last polar angle, respectively; false without azimuths.
    poles: [bool; 2],
}

/// Layout of a tensor whose last directions are a grid of angles: `[blocks, polar angles and azimuths…, wavelengths]`.
#[derive(Clone, Debug)]
pub(crate) struct Shape {
    blocks: usize,
    lines: Vec<Stated>,
    /// Number of angle axes (polar angles, azimuths) of the incoming directions, 0 to 2.
    incoming: usize,
    /// Coordinate frames of the incoming and the outgoing angles, each with the fixed azimuth of a grid that has only
    /// one.
    frames: [(Frame, f64); 2],
    length: usize,
}

impl Shape {
    /// Returns the layout of a tensor as axes of angles; `None` if the last axis of directions is not a grid of angles.
    pub(crate) fn of(axes: &[Axis]) -> Option<Self> {
        let at = axes.iter().rposition(|axis| matches!(axis, Axis::Triangles(_) | Axis::Grid(_)))?;
        let Axis::Grid(outgoing) = &axes[at] else { return None };
        if axes.len() > at + 2 {
            return None;
        }
        let mut lines = Vec::new();
        let mut frames = [(Frame::Surface, 0.0), frame_of(outgoing)];
        let mut first = at;
        match at.checked_sub(1).map(|before| &axes[before]) {
            Some(Axis::Elevation(positions)) => {
                lines.push(Stated { positions: positions.clone(), period: None, is_closed: false, poles: [false; 2] });
                first = at - 1;
            }
            Some(Axis::Grid(incoming)) => {
                lines.extend(lines_of(incoming));
                frames[0] = frame_of(incoming);
                first = at - 1;
            }
            _ => {}
        }
        let incoming = lines.len();
        lines.extend(lines_of(outgoing));
        Some(Self {
            blocks: axes[..first].iter().map(Axis::len).product(),
            lines,
            incoming,
            frames,
            length: axes.get(at + 1).map_or(1, Axis::len),
        })
    }

    /// Number of samples for each pair of directions, usually the number of wavelengths.
    pub(crate) fn length(&self) -> usize {
        self.length
    }

    /// Order in which wavelengths or colour channels are coded; three channels as green, blue, red.
    pub(crate) fn lanes(&self) -> Vec<usize> {
        if self.length == 3 { vec![1, 2, 0] } else { (0..self.length).collect() }
    }

    /// Layout for coding the samples' classes (positive, negative, zero, masked): rows of azimuths.
    pub(crate) fn class_grid(&self) -> ClassGrid {
        let outgoing = &self.lines[self.incoming..];
        let length = |line: usize| outgoing.get(line).map_or(1, |line| line.positions.len());
        let (polar, azimuths) = if outgoing.len() > 1 { (length(0), length(1)) } else { (1, length(0)) };
        ClassGrid { incoming: self.incoming_entries(), polar, azimuths, lanes: self.lanes() }
    }

    /// Number of incoming directions: entries of all axes in front of the outgoing directions.
    pub(crate) fn incoming_entries(&self) -> usize {
        self.blocks * self.lines[..self.incoming].iter().map(|line| line.positions.len()).product::<usize>()
    }

    /// Returns true if the tensor has only one slice of outgoing directions: each axis in front of them has a single
    /// entry.
    pub(crate) fn is_single(&self) -> bool {
        self.incoming_entries() == 1
    }

    /// Kinds of scattering model that the incoming and outgoing angles allow.
    pub(crate) fn models(&self) -> &'static [ChartKind] {
        match (self.blocks, self.incoming) {
            (1, 1) => &[ChartKind::Isotropic],
            (1, 2) => &[ChartKind::Isotropic, ChartKind::Anisotropic],
            _ => &[],
        }
    }

    /// Stated polar angles and azimuths of the incoming and of the outgoing directions; `None` without incoming angles,
    /// or with angles of luminaires.
    pub(super) fn angles(&self) -> Option<[[Vec<f64>; 2]; 2]> {
        let (incoming, outgoing) = self.lines.split_at(self.incoming);
        let of = |(frame, only): (Frame, f64), lines: &[Stated]| -> Option<[Vec<f64>; 2]> {
            let [polar, azimuths @ ..] = lines else { return None };
            let azimuths = azimuths.first().map_or_else(|| vec![only], |line| line.positions.clone());
            (frame == Frame::Surface).then(|| [polar.positions.clone(), azimuths])
        };
        let [from, to] = self.frames;
        Some([of(from, incoming)?, of(to, outgoing)?])
    }

    /// Number of spectra in the tensor, one for each pair of an incoming and an outgoing direction.
    pub(crate) fn rows(&self) -> usize {
        self.blocks * self.lines.iter().map(|line| line.positions.len()).product::<usize>()
    }
}

/// Coordinate frame of a grid of angles, and its first azimuth in degrees, 0 without azimuths.
fn frame_of(grid: &DirectionGrid) -> (Frame, f64) {
    let azimuth = grid.azimuths().and_then(|azimuths| azimuths.angles.first());
    (grid.frame(), azimuth.copied().unwrap_or(0.0))
}

fn lines_of(grid: &DirectionGrid) -> Vec<Stated> {
    let (low, high) = grid.frame().polar_range();
    let polar = grid.polar().to_vec();
    let poles = [polar.first() == Some(&low), polar.last() == Some(&high)];
    let azimuths = grid.azimuths().filter(|azimuths| azimuths.angles.len() > 1);
    let line = |positions, poles| Stated { positions, period: None, is_closed: false, poles };
    let mut lines = vec![line(polar, poles.map(|pole| pole && azimuths.is_some()))];
    if let Some(azimuths) = azimuths {
        lines.push(Stated {
            period: (azimuths.extent == AzimuthExtent::Circle).then_some(360.0),
            is_closed: azimuths.extent == AzimuthExtent::Closed,
            ..line(azimuths.angles.clone(), [false; 2])
        });
    }
    lines
}

/// Angle axis from which entries are dropped if their samples repeat those of another entry.
#[derive(Clone, Debug, PartialEq)]
struct Kept {
    /// For each entry of the axis in the measurement, index of the entry with equal samples among those left after
    /// repeated entries are dropped.
    source: Vec<u32>,
    positions: Vec<f64>,
    period: Option<f64>,
    /// Indices of poles at which all azimuths have equal samples, counted among the polar angles that repeat no other.
    poles: Vec<u32>,
}

/// Layout of a tensor on grids of angles after its repeated slices are dropped.
#[derive(Clone, Debug)]
pub(crate) struct Lattice {
    shape: Shape,
    kept: Vec<Kept>,
}

/// Slices of a tensor, one for each entry of one angle axis, for comparison with each other.
struct Slices<'a> {
    same: &'a dyn Fn(usize, usize) -> bool,
    before: usize,
    length: usize,
    behind: usize,
}

impl Slices<'_> {
    fn are_equal(&self, a: usize, b: usize) -> bool {
        (0..self.before).all(|outer| {
            let first = |entry| (outer * self.length + entry) * self.behind;
            (0..self.behind).all(|inner| (self.same)(first(a) + inner, first(b) + inner))
        })
    }
}

impl Lattice {
    /// Encodes or decodes which slices of a tensor of this layout repeat others. `same` tells an encoder which samples
    /// are equal; a decoder passes `None`.
    pub(crate) fn code<C: BitCoder>(coder: &mut C, shape: Shape, same: Option<&dyn Fn(usize, usize) -> bool>) -> Self {
        let lengths: Vec<usize> = shape.lines.iter().map(|line| line.positions.len()).collect();
        let slices = |axis: usize| {
            same.map(|same| Slices {
                same,
                before: shape.blocks * lengths[..axis].iter().product::<usize>(),
                length: lengths[axis],
                behind: shape.length * lengths[axis + 1..].iter().product::<usize>(),
            })
        };
        let mut kept: Vec<Kept> = Vec::with_capacity(lengths.len());
        for (axis, line) in shape.lines.iter().enumerate() {
            let slices = slices(axis);
            let equal = |a: usize, b: usize| slices.as_ref().is_some_and(|slices| slices.are_equal(a, b));
            let last = lengths[axis] - 1;
            let is_seam = line.is_closed && coder.even(equal(last, 0));
            let stated = last + usize::from(!is_seam);
            let mut drops = vec![false; stated];
            if !C::DECODES {
                for (entry, drop) in drops.iter_mut().enumerate().skip(1) {
                    *drop = equal(entry, entry - 1);
                }
            }
            if stated > 1 && coder.even(drops.contains(&true)) {
                code_flags(coder, &mut drops[1..]);
            } else {
                drops.fill(false);
            }
            let mut positions = Vec::new();
            let mut source = Vec::with_capacity(lengths[axis]);
            for (entry, &is_dropped) in drops.iter().enumerate() {
                if !is_dropped {
                    positions.push(line.positions[entry]);
                }
                source.push(positions.len() as u32 - 1);
            }
            if is_seam {
                source.push(0);
            }
            let period = if is_seam { Some(360.0) } else { line.period };
            kept.push(Kept { source, positions, period, poles: Vec::new() });
        }
        for axis in 0..lengths.len().saturating_sub(1) {
            let (line, azimuths) = (&shape.lines[axis], kept[axis + 1].positions.len());
            let last = kept[axis].positions.len() as u32 - 1;
            let ends = [(0, 0), (lengths[axis] - 1, last)];
            for ((stated, entry), _) in ends.into_iter().zip(line.poles).filter(|(_, pole)| *pole && azimuths > 1) {
                let is_constant = slices(axis + 1).is_some_and(|slices| is_constant(&slices, (stated, lengths[axis])));
                if !kept[axis].poles.contains(&entry) && coder.even(is_constant) {
                    kept[axis].poles.push(entry);
                }
            }
        }
        Self { shape, kept }
    }

    /// Grid of angles whose samples are coded together: all angle axes, or only the outgoing ones if incoming
    /// directions are coded independently for random access (`random`).
    pub(crate) fn grid(&self, random: bool) -> Grid {
        let lines: Vec<Line> = self.kept[self.first(random)..]
            .iter()
            .map(|kept| Line { positions: kept.positions.clone(), period: kept.period })
            .collect();
        Grid::new(&lines)
    }

    fn first(&self, random: bool) -> usize {
        if random { self.shape.incoming } else { 0 }
    }

    /// Number of slices in which a tensor on grids of angles is coded: one for each entry of the axes before the angles
    /// or, if incoming directions are coded independently (`random`), one for each distinct incoming direction of each
    /// such entry.
    pub(crate) fn units(&self, random: bool) -> usize {
        self.shape.blocks * self.kept[..self.first(random)].iter().map(|kept| kept.positions.len()).product::<usize>()
    }

    /// Number of the byte stream that codes an incoming direction, if incoming directions are coded independently.
    pub(crate) fn unit_of(&self, entry: usize) -> usize {
        let incoming = 0..self.shape.incoming;
        let units: usize = self.kept[incoming.clone()].iter().map(|kept| kept.positions.len()).product();
        let rows = self.rows_of(incoming);
        entry / rows.len() * units + rows[entry % rows.len()] as usize
    }

    /// Returns true if several incoming directions are copies of one because they lie at a pole.
    pub(crate) fn has_incoming_poles(&self) -> bool {
        self.kept[..self.shape.incoming].iter().any(|kept| !kept.poles.is_empty())
    }

    /// Number of distinct pairs of directions to be coded: the pairs of one slice (entry of the index axes in front),
    /// times the number of slices.
    pub(crate) fn leaves(&self) -> usize {
        self.shape.blocks * self.kept.iter().map(|kept| kept.positions.len()).product::<usize>()
    }

    /// Maps each direction (or pair of directions) on the angle axes of the range `lines` to the distinct direction (or
    /// pair) that has its samples, for example to one azimuth at a pole. Returns row-major indices among the distinct
    /// ones.
    fn rows_of(&self, lines: Range<usize>) -> Vec<u32> {
        let mut rows = vec![0_u32];
        for axis in lines.clone() {
            let kept = &self.kept[axis];
            let n = kept.positions.len() as u32;
            let polar = axis.checked_sub(1).filter(|polar| lines.contains(polar)).map(|polar| &self.kept[polar]);
            let of_row = |&row: &u32| {
                let is_pole = polar.is_some_and(|polar| polar.poles.contains(&(row % polar.positions.len() as u32)));
                kept.source.iter().map(move |&entry| row * n + if is_pole { 0 } else { entry })
            };
            rows = rows.iter().flat_map(of_row).collect();
        }
        rows
    }

    /// Incoming and outgoing directions that are left after repeated ones are dropped. `None` without incoming
    /// directions, or with other axes in front.
    pub(super) fn directions(&self) -> Option<[Vec<Vector>; 2]> {
        let (incoming, outgoing) = self.kept.split_at(self.shape.incoming);
        let of = |(frame, only): (Frame, f64), lines: &[Kept]| -> Option<Vec<Vector>> {
            let [polar, azimuths @ ..] = lines else { return None };
            let azimuths = azimuths.first().map_or(slice::from_ref(&only), |line| &line.positions);
            let row = |&polar: &f64| azimuths.iter().map(move |&azimuth| frame.direction(polar, azimuth).xyz());
            Some(polar.positions.iter().flat_map(row).collect())
        };
        let [from, to] = self.shape.frames;
        (self.shape.blocks == 1).then_some(())?;
        Some([of(from, incoming)?, of(to, outgoing)?])
    }

    /// For each outgoing direction of the measurement, row-major index of the one with equal samples among those left
    /// after repeated angles are dropped.
    pub(crate) fn outgoing_rows(&self) -> Vec<u32> {
        self.rows_of(self.shape.incoming..self.kept.len())
    }

    /// For each direction pair of the tensor, number of the distinct direction pair whose samples it repeats.
    pub(crate) fn rows(&self) -> Vec<u32> {
        let rows = self.rows_of(0..self.kept.len());
        let leaves = (self.leaves() / self.shape.blocks) as u32;
        (0..self.shape.blocks as u32).flat_map(|block| rows.iter().map(move |&row| block * leaves + row)).collect()
    }

    /// For each distinct direction pair, number of the first direction pair of the tensor that has its samples.
    pub(crate) fn first_rows(&self, rows: &[u32]) -> Vec<u32> {
        let mut first = vec![u32::MAX; self.leaves()];
        for (row, &leaf) in rows.iter().enumerate().rev() {
            first[leaf as usize] = row as u32;
        }
        // Copies within a pole represent no row: they take the pole's own row.
        let mut last = 0;
        for row in &mut first {
            if *row == u32::MAX {
                *row = last;
            }
            last = *row;
        }
        first
    }

    /// Angle axes of a coarser grid, made by merging neighbouring angles in pairs along one axis after another.
    /// `left_out` lists the axis of each merge: 3 is the last axis of angles, 2 the one before it, down to 0.
    pub(super) fn coarse_lines(&self, left_out: &[u8]) -> Vec<Nodes> {
        let lines = self.kept.len();
        let halvings = |axis: usize| left_out.iter().filter(|&&halved| usize::from(halved) == axis).count() as u32;
        (0..lines).map(|line| self.nodes(line, halvings(AXES - lines + line))).collect()
    }

    /// Returns true if merges along the axes in `left_out` make all azimuths of an axis one.
    pub(super) fn has_lost_azimuths(&self, left_out: &[u8]) -> bool {
        let lines = self.coarse_lines(left_out);
        let (incoming, outgoing) = lines.split_at(self.shape.incoming);
        [incoming, outgoing].iter().any(|lines| lines.get(1).is_some_and(|line| line.halvings > 0 && line.count == 1))
    }

    /// Angle axis after `halvings` merges of neighbouring entries. Every merged entry lies at the mean of the stated
    /// angles in it; an azimuth of 360° that repeats 0° does not count. Without a halving all stated entries remain.
    fn nodes(&self, line: usize, halvings: u32) -> Nodes {
        let (stated, kept) = (&self.shape.lines[line], &self.kept[line]);
        if halvings == 0 {
            let (positions, entries) = (stated.positions.clone(), kept.source.clone());
            return Nodes { count: kept.positions.len(), positions, entries, halvings };
        }
        let count = (0..halvings).fold(kept.positions.len(), |count, _| count.div_ceil(2));
        let is_seam = stated.is_closed && kept.period.is_some();
        let own = kept.source.len() - usize::from(is_seam);
        let mut sums = vec![(0.0, 0_u32); count];
        for (&source, angle) in kept.source[..own].iter().zip(&stated.positions) {
            let (sum, merged) = &mut sums[(source >> halvings) as usize];
            (*sum, *merged) = (*sum + angle, *merged + 1);
        }
        let positions = sums.into_iter().map(|(sum, merged)| sum / f64::from(merged)).collect();
        Nodes { count, positions, entries: (0..count as u32).collect(), halvings }
    }

    /// For each direction pair of a coarser grid, number of the decoded mean that it takes.
    pub(super) fn coarse_rows(&self, lines: &[Nodes]) -> Vec<u32> {
        let mut rows = vec![0_u32];
        for (axis, line) in lines.iter().enumerate() {
            let n = line.count as u32;
            // Copies within a pole have no node of their own.
            let polar = axis.checked_sub(1).map(|polar| (&lines[polar], &self.kept[polar].poles));
            let polar = polar.filter(|(polar, _)| polar.halvings == 0);
            let of_row = |&row: &u32| {
                let is_pole = polar.is_some_and(|(polar, poles)| poles.contains(&(row % polar.count as u32)));
                line.entries.iter().map(move |&entry| row * n + if is_pole { 0 } else { entry })
            };
            rows = rows.iter().flat_map(of_row).collect();
        }
        let nodes = lines.iter().map(|line| line.count as u32).product::<u32>();
        (0..self.shape.blocks as u32).flat_map(|block| rows.iter().map(move |&row| block * nodes + row)).collect()
    }

    /// For each distinct direction pair, number of the node (merged direction pairs) of a coarser grid that contains
    /// it.
    pub(super) fn nodes_of_leaves(&self, lines: &[Nodes]) -> Vec<u32> {
        let mut nodes: Vec<u32> = (0..self.shape.blocks as u32).collect();
        for (line, kept) in lines.iter().zip(&self.kept) {
            let n = line.count as u32;
            let entries = 0..kept.positions.len() as u32;
            let mut next = Vec::with_capacity(nodes.len() * entries.len());
            for node in nodes {
                next.extend(entries.clone().map(|entry| node * n + (entry >> line.halvings)));
            }
            nodes = next;
        }
        nodes
    }

    /// Layout of the tensor with all angles of the measurement, including those whose samples repeat those of others.
    pub(crate) fn shape(&self) -> &Shape {
        &self.shape
    }
}

/// Returns true if at polar angle number `entry`, out of `of`, all azimuths have equal samples.
fn is_constant(azimuths: &Slices<'_>, (entry, of): (usize, usize)) -> bool {
    (0..azimuths.before).filter(|outer| outer % of == entry).all(|outer| {
        let first = outer * azimuths.length * azimuths.behind;
        (azimuths.behind..azimuths.length * azimuths.behind)
            .all(|i| (azimuths.same)(first + i, first + i % azimuths.behind))
    })
}
