//! Compression requests.

use crate::compress::{ALBEDO_ERROR, AUTO_BASIS, FLOOR, Policy, Settings, Target, check_basis};
use crate::domain::limits::MAX_LEVEL;
use crate::domain::{Declared, Values, WavelengthError, WavelengthGrid, named};
use crate::projection::{AxesRequest, DirectionDomain};
use serde::{Deserialize, Serialize};

/// Interpolation method between the listed directions of a grid of angles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Curve {
    /// Cubic interpolation of logarithms. For luminaires and phase functions it is mixed with the least share of
    /// linear interpolation that keeps the flux within 0.3 % of the zonal flux of the samples.
    #[default]
    Cubic,
    /// Linear interpolation between the samples of a grid of angles.
    Linear,
}
impl Curve {
    /// Returns true for cubic interpolation, the default.
    pub fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

named!(Curve, "interpolation", { Cubic = "cubic", Linear = "linear" });

/// Declares the options of a compression request: each once, with its name, help text, JSON form, default and allowed
/// values.
macro_rules! options {
    ($(#[$meta:meta])* pub struct Request {
        $(#[doc = $target:literal])+
        pub target: Target,
        $(
            $(#[doc = $help:literal])+
            $(#[serde($($serde:tt)+)])?
            pub $name:ident: $type:ty = $default:expr => $values:expr,
        )+
    }) => {
        $(#[$meta])*
        pub struct Request {
            $(#[doc = $target])+
            #[serde(default)]
            pub target: Target,
            $(
                $(#[doc = $help])+
                $(#[serde($($serde)+)])?
                pub $name: $type,
            )+
        }

        impl Request {
            /// Options of a compression request besides the target, in the order of the help text.
            pub const OPTIONS: &'static [Declared] = &[$(
                Declared {
                    name: stringify!($name),
                    help: concat!($($help),+),
                    values: $values,
                    default: || serde_json::json!(Defaults::$name()),
                },
            )+];
            /// Help text of the compression target.
            pub const TARGET_HELP: &'static str = concat!($($target),+);

            /// Creates a compression request for `target` with defaults for all other options.
            pub fn to(target: Target) -> Self {
                Self { target, $($name: Defaults::$name(),)+ }
            }
        }

        /// Default values of the options of a compression, by the name of the option.
        struct Defaults;

        impl Defaults {
            $(fn $name() -> $type { $default })+
        }
    };
}

/// Allowed values of the options that take a subdivision level of the triangles of directions.
const LEVEL: Values = Values::Whole { shown: "N", least: 0, most: MAX_LEVEL as u64 };

options! {
    /// Options of a compression. Every field has a default.
    ///
    /// The help texts of the command line and the description of the HTTP interface are the documentation of these
    /// fields.
    ///
    /// ```
    /// use wavelume_formats::pipeline::Request;
    /// let request = Request { basis: "db4".to_owned(), ..Request::er_l2(0.01) };
    /// assert_eq!(serde_json::to_value(&request)?["target"]["er_l2"], 0.01);
    /// # Ok::<(), serde_json::Error>(())
    /// ```
    #[allow(clippy::struct_excessive_bools, reason = "each is an option of its own")]
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub struct Request {
        /// Promised error bound, size or ratio. For a measurement on a grid of angles, errors are those at the samples
        /// of the file, and of the mean of those stated for one direction. If samples were averaged over triangles
        /// first, the bound holds against these averages, and the report also gives the errors at the samples. Default:
        /// `{"er_l2": 0.01}`, a root mean square relative error of 1 %.
        pub target: Target,
        /// Directions at which values are stored. `grid` keeps the grid of angles of the file; it is the default if
        /// there is one and no subdivision level is given. `triangles` averages samples over triangles, as a
        /// subdivision level also does.
        #[serde(default = "Defaults::domain", skip_serializing_if = "Option::is_none")]
        pub domain: Option<DirectionDomain> = None =>
            Values::Name { shown: None, names: DirectionDomain::all_names },
        /// Makes a BRDF on its own grid of angles reciprocal: replaces each value by its mean with the value for
        /// exchanged incoming and outgoing directions. Errors are then measured against these means.
        #[serde(default = "Defaults::reciprocal", skip_serializing_if = "std::ops::Not::not")]
        pub reciprocal: bool = false => Values::Switch,
        /// Subdivision level of the triangles of incoming directions; each level halves the side of a triangle.
        #[serde(default = "Defaults::incoming_level", skip_serializing_if = "Option::is_none")]
        pub incoming_level: Option<u8> = None => LEVEL,
        /// Subdivision level of the triangles of outgoing directions; each level halves the side of a triangle.
        #[serde(default = "Defaults::outgoing_level", skip_serializing_if = "Option::is_none")]
        pub outgoing_level: Option<u8> = None => LEVEL,
        /// Wavelengths to resample to: `START:STOP:STEP` in nm, both ends included.
        #[serde(default = "Defaults::wavelengths", skip_serializing_if = "Option::is_none")]
        pub wavelengths: Option<String> = None =>
            Values::Text { shown: "START:STOP:STEP", check: wavelengths },
        /// Method that selects and codes the coefficients: rd (rate-distortion), lossless, or a method of Claustres et
        /// al. (2006). Those are conventional (one threshold), generic (one threshold for each axis of the samples) and
        /// adaptive (thresholds for each axis that grow with the range of the values).
        #[serde(default = "Defaults::policy")]
        pub policy: Policy = Policy::default() =>
            Values::Name { shown: None, names: Policy::all_names },
        /// Basis that transforms the wavelength axis: auto, klt (computed from the data), identity, or a name that
        /// `wavelume bases` lists.
        #[serde(default = "Defaults::basis")]
        pub basis: String = AUTO_BASIS.to_owned() => Values::Text { shown: "BASIS", check: basis },
        /// Floor of the relative errors, as a fraction of the largest sample: smaller samples do not count in the
        /// relative errors. With policy rd, the absolute error of samples of a smaller magnitude is at most the floor,
        /// that of other negative samples, if er(L2) is bounded, at most the largest magnitude of a negative sample.
        #[serde(default = "Defaults::floor", skip_serializing_if = "Option::is_none")]
        pub floor: Option<f64> = None => Values::Number { shown: "F", limits: FLOOR },
        /// Upper bound on the relative error of the directional albedo or flux of every incoming direction and
        /// wavelength; needs policy rd.
        #[serde(default = "Defaults::albedo_error", skip_serializing_if = "Option::is_none")]
        pub albedo_error: Option<f64> = None =>
            Values::Number { shown: "E", limits: ALBEDO_ERROR },
        /// Makes each incoming direction decodable without the other ones; needs policy rd. The material then has no
        /// coarser resolution levels.
        #[serde(default = "Defaults::random_access", skip_serializing_if = "std::ops::Not::not")]
        pub random_access: bool = false => Values::Switch,
        /// Method, stored in the file, for interpolating between the directions of a grid of angles. `cubic`
        /// interpolates logarithms of the values, blended with enough linear interpolation to keep the flux of
        /// luminaires and phase functions within 0.3 % of the zonal flux of the samples; `linear` interpolates
        /// linearly.
        #[serde(default = "Defaults::interpolation", skip_serializing_if = "Curve::is_default")]
        pub interpolation: Curve = Curve::default() =>
            Values::Name { shown: None, names: Curve::all_names },
        /// Fails, instead of warning, if the measurement contradicts physics: an albedo above 1 by more than its error,
        /// values far from reciprocal, or many negative ones. Also fails if the material adds more error to the noise
        /// of scattered samples than promised, or if its total light differs from that of the samples.
        #[serde(default = "Defaults::strict", skip_serializing_if = "std::ops::Not::not")]
        pub strict: bool = false => Values::Switch,
        /// Stores the provenance in the file: source, options and program.
        #[serde(default = "Defaults::metadata")]
        pub metadata: bool = true => Values::Switch,
    }
}

/// Refuses an unknown name of a spectral basis; the error lists the names.
fn basis(name: &str) -> Result<(), String> {
    check_basis(name).map_err(|error| error.to_string())
}

/// Refuses invalid wavelengths to resample to; the error says what was expected.
fn wavelengths(text: &str) -> Result<(), String> {
    WavelengthGrid::parse_range(text).map(|_| ()).map_err(|error| error.to_string())
}

/// Error for an option of a compression request that has a value out of its allowed values.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("option {option}: {reason}")]
pub struct OptionError {
    /// Name of the option that has the wrong value.
    pub option: &'static str,
    /// Found value and allowed values of the option, in words.
    pub reason: String,
}

impl Request {
    /// Creates a compression request for a root mean square relative error, er(L2), of at most `error`: 0.01 is 1 %.
    pub fn er_l2(error: f64) -> Self {
        Self::to(Target::ErL2(error))
    }

    /// Checks every option of a compression request against its declaration, before any measurement is read.
    pub fn check(&self) -> Result<(), OptionError> {
        self.target.check().map_err(|error| OptionError { option: "target", reason: error.to_string() })?;
        let unwritten = |error: serde_json::Error| OptionError { option: "request", reason: error.to_string() };
        let stated = serde_json::to_value(self).map_err(unwritten)?;
        for declared in Self::OPTIONS {
            let Some(found) = stated.get(declared.name).filter(|found| !found.is_null()) else { continue };
            declared.check(found).map_err(|expected| {
                let is_text = matches!(declared.values, Values::Text { .. });
                let reason = if is_text { expected } else { format!("found {found}, {expected}") };
                OptionError { option: declared.name, reason }
            })?;
        }
        Ok(())
    }

    /// Returns the settings of a compression that follow from the request alone. Metadata, interpolations and lobe,
    /// which follow from the measurement, are those of [`Settings::default`].
    pub fn settings(&self) -> Settings {
        Settings {
            target: self.target,
            policy: self.policy,
            basis: self.basis.clone(),
            floor: self.floor,
            albedo_error: self.albedo_error,
            random_access: self.random_access,
            ..Settings::default()
        }
    }

    /// Returns the axes of the request, onto which the measurement is projected before compression. The error tells why
    /// the requested wavelengths are invalid.
    pub(super) fn axes(&self) -> Result<AxesRequest, WavelengthError> {
        Ok(AxesRequest {
            domain: self.domain,
            incoming_level: self.incoming_level,
            outgoing_level: self.outgoing_level,
            wavelengths: self.wavelengths.as_deref().map(WavelengthGrid::parse_range).transpose()?,
            finer: 0,
            target: match self.target {
                Target::ErL1(error) | Target::ErL2(error) => Some(error),
                _ => None,
            },
        })
    }
}

#[cfg(feature = "schema")]
impl utoipa::PartialSchema for Request {
    fn schema() -> utoipa::openapi::RefOr<utoipa::openapi::schema::Schema> {
        use crate::domain::schema_of;
        use utoipa::openapi::Ref;
        use utoipa::openapi::schema::{AdditionalProperties, ObjectBuilder};
        let target = Ref::builder().ref_location_from_schema_name("Target").description(Some(Self::TARGET_HELP.trim()));
        let target = target.build();
        let request = ObjectBuilder::new().property("target", target);
        let options = Self::OPTIONS.iter();
        let request = options.fold(request, |request, option| request.property(option.name, schema_of(option)));
        let request = request.additional_properties(Some(AdditionalProperties::FreeForm(false)));
        request.description(Some("Options of a compression, in the names of the command line.")).into()
    }
}

#[cfg(feature = "schema")]
impl utoipa::ToSchema for Request {
    fn name() -> std::borrow::Cow<'static, str> {
        "Request".into()
    }

    fn schemas(schemas: &mut Vec<(String, utoipa::openapi::RefOr<utoipa::openapi::schema::Schema>)>) {
        schemas.push(("Target".to_owned(), <Target as utoipa::PartialSchema>::schema()));
        <Target as utoipa::ToSchema>::schemas(schemas);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_request_of_its_target_alone_has_the_declared_defaults() {
        let made = Request::to(Target::default());
        let read: Request = serde_json::from_value(json!({ "target": Target::default() })).unwrap();
        assert_eq!(read, made);
        assert_eq!(serde_json::from_value::<Request>(json!({})).unwrap(), made);
        let stated = serde_json::to_value(&made).unwrap();
        for declared in Request::OPTIONS {
            let default = (declared.default)();
            // Options at their default may be left out.
            let found = stated.get(declared.name).unwrap_or(&default);
            assert_eq!(found, &default, "{}", declared.name);
            assert!(default.is_null() || declared.check(&default).is_ok(), "{}", declared.name);
        }
        assert_eq!(made.settings(), Settings::default());
    }
}
