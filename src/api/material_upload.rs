//! `POST /v1/materials`: a material that was made elsewhere.

use super::caller::Caller;
use super::expiring::ended;
use super::extract::{Query, check_upload_id, linger};
use super::materials::Material;
use super::places::KIB;
use super::problem::{Kind, Problem};
use super::resumable;
use super::schemas::{Binary, FileForm, UploadIdText};
use super::state::{App, Service};
use super::upload::Received;
use super::upload_query::UPLOAD;
use crate::catalog::MaterialRow;
use crate::jobs::{MaterialUpload, Tags, Text};
use crate::store::{Digest, Staged};
use axum::Json;
use axum::extract::{FromRequestParts, Request};
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::de::Error;
use serde::{Deserialize, Deserializer};
use utoipa::IntoParams;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// HTTP routes of uploads of materials.
pub(crate) fn routes() -> OpenApiRouter<Service> {
    OpenApiRouter::new().routes(routes!(post_material))
}

/// Names that a client gives with an uploaded material, read from a query string.
#[derive(Debug, PartialEq)]
struct MaterialQuery(MaterialUpload, Option<String>);

/// Types of the query parameters of an uploaded material, for the OpenAPI description.
#[derive(IntoParams)]
#[into_params(parameter_in = Query)]
#[allow(dead_code, reason = "describes the query")]
struct Types {
    /// Name of the material.
    #[param(value_type = Option<Text>)]
    name: Option<String>,
    /// Licence of the material.
    #[param(value_type = Option<Text>)]
    licence: Option<String>,
    /// Tag of the material; may be repeated.
    #[param(value_type = Tags, required = false, explode = true)]
    tags: Vec<String>,
    /// Id of the stored measurement that the material was made from; may be repeated. Default: the stored measurements
    /// whose bytes have the digest that the file states.
    #[param(required = false, max_items = 8, explode = true)]
    measurement: Vec<Digest>,
    /// Id of a complete resumable upload, which takes the place of the body and is gone afterwards. A request that is
    /// refused leaves the upload.
    #[param(value_type = Option<UploadIdText>)]
    upload: Option<String>,
}

impl<'de> Deserialize<'de> for MaterialQuery {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        read(Vec::deserialize(deserializer)?).map(|(upload, id)| Self(upload, id)).map_err(D::Error::custom)
    }
}

/// Reads the parameters of an upload. The error names the parameter.
fn read(pairs: Vec<(String, String)>) -> Result<(MaterialUpload, Option<String>), String> {
    let (mut upload, mut resumable) = (MaterialUpload::default(), None);
    for (key, value) in pairs {
        let once = match key.as_str() {
            "name" => upload.name.replace(value).is_none(),
            "licence" => upload.licence.replace(value).is_none(),
            "tags" => {
                upload.tags.push(value);
                true
            }
            "measurement" => {
                let id = value.parse().map_err(|error| format!("measurement: {error}"))?;
                if !upload.measurements.contains(&id) {
                    upload.measurements.push(id);
                }
                true
            }
            UPLOAD => {
                check_upload_id(&value)?;
                resumable.replace(value).is_none()
            }
            _ => {
                return Err(format!(
                    "unknown field `{key}`, expected one of name, licence, tags, measurement, {UPLOAD}"
                ));
            }
        };
        if !once {
            return Err(format!("duplicate field `{key}`"));
        }
    }
    upload.check()?;
    Ok((upload, resumable))
}

/// Upload a material that was made elsewhere, for example by `wavelume compress`.
///
/// The file is decoded completely. If its measurement is stored, the errors are measured again, and a material with
/// larger errors than it states is refused.
#[utoipa::path(
    post, path = "/v1/materials", tag = "materials", params(Types),
    request_body(content((Binary = "application/vnd.wavelume.material"), (FileForm = "multipart/form-data")),
        description = "The bytes of the file (.wlm), or a form (`multipart/form-data`) with one file. `Content-Encoding: gzip` and \
                       `zstd` are decoded; any other `Content-Type` is ignored"),
    responses(
        (status = 201, description = "New material", body = Material, headers(("Location" = String, description = "URL of the material"))),
        (status = 200, description = "The material was stored before; the names, tags and measurements of this upload are added to it", body = Material,
            headers(("Location" = String, description = "URL of the material"))),
    )
)]
async fn post_material(app: App, caller: Caller, request: Request) -> Result<Response, Problem> {
    let start = std::time::Instant::now();
    let (mut parts, body) = request.into_parts();
    let stated = Query::<MaterialQuery>::from_request_parts(&mut parts, &app).await;
    let request = Request::from_parts(parts, body);
    let (upload, id) = match stated {
        Ok(Query(MaterialQuery(upload, id))) => (upload, id),
        Err(problem) => {
            linger(request).await;
            return Err(problem);
        }
    };
    let (Received { staged, lines, .. }, used) = resumable::receive(&app, id.as_deref(), request).await?;
    let bytes = staged.bytes();
    let ingested = ingest(&app, &caller, staged, upload).await;
    if let Some(used) = used {
        used.end(&app, ingested.is_ok()).await;
    }
    let (row, new) = ingested.map_err(|problem| lines.explain(problem))?;
    metrics::counter!("wavelume_uploaded_bytes_total").increment(bytes);
    let duration_ms = start.elapsed().as_millis() as u64;
    tracing::info!(material = %row.id, bytes, new, measured = row.measurements.len(), duration_ms, "material uploaded");
    let status = if new { StatusCode::CREATED } else { StatusCode::OK };
    let location = HeaderValue::from_str(&format!("/v1/materials/{}", row.id)).ok();
    let mut response = (status, Json(Material::of(row)?)).into_response();
    response.headers_mut().extend(location.map(|value| (header::LOCATION, value)));
    Ok(response)
}

/// Checks and stores an uploaded file, within the memory that its client may use for that. The work goes on if the
/// client leaves, holds its memory until it has ended, and ends with the rights of the caller.
async fn ingest(
    app: &App,
    caller: &Caller,
    staged: Staged,
    upload: MaterialUpload,
) -> Result<(MaterialRow, bool), Problem> {
    let (staged, memory) = app.engine.material_memory(staged).await?;
    let most = app.engine.limits.checking_bytes_each.min(app.engine.limits.checking_bytes);
    let over_limit = move |memory: u64| {
        let detail = format!("checking the material takes {memory} bytes of memory, the limit is {most}");
        Problem::new(Kind::OverLimit, detail)
    };
    if memory > most as u64 {
        return Err(over_limit(memory));
    }
    let (client, watched) = (caller.client(), caller.watched());
    let mut place = app.held.checking.take(client.clone(), (memory as usize).div_ceil(KIB).min(most / KIB))?;
    let app = app.clone();
    let work = tokio::spawn(client.on_behalf(async move {
        let (mut total, mut refused) = (memory, None);
        let mut more = |bytes: u64| {
            total = total.saturating_add(bytes);
            let grown = if total > most as u64 {
                Err(over_limit(total))
            } else {
                place.grow((bytes as usize).div_ceil(KIB)).map_err(Problem::from)
            };
            grown.map_err(|problem| refused = Some(problem)).is_ok()
        };
        let ingested = tokio::select! {
            ingested = app.engine.ingest_material(staged, upload, &mut more) => ingested,
            problem = ended(&app, watched) => return Err(problem),
        };
        drop(place);
        match refused {
            Some(problem) => Err(problem),
            None => Ok(ingested?),
        }
    }));
    work.await.unwrap_or_else(|error| Err(Problem::internal(&error)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn query(text: &str) -> Result<MaterialUpload, String> {
        let uri = format!("/?{text}").parse().unwrap();
        axum::extract::Query::<MaterialQuery>::try_from_uri(&uri)
            .map(|axum::extract::Query(MaterialQuery(upload, _))| upload)
            .map_err(|rejection| rejection.body_text())
    }

    #[test]
    fn names_and_measurements_are_read() {
        let id = Digest::of(b"lamp");
        let upload = query(&format!("name=Lamp&tags=a&tags=b,c&licence=CC0-1.0&measurement={id}&measurement={id}"));
        let upload = upload.unwrap();
        assert_eq!((upload.name.as_deref(), upload.licence.as_deref()), (Some("Lamp"), Some("CC0-1.0")));
        assert_eq!((upload.tags, upload.measurements), (vec!["a".to_owned(), "b,c".to_owned()], vec![id]));
        assert_eq!(query("").unwrap(), MaterialUpload::default());
        for (text, reason) in [
            ("tag=a", "unknown field `tag`, expected one of name"),
            ("name=a&name=b", "duplicate field `name`"),
            ("measurement=b3-1", "measurement: `b3-1` is no digest"),
            ("tags=", "a tag of 0 characters"),
        ] {
            let refusal = query(text).unwrap_err();
            assert!(refusal.contains(reason), "{text}: {refusal}");
        }
        let many: Vec<String> = (0..9_u8).map(|i| format!("measurement={}", Digest::of(&[i]))).collect();
        assert!(query(&many.join("&")).unwrap_err().contains("9 measurements, expected at most 8"));
    }
}
