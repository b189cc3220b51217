//! Averages of the divisor over cells of outgoing directions, by which the cells' own averages are divided.

use super::course::Course;
use crate::domain::vector::Vector;
use crate::domain::{TriangleMesh, centroid, child, solid_angle};
use crate::evaluate::between::FOUR;
use crate::evaluate::reconstruct::Cells;
use crate::numeric::logarithm::ln_f32;
use rayon::prelude::*;
use wide::f32x4;

/// Level of the triangles into which cells are divided to average the divisor over them: parts of 0.3° are narrower
/// than half the lobe of a surface of roughness 0.02.
const FINEST: u8 = 8;
/// Limits of the number of times that a cell is divided into four.
const LEAST_DIVISIONS: u8 = 1;
const MOST_DIVISIONS: u8 = 4;

/// Logarithms of the averages of a divisor (model divided out before interpolation) over cells of outgoing directions,
/// or of its values at their centroids if the samples were taken there.
pub(super) struct CellMeans<'a> {
    course: &'a Course,
    cells: usize,
    incidences: usize,
    /// `[incoming direction][cell]`
    logarithms: Vec<f32>,
}

/// Directions of four parts of a cell, and the parts' solid angles.
struct Parts {
    directions: [f32x4; 3],
    solid_angles: [f64; FOUR],
}

impl<'a> CellMeans<'a> {
    pub(super) fn new(course: &'a Course, incidences: &[Vector], cells: &Cells) -> Self {
        let (mesh, count) = (cells.mesh(), cells.mesh().len());
        let pairs = incidences.par_iter().flat_map_iter(|&wi| (0..count).map(move |cell| (wi, cell)));
        let logarithms = if cells.has_averages() {
            let parts = parts(mesh);
            let of_cell = parts.len() / count;
            let mean = |(wi, cell): (Vector, usize)| mean(course, wi, &parts[cell * of_cell..][..of_cell]);
            pairs.map(mean).map(|mean| ln_f32(mean as f32)).collect()
        } else {
            pairs.map(|(wi, cell)| course.divisor(wi, cells.points(cell)[0])).collect()
        };
        Self { course, cells: count, incidences: incidences.len(), logarithms }
    }

    /// Divides the spectra that the coefficients of all cells represent, `[cell][coefficient]`. `table` is the
    /// row-major number of the combination of indices and of the incoming direction.
    pub(super) fn divide(&self, table: usize, averages: &mut [f32], width: usize) {
        let first = table % self.incidences * self.cells;
        for (row, logarithm) in averages.chunks_exact_mut(width).zip(&self.logarithms[first..]) {
            row.iter_mut().zip(self.course.constant).for_each(|(value, constant)| *value -= logarithm * constant);
        }
    }
}

/// Parts of all cells of a mesh, as many for each.
fn parts(mesh: TriangleMesh) -> Vec<Parts> {
    let divisions = FINEST.saturating_sub(mesh.level()).clamp(LEAST_DIVISIONS, MOST_DIVISIONS);
    let cells = mesh.all_vertices();
    let of_cell = |cell: &[Vector; 3]| {
        let mut triangles = vec![*cell];
        for _ in 1..divisions {
            triangles = triangles.into_iter().flat_map(|triangle| (0..FOUR).map(move |k| child(triangle, k))).collect();
        }
        triangles.into_iter().map(|triangle| {
            let four: [[Vector; 3]; FOUR] = std::array::from_fn(|k| child(triangle, k));
            let centroids = four.map(|part| centroid(part).xyz());
            let directions = [0, 1, 2].map(|axis| f32x4::new(centroids.map(|d| d[axis] as f32)));
            Parts { directions, solid_angles: four.map(solid_angle) }
        })
    };
    cells.iter().flat_map(of_cell).collect()
}

/// Average of the divisor over the parts of a cell.
fn mean(course: &Course, wi: Vector, parts: &[Parts]) -> f64 {
    let wi = wi.map(|x| f32x4::splat(x as f32));
    let (mut sum, mut weights) = (0.0, 0.0);
    for Parts { directions, solid_angles } in parts {
        let values = course.divided.value(wi, *directions).to_array();
        for (value, solid_angle) in values.into_iter().zip(solid_angles) {
            sum += solid_angle * f64::from(value);
            weights += solid_angle;
        }
    }
    sum / weights
}
