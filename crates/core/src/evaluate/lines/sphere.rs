//! Polar and azimuth lines of a grid of directions: the rows and columns around a direction, over the pole and across
//! mirror planes.

use super::line::{Along, Line, Node, ON_BORDER};
use crate::domain::vector::Vector;
use crate::domain::{AzimuthExtent, Direction, DirectionGrid, Frame, Outside, WIDEST_GAP};
use crate::evaluate::kernel::{BLOCK, Block, Vectors, set_vector, vector_of};
use crate::numeric::wide;

/// Difference in degrees below which two azimuths count as equal: an azimuth in a mirror plane and its own mirror
/// image.
const SAME: f64 = 1e-9;

/// Polar angle in degrees of the horizon of a surface.
const HORIZON: f64 = 90.0;
/// Degrees in a circle.
const CIRCLE: f64 = 360.0;

/// Flag on rows of a grid that are continued beyond a pole: their directions lie at the opposite azimuth.
const BEYOND: u32 = 1 << 31;

/// Borders in a grid of directions, across which nothing is interpolated.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::evaluate) struct Borders {
    /// True if values between azimuths more than 90° apart are unknown, as between the planes of a scan.
    pub(in crate::evaluate) gaps: bool,
    /// True if the two sides of the horizon are functions of their own, as those of a surface.
    pub(in crate::evaluate) horizon: bool,
}

/// Grid of polar angles and azimuths, continued over the poles and across mirror planes, for interpolation between its
/// directions.
///
/// Every direction of the grid has a place with the interpolated value: its own sample, or the mean of all samples
/// stated for the same direction. The stated samples of those have extra places after the grid's.
#[derive(Debug)]
pub(super) struct Sphere {
    grid: DirectionGrid,
    /// Polar angles of the grid's rows, each with the number of the row's first direction; [`BEYOND`] marks rows
    /// continued beyond a pole.
    polar: Line,
    azimuth: Line,
    borders: Borders,
    /// True if the grid covers all azimuths, so that each azimuth can be looked up without a check.
    is_round: bool,
    /// Open intervals of azimuths in degrees, between planes of a scan, in which nothing is known.
    gaps: Vec<[f64; 2]>,
    /// Groups of grid directions that coincide; then all directions of the groups in increasing order of their numbers.
    same: Vec<Vec<u32>>,
    merged: Vec<u32>,
    /// For each direction of the grid, the number of the first direction that coincides with it.
    first_of: Vec<u32>,
}

/// Samples around a direction, in four rows (polar angles) of four columns (azimuths), and the interpolation weights
/// along rows and columns.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patch {
    /// Numbers of the first samples in the four rows (polar angles) of the 4 × 4 samples around a direction.
    rows: [u32; 4],
    /// For each of the four rows (polar angles) of samples around a direction: 1 if the row lies beyond a pole, so that
    /// its azimuths are opposite, else 0. It selects the column numbers and weights of the row.
    sides: [u8; 4],
    columns: [[u32; 4]; 2],
    along: [Along; 2],
    /// Interpolation weights across the rows, that is, over the polar angle.
    pub(super) across: Along,
}

impl Patch {
    /// Interpolation stencil (4 × 4 samples with weights) that consists of a single sample with weight 1.
    fn one(place: u32) -> Self {
        Self { rows: [place; 4], sides: [0; 4], columns: [[0; 4]; 2], along: [Along::START; 2], across: Along::START }
    }

    /// Returns the interpolation weights over the azimuth in row `row` of the 4 × 4 samples around a direction.
    #[inline(always)]
    pub(super) fn along(&self, row: usize) -> &Along {
        &self.along[usize::from(self.sides[row] & 1)]
    }

    /// Position, in the table of samples over all directions, of one of the 4 × 4 samples around a direction. `row`
    /// counts the polar angles around the direction and `column` the azimuths, both from 0 to 3.
    #[inline(always)]
    pub(super) fn place(&self, row: usize, column: usize) -> u32 {
        self.rows[row] + self.columns[usize::from(self.sides[row] & 1)][column]
    }
}

impl Sphere {
    /// Prepares interpolation between the directions of a grid.
    pub(super) fn new(grid: &DirectionGrid, borders: Borders) -> Self {
        let same = grid.coinciding();
        let merged = same.iter().flatten().copied().collect();
        let mut first_of: Vec<u32> = (0..grid.len() as u32).collect();
        for same in &same {
            for &entry in same {
                first_of[entry as usize] = same[0];
            }
        }
        let (polar, azimuth) = (polar_line(grid, borders.horizon), azimuth_line(grid));
        let is_gap = |[from, to]: &[f64; 2]| borders.gaps && grid.azimuths().is_some() && to - from > WIDEST_GAP;
        let gaps: Vec<[f64; 2]> = azimuth.intervals().into_iter().filter(is_gap).collect();
        let is_round = gaps.is_empty() && grid.covers_all_azimuths();
        Self { polar, azimuth, borders, is_round, gaps, same, merged, first_of, grid: grid.clone() }
    }

    /// Groups of grid directions that coincide.
    pub(super) fn same(&self) -> &[Vec<u32>] {
        &self.same
    }

    /// Number of the table entry that holds the original sample of a grid direction, before directions that coincide
    /// are averaged.
    pub(super) fn stated(&self, entry: u32) -> u32 {
        self.merged.binary_search(&entry).map_or(entry, |position| (self.grid.len() + position) as u32)
    }

    /// Number of the first direction of the grid that coincides with direction number `entry`.
    #[inline]
    pub(super) fn first_of(&self, entry: u32) -> u32 {
        self.first_of[entry as usize]
    }

    pub(super) fn grid(&self) -> &DirectionGrid {
        &self.grid
    }

    /// Intervals of the polar angle, then of the azimuth, in degrees, that tile the covered part of the sphere without
    /// its mirror images across the equator. They lie between the angles of the grid, and from its outermost angles to
    /// the ends of the covered part.
    pub(super) fn intervals(&self) -> [Vec<[f64; 2]>; 2] {
        let (low, high) = self.grid.covers();
        let polar = self.grid.polar();
        let mut ends = polar.to_vec();
        if low < polar[0] {
            ends.insert(0, low);
        }
        if high > polar[polar.len() - 1] {
            ends.push(high);
        }
        [ends.array_windows().map(|&[a, b]| [a, b]).collect(), self.azimuth.intervals()]
    }

    /// Value outside the part of the sphere that the grid covers: NaN if masked, 0 if dark.
    pub(super) fn outside(&self) -> f32 {
        match self.grid.outside() {
            Outside::Masked => f32::NAN,
            Outside::Dark => 0.0,
        }
    }

    /// Selects the direction of the grid nearest to `direction`; `None` outside the part of the sphere that the grid
    /// covers.
    pub(super) fn nearest(&self, direction: Direction) -> Option<Patch> {
        let entry = self.grid.nearest(direction)?;
        let angles = self.grid.angles(direction)?;
        self.off_gaps(angles)?;
        Some(Patch::one(self.on_side_of(angles[0], entry) as u32))
    }

    /// Number of the direction `entry` of the grid if it lies on the same side of the horizon as the angle `polar`, or
    /// if the horizon is no border; else of its neighbour across the horizon.
    fn on_side_of(&self, polar: f64, entry: usize) -> usize {
        let [rows, columns] = self.grid.shape();
        let is_below = |angle: f64| angle > HORIZON + ON_BORDER;
        let row = entry / columns;
        match (is_below(polar), is_below(self.grid.polar()[row])) {
            (true, false) if self.borders.horizon && row + 1 < rows => entry + columns,
            (false, true) if self.borders.horizon && row > 0 => entry - columns,
            _ => entry,
        }
    }

    /// Samples around a direction; `None` outside the part of the sphere that the grid covers.
    #[inline(always)]
    pub(super) fn patch(&self, direction: Vector) -> Option<Patch> {
        let frame = self.grid.frame();
        self.patch_at(frame.angles_of_upright(frame.upright(direction)))
    }

    /// Samples around a polar angle and an azimuth (degrees, in the grid's frame); `None` outside the part of the
    /// sphere that the grid covers.
    #[inline(always)]
    pub(super) fn patch_at(&self, angles: [f64; 2]) -> Option<Patch> {
        let [polar, azimuth] = if self.is_round {
            let polar = if self.grid.is_polar_mirrored() { angles[0].abs() } else { angles[0] };
            if !self.grid.covers_polar(polar) {
                return None;
            }
            // The line may extend beyond the ends of the grid.
            let ends = self.grid.polar();
            [
                polar.clamp(if self.grid.is_polar_mirrored() { -ends[0] } else { ends[0] }, ends[ends.len() - 1]),
                angles[1],
            ]
        } else {
            self.off_gaps(self.grid.held(angles)?)?
        };
        let across = self.polar.around(polar);
        let here = self.azimuth.around(azimuth);
        let [a, b, c, d] = across.entries;
        let is_beyond = (a | b | c | d) & BEYOND != 0;
        let opposite = if is_beyond { self.azimuth.around(azimuth + 180.0) } else { here };
        Some(Patch {
            rows: [a & !BEYOND, b & !BEYOND, c & !BEYOND, d & !BEYOND],
            sides: [(a >> 31) as u8, (b >> 31) as u8, (c >> 31) as u8, (d >> 31) as u8],
            columns: [here.entries, opposite.entries],
            along: [here.along, opposite.along],
            across: across.along,
        })
    }

    /// Returns a polar angle and an azimuth (degrees, in the grid's frame) unless the azimuth lies in a gap between
    /// planes. Azimuths within 10⁻³ degrees of a plane, on the sphere, move onto the plane.
    fn off_gaps(&self, [polar, azimuth]: [f64; 2]) -> Option<[f64; 2]> {
        let Some([first, _]) = self.gaps.first() else { return Some([polar, azimuth]) };
        if self.grid.is_at_pole(polar) {
            return Some([polar, *first]);
        }
        let border = self.grid.border(polar);
        for &[from, to] in &self.gaps {
            let along = (azimuth - from).rem_euclid(CIRCLE);
            if along <= border || CIRCLE - along <= border {
                return Some([polar, from]);
            }
            if along < to - from - border {
                return None;
            }
            if along <= to - from + border {
                return Some([polar, to]);
            }
        }
        Some([polar, azimuth])
    }

    /// Writes the polar angles and azimuths of a block of vectors, which need not be unit vectors, in degrees with
    /// respect to the axes of the grid (its pole and its azimuth 0). [`Sphere::patch_at`] takes such angles.
    pub(super) fn angles(&self, directions: &Vectors, to: &mut [Block; 2]) {
        let frame = self.grid.frame();
        wide(
            #[inline(always)]
            || {
                let mut upright = *directions;
                for i in 0..BLOCK {
                    set_vector(&mut upright, i, frame.upright(vector_of(directions, i)));
                }
                // One loop for each convention of polar angles, so that the loop has no branch.
                if frame.polar_range().0 < 0.0 {
                    angles_of(Frame::TypeA, &upright, to);
                } else {
                    angles_of(Frame::Surface, &upright, to);
                }
            },
        );
    }

    pub(super) fn memory(&self) -> usize {
        let same: usize = self.same.iter().map(|same| size_of_val(&**same)).sum();
        self.polar.memory()
            + self.azimuth.memory()
            + size_of_val(&*self.merged)
            + size_of_val(&*self.first_of)
            + size_of_val(&*self.gaps)
            + same
    }
}

#[inline(always)]
fn angles_of(frame: Frame, upright: &Vectors, [polar, azimuth]: &mut [Block; 2]) {
    for i in 0..BLOCK {
        [polar[i], azimuth[i]] = frame.angles_of_upright(vector_of(upright, i));
    }
}

/// Axis of the polar angles of a grid of directions, and of their images beyond a pole or the mirrored equator. Each
/// entry holds the index of the first grid direction at that polar angle, or at the original of an image.
fn polar_line(grid: &DirectionGrid, is_parted: bool) -> Line {
    let (angles, [rows, columns]) = (grid.polar(), grid.shape());
    let place = |row: usize| (row * columns) as u32;
    let mut nodes: Vec<Node> = angles.iter().zip(0..).map(|(&angle, row)| Node { angle, entry: place(row) }).collect();
    let (low, high) = grid.frame().polar_range();
    let image = |pole: f64, row: usize, turned: bool| Node {
        angle: 2.0 * pole - angles[row],
        entry: if turned { place(row) | BEYOND } else { place(row) },
    };
    if rows > 1 && angles[rows - 1] == high {
        nodes.push(image(high, rows - 2, true));
    }
    if grid.is_polar_mirrored() {
        let from = usize::from(angles[0] == 0.0);
        nodes.splice(0..0, (from..rows.min(from + 2)).rev().map(|row| image(0.0, row, false)));
    } else if rows > 1 && angles[0] == low {
        nodes.insert(0, image(low, 1, true));
    }
    if is_parted { Line::parted(nodes, HORIZON) } else { Line::new(nodes, false) }
}

/// Axis of the azimuths around the whole circle, including mirror images; if the grid covers a sector only, of the
/// sector.
fn azimuth_line(grid: &DirectionGrid) -> Line {
    let is_circle = grid.azimuths().is_none_or(|azimuths| azimuths.extent != AzimuthExtent::Sector);
    Line::new(azimuth_nodes(grid), is_circle)
}

/// Azimuths of a grid in increasing order, with their mirror images around the whole circle; those of a sector without.
pub(in crate::evaluate) fn azimuth_nodes(grid: &DirectionGrid) -> Vec<Node> {
    let Some(azimuths) = grid.azimuths() else {
        return vec![Node { angle: 0.0, entry: 0 }];
    };
    let own = azimuths.angles.iter().zip(0..).map(|(&angle, entry)| Node { angle, entry });
    let images: &[fn(f64) -> f64] = match azimuths.extent {
        AzimuthExtent::Sector => return own.collect(),
        AzimuthExtent::Circle | AzimuthExtent::Closed => &[],
        AzimuthExtent::Mirrored => &[|a| -a],
        AzimuthExtent::MirroredAt90 => &[|a| 180.0 - a],
        AzimuthExtent::Quadrant => &[|a| 180.0 - a, |a| 180.0 + a, |a| -a],
    };
    let first = azimuths.angles[0];
    let from_first = |angle: f64| angle - CIRCLE * libm::floor((angle - first) / CIRCLE);
    let mirrored = own.clone().flat_map(|Node { angle, entry }| {
        images.iter().map(move |image| Node { angle: from_first(image(angle)), entry })
    });
    let mut nodes: Vec<Node> = own.chain(mirrored).collect();
    nodes.sort_by(|a, b| a.angle.total_cmp(&b.angle).then(a.entry.cmp(&b.entry)));
    nodes.dedup_by(|later, earlier| later.angle - earlier.angle < SAME);
    // Removes the repeated first azimuth, one circle further.
    while nodes.len() > 1 && nodes[nodes.len() - 1].angle - first > CIRCLE - SAME {
        nodes.pop();
    }
    nodes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::{Azimuths, Frame};

    fn grid(frame: Frame, polar: &[f64], azimuths: Option<(&[f64], AzimuthExtent)>) -> DirectionGrid {
        let azimuths = azimuths.map(|(angles, extent)| Azimuths { angles: angles.to_vec(), extent });
        DirectionGrid::new(frame, polar.to_vec(), azimuths).unwrap()
    }

    fn value(sphere: &Sphere, values: &[f64], direction: Direction) -> f64 {
        let of = |place: u32| {
            let same = sphere.same().iter().find(|same| same.contains(&place));
            let mean =
                same.map(|same| same.iter().map(|&entry| values[entry as usize]).sum::<f64>() / same.len() as f64);
            mean.unwrap_or_else(|| values[place as usize])
        };
        let patch = sphere.patch(direction.xyz()).unwrap();
        let row = |r: usize| -> f64 {
            (0..4).map(|column| of(patch.place(r, column)) * f64::from(patch.along(r).cubic[column])).sum()
        };
        (0..4).map(|r| row(r) * f64::from(patch.across.cubic[r])).sum()
    }

    #[test]
    fn smooth_functions_of_direction_are_smooth_over_poles_and_mirrors() {
        // A function with both mirror planes, on every extent that can represent it.
        let f = |[x, y, z]: [f64; 3]| 2.0 + z + 0.5 * x * x - 0.3 * y * y * z;
        let every = |first: f64, last: f64, step: f64| -> Vec<f64> {
            (0..=((last - first) / step).round() as u32).map(|i| first + step * f64::from(i)).collect()
        };
        let polar = every(0.0, 180.0, 5.0);
        for frame in [Frame::Surface, Frame::TypeC] {
            for (azimuths, extent) in [
                (every(0.0, 350.0, 10.0), AzimuthExtent::Circle),
                (every(-180.0, 170.0, 10.0), AzimuthExtent::Circle),
                (every(0.0, 360.0, 10.0), AzimuthExtent::Closed),
                (every(0.0, 180.0, 10.0), AzimuthExtent::Mirrored),
                (every(5.0, 175.0, 10.0), AzimuthExtent::Mirrored),
                (every(90.0, 270.0, 10.0), AzimuthExtent::MirroredAt90),
                (every(0.0, 90.0, 10.0), AzimuthExtent::Quadrant),
            ] {
                let grid = grid(frame, &polar, Some((&azimuths, extent)));
                let sphere = Sphere::new(&grid, Borders::default());
                let values: Vec<f64> = (0..grid.len()).map(|i| f(grid.direction(i).xyz())).collect();
                for (theta, phi) in
                    [(1.0, 33.0), (2.4, 200.0), (47.3, 1.0), (92.0, 359.0), (178.0, 91.0), (60.0, 182.0)]
                {
                    let direction = Direction::from_degrees(theta, phi);
                    let (found, expected) = (value(&sphere, &values, direction), f(direction.xyz()));
                    assert!((found - expected).abs() < 2e-3, "{frame} {extent} {theta} {phi}: {found} {expected}");
                }
                for entry in 0..grid.len() {
                    let found = value(&sphere, &values, grid.direction(entry));
                    assert!((found - values[entry]).abs() < 1e-5, "{frame} {extent} {entry}");
                }
            }
        }
    }

    #[test]
    fn latitudes_are_mirrored_across_the_equator() {
        for first in [0.0, 4.0] {
            let polar: Vec<f64> = (0..10).map(|i| first + 8.0 * f64::from(i)).collect();
            let azimuths: Vec<f64> = (-9..=9).map(|i| 10.0 * f64::from(i)).collect();
            let grid = grid(Frame::TypeB, &polar, Some((&azimuths, AzimuthExtent::Sector)));
            let grid = grid.mirrored().unwrap().covering(0.0, polar[9]).unwrap();
            let f = |[x, y, z]: [f64; 3]| 1.0 + y * y + 0.2 * x - 0.4 * z;
            let sphere = Sphere::new(&grid, Borders::default());
            let values: Vec<f64> = (0..grid.len()).map(|i| f(grid.direction(i).xyz())).collect();
            for (latitude, azimuth) in [(1.0, 5.0), (-1.0, 5.0), (-33.0, -72.0), (0.0, 0.0)] {
                let direction = Frame::TypeB.direction(latitude, azimuth);
                let found = value(&sphere, &values, direction);
                assert!((found - f(direction.xyz())).abs() < 2e-3, "{first} {latitude} {azimuth}");
            }
        }
    }

    #[test]
    fn places_stated_several_times_are_one() {
        let closed = grid(Frame::TypeC, &[0.0, 90.0, 180.0], Some((&[0.0, 180.0, 360.0], AzimuthExtent::Closed)));
        let sphere = Sphere::new(&closed, Borders::default());
        assert_eq!(sphere.same(), [vec![0, 1, 2], vec![3, 5], vec![6, 7, 8]]);
        assert_eq!([3, 4, 5].map(|entry| sphere.stated(entry)), [12, 4, 13]);
        assert_eq!([3, 4, 5].map(|entry| sphere.first_of(entry)), [3, 4, 3]);
        let plain = Sphere::new(&grid(Frame::TypeC, &[0.0, 90.0], None), Borders::default());
        let nearest = plain.nearest(Direction::from_degrees(180.0, 0.0)).unwrap();
        assert_eq!((plain.same().len(), plain.stated(1), nearest.place(1, 1)), (0, 1, 0));
    }
}
