//! JSON schemas of names, options and targets, for the description of an HTTP interface.

/// Implements the JSON schema of an enum without fields: a text that is one of the enum's names. If the enum is the
/// value of one declared option, the help text and the default value of that option are part of the schema.
#[doc(hidden)]
#[macro_export]
#[cfg(feature = "schema")]
macro_rules! schema_of_names {
    ($type:ident, $what:literal) => {
        $crate::schema_of_names!(@ $type, $crate::domain::one_of(concat!("Name of the ", $what, "."), $type::all_names()));
    };
    ($type:ident, $what:literal, $option:path) => {
        $crate::schema_of_names!(@ $type, $crate::domain::values_of(&$option));
    };
    (@ $type:ident, $schema:expr) => {
        impl $crate::domain::utoipa::PartialSchema for $type {
            fn schema() -> $crate::domain::utoipa::openapi::RefOr<$crate::domain::utoipa::openapi::schema::Schema> {
                $schema.into()
            }
        }

        impl $crate::domain::utoipa::ToSchema for $type {
            fn name() -> std::borrow::Cow<'static, str> {
                stringify!($type).into()
            }
        }
    };
}
/// Replaces the JSON schema of an enum by nothing, since the crate feature `schema` is off.
#[doc(hidden)]
#[macro_export]
#[cfg(not(feature = "schema"))]
macro_rules! schema_of_names {
    ($type:ident, $what:literal $(, $option:path)?) => {};
}

#[cfg(feature = "schema")]
pub use described::{object_of, one_of, schema_of, values_of};

#[cfg(feature = "schema")]
mod described {
    use super::super::option::{Declared, Values};
    use std::ops::Bound;
    use utoipa::openapi::schema::{AdditionalProperties, Object, ObjectBuilder, OneOfBuilder, Schema, Type};
    use utoipa::openapi::{KnownFormat, SchemaFormat};

    /// Returns the JSON schema of a text that is one of `names`.
    pub fn one_of(description: &str, names: Vec<&'static str>) -> Object {
        let text = ObjectBuilder::new().schema_type(Type::String).description(Some(description));
        text.enum_values(Some(names)).build()
    }

    /// Returns the JSON schema of a declared option, with its help text. An option without a default also accepts null.
    pub fn schema_of(declared: &Declared) -> Schema {
        let described = values_of(declared);
        if !(declared.default)().is_null() {
            return described.into();
        }
        let nothing = ObjectBuilder::new().schema_type(Type::Null);
        OneOfBuilder::new().item(described).item(nothing).into()
    }

    /// Returns the JSON schema of the values of a declared option, with its help text.
    pub fn values_of(declared: &Declared) -> Object {
        let help = declared.help.trim();
        let default = Some((declared.default)()).filter(|default| !default.is_null());
        let described = ObjectBuilder::new().description(Some(help)).default(default);
        match declared.values {
            Values::Switch => described.schema_type(Type::Boolean),
            Values::Number { limits, .. } => {
                let mut number = described.schema_type(Type::Number);
                number = number.format(Some(SchemaFormat::KnownFormat(KnownFormat::Double)));
                number = match limits.low {
                    Bound::Included(low) => number.minimum(Some(low)),
                    Bound::Excluded(low) => number.exclusive_minimum(Some(low)),
                    Bound::Unbounded => number,
                };
                match limits.high {
                    Bound::Included(high) => number.maximum(Some(high)),
                    Bound::Excluded(high) => number.exclusive_maximum(Some(high)),
                    Bound::Unbounded => number,
                }
            }
            Values::Whole { least, most, .. } => {
                let number = described.schema_type(Type::Integer).minimum(Some(least as f64));
                if most == u64::MAX { number } else { number.maximum(Some(most as f64)) }
            }
            Values::Name { names, .. } => described.schema_type(Type::String).enum_values(Some(names())),
            Values::List { .. } | Values::Text { .. } | Values::File { .. } => described.schema_type(Type::String),
            Values::Document { .. } => described,
        }
        .build()
    }

    /// Returns the JSON schema of an object that has one declared option as its only, required property. Its title is
    /// `PREFIX_NAME`, because generated clients use it as the name of a type.
    pub fn object_of(prefix: &str, declared: &Declared) -> Object {
        ObjectBuilder::new()
            .title(Some(format!("{prefix}_{}", declared.name)))
            .property(declared.name, values_of(declared))
            .required(declared.name)
            .additional_properties(Some(AdditionalProperties::FreeForm(false)))
            .build()
    }
}
