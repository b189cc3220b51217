//! Normalisations of phase functions: integral of the values of a table over the sphere.

use super::text::snippet;
use serde::{Deserialize, Serialize};

/// Integral of the values of a phase table over the sphere.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Normalization {
    /// Integral 1.
    #[serde(rename = "1")]
    One,
    /// Integral 4π.
    #[serde(rename = "4pi")]
    FourPi,
    /// Integral equal to the scattering coefficient: a volume scattering function.
    #[serde(rename = "vsf")]
    Vsf,
    /// Arbitrary integral: only ratios of the values are meaningful.
    #[serde(rename = "relative")]
    Relative,
}

impl Normalization {
    const ALL: [(&'static str, Self); 4] =
        [("1", Self::One), ("4pi", Self::FourPi), ("vsf", Self::Vsf), ("relative", Self::Relative)];

    /// Returns the name: `1`, `4pi`, `vsf` or `relative`.
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(_, known)| *known == self).map_or("relative", |(name, _)| name)
    }
}

impl std::str::FromStr for Normalization {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Self::ALL.iter().find(|(name, _)| *name == text).map(|&(_, known)| known);
        found.ok_or_else(|| format!("found {}, expected 1, 4pi, vsf or relative", snippet(text)))
    }
}
