//! Promises that a compressed file can make, and the figure of an error report that each one bounds.

use super::setting_error::SettingError;
use crate::domain::ErrorReport;
use crate::domain::colour::Illuminant;
use serde::de::value::MapAccessDeserializer;
use serde::de::{Deserialize, Deserializer, Error, IgnoredAny, IntoDeserializer, MapAccess, Visitor};
use serde::{Deserialize as DeriveDeserialize, Serialize, Serializer};

/// Promise that the compressed file keeps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, DeriveDeserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields, remote = "Self")]
pub enum Target {
    /// Upper bound on er(L1), the mean relative error of the samples > 0 (0.01 = 1 %).
    ErL1(f64),
    /// Upper bound on er(L2), the root mean square of the relative error of the samples > 0 (0.01 = 1 %).
    ErL2(f64),
    /// Upper bound on the relative error of every sample > 0.
    MaxRelativeError(f64),
    /// Upper bound on the absolute error of every unmasked sample, in the unit of the samples.
    MaxAbsoluteError(f64),
    /// Upper bound on `√(Σ(s'−s)² / Σs²)` over all unmasked samples.
    RelativeRmse(f64),
    /// Upper bound on the colour difference of every spectrum.
    DeltaE(DeltaE),
    /// Lower bound on samples per kept coefficient.
    Ratio(f64),
    /// Upper bound on the file size in bytes, metadata included.
    Bytes(u64),
    /// No error bound: fixes the quantiser step, in natural-log units of the samples; policy `rd`. For experts and for
    /// speed, as no search is made. Errors are still measured and reported. er(L2) is about a tenth of the step, unless
    /// the data's own basis (the choice of `auto`) has too few vectors to follow the data.
    Step(f64),
    /// As accurate as the noise of the measurement allows: er(L2) stops where the remaining error is noise. If a file
    /// states larger uncertainties, `wavelume_formats::pipeline` stops at those.
    Auto,
    /// Every bit is kept.
    Lossless,
}

/// Upper bound on CIEDE2000 of every scored spectrum, as `domain::colour::SpectraColours` defines it.
///
/// In JSON a number (the illuminant is then D65), or an object with both fields.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DeltaE {
    /// Largest colour difference allowed; about 1 is just noticeable.
    pub at_most: f64,
    /// Illuminant of reflection and transmission; for emission, the chromaticity of white.
    pub illuminant: Illuminant,
}

/// Figure of an error report, with its upper bound.
#[derive(Clone, Copy)]
pub(crate) struct Bound {
    /// Name of the figure in requests and reports.
    pub(crate) name: &'static str,
    pub(crate) at_most: f64,
    pub(crate) figure: fn(&ErrorReport) -> f64,
}

impl Bound {
    /// Returns true if `errors` are within the bound.
    pub(crate) fn keeps(&self, errors: &ErrorReport) -> bool {
        (self.figure)(errors) <= self.at_most
    }
}

/// Largest relative error that can be requested; larger ones are meaningless. 10 is 1000 %.
const MOST_RELATIVE: f64 = 10.0;
/// Smallest quantiser step; float32 logarithms cannot resolve finer ones.
pub(crate) const LEAST_STEP: f64 = 1e-6;
/// Largest quantiser step; at the loosest targets it leaves one coefficient.
const MOST_STEP: f64 = 64.0;
/// Largest ΔE that can be requested: from black to white.
const MOST_DELTA_E: f64 = 100.0;

impl Target {
    /// Returns the figure that the target bounds; `None` if it bounds no figure of an error report.
    pub(crate) fn bound(self) -> Option<Bound> {
        let (name, at_most, figure): (_, _, fn(&ErrorReport) -> f64) = match self {
            Self::ErL1(most) => ("er_l1", most, |e| e.er_l1),
            Self::ErL2(most) => ("er_l2", most, |e| e.er_l2),
            Self::MaxRelativeError(most) => ("max_relative_error", most, |e| e.max_relative_error),
            Self::MaxAbsoluteError(most) => ("max_absolute_error", most, |e| e.max_absolute_error),
            Self::RelativeRmse(most) => ("relative_rmse", most, |e| e.relative_rmse),
            Self::Lossless => ("lossless: largest error", 0.0, |e| e.max_absolute_error),
            Self::DeltaE(_) | Self::Ratio(_) | Self::Bytes(_) | Self::Step(_) | Self::Auto => return None,
        };
        Some(Bound { name, at_most, figure })
    }

    /// Rejects a target value outside its range.
    pub(crate) fn check(self) -> Result<(), SettingError> {
        let refuse = |option, found, expected| Err(SettingError::Range { option, found, expected });
        match self {
            Self::ErL1(error) | Self::ErL2(error) | Self::MaxRelativeError(error) | Self::RelativeRmse(error)
                if !(error > 0.0 && error <= MOST_RELATIVE) =>
            {
                let name = self.bound().map_or("", |bound| bound.name);
                refuse(name, error, "more than 0 and at most 10 (0.01 is 1 %)")
            }
            Self::MaxAbsoluteError(error) if !(error > 0.0 && error.is_finite()) => {
                refuse("max_absolute_error", error, "more than 0, in the unit of the samples")
            }
            Self::DeltaE(DeltaE { at_most, .. }) if !(at_most > 0.0 && at_most <= MOST_DELTA_E) => {
                refuse("delta_e", at_most, "more than 0 and at most 100")
            }
            Self::Ratio(ratio) if !(ratio >= 1.0 && ratio.is_finite()) => {
                refuse("ratio", ratio, "at least 1 sample per coefficient")
            }
            Self::Step(step) if !(LEAST_STEP..=MOST_STEP).contains(&step) => {
                refuse("step", step, "0.000001 to 64, in natural logarithms")
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
                Ok(DeltaE { at_most, illuminant: Illuminant::default() })
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
