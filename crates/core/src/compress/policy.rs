//! Policies: ways to choose and code coefficients.

/// Method of a compression: which coefficients it keeps, and how it codes them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Policy {
    /// Rate–distortion policy: codes the logarithms of the samples, with one uniform quantiser step for all normalised
    /// coefficients.
    #[default]
    Rd,
    /// Conventional policy of the paper \[CPB06\]: one threshold on normalised coefficients, kept coefficients exact.
    Conventional,
    /// Every bit is kept; the only policy of [`Target::Lossless`](super::Target::Lossless).
    Lossless,
    /// Generic policy of the paper \[CPB06\]: one threshold for each axis in turn. Coefficients below it, functions of
    /// the remaining axes, are dropped with all that derive from them.
    Generic,
    /// Adaptive policy of the paper \[CPB06\]: one threshold ε for each axis in turn, multiplied by √d for coefficients
    /// computed from values of range d = max − min. Coefficients below it are dropped with all that derive from them.
    Adaptive,
}
crate::domain::named!(Policy, "policy", { Rd = "rd", Conventional = "conventional", Lossless = "lossless", Generic = "generic", Adaptive = "adaptive" });
