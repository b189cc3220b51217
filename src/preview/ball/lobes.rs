//! What a surface scatters, tabulated for pictures: a few incoming directions × a lattice of outgoing ones, in linear sRGB.
//!
//! Between incoming directions a lobe is moved along, not faded over: from each tabulated direction the value is taken where
//! it has the half vector of the pair asked for. A measurement of 16 incoming directions so has one highlight, not the 16 that
//! are in its samples. Where the pair is tabulated, the value is the material's own smooth one.

use super::super::PreviewError;
use super::super::channels::Channels;
use super::lattice::{Lattice, Rgb, Vector};
use crate::domain::vector::{dot, scale, sub, unit};
use crate::domain::{Axis, Direction, Domain, Measurement, Quantity, Sampling, Tensor, TriangleMesh, Unit};
use crate::evaluate::{Interpolation, Material, Place};
use rayon::prelude::*;
use std::f64::consts::{FRAC_1_PI, PI};

/// A surface as a picture needs it: f(wi, wo), with wi.z ≥ 0 on the side of the light.
pub(super) struct Lobes {
    incoming: Incoming,
    lattice: Lattice,
    /// For each incoming node the values by outgoing direction on the side of the light, and by the mirror image of the
    /// direction on the other side; either may be absent.
    sides: [Option<Vec<Vec<Rgb>>>; 2],
    /// For each incoming node, by reciprocity: what a uniform surrounding sends that way, and one that is as bright as the
    /// z of its direction is high, for z along x, y and z of the surface.
    surroundings: Vec<[Rgb; 4]>,
}

/// On which side of the surface light leaves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    /// Where it came from.
    Reflected = 0,
    /// The other one.
    Transmitted = 1,
}

/// Tabulated incoming directions.
enum Incoming {
    Lattice(Lattice, Vec<usize>, Vec<Vector>),
    /// Of isotropic data: cosines, decreasing, and directions of azimuth 0.
    Elevations(Vec<f64>, Vec<Vector>),
}

/// Values that are evaluated for a table.
const EVALUATIONS: usize = 120_000;
/// Samples of the incoming directions used, in linear sRGB.
const SAMPLES: usize = 1 << 24;
/// Elevations that are tabulated.
const ELEVATIONS: usize = 24;
/// The cosine of a moved direction from which its value counts in full.
const FULL_HEIGHT: f64 = 0.2;
/// Subdivisions of the lattice of incoming directions.
const FINEST: usize = 6;

impl Lobes {
    /// Of entry `index` of a BRDF, BTDF or BSDF; of a reflectance by incoming direction as a diffuser.
    pub(super) fn of(material: &Material, index: &[usize], channels: &Channels) -> Result<Self, PreviewError> {
        let layout = material.layout();
        let axes = material.axes();
        let Some(incoming_axis) = layout.incoming else {
            return super::super::unfit("no incoming axis, expected one to light a ball");
        };
        let outgoing = layout.outgoing.map(|axis| &axes[axis]);
        let (cells, flip) = cells(&axes[incoming_axis]);
        let diffuse = matches!(material.quantity(), Quantity::Reflectance);
        let width = outgoing.map_or(1, Axis::len);
        let (incoming, stencils) = nodes(&axes[incoming_axis], &cells, (SAMPLES / width).max(4));
        let mut used: Vec<usize> = stencils.iter().flatten().map(|&(cell, _)| cell).collect();
        used.sort_unstable();
        used.dedup();
        let lambdas = material.lambdas();
        let entry = material.entry(index)?;
        let row = |cell: usize| material.slice(entry * axes[incoming_axis].len() + cell);
        let (lattice, tables) = if let Some(Axis::Triangles(mesh)) = outgoing {
            let finest = (2_usize << mesh.level()).clamp(8, 48);
            let affordable = ((EVALUATIONS / used.len()) as f64 / 2.0).sqrt() as usize;
            let lattice = Lattice::new(finest.min(affordable.max(6)));
            (lattice, outgoing_tables(*mesh, flip, lattice, lambdas, channels, &used, row)?)
        } else {
            let lattice = Lattice::new(1);
            let of = |&cell: &usize| {
                let rgb = channels.linear(&row(cell));
                let share = if diffuse { FRAC_1_PI as f32 } else { 1.0 };
                vec![rgb.map(|c| if c.is_nan() { 0.0 } else { share * c }); lattice.len()]
            };
            (lattice, [Some(used.iter().map(of).collect()), None])
        };
        // Cells to nodes, lobes moved along.
        let directions = incoming.directions();
        let sides = tables.map(|side| {
            side.map(|tables: Vec<Vec<Rgb>>| {
                let node = |(to, stencil): (&Vector, &Vec<(usize, f64)>)| {
                    let mut table = vec![[0.0; 3]; lattice.len()];
                    for (place, wo) in lattice.nodes() {
                        let around = stencil.iter().map(|&(cell, weight)| {
                            let at = used.partition_point(|&known| known < cell);
                            (tables[at].as_slice(), cells[cell].1, weight as f32)
                        });
                        table[place] = mean(lattice, *to, wo, around);
                    }
                    table
                };
                directions.par_iter().zip(&stencils).map(node).collect()
            })
        });
        let mut lobes = Self { incoming, lattice, sides, surroundings: Vec::new() };
        lobes.surroundings = lobes.surroundings();
        Ok(lobes)
    }

    pub(super) fn has(&self, side: Side) -> bool {
        self.sides[side as usize].is_some()
    }

    /// f in sr⁻¹ of unit vectors; `wo` on the other side is given mirrored, with z ≥ 0. 0 where nothing is measured.
    pub(super) fn at(&self, side: Side, wi: Vector, wo: Vector) -> Rgb {
        let Some(tables) = &self.sides[side as usize] else { return [0.0; 3] };
        let (around, [cos, sin]) = self.incoming.around(wi);
        let wi = turned(wi, cos, -sin);
        let wo = turned(wo, cos, -sin);
        let directions = self.incoming.directions();
        let around = around.into_iter().map(|(node, weight)| (tables[node].as_slice(), directions[node], weight));
        mean(self.lattice, wi, wo, around)
    }

    /// What surroundings of radiance `uniform + gradient · z` of the world's z reflect towards `wo`; `up` is the world's z in
    /// the surface's frame. The function is taken to be reciprocal.
    pub(super) fn surrounded(&self, wo: Vector, up: Vector, uniform: f32, gradient: f32) -> Rgb {
        let (around, [cos, sin]) = self.incoming.around(wo);
        let up = turned(up, cos, -sin).map(|c| c as f32);
        let mut sum = [0.0; 3];
        for (node, weight) in around {
            let [all, x, y, z] = &self.surroundings[node];
            for k in 0..3 {
                sum[k] += weight * (uniform * all[k] + gradient * (up[0] * x[k] + up[1] * y[k] + up[2] * z[k]));
            }
        }
        sum
    }

    fn surroundings(&self) -> Vec<[Rgb; 4]> {
        let Some(tables) = &self.sides[Side::Reflected as usize] else {
            return vec![[[0.0; 3]; 4]; self.incoming.directions().len()];
        };
        let Some(mesh) = TriangleMesh::new(Domain::Hemisphere, 4) else { return Vec::new() };
        let parts: Vec<(Vector, f64)> =
            (0..mesh.len()).map(|i| (mesh.centroid(i).xyz(), mesh.projected_solid_angle(i))).collect();
        let of = |table: &Vec<Rgb>| {
            let mut sums = [[0.0_f64; 3]; 4];
            for &(direction, measure) in &parts {
                let value = self.lattice.at(table, direction);
                let factors = [1.0, direction[0], direction[1], direction[2]];
                for (sum, factor) in sums.iter_mut().zip(factors) {
                    for (sum, value) in sum.iter_mut().zip(value) {
                        *sum += measure * factor * f64::from(value);
                    }
                }
            }
            sums.map(|rgb| rgb.map(|c| c as f32))
        };
        tables.par_iter().map(of).collect()
    }
}

impl Incoming {
    fn directions(&self) -> &[Vector] {
        match self {
            Self::Lattice(_, _, directions) | Self::Elevations(_, directions) => directions,
        }
    }

    /// The nodes around a direction with their weights, and the azimuth to turn back by.
    fn around(&self, wi: Vector) -> ([(usize, f32); 3], [f64; 2]) {
        match self {
            Self::Lattice(lattice, numbers, _) => {
                (lattice.corners(wi).map(|(place, weight)| (numbers[place], weight)), [1.0, 0.0])
            }
            Self::Elevations(cosines, _) => {
                let below = cosines.partition_point(|&c| c >= wi[2]).max(1) - 1;
                let next = (below + 1).min(cosines.len() - 1);
                let gap = cosines[below] - cosines[next];
                let t = if gap > 0.0 { ((cosines[below] - wi[2]) / gap).clamp(0.0, 1.0) as f32 } else { 0.0 };
                let length = (wi[0] * wi[0] + wi[1] * wi[1]).sqrt();
                let azimuth = if length > 0.0 { [wi[0] / length, wi[1] / length] } else { [1.0, 0.0] };
                ([(below, 1.0 - t), (next, t), (next, 0.0)], azimuth)
            }
        }
    }
}

/// The cells of an incoming axis with wi.z ≥ 0 in the surface's frame: their numbers there and directions; whether the
/// data are of the lower side, so that z was turned round.
fn cells(axis: &Axis) -> (Vec<(usize, Vector)>, bool) {
    match axis {
        Axis::Triangles(mesh) => {
            let flip = mesh.domain() == Domain::Lower;
            let cell = |i: usize| {
                let [x, y, z] = mesh.centroid(i).xyz();
                (i, [x, y, if flip { -z } else { z }])
            };
            // On the sphere the first half is the upper one.
            let upper = if mesh.domain() == Domain::Sphere { mesh.len() / 2 } else { mesh.len() };
            ((0..upper).map(cell).collect(), flip)
        }
        Axis::Elevation(values) => {
            let direction = |theta: f64| Direction::from_degrees(theta, 0.0).xyz();
            (values.iter().map(|&theta| direction(theta)).enumerate().collect(), false)
        }
        _ => (Vec::new(), false),
    }
}

/// The incoming directions to tabulate, and for each the cells around it with their weights. At most `most` cells.
fn nodes(axis: &Axis, cells: &[(usize, Vector)], most: usize) -> (Incoming, Vec<Vec<(usize, f64)>>) {
    let Axis::Triangles(mesh) = axis else {
        let count = cells.len().min(ELEVATIONS).min(most).max(1);
        let pick = |i: usize| if count == 1 { 0 } else { i * (cells.len() - 1) / (count - 1) };
        let picked: Vec<usize> = (0..count).map(pick).collect();
        let directions: Vec<Vector> = picked.iter().map(|&i| cells[i].1).collect();
        let cosines = directions.iter().map(|d| d[2]).collect();
        return (Incoming::Elevations(cosines, directions), picked.into_iter().map(|i| vec![(i, 1.0)]).collect());
    };
    let finest = (1_usize << mesh.level()).min(FINEST);
    // Half the neighbours of a node are those of another.
    let fits = |n: &usize| (6 * n * n).min(cells.len()) <= most;
    let n = (1..=finest).rev().find(fits).unwrap_or(1);
    let lattice = Lattice::new(n);
    let mut numbers = vec![0; lattice.len()];
    let (mut directions, mut stencils) = (Vec::new(), Vec::new());
    // Six triangles meet at a vertex; the next ones are twice as far.
    let reach = 1.7 * (2.0 * PI / cells.len() as f64).sqrt();
    for (number, (place, direction)) in lattice.nodes().into_iter().enumerate() {
        numbers[place] = number;
        let mut near: Vec<(usize, f64)> =
            cells.iter().map(|(cell, centre)| (*cell, (2.0 - 2.0 * dot(*centre, direction)).max(0.0).sqrt())).collect();
        let order = |a: &(usize, f64), b: &(usize, f64)| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0));
        let count = 6.min(most / 2).clamp(1, near.len());
        near.select_nth_unstable_by(count - 1, order);
        near.truncate(count);
        near.sort_by(order);
        let closest = near[0].1;
        near.retain(|(_, distance)| *distance < reach.max(1.2 * closest));
        let weights: Vec<f64> = near.iter().map(|(_, distance)| 1.0 / (distance + 0.1 * reach)).collect();
        let total: f64 = weights.iter().sum();
        // Where they are on the whole: at the horizon a half vector would not tell one direction from another.
        let middle = near.iter().zip(&weights).fold([0.0; 3], |sum, ((cell, _), weight)| {
            let at = cells[*cell].1;
            [0, 1, 2].map(|k| sum[k] + weight * at[k])
        });
        stencils.push(near.iter().zip(&weights).map(|((cell, _), weight)| (*cell, weight / total)).collect());
        directions.push(unit(middle));
    }
    (Incoming::Lattice(lattice, numbers, directions), stencils)
}

/// For either side of the surface, for each cell used: its smooth values at the nodes of the lattice.
fn outgoing_tables(
    mesh: TriangleMesh,
    flip: bool,
    lattice: Lattice,
    lambdas: usize,
    channels: &Channels,
    used: &[usize],
    row: impl Fn(usize) -> Vec<f32> + Sync,
) -> Result<[Option<Vec<Vec<Rgb>>>; 2], PreviewError> {
    let mut samples = vec![0.0_f32; used.len() * mesh.len() * 3];
    samples.par_chunks_mut(mesh.len() * 3).zip(used).for_each(|(out, &cell)| {
        for (rgb, spectrum) in out.chunks_exact_mut(3).zip(row(cell).chunks_exact(lambdas)) {
            // Far beyond what is lit, and finite.
            let linear = channels.linear(spectrum).map(|c| if c.is_nan() { c } else { c.clamp(-1e30, 1e30) });
            rgb.copy_from_slice(&linear);
        }
    });
    // The cells as entries of an index axis, each with an emission of its own: smooth in the outgoing direction alone.
    let axes = vec![Axis::Index { count: used.len(), labels: Vec::new() }, Axis::Triangles(mesh), Axis::Rgb];
    let tensor = Tensor::new(axes, samples).map_err(|error| PreviewError::Unfit(error.to_string()))?;
    let slices = Measurement::new(Quantity::Edf, Unit::Relative, Sampling::Average, tensor)
        .map_err(|error| PreviewError::Unfit(error.to_string()))?;
    let slices = Material::of(slices)?;
    let side = |upper: bool| -> Result<Option<Vec<Vec<Rgb>>>, PreviewError> {
        let there = match mesh.domain() {
            Domain::Sphere => true,
            Domain::Hemisphere => upper,
            Domain::Lower => !upper,
        };
        if !there {
            return Ok(None);
        }
        let nodes = lattice.nodes();
        let table = |cell: usize| {
            let mut table = vec![[0.0; 3]; lattice.len()];
            let mut whole = true;
            for &(place, [x, y, z]) in &nodes {
                let wo = Direction::from_unit([x, y, if upper { z } else { -z }]);
                let at = Place { index: &[cell], wi: None, wo: Some(wo) };
                slices.spectrum(at, Interpolation::Smooth, &mut table[place])?;
                whole &= table[place].iter().all(|c| !c.is_nan());
            }
            if !whole {
                lattice.fill(&mut table);
            }
            Ok(table)
        };
        (0..used.len()).into_par_iter().map(table).collect::<Result<_, PreviewError>>().map(Some)
    };
    Ok(if flip { [side(false)?, side(true)?] } else { [side(true)?, side(false)?] })
}

/// The value for `wi` and `wo` from tables of other incoming directions, each with its weight: where they have the same half
/// vector. A table counts less the nearer to the horizon that is, and hardly where it is below.
fn mean<'a>(lattice: Lattice, wi: Vector, wo: Vector, tables: impl Iterator<Item = (&'a [Rgb], Vector, f32)>) -> Rgb {
    let half = [wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]];
    let squared = dot(half, half);
    let factor = if squared > 1e-9 { 2.0 / squared } else { 0.0 };
    let (mut sum, mut total) = ([0.0; 3], 0.0);
    for (table, from, weight) in tables {
        if weight <= 0.0 {
            continue;
        }
        let [x, y, z] = sub(scale(half, factor * dot(from, half)), from);
        let weight = weight * (0.01 + (z / FULL_HEIGHT).clamp(0.0, 1.0) as f32);
        let value = lattice.at(table, [x, y, z.max(0.0)]);
        sum = [0, 1, 2].map(|k| sum[k] + weight * value[k]);
        total += weight;
    }
    if total > 0.0 { sum.map(|c| c / total) } else { sum }
}

/// Turned about +z by the angle of this cosine and sine.
fn turned([x, y, z]: Vector, cos: f64, sin: f64) -> Vector {
    [cos * x - sin * y, sin * x + cos * y, z]
}
