//! Description of the export of a material: its parameters and its answers, made from the table of writers.

use super::schemas::{Binary, ExportName, IndexText};
use crate::domain::{Declared, Values, values_of};
use crate::export::{ExportFormat, ExportOptions, format_help, option_help};
use crate::formats::ArrayManifest;
use std::collections::BTreeMap;
use utoipa::openapi::path::{Parameter, ParameterBuilder, ParameterIn};
use utoipa::openapi::{
    ContentBuilder, HeaderBuilder, ObjectBuilder, Ref, RefOr, Required, Response, ResponseBuilder, Schema, schema::Type,
};
use utoipa::{IntoParams, IntoResponses, ToSchema};

/// Query parameter that names the format of an export.
pub(super) const FORMAT: &str = "format";

/// Parameters of an export.
pub(super) struct ExportParams;

impl IntoParams for ExportParams {
    fn into_params(_: impl Fn() -> Option<ParameterIn>) -> Vec<Parameter> {
        let parameter = |name: &str, help: String, required: Required, schema: RefOr<Schema>| {
            let parameter = ParameterBuilder::new().name(name).parameter_in(ParameterIn::Query);
            parameter.required(required).description(Some(help)).schema(Some(schema)).build()
        };
        let help = format!("{}; `manifest` is the manifest of an array alone.", format_help());
        let format = parameter(FORMAT, help, Required::True, Ref::from_schema_name(ExportName::name()).into());
        let options = ExportOptions::OPTIONS
            .iter()
            .map(|declared| parameter(declared.name, option_help(declared), Required::False, schema_of(declared)));
        std::iter::once(format).chain(options).collect()
    }
}

/// Returns the OpenAPI schema of the query parameter for one option of an export.
fn schema_of(declared: &Declared) -> RefOr<Schema> {
    if matches!(declared.values, Values::List { .. }) {
        return Ref::from_schema_name(IndexText::name()).into();
    }
    // The parameter has the help text.
    let mut values = values_of(declared);
    values.description = None;
    Schema::from(values).into()
}

/// HTTP responses to a request that exports a material, for the OpenAPI description: the exported file, or status 304
/// without content.
pub(super) struct ExportedFile;

/// Text on the response header `Wavelume-Export-Error` in the OpenAPI description. The header states the error that an
/// export adds to a material.
const ERROR: &str = "Error that the file adds to the error of the material, measured on its bytes: er_l2, er_l1, max (relative errors), \
                     relative_rmse, pairs (number of compared pairs of directions), of (kind of the compared values), and for \
                     luminaires peak, flux (both relative), rms_of_peak and er_l2_bright (over intensities above 1 % of the peak); \
                     promise=\"broken\" ends it if er_l2 exceeds the error that the material promises";

impl IntoResponses for ExportedFile {
    fn responses() -> BTreeMap<String, RefOr<Response>> {
        let text = || RefOr::T(Schema::from(ObjectBuilder::new().schema_type(Type::String).build()));
        let error = HeaderBuilder::new().schema(Some(text())).description(Some(ERROR)).build();
        let mut file = ResponseBuilder::new().description("The exported file").header("Wavelume-Export-Error", error);
        for format in ExportFormat::ALL {
            let media_type = format.media_type();
            let is_text = media_type.starts_with("text/");
            let schema = if is_text { text() } else { Ref::from_schema_name(Binary::name()).into() };
            file = file.content(media_type, ContentBuilder::new().schema(Some(schema)).build());
        }
        let manifest = ContentBuilder::new().schema(Some(Ref::from_schema_name(ArrayManifest::name()))).build();
        let file = file.content("application/json", manifest).build();
        let known =
            ResponseBuilder::new().description("The content still has the entity tag of `If-None-Match`").build();
        BTreeMap::from([("200".to_owned(), file.into()), ("304".to_owned(), known.into())])
    }
}
