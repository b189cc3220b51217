//! Quantities as users and files state them: those of a measurement, plus reflectance factors, which are read as a
//! BRDF.

use crate::domain::{Quantity, named};
use std::f64::consts::PI;

/// Quantity of a measurement as the user names it in the option `quantity`. The command line, the service and the
/// manifests share this list.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum StatedQuantity {
    /// Spectrum of a lamp or of emitted light: see [`Quantity::Spectrum`].
    Spectrum,
    /// Reflectance or transmittance, without or with an incoming direction: see [`Quantity::Reflectance`].
    Reflectance,
    /// Emission distribution of a luminaire: see [`Quantity::Edf`].
    Edf,
    /// Bidirectional reflectance distribution function: see [`Quantity::Brdf`].
    Brdf,
    /// Bidirectional transmittance distribution function: see [`Quantity::Btdf`].
    Btdf,
    /// Reflection and transmission in one function: see [`Quantity::Bsdf`].
    Bsdf,
    /// Phase function of volume scattering: see [`Quantity::Phase`].
    Phase,
    /// Reflectance factor: reflected radiance relative to that of an ideal diffuser in equal geometry (BRF, HCRF); π
    /// times the BRDF.
    ReflectanceFactor,
}
named!(StatedQuantity, "quantity", {
    Spectrum = "spectrum",
    Reflectance = "reflectance",
    Edf = "edf",
    Brdf = "brdf",
    Btdf = "btdf",
    Bsdf = "bsdf",
    Phase = "phase",
    ReflectanceFactor = "reflectance-factor",
});

impl StatedQuantity {
    /// Returns the quantity of the measurement after reading; reflectance factors become a BRDF.
    pub fn quantity(self) -> Quantity {
        match self {
            Self::Spectrum => Quantity::Spectrum,
            Self::Reflectance => Quantity::Reflectance,
            Self::Edf => Quantity::Edf,
            Self::Brdf | Self::ReflectanceFactor => Quantity::Brdf,
            Self::Btdf => Quantity::Btdf,
            Self::Bsdf => Quantity::Bsdf,
            Self::Phase => Quantity::Phase,
        }
    }

    /// Returns true for reflectance factors, which are divided by π on reading.
    pub fn is_factor(self) -> bool {
        self == Self::ReflectanceFactor
    }

    /// Returns the quantity that a word in a file names: a name of the option `quantity`, `emission`, `transmittance`,
    /// or a name or acronym of reflectance factors.
    pub(super) fn in_file(name: &str) -> Option<Self> {
        match name.to_lowercase().replace('_', "-").as_str() {
            "emission" => Some(Self::Edf),
            "transmittance" => Some(Self::Reflectance),
            "reflectance factor" => Some(Self::ReflectanceFactor),
            _ if names_factor(name) => Some(Self::ReflectanceFactor),
            other => other.parse().ok(),
        }
    }

    /// Returns the names that the option `quantity` accepts, for messages.
    pub(super) fn names() -> String {
        Self::ALL.iter().map(|stated| stated.name()).collect::<Vec<_>>().join(", ")
    }
}

impl From<Quantity> for StatedQuantity {
    fn from(quantity: Quantity) -> Self {
        match quantity {
            Quantity::Spectrum => Self::Spectrum,
            Quantity::Reflectance => Self::Reflectance,
            Quantity::Edf => Self::Edf,
            Quantity::Brdf => Self::Brdf,
            Quantity::Btdf => Self::Btdf,
            Quantity::Bsdf => Self::Bsdf,
            Quantity::Phase => Self::Phase,
        }
    }
}

/// Acronyms of reflectance factors with one direction (or cone) of incidence and one of view.
const ACRONYMS: [&str; 5] = ["brf", "hcrf", "hdrf", "bcrf", "ccrf"];
/// Endings of the full names of reflectance factors: bidirectional, hemispherical-directional, biconical,
/// hemispherical-conical.
const NAMES: [&str; 2] = ["directional reflectance factor", "conical reflectance factor"];

/// Returns true if a text names a reflectance factor of one viewing direction, which is π times a BRDF.
pub(super) fn names_factor(text: &str) -> bool {
    let text = text.to_lowercase().replace(['_', '-'], " ");
    NAMES.iter().any(|name| text.contains(name))
        || text.split(|c: char| !c.is_alphanumeric()).any(|word| ACRONYMS.contains(&word))
}

/// Divides reflectance factors by π, which gives a BRDF in 1/sr; NaN stays NaN.
pub(super) fn divide_by_pi(values: &mut [f32]) {
    for value in values {
        *value = (f64::from(*value) / PI) as f32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_quantity_keeps_its_name() {
        for &quantity in Quantity::ALL {
            let stated = StatedQuantity::from(quantity);
            assert_eq!((stated.name(), stated.quantity()), (quantity.name(), quantity));
            assert_eq!(StatedQuantity::in_file(quantity.name()), Some(stated));
        }
        assert_eq!(StatedQuantity::ALL.len(), Quantity::ALL.len() + 1);
    }

    #[test]
    fn factors_have_many_names_and_reflectances_are_none() {
        for name in ["BRF", "hcrf", "reflectance-factor", "reflectance_factor", "Bidirectional Reflectance Factor"] {
            assert_eq!(StatedQuantity::in_file(name), Some(StatedQuantity::ReflectanceFactor), "{name}");
        }
        for text in ["HCRF (mean of 5)", "hemispherical-conical reflectance factor", "BRF_i10_e0", "550nm_BRF"] {
            assert!(names_factor(text), "{text}");
        }
        for text in ["reflectance", "bidirectional reflectance", "directional-hemispherical reflectance", "brfs", "R"] {
            assert!(!names_factor(text), "{text}");
        }
    }

    #[test]
    fn a_perfect_diffuser_is_one_over_pi() {
        let mut values = [1.0, 0.5, f32::NAN, -0.25];
        divide_by_pi(&mut values);
        assert_eq!((values[0], values[1], values[3]), (0.318_309_87, 0.159_154_94, -0.079_577_47));
        assert!(values[2].is_nan());
    }
}
