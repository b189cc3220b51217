//! Schemas of words and numbers whose own types know nothing of OpenAPI: enumerations, patterns and limits.

use super::extract::LONGEST_WORD;
use super::page::{LONGEST_PAGE, USUAL_PAGE};
use crate::domain::colour::{Illuminant, StandardObserver};
use crate::export::ExportFormat;
use std::borrow::Cow;
use utoipa::openapi::schema::{ArrayBuilder, ObjectBuilder, OneOfBuilder, Schema, Type};
use utoipa::openapi::{KnownFormat, Ref, RefOr, SchemaFormat};
use utoipa::{PartialSchema, ToSchema};

/// Regular expression of a digest in text form.
const DIGEST: &str = "b3-[0-9a-f]{64}";
/// Regular expression of a decimal number without a sign.
const NUMBER: &str = r"[0-9]{1,6}(\.[0-9]{1,12})?";

/// Regular expression of a decimal number above 0.
const POSITIVE: &str = r"([1-9][0-9]{0,4}(\.[0-9]{1,6})?|0\.0{0,3}[1-9][0-9]{0,4})";

/// Upper bound on the characters of the header `Idempotency-Key`.
pub(super) const LONGEST_REQUEST_KEY: usize = 255;

macro_rules! described {
    ($($(#[$doc:meta])* $type:ident = $name:literal, $schema:expr;)+) => {
        $(
            $(#[$doc])*
            #[derive(Debug)]
            pub(crate) struct $type;

            impl PartialSchema for $type {
                fn schema() -> RefOr<Schema> {
                    $schema.into()
                }
            }

            impl ToSchema for $type {
                fn name() -> Cow<'static, str> {
                    Cow::Borrowed($name)
                }
            }
        )+

        /// Returns every hand-written OpenAPI schema with its name.
        pub(super) fn all() -> Vec<(String, RefOr<Schema>)> {
            vec![$(($type::name().into_owned(), $type::schema())),+]
        }
    };
}

described! {
    /// Schema of the id of a tenant.
    TenantText = "TenantId", text("1 to 40 of a–z, 0–9 and `-`, the first one a letter.")
        .pattern(Some("^[a-z][a-z0-9-]{0,39}$"));
    /// Schema of the parameter that chooses whose materials are listed.
    VisibleText = "Visible", one_of("Whose materials are listed.", ["own", "shared", "public"]);
    /// Schema of the header `Idempotency-Key`.
    RequestKey = "RequestKey", text("Key that a client makes for one request and its repetitions.")
        .min_length(Some(1)).max_length(Some(LONGEST_REQUEST_KEY)).pattern(Some("^[!-~]([ -~]*[!-~])?$"));
    /// Schema of the id of a job.
    JobIdText = "JobId", text("UUID of a job.")
        .pattern(Some("^[0-9a-f]{8}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{12}$"));
    /// Schema of the version of the protocol of resumable uploads.
    TusVersion = "TusVersion", one_of("Version of the protocol of resumable uploads.", ["1.0.0"]);
    /// Schema of the method that a request with `POST` to a resumable upload carries out.
    OverridingMethod = "OverridingMethod", one_of("Method that the request carries out.", ["PATCH", "DELETE"]);
    /// Schema of the id of a resumable upload.
    UploadIdText = "UploadId", text("Id of an upload: 32 lower-case hexadecimal digits.").pattern(Some("^[0-9a-f]{32}$"));
    /// Schema of the public id of an access key.
    KeyIdText = "KeyId", text("Id of an access key: 10 digits and lower-case letters without i, l, o and u.")
        .pattern(Some("^[0-9a-hjkmnp-tv-z]{10}$"));
    /// Schema of a cursor, the value `next` of a page of a list.
    CursorText = "Cursor", text("Value `next` of an earlier answer.").pattern(Some(r"^[0-9a-f]{1,15}\.[0-9a-z-]{1,80}$"));
    /// Schema of the number of items on a page of a list.
    PageSize = "PageSize", ObjectBuilder::new()
        .schema_type(Type::Integer)
        .minimum(Some(1))
        .maximum(Some(LONGEST_PAGE))
        .default(Some(USUAL_PAGE.into()))
        .description(Some("Largest number of items on a page of a list."));
    /// Schema of a text by which a list is filtered.
    Word = "Word", text("Text to filter a list by; U+0000 is refused.")
        .max_length(Some(LONGEST_WORD)).pattern(Some(r"^[^\x00]*$"));
    /// Schema of the name of an export's file format, or `manifest` for the description of an exported array.
    ExportName = "ExportFormat", one_of(
        "Name of a format that can be written, or `manifest`.",
        ExportFormat::ALL.iter().map(|known| known.name()).chain(["manifest"]),
    );
    /// Schema of the illuminant of a query: a standard name or the id of a stored spectrum.
    IlluminantText = "IlluminantOrId", named("An illuminant, or the id of a stored spectrum.",
        Illuminant::ALL.iter().map(|known| known.name()));
    /// Schema of the observer of a query: a standard name or the id of a stored table.
    ObserverText = "ObserverOrId", named("An observer, or the id of a stored table of x̄, ȳ, z̄.",
        StandardObserver::ALL.iter().map(|known| known.name()));
    /// Schema of a direction in a query string, as text.
    DirectionText = "DirectionText", text("`θ,φ` in degrees, θ from 0 to 180.").pattern(Some(
        format!(r"^(180|(1[0-7][0-9]|[1-9]?[0-9])(\.[0-9]{{1,12}})?),-?{NUMBER}$"),
    )).examples(["30,90"]);
    /// Schema of the positions on the index axes (tensor axes before the directions) that a query selects.
    IndexText = "IndexText", text("One entry, from 0, for each leading index axis: `I,J`.")
        .pattern(Some("^[0-9]{1,7}(,[0-9]{1,7}){0,7}$")).examples(["0"]);
    /// Schema of the wavelengths in a query string, as text.
    WavelengthsText = "WavelengthsText", text("`A,B,C` or `START:STOP:STEP` in nm.").pattern(Some(
        format!("^({POSITIVE}(,{POSITIVE})*|{POSITIVE}:{POSITIVE}:{POSITIVE})$"),
    )).examples(["400,550.5,700", "380:720:10"]);
    /// Schema of a direction in JSON: polar angle θ and azimuth φ in degrees.
    Angles = "Direction", ArrayBuilder::new()
        .description(Some("`[θ, φ]` in degrees."))
        .prefix_items([
            Schema::from(number().minimum(Some(0.0)).maximum(Some(180.0))),
            Schema::from(number()),
        ])
        .items(number())
        .min_items(Some(2))
        .max_items(Some(2));
    /// Schema of a direction of a luminaire in JSON: azimuth C and angle gamma from straight down in degrees.
    LuminaireAngles = "LuminaireDirection", ArrayBuilder::new()
        .description(Some("`[C, gamma]` in degrees."))
        .prefix_items([
            Schema::from(number()),
            Schema::from(number().minimum(Some(0.0)).maximum(Some(180.0))),
        ])
        .items(number())
        .min_items(Some(2))
        .max_items(Some(2));
    /// Schema of one or several directions in JSON, each a polar angle θ and an azimuth φ in degrees.
    OneOrMoreAngles = "Directions", OneOfBuilder::new()
        .description(Some("`[θ, φ]` in degrees or a list of such."))
        .item(Ref::from_schema_name(Angles::name()))
        .item(ArrayBuilder::new().items(Ref::from_schema_name(Angles::name())).min_items(Some(1)));
    /// Schema of a request or response body of arbitrary bytes.
    Binary = "Bytes", ObjectBuilder::new()
        .schema_type(Type::String)
        .format(Some(SchemaFormat::KnownFormat(KnownFormat::Binary)))
        .description(Some("Bytes of a file."));
    /// Schema of a form with one file, as `curl -F file=@…` and web pages send it.
    FileForm = "FileForm", ObjectBuilder::new()
        .description(Some("A form with one file. Its field may have any name."))
        .property("file", Ref::from_schema_name(Binary::name()))
        .required("file");
    /// Schema of a server-sent event.
    EventText = "Event", ObjectBuilder::new()
        .description(Some("A server-sent event: `state` with a job, or `progress` with `{\"progress\": 0.5}`."))
        .property("event", one_of("Type of the event.", ["state", "progress"]))
        .property("data", text("JSON text of the job or of the progress."))
        .required("event")
        .required("data");
    /// Schema of the answer that contains the OpenAPI document of this HTTP interface.
    Described = "OpenApi", ObjectBuilder::new()
        .description(Some("OpenAPI 3.1 document."))
        .property("openapi", text("Version of OpenAPI."))
        .required("openapi");
    /// Schema of a body with one JSON object per line.
    Lines = "Lines", text("JSON objects, one on each line.");
}

fn text(description: &str) -> ObjectBuilder {
    ObjectBuilder::new().schema_type(Type::String).description(Some(description))
}

fn number() -> ObjectBuilder {
    ObjectBuilder::new().schema_type(Type::Number)
}

fn one_of(description: &str, names: impl IntoIterator<Item = &'static str>) -> ObjectBuilder {
    text(description).enum_values(Some(names.into_iter().collect::<Vec<_>>()))
}

fn named(description: &str, names: impl IntoIterator<Item = &'static str>) -> ObjectBuilder {
    let names: Vec<&str> = names.into_iter().collect();
    text(description).pattern(Some(format!("^({}|{DIGEST})$", names.join("|"))))
}
