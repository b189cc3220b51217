//! The sampling trees of a material: one for every incoming node, built when a first direction is drawn.
//!
//! A leaf weighs max(0, value) × the integral of |cos θ| over it (BRDF, BTDF, BSDF) or × its solid angle (emission, phase
//! functions), the value being the mean over wavelengths or that at one wavelength: linear means, never those of logarithms.
//! Of an entry of the incoming axis the value is that of the cell; of a node between entries it is the mean of the smooth
//! function over the leaf, by its corners and its centroid.
//!
//! Whether directions are carried from a node to the incoming direction asked for, as the function is, or stay is decided by
//! the variance that either leaves, measured between the nodes: carrying serves lobes, and spoils what does not move.

use super::background::Background;
use super::carried::Carry;
use super::incoming::Alignment;
use super::lookup::MeshLookup;
use super::material::Form;
use super::mixture::Mixture;
use super::warp::{Density, Measure, SampleOptions, WarpMesh, Warps};
use super::{Interpolation, Material, Place};
use crate::domain::vector::Vector;
use crate::domain::{Direction, wide};
use std::f64::consts::PI;
use std::sync::Arc;

/// Incoming directions at which carrying is compared with staying, and points on a side of the square drawn at each by both.
const COMPARED: u32 = 8;
const POINTS: u32 = 12;
/// Beyond this elevation nothing is compared: the function is hardly light there.
const LOWEST_COSINE: f64 = 0.15;

/// The trees of all entries of the opaque axes.
#[derive(Debug)]
pub(super) struct Trees {
    warps: Warps,
    /// Trees of one entry of the opaque axes: of the entries of the incoming axis, then of the nodes between.
    per_entry: usize,
    background: Arc<Background>,
    /// What the value is made of: a weight for each sample of a spectrum.
    weights: Vec<f32>,
    carry: Option<Carry>,
    has_masked: bool,
}

impl Trees {
    /// By the mean over wavelengths.
    pub(super) fn of_mean(material: &Material, lookup: &Arc<MeshLookup>) -> Self {
        let measure = if material.quantity().has_cosine() { Measure::Projected } else { Measure::SolidAngle };
        let mesh = Arc::new(WarpMesh::over(Arc::clone(lookup), measure));
        let weights = vec![1.0 / material.lambdas() as f32; material.lambdas()];
        let warps = Self::warps_by(&mesh, material, lookup, &weights);
        let background = Arc::new(Background::new(material, lookup));
        let has_masked = material.has_masked();
        let per_entry = material.trees_of_entry();
        let mut trees = Self { warps, per_entry, background, weights, carry: None, has_masked };
        trees.carry = material.carry().filter(|carry| {
            let [carried, staying] = trees.second_moments(material, *carry);
            carried <= staying
        });
        trees
    }

    /// By the inner product of spectra with `weights`, otherwise as these.
    pub(super) fn by(&self, material: &Material, lookup: &MeshLookup, weights: &[f32]) -> Self {
        Self {
            warps: Self::warps_by(self.warps.mesh(), material, lookup, weights),
            background: Arc::clone(&self.background),
            weights: weights.to_vec(),
            ..*self
        }
    }

    fn warps_by(shared: &Arc<WarpMesh>, material: &Material, lookup: &MeshLookup, weights: &[f32]) -> Warps {
        let (leaves, has_cosine) = (lookup.mesh().len(), material.quantity().has_cosine());
        let own = material.shape[0];
        let per_entry = material.trees_of_entry();
        let centroids: Vec<Vector> = (0..leaves).map(|leaf| lookup.mesh().centroid(leaf).xyz()).collect();
        Warps::new(Arc::clone(shared), material.entries() * per_entry, |tree, integrals, values| {
            let (entry, node) = (tree / per_entry, tree % per_entry);
            let mut at_corners = vec![0.0; values.len()];
            for ((vertex, value), point) in at_corners.iter_mut().enumerate().zip(shared.vertices()) {
                *value = if node < own {
                    material.vertex_value(entry * own + node, vertex as u32, point.xyz(), weights)
                } else {
                    material.node_value(entry, node, point.xyz(), weights)
                };
            }
            for (leaf, (integral, measure)) in integrals.iter_mut().zip(shared.measures()).enumerate() {
                let value = if node < own {
                    material.cell_value((entry * own + node) * leaves + leaf, weights)
                } else {
                    let corners = shared.corners()[leaf].map(|vertex| at_corners[vertex as usize]);
                    mean_over(corners, material.node_value(entry, node, centroids[leaf], weights))
                };
                *integral = f64::from(value.max(0.0)) * measure;
            }
            for ((to, value), point) in values.iter_mut().zip(at_corners).zip(shared.vertices()) {
                let value = f64::from(value.max(0.0));
                *to = if has_cosine { value * point.cos_theta().abs() } else { value };
            }
        })
    }

    /// The second moments of the weights of a sample, with the trees' directions carried and staying: the mean over some
    /// incoming directions of that over the square of the first moment. Both are estimated from directions of both.
    fn second_moments(&self, material: &Material, carry: Carry) -> [f64; 2] {
        let mut sums = [0.0; 2];
        let options = SampleOptions::default();
        let ways = [Some(carry), None];
        for wi in compared(material) {
            let index = vec![0; material.layout().indices];
            let mixtures = ways.map(|carry| Mixture::new(material, self, &index, Some(wi), options, carry).ok());
            let [Some(carried), Some(staying)] = mixtures else { continue };
            let (mut first, mut second) = (0.0, [0.0; 2]);
            for k in 0..2 * POINTS * POINTS {
                let from = if k % 2 == 0 { &carried } else { &staying };
                let u = [k / 2 / POINTS, k / 2 % POINTS].map(|k| (f64::from(k) + 0.5) / f64::from(POINTS));
                let Some((wo, _)) = from.draw(u) else { continue };
                let turned = material.turned_with(Some(wi), wo);
                let place = Place { index: &index, wi: Some(wi), wo: Some(turned) };
                let Ok(value) = material.weighted_known(place, Interpolation::Smooth, &self.weights) else { continue };
                let cosine = if material.quantity().has_cosine() { wo.cos_theta().abs() } else { 1.0 };
                let value = f64::from(value.max(0.0)) * cosine;
                let densities = [&carried, &staying].map(|mixture| mixture.density(wo));
                let drawn = 0.5 * (densities[0] + densities[1]);
                if value > 0.0 && densities.iter().all(|density| *density > 0.0) {
                    first += value / drawn;
                    second.iter_mut().zip(densities).for_each(|(sum, pdf)| *sum += value * value / (pdf * drawn));
                }
            }
            if first > 0.0 {
                let count = f64::from(2 * POINTS * POINTS);
                sums.iter_mut().zip(second).for_each(|(sum, second)| *sum += second * count / (first * first));
            }
        }
        sums
    }

    #[inline]
    pub(super) fn warps(&self) -> &Warps {
        &self.warps
    }

    #[inline]
    pub(super) fn background(&self) -> &Background {
        &self.background
    }

    pub(super) fn weights(&self) -> &[f32] {
        &self.weights
    }

    /// The alignment and the outgoing domain, if the directions of a density are carried.
    #[inline]
    pub(super) fn carry(&self, density: Density) -> Option<Carry> {
        self.carry.filter(|_| density == Density::Linear)
    }

    /// The defensive part of an entry of the opaque axes under an incoming direction: what was asked for, but all where no
    /// tree has light, and nothing where no light is anywhere.
    #[inline(always)]
    pub(super) fn defensive(&self, entry: usize, options: SampleOptions, has_light: bool) -> f64 {
        let is_defended = options.defensive > 0.0 && self.background.has_any(entry, options.density);
        match (is_defended, has_light) {
            (false, _) => 0.0,
            (true, true) => options.defensive,
            (true, false) => 1.0,
        }
    }

    /// Whether some cells are masked: a direction that is drawn there is none.
    #[inline]
    pub(super) fn has_masked(&self) -> bool {
        self.has_masked
    }

    /// The tree of a node.
    #[inline]
    pub(super) fn tree(&self, entry: usize, node: usize) -> usize {
        entry * self.per_entry + node
    }

    /// Memory in bytes of trees that are built already; of those that will be, but for a luminaire's dark cells.
    pub(super) fn memory(&self) -> usize {
        self.warps.memory() + self.warps.mesh().memory() + self.background.memory() + size_of_val(&*self.weights)
    }

    pub(super) fn expected_memory(material: &Material, lookup: &MeshLookup) -> usize {
        let [shared, each] = WarpMesh::expected_memory(lookup);
        let trees = material.entries() * material.trees_of_entry();
        size_of::<Warps>() + shared + each * trees + material.lambdas() * size_of::<f32>()
    }
}

/// The mean over a triangle of a function that is quadratic, by its corners and its centroid.
fn mean_over(corners: [f32; 3], centroid: f32) -> f32 {
    let known = |value: f32| if value.is_nan() { 0.0 } else { value };
    let [a, b, c] = corners.map(known);
    (a + b + c) / 12.0 + 0.75 * known(centroid)
}

/// Incoming directions between nodes, spread over the domain of the incoming axis.
fn compared(material: &Material) -> Vec<Direction> {
    let golden = PI * (3.0 - 5.0_f64.sqrt());
    let directions = (0..COMPARED).map(|k| {
        let height = LOWEST_COSINE + (1.0 - LOWEST_COSINE) * (f64::from(k) + 0.5) / f64::from(COMPARED);
        let (sin, cos) = libm::sincos(0.4 + golden * f64::from(k));
        let radius = (1.0 - height * height).sqrt();
        [radius * cos, radius * sin, height]
    });
    let both = directions.flat_map(|[x, y, z]| [[x, y, z], [x, y, -z]]);
    both.filter_map(|[x, y, z]| Direction::new(x, y, z)).filter(|&wi| material.takes(wi)).collect()
}

impl Material {
    /// The alignment of the smooth function and its outgoing domain; `None` where it has no alignment.
    fn carry(&self) -> Option<Carry> {
        let Form::Planes { smooth, .. } = &self.form else { return None };
        let domain = self.outgoing.as_ref()?.mesh().domain();
        (smooth.alignment != Alignment::None && self.has_incoming()).then_some((smooth.alignment, domain))
    }

    /// Trees of one entry of the opaque axes: of the entries of the incoming axis, and of nodes between them.
    fn trees_of_entry(&self) -> usize {
        match &self.form {
            Form::Planes { smooth, .. } => self.shape[0].max(smooth.nodes.counts().0),
            Form::Samples { .. } => self.shape[0],
        }
    }

    /// The inner product with weights of the smooth function under a node.
    fn node_value(&self, entry: usize, node: usize, d: Vector, weights: &[f32]) -> f32 {
        let Form::Planes { planes, smooth } = &self.form else { return 0.0 };
        let mixed = smooth.under(entry, node, d);
        wide(
            #[inline(always)]
            || planes.weighted(&mixed.row, mixed.presence, weights),
        )
    }
}
