//! The formats that are written, with their names, extensions and media types.

use crate::domain::{UnknownName, named};

/// The formats that are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum ExportFormat {
    /// RGL tensor file: a BRDF, spectral or RGB, isotropic or not.
    Rgl,
    /// MERL table: an isotropic BRDF in RGB.
    Merl,
    /// MDL measured BSDF: isotropic, RGB or scalar.
    Mbsdf,
    /// IES LM-63-2002: a luminaire.
    Lm63,
    /// EULUMDAT: a luminaire in candela.
    Eulumdat,
    /// One spectrum in two columns.
    Spd,
    /// Spectra in columns.
    Csv,
    /// A phase function over the cosine.
    Tabphase,
    /// The samples as a `NumPy` array, beside a manifest of its axes.
    Npy,
}
named!(ExportFormat, "export format", {
    Rgl = "rgl",
    Merl = "merl",
    Mbsdf = "mbsdf",
    Lm63 = "lm63",
    Eulumdat = "eulumdat",
    Spd = "spd",
    Csv = "csv",
    Tabphase = "tabphase",
    Npy = "npy",
});

impl ExportFormat {
    /// Returns the format called `name`. Names of the table of formats and common luminaire extensions are accepted,
    /// too.
    pub fn of_name(name: &str) -> Result<Self, UnknownName> {
        match name {
            "lm-63" | "ies" => Ok(Self::Lm63),
            "ldt" => Ok(Self::Eulumdat),
            _ => name.parse(),
        }
    }

    /// The usual file extension.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Rgl => "bsdf",
            Self::Merl => "binary",
            Self::Mbsdf => "mbsdf",
            Self::Lm63 => "ies",
            Self::Eulumdat => "ldt",
            Self::Spd => "spd",
            Self::Csv => "csv",
            Self::Tabphase => "txt",
            Self::Npy => "npy",
        }
    }

    /// The media type of the bytes.
    pub fn media_type(self) -> &'static str {
        match self {
            Self::Rgl | Self::Merl | Self::Mbsdf | Self::Npy => "application/octet-stream",
            Self::Csv => "text/csv",
            Self::Lm63 | Self::Eulumdat | Self::Spd | Self::Tabphase => "text/plain",
        }
    }
}
