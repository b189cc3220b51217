//! Policies: the ways to choose and code coefficients.

/// Policies: ways to choose coefficients and to code them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Policy {
    /// Rate–distortion: log domain, one uniform step.
    #[default]
    Rd,
    /// The paper's: one threshold on normalised coefficients, kept ones exact.
    Conventional,
    /// Every bit; the only policy of [`Target::Lossless`](super::Target::Lossless).
    Lossless,
    /// The paper's: one threshold a space, whole functions dropped.
    Generic,
    /// The paper's: the same with ε√d inside a function of range d.
    Adaptive,
}
crate::domain::named!(Policy, "policy", { Rd = "rd", Conventional = "conventional", Lossless = "lossless", Generic = "generic", Adaptive = "adaptive" });
