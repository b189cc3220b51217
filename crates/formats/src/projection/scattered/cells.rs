//! Averages of local fits over triangles, and the origin of the value of every cell.

use super::cloud::Cloud;
use super::fit::{Fitter, Place, Support};
use super::nearby::Nearby;
use super::rows::{Kind, PARTS, Rows};
use super::tree::{Found, distance, nearness};
use crate::domain::vector::Vector;
use crate::domain::{TriangleMesh, Vertices, centroid, child, solid_angle};
use crate::projection::resampling::Channels;
use rayon::prelude::*;

/// Number of triangles that one task computes together, with one common search for samples.
const BLOCK: usize = 16;
/// Largest distance from a hole between samples to the nearest sample at which the hole is filled. It is a fraction of
/// the distance to the farthest sample of the fit. Raising the limit fills larger holes.
const DEEPEST: f64 = 0.75;
/// Largest distance beyond the outermost samples to which values are extrapolated, in units of the distance from such a
/// sample to its fourth neighbour. Raising it extrapolates farther.
const BEYOND: f64 = 2.0;
const NEIGHBOURS: usize = 5;
/// Lower bound on the emptiness from which a place counts as a hole. Emptiness is the number of samples expected, at
/// the local density, within the distance to the nearest one. Raising the bound marks fewer triangles as filled.
const HOLE: f32 = 5.0;
/// Ratio of emptiness to its median over all places between samples from which a place counts as a hole. Emptiness is
/// the number of samples expected within the distance to the nearest one. Raising the ratio marks fewer triangles as
/// filled.
const EMPTIER: f32 = 6.0;

/// Origin of the value of a triangle of outgoing directions: measured, interpolated, extrapolated or none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Standing {
    /// The triangle of directions contains a measured sample.
    Measured,
    /// The triangle of directions contains no measured sample, but lies between samples.
    Interpolated,
    /// The triangle lies in a hole or beyond the outermost samples; its value is extrapolated from the samples around.
    Filled,
    /// The triangle of directions is too far from any sample to have a value.
    Empty,
}

/// Facts about the samples in and around a triangle. The origin of its value (measured, interpolated, extrapolated or
/// none) follows from them once the usual sample density is known.
#[derive(Clone, Copy, Debug)]
pub(super) struct Draft {
    has_sample: bool,
    valid: bool,
    surrounded: bool,
    /// Largest emptiness among the parts of the triangle. The emptiness of a part is the number of samples expected
    /// within the distance from its middle to the nearest sample, at the density of the samples farther out.
    emptiness: f32,
}

impl Draft {
    const NOTHING: Self = Self { has_sample: false, valid: false, surrounded: false, emptiness: 0.0 };
}

/// Samples and settings for local fits whose averages over triangles are computed.
#[derive(Clone, Copy)]
pub(super) struct Fitted<'a> {
    pub(super) rows: &'a Rows<'a>,
    pub(super) cloud: &'a Cloud,
    pub(super) neighbours: usize,
    /// Variance of a sample's value in one band about the fit, relative to the variance of its mean over bands.
    pub(super) noise: f64,
    /// Largest chord to the nearest measured incoming direction; triangles under incoming directions farther away are
    /// empty.
    pub(super) incoming_reach: f64,
    /// True if samples above and below the horizon are fitted independently.
    pub(super) sides_apart: bool,
}

/// Way in which local fits to samples give the average over a triangle of directions: their number, and where they lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Parts {
    /// One local fit to samples in each of the 4ⁿ parts that result from splitting a triangle into four n times; the
    /// number is n.
    Divided(u32),
    /// One fit in the middle of four sibling triangles serves all four if it is accurate enough, otherwise one fit for
    /// each triangle.
    Shared,
}

/// Scratch space of one task that fits samples.
#[derive(Default)]
pub(super) struct Scratch {
    pub(super) fitter: Fitter,
    pub(super) found: Vec<Found>,
    around: Vec<Found>,
    nearby: Nearby,
    /// Facts about the local polynomial fit at the middle one of four sibling triangles: number of its samples, their
    /// distances from the triangle, and variance of its values. `None` if this fit must not serve the other siblings.
    middle: Option<Support>,
    /// Facts about the last local polynomial fit: number of its samples, their distances from the fitted triangle, and
    /// variance of its values. `None` if this fit must not serve other triangles.
    last: Option<Support>,
    missing: Vec<bool>,
    pub(super) row: Vec<f32>,
    sums: Vec<f64>,
    areas: Vec<f64>,
}

impl Fitted<'_> {
    /// Fits the samples locally under the incoming direction `wi`, and writes the average of the fits over each
    /// triangle of `mesh` into `out`, `[triangle, channel]`. Triangles without data become NaN. `wanted` returns `None`
    /// for triangles to skip, and otherwise true if a sample lies inside. `parts` says how many local fits a triangle
    /// takes, and where.
    pub(super) fn cells(
        &self,
        wi: Vector,
        mesh: TriangleMesh,
        parts: Parts,
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
                let wanted_side = self.wanted(vertices[0][0]);
                scratch.nearby.gather((self.cloud, self.neighbours), wi, vertices, wanted_side);
                let mut drafts = vec![Draft::NOTHING; vertices.len()];
                for (i, four) in vertices.chunks(4).enumerate() {
                    (scratch.middle, scratch.last) = (None, None);
                    // Starts with the middle one: the others may reuse its fit.
                    for i in [3, 0, 1, 2].into_iter().filter(|&c| c < four.len()).map(|c| 4 * i + c) {
                        let out = &mut out[i * width..][..width];
                        let Some(has_sample) = wanted(i) else {
                            out.fill(f32::NAN);
                            continue;
                        };
                        let draft = Draft { has_sample, valid: false, surrounded: true, emptiness: 0.0 };
                        drafts[i] = self.cell((wi, vertices[i], parts), channels, draft, out, scratch);
                        if i % 4 == 3 {
                            scratch.middle = scratch.last;
                        }
                    }
                }
                drafts
            })
            .collect();
        drafts.into_iter().flatten().collect()
    }

    /// Returns a predicate that accepts samples on the same side of the horizon as `wo`. It accepts all samples if both
    /// sides are fitted together.
    fn wanted(&self, wo: Vector) -> impl Fn(u32) -> bool {
        let side = if self.sides_apart { wo[2].signum() } else { 0.0 };
        move |point| side == 0.0 || self.cloud.wo[point as usize][2] * side >= 0.0
    }

    fn cell(
        &self,
        (wi, vertices, parts): (Vector, Vertices, Parts),
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
        match parts {
            Parts::Divided(times) => self.part(wi, vertices, times, scratch, &mut draft),
            Parts::Shared => self.shared(wi, vertices, scratch, &mut draft),
        }
        let Scratch { sums, areas, .. } = scratch;
        // 0 / 0 without any area: masked.
        sums.iter_mut().zip(&*areas).for_each(|(sum, area)| *sum /= area);
        channels.write(sums, out);
        draft
    }

    /// Computes the average value over one of four sibling triangles. Evaluates the polynomial that was fitted to the
    /// samples around the middle sibling, if it is accurate enough here; otherwise fits another.
    fn shared(&self, wi: Vector, vertices: Vertices, scratch: &mut Scratch, draft: &mut Draft) {
        let Some(mut support) = scratch.middle.take() else {
            return self.part(wi, vertices, 0, scratch, draft);
        };
        let children: [Vertices; PARTS] = std::array::from_fn(|c| child(vertices, c));
        let parts = children.map(|vertices| centroid(vertices).xyz());
        let Some(variance) = scratch.fitter.elsewhere(parts, support.degree) else {
            return self.part(wi, vertices, 0, scratch, draft);
        };
        scratch.middle = Some(support);
        support.variance = variance;
        if !draft.has_sample {
            let key = self.cloud.key(wi, centroid(vertices).xyz());
            let near = |found: &Found| (distance(&key, &self.cloud.place(found.1)), found.1);
            if let Some(nearest) = scratch.found.iter().map(near).min_by_key(nearness) {
                (support.nearest, support.nearest_point) = (nearest.0.sqrt(), nearest.1);
            }
        }
        let shares = children.map(|vertices| solid_angle(vertices) as f32);
        self.evaluate(shares, scratch);
        self.add(&support, vertices, scratch, draft);
    }

    fn part(&self, wi: Vector, vertices: Vertices, divisions: u32, scratch: &mut Scratch, draft: &mut Draft) {
        if divisions > 0 {
            for c in 0..4 {
                self.part(wi, child(vertices, c), divisions - 1, scratch, draft);
            }
            return;
        }
        let wo = centroid(vertices).xyz();
        let children: [Vertices; PARTS] = std::array::from_fn(|c| child(vertices, c));
        let place = Place { wi, wo, parts: children.map(|vertices| centroid(vertices).xyz()) };
        let key = self.cloud.key(wi, wo);
        scratch.nearby.select((self.cloud, self.neighbours), &key, self.wanted(wo), &mut scratch.found);
        let shares = children.map(|vertices| solid_angle(vertices) as f32);
        let Some(support) = self.value(&place, shares, scratch) else { return };
        let whole = support.surrounded && scratch.missing.is_empty();
        scratch.last = whole.then_some(support);
        self.add(&support, vertices, scratch, draft);
    }

    /// Adds the fitted value of a part of a triangle to the average over the triangle, unless the part lies too far
    /// from the samples.
    fn add(&self, support: &Support, vertices: Vertices, scratch: &mut Scratch, draft: &mut Draft) {
        let emptiness = emptiness(support);
        draft.emptiness = draft.emptiness.max(emptiness);
        draft.surrounded &= support.surrounded;
        if !draft.has_sample && !self.is_near(support, scratch) {
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

    /// Fits a polynomial to the samples `scratch.found` around `place`. Writes the average of the fit over the
    /// [`PARTS`] directions of `place`, with the weights `shares`, into `scratch.row`, one value for each band.
    pub(super) fn value(&self, place: &Place, shares: [f32; PARTS], scratch: &mut Scratch) -> Option<Support> {
        let Scratch { fitter, found, .. } = scratch;
        let support = fitter.fit(self.cloud, self.rows, place, found, self.noise)?;
        self.evaluate(shares, scratch);
        Some(support)
    }

    /// Averages the polynomial that was last fitted to the samples over the parts of a triangle, with the weights
    /// `shares`. Writes the average in each spectral band into `scratch.row`; NaN for a band that no sample has.
    fn evaluate(&self, shares: [f32; PARTS], scratch: &mut Scratch) {
        let Scratch { fitter, missing, row, .. } = scratch;
        missing.clear();
        if let ([value], true) = (&mut row[..], fitter.gathered.logarithms) {
            *value = self.rows.mean_of(fitter.gathered.rows[0], fitter.lights(), shares);
            return;
        }
        let is_partial = |&row: &u32| self.rows.kinds[row as usize] == Kind::Partial;
        if fitter.gathered.logarithms || !fitter.gathered.rows.iter().any(is_partial) {
            fitter.weigh();
            self.rows.combine(&fitter.rows, &fitter.weights, shares, row);
            return;
        }
        let mut any = false;
        for (band, value) in row.iter_mut().enumerate() {
            let is_missing = |&row: &u32| self.rows.row(row)[band].is_nan();
            if missing.is_empty() || !fitter.gathered.rows.iter().map(is_missing).eq(missing.iter().copied()) {
                missing.clear();
                missing.extend(fitter.gathered.rows.iter().map(is_missing));
                any = fitter.without(missing);
            }
            *value = if any { self.rows.combine_band(band, &fitter.rows, &fitter.weights, shares) } else { f32::NAN };
        }
    }

    /// Returns true if the samples of a local fit lie close enough to the place at which it is evaluated for its value
    /// to be used.
    fn is_near(&self, support: &Support, scratch: &mut Scratch) -> bool {
        if support.nearest_incoming > self.incoming_reach || support.variance.is_nan() {
            return false;
        }
        if support.surrounded {
            return support.nearest <= DEEPEST * support.reach;
        }
        let key = self.cloud.place(support.nearest_point);
        self.cloud.nearest(&key, NEIGHBOURS, |_| true, &mut scratch.around);
        let spacing = scratch.around.first().map_or(0.0, |farthest| farthest.0.sqrt());
        support.nearest <= BEYOND * spacing
    }
}

/// Returns the emptiness about the centre of a local fit: the number of samples expected within the distance to the
/// nearest sample, at the density of the samples between that distance and the distance to the farthest one.
fn emptiness(support: &Support) -> f32 {
    let (empty, full) = (support.nearest * support.nearest, support.reach * support.reach);
    if full > empty { (support.count as f64 * empty / (full - empty)) as f32 } else { f32::MAX }
}

/// Classifies triangles by the origin of their values: measured, interpolated, extrapolated (filled) or none (empty).
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
