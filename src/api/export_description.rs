//! Description of the export of a material: its parameters and its answers, made from the table of writers.

use super::schemas::{Binary, ExportName, IndexText};
use crate::export::{ExportFormat, format_help, option_help};
use crate::formats::ArrayManifest;
use std::collections::BTreeMap;
use utoipa::openapi::path::{Parameter, ParameterIn};
use utoipa::openapi::{
    ContentBuilder, HeaderBuilder, ObjectBuilder, Ref, RefOr, Response, ResponseBuilder, Schema, schema::Type,
};
use utoipa::{IntoParams, IntoResponses, ToSchema};

/// Types of the query parameters with which a material is exported, for the OpenAPI description.
#[derive(IntoParams)]
#[into_params(parameter_in = Query)]
#[allow(dead_code, reason = "describes the query")]
struct Types {
    #[param(value_type = ExportName)]
    format: String,
    /// Zero-based position of the exported entry on each leading index axis (columns of a table, scan positions):
    /// `I,J`. Not allowed for `npy` and `manifest`, which contain every entry.
    #[param(value_type = Option<IndexText>)]
    index: Option<String>,
    side: Option<u32>,
    step: Option<f64>,
    rgb: Option<bool>,
    wavelength: Option<f64>,
}

/// Parameters of an export.
pub(super) struct ExportParams;

impl IntoParams for ExportParams {
    fn into_params(parameter_in: impl Fn() -> Option<ParameterIn>) -> Vec<Parameter> {
        let mut parameters = Types::into_params(parameter_in);
        for parameter in &mut parameters {
            let described = match parameter.name.as_str() {
                "format" => Some(format!("{}; `manifest` is the manifest of an array alone.", format_help())),
                option => option_help(option),
            };
            parameter.description = described.or(parameter.description.take());
        }
        parameters
    }
}

/// HTTP responses to a request that exports a material, for the OpenAPI description: the exported file, or status 304
/// without content.
pub(super) struct ExportedFile;

/// Text on the response header `Wavelume-Export-Error` in the OpenAPI description. The header states the error that an
/// export adds to a material.
const ERROR: &str = "Error that the file adds to the error of the material, measured on its bytes: er_l2, er_l1, max (relative errors), \
                     relative_rmse, pairs (number of compared pairs of directions), of (kind of the compared values), and for \
                     luminaires peak, flux (both relative), rms_of_peak and er_l2_bright (over intensities above 1 % of the peak)";

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
