//! Promises that a compressed file can make, and the figure of an error report that each one bounds.

use super::setting_error::SettingError;
use crate::domain::colour::Illuminant;
use crate::domain::{DEFAULT_ERROR, Declared, ErrorReport, Limits, Values};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Deserialize, Deserializer, Error, IgnoredAny, IntoDeserializer, MapAccess, Visitor};
use serde::{Deserialize as DeriveDeserialize, Serialize, Serializer};
use serde_json::Value;
use std::ops::Bound::{Included, Unbounded};

/// Declares the targets of a compression: each once, with the help text, the name and the values of its option.
macro_rules! targets {
    ($(#[$meta:meta])* pub enum Target { $(
        $(#[doc = $help:literal])+
        $variant:ident $(($type:ty))? = $name:literal $(: $values:expr)?,
    )+ }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Serialize, DeriveDeserialize)]
        #[serde(rename_all = "snake_case", deny_unknown_fields, remote = "Self")]
        pub enum Target { $(
            $(#[doc = $help])+
            $variant $(($type))?,
        )+ }

        impl Target {
            /// All targets of a compression, in the order of the variants. In JSON a target with a value is the object
            /// `{NAME: value}`, one without is the text `NAME`.
            pub const DECLARED: &'static [Declared] = &[$(
                Declared {
                    name: $name,
                    help: concat!($($help),+),
                    values: targets!(@values $($values)?),
                    default: || Value::Null,
                },
            )+];

            /// Returns the name of the target in JSON, for example `er_l2`.
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant { .. } => $name,)+ }
            }
        }
    };
    (@values) => { Values::Switch };
    (@values $values:expr) => { $values };
}

/// Range of relative errors that can be requested; larger ones are meaningless.
const RELATIVE: Values = Values::Number { shown: "E", limits: Limits::up_to(10.0, " (0.01 is 1 %)") };
/// Smallest quantiser step that can be requested, in natural logarithms; float32 logarithms cannot resolve finer ones.
pub(crate) const LEAST_STEP: f64 = 1e-6;
/// Largest quantiser step that can be requested, in natural logarithms; it leaves about one coefficient.
const MOST_STEP: f64 = 64.0;

targets! {
    /// Promise that the compressed file keeps, for example an error or a size.
    pub enum Target {
        /// Upper bound on the mean relative error, er(L1), of the samples above 0: 0.01 is 1 %.
        ErL1(f64) = "er_l1": RELATIVE,
        /// Upper bound on the root mean square of the relative error, er(L2), of the samples above 0: 0.01 is 1 %.
        ErL2(f64) = "er_l2": RELATIVE,
        /// Upper bound on the relative error of every sample above 0.
        MaxRelativeError(f64) = "max_relative_error": RELATIVE,
        /// Upper bound on the absolute error of every sample, in the unit of the samples.
        MaxAbsoluteError(f64) = "max_absolute_error":
            Values::Number { shown: "E", limits: Limits::positive(", in the unit of the samples") },
        /// Upper bound on the relative root mean square error: the square root of the ratio of the sum of squared
        /// errors to the sum of squared samples.
        RelativeRmse(f64) = "relative_rmse": RELATIVE,
        /// Upper bound on the colour difference CIEDE2000 of every spectrum, under an illuminant;
        /// needs the rate–distortion policy, rd.
        DeltaE(DeltaE) = "delta_e":
            Values::Number { shown: "E", limits: Limits::up_to(100.0, "") },
        /// Lower bound on the compression ratio: number of samples divided by that of kept transform coefficients.
        Ratio(f64) = "ratio": Values::Number {
            shown: "R",
            limits: Limits { low: Included(1.0), high: Unbounded, remark: " sample per coefficient" },
        },
        /// Upper bound on the bytes of the file, metadata included.
        Bytes(u64) = "bytes": Values::Whole { shown: "N", least: 1, most: u64::MAX },
        /// No error bound: fixes the quantiser step, in natural logarithms of the samples, without a search. Errors are
        /// still measured and reported; er(L2) is about a tenth of the step, unless the spectral basis is the data's
        /// own (auto may choose it) and has too few vectors to follow the data. Only the rate–distortion policy, rd,
        /// has a quantiser.
        Step(f64) = "step": Values::Number {
            shown: "S",
            limits: Limits {
                low: Included(LEAST_STEP),
                high: Included(MOST_STEP),
                remark: ", in natural logarithms",
            },
        },
        /// Error er(L2) as small as the noise of the measurement justifies, as estimated from the samples or, if
        /// larger, as the file states its uncertainty; needs the rate–distortion policy, rd.
        Auto = "auto",
        /// Every bit of every sample is kept.
        Lossless = "lossless",
    }
}

/// Upper bound on the colour difference CIEDE2000 of every spectrum with enough measured wavelengths for a colour, and
/// the illuminant to which the colours refer.
///
/// In JSON a number (the illuminant is then the default one), or an object.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DeltaE {
    /// Largest CIEDE2000 colour difference allowed; about 1 is just noticeable.
    pub at_most: f64,
    /// Illuminant of reflection and transmission; for emission, the light whose chromaticity counts as white.
    pub illuminant: Illuminant,
}

impl From<f64> for DeltaE {
    /// Makes the upper bound `at_most` on colour differences under the default illuminant.
    fn from(at_most: f64) -> Self {
        Self { at_most, illuminant: Illuminant::default() }
    }
}

impl Default for Target {
    /// Returns the target of a compression if the user states none: a bound on the root mean square relative error.
    fn default() -> Self {
        Self::ErL2(DEFAULT_ERROR)
    }
}

/// Error of all samples in one number (for example er(L2)) that a target bounds, with its upper bound.
#[derive(Clone, Copy)]
pub(crate) struct Bound {
    /// Name of the bounded error figure in requests and reports.
    pub(crate) name: &'static str,
    pub(crate) at_most: f64,
    pub(crate) figure: fn(&ErrorReport) -> f64,
}

impl Bound {
    /// Returns true if the error that the compression target bounds, for example er(L2), is at most the bound in an
    /// error report.
    pub(crate) fn keeps(&self, errors: &ErrorReport) -> bool {
        (self.figure)(errors) <= self.at_most
    }
}

impl Target {
    /// Returns the error figure that this compression target bounds, for example er(L2), with its upper bound. `None`
    /// if the target bounds no error of the samples, for example if it is a file size.
    pub(crate) fn bound(self) -> Option<Bound> {
        let (at_most, figure): (_, fn(&ErrorReport) -> f64) = match self {
            Self::ErL1(most) => (most, |e| e.er_l1),
            Self::ErL2(most) => (most, |e| e.er_l2),
            Self::MaxRelativeError(most) => (most, |e| e.max_relative_error),
            Self::MaxAbsoluteError(most) => (most, |e| e.max_absolute_error),
            Self::RelativeRmse(most) => (most, |e| e.relative_rmse),
            Self::Lossless => (0.0, |e| e.max_absolute_error),
            Self::DeltaE(_) | Self::Ratio(_) | Self::Bytes(_) | Self::Step(_) | Self::Auto => return None,
        };
        let name = if self == Self::Lossless { "lossless: largest error" } else { self.name() };
        Some(Bound { name, at_most, figure })
    }

    /// Returns the declaration of this compression target, from which the command line and the service offer it as an
    /// option: name, help text and allowed values.
    pub fn declared(self) -> Option<&'static Declared> {
        Self::DECLARED.iter().find(|declared| declared.name == self.name())
    }

    fn number(self) -> Option<f64> {
        match self {
            Self::ErL1(number)
            | Self::ErL2(number)
            | Self::MaxRelativeError(number)
            | Self::MaxAbsoluteError(number)
            | Self::RelativeRmse(number)
            | Self::Ratio(number)
            | Self::Step(number) => Some(number),
            Self::DeltaE(DeltaE { at_most, .. }) => Some(at_most),
            Self::Bytes(_) | Self::Auto | Self::Lossless => None,
        }
    }

    /// Rejects a target whose value is outside its range.
    pub fn check(self) -> Result<(), SettingError> {
        match (self.declared(), self.number()) {
            (Some(&Declared { name, values: Values::Number { limits, .. }, .. }), Some(found))
                if !limits.allow(found) =>
            {
                Err(SettingError::Range { option: name, found, limits })
            }
            _ => Ok(()),
        }
    }
}

impl Serialize for Target {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        Self::serialize(self, serializer)
    }
}

impl<'de> Deserialize<'de> for Target {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct One;

        impl<'de> Visitor<'de> for One {
            type Value = Target;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("auto, lossless, or an object with one promise such as {\"er_l2\": 0.01}")
            }

            fn visit_str<E: Error>(self, name: &str) -> Result<Target, E> {
                Target::deserialize(name.into_deserializer())
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Target, A::Error> {
                let target = Target::deserialize(MapAccessDeserializer::new(&mut map))?;
                if map.next_key::<IgnoredAny>()?.is_some() {
                    return Err(A::Error::custom("several promises, expected one: a target bounds one figure"));
                }
                Ok(target)
            }
        }

        deserializer.deserialize_any(One)
    }
}

impl<'de> Deserialize<'de> for DeltaE {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(DeriveDeserialize)]
        #[serde(deny_unknown_fields)]
        struct Whole {
            at_most: f64,
            #[serde(default)]
            illuminant: Illuminant,
        }

        struct Either;

        impl<'de> Visitor<'de> for Either {
            type Value = DeltaE;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("a number, or an object with at_most and illuminant")
            }

            fn visit_f64<E: Error>(self, at_most: f64) -> Result<DeltaE, E> {
                Ok(DeltaE::from(at_most))
            }

            fn visit_u64<E: Error>(self, at_most: u64) -> Result<DeltaE, E> {
                self.visit_f64(at_most as f64)
            }

            fn visit_i64<E: Error>(self, at_most: i64) -> Result<DeltaE, E> {
                self.visit_f64(at_most as f64)
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<DeltaE, A::Error> {
                let Whole { at_most, illuminant } = Whole::deserialize(MapAccessDeserializer::new(map))?;
                Ok(DeltaE { at_most, illuminant })
            }
        }

        deserializer.deserialize_any(Either)
    }
}

#[cfg(feature = "schema")]
impl utoipa::PartialSchema for Target {
    fn schema() -> utoipa::openapi::RefOr<utoipa::openapi::schema::Schema> {
        use crate::domain::{object_of, one_of, values_of};
        use utoipa::openapi::Ref;
        use utoipa::openapi::schema::OneOfBuilder;
        let is_text = |declared: &&Declared| matches!(declared.values, Values::Switch);
        let texts = Self::DECLARED.iter().filter(is_text);
        let help = texts.clone().map(|declared| format!("`{}`: {}", declared.name, declared.help.trim()));
        let help = help.collect::<Vec<_>>().join(" ");
        let mut target = OneOfBuilder::new().item(one_of(&help, texts.map(|declared| declared.name).collect()));
        for declared in Self::DECLARED.iter().filter(|declared| !is_text(declared)) {
            let mut object = object_of("target", declared);
            if declared.name == Self::DeltaE(DeltaE::from(1.0)).name() {
                let number = values_of(declared);
                let whole = Ref::from_schema_name("DeltaE");
                object.properties.insert(declared.name.to_owned(), OneOfBuilder::new().item(number).item(whole).into());
            }
            target = target.item(object);
        }
        target.description(Some("Promise that the compressed file keeps.")).into()
    }
}

#[cfg(feature = "schema")]
impl utoipa::ToSchema for Target {
    fn name() -> std::borrow::Cow<'static, str> {
        "Target".into()
    }

    fn schemas(schemas: &mut Vec<(String, utoipa::openapi::RefOr<utoipa::openapi::schema::Schema>)>) {
        schemas.push(("DeltaE".to_owned(), <DeltaE as utoipa::PartialSchema>::schema()));
        <DeltaE as utoipa::ToSchema>::schemas(schemas);
    }
}

#[cfg(feature = "schema")]
impl utoipa::PartialSchema for DeltaE {
    fn schema() -> utoipa::openapi::RefOr<utoipa::openapi::schema::Schema> {
        use crate::domain::values_of;
        use utoipa::openapi::Ref;
        use utoipa::openapi::schema::ObjectBuilder;
        let declared = Target::DeltaE(Self::from(1.0)).declared();
        let mut at_most = declared.map(values_of).unwrap_or_default();
        at_most.description =
            Some("Largest CIEDE2000 colour difference allowed; about 1 is just noticeable.".to_owned());
        let light = format!(
            "Illuminant of reflection and transmission; for emission, the light whose chromaticity counts as white. It is {} \
             if the request names none.",
            Illuminant::default()
        );
        let illuminant = Ref::builder().ref_location_from_schema_name("Illuminant").description(Some(light));
        ObjectBuilder::new()
            .description(Some(
                "Upper bound on the colour difference CIEDE2000 of every spectrum with enough measured wavelengths for a \
                 colour, and the illuminant to which the colours refer.",
            ))
            .property("at_most", at_most)
            .property("illuminant", illuminant.build())
            .required("at_most")
            .into()
    }
}

#[cfg(feature = "schema")]
impl utoipa::ToSchema for DeltaE {
    fn name() -> std::borrow::Cow<'static, str> {
        "DeltaE".into()
    }

    fn schemas(schemas: &mut Vec<(String, utoipa::openapi::RefOr<utoipa::openapi::schema::Schema>)>) {
        schemas.push(("Illuminant".to_owned(), <Illuminant as utoipa::PartialSchema>::schema()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Target, String> {
        serde_json::from_str(text).map_err(|e| e.to_string())
    }

    #[test]
    fn targets_are_read_as_they_are_written() {
        let delta_e = |at_most, illuminant| Target::DeltaE(DeltaE { at_most, illuminant });
        for (text, target) in [
            (r#"{"er_l1":0.01}"#, Target::ErL1(0.01)),
            (r#"{"max_absolute_error":0.5}"#, Target::MaxAbsoluteError(0.5)),
            (r#"{"relative_rmse":0.02}"#, Target::RelativeRmse(0.02)),
            (r#"{"delta_e":1}"#, delta_e(1.0, Illuminant::D65)),
            (r#"{"delta_e":0.5}"#, delta_e(0.5, Illuminant::D65)),
            (r#"{"delta_e":{"at_most":0.5}}"#, delta_e(0.5, Illuminant::D65)),
            (r#"{"delta_e":{"at_most":2,"illuminant":"A"}}"#, delta_e(2.0, Illuminant::A)),
            (r#"{"step":0.02}"#, Target::Step(0.02)),
            (r#""lossless""#, Target::Lossless),
            (r#""auto""#, Target::Auto),
        ] {
            assert_eq!(read(text), Ok(target));
            assert!(text.contains(target.name()) && target.declared().is_some(), "{text}");
            assert_eq!(read(&serde_json::to_string(&target).unwrap()), Ok(target));
        }
    }

    #[test]
    fn what_is_no_target_says_why() {
        for (text, reason) in [
            (r#"{"delta_e":"1"}"#, "expected a number, or an object with at_most and illuminant"),
            (r#"{"delta_e":{"illuminant":"A"}}"#, "missing field `at_most`"),
            (r#"{"delta_e":{"at_most":1,"observer":10}}"#, "unknown field `observer`"),
            (r#"{"delta_e":{"at_most":1,"illuminant":"D93"}}"#, "expected one of A, B, C, D50, D65, F11, E"),
            (r#"{"er_l3":1}"#, "unknown variant `er_l3`"),
            (r#"{"er_l2":0.1,"bytes":300}"#, "several promises, expected one"),
            (r#""smallest""#, "unknown variant `smallest`"),
            ("0.01", "expected auto, lossless, or an object with one promise"),
        ] {
            let error = read(text).unwrap_err();
            assert!(error.contains(reason), "{error}");
        }
    }
}
