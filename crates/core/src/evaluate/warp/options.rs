//! Options of sampling: the measure of the tree, the density in the last triangle, the defensive part.

/// Measure by which the tree weights values, and by which a probability is divided below the end level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// Projected solid angle |cos θ| dω: BRDF, BTDF, BSDF.
    Projected,
    /// Solid angle dω: emission and phase functions.
    SolidAngle,
}

/// Density inside the last triangle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Density {
    /// Constant on the planar triangle; goes with piecewise constant evaluation.
    Uniform,
    /// Linear on the planar triangle between the vertex values (f·cos; cos below a coarser end level). Constant if the
    /// vertex values are all 0.
    #[default]
    Linear,
}

/// Options of sampling. Sampling, density and inversion match only with equal options.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleOptions {
    /// End level of the choice by value; below it directions follow the measure. 0 is the base triangles, `None` or a
    /// number beyond the last level the leaves.
    pub level: Option<u8>,
    /// Density inside the last triangle.
    pub density: Density,
    /// Fraction δ, 0 ≤ δ < 1, of directions drawn independently of the function: by the cosine for
    /// [`Measure::Projected`], uniformly for [`Measure::SolidAngle`]. With δ > 0 the density is positive wherever the
    /// function is nonzero. A smooth function has light beside dark leaves, and between incoming directions where no
    /// tree expects it. The first coordinate is split: below 1 − δ it is the tree's, above it the defensive part's.
    pub defensive: f64,
}

impl SampleOptions {
    /// Default defensive fraction.
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
