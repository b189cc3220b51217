//! Options for reading the bytes of a measurement, and the identity that they give it.

use super::text::{Text, check_text};
use crate::domain::{Declared, Values, schema_of, values_of};
use crate::formats::{ArrayManifest, Interpretation, StatedQuantity};
use crate::store::Digest;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::collections::BTreeMap;
use utoipa::openapi::schema::{AdditionalProperties, ObjectBuilder, OneOfBuilder, Schema, Type};
use utoipa::openapi::{Ref, RefOr};
use utoipa::{PartialSchema, ToSchema};

/// Reading option that an upload does not have: it selects one file of an archive, whereas an upload makes a
/// measurement of each file.
const NOT_UPLOADED: &str = "member";
/// Name of the reading option for the axes of an array, which an upload has from the manifest beside the array in an
/// archive.
const UNPACKED: &str = "axes";

/// Options for reading the bytes of a measurement; kept in the JSON description of the measurement in the database. An
/// option unknown to this version is an error: bytes read without it would be read wrongly.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct Options {
    /// Id of the measurement whose content is the spectrum by which the uploaded measurement is multiplied.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spectrum: Option<Digest>,
    /// Reading options that the parsers of measurement file formats take, for example the quantity.
    #[serde(flatten)]
    stated: Interpretation,
}

/// Declares the options for reading a measurement that a compression job may state too, each once with its name and the
/// type that it has in [`Interpretation`].
macro_rules! later {
    ($(#[$meta:meta])* pub(crate) struct LaterOptions { $($(#[doc = $doc:literal])+ $name:ident: $type:ty,)+ }) => {
        $(#[$meta])*
        pub(crate) struct LaterOptions {
            $(
                $(#[doc = $doc])+
                #[serde(skip_serializing_if = "Option::is_none")]
                $name: Option<$type>,
            )+
        }

        impl LaterOptions {
            /// Names of the options, which are those of [`Interpretation::OPTIONS`].
            const NAMES: &[&str] = &[$(stringify!($name)),+];

            /// Returns the upload's reading options, `stated`, in which the options that the job states replace those
            /// of the upload.
            pub(super) fn replace(self, stated: Interpretation) -> Interpretation {
                Interpretation { $($name: self.$name.or(stated.$name),)+ ..stated }
            }
        }
    };
}

later! {
    /// Reading options of a job, which replace those of the upload.
    #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub(crate) struct LaterOptions {
        /// Manifest that describes the axes of an array, if the job states one: see [`Interpretation::axes`].
        axes: serde_json::Value,
        /// Radiometric quantity of the values, if the job states one: see [`Interpretation::quantity`].
        quantity: StatedQuantity,
    }
}

impl From<Interpretation> for Options {
    fn from(stated: Interpretation) -> Self {
        Self { spectrum: None, stated }
    }
}

impl Options {
    /// Returns the options that a client may state with an upload.
    pub(crate) fn of_upload() -> impl Iterator<Item = &'static Declared> {
        of_measurement().filter(|declared| declared.name != UNPACKED)
    }

    /// Reads the options of an upload from their names and values as text. The error names the option.
    pub(crate) fn read(texts: &[(&'static Declared, String)]) -> Result<Self, String> {
        let mut stated = serde_json::Map::new();
        for (declared, text) in texts {
            if matches!(declared.values, Values::Text { .. }) {
                check_text(declared.name, text)?;
            }
            let value =
                declared.read(text).map_err(|expected| format!("{}: found `{text}`, {expected}", declared.name));
            stated.insert(declared.name.to_owned(), value?);
        }
        serde_json::from_value(stated.into()).map_err(|error| error.to_string())
    }

    /// Returns the options for reading a measurement (quantity, unit, column and so on) that were given at its upload,
    /// from its stored description.
    pub(super) fn kept(document: &str) -> Result<Self, serde_json::Error> {
        #[derive(Deserialize)]
        struct Kept {
            options: Options,
        }
        serde_json::from_str::<Kept>(document).map(|kept| kept.options)
    }

    /// Returns a copy of these options for reading an array in which `axes`, from the manifest beside the array,
    /// replace the stated ones.
    pub(super) fn with_axes(&self, axes: Option<serde_json::Value>) -> Self {
        Self { spectrum: self.spectrum, stated: Interpretation { axes, ..self.stated.clone() } }
    }

    /// Returns true if the client stated no option for reading the measurement.
    pub(super) fn is_default(&self) -> bool {
        *self == Self::default()
    }

    /// Returns the reading options in the form that the file readers take.
    pub(crate) fn interpretation(&self) -> Interpretation {
        self.stated.clone()
    }

    /// Returns the id of a measurement: the digest of its bytes, `content`, if it has no reading options. Otherwise it
    /// is the digest of `{"content":"b3-…","options":{…}}`: JSON without white space, keys in alphabetical order,
    /// values as text.
    pub(crate) fn identity(&self, content: Digest) -> Digest {
        if self.is_default() {
            return content;
        }
        let mut options = BTreeMap::new();
        options.extend(self.spectrum.map(|id| (Interpretation::SPECTRUM.name, id.to_string())));
        options.extend(self.stated.stated().into_iter().map(|(name, value)| (name, value.to_string())));
        let quoted = |text: &str| serde_json::Value::from(text).to_string();
        let listed: Vec<String> =
            options.iter().map(|(key, value)| format!("{}:{}", quoted(key), quoted(value))).collect();
        Digest::of(format!("{{\"content\":\"{content}\",\"options\":{{{}}}}}", listed.join(",")).as_bytes())
    }
}

/// Returns the declarations of all options for reading that can be stored with an uploaded measurement.
fn of_measurement() -> impl Iterator<Item = &'static Declared> {
    Interpretation::OPTIONS.iter().filter(|declared| declared.name != NOT_UPLOADED)
}

/// Describes an option as a parameter of the query string of a URL, for OpenAPI.
pub(crate) fn parameter_of(declared: &Declared) -> RefOr<Schema> {
    if let Some(name) = named_schema(declared) {
        return Ref::from_schema_name(name).into();
    }
    // The parameter has the help text.
    let mut values = values_of(declared);
    values.description = None;
    Schema::from(values).into()
}

/// Describes an option as a property of a JSON object in OpenAPI; the value of the property may be null.
fn property_of(declared: &Declared) -> RefOr<Schema> {
    let Some(name) = named_schema(declared) else { return schema_of(declared).into() };
    let described = Ref::builder().ref_location_from_schema_name(name).description(Some(declared.help.trim()));
    let nothing = ObjectBuilder::new().schema_type(Type::Null);
    Schema::from(OneOfBuilder::new().item(described.build()).item(nothing).build()).into()
}

/// Returns the name of the OpenAPI schema that describes the values of an option; `None` if that schema has no name.
fn named_schema(declared: &Declared) -> Option<Cow<'static, str>> {
    match declared.values {
        Values::Name { .. } => {
            let mut fields = Interpretation::schemas().into_iter();
            fields.find(|(option, ..)| *option == declared.name).map(|(_, name, _)| name)
        }
        Values::Text { .. } => Some(Text::name()),
        Values::File { .. } => Some(Digest::name()),
        Values::Document { .. } => Some(ArrayManifest::name()),
        _ => None,
    }
}

/// Describes, as an OpenAPI schema, a JSON object whose fields are the given options.
fn object<'a>(description: &str, options: impl Iterator<Item = &'a Declared>) -> RefOr<Schema> {
    let object = ObjectBuilder::new().description(Some(description));
    let object = options.fold(object, |object, declared| object.property(declared.name, property_of(declared)));
    Schema::from(object.additional_properties(Some(AdditionalProperties::FreeForm(false))).build()).into()
}

fn push_schemas(schemas: &mut Vec<(String, RefOr<Schema>)>) {
    schemas.push((Text::name().into_owned(), Text::schema()));
    schemas.push((Digest::name().into_owned(), Digest::schema()));
    schemas.push((ArrayManifest::name().into_owned(), ArrayManifest::schema()));
    ArrayManifest::schemas(schemas);
    schemas.extend(Interpretation::schemas().into_iter().map(|(_, name, schema)| (name.into_owned(), schema)));
}

impl PartialSchema for Options {
    fn schema() -> RefOr<Schema> {
        object("Options with which the bytes of a measurement are read.", of_measurement())
    }
}

impl ToSchema for Options {
    fn name() -> Cow<'static, str> {
        "ReadingOptions".into()
    }

    fn schemas(schemas: &mut Vec<(String, RefOr<Schema>)>) {
        push_schemas(schemas);
    }
}

impl PartialSchema for LaterOptions {
    fn schema() -> RefOr<Schema> {
        let options = Interpretation::OPTIONS.iter().filter(|declared| Self::NAMES.contains(&declared.name));
        object("Reading options of a job, which replace those of the upload.", options)
    }
}

impl ToSchema for LaterOptions {
    fn schemas(schemas: &mut Vec<(String, RefOr<Schema>)>) {
        push_schemas(schemas);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Quantity;

    #[test]
    fn options_are_part_of_the_identity() {
        let content = Digest::of(b"table");
        let none = Options::default();
        assert_eq!(none.identity(content), content);
        let stated = Interpretation { column: Some("light \"skin\"".to_owned()), ..Interpretation::default() };
        let column = Options::from(stated.clone());
        let both = Options::from(Interpretation { quantity: Some(Quantity::Reflectance.into()), ..stated });
        let text = format!(
            "{{\"content\":\"{content}\",\"options\":{{\"column\":\"light \\\"skin\\\"\",\"quantity\":\"reflectance\"}}}}"
        );
        assert_eq!(both.identity(content), Digest::of(text.as_bytes()));
        assert_ne!(column.identity(content), both.identity(content));
        assert_ne!(column.identity(content), content);
    }

    #[test]
    fn options_of_a_job_replace_those_of_the_upload() {
        let later: LaterOptions = serde_json::from_str("{\"quantity\":\"brdf\"}").unwrap();
        assert_eq!(serde_json::to_string(&later).unwrap(), "{\"quantity\":\"brdf\"}");
        let axes = Some(serde_json::json!(["index"]));
        let stated = Interpretation { axes, quantity: Some(StatedQuantity::Edf), ..Interpretation::default() };
        let replaced = Interpretation { quantity: Some(StatedQuantity::Brdf), ..stated.clone() };
        assert_eq!(later.replace(stated), replaced);
        let error = serde_json::from_str::<LaterOptions>("{\"unit\":\"1/sr\"}").unwrap_err().to_string();
        assert!(error.starts_with("unknown field `unit`, expected `axes` or `quantity`"), "{error}");
        let is_declared = |name: &&str| Interpretation::OPTIONS.iter().any(|declared| declared.name == *name);
        assert!(LaterOptions::NAMES.iter().all(is_declared), "{:?}", LaterOptions::NAMES);
    }

    #[test]
    fn every_option_changes_the_identity_as_it_did() {
        let content = Digest::of(b"table");
        let text = |name: &str| match name {
            "spectrum" => content.to_string(),
            "quantity" => "brdf".to_owned(),
            "unit" => "1/sr".to_owned(),
            "normalization" => "4pi".to_owned(),
            "side" => "front".to_owned(),
            "overlap" => "longer".to_owned(),
            "in_plane_sign" => "source".to_owned(),
            name => format!("the {name}"),
        };
        let texts: Vec<_> = Options::of_upload().map(|declared| (declared, text(declared.name))).collect();
        let options = Options::read(&texts).unwrap().with_axes(Some(serde_json::json!({ "axes": ["index", 2] })));
        let all = format!(
            "{{\"content\":\"{content}\",\"options\":{{\"axes\":\"{{\\\"axes\\\":[\\\"index\\\",2]}}\",\
             \"band\":\"the band\",\"column\":\"the column\",\"in_plane_sign\":\"source\",\"normalization\":\"4pi\",\
             \"overlap\":\"longer\",\"quantity\":\"brdf\",\"side\":\"front\",\"spectrum\":\"{content}\",\"unit\":\"1/sr\",\
             \"wavelength_column\":\"the wavelength_column\",\"wavelength_unit\":\"the wavelength_unit\"}}}}"
        );
        assert_eq!(options.identity(content), Digest::of(all.as_bytes()));
        let document = serde_json::to_string(&options).unwrap();
        assert_eq!(serde_json::from_str::<Options>(&document).unwrap(), options);
        assert!(serde_json::from_str::<Options>("{\"colour\":1}").is_err());
    }
}
