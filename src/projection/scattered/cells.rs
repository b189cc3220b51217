//! Averages over triangles of the local fits within them, and what every cell stands on.

use super::cloud::Cloud;
use super::fit::{Fitter, Place, Support};
use super::rows::{Kind, PARTS, Rows};
use super::tree::Found;
use crate::domain::vector::Vector;
use crate::domain::{TriangleMesh, Vertices, centroid, child, solid_angle};
use crate::projection::resampling::Channels;
use rayon::prelude::*;

/// Triangles that one task works through, and that look for their samples together.
const BLOCK: usize = 16;
/// The distance to the nearest sample in a hole that is filled, in parts of that to the farthest that counts.
const DEEPEST: f64 = 0.75;
/// How far values are continued beyond the outermost samples, in distances of these to their fourth neighbours.
const BEYOND: f64 = 2.0;
const NEIGHBOURS: usize = 5;
/// Samples that would lie within the distance to the nearest one if they lay as densely as around: more are a hole.
const HOLE: f32 = 5.0;
/// A hole is so many times emptier than most places between samples are.
const EMPTIER: f32 = 6.0;

/// What a cell stands on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Standing {
    /// A sample lies inside.
    Measured,
    /// It lies between samples.
    Interpolated,
    /// In a hole, or beyond the outermost samples: continued from those around.
    Filled,
    /// Too far from any.
    Empty,
}

/// Cells before it is known how empty places between samples are.
#[derive(Clone, Copy, Debug)]
pub(super) struct Draft {
    has_sample: bool,
    valid: bool,
    surrounded: bool,
    /// How many samples are missing within the distance to the nearest.
    emptiness: f32,
}

impl Draft {
    const NOTHING: Self = Self { has_sample: false, valid: false, surrounded: false, emptiness: 0.0 };
}

/// What is fitted onto triangles.
#[derive(Clone, Copy)]
pub(super) struct Fitted<'a> {
    pub(super) rows: &'a Rows<'a>,
    pub(super) cloud: &'a Cloud,
    pub(super) neighbours: usize,
    /// The variance of a value about the fit in parts of that of its row's light.
    pub(super) noise: f64,
    /// How far the nearest incoming direction may be, as a chord.
    pub(super) incoming_reach: f64,
    /// Whether the two sides of the horizon have nothing to do with each other.
    pub(super) sides_apart: bool,
}

/// Scratch of one task.
#[derive(Default)]
pub(super) struct Scratch {
    pub(super) fitter: Fitter,
    pub(super) found: Vec<Found>,
    candidates: Vec<Found>,
    /// The square of the distance within which the block's centre has its neighbours.
    reach: f64,
    missing: Vec<bool>,
    pub(super) row: Vec<f32>,
    sums: Vec<f64>,
    areas: Vec<f64>,
}

impl Fitted<'_> {
    /// Writes the averages under `wi` over all triangles of `mesh` into `out`, `[triangle, channel]`, NaN where there is
    /// nothing or where `wanted` has none; it says whether a sample lies inside. `divisions` says how often each is split in four, with a fit in each part.
    pub(super) fn cells(
        &self,
        wi: Vector,
        mesh: TriangleMesh,
        divisions: u32,
        channels: &Channels,
        wanted: &(impl Fn(usize) -> Option<bool> + Sync),
        out: &mut [f32],
    ) -> Vec<Draft> {
        let width = channels.to();
        let vertices = mesh.all_vertices();
        let drafts: Vec<Vec<Draft>> = out
            .par_chunks_mut(BLOCK * width)
            .zip(vertices.par_chunks(BLOCK))
            .enumerate()
            .map_init(Scratch::default, |scratch, (block, (out, vertices))| {
                let wanted = |i: usize| wanted(block * BLOCK + i);
                if (0..vertices.len()).all(|i| wanted(i).is_none()) {
                    out.fill(f32::NAN);
                    return vec![Draft::NOTHING; vertices.len()];
                }
                self.gather(wi, vertices, scratch);
                let cells = out.chunks_mut(width).zip(vertices).enumerate();
                cells
                    .map(|(i, (out, &vertices))| {
                        let Some(has_sample) = wanted(i) else {
                            out.fill(f32::NAN);
                            return Draft::NOTHING;
                        };
                        let draft = Draft { has_sample, valid: false, surrounded: true, emptiness: 0.0 };
                        self.cell((wi, vertices, divisions), channels, draft, out, scratch)
                    })
                    .collect()
            })
            .collect();
        drafts.into_iter().flatten().collect()
    }

    /// The samples within the reach of any place in `vertices`.
    fn gather(&self, wi: Vector, vertices: &[Vertices], scratch: &mut Scratch) {
        let keys: Vec<[f64; 6]> = vertices.iter().flatten().map(|&corner| self.cloud.key(wi, corner)).collect();
        let centre: [f64; 6] = std::array::from_fn(|k| keys.iter().map(|key| key[k]).sum::<f64>() / keys.len() as f64);
        let apart = |key: &[f64; 6]| key.iter().zip(&centre).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
        let size = keys.iter().map(apart).fold(0.0, f64::max).sqrt();
        self.cloud.tree.nearest(&centre, self.neighbours, self.wanted(vertices[0][0]), &mut scratch.found);
        scratch.reach = scratch.found.last().map_or(0.0, |found| found.0);
        // Whatever lies within the reach of a place of the block.
        let reach = scratch.reach.sqrt() + size + 1e-9;
        self.cloud.tree.within(&centre, reach * reach, &mut scratch.candidates);
        if self.sides_apart {
            let wanted = self.wanted(vertices[0][0]);
            scratch.candidates.retain(|found| wanted(found.1));
        }
    }

    /// Whether a point may be counted on the side of the horizon where `wo` is.
    fn wanted(&self, wo: Vector) -> impl Fn(u32) -> bool {
        let side = if self.sides_apart { wo[2].signum() } else { 0.0 };
        move |point| self.cloud.points[point as usize].wo[2] * side >= 0.0
    }

    fn cell(
        &self,
        (wi, vertices, divisions): (Vector, Vertices, u32),
        channels: &Channels,
        mut draft: Draft,
        out: &mut [f32],
        scratch: &mut Scratch,
    ) -> Draft {
        let width = self.rows.width;
        scratch.row.resize(width, 0.0);
        scratch.sums.clear();
        scratch.sums.resize(width, 0.0);
        scratch.areas.clear();
        scratch.areas.resize(width, 0.0);
        self.part(wi, vertices, divisions, scratch, &mut draft);
        let Scratch { sums, areas, .. } = scratch;
        // Without any area 0 / 0: masked.
        sums.iter_mut().zip(&*areas).for_each(|(sum, area)| *sum /= area);
        channels.write(sums, out);
        draft
    }

    fn part(&self, wi: Vector, vertices: Vertices, divisions: u32, scratch: &mut Scratch, draft: &mut Draft) {
        if divisions > 0 {
            for c in 0..4 {
                self.part(wi, child(vertices, c), divisions - 1, scratch, draft);
            }
            return;
        }
        let wo = centroid(vertices).vector();
        let children: [Vertices; PARTS] = std::array::from_fn(|c| child(vertices, c));
        let place = Place { wi, wo, parts: children.map(|vertices| centroid(vertices).vector()) };
        self.select(&self.cloud.key(wi, wo), wo, scratch);
        let shares = children.map(|vertices| solid_angle(vertices) as f32);
        let Some(support) = self.value(&place, shares, scratch) else { return };
        let emptiness = emptiness(&support);
        draft.emptiness = draft.emptiness.max(emptiness);
        draft.surrounded &= support.surrounded;
        if !draft.has_sample && !self.is_near(&support, scratch) {
            return;
        }
        draft.valid = true;
        let area = solid_angle(vertices);
        for ((sum, total), &value) in scratch.sums.iter_mut().zip(&mut scratch.areas).zip(&scratch.row) {
            if !value.is_nan() {
                *sum += area * f64::from(value);
                *total += area;
            }
        }
    }

    /// The samples around a place: those within the reach of the block, if these are about as many as wanted, else the
    /// nearest.
    fn select(&self, key: &[f64; 6], wo: Vector, scratch: &mut Scratch) {
        let Scratch { found, candidates, reach, .. } = scratch;
        let square = |a: f64, b: f64| (a - b) * (a - b);
        let distance = |item: u32| {
            let other = &self.cloud.keys[item as usize];
            let near = square(key[0], other[0]) + square(key[1], other[1]) + square(key[2], other[2]);
            if self.cloud.slopes || self.cloud.stretch > 0.0 {
                return near + square(key[3], other[3]) + square(key[4], other[4]) + square(key[5], other[5]);
            }
            near
        };
        found.clear();
        for &(_, item) in &*candidates {
            let distance = distance(item);
            if distance <= *reach {
                found.push((distance, item));
            }
        }
        if 4 * found.len() < 3 * self.neighbours {
            self.cloud.tree.nearest(key, self.neighbours, self.wanted(wo), found);
        } else if 4 * found.len() > 5 * self.neighbours {
            found.select_nth_unstable_by(self.neighbours, super::tree::by_distance);
            found.truncate(self.neighbours);
        }
    }

    /// The value at `place` from the samples `scratch.found`, in `scratch.row`.
    pub(super) fn value(&self, place: &Place, shares: [f32; PARTS], scratch: &mut Scratch) -> Option<Support> {
        let Scratch { fitter, found, missing, row, .. } = scratch;
        let support = fitter.fit(self.cloud, self.rows, place, found, self.noise)?;
        let partial = fitter.gathered.iter().any(|&row| self.rows.kinds[row as usize] == Kind::Partial);
        if !partial {
            self.rows.combine(&fitter.rows, &fitter.weights, shares, row);
            return Some(support);
        }
        missing.clear();
        let mut any = false;
        for (band, value) in row.iter_mut().enumerate() {
            let is_missing = |&row: &u32| self.rows.row(row)[band].is_nan();
            if missing.is_empty() || !fitter.gathered.iter().map(is_missing).eq(missing.iter().copied()) {
                missing.clear();
                missing.extend(fitter.gathered.iter().map(is_missing));
                any = fitter.without(missing);
            }
            *value = if any { self.rows.combine_band(band, &fitter.rows, &fitter.weights, shares) } else { f32::NAN };
        }
        Some(support)
    }

    /// Whether the samples say anything of a place so far from them.
    fn is_near(&self, support: &Support, scratch: &mut Scratch) -> bool {
        if support.nearest_incoming > self.incoming_reach || support.variance.is_nan() {
            return false;
        }
        if support.surrounded {
            return support.nearest <= DEEPEST * support.reach;
        }
        let key = &self.cloud.keys[support.nearest_point as usize];
        self.cloud.tree.nearest(key, NEIGHBOURS, |_| true, &mut scratch.found);
        let spacing = scratch.found.last().map_or(0.0, |found| found.0.sqrt());
        support.nearest <= BEYOND * spacing
    }
}

/// How many samples would lie within the distance to the nearest one, as densely as the others lie.
fn emptiness(support: &Support) -> f32 {
    let (empty, full) = (support.nearest * support.nearest, support.reach * support.reach);
    if full > empty { (support.count as f64 * empty / (full - empty)) as f32 } else { f32::MAX }
}

/// What each cell stands on.
pub(super) fn standings(drafts: &[Draft]) -> Vec<Standing> {
    let mut between: Vec<f32> = drafts.iter().filter(|d| d.valid && d.surrounded).map(|d| d.emptiness).collect();
    let middle = between.len() / 2;
    let usual = if between.is_empty() { 0.0 } else { *between.select_nth_unstable_by(middle, f32::total_cmp).1 };
    let hole = HOLE.max(EMPTIER * usual);
    let standing = |draft: &Draft| match draft {
        Draft { valid: false, .. } => Standing::Empty,
        Draft { has_sample: true, .. } => Standing::Measured,
        Draft { surrounded: true, emptiness, .. } if *emptiness <= hole => Standing::Interpolated,
        _ => Standing::Filled,
    };
    drafts.iter().map(standing).collect()
}
