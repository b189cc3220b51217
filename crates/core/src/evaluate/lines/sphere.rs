//! Both lines of a grid of directions together: the rows and columns around a direction, over the pole and across mirror planes.

use super::line::{Around, Line, Node};
use crate::domain::{AzimuthExtent, Direction, DirectionGrid, Outside};

/// Azimuths nearer to one another than this, in degrees, are one: mirror images of an azimuth in the mirror plane.
const SAME: f64 = 1e-9;

/// The lines of a grid of directions.
#[derive(Debug)]
pub(super) struct Sphere {
    grid: DirectionGrid,
    polar: Line,
    azimuth: Line,
    columns: usize,
    /// Rows of the grid: entries of the polar line from this number on lie beyond a pole, at the opposite azimuth.
    rows: u32,
    /// Place of each direction's value: its own, or that of a mean.
    place_of: Vec<u32>,
    /// The directions that each place beyond the grid's own is the mean of.
    means: Vec<Vec<u32>>,
}

/// The places around a direction: four rows of four, and the weights along both lines.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patch {
    pub(super) places: [[u32; 4]; 4],
    /// Weights along each row.
    pub(super) along: [Along; 4],
    /// Weights from row to row.
    pub(super) across: Along,
}

/// Weights along a line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Along {
    pub(super) cubic: [f32; 4],
    pub(super) t: f32,
}

impl From<Around> for Along {
    fn from(Around { cubic, t, .. }: Around) -> Self {
        Self { cubic, t }
    }
}

impl Sphere {
    pub(super) fn new(grid: &DirectionGrid) -> Self {
        let [rows, columns] = grid.shape();
        let (place_of, means) = places(grid);
        Self {
            polar: polar_line(grid),
            azimuth: azimuth_line(grid),
            columns,
            rows: rows as u32,
            place_of,
            means,
            grid: grid.clone(),
        }
    }

    /// The directions that each place after the grid's own is the mean of.
    pub(super) fn means(&self) -> &[Vec<u32>] {
        &self.means
    }

    pub(super) fn grid(&self) -> &DirectionGrid {
        &self.grid
    }

    /// Intervals of the polar angle and of the azimuth, in degrees, that tile what the grid covers without its mirror images
    /// across the equator: between the angles of the file, and from its ends to those of what is covered.
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

    /// The value outside what the grid covers.
    pub(super) fn outside(&self) -> f32 {
        match self.grid.outside() {
            Outside::Masked => f32::NAN,
            Outside::Dark => 0.0,
        }
    }

    /// The place of the direction of the grid that is nearest; `None` outside what it covers.
    pub(super) fn nearest(&self, direction: Direction) -> Option<u32> {
        self.grid.nearest(direction).map(|entry| self.place_of[entry])
    }

    /// The places around a direction; `None` outside what the grid covers.
    pub(super) fn patch(&self, direction: Direction) -> Option<Patch> {
        let [polar, azimuth] = self.grid.angles(direction)?;
        let across = self.polar.around(polar);
        let here = self.azimuth.around(azimuth);
        let is_beyond = |entry: u32| entry >= self.rows;
        let opposite =
            if across.entries.into_iter().any(is_beyond) { self.azimuth.around(azimuth + 180.0) } else { here };
        let of_row = |entry: u32| if is_beyond(entry) { opposite } else { here };
        let place = |entry: u32, column: u32| {
            let row = if is_beyond(entry) { entry - self.rows } else { entry };
            self.place_of[row as usize * self.columns + column as usize]
        };
        Some(Patch {
            places: across.entries.map(|entry| of_row(entry).entries.map(|column| place(entry, column))),
            along: across.entries.map(|entry| of_row(entry).into()),
            across: across.into(),
        })
    }

    pub(super) fn memory(&self) -> usize {
        let means: usize = self.means.iter().map(|mean| size_of_val(&**mean)).sum();
        self.polar.memory() + self.azimuth.memory() + size_of_val(&*self.place_of) + means
    }
}

/// The polar angles, and beyond a pole or the mirrored equator those on its other side. Rows beyond a pole, where the azimuth is
/// the opposite one, have numbers from that of the rows on.
fn polar_line(grid: &DirectionGrid) -> Line {
    let (angles, rows) = (grid.polar(), grid.polar().len());
    let mut nodes: Vec<Node> = angles.iter().zip(0..).map(|(&angle, entry)| Node { angle, entry }).collect();
    let (low, high) = grid.frame().polar_range();
    let image = |pole: f64, row: usize, turned: bool| Node {
        angle: 2.0 * pole - angles[row],
        entry: if turned { (rows + row) as u32 } else { row as u32 },
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
    Line::new(nodes, false)
}

/// The azimuths around the whole circle, mirror images among them; those of a sector alone.
fn azimuth_line(grid: &DirectionGrid) -> Line {
    let Some(azimuths) = grid.azimuths() else {
        return Line::new(vec![Node { angle: 0.0, entry: 0 }], true);
    };
    let own = azimuths.angles.iter().zip(0..).map(|(&angle, entry)| Node { angle, entry });
    let images: &[fn(f64) -> f64] = match azimuths.extent {
        AzimuthExtent::Sector => return Line::new(own.collect(), false),
        AzimuthExtent::Circle | AzimuthExtent::Closed => &[],
        AzimuthExtent::Mirrored => &[|a| -a],
        AzimuthExtent::MirroredAt90 => &[|a| 180.0 - a],
        AzimuthExtent::Quadrant => &[|a| 180.0 - a, |a| 180.0 + a, |a| -a],
    };
    let first = azimuths.angles[0];
    let from_first = |angle: f64| angle - 360.0 * libm::floor((angle - first) / 360.0);
    let mirrored = own.clone().flat_map(|Node { angle, entry }| {
        images.iter().map(move |image| Node { angle: from_first(image(angle)), entry })
    });
    let mut nodes: Vec<Node> = own.chain(mirrored).collect();
    nodes.sort_by(|a, b| a.angle.total_cmp(&b.angle).then(a.entry.cmp(&b.entry)));
    nodes.dedup_by(|later, earlier| later.angle - earlier.angle < SAME);
    // The first again, a circle further.
    while nodes.len() > 1 && nodes[nodes.len() - 1].angle - first > 360.0 - SAME {
        nodes.pop();
    }
    Line::new(nodes, true)
}

/// Returns the place of each direction's value, and the directions of each place that is a mean: all azimuths at a pole are
/// one direction, and so are the first and the last azimuth of a closed circle.
fn places(grid: &DirectionGrid) -> (Vec<u32>, Vec<Vec<u32>>) {
    let [rows, columns] = grid.shape();
    let own = (rows * columns) as u32;
    let mut place_of: Vec<u32> = (0..own).collect();
    let mut means = Vec::new();
    if columns == 1 {
        return (place_of, means);
    }
    let (low, high) = grid.frame().polar_range();
    let is_closed = grid.azimuths().is_some_and(|azimuths| azimuths.extent == AzimuthExtent::Closed);
    for (row, &angle) in grid.polar().iter().enumerate() {
        let entries: Vec<u32> = (row * columns..(row + 1) * columns).map(|entry| entry as u32).collect();
        let merged = if angle == low || angle == high {
            entries
        } else if is_closed {
            vec![entries[0], entries[columns - 1]]
        } else {
            continue;
        };
        for &entry in &merged {
            place_of[entry as usize] = own + means.len() as u32;
        }
        means.push(merged);
    }
    (place_of, means)
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
            let place = place as usize;
            values.get(place).copied().unwrap_or_else(|| {
                let mean = &sphere.means()[place - values.len()];
                mean.iter().map(|&entry| values[entry as usize]).sum::<f64>() / mean.len() as f64
            })
        };
        let patch = sphere.patch(direction).unwrap();
        let row = |r: usize| -> f64 {
            patch.places[r].iter().zip(patch.along[r].cubic).map(|(&place, w)| of(place) * f64::from(w)).sum()
        };
        (0..4).map(|r| row(r) * f64::from(patch.across.cubic[r])).sum()
    }

    #[test]
    fn smooth_functions_of_direction_are_smooth_over_poles_and_mirrors() {
        // A function with both mirror planes, on every extent that can hold it.
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
                let sphere = Sphere::new(&grid);
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
            let sphere = Sphere::new(&grid);
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
        let sphere = Sphere::new(&closed);
        assert_eq!(sphere.means(), [vec![0, 1, 2], vec![3, 5], vec![6, 7, 8]]);
        assert_eq!(sphere.nearest(closed.direction(5)), Some(10));
        assert_eq!(sphere.nearest(closed.direction(4)), Some(4));
        let plain = Sphere::new(&grid(Frame::TypeC, &[0.0, 90.0], None));
        assert_eq!((plain.means().len(), plain.nearest(Direction::from_degrees(180.0, 0.0))), (0, Some(0)));
    }
}
