//! Values of notes as JSON holds them.

use crate::domain::{Domain, Quantity, Unit};
use serde::{Deserialize, Serialize, Serializer};

/// Value of a note: a number, a name or a flag.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(untagged)]
pub enum NoteValue {
    /// Yes or no.
    Flag(bool),
    /// A finite number. A whole one is written without a decimal point.
    Number(#[serde(serialize_with = "number")] f64),
    /// A name, or a quotation of the file.
    Text(String),
}

/// Writes a number as people do: `3`, not `3.0`.
#[allow(clippy::trivially_copy_pass_by_ref, reason = "the signature that serde calls")]
fn number<S: Serializer>(number: &f64, to: S) -> Result<S::Ok, S::Error> {
    // Whole numbers below 2^53 are exact.
    let is_whole = number.fract() == 0.0 && number.abs() < 9_007_199_254_740_992.0;
    if is_whole { to.serialize_i64(*number as i64) } else { to.serialize_f64(*number) }
}

/// Conversion of a field of a note; `None` leaves the value out.
#[doc(hidden)]
pub trait ToNoteValue {
    /// Returns the value; `None` if there is none or it is not finite.
    fn to_value(&self) -> Option<NoteValue>;
}

impl ToNoteValue for bool {
    fn to_value(&self) -> Option<NoteValue> {
        Some(NoteValue::Flag(*self))
    }
}

impl ToNoteValue for f64 {
    fn to_value(&self) -> Option<NoteValue> {
        Some(*self).filter(|value| value.is_finite()).map(NoteValue::Number)
    }
}

impl ToNoteValue for f32 {
    /// Returns the shortest decimal that stands for the number, as a sentence shows it.
    fn to_value(&self) -> Option<NoteValue> {
        self.to_string().parse::<f64>().ok()?.to_value()
    }
}

impl<T: ToNoteValue> ToNoteValue for Option<T> {
    fn to_value(&self) -> Option<NoteValue> {
        self.as_ref().and_then(T::to_value)
    }
}

/// Implements the conversion of counts.
macro_rules! counts {
    ($($type:ty),+) => { $(
        impl ToNoteValue for $type {
            fn to_value(&self) -> Option<NoteValue> {
                // Counts stay below 2^53.
                #[allow(clippy::cast_lossless, reason = "one form for all counts")]
                Some(NoteValue::Number(*self as f64))
            }
        }
    )+ };
}

/// Implements the conversion of types that are shown by name.
macro_rules! names {
    ($($type:ty),+) => { $(
        impl ToNoteValue for $type {
            fn to_value(&self) -> Option<NoteValue> {
                Some(NoteValue::Text(self.to_string()))
            }
        }
    )+ };
}

counts!(u8, u32, u64, usize);
names!(&'static str, String, Domain, Quantity, Unit);
