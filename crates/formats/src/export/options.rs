//! Options of an export, and the limit on the size of its file.

use super::error::ExportError;
use crate::domain::limits::MAX_SAMPLES;
use crate::domain::{Declared, Limits, Values};
use serde_json::{Map, Value};
use std::ops::Bound::Included;

/// Declares the options of an export: each once, with its name, help text, default and values. Fields in the block
/// `beside` are set by the calling program, not by its user.
macro_rules! options {
    ($(#[$meta:meta])* pub struct ExportOptions {
        $($(#[doc = $help:literal])+ pub $name:ident: $type:ty = $default:expr => $values:expr,)+
    } beside {
        $(#[doc = $most_help:literal])+ pub $most:ident: usize = $limit:expr,
    }) => {
        $(#[$meta])*
        pub struct ExportOptions {
            $($(#[doc = $help])+ pub $name: $type,)+
            $(#[doc = $most_help])+
            pub $most: usize,
        }

        impl ExportOptions {
            /// Options of an export, in the order of the help text. [`option_help`](super::option_help) adds to the
            /// help text of an option what it means in each format that takes it.
            pub const OPTIONS: &'static [Declared] = &[$(
                Declared {
                    name: stringify!($name),
                    help: concat!($($help),+),
                    values: $values,
                    default: || serde_json::json!(Self::default().$name),
                },
            )+];

            /// Reads the options of an export from their JSON values by name; those that are not stated have their
            /// defaults. The error names the option.
            pub fn read(mut stated: Map<String, Value>) -> Result<Self, String> {
                let mut options = Self::default();
                $(
                    if let Some(value) = stated.remove(stringify!($name)) {
                        let wrong = |error| format!("{}: {error}", stringify!($name));
                        options.$name = serde_json::from_value(value).map_err(wrong)?;
                    }
                )+
                Ok(options)
            }

            /// Returns the names of the export options that differ from their defaults.
            pub(super) fn stated(&self) -> impl Iterator<Item = &'static str> {
                let usual = Self::default();
                let options = [$((stringify!($name), self.$name != usual.$name)),+];
                options.into_iter().filter(|(_, is_stated)| *is_stated).map(|(name, _)| name)
            }
        }

        impl Default for ExportOptions {
            fn default() -> Self {
                Self { $($name: $default,)+ $most: $limit }
            }
        }
    };
}

/// Steps in degrees that an export can have between neighbouring angles.
pub(super) const STEPS: Limits = Limits { low: Included(0.1), high: Included(45.0), remark: " degrees" };

options! {
    /// Options of an export that replace its default resolution. An option that has no effect for the format is
    /// refused.
    #[derive(Clone, Debug, PartialEq)]
    pub struct ExportOptions {
        /// Entry to use on each leading index axis (columns of a table, scan positions), counted from 0. Without an
        /// index `csv` writes every entry; `npy` always writes every entry.
        pub index: Option<Vec<usize>> = None => Values::List { shown: "I,..." },
        /// Without this option the resolution of the exported file is that of the material's own axes or, for mbsdf,
        /// its angles are those of the file from which the material was made.
        pub side: Option<usize> = None => Values::Whole { shown: "N", least: 1, most: u32::MAX as u64 },
        /// Without this option the angles of the exported file follow from the material's own axes or, for luminaires,
        /// are those of the file from which the material was made.
        pub step: Option<f64> = None => Values::Number { shown: "DEGREES", limits: STEPS },
        /// Without this option the exported file has spectra.
        pub rgb: bool = false => Values::Switch,
        /// Without this option the exported phase function is the mean over wavelengths.
        pub wavelength: Option<f64> = None => Values::Number { shown: "NM", limits: Limits::positive(" nm") },
        /// Fails, instead of warning, if the file adds more error than the material promises.
        pub strict: bool = false => Values::Switch,
    } beside {
        /// Upper bound on the size of the exported file, in bytes.
        pub most_bytes: usize = 4 * MAX_SAMPLES,
    }
}

/// Refuses a file of `bytes` bytes before it is generated, if that is over the limit.
pub(super) fn check_size(
    bytes: Option<usize>,
    options: &ExportOptions,
    instead: &'static str,
) -> Result<(), ExportError> {
    match bytes {
        Some(bytes) if bytes <= options.most_bytes => Ok(()),
        found => Err(ExportError::OverLimit { found, most: options.most_bytes, instead }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn every_option_is_read_and_stated() {
        for declared in ExportOptions::OPTIONS {
            let value = match declared.values {
                Values::List { .. } => json!([1]),
                Values::Switch => json!(true),
                _ => json!(2),
            };
            assert_eq!(declared.check(&value), Ok(()), "{}", declared.name);
            let read = ExportOptions::read(Map::from_iter([(declared.name.to_owned(), value)])).unwrap();
            assert_eq!(read.stated().collect::<Vec<_>>(), [declared.name]);
        }
        assert_eq!(ExportOptions::read(Map::new()), Ok(ExportOptions::default()));
        let wrong = ExportOptions::read(Map::from_iter([("side".to_owned(), json!(0.5))])).unwrap_err();
        assert!(wrong.starts_with("side: "), "{wrong}");
    }
}
