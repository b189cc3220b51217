//! The formats that are written, with their names, extensions and media types.

use crate::domain::{UnknownName, named};

/// Declares the formats that are written: each once, with its name, usual extension and media type.
macro_rules! exports {
    ($($(#[$doc:meta])+ $format:ident: $name:literal, $extension:literal, $media_type:literal;)+) => {
        /// The formats that are written.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u8)]
        pub enum ExportFormat {
            $($(#[$doc])+ $format,)+
        }
        named!(ExportFormat, "export format", { $($format = $name),+ });

        impl ExportFormat {
            /// The usual file extension.
            pub fn extension(self) -> &'static str {
                match self { $(Self::$format => $extension),+ }
            }

            /// The media type of the bytes.
            pub fn media_type(self) -> &'static str {
                match self { $(Self::$format => $media_type),+ }
            }
        }
    };
}

exports! {
    /// RGL tensor file: a BRDF, spectral or RGB, isotropic or not.
    Rgl: "rgl", "bsdf", "application/octet-stream";
    /// MERL table: an isotropic BRDF in RGB.
    Merl: "merl", "binary", "application/octet-stream";
    /// MDL measured BSDF: isotropic, RGB or scalar.
    Mbsdf: "mbsdf", "mbsdf", "application/octet-stream";
    /// IES LM-63-2002: a luminaire.
    Lm63: "lm63", "ies", "text/plain";
    /// EULUMDAT: a luminaire in candela.
    Eulumdat: "eulumdat", "ldt", "text/plain";
    /// One spectrum in two columns.
    Spd: "spd", "spd", "text/plain";
    /// Spectra in columns.
    Csv: "csv", "csv", "text/csv";
    /// A phase function over the cosine.
    Tabphase: "tabphase", "txt", "text/plain";
    /// The samples as a `NumPy` array, beside a manifest of its axes.
    Npy: "npy", "npy", "application/octet-stream";
}

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
}
