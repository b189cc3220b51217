//! Declaration of an option: its name, its help text and its values. The command line, the HTTP description and the
//! checks of a request are all derived from it.

use serde_json::Value;
use std::ops::{Bound, RangeBounds};

/// Declaration of one option of a request, from which command line, HTTP interface and checks are derived.
#[derive(Clone, Copy, Debug)]
pub struct Declared {
    /// Name of the option in JSON, in `snake_case`; the command line has `--kebab-case`.
    pub name: &'static str,
    /// Help text of the option: sentences for the user.
    pub help: &'static str,
    /// Values that the option accepts.
    pub values: Values,
    /// Function that returns the default value of the option as JSON; null for an option without a default.
    pub default: fn() -> Value,
}

/// Values that an option accepts.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum Values {
    /// Switch, true or false. On the command line the option takes no value; `--no-NAME` makes a switch false that is
    /// true by default.
    Switch,
    /// Option that takes a number within limits.
    Number {
        /// Placeholder in the help text for the number that the user gives as the option's value, such as `E`.
        shown: &'static str,
        /// Range of numbers that the option accepts.
        limits: Limits,
    },
    /// Option that takes a whole number in a range, both ends included.
    Whole {
        /// Placeholder in the help text for the whole number that the user gives as the option's value, such as `N`.
        shown: &'static str,
        /// Smallest whole number that the option accepts.
        least: u64,
        /// Largest whole number that the option accepts.
        most: u64,
    },
    /// Option that takes a list of whole numbers, none negative, as text with commas between them.
    List {
        /// Placeholder in the help text for the numbers that the user gives as the option's value, such as `I,...`.
        shown: &'static str,
    },
    /// Option that takes one of a list of names.
    Name {
        /// Placeholder in the help text for the name that the user gives as the option's value, such as `UNIT`. `None`
        /// if the names themselves stand there.
        shown: Option<&'static str>,
        /// Names that the option accepts.
        names: fn() -> Vec<&'static str>,
    },
    /// Option that takes a text of the user, which a function checks.
    Text {
        /// Placeholder in the help text for the text that the user gives as the option's value, such as `NAME`.
        shown: &'static str,
        /// Function that checks the text of the user. The error says what was expected.
        check: fn(&str) -> Result<(), String>,
    },
    /// Option that takes a file: its path on the command line, the id of the uploaded bytes over HTTP.
    File {
        /// Placeholder in the help text for the path that the user gives as the option's value, such as `SPD`.
        shown: &'static str,
    },
    /// JSON document: the path of a file with it on the command line, the document itself over HTTP.
    Document {
        /// Placeholder in the help text for the path that the user gives as the option's value, such as `MANIFEST`.
        shown: &'static str,
    },
}

/// Range of numbers that an option accepts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Lower end of the range of numbers that the option accepts.
    pub low: Bound<f64>,
    /// Upper end of the range of numbers that the option accepts.
    pub high: Bound<f64>,
    /// Text that messages append to the range, with the space or comma before it: a unit, or an example. May be empty.
    pub remark: &'static str,
}

impl Limits {
    /// Creates the range of numbers above 0 and up to `most`.
    pub const fn up_to(most: f64, remark: &'static str) -> Self {
        Self { low: Bound::Excluded(0.0), high: Bound::Included(most), remark }
    }

    /// Creates the range of finite numbers above 0.
    pub const fn positive(remark: &'static str) -> Self {
        Self { low: Bound::Excluded(0.0), high: Bound::Unbounded, remark }
    }

    /// Describes the range in the words that follow "expected" in an error message.
    pub fn expected(&self) -> String {
        let low = match self.low {
            Bound::Included(low) => Some(format!("at least {low}")),
            Bound::Excluded(low) => Some(format!("more than {low}")),
            Bound::Unbounded => None,
        };
        let high = match self.high {
            Bound::Included(high) => Some(format!("at most {high}")),
            Bound::Excluded(high) => Some(format!("less than {high}")),
            Bound::Unbounded => None,
        };
        let range = match (self.low, self.high) {
            (Bound::Included(low), Bound::Included(high)) => format!("{low} to {high}"),
            (Bound::Unbounded, Bound::Unbounded) => "a finite number".to_owned(),
            _ => low.into_iter().chain(high).collect::<Vec<_>>().join(" and "),
        };
        format!("{range}{}", self.remark)
    }

    /// Returns true if `number` is finite and within the range.
    pub fn allow(&self, number: f64) -> bool {
        number.is_finite() && (self.low, self.high).contains(&number)
    }
}

impl Declared {
    /// Converts the text that the command line gives for an option to a JSON value. The error says what was expected.
    pub fn read(&self, text: &str) -> Result<Value, String> {
        match self.values {
            Values::Switch => match text {
                "true" => Ok(Value::Bool(true)),
                "false" => Ok(Value::Bool(false)),
                _ => Err("expected true or false".to_owned()),
            },
            Values::Number { limits, .. } => {
                let number = text.parse().map_err(|_| format!("expected a number {}", limits.expected()));
                number.and_then(|number: f64| self.checked(Value::from(number)))
            }
            Values::Whole { .. } => {
                let number = text.parse::<u64>().map_or(Value::Null, Value::from);
                self.checked(number)
            }
            Values::List { .. } => {
                let numbers = text.split(',').map(|part| part.trim().parse::<u64>()).collect::<Result<Vec<_>, _>>();
                self.checked(numbers.map_or(Value::Null, Value::from))
            }
            Values::Document { .. } => serde_json::from_str(text).map_err(|error| format!("expected JSON: {error}")),
            Values::Name { .. } | Values::Text { .. } | Values::File { .. } => self.checked(Value::from(text)),
        }
    }

    /// Returns the JSON value unchanged if the option accepts it; the error says what was expected.
    fn checked(&self, value: Value) -> Result<Value, String> {
        self.check(&value).map(|()| value)
    }

    /// Checks a JSON value of the right type against the limits of the option. The error says what was expected.
    pub fn check(&self, value: &Value) -> Result<(), String> {
        match self.values {
            Values::Switch | Values::File { .. } | Values::Document { .. } => Ok(()),
            Values::Number { limits, .. } => match value.as_f64() {
                Some(number) if limits.allow(number) => Ok(()),
                _ => Err(format!("expected {}", limits.expected())),
            },
            Values::Whole { least, most, .. } => match value.as_u64() {
                Some(number) if (least..=most).contains(&number) => Ok(()),
                _ if most == u64::MAX => Err(format!("expected a whole number, at least {least}")),
                _ => Err(format!("expected a whole number from {least} to {most}")),
            },
            Values::List { .. } => match value.as_array() {
                Some(numbers) if numbers.iter().all(Value::is_u64) => Ok(()),
                _ => Err("expected whole numbers, none negative, with commas between them".to_owned()),
            },
            Values::Name { names, .. } => match value.as_str() {
                Some(name) if names().contains(&name) => Ok(()),
                _ => Err(format!("expected one of {}", names().join(", "))),
            },
            Values::Text { check, .. } => value.as_str().ok_or_else(|| "expected a text".to_owned()).and_then(check),
        }
    }
}

/// Accepts every text as the value of an option.
pub fn any_text(_: &str) -> Result<(), String> {
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRACTION: Declared = Declared {
        name: "floor",
        help: "",
        values: Values::Number {
            shown: "F",
            limits: Limits { low: Bound::Excluded(0.0), high: Bound::Excluded(1.0), remark: " (0.01 is 1 %)" },
        },
        default: || Value::Null,
    };

    #[test]
    fn texts_become_values_within_the_limits() {
        assert_eq!(FRACTION.read("0.25"), Ok(Value::from(0.25)));
        for bad in ["0", "1", "nan", "inf", "-0.5", "x", ""] {
            assert!(FRACTION.read(bad).unwrap_err().contains("more than 0 and less than 1 (0.01 is 1 %)"), "{bad}");
        }
        let level = Declared { values: Values::Whole { shown: "N", least: 0, most: 8 }, ..FRACTION };
        assert_eq!(level.read("8"), Ok(Value::from(8)));
        for bad in ["9", "-1", "1.5", ""] {
            assert_eq!(level.read(bad), Err("expected a whole number from 0 to 8".to_owned()));
        }
        let list = Declared { values: Values::List { shown: "I,..." }, ..FRACTION };
        assert_eq!(list.read("3, 0"), Ok(serde_json::json!([3, 0])));
        for bad in ["", "1,", "-1", "0.5", "x"] {
            assert_eq!(
                list.read(bad),
                Err("expected whole numbers, none negative, with commas between them".to_owned())
            );
        }
        let name = Values::Name { shown: None, names: || vec!["a", "b"] };
        let name = Declared { values: name, ..FRACTION };
        assert_eq!(name.read("b"), Ok(Value::from("b")));
        assert_eq!(name.read("c"), Err("expected one of a, b".to_owned()));
        assert_eq!(Declared { values: Values::Switch, ..FRACTION }.read("true"), Ok(Value::Bool(true)));
    }
    #[test]
    fn ranges_are_told_in_words() {
        let limits = |low, high| Limits { low, high, remark: "" }.expected();
        for (words, found) in [
            ("more than 0 and at most 10", Limits::up_to(10.0, "").expected()),
            ("more than 0 nm", Limits::positive(" nm").expected()),
            ("at least 1", limits(Bound::Included(1.0), Bound::Unbounded)),
            ("less than 2", limits(Bound::Unbounded, Bound::Excluded(2.0))),
            ("0.000001 to 64", limits(Bound::Included(1e-6), Bound::Included(64.0))),
            ("a finite number", limits(Bound::Unbounded, Bound::Unbounded)),
        ] {
            assert_eq!(found, words);
        }
    }
}
