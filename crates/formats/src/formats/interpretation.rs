//! Options of reading: information missing from a file's bytes, declared once with help text and values.

use super::in_plane::InPlaneSign;
use super::lit_side::LitSide;
use super::normalization::Normalization;
use super::overlap::Overlap;
use super::stated::StatedQuantity;
use crate::domain::{Declared, Quantity, Unit, Values, any_text};
use serde::{Deserialize, Serialize};
#[cfg(feature = "schema")]
use std::borrow::Cow;
use std::fmt::Display;
#[cfg(feature = "schema")]
use utoipa::openapi::{RefOr, schema::Schema};
#[cfg(feature = "schema")]
use utoipa::{PartialSchema, ToSchema};

/// Declares the options for reading a measured file, each once with its name, help text, type and values. Fields in the
/// block `beside` are stored with them, but belong to options that are declared elsewhere.
macro_rules! reading {
    ($(#[$meta:meta])* pub struct Interpretation {
        $($(#[doc = $help:literal])+ pub $name:ident: $type:ty => $values:expr,)+
    } beside {
        $($(#[doc = $beside_doc:literal])+ pub $beside:ident: $beside_type:ty,)+
    }) => {
        $(#[$meta])*
        pub struct Interpretation {
            $(
                $(#[doc = $help])+
                #[serde(skip_serializing_if = "Option::is_none")]
                pub $name: Option<$type>,
            )+
            $(
                $(#[doc = $beside_doc])+
                #[serde(skip_serializing_if = "Option::is_none")]
                pub $beside: Option<$beside_type>,
            )+
        }

        impl Interpretation {
            /// Options for reading a measured file, in the order of the help text: the option for a lamp's spectrum
            /// first, then one option for each declared field.
            pub const OPTIONS: &'static [Declared] = &[Self::SPECTRUM, $(
                Declared {
                    name: stringify!($name),
                    help: concat!($($help),+),
                    values: $values,
                    default: || serde_json::Value::Null,
                },
            )+];

            /// Returns the names of the options for reading a file that the user stated, each with its value as
            /// displayed.
            pub fn stated(&self) -> Vec<(&'static str, &dyn Display)> {
                let mut stated: Vec<(&'static str, &dyn Display)> = Vec::new();
                $(stated.extend(self.$name.as_ref().map(|value| (stringify!($name), value as &dyn Display)));)+
                $(stated.extend(self.$beside.as_ref().map(|value| (stringify!($beside), value as &dyn Display)));)+
                stated
            }

            /// Returns the options for reading a measured file, each as three parts: its name, the name of the schema
            /// of its values, and that schema.
            #[cfg(feature = "schema")]
            pub fn schemas() -> Vec<(&'static str, Cow<'static, str>, RefOr<Schema>)> {
                vec![$((stringify!($name), <$type as ToSchema>::name(), <$type as PartialSchema>::schema())),+]
            }
        }
    };
}

reading! {
    /// Options by which a user states what a measured file leaves open, such as its quantity or unit; every field is
    /// optional.
    ///
    /// The help texts of the command line and the description of the HTTP interface are the documentation of these
    /// fields.
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct Interpretation {
        /// Quantity, if the file does not state it or states it wrongly. A reflectance factor (BRF, HCRF) is divided by
        /// π to give a BRDF in 1/sr.
        pub quantity: StatedQuantity => Values::Name { shown: Some("QUANTITY"), names: StatedQuantity::all_names },
        /// Unit of the values.
        pub unit: Unit => Values::Name { shown: Some("UNIT"), names: Unit::all_names },
        /// Unit of the wavelengths in a spectral table: `nm`, `um`, `angstrom` or `1/cm`.
        pub wavelength_unit: String => Values::Text { shown: "UNIT", check: any_text },
        /// Column of values of a spectral table, emitter of a TM-33 luminaire, or channel of a Zemax BSDF, by name or
        /// by number from 1 (wavelengths are not counted).
        pub column: String => Values::Text { shown: "COLUMN", check: any_text },
        /// Column of wavelengths of a spectral table, by name or by number from 1, if its header does not say it.
        pub wavelength_column: String => Values::Text { shown: "COLUMN", check: any_text },
        /// Rule for wavelengths that two detectors of an instrument measured: the values of the detector for shorter
        /// wavelengths (the default), of the one for longer wavelengths, or their mean.
        pub overlap: Overlap => Values::Name { shown: None, names: Overlap::all_names },
        /// Side of the plane of incidence on which positive `theta_o` at azimuth 0 lies: that of the `mirror` (the
        /// default for angles with a sign and without azimuths), or that of the `source` (the default for azimuths).
        pub in_plane_sign: InPlaneSign => Values::Name { shown: None, names: InPlaneSign::all_names },
        /// Integral of the values of a phase table over the sphere; `vsf` is that of a volume scattering function,
        /// `relative` an arbitrary one.
        pub normalization: Normalization => Values::Name { shown: None, names: Normalization::all_names },
        /// File of a zip archive, by name; `inspect` lists them.
        pub member: String => Values::Text { shown: "NAME", check: any_text },
        /// Side of the light in a BSDF of WINDOW, by its names: `front` is outdoors, `back` indoors.
        pub side: LitSide => Values::Name { shown: None, names: LitSide::all_names },
        /// Band of a BSDF of WINDOW, by the name in the file, such as Visible or Solar.
        pub band: String => Values::Text { shown: "BAND", check: any_text },
        /// Manifest of an array's axes; by default NAME.axes.json beside NAME.npy, in a directory or in an archive.
        pub axes: serde_json::Value => Values::Document { shown: "MANIFEST" },
    } beside {
        /// Wavelengths of an array whose manifest states only `"lambda"`: `START:STOP:STEP` in nm.
        pub wavelengths: String,
    }
}

impl Interpretation {
    /// Option that names a further file with the spectrum of a lamp, by which the intensities of a luminaire are
    /// multiplied.
    pub const SPECTRUM: Declared = Declared {
        name: "spectrum",
        help: "Spectrum to join with a luminaire: its file, or over HTTP the id of the uploaded measurement.",
        values: Values::File { shown: "SPD" },
        default: || serde_json::Value::Null,
    };

    /// Returns the radiometric quantity, such as BRDF, that the user states for the values in a file; `None` if the
    /// user states none.
    pub(super) fn quantity(&self) -> Option<Quantity> {
        self.quantity.map(StatedQuantity::quantity)
    }

    /// Returns true if the user says that the values are reflectance factors (π times a BRDF).
    pub(super) fn is_factor(&self) -> bool {
        self.quantity.is_some_and(StatedQuantity::is_factor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn every_option_is_a_field_and_accepts_a_value() {
        for declared in Interpretation::OPTIONS.iter().filter(|declared| declared.name != "spectrum") {
            let value = match declared.values {
                Values::Name { names, .. } => json!(names()[0]),
                Values::Document { .. } => json!([]),
                _ => json!("1"),
            };
            assert_eq!(declared.check(&value), Ok(()), "{}", declared.name);
            let read: Interpretation = serde_json::from_value(json!({ declared.name: value })).unwrap();
            let text = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
            let stated: Vec<_> = read.stated().iter().map(|(name, value)| (*name, value.to_string())).collect();
            assert_eq!(stated, [(declared.name, text)]);
        }
    }
}
