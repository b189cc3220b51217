//! Two tenants of one service: neither learns anything of the other's data.

use super::access::Access;
use super::caller::Caller;
use super::content_cache::Contents;
use super::figures::Durations;
use super::front::Front;
use super::guard::{AuthMode, Guard};
use super::rates::Rates;
use super::remembered::Remembered;
use super::router::openapi;
use super::state::{App, Held, Shared};
use crate::catalog::testing;
use crate::jobs::{Engine, Site, WorkConfig, run_workers};
use crate::store::{Digest, contract};
use axum::body::{Body, to_bytes};
use axum::extract::Request;
use axum::http::{HeaderMap, StatusCode, header};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::sync::Arc;
use tokio_util::sync::CancellationToken;
use tokio_util::task::AbortOnDropHandle;

const SPECTRUM: &str = "wavelength,a\n400,1\n410,2\n420,3\n430,2\n440,1\n";

/// Header in which a test names the tenant that sends a request.
const TENANT: &str = "x-tenant";

/// Service with two tenants, `one` and `two`, and a worker that runs their jobs.
struct Desk {
    front: Front,
    stop: CancellationToken,
    _working: AbortOnDropHandle<()>,
}

/// Status, headers and body of an answer of the service. The headers with the date and the request id are left out.
#[derive(Clone, Debug, PartialEq)]
struct Answer {
    status: StatusCode,
    headers: Vec<(String, String)>,
    body: String,
}

impl Answer {
    /// Returns the answer with the identifier `id` replaced by `ID` wherever it occurs.
    fn without(mut self, id: &str) -> Self {
        let replaced = |text: &str| text.replace(id, "ID");
        for (_, value) in &mut self.headers {
            *value = replaced(value);
        }
        self.body = replaced(&self.body);
        self
    }

    fn json(&self) -> Value {
        serde_json::from_str(&self.body).unwrap_or_else(|error| panic!("{error}: {self:?}"))
    }

    fn text(&self, key: &str) -> String {
        self.json()[key].as_str().unwrap_or_else(|| panic!("{key}: {self:?}")).to_owned()
    }

    fn header(&self, name: &str) -> Option<&str> {
        self.headers.iter().find(|(known, _)| known == name).map(|(_, value)| value.as_str())
    }
}

/// Makes a request one of the tenant that its header [`TENANT`] names.
fn as_tenant(mut request: Request) -> Request {
    if let Some(tenant) = request.headers_mut().remove(TENANT) {
        let tenant = tenant.to_str().unwrap().parse().unwrap();
        request.extensions_mut().insert(Caller::of_tenant(tenant));
    }
    request
}

/// Builds a `GET` request of a tenant.
fn get(tenant: &str, uri: &str) -> Request {
    asks(tenant, "GET", uri, &[], "")
}

fn asks(tenant: &str, method: &str, uri: &str, headers: &[(&str, &str)], body: &str) -> Request {
    let mut request = Request::builder().method(method).uri(uri).header(header::HOST, "localhost");
    if !tenant.is_empty() {
        request = request.header(TENANT, tenant);
    }
    for (name, value) in headers {
        request = request.header(*name, *value);
    }
    request.body(Body::from(body.to_owned())).unwrap()
}

const JSON: (&str, &str) = ("content-type", "application/json");
const TUS: (&str, &str) = ("tus-resumable", "1.0.0");

impl Desk {
    async fn open(site: &Site) -> Self {
        let mut config = WorkConfig::new(&site.data);
        (config.site, config.workers) = (site.clone(), 1);
        let engine = Engine::open(&config).await.unwrap();
        for id in ["one", "two"] {
            testing::other(&engine.archive.catalog, id).await;
        }
        let access = Access::new(([127, 0, 0, 1], 0).into(), false, &[], &[]).unwrap();
        let stop = CancellationToken::new();
        let shared = Shared {
            writing: tokio_util::task::TaskTracker::new(),
            held: Held::new(&engine.limits),
            rates: Rates::new(),
            contents: Contents::new(engine.limits.content_bytes),
            remembered: Remembered::new(),
            access: Arc::new(access),
            guard: Guard::new(AuthMode::Off, false, &engine.limits),
            stopping: stop.clone(),
            stop: stop.clone(),
            durations: Durations::default(),
            metrics: None,
            openapi: super::router::openapi_json,
        };
        let app = App::new(Arc::clone(&engine), shared);
        let working = stop.clone();
        let working = tokio::spawn(async move { run_workers(&engine, 1, &working).await });
        Self { front: Front::new(app), stop, _working: AbortOnDropHandle::new(working) }
    }

    async fn answer(&self, request: Request) -> Answer {
        let response = self.front.answer(as_tenant(request)).await;
        let status = response.status();
        let told = |headers: &HeaderMap| {
            let mut told: Vec<_> = headers
                .iter()
                .filter(|(name, _)| !matches!(name.as_str(), "request-id" | "date"))
                .map(|(name, value)| (name.to_string(), value.to_str().unwrap().to_owned()))
                .collect();
            told.sort();
            told
        };
        let headers = told(response.headers());
        let body = to_bytes(response.into_body(), 1 << 24).await.unwrap();
        Answer { status, headers, body: String::from_utf8_lossy(&body).into_owned() }
    }

    /// Sends a request, checks that the answer has the given status, and returns the answer.
    async fn done(&self, status: u16, request: Request) -> Answer {
        let about = format!("{} {}", request.method(), request.uri());
        let answer = self.answer(request).await;
        assert_eq!(answer.status, status, "{about}: {answer:?}");
        answer
    }

    /// Uploads a measurement and returns its id.
    async fn measurement(&self, tenant: &str, text: &str) -> String {
        let upload = asks(tenant, "POST", "/v1/measurements?quantity=spectrum&filename=a.csv", &[], text);
        self.done(201, upload).await.text("id")
    }

    /// Runs a job to its end, and returns it.
    async fn job(&self, tenant: &str, request: &Value) -> Value {
        let headers = [JSON, ("prefer", "wait=60"), ("idempotency-key", "the same of both")];
        let headers = if request.get("kind").is_some() { &headers[..2] } else { &headers[..] };
        let job = self.done(200, asks(tenant, "POST", "/v1/jobs", headers, &request.to_string())).await.json();
        assert_eq!(job["state"], "succeeded", "{job}");
        job
    }
}

/// Identifiers of all stored things, jobs and uploads that a test has made for one tenant.
struct Owned {
    measurement: String,
    material: String,
    report: String,
    job: String,
    upload: String,
    /// Id of a job that waits in the queue.
    waiting: String,
}

impl Owned {
    async fn of(desk: &Desk, tenant: &str) -> Self {
        let measurement = desk.measurement(tenant, SPECTRUM).await;
        let job = desk.job(tenant, &json!({ "measurement": measurement, "target": { "er_l2": 0.01 } })).await;
        let report = desk.job(tenant, &json!({ "kind": "paper", "tables": [2] })).await;
        let text = |job: &Value, key: &str| job[key].as_str().unwrap().to_owned();
        let begun = asks(tenant, "POST", "/v1/uploads", &[TUS, ("upload-length", "5")], "");
        let begun = desk.done(201, begun).await;
        let upload = begun.header("location").unwrap().rsplit('/').next().unwrap().to_owned();
        // Larger than one batch, so that it is behind whatever runs.
        let waiting = json!({ "kind": "paper", "tables": [2], "priority": 1 }).to_string();
        let waiting = desk.answer(asks(tenant, "POST", "/v1/jobs", &[JSON], &waiting)).await.text("id");
        Self {
            material: text(&job, "material"),
            report: text(&report, "report"),
            job: text(&job, "id"),
            measurement,
            upload,
            waiting,
        }
    }

    /// Returns the identifiers by kind: digests, ids of jobs, ids of uploads.
    fn ids(&self) -> [Vec<&str>; 3] {
        [vec![&self.measurement, &self.material, &self.report], vec![&self.job, &self.waiting], vec![&self.upload]]
    }
}

/// Identifiers that exist nowhere, one of each kind in [`Owned::ids`].
fn nowhere() -> [String; 3] {
    [
        Digest::of(b"exists nowhere").to_string(),
        "018f0000-0000-7000-8000-000000000000".to_owned(),
        "0123456789abcdef0123456789abcdef".to_owned(),
    ]
}

/// Request that names a thing by its identifier, `ID`: kind of the identifier (as an index into [`Owned::ids`]),
/// method, address, headers and body.
type Ask = (usize, &'static str, &'static str, &'static [(&'static str, &'static str)], &'static str);

const LINES: (&str, &str) = ("content-type", "application/x-ndjson");
const FLOATS: (&str, &str) = ("content-type", "application/octet-stream");
const PART: (&str, &str) = ("content-type", "application/offset+octet-stream");
const ANY: (&str, &str) = ("if-none-match", "*");
const RANGE: (&str, &str) = ("range", "bytes=0-0");

/// Requests that name a thing by its identifier in the path, one for each way to do so.
const PATHS: &[Ask] = &[
    (0, "GET", "/v1/measurements/ID", &[], ""),
    (0, "DELETE", "/v1/measurements/ID", &[], ""),
    (0, "GET", "/v1/measurements/ID/content", &[], ""),
    (0, "GET", "/v1/measurements/ID/content", &[ANY], ""),
    (0, "GET", "/v1/materials/ID", &[], ""),
    (0, "DELETE", "/v1/materials/ID", &[], ""),
    (0, "PATCH", "/v1/materials/ID", &[JSON], "{\"visibility\":\"public\"}"),
    (0, "GET", "/v1/materials/ID/content", &[], ""),
    (0, "GET", "/v1/materials/ID/content", &[ANY], ""),
    (0, "GET", "/v1/materials/ID/content", &[RANGE], ""),
    (0, "GET", "/v1/materials/ID/spectrum", &[], ""),
    (0, "GET", "/v1/materials/ID/spectrum?wavelengths=400,410", &[], ""),
    (0, "GET", "/v1/materials/ID/albedo", &[], ""),
    (0, "POST", "/v1/materials/ID/albedo", &[JSON], "{}"),
    (0, "POST", "/v1/materials/ID/evaluate", &[JSON], "{}"),
    (0, "POST", "/v1/materials/ID/evaluate", &[LINES], "{}\n{}\n"),
    (0, "POST", "/v1/materials/ID/evaluate", &[FLOATS], "12345678"),
    (0, "POST", "/v1/materials/ID/pdf", &[JSON], "{\"wo\":[[0,0]]}"),
    (0, "POST", "/v1/materials/ID/sample", &[JSON], "{}"),
    (0, "GET", "/v1/materials/ID/color", &[], ""),
    (0, "GET", "/v1/materials/ID/physics", &[], ""),
    (0, "GET", "/v1/materials/ID/preview.png", &[], ""),
    (0, "GET", "/v1/materials/ID/preview.png", &[ANY], ""),
    (0, "GET", "/v1/materials/ID/export?format=npy", &[], ""),
    (0, "GET", "/v1/materials/ID/export?format=npy", &[ANY], ""),
    (0, "GET", "/v1/materials/ID/export?format=manifest", &[], ""),
    (0, "GET", "/v1/blobs/ID", &[], ""),
    (0, "GET", "/v1/blobs/ID", &[ANY], ""),
    (0, "GET", "/v1/blobs/ID", &[RANGE], ""),
    (1, "GET", "/v1/jobs/ID", &[], ""),
    (1, "GET", "/v1/jobs/ID/events", &[], ""),
    (1, "POST", "/v1/jobs/ID/cancel", &[], ""),
    (1, "POST", "/v1/jobs/ID/retry", &[], ""),
    (2, "HEAD", "/v1/uploads/ID", &[TUS], ""),
    (2, "PATCH", "/v1/uploads/ID", &[TUS, PART, ("upload-offset", "0")], "bytes"),
    (2, "PATCH", "/v1/uploads/ID", &[TUS, PART, ("upload-offset", "7")], "bytes"),
    (2, "DELETE", "/v1/uploads/ID", &[TUS], ""),
    (2, "POST", "/v1/uploads/ID", &[TUS, PART, ("x-http-method-override", "DELETE")], ""),
    (2, "POST", "/v1/uploads/ID", &[TUS, PART, ("x-http-method-override", "PATCH"), ("upload-offset", "0")], "bytes"),
];

/// Requests that name a thing by its identifier in the query string or the body, one for each way to do so. `OWN` is a
/// material of the asking tenant.
const NAMED: &[Ask] = &[
    (0, "GET", "/v1/materials?measurement=ID", &[], ""),
    (0, "GET", "/v1/jobs?measurement=ID", &[], ""),
    (0, "GET", "/v1/materials?cursor=7fffffffffffffff.ID&measurement=ID", &[], ""),
    (0, "POST", "/v1/jobs", &[JSON], "{\"measurement\":\"ID\",\"target\":{\"er_l2\":0.01}}"),
    (0, "POST", "/v1/measurements?quantity=edf&spectrum=ID", &[], "theta,phi,value\n0,0,1\n"),
    (0, "POST", "/v1/materials?measurement=ID", &[], "no material"),
    (2, "POST", "/v1/measurements?upload=ID", &[], ""),
    (2, "POST", "/v1/materials?upload=ID", &[], ""),
    (0, "GET", "/v1/materials/OWN/color?illuminant=ID", &[], ""),
    (0, "GET", "/v1/materials/OWN/color?observer=ID", &[], ""),
    (0, "GET", "/v1/materials/OWN/preview.png?illuminant=ID", &[], ""),
    (0, "GET", "/v1/materials/OWN/preview.png?observer=ID", &[], ""),
];

/// Returns one site (place of database and store) of each kind: a local directory, and PostgreSQL with an S3 bucket.
async fn sites() -> Vec<(Site, tempfile::TempDir)> {
    crate::store::provide_tls();
    let (alone, scratch) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let (database, store) = (Some(testing::server().await), Some(contract::bucket()));
    let shared = Site { database, store, ..Site::new(scratch.path()) };
    crate::jobs::Archive::migrate(&shared, false).await.unwrap();
    vec![(Site::new(alone.path()), alone), (shared, scratch)]
}

#[test]
fn the_walk_asks_every_route_that_has_an_identifier() {
    let mut asked = BTreeSet::new();
    for (_, method, path, ..) in PATHS {
        asked.insert(format!("{method} {}", path.split('?').next().unwrap()));
    }
    let described = serde_json::to_value(openapi()).unwrap();
    for (path, methods) in described["paths"].as_object().unwrap() {
        let (Some(start), Some(end)) = (path.find('{'), path.find('}')) else { continue };
        // Templates belong to nobody, and tenants to those who administer the service. Keys of others are tried by
        // `tests/it/http/keys.rs`.
        if ["/v1/formats/", "/v1/tenants/", "/v1/keys/"].iter().any(|start| path.starts_with(start)) {
            continue;
        }
        let path = format!("{}ID{}", &path[..start], &path[end + 1..]);
        for method in methods.as_object().unwrap().keys().filter(|key| *key != "parameters") {
            let route = format!("{} {path}", method.to_uppercase());
            assert!(asked.contains(&route), "{route} is not in PATHS");
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn whatever_one_tenant_has_exists_nowhere_for_the_other() {
    for (site, _guard) in sites().await {
        let desk = Desk::open(&site).await;
        let owned = Owned::of(&desk, "one").await;
        let other = desk.measurement("two", "wavelength,a\n400,5\n500,6\n600,7\n").await;
        let other = desk.job("two", &json!({ "measurement": other, "target": { "er_l2": 0.01 } })).await;
        let own = other["material"].as_str().unwrap();
        for (kind, method, uri, headers, body) in PATHS.iter().chain(NAMED) {
            let ask = |tenant: &str, id: &str| {
                let [uri, body] = [uri, body].map(|text| text.replace("ID", id).replace("OWN", own));
                asks(tenant, method, &uri, headers, &body)
            };
            let nowhere = &nowhere()[*kind];
            let expected = desk.answer(ask("two", nowhere)).await.without(nowhere);
            assert!(!expected.status.is_server_error(), "{method} {uri}: {expected:?}");
            for id in &owned.ids()[*kind] {
                // Callers of another tenant, and of none.
                for tenant in ["two", ""] {
                    let found = desk.answer(ask(tenant, id)).await.without(id);
                    let expected = if tenant.is_empty() && uri.contains("OWN") { continue } else { &expected };
                    assert_eq!(found, *expected, "{method} {uri} of {id} by `{tenant}`");
                }
            }
        }
        // None of this has changed anything.
        let Owned { measurement, material, report, job, upload, waiting } = &owned;
        for path in ["content", "spectrum", "preview.png", "export?format=npy"] {
            desk.done(200, get("one", &format!("/v1/materials/{material}/{path}"))).await;
        }
        desk.done(200, get("one", &format!("/v1/measurements/{measurement}/content"))).await;
        for digest in [material, report, measurement] {
            assert!(desk.answer(get("one", &format!("/v1/blobs/{digest}"))).await.status.as_u16() < 405);
        }
        desk.done(200, get("one", &format!("/v1/jobs/{job}/events"))).await;
        assert_ne!(desk.done(200, get("one", &format!("/v1/jobs/{waiting}"))).await.text("state"), "cancelled");
        let kept = desk.done(200, asks("one", "HEAD", &format!("/v1/uploads/{upload}"), &[TUS], "")).await;
        assert_eq!(kept.header("upload-offset"), Some("0"));
        desk.stop.cancel();
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_tenant_is_refused_more_than_its_limits_allow() {
    for (site, _guard) in sites().await {
        let desk = Desk::open(&site).await;
        let set = async |change: Value| {
            desk.done(200, asks("", "PATCH", "/v1/tenants/one", &[JSON], &change.to_string())).await.json()
        };
        let new = json!({ "id": "three", "name": "Third", "max_queued": 7 }).to_string();
        desk.done(201, asks("", "POST", "/v1/tenants", &[JSON], &new)).await;
        desk.done(409, asks("", "POST", "/v1/tenants", &[JSON], &new)).await;
        let listed = desk.done(200, get("", "/v1/tenants")).await.json();
        assert_eq!(listed["items"].as_array().unwrap().len(), 4, "{listed}");

        let measurement = desk.measurement("one", SPECTRUM).await;
        let bytes = SPECTRUM.len() as u64;
        let about = set(json!({ "max_bytes": bytes + 10, "max_queued": 0 })).await;
        assert_eq!((&about["used_bytes"], &about["max_bytes"]), (&json!(bytes), &json!(bytes + 10)));
        let upload = |tenant: &str, declared: bool| {
            let text = "wavelength,a\n400,5\n500,6\n600,7\n";
            let length = text.len().to_string();
            let headers = [("content-length", length.as_str())];
            asks(tenant, "POST", "/v1/measurements?quantity=spectrum", if declared { &headers } else { &[] }, text)
        };
        for declared in [true, false] {
            let refused = desk.done(403, upload("one", declared)).await.json();
            assert_eq!(refused["type"], "urn:wavelume:problem:quota-exceeded");
            assert_eq!((&refused["limit"], &refused["used"]), (&json!(bytes + 10), &json!(bytes)));
        }
        desk.done(201, upload("two", true)).await;
        let begun = asks("one", "POST", "/v1/uploads", &[TUS, ("upload-length", "99")], "");
        desk.done(403, begun).await;
        let job = json!({ "measurement": measurement, "target": { "er_l2": 0.01 } });
        let refused = desk.done(429, asks("one", "POST", "/v1/jobs", &[JSON], &job.to_string())).await.json();
        assert_eq!((&refused["type"], &refused["limit"]), (&json!("urn:wavelume:problem:too-many-jobs"), &json!(0)));

        // The result of a job is held to the limits, too.
        set(json!({ "max_queued": null, "max_materials": 0, "max_bytes": null })).await;
        let headers = [JSON, ("prefer", "wait=60")];
        let ended = desk.done(200, asks("one", "POST", "/v1/jobs", &headers, &job.to_string())).await.json();
        assert_eq!((&ended["state"], &ended["problem"]["status"]), (&json!("failed"), &json!(403)), "{ended}");
        set(json!({ "max_materials": 1 })).await;
        desk.job("one", &job).await;
        let about = desk.done(200, get("", "/v1/tenants/one")).await.json();
        assert_eq!(about["used_materials"], 1);
        desk.done(204, asks("one", "DELETE", &format!("/v1/materials/{}", only_material(&desk).await), &[], "")).await;
        desk.done(204, asks("one", "DELETE", &format!("/v1/measurements/{measurement}"), &[], "")).await;
        let about = desk.done(200, get("", "/v1/tenants/one")).await.json();
        assert_eq!((&about["used_bytes"], &about["used_materials"]), (&json!(0), &json!(0)), "at once");
        desk.stop.cancel();
    }
}

/// Returns the id of the only material of the tenant `one`.
async fn only_material(desk: &Desk) -> String {
    desk.done(200, get("one", "/v1/materials")).await.json()["items"][0]["id"].as_str().unwrap().to_owned()
}

#[tokio::test(flavor = "multi_thread")]
async fn equal_bytes_are_new_to_each_tenant() {
    for (site, _guard) in sites().await {
        let desk = Desk::open(&site).await;
        let mut told: Vec<Vec<Answer>> = Vec::new();
        for tenant in ["one", "two"] {
            let upload = || asks(tenant, "POST", "/v1/measurements?quantity=spectrum&filename=a.csv", &[], SPECTRUM);
            let digest = Digest::of(SPECTRUM.as_bytes());
            let mut answers =
                vec![desk.answer(get(tenant, &format!("/v1/blobs/{digest}"))).await, desk.answer(upload()).await];
            let measurement = answers[1].text("id");
            answers.push(desk.answer(upload()).await);
            let job = desk.job(tenant, &json!({ "measurement": measurement, "target": { "er_l2": 0.01 } })).await;
            let material = job["material"].as_str().unwrap();
            let content = as_tenant(get(tenant, &format!("/v1/materials/{material}/content")));
            let file = desk.front.answer(content).await;
            let file = to_bytes(file.into_body(), 1 << 20).await.unwrap();
            let again = Request::builder().method("POST").uri("/v1/materials").header(header::HOST, "localhost");
            let again = again.header(TENANT, tenant).body(Body::from(file)).unwrap();
            answers.push(desk.answer(again).await);
            for path in ["", "/content", "/spectrum", "/color", "/preview.png", "/export?format=npy"] {
                answers.push(desk.answer(get(tenant, &format!("/v1/materials/{material}{path}"))).await);
            }
            for path in ["/v1/materials".to_owned(), "/v1/measurements".to_owned(), format!("/v1/blobs/{digest}")] {
                answers.push(desk.answer(get(tenant, &path)).await);
            }
            let gone = |path: String| asks(tenant, "DELETE", &path, &[], "");
            answers.push(desk.answer(gone(format!("/v1/measurements/{measurement}"))).await);
            for answer in &mut answers {
                // Times differ, whoever asks.
                if let Ok(mut body) = serde_json::from_str::<Value>(&answer.body) {
                    forget_times(&mut body);
                    answer.body = body.to_string();
                }
            }
            told.push(answers);
        }
        for (one, other) in told[0].iter().zip(&told[1]) {
            assert_eq!(one, other);
        }
        assert_eq!(told[0].iter().map(|answer| answer.status.as_u16()).collect::<Vec<_>>()[..4], [404, 201, 200, 200]);
        desk.stop.cancel();
    }
}

/// Replaces each time in a JSON answer, a field whose name ends with `_ms`, by null.
fn forget_times(value: &mut Value) {
    match value {
        Value::Object(fields) => {
            for (name, field) in fields {
                if name.ends_with("_ms") {
                    assert!(field.is_i64());
                    *field = Value::Null;
                } else {
                    forget_times(field);
                }
            }
        }
        Value::Array(items) => items.iter_mut().for_each(forget_times),
        _ => {}
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_material_is_read_by_those_whom_its_owner_lets_and_by_nobody_else_afterwards() {
    for (site, _guard) in sites().await {
        let desk = Desk::open(&site).await;
        let owned = Owned::of(&desk, "one").await;
        let id = owned.material.as_str();
        let reads: Vec<_> = PATHS
            .iter()
            .filter(|(kind, method, uri, ..)| {
                *kind == 0 && !uri.contains("/measurements/") && !["DELETE", "PATCH"].contains(method)
            })
            .collect();
        // Some questions do not fit a spectrum.
        let readable = async || {
            let mut readable = Vec::new();
            for (_, method, uri, headers, body) in &reads {
                let status = desk.answer(asks("two", method, &uri.replace("ID", id), headers, body)).await.status;
                assert!(!status.is_server_error(), "{method} {uri}: {status}");
                readable.push(status != 404);
            }
            readable
        };
        let change = async |change: Value| {
            let ask = asks("one", "PATCH", &format!("/v1/materials/{id}"), &[JSON], &change.to_string());
            desk.answer(ask).await
        };
        assert_eq!(readable().await, vec![false; reads.len()]);
        for opened in [json!({ "shared_with": ["two", "one"] }), json!({ "shared_with": [], "visibility": "public" })] {
            let answer = change(opened.clone()).await;
            assert_eq!(answer.status, 200, "{answer:?}");
            let shared = opened["shared_with"].as_array().unwrap().len().saturating_sub(1);
            assert_eq!(answer.json()["shared_with"].as_array().unwrap().len(), shared, "{answer:?}");
            assert_eq!(readable().await, vec![true; reads.len()]);

            // The reader sees no measurement, and may change nothing.
            let seen = desk.done(200, get("two", &format!("/v1/materials/{id}"))).await;
            assert!(!seen.body.contains(&owned.measurement), "{seen:?}");
            let (own, seen) = (desk.done(200, get("one", &format!("/v1/materials/{id}"))).await.json(), seen.json());
            assert_eq!((&seen["er_l2"], &seen["name"]), (&own["er_l2"], &own["name"]));
            assert_eq!((&seen["measurements"], &seen["shared_with"]), (&json!([]), &json!([])));
            for (method, body) in [("DELETE", ""), ("PATCH", "{}")] {
                desk.done(404, asks("two", method, &format!("/v1/materials/{id}"), &[JSON], body)).await;
            }
            desk.done(404, get("two", &format!("/v1/measurements/{}", owned.measurement))).await;
            let listed = async |whose: &str| {
                let list = desk.done(200, get("two", &format!("/v1/materials?visible={whose}"))).await;
                assert!(!list.body.contains(&owned.measurement), "{list:?}");
                list.json()["items"].as_array().unwrap().len()
            };
            let public = usize::from(shared == 0);
            assert_eq!([listed("own").await, listed("shared").await, listed("public").await], [0, 1 - public, public]);
        }
        assert_eq!(change(json!({ "visibility": "private" })).await.text("visibility"), "private");
        assert_eq!(readable().await, vec![false; reads.len()], "nothing stays open");
        let unknown = change(json!({ "shared_with": ["nobody"] })).await;
        assert_eq!((unknown.status.as_u16(), unknown.body.contains("there is no tenant nobody")), (422, true));
        desk.stop.cancel();
    }
}
