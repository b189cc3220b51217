//! Values of notes as JSON holds them.

use crate::domain::{Domain, Quantity, Unit};
use serde::{Deserialize, Serialize, Serializer};

/// Value in a remark for the user: a number, a name or a flag.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(untagged)]
pub enum NoteValue {
    /// Truth value that a remark for the user mentions.
    Flag(bool),
    /// Finite number that a remark for the user mentions. In JSON, a whole number has no decimal point.
    Number(#[serde(serialize_with = "number")] f64),
    /// Name, or quotation from the file, that a remark for the user mentions.
    Text(String),
}

/// Serialises a number without a needless decimal point: `3`, not `3.0`.
#[allow(clippy::trivially_copy_pass_by_ref, reason = "the signature that serde calls")]
fn number<S: Serializer>(number: &f64, to: S) -> Result<S::Ok, S::Error> {
    // Whole numbers below 2^53 are exact.
    let is_whole = number.fract() == 0.0 && number.abs() < 9_007_199_254_740_992.0;
    if is_whole { to.serialize_i64(*number as i64) } else { to.serialize_f64(*number) }
}

/// Conversion of a Rust value to one that a remark for the user mentions; `None` leaves the value out.
#[doc(hidden)]
pub trait ToNoteValue {
    /// Converts a Rust value to a flag, number or text for a remark to the user; `None` if there is no value or it is
    /// not finite.
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
    /// Converts a 32-bit floating-point number to the 64-bit number with the same shortest decimal form (0.1, not
    /// 0.100000001), for a remark to the user.
    fn to_value(&self) -> Option<NoteValue> {
        self.to_string().parse::<f64>().ok()?.to_value()
    }
}

impl<T: ToNoteValue> ToNoteValue for Option<T> {
    fn to_value(&self) -> Option<NoteValue> {
        self.as_ref().and_then(T::to_value)
    }
}

/// Implements, for integer types, the conversion of a count to a number that a remark for the user mentions.
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

/// Implements, for types that can be printed, the conversion to the text with which a remark for the user quotes a
/// value.
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
