//! Description of the interface: the parts that utoipa derives from the handlers, and the problems of each operation.

use super::examples;
use super::flattened::{flatten, prune};
use super::needs::{Need, need};
use super::problem::{Kind, ProblemBody};
use super::schemas;
use std::collections::BTreeMap;
use utoipa::openapi::header::HeaderBuilder;
use utoipa::openapi::schema::{ObjectBuilder, Type};
use utoipa::openapi::security::{HttpAuthScheme, HttpBuilder, SecurityRequirement, SecurityScheme};
use utoipa::openapi::{ContentBuilder, Info, InfoBuilder, OpenApi, Ref, RefOr, Response, ResponseBuilder};
use utoipa::{PartialSchema, ToSchema};

/// Kinds of errors that every HTTP operation can return: an unaccepted host, a bad header, a key that a page of another
/// origin sends, a proxy in front of a service without keys, or a bug of the service.
const ALWAYS: &[Kind] = &[Kind::BadHeader, Kind::CrossOriginRead, Kind::Misdirected, Kind::PassedOn, Kind::Internal];
/// Kinds of errors of HTTP operations that need a key.
const GUARDED: &[Kind] = &[Kind::Unauthorized, Kind::MissingScope, Kind::TooManyRequests, Kind::Unavailable];
/// Names of the HTTP operations (health checks) that answer even when the service is at its limits.
const HEALTH: &[&str] = &["healthz", "readyz"];
/// Kinds of errors of all HTTP operations except health checks: too many simultaneous requests, in total or from one
/// address.
const BUSY: &[Kind] = &[Kind::Overloaded, Kind::TooManyAtOnce];
/// Kinds of errors peculiar to HTTP operations that change or compute something. The only one is a request from a web
/// page of another origin.
const WRITES: &[Kind] = &[Kind::CrossOrigin];
/// Kinds of errors of HTTP operations with a query string.
const QUERY: &[Kind] = &[Kind::BadQuery, Kind::LongQuery];
/// Kinds of errors of HTTP operations that read the catalog.
const CATALOG: &[Kind] = &[Kind::Unavailable];
/// Kinds of errors of HTTP operations on one resource, such as a job or a material.
const ONE: &[Kind] = &[Kind::NotFound];
/// Kinds of errors of HTTP operations that send stored bytes.
const BYTES: &[Kind] = &[Kind::RangeNotSatisfiable, Kind::Corrupt];
/// Kinds of errors of HTTP operations that open a material and compute values from it.
const OPENS: &[Kind] = &[Kind::UnfitQuery, Kind::Overloaded, Kind::Corrupt];
/// Kinds of errors of HTTP operations with a JSON request body.
const JSON: &[Kind] = &[
    Kind::BadBody,
    Kind::EmptyBody,
    Kind::InvalidRequest,
    Kind::TooLarge,
    Kind::TooSlow,
    Kind::UnsupportedMediaType,
    Kind::UnsupportedEncoding,
    Kind::Overloaded,
];
/// Kinds of errors of HTTP operations that take the bytes of a file.
const FILE: &[Kind] = &[
    Kind::BadBody,
    Kind::EmptyBody,
    Kind::InvalidRequest,
    Kind::TooLarge,
    Kind::DecompressionRatio,
    Kind::TooSlow,
    Kind::UnsupportedEncoding,
    Kind::Overloaded,
    Kind::Corrupt,
];
/// Kinds of errors of HTTP operations that store something.
const SPACE: &[Kind] = &[Kind::NoSpace];
/// Kinds of errors of HTTP operations that add to the stored data or the jobs of a tenant.
const ADDS: &[Kind] = &[Kind::QuotaExceeded];
/// Kinds of errors of uploads of a measurement, besides those of any file.
const MEASUREMENT: &[Kind] =
    &[Kind::Unrecognised, Kind::Malformed, Kind::Unsupported, Kind::OverLimit, Kind::NeedsOption, Kind::Spectrum];
/// Kinds of errors of uploads of a material, besides those of any file.
const MATERIAL: &[Kind] = &[Kind::MalformedMaterial, Kind::NotOfMeasurement, Kind::OverLimit, Kind::Spectrum];
/// Kinds of errors of HTTP operations on resumable uploads.
const TUS: &[Kind] = &[Kind::UnknownVersion];
/// Kinds of errors of HTTP operations that send bytes to a resumable upload.
const PART: &[Kind] = &[
    Kind::BadBody,
    Kind::ChecksumMismatch,
    Kind::OverLimit,
    Kind::TooLarge,
    Kind::TooSlow,
    Kind::UnsupportedEncoding,
    Kind::UnsupportedMediaType,
    Kind::WrongOffset,
];
/// Kinds of errors of HTTP operations that use one resumable upload.
const HOLDS: &[Kind] = &[Kind::NotFound, Kind::Gone, Kind::Locked];
/// Kinds of errors of HTTP operations that may take a resumable upload in place of a body.
const USES: &[Kind] = &[Kind::NotFound, Kind::Gone, Kind::Locked, Kind::IncompleteUpload];
/// Kinds of errors of batch evaluations, besides those of every JSON request body.
const BATCH: &[Kind] = &[Kind::NotAcceptable];
/// Kinds of errors of exports of a material to another file format.
const EXPORT: &[Kind] = &[Kind::NotAvailable, Kind::BadSetting, Kind::OverLimit];

/// Kinds of errors of each HTTP operation, by operation id, besides those common to all operations.
const OPERATIONS: &[(&str, &[&[Kind]])] = &[
    ("index", &[]),
    ("healthz", &[]),
    ("readyz", &[CATALOG, SPACE]),
    ("metrics_page", &[CATALOG]),
    ("openapi_json", &[]),
    ("post_measurement", &[WRITES, SPACE, QUERY, CATALOG, FILE, MEASUREMENT, USES, ADDS]),
    ("upload_options", &[]),
    ("create_upload", &[WRITES, SPACE, CATALOG, TUS, PART, HOLDS, ADDS]),
    ("get_upload_offset", &[CATALOG, TUS, HOLDS]),
    ("append_upload", &[WRITES, SPACE, CATALOG, TUS, PART, HOLDS]),
    ("delete_upload", &[WRITES, SPACE, CATALOG, TUS, ONE]),
    ("override_upload", &[WRITES, SPACE, CATALOG, TUS, PART, HOLDS]),
    ("list_measurements", &[QUERY, CATALOG]),
    ("get_measurement", &[ONE, CATALOG]),
    ("delete_measurement", &[WRITES, SPACE, ONE, CATALOG, &[Kind::InUse]]),
    ("get_measurement_content", &[ONE, CATALOG, BYTES]),
    ("post_job", &[WRITES, SPACE, CATALOG, JSON, &[Kind::BadSetting, Kind::KeyReused, Kind::TooManyJobs]]),
    ("list_jobs", &[QUERY, CATALOG]),
    ("get_job", &[ONE, CATALOG]),
    ("get_job_events", &[ONE, CATALOG]),
    ("cancel_job", &[WRITES, SPACE, ONE, CATALOG, &[Kind::JobFinished]]),
    ("retry_job", &[WRITES, SPACE, ONE, CATALOG, &[Kind::JobFinished, Kind::TooManyJobs]]),
    ("post_material", &[WRITES, SPACE, QUERY, CATALOG, FILE, MATERIAL, USES, ADDS]),
    ("list_materials", &[QUERY, CATALOG]),
    ("get_material", &[ONE, CATALOG]),
    ("delete_material", &[WRITES, SPACE, ONE, CATALOG]),
    ("change_material", &[WRITES, SPACE, ONE, CATALOG, JSON]),
    ("get_material_content", &[ONE, CATALOG, BYTES]),
    ("get_blob", &[ONE, CATALOG, BYTES]),
    ("get_spectrum", &[ONE, QUERY, CATALOG, OPENS]),
    ("get_albedo", &[ONE, QUERY, CATALOG, OPENS]),
    ("albedo", &[WRITES, ONE, QUERY, CATALOG, OPENS, JSON, BATCH]),
    ("evaluate", &[WRITES, ONE, QUERY, CATALOG, OPENS, JSON, BATCH]),
    ("pdf", &[WRITES, ONE, QUERY, CATALOG, OPENS, JSON, BATCH]),
    ("sample", &[WRITES, ONE, QUERY, CATALOG, OPENS, JSON, BATCH]),
    ("color", &[ONE, QUERY, CATALOG, OPENS]),
    ("physics", &[ONE, CATALOG, OPENS]),
    ("preview", &[ONE, QUERY, CATALOG, OPENS]),
    ("export", &[ONE, QUERY, CATALOG, OPENS, EXPORT]),
    ("list_tenants", &[CATALOG]),
    ("create_tenant", &[WRITES, SPACE, CATALOG, JSON, &[Kind::InUse]]),
    ("get_tenant", &[ONE, CATALOG]),
    ("change_tenant", &[WRITES, SPACE, ONE, CATALOG, JSON, &[Kind::InUse]]),
    ("list_formats", &[]),
    ("get_template", &[ONE]),
    ("list_bases", &[]),
    ("create_key", &[WRITES, SPACE, CATALOG, JSON, ADDS]),
    ("list_keys", &[QUERY, CATALOG]),
    ("revoke_key", &[WRITES, SPACE, ONE, CATALOG]),
    ("list_audit", &[QUERY, CATALOG]),
];

/// Name of the security scheme in the OpenAPI description.
const SCHEME: &str = "key";

/// Returns the title, version and introduction of the OpenAPI description.
pub(super) fn info() -> Info {
    InfoBuilder::new()
        .title("wavelume")
        .version(env!("CARGO_PKG_VERSION"))
        .description(Some(
            "Acquired radiometric measurements, compressed with generic wavelet transforms to a promised error. \
             Angles are degrees, wavelengths nm, digests `b3-<64 hex>` (BLAKE3); errors are RFC 9457 problems. \
             A request for a host that the service does not serve (`Host`, `:authority`) gets 421; every response has a \
             `Request-Id`.",
        ))
        .build()
}

/// Completes the OpenAPI description: adds the error responses and the needed scope of each operation, and the schemas
/// that no handler registers.
pub(super) fn complete(mut openapi: OpenApi) -> OpenApi {
    for (path, item) in &mut openapi.paths.paths {
        let operations = [
            ("GET", &mut item.get),
            ("HEAD", &mut item.head),
            ("POST", &mut item.post),
            ("PATCH", &mut item.patch),
            ("DELETE", &mut item.delete),
            ("OPTIONS", &mut item.options),
        ];
        for (method, operation) in operations {
            let Some(operation) = operation else { continue };
            examples::add(operation);
            let need = need(method, path).unwrap_or(Need::Instance);
            let name = operation.operation_id.as_deref().unwrap_or_default();
            for (status, kinds) in problems(name, need) {
                operation.responses.responses.insert(status.to_string(), RefOr::T(answer(status, &kinds)));
            }
            if need != Need::Public {
                // A service without keys needs none.
                let none = SecurityRequirement::default();
                operation.security = Some(vec![none, SecurityRequirement::new(SCHEME, [need.name()])]);
            }
        }
    }
    let components = openapi.components.get_or_insert_default();
    components.schemas.insert(ProblemBody::name().into_owned(), ProblemBody::schema());
    components.schemas.extend(schemas::all());
    let scheme = HttpBuilder::new().scheme(HttpAuthScheme::Bearer).description(Some(
        "A key (`wlm_…`), or a token (`wlt_…`) that was made from one, in the header `Authorization: Bearer …`. A service \
         that runs without keys ignores it. Operations name the scope that the key needs.",
    ));
    components.add_security_scheme(SCHEME, SecurityScheme::Http(scheme.build()));
    flatten(components);
    prune(&mut openapi);
    openapi
}

/// Returns the kinds of errors that an HTTP operation can return, grouped by HTTP status.
fn problems(operation: &str, need: Need) -> BTreeMap<u16, Vec<Kind>> {
    let own = OPERATIONS.iter().find(|(name, _)| *name == operation).map_or(&[][..], |(_, kinds)| kinds);
    let mut problems: BTreeMap<u16, Vec<Kind>> = BTreeMap::new();
    let busy = if HEALTH.contains(&operation) { &[][..] } else { BUSY };
    let guarded = if need == Need::Public { &[][..] } else { GUARDED };
    for &kind in [ALWAYS, busy, guarded].iter().chain(own).flat_map(|kinds| kinds.iter()) {
        let kinds = problems.entry(kind.status().as_u16()).or_default();
        if !kinds.contains(&kind) {
            kinds.push(kind);
        }
    }
    problems
}

fn answer(status: u16, kinds: &[Kind]) -> Response {
    let lines: Vec<String> = kinds.iter().map(|kind| format!("`{}`: {}", kind.code(), kind.title())).collect();
    let schema = Ref::from_schema_name(ProblemBody::name());
    let content = ContentBuilder::new().schema(Some(schema)).build();
    let mut answer = ResponseBuilder::new().description(lines.join("; ")).content("application/problem+json", content);
    let mut header = |name: &str, description: &str, kind: Type| {
        let header = HeaderBuilder::new()
            .schema(Some(ObjectBuilder::new().schema_type(kind).build()))
            .description(Some(description))
            .build();
        let before = std::mem::take(&mut answer);
        answer = before.header(name, header);
    };
    match status {
        429 | 503 => header("Retry-After", "Seconds to wait before repeating the request", Type::Integer),
        401 => header(
            "WWW-Authenticate",
            "Kind of authentication that the service expects: `Bearer realm=\"wavelume\"`",
            Type::String,
        ),
        416 => header("Content-Range", "Size of the whole content, as `bytes */SIZE`", Type::String),
        _ => {}
    }
    answer.build()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_operation_has_its_problems_and_every_table_entry_is_an_operation() {
        let openapi = crate::api::openapi();
        let paths = openapi.paths.paths.values();
        let operations = paths
            .flat_map(|path| [&path.get, &path.head, &path.post, &path.delete, &path.put, &path.patch, &path.options])
            .flatten();
        let mut found: Vec<&str> =
            operations.clone().map(|operation| operation.operation_id.as_deref().unwrap()).collect();
        let mut described: Vec<&str> = OPERATIONS.iter().map(|(name, _)| *name).collect();
        found.sort_unstable();
        described.sort_unstable();
        assert_eq!(found, described);
        for operation in operations {
            assert!(operation.responses.responses.keys().all(|status| status.parse::<u16>().is_ok()), "no `default`");
        }
    }

    #[test]
    fn every_schema_that_is_named_is_there() {
        let openapi = crate::api::openapi();
        let text = openapi.to_json().unwrap();
        let schemas = &openapi.components.unwrap().schemas;
        let names = text.split("\"#/components/schemas/").skip(1).map(|rest| rest.split('"').next().unwrap());
        for name in names {
            assert!(schemas.contains_key(name), "{name}");
        }
    }
}
