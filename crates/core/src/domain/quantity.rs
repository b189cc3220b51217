//! Radiometric quantity and unit of a tensor, and the meaning of one sample.

/// Error for a name that is not in the list of known names.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown {what} `{found}`, expected one of {expected}")]
pub struct UnknownName {
    /// Kind of object that the unknown name should denote, for example `unit`.
    pub what: &'static str,
    /// Name found in the input that is not in the list of known names, for example of known units.
    pub found: String,
    /// Names that would have been accepted in the place of the unknown one, separated by commas.
    pub expected: String,
}

/// Implements stable names for an enum without fields: `Display`, `FromStr`, serde as text, a numeric code for files,
/// and the list of all values. The declaration of the option whose values they are may follow, for the JSON schema.
#[doc(hidden)]
#[macro_export]
macro_rules! named {
    ($type:ident, $what:literal, { $($variant:ident = $name:literal),+ $(,)? } $(, $option:path)?) => {
        impl $type {
            /// All values of the enum, in the order of their codes in files.
            pub const ALL: &[Self] = &[$(Self::$variant),+];

            /// Returns the permanent name of this enum value, such as `brdf` for a quantity; files, command line and
            /// HTTP use it.
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $name),+ }
            }

            #[doc(hidden)]
            pub fn all_names() -> Vec<&'static str> {
                Self::ALL.iter().map(|known| known.name()).collect()
            }

            #[allow(dead_code, reason = "not every list is stored")]
            pub(crate) fn code(self) -> u8 {
                self as u8
            }

            #[allow(dead_code, reason = "not every list is stored")]
            pub(crate) fn from_code(code: u8) -> Option<Self> {
                Self::ALL.get(usize::from(code)).copied()
            }
        }

        impl std::fmt::Display for $type {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(self.name())
            }
        }

        impl std::str::FromStr for $type {
            type Err = $crate::domain::UnknownName;
            fn from_str(name: &str) -> Result<Self, $crate::domain::UnknownName> {
                Self::ALL.iter().copied().find(|known| known.name() == name).ok_or_else(|| $crate::domain::UnknownName {
                    what: $what,
                    found: name.to_owned(),
                    expected: Self::all_names().join(", "),
                })
            }
        }

        impl serde::Serialize for $type {
            fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                serializer.serialize_str(self.name())
            }
        }

        impl<'de> serde::Deserialize<'de> for $type {
            fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                let name = <std::borrow::Cow<'de, str>>::deserialize(deserializer)?;
                name.parse().map_err(serde::de::Error::custom)
            }
        }

        $crate::schema_of_names!($type, $what $(, $option)?);
    };
}
#[doc(hidden)]
pub use crate::named;

/// Radiometric quantity of a tensor: a function of zero, one or two directions and wavelength.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Quantity {
    /// Spectral power distribution, illuminant or any other function of wavelength.
    Spectrum,
    /// Reflectance or transmittance, 0..1: a function of wavelength, or of incoming direction and wavelength.
    Reflectance,
    /// Emission distribution of a light source: intensity by outgoing direction (and wavelength).
    Edf,
    /// Reflection distribution of a surface, `f(wi, wo, lambda)` in sr⁻¹, without the cosine.
    Brdf,
    /// Transmission distribution of a surface in sr⁻¹, without the cosine; `wo` is on the lower hemisphere.
    Btdf,
    /// Reflection and transmission distribution of a surface in sr⁻¹, without the cosine; `wo` is on the whole sphere.
    Bsdf,
    /// Phase function of a scattering medium, `p(wi, wo)`, which integrates to 1 over the sphere.
    Phase,
}
named!(Quantity, "quantity", {
    Spectrum = "spectrum",
    Reflectance = "reflectance",
    Edf = "edf",
    Brdf = "brdf",
    Btdf = "btdf",
    Bsdf = "bsdf",
    Phase = "phase",
});

impl Quantity {
    /// Returns true if the rendering equation multiplies the quantity by |cos θ| of the outgoing direction.
    pub fn has_cosine(self) -> bool {
        matches!(self, Self::Brdf | Self::Btdf | Self::Bsdf)
    }

    /// Returns the largest number of directions of which the quantity is a function.
    pub fn directions(self) -> usize {
        match self {
            Self::Spectrum => 0,
            Self::Reflectance | Self::Edf => 1,
            Self::Brdf | Self::Btdf | Self::Bsdf | Self::Phase => 2,
        }
    }

    /// Returns the unit assumed for the quantity if a file states none.
    pub fn default_unit(self) -> Unit {
        match self {
            Self::Reflectance => Unit::One,
            Self::Brdf | Self::Btdf | Self::Bsdf | Self::Phase => Unit::PerSteradian,
            Self::Spectrum | Self::Edf => Unit::Relative,
        }
    }
}

/// Physical unit of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Unit {
    /// Relative values, of which only ratios are meaningful.
    Relative,
    /// Unit 1 of dimensionless samples, such as reflectances.
    One,
    /// Per steradian, sr⁻¹.
    PerSteradian,
    /// Luminous intensity in cd.
    Candela,
    /// Luminous intensity in cd per 1000 lamp lumens, cd/klm.
    CandelaPerKilolumen,
    /// Radiant intensity in W·sr⁻¹.
    WattPerSteradian,
    /// Radiant intensity in mW·sr⁻¹.
    MilliwattPerSteradian,
    /// Radiant intensity in µW·sr⁻¹.
    MicrowattPerSteradian,
    /// Photon intensity in µmol·s⁻¹·sr⁻¹.
    MicromolePerSecondSteradian,
    /// Spectral radiant intensity in W·sr⁻¹·nm⁻¹.
    WattPerSteradianNanometre,
    /// Spectral radiant intensity in mW·sr⁻¹·nm⁻¹.
    MilliwattPerSteradianNanometre,
    /// Spectral radiant intensity in µW·sr⁻¹·nm⁻¹.
    MicrowattPerSteradianNanometre,
    /// Spectral photon intensity in µmol·s⁻¹·sr⁻¹·nm⁻¹.
    MicromolePerSecondSteradianNanometre,
    /// Relative spectral intensity, per nm.
    RelativePerNanometre,
}
named!(Unit, "unit", {
    Relative = "relative",
    One = "1",
    PerSteradian = "1/sr",
    Candela = "cd",
    CandelaPerKilolumen = "cd/klm",
    WattPerSteradian = "W/sr",
    MilliwattPerSteradian = "mW/sr",
    MicrowattPerSteradian = "uW/sr",
    MicromolePerSecondSteradian = "umol/s/sr",
    WattPerSteradianNanometre = "W/sr/nm",
    MilliwattPerSteradianNanometre = "mW/sr/nm",
    MicrowattPerSteradianNanometre = "uW/sr/nm",
    MicromolePerSecondSteradianNanometre = "umol/s/sr/nm",
    RelativePerNanometre = "relative/nm",
});

impl Unit {
    /// Returns the unit of the spectral density that belongs to an intensity in this unit, used once a spectrum is
    /// attached. `None` for photometric and dimensionless units.
    pub fn per_nanometre(self) -> Option<Self> {
        match self {
            Self::WattPerSteradian => Some(Self::WattPerSteradianNanometre),
            Self::MilliwattPerSteradian => Some(Self::MilliwattPerSteradianNanometre),
            Self::MicrowattPerSteradian => Some(Self::MicrowattPerSteradianNanometre),
            Self::MicromolePerSecondSteradian => Some(Self::MicromolePerSecondSteradianNanometre),
            Self::Relative => Some(Self::RelativePerNanometre),
            _ => None,
        }
    }

    /// Returns the factor from a unit of spectral intensity to W·sr⁻¹·nm⁻¹; `None` for other units. For units of
    /// photons it applies after the conversion of photons to energy.
    pub fn watts(self) -> Option<f64> {
        match self {
            Self::WattPerSteradianNanometre | Self::MicromolePerSecondSteradianNanometre => Some(1.0),
            Self::MilliwattPerSteradianNanometre => Some(1e-3),
            Self::MicrowattPerSteradianNanometre => Some(1e-6),
            _ => None,
        }
    }

    /// Returns true for units of light that count photons (µmol/s) instead of measuring their energy.
    pub fn counts_photons(self) -> bool {
        self == Self::MicromolePerSecondSteradianNanometre
    }

    /// Returns the unit of the integral over directions of samples in this unit, such as `mW` for intensities in
    /// mW·sr⁻¹ and `1` for a BSDF times a cosine.
    pub fn over_directions(self) -> &'static str {
        match self {
            Self::Relative => "relative·sr",
            Self::One => "sr",
            Self::PerSteradian => "1",
            Self::Candela => "lm",
            Self::CandelaPerKilolumen => "lm/klm",
            Self::WattPerSteradian => "W",
            Self::MilliwattPerSteradian => "mW",
            Self::MicrowattPerSteradian => "uW",
            Self::MicromolePerSecondSteradian => "umol/s",
            Self::WattPerSteradianNanometre => "W/nm",
            Self::MilliwattPerSteradianNanometre => "mW/nm",
            Self::MicrowattPerSteradianNanometre => "uW/nm",
            Self::MicromolePerSecondSteradianNanometre => "umol/s/nm",
            Self::RelativePerNanometre => "relative·sr/nm",
        }
    }
}

/// Meaning of one sample on an axis of triangles: an average or a value at a point.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Sampling {
    /// Each sample is the average over its triangle, as in all measurements that were resampled onto triangles.
    #[default]
    Average,
    /// Each sample is the value at the centroid of its triangle.
    Point,
}
named!(Sampling, "sampling", { Average = "average", Point = "point" });

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_codes_round_trip() {
        for &quantity in Quantity::ALL {
            assert_eq!(quantity.name().parse(), Ok(quantity));
            assert_eq!(Quantity::from_code(quantity.code()), Some(quantity));
        }
        for &unit in Unit::ALL {
            assert_eq!(unit.name().parse(), Ok(unit));
            assert_eq!(Unit::from_code(unit.code()), Some(unit));
        }
        assert_eq!(Unit::from_code(200), None);
        let error = "brd".parse::<Quantity>().unwrap_err();
        assert!(error.to_string().starts_with("unknown quantity `brd`, expected one of spectrum, "));
    }
}
