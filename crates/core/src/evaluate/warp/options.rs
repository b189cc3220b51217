//! Options of sampling: the measure of the tree, the density in the last triangle, the defensive part.

/// Measure of solid angle, projected or not, that weights values in a sampling tree. Where a tree stops following the
/// function, the triangles below share the probability in proportion to the measure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// Projected solid angle |cos θ| dω as weight of function values, used for a BRDF, BTDF or BSDF.
    Projected,
    /// Solid angle dω as weight of function values, used for emission and phase functions.
    SolidAngle,
}

/// Sampling density inside the triangle in which the descent of a sampling tree ends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Density {
    /// Sampling density that is constant on the planar triangle, as suits piecewise constant evaluation.
    Uniform,
    /// Density linear on the planar triangle, in proportion to function times cosine at the vertices. If the descent of
    /// the sampling tree ends above the finest level, the density follows the cosine alone. Constant if the vertex
    /// values are all 0.
    #[default]
    Linear,
}

/// Options of importance sampling. Drawing, density and inversion agree only with equal options.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleOptions {
    /// Level of the triangles at which a sampling tree stops choosing by the function's value; below it directions
    /// follow the (projected) solid angle. 0 is the coarsest triangles; `None`, or a number beyond the last level, the
    /// finest.
    pub level: Option<u8>,
    /// Sampling density, constant or linear, inside the triangle in which the descent of a sampling tree ends.
    pub density: Density,
    /// Fraction δ, 0 ≤ δ < 1, of directions drawn independently of the function: in proportion to the cosine for
    /// [`Measure::Projected`], uniformly for [`Measure::SolidAngle`].
    ///
    /// With δ > 0 the density is positive wherever the function is nonzero, even where the integrals over triangles
    /// that guide sampling are 0. Points of the unit square with a first coordinate below 1 − δ give directions in
    /// proportion to the function, others the independent ones.
    pub defensive: f64,
}

impl SampleOptions {
    /// Default fraction of directions drawn independently of the function (defensive sampling).
    pub const DEFENSIVE: f64 = 0.03;
}

impl Default for SampleOptions {
    fn default() -> Self {
        Self { level: None, density: Density::default(), defensive: Self::DEFENSIVE }
    }
}

impl From<Option<u8>> for SampleOptions {
    fn from(level: Option<u8>) -> Self {
        Self { level, ..Self::default() }
    }
}
