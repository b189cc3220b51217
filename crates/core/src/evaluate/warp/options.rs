//! How directions are drawn: what weighs values, the density in the last triangle, the defensive part.

/// What values are weighed with in the tree, and what shares a probability below the end level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// |cos θ| dω: BRDF, BTDF, BSDF.
    Projected,
    /// dω: emission and phase functions.
    SolidAngle,
}

/// The density inside the last triangle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Density {
    /// Constant on the planar triangle; goes with piecewise constant evaluation.
    Uniform,
    /// Linear on the planar triangle between the vertex values (f·cos; cos below a coarser end level); constant where the
    /// vertex values are all 0.
    #[default]
    Linear,
}

/// How directions are drawn. Sampling, density and inversion belong together only with the same options.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleOptions {
    /// Ends the choice by value at this level (0 = the base triangles, `None` or more than there are = the leaves) and
    /// goes on by the measure.
    pub level: Option<u8>,
    /// The density inside the last triangle.
    pub density: Density,
    /// The part δ in 0..1 of directions drawn without regard to the function: by the cosine for [`Measure::Projected`],
    /// uniformly for [`Measure::SolidAngle`]. Then no direction where the function is not 0 has density 0: a smooth function
    /// has light beside leaves without any, and between incoming directions where no tree expects it. The first coordinate
    /// is split: below 1 − δ the tree's, above it the defensive one's.
    pub defensive: f64,
}

impl SampleOptions {
    /// The defensive part where none is named.
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
