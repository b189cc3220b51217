//! Policies: ways to choose and code coefficients.

/// Way to choose coefficients and to code them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Policy {
    /// Rate–distortion: log domain, one uniform step.
    #[default]
    Rd,
    /// The paper's conventional policy: one threshold on normalised coefficients, kept coefficients exact.
    Conventional,
    /// Every bit is kept; the only policy of [`Target::Lossless`](super::Target::Lossless).
    Lossless,
    /// The paper's generic policy: one threshold for each space, whole functions dropped.
    Generic,
    /// The paper's adaptive policy: like `Generic`, with the threshold ε√d inside a function of range d.
    Adaptive,
}
crate::domain::named!(Policy, "policy", { Rd = "rd", Conventional = "conventional", Lossless = "lossless", Generic = "generic", Adaptive = "adaptive" });
