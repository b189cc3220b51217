//! Query of an upload: the names that a client gives, and the reading options as they are declared.

use super::extract::{check_upload_id, unknown_parameter};
use super::resumable::upload_parameter;
use crate::domain::Declared;
use crate::jobs::{Options, Text, Upload, check_text, parameter_of};
use serde::de::Error;
use serde::{Deserialize, Deserializer};
use utoipa::openapi::path::{Parameter, ParameterBuilder, ParameterIn};
use utoipa::openapi::{Ref, RefOr, Required, Schema};
use utoipa::{IntoParams, ToSchema};

/// Query parameters of an upload that name the uploaded file and the measurement, with their help texts.
const NAMES: [(&str, &str); 2] = [("filename", "Name of the file."), ("name", "Name of the measurement.")];

/// Query parameter that names a resumable upload.
pub(super) const UPLOAD: &str = "upload";

/// Statements of a client about the bytes that it uploads, read from a query string, and the id of the resumable upload
/// that has the bytes.
#[derive(Debug)]
pub(super) struct UploadQuery(pub(super) Upload, pub(super) Option<String>);

/// Reads the parameters of an upload. The error names the parameter.
fn read(pairs: Vec<(String, String)>) -> Result<(Upload, Option<String>), String> {
    let mut resumable = None;
    let mut names: [Option<String>; NAMES.len()] = [const { None }; NAMES.len()];
    let mut options: Vec<(&'static Declared, String)> = Vec::new();
    for (key, value) in pairs {
        let is_twice = if let Some(place) = NAMES.iter().position(|(name, _)| *name == key) {
            check_text(&key, &value)?;
            names[place].replace(value).is_some()
        } else if key == UPLOAD {
            check_upload_id(&value)?;
            resumable.replace(value).is_some()
        } else {
            let declared = Options::of_upload().find(|declared| declared.name == key).ok_or_else(|| unknown(&key))?;
            let is_twice = options.iter().any(|(known, _)| known.name == key);
            options.push((declared, value));
            is_twice
        };
        if is_twice {
            return Err(format!("duplicate field `{key}`"));
        }
    }
    let [file_name, name] = names;
    Ok((Upload { file_name, name, options: Options::read(&options)? }, resumable))
}

fn unknown(key: &str) -> String {
    let names = NAMES.iter().map(|(name, _)| *name).chain([UPLOAD]);
    unknown_parameter(key, names.chain(Options::of_upload().map(|declared| declared.name)))
}

impl<'de> Deserialize<'de> for UploadQuery {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        read(Vec::deserialize(deserializer)?).map(|(upload, id)| Self(upload, id)).map_err(D::Error::custom)
    }
}

impl IntoParams for UploadQuery {
    fn into_params(_: impl Fn() -> Option<ParameterIn>) -> Vec<Parameter> {
        let parameter = |name: &str, help: &str, schema: RefOr<Schema>| {
            let parameter = ParameterBuilder::new().name(name).parameter_in(ParameterIn::Query);
            parameter.required(Required::False).description(Some(help.trim())).schema(Some(schema)).build()
        };
        let names = NAMES.iter().map(|(name, help)| parameter(name, help, Ref::from_schema_name(Text::name()).into()));
        let names = names.chain([upload_parameter()]);
        names.chain(Options::of_upload().map(|known| parameter(known.name, known.help, parameter_of(known)))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::StatedQuantity;

    fn query(text: &str) -> Result<Upload, String> {
        let uri = format!("/?{text}").parse().unwrap();
        axum::extract::Query::<UploadQuery>::try_from_uri(&uri)
            .map(|axum::extract::Query(UploadQuery(upload, _))| upload)
            .map_err(|rejection| rejection.body_text())
    }

    #[test]
    fn names_and_options_are_read() {
        let upload = query("filename=a.ies&column=2&quantity=brdf").unwrap();
        assert_eq!((upload.file_name.as_deref(), upload.name), (Some("a.ies"), None));
        let interpretation = upload.options.interpretation();
        assert_eq!(interpretation.column.as_deref(), Some("2"));
        assert_eq!(interpretation.quantity.map(StatedQuantity::name), Some("brdf"));
    }

    #[test]
    fn other_parameters_and_values_are_refused_by_name() {
        for (text, reason) in [
            (
                "colour=red",
                "unknown field `colour`, expected one of `filename`, `name`, `upload`, `spectrum`, `quantity`",
            ),
            ("axes=[]", "unknown field `axes`"),
            ("member=a", "unknown field `member`"),
            ("upload=1", "`1` is no id of an upload, expected 32 hexadecimal digits"),
            ("column=1&column=1", "duplicate field `column`"),
            ("name=a&name=a", "duplicate field `name`"),
            ("quantity=light", "quantity: found `light`, expected one of spectrum, "),
            ("column=", "a column of 0 characters"),
            ("name=a%0ab", "a name with control characters"),
            ("spectrum=b3-1", "`b3-1` is no digest"),
        ] {
            let refusal = query(text).unwrap_err();
            assert!(refusal.contains(reason), "{text}: {refusal}");
        }
    }
}
