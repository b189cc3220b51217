//! Sampling trees of a material: one for every incoming node, built when a first direction is drawn.
//!
//! The weight of a leaf is max(0, value) × the integral of |cos θ| over it (BRDF, BTDF, BSDF) or × its solid angle
//! (emission, phase functions). The value is the mean over wavelengths or that at one wavelength; means are linear,
//! never of logarithms. For an entry of the incoming axis the value is that of the cell. For a node between entries it
//! is the mean of the smooth function over the leaf, from its corners and its centroid.

use super::background::Background;
use super::carried::Carry;
use super::function::Function;
use super::lookup::MeshLookup;
use super::warp::{Density, Measure, SampleOptions, WarpMesh, Warps};
use crate::domain::vector::Vector;
use std::sync::Arc;

/// Importance sampling trees of a material, for all combinations of indices (positions on the axes before the
/// directions).
#[derive(Debug)]
pub(super) struct Trees {
    warps: Warps,
    /// Number of sampling trees for one combination of indices (positions on the axes before the directions): one for
    /// each sampled incoming direction, then one for each interpolation node between them.
    per_entry: usize,
    background: Arc<Background>,
    /// Spectral weight of each sample of a spectrum in the value by which directions are drawn.
    weights: Vec<f32>,
    carry: Option<Carry>,
    has_masked: bool,
}

impl Trees {
    /// Builds the trees from which outgoing directions are drawn in proportion to the function's mean over wavelengths.
    /// Directions drawn from them do not follow lobes that move with the incoming direction.
    pub(super) fn of_mean(function: &Function, lookup: &Arc<MeshLookup>) -> Self {
        let measure =
            if function.geometry().quantity().has_cosine() { Measure::Projected } else { Measure::SolidAngle };
        let mesh = Arc::new(WarpMesh::over(Arc::clone(lookup), measure));
        let weights = vec![1.0 / function.geometry().lambdas() as f32; function.geometry().lambdas()];
        let warps = Self::warps_by(&mesh, function, lookup, &weights);
        let background = Arc::new(Background::new(function, lookup));
        let has_masked = function.has_masked();
        let per_entry = function.trees_of_entry();
        Self { warps, per_entry, background, weights, carry: None, has_masked }
    }

    /// Sets the rule by which a drawn direction moves, with the lobe around it, to the queried incoming direction;
    /// `None` leaves drawn directions in place.
    pub(super) fn carried_by(self, carry: Option<Carry>) -> Self {
        Self { carry, ..self }
    }

    /// Builds sampling trees for the sum over wavelengths of `weights` times the material's function. Takes all else
    /// over from `self`, the trees for other weights.
    pub(super) fn by(&self, function: &Function, lookup: &MeshLookup, weights: &[f32]) -> Self {
        Self {
            warps: Self::warps_by(self.warps.mesh(), function, lookup, weights),
            background: Arc::clone(&self.background),
            weights: weights.to_vec(),
            ..*self
        }
    }

    fn warps_by(shared: &Arc<WarpMesh>, function: &Function, lookup: &MeshLookup, weights: &[f32]) -> Warps {
        let (leaves, has_cosine) = (lookup.mesh().len(), function.geometry().quantity().has_cosine());
        let own = function.geometry().shape()[0];
        let per_entry = function.trees_of_entry();
        let centroids: Vec<Vector> = (0..leaves).map(|leaf| lookup.mesh().centroid(leaf).xyz()).collect();
        Warps::new(Arc::clone(shared), function.geometry().entries() * per_entry, |tree, integrals, values| {
            let (entry, node) = (tree / per_entry, tree % per_entry);
            let mut at_corners = vec![0.0; values.len()];
            for ((vertex, value), point) in at_corners.iter_mut().enumerate().zip(shared.vertices()) {
                *value = if node < own {
                    function.vertex_value(entry * own + node, vertex as u32, point.xyz(), weights)
                } else {
                    function.node_value(entry, node, point.xyz(), weights)
                };
            }
            for (leaf, (integral, measure)) in integrals.iter_mut().zip(shared.measures()).enumerate() {
                let value = if node < own {
                    function.cell_value((entry * own + node) * leaves + leaf, weights)
                } else {
                    let corners = shared.corners()[leaf].map(|vertex| at_corners[vertex as usize]);
                    mean_over(corners, function.node_value(entry, node, centroids[leaf], weights))
                };
                *integral = f64::from(value.max(0.0)) * measure;
            }
            for ((to, value), point) in values.iter_mut().zip(at_corners).zip(shared.vertices()) {
                let value = f64::from(value.max(0.0));
                *to = if has_cosine { value * point.cos_theta().abs() } else { value };
            }
        })
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

    /// Rule by which drawn outgoing directions follow lobes that move with the incoming direction, with the domain of
    /// outgoing directions. `None` if drawn directions stay in place, as they do if `density` is uniform inside
    /// triangles.
    #[inline]
    pub(super) fn carry(&self, density: Density) -> Option<Carry> {
        self.carry.filter(|_| density == Density::Linear)
    }

    /// Returns the fraction of directions drawn defensively (independently of the function) under an incoming
    /// direction. It is that of the options if `has_light` says that some sampling tree has light, else 1. It is 0 if
    /// the options exclude defensive sampling, or if no direction has light.
    #[inline(always)]
    pub(super) fn defensive(&self, entry: usize, options: SampleOptions, has_light: bool) -> f64 {
        let is_defended = options.defensive > 0.0 && self.background.has_any(entry, options.density);
        match (is_defended, has_light) {
            (false, _) => 0.0,
            (true, true) => options.defensive,
            (true, false) => 1.0,
        }
    }

    /// Returns true if some samples are masked: a direction drawn where the function is masked is discarded.
    #[inline]
    pub(super) fn has_masked(&self) -> bool {
        self.has_masked
    }

    /// Number of the sampling tree of an incoming interpolation node, for one combination of indices (positions on the
    /// axes before the directions).
    #[inline]
    pub(super) fn tree(&self, entry: usize, node: usize) -> usize {
        entry * self.per_entry + node
    }

    /// Memory in bytes of built sampling trees. The estimate for unbuilt ones, [`Trees::expected_memory`], excludes a
    /// luminaire's table of lit triangles.
    pub(super) fn memory(&self) -> usize {
        self.warps.memory() + self.warps.mesh().memory() + self.background.memory() + size_of_val(&*self.weights)
    }

    pub(super) fn expected_memory(function: &Function, lookup: &MeshLookup) -> usize {
        let [shared, each] = WarpMesh::expected_memory(lookup);
        let trees = function.geometry().entries() * function.trees_of_entry();
        size_of::<Warps>() + shared + each * trees + function.geometry().lambdas() * size_of::<f32>()
    }
}

/// Mean over a triangle of a quadratic function, from its values at the corners and the centroid; NaN counts as 0.
fn mean_over(corners: [f32; 3], centroid: f32) -> f32 {
    let known = |value: f32| if value.is_nan() { 0.0 } else { value };
    let [a, b, c] = corners.map(known);
    (a + b + c) / 12.0 + 0.75 * known(centroid)
}
