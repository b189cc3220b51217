//! File formats to which a material can be exported, declared from the table of their writers.

/// Declares the enum of export formats from a list of names and writers, with one variant for each format.
macro_rules! writers {
    ($($format:ident = $writer:path,)+) => {
        /// File formats to which a material can be exported.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum ExportFormat {
            $(#[doc = concat!("Format `", stringify!($format), "`; see [`ExportFormat::description`].")] $format,)+
        }

        impl ExportFormat {
            /// All export formats, in the order in which their writers are listed.
            pub const ALL: &'static [Self] = &[$(Self::$format),+];

            #[doc(hidden)]
            pub fn all_names() -> Vec<&'static str> {
                Self::ALL.iter().map(|known| known.name()).collect()
            }

            fn writer(self) -> &'static writer::Writer {
                match self { $(Self::$format => &$writer),+ }
            }

            /// Returns the stable name of the export format, as used on the command line and over HTTP.
            pub fn name(self) -> &'static str {
                self.writer().name
            }

            /// Returns a description of the export format in one line.
            pub fn description(self) -> &'static str {
                self.writer().description
            }

            /// Returns the usual extension of files in the export format, without a dot.
            pub fn extension(self) -> &'static str {
                self.writer().extension
            }

            /// Returns the media type of files in the export format.
            pub fn media_type(self) -> &'static str {
                self.writer().media_type
            }

            /// Returns true if the format takes decoded samples ([`samples`]) instead of a material ([`export()`]).
            pub fn takes_samples(self) -> bool {
                matches!(self.writer().write, writer::Write::Samples(_))
            }

            /// Returns the format called `name`. Names of the table of formats and common luminaire extensions are
            /// accepted, too.
            pub fn of_name(name: &str) -> Result<Self, crate::domain::UnknownName> {
                let other = Self::ALL.iter().find(|format| format.writer().other_names.contains(&name));
                other.map_or_else(|| name.parse(), |format| Ok(*format))
            }
        }

        impl std::fmt::Display for ExportFormat {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(self.name())
            }
        }

        impl std::str::FromStr for ExportFormat {
            type Err = crate::domain::UnknownName;

            fn from_str(name: &str) -> Result<Self, Self::Err> {
                Self::ALL.iter().copied().find(|known| known.name() == name).ok_or_else(|| {
                    crate::domain::UnknownName {
                        what: "export format",
                        found: name.to_owned(),
                        expected: Self::all_names().join(", "),
                    }
                })
            }
        }

        impl serde::Serialize for ExportFormat {
            fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                serializer.serialize_str(self.name())
            }
        }

        impl<'de> serde::Deserialize<'de> for ExportFormat {
            fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                let name = <std::borrow::Cow<'de, str>>::deserialize(deserializer)?;
                name.parse().map_err(serde::de::Error::custom)
            }
        }
    };
}
pub(super) use writers;
