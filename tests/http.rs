//! Every call of the HTTP contract against a real server, and every refusal by its problem.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails by panicking"
)]

mod service;

use async_compression::tokio::bufread::{GzipEncoder, ZstdEncoder};
use reqwest::{Method, StatusCode};
use serde_json::{Value, json};
use service::{CHECKER, D65, LAMP, LAMP_SPECTRUM, LONG_SHAPE, Service, config, long_request, npy, problem, problem_of};
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use wavelume::api::{ServeError, Server};
use wavelume::jobs::Archive;
use wavelume::store::Digest;

async fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    GzipEncoder::new(bytes).read_to_end(&mut out).await.unwrap();
    out
}

async fn zstd(bytes: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    ZstdEncoder::new(bytes).read_to_end(&mut out).await.unwrap();
    out
}

#[tokio::test(flavor = "multi_thread")]
async fn an_upload_says_what_was_understood_and_keeps_the_bytes() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let response = service.post("/v1/measurements?filename=lamp.ies&name=Lamp").body(LAMP).send().await.unwrap();
    assert_eq!(response.status(), StatusCode::CREATED);
    let location = response.headers()["location"].to_str().unwrap().to_owned();
    let lamp: Value = response.json().await.unwrap();
    assert_eq!(lamp["id"], Digest::of(LAMP).to_string());
    assert_eq!(lamp["content_digest"], lamp["id"]);
    assert_eq!((lamp["quantity"].as_str(), lamp["name"].as_str()), (Some("edf"), Some("Lamp")));
    assert_eq!(location, lamp["links"]["self"].as_str().unwrap());
    assert!(lamp["range"][1].as_f64().unwrap() > 0.0 && lamp["coverage"]["outside"] == "zero");
    assert!(!lamp["axes"].as_array().unwrap().is_empty() && lamp["warnings"].is_array());

    let again = service.post("/v1/measurements").body(LAMP).send().await.unwrap();
    assert_eq!(again.status(), StatusCode::OK);
    assert_eq!(service.get(&location).send().await.unwrap().json::<Value>().await.unwrap(), lamp);

    let content = service.get(&format!("{location}/content")).send().await.unwrap();
    assert_eq!(content.headers()["content-type"], "application/octet-stream");
    assert!(content.headers()["content-disposition"].to_str().unwrap().contains("lamp.ies"));
    assert_eq!(content.headers()["x-content-type-options"], "nosniff");
    assert_eq!(content.bytes().await.unwrap(), LAMP);
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn options_make_another_measurement_of_the_same_content() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let table = service.upload("", CHECKER).await;
    let skin = service.upload("?column=light%20skin&quantity=reflectance", CHECKER).await;
    assert_eq!(skin["content_digest"], table["content_digest"]);
    assert_ne!(skin["id"], table["id"]);
    assert_eq!(
        (skin["quantity"].as_str(), skin["options"]["column"].as_str()),
        (Some("reflectance"), Some("light skin"))
    );

    let spectrum = service.upload("", LAMP_SPECTRUM).await;
    let id = spectrum["id"].as_str().unwrap();
    let joined = service.upload(&format!("?spectrum={id}"), LAMP).await;
    assert!(joined["axes"].as_array().unwrap().iter().any(|axis| axis["kind"] == "wavelength"));
    problem(service.request(Method::DELETE, &format!("/v1/measurements/{id}")), 409, "in-use").await;

    let absent = Digest::of(b"absent");
    problem(service.post(&format!("/v1/measurements?spectrum={absent}")).body(D65), 422, "unreadable-spectrum").await;
    let skin = skin["id"].as_str().unwrap();
    let refused = service.post(&format!("/v1/measurements?spectrum={skin}")).body(LAMP.to_vec());
    problem(refused, 422, "unreadable-spectrum").await;
    let refused = service.post("/v1/measurements?column=no%20such%20column").body(CHECKER);
    problem(refused, 422, "needs-option").await;
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn encoded_bodies_are_decoded_within_limits() {
    let data = tempfile::tempdir().unwrap();
    let mut config = config(data.path());
    config.work.limits.upload_bytes = 4 << 20;
    let service = Service::start(config).await;
    let post = |encoding: &str, body: Vec<u8>| {
        service.post("/v1/measurements").header("content-encoding", encoding).body(body)
    };
    for (encoding, body) in [("gzip", gzip(D65).await), ("zstd", zstd(D65).await), ("identity", D65.to_vec())] {
        let uploaded: Value = post(encoding, body).send().await.unwrap().json().await.unwrap();
        assert_eq!(uploaded["id"], Digest::of(D65).to_string(), "{encoding}: {uploaded}");
    }
    let zeros = vec![0; 3 << 20];
    problem(post("gzip", gzip(&zeros).await), 413, "decompression-ratio").await;
    problem(post("zstd", zstd(&zeros).await), 413, "decompression-ratio").await;
    problem(post("identity", vec![b'x'; (4 << 20) + 1]), 413, "too-large").await;
    let noise: Vec<u8> = (0_u32..5 << 20).map(|i| (i.wrapping_mul(2_654_435_761).rotate_left(9) >> 24) as u8).collect();
    problem(post("gzip", gzip(&noise).await), 413, "too-large").await;
    for (encoding, whole) in [("gzip", gzip(D65).await), ("zstd", zstd(D65).await)] {
        problem(post(encoding, whole[..whole.len() / 2].to_vec()), 400, "bad-body").await;
        problem(post(encoding, D65.to_vec()), 400, "bad-body").await;
        problem(post(encoding, [whole.as_slice(), b"and more"].concat()), 400, "bad-body").await;
    }
    problem(post("br", D65.to_vec()), 415, "unsupported-encoding").await;
    problem(post("gzip, gzip", D65.to_vec()), 415, "unsupported-encoding").await;
    problem(post("identity", Vec::new()), 422, "empty-body").await;
    problem(post("gzip", gzip(b"").await), 422, "empty-body").await;
    service.stop().await;
    assert_eq!(std::fs::read_dir(data.path().join("staging")).unwrap().count(), 0, "refused bytes are not kept");
}

#[tokio::test(flavor = "multi_thread")]
async fn refused_measurements_say_where_and_leave_nothing() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let post = |body: &'static [u8]| service.post("/v1/measurements").body(body);
    problem(post(b"\x00\x01\x02 what is this"), 422, "unrecognised-format").await;
    let broken = &include_bytes!("fixtures/ies/test_file_format_error.ies")[..];
    let refusal = problem(post(broken), 422, "malformed-measurement").await;
    assert!(refusal["detail"].as_str().unwrap().contains("line "), "{refusal}");
    let absent = Digest::of(broken);
    problem(service.get(&format!("/v1/blobs/{absent}")), 404, "not-found").await;
    let page: Value = service.get("/v1/measurements").send().await.unwrap().json().await.unwrap();
    assert_eq!(page, json!({ "items": [], "next": null }));
    service.stop().await;
    assert_eq!(std::fs::read_dir(data.path().join("blobs")).unwrap().count(), 0);
}

#[tokio::test(flavor = "multi_thread")]
async fn an_array_waits_for_its_axes() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let array = service.upload("?filename=a.npy", npy(&[8])).await;
    assert_eq!(array["format"], "npy");
    assert_eq!(array["needs"].as_array().unwrap().len(), 1, "{array}");
    let request = |axes: Value| json!({ "measurement": array["id"], "target": { "er_l2": 0.01 }, "axes": axes });
    let good = json!({ "quantity": "spectrum", "axes": ["lambda:400:10:8"] });
    let job = service.compress(&request(good)).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    let bad = json!({ "quantity": "spectrum", "axes": ["lambda:400:10:9"] });
    let job = service.compress(&request(bad)).await;
    assert_eq!((job["state"].as_str(), job["attempts"].as_u64()), (Some("failed"), Some(1)), "{job}");
    assert_eq!(job["problem"]["type"], "urn:wavelume:problem:malformed-measurement");
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn lists_filter_and_page() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    for (query, bytes) in [("?name=lamp", LAMP), ("?name=daylight", D65), ("?name=checker", CHECKER)] {
        service.upload(query, bytes).await;
    }
    let list = async |query: &str| -> Value {
        service.get(&format!("/v1/measurements{query}")).send().await.unwrap().json().await.unwrap()
    };
    assert_eq!(list("").await["items"].as_array().unwrap().len(), 3);
    assert_eq!(list("?quantity=edf").await["items"][0]["name"], "lamp");
    assert_eq!(list("?q=DAYL").await["items"][0]["name"], "daylight");
    assert_eq!(list("?format=nothing").await["items"], json!([]));
    let first = list("?limit=2").await;
    let rest = list(&format!("?limit=2&cursor={}", first["next"].as_str().unwrap())).await;
    assert_eq!((first["items"].as_array().unwrap().len(), rest["items"].as_array().unwrap().len()), (2, 1));
    assert_eq!(rest["next"], Value::Null);
    for bad in ["?limit=0", "?limit=1001", "?limit=x", "?cursor=x", "?quantity=brd", "?unknown=1"] {
        problem(service.get(&format!("/v1/measurements{bad}")), 400, "bad-query").await;
    }
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_makes_a_material_with_a_manifest() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let lamp = service.upload("", LAMP).await;
    let request = json!({
        "measurement": lamp["id"], "target": { "er_l2": 0.01 }, "name": "Far-UVC", "licence": "CC0-1.0",
        "tags": ["uv", "lamp"],
    });
    let response = service.post("/v1/jobs").header("prefer", "wait=60").json(&request).send().await.unwrap();
    assert_eq!(response.headers()["preference-applied"], "wait=60");
    let location = response.headers()["location"].to_str().unwrap().to_owned();
    let job: Value = response.json().await.unwrap();
    assert_eq!((job["state"].as_str(), job["progress"].as_f64()), (Some("succeeded"), Some(1.0)), "{job}");
    assert_eq!(service.get(&location).send().await.unwrap().json::<Value>().await.unwrap(), job);

    let id = job["material"].as_str().unwrap();
    let path = format!("/v1/materials/{id}");
    let material: Value = service.get(&path).send().await.unwrap().json().await.unwrap();
    let bytes = service.get(&format!("{path}/content")).send().await.unwrap().bytes().await.unwrap();
    assert_eq!(Digest::of(&bytes).to_string(), id);
    assert_eq!(material["bytes"].as_u64(), Some(bytes.len() as u64));
    assert!(material["er_l2"].as_f64().unwrap() <= 0.01, "{material}");
    assert_eq!((&material["name"], &material["licence"]), (&json!("Far-UVC"), &json!("CC0-1.0")));
    assert_eq!(material["tags"], json!(["lamp", "uv"]));
    assert_eq!(material["provenance"]["measurement"], lamp["id"]);
    assert_eq!(material["measurements"], json!([lamp["id"]]));
    for query in ["?tag=uv", "?q=far", "?quantity=edf", &format!("?measurement={}", lamp["id"].as_str().unwrap())] {
        let page: Value = service.get(&format!("/v1/materials{query}")).send().await.unwrap().json().await.unwrap();
        assert_eq!(page["items"][0]["id"], id, "{query}");
    }
    let again = service.compress(&request).await;
    assert_eq!(again["material"], id, "the same input and request give the same bytes");

    let lamp = format!("/v1/measurements/{}", lamp["id"].as_str().unwrap());
    problem(service.request(Method::DELETE, &lamp), 409, "in-use").await;
    assert_eq!(service.request(Method::DELETE, &path).send().await.unwrap().status(), StatusCode::NO_CONTENT);
    problem(service.get(&path), 404, "not-found").await;
    problem(service.request(Method::DELETE, &path), 404, "not-found").await;
    assert_eq!(service.request(Method::DELETE, &lamp).send().await.unwrap().status(), StatusCode::NO_CONTENT);
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn every_promise_can_be_asked_for() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let id = service.upload("?quantity=reflectance", CHECKER).await["id"].clone();
    let material = async |target: Value| -> Value {
        let job = service.compress(&json!({ "measurement": id, "quantity": "reflectance", "target": target })).await;
        assert_eq!(job["state"], "succeeded", "{job}");
        let path = format!("/v1/materials/{}", job["material"].as_str().unwrap());
        service.get(&path).send().await.unwrap().json().await.unwrap()
    };
    for (field, most) in [("er_l1", 0.004), ("max_absolute_error", 0.003), ("relative_rmse", 0.005)] {
        let found = material(json!({ field: most })).await;
        assert!(found[field].as_f64().unwrap() <= most && found["delta_e"].is_null(), "{found}");
        assert_eq!(found["provenance"]["request"]["target"], json!({ field: most }));
    }
    let whole = json!({ "delta_e": { "at_most": 1.0, "illuminant": "D65" } });
    let short = material(json!({ "delta_e": 1 })).await;
    assert!(short["delta_e"]["largest"].as_f64().unwrap() <= 1.0, "{short}");
    assert_eq!(short["provenance"]["request"]["target"], whole);
    assert_eq!(material(whole).await["id"], short["id"]);
    let lit = material(json!({ "delta_e": { "at_most": 1.0, "illuminant": "A" } })).await;
    assert_eq!((&lit["delta_e"]["illuminant"], &lit["delta_e"]["spectra"]), (&json!("A"), &json!(24)));

    let bad = json!({ "measurement": id, "target": { "delta_e": { "at_most": 1, "illuminant": "D93" } } });
    let refusal = problem(service.post("/v1/jobs").json(&bad), 422, "invalid-request").await;
    assert!(refusal["detail"].as_str().unwrap().contains("unknown illuminant `D93`"), "{refusal}");
    for target in [json!({ "delta_e": 0 }), json!({ "max_absolute_error": -1 })] {
        let job = service.compress(&json!({ "measurement": id, "target": target })).await;
        assert_eq!(job["problem"]["type"], "urn:wavelume:problem:bad-setting", "{job}");
    }
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn job_bodies_are_checked() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let id = service.upload("", D65).await["id"].clone();
    let post = |body: Value| service.post("/v1/jobs").json(&body);
    let text = |body: &'static str| service.post("/v1/jobs").header("content-type", "application/json").body(body);
    problem(text("{"), 400, "bad-body").await;
    problem(text(""), 422, "empty-body").await;
    problem(service.post("/v1/jobs").body("{}"), 415, "unsupported-media-type").await;
    problem(text("{}").header("content-encoding", "gzip"), 415, "unsupported-encoding").await;
    problem(post(json!([1])), 422, "invalid-request").await;
    problem(post(json!({ "axes": "x".repeat(600_000) })), 413, "too-large").await;
    let unknown =
        problem(post(json!({ "measurement": id, "target": "lossless", "polcy": "rd" })), 422, "invalid-request");
    assert!(unknown.await["detail"].as_str().unwrap().contains("unknown field `polcy`"));
    problem(post(json!({ "measurement": id, "target": { "er_l3": 1 } })), 422, "invalid-request").await;
    problem(post(json!({ "measurement": "b3-12", "target": "lossless" })), 422, "invalid-request").await;
    problem(post(json!({ "measurement": id, "target": "lossless", "name": "" })), 422, "invalid-request").await;
    let absent = Digest::of(b"absent").to_string();
    problem(post(json!({ "measurement": absent, "target": "lossless" })), 422, "invalid-request").await;
    for (setting, value, code) in
        [("basis", json!("nonsense"), "bad-setting"), ("wavelengths", json!("780:380:5"), "bad-setting")]
    {
        let mut request = json!({ "measurement": id, "target": { "er_l2": 0.01 } });
        request[setting] = value;
        let job = service.compress(&request).await;
        assert_eq!(job["state"], "failed", "{job}");
        assert_eq!(job["problem"]["type"], format!("urn:wavelume:problem:{code}"), "{job}");
    }
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_report_on_the_papers_tables_is_a_job() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let post = |body: Value| service.post("/v1/jobs").header("prefer", "wait=60").json(&body);
    for (tables, found) in [(json!([0]), "found 0"), (json!([1, 300]), "found 300"), (json!([]), "none")] {
        let refusal = problem(post(json!({ "kind": "paper", "tables": tables })), 422, "invalid-request").await;
        assert!(refusal["detail"].as_str().unwrap().contains(found), "{refusal}");
    }
    problem(post(json!({ "kind": "paper", "target": "lossless" })), 422, "invalid-request").await;
    let refusal = problem(post(json!({ "kind": "poster" })), 422, "invalid-request").await;
    assert!(refusal["detail"].as_str().unwrap().contains("expected `compress` or `paper`"), "{refusal}");

    let everything: Value =
        service.post("/v1/jobs").json(&json!({ "kind": "paper" })).send().await.unwrap().json().await.unwrap();
    let path = everything["links"]["self"].as_str().unwrap();
    let state = async || service.get(path).send().await.unwrap().json::<Value>().await.unwrap()["state"].clone();
    while state().await == "queued" {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    service.post(everything["links"]["cancel"].as_str().unwrap()).send().await.unwrap().error_for_status().unwrap();
    while state().await == "running" {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    assert_eq!(state().await, "cancelled");

    let response = post(json!({ "kind": "paper", "tables": [2] })).send().await.unwrap();
    assert_eq!(response.status(), StatusCode::OK);
    let job: Value = response.json().await.unwrap();
    assert_eq!(
        (job["state"].as_str(), &job["measurement"], &job["material"]),
        (Some("succeeded"), &Value::Null, &Value::Null)
    );
    let (digest, link) = (job["report"].as_str().unwrap(), job["links"]["result"].as_str().unwrap());
    assert_eq!(link, format!("/v1/blobs/{digest}"));
    service.stop().await;

    let swept = Archive::open(data.path()).await.unwrap().sweep().await.unwrap();
    assert_eq!((swept.removed_blobs, swept.kept_blobs), (0, 1), "the job keeps its report");
    let service = Service::start(config(data.path())).await;
    let report = service.get(link).send().await.unwrap();
    assert_eq!(report.headers()["content-type"], "application/json");
    let report = report.bytes().await.unwrap();
    assert_eq!(Digest::of(&report).to_string(), digest);
    let table = wavelume::paper::table(2, &wavelume::domain::Silent).unwrap();
    assert_eq!(report, serde_json::to_string(&[table]).unwrap() + "\n");
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn keys_make_jobs_idempotent_and_queues_have_an_end() {
    let data = tempfile::tempdir().unwrap();
    let mut config = config(data.path());
    config.work.workers = 0;
    config.work.limits.queued_jobs = 2;
    let service = Service::start(config).await;
    let id = service.upload("", D65).await["id"].clone();
    let body = json!({ "measurement": id, "target": { "er_l2": 0.01 } });
    let post = |key: &str, body: &Value| service.post("/v1/jobs").header("idempotency-key", key).json(body);
    let first = post("key", &body).send().await.unwrap();
    assert_eq!(first.status(), StatusCode::ACCEPTED);
    let first: Value = first.json().await.unwrap();
    let second = post("key", &body).send().await.unwrap();
    assert_eq!(second.status(), StatusCode::ACCEPTED);
    assert_eq!(second.json::<Value>().await.unwrap()["id"], first["id"]);
    let other = json!({ "measurement": id, "target": { "er_l2": 0.02 } });
    problem(post("key", &other), 422, "idempotency-key-reused").await;
    problem(post("", &body), 400, "bad-header").await;

    let path = format!("/v1/measurements/{}", id.as_str().unwrap());
    problem(service.request(Method::DELETE, &path), 409, "in-use").await;
    post("another", &body).send().await.unwrap().error_for_status().unwrap();
    let full = post("third", &body).send().await.unwrap();
    assert!(full.headers().contains_key("retry-after"));
    problem_of(full, 429, "too-many-jobs").await;

    let job = first["links"]["cancel"].as_str().unwrap();
    let cancelled = service.post(job).send().await.unwrap();
    assert_eq!(cancelled.status(), StatusCode::OK);
    assert_eq!(cancelled.json::<Value>().await.unwrap()["state"], "cancelled");
    assert_eq!(service.post(job).send().await.unwrap().status(), StatusCode::OK, "cancelling twice is once");
    problem(service.get("/v1/jobs/nonsense"), 404, "not-found").await;
    problem(service.post("/v1/jobs/0193b7a0-0000-7000-8000-000000000000/cancel"), 404, "not-found").await;
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn events_tell_progress_and_end_with_the_job() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let array = service.upload("", npy(&LONG_SHAPE)).await;
    let job: Value =
        service.post("/v1/jobs").json(&long_request(&array["id"])).send().await.unwrap().json().await.unwrap();
    let mut events = service.get(job["links"]["events"].as_str().unwrap()).send().await.unwrap();
    assert_eq!(events.headers()["content-type"], "text/event-stream");
    let (mut text, mut asked) = (String::new(), false);
    while let Some(piece) = events.chunk().await.unwrap() {
        text += std::str::from_utf8(&piece).unwrap();
        if !asked && text.contains("\"state\":\"running\"") {
            asked = true;
            let status = service.post(job["links"]["cancel"].as_str().unwrap()).send().await.unwrap().status();
            assert!(status == StatusCode::ACCEPTED || status == StatusCode::OK, "{status}");
        }
    }
    assert!(asked, "{text}");
    let states: Vec<&str> = text.lines().filter_map(|line| line.strip_prefix("event: ")).collect();
    assert_eq!(states.last(), Some(&"state"), "{text}");
    assert!(text.contains("\"state\":\"cancelled\""), "{text}");
    problem(service.get("/v1/jobs/0193b7a0-0000-7000-8000-000000000000/events"), 404, "not-found").await;
    let done = service.material().await;
    let material: Value = service.get(&format!("/v1/materials/{done}")).send().await.unwrap().json().await.unwrap();
    assert_eq!(material["quantity"], "spectrum", "the worker goes on after a cancel");
    let levels = material["levels"].as_array().unwrap();
    assert_eq!((levels.len(), levels[0]["level"].as_u64()), (1, Some(0)), "a spectrum has no triangles");
    assert!(levels[0]["bytes"].as_u64() < material["bytes"].as_u64(), "metadata are behind the last level");
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn content_has_conditions_and_ranges() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let id = service.material().await;
    let tag = format!("\"{id}\"");
    for path in [format!("/v1/materials/{id}/content"), format!("/v1/blobs/{id}")] {
        let whole = service.get(&path).send().await.unwrap();
        assert_eq!(whole.headers()["etag"], tag.as_str());
        assert_eq!(whole.headers()["cache-control"], "public, max-age=31536000, immutable");
        assert_eq!(whole.headers()["content-type"], "application/vnd.wavelume.material");
        let bytes = whole.bytes().await.unwrap();

        let head = service.request(Method::HEAD, &path).send().await.unwrap();
        assert_eq!(head.headers()["content-length"], bytes.len().to_string().as_str());
        assert_eq!(head.headers()["etag"], tag.as_str());
        let same = service.get(&path).header("if-none-match", &tag).send().await.unwrap();
        assert_eq!((same.status(), same.bytes().await.unwrap().len()), (StatusCode::NOT_MODIFIED, 0));

        let part = service.get(&path).header("range", "bytes=3-9").send().await.unwrap();
        assert_eq!(part.status(), StatusCode::PARTIAL_CONTENT);
        assert_eq!(part.headers()["content-range"], format!("bytes 3-9/{}", bytes.len()).as_str());
        assert_eq!(part.bytes().await.unwrap(), bytes[3..10]);
        let tail = service.get(&path).header("range", "bytes=-4").header("if-range", &tag).send().await.unwrap();
        assert_eq!(tail.bytes().await.unwrap(), bytes[bytes.len() - 4..]);
        let stale =
            service.get(&path).header("range", "bytes=-4").header("if-range", "\"other\"").send().await.unwrap();
        assert_eq!((stale.status(), stale.bytes().await.unwrap().len()), (StatusCode::OK, bytes.len()));
        let outside = service.get(&path).header("range", "bytes=999999999-").send().await.unwrap();
        assert_eq!(outside.headers()["content-range"], format!("bytes */{}", bytes.len()).as_str());
        problem_of(outside, 416, "range-not-satisfiable").await;
    }
    problem(service.get("/v1/blobs/b3-xyz"), 404, "not-found").await;
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn large_content_is_streamed_whole_and_in_part() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let array = npy(&[40, 1024, 75]);
    assert!(array.len() as u64 > wavelume::store::WHOLE);
    let uploaded = service.upload("", array.clone()).await;
    let path = uploaded["links"]["content"].as_str().unwrap();
    assert_eq!(service.get(path).send().await.unwrap().bytes().await.unwrap(), array);
    let part = service.get(path).header("range", "bytes=5000000-9999999").send().await.unwrap();
    assert_eq!(part.bytes().await.unwrap(), array[5_000_000..10_000_000]);
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_damaged_blob_is_a_problem_until_it_is_uploaded_again() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let id = service.upload("", D65).await["id"].as_str().unwrap().to_owned();
    std::fs::write(data.path().join("blobs").join(&id[3..5]).join(&id), b"bit rot").unwrap();
    problem(service.get(&format!("/v1/blobs/{id}")), 500, "corrupt").await;
    let job = service.compress(&json!({ "measurement": id, "target": { "er_l2": 0.01 } })).await;
    assert_eq!(job["problem"]["type"], "urn:wavelume:problem:corrupt", "{job}");
    service.upload("", D65).await;
    assert_eq!(service.get(&format!("/v1/blobs/{id}")).send().await.unwrap().bytes().await.unwrap(), D65);
    std::fs::remove_file(data.path().join("blobs").join(&id[3..5]).join(&id)).unwrap();
    problem(service.get(&format!("/v1/measurements/{id}/content")), 500, "corrupt").await;
    problem(service.get(&format!("/v1/blobs/{id}")), 404, "not-found").await;
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn spectra_are_answered_in_the_materials_unit() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let id = service.material().await;
    let path = format!("/v1/materials/{id}/spectrum");
    let whole: Value = service.get(&path).send().await.unwrap().json().await.unwrap();
    assert_eq!(whole["wavelengths"].as_array().unwrap().len(), whole["values"].as_array().unwrap().len());
    assert_eq!(whole["unit"], "relative");
    let some: Value =
        service.get(&format!("{path}?wavelengths=560:600:20")).send().await.unwrap().json().await.unwrap();
    assert_eq!(some["wavelengths"], json!([560.0, 580.0, 600.0]));
    assert!((some["values"][0].as_f64().unwrap() - 100.0).abs() < 3.0, "{some}");
    problem(service.get(&format!("{path}?wi=30,0")), 422, "unfit-query").await;
    for bad in ["?wi=30", "?wavelengths=x", "?index=-1", "?interpolation=cubic", "?nonsense=1"] {
        problem(service.get(&format!("{path}{bad}")), 400, "bad-query").await;
    }
    let absent = Digest::of(b"absent");
    problem(service.get(&format!("/v1/materials/{absent}/spectrum")), 404, "not-found").await;
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn batches_evaluate_and_sample() {
    let data = tempfile::tempdir().unwrap();
    let mut config = config(data.path());
    config.work.limits.batch = 1000;
    let service = Service::start(config).await;
    let array = service.upload("", npy(&[4, 64, 3])).await;
    let axes = json!({ "axes": ["hemi:0", "hemi:2", "lambda:400:100:3"] });
    let job = service
        .compress(&json!({ "measurement": array["id"], "quantity": "brdf", "axes": axes, "target": { "er_l2": 0.01 } }))
        .await;
    let path = format!("/v1/materials/{}", job["material"].as_str().unwrap());
    let post = |what: &str, body: &Value| service.post(&format!("{path}/{what}")).json(body);
    let ask = async |what: &str, body: Value| -> Value {
        let response = post(what, &body).send().await.unwrap();
        assert_eq!(response.status(), StatusCode::OK, "{}", response.text().await.unwrap());
        response.json().await.unwrap()
    };
    let pairs = json!({ "wi": [[30, 0], [60, 45]], "wo": [[10, 20], [40, 200]] });
    let spectra = ask("evaluate", pairs).await;
    assert_eq!((spectra["values"].as_array().unwrap().len(), spectra["values"][0].as_array().unwrap().len()), (2, 3));
    assert_eq!(spectra["unit"], "1/sr");
    let one: Value =
        service.get(&format!("{path}/spectrum?wi=60,45&wo=40,200")).send().await.unwrap().json().await.unwrap();
    assert_eq!(one["values"], spectra["values"][1], "a batch answers as one question does");
    let below = ask("evaluate", json!({ "wi": [[30, 0]], "wo": [[10, 20], [20, 20]], "wavelengths": [450.0] })).await;
    assert_eq!(below["values"].as_array().unwrap().len(), 2);

    let drawn = ask("sample", json!({ "wi": [30, 0], "count": 5, "seed": 7 })).await;
    assert_eq!(drawn["directions"].as_array().unwrap().len(), 5);
    assert_eq!(drawn, ask("sample", json!({ "wi": [30, 0], "count": 5, "seed": 7 })).await);
    assert_ne!(drawn, ask("sample", json!({ "wi": [30, 0], "count": 5 })).await);
    let density = ask("pdf", json!({ "wi": [[30, 0]], "wo": drawn["directions"] })).await;
    for (a, b) in density["pdf"].as_array().unwrap().iter().zip(drawn["pdf"].as_array().unwrap()) {
        let (a, b) = (a.as_f64().unwrap(), b.as_f64().unwrap());
        assert!((a - b).abs() <= 1e-6 * b, "the density of a drawn direction is the one it was drawn with: {a} {b}");
    }

    problem(
        post("evaluate", &json!({ "wi": [[30, 0], [1, 1]], "wo": [[1, 1], [2, 2], [3, 3]] })),
        422,
        "invalid-request",
    )
    .await;
    problem(post("evaluate", &json!({ "wi": [[300, 0]], "wo": [[1, 1]] })), 422, "invalid-request").await;
    problem(post("evaluate", &json!({ "wo": [[1, 1]] })), 422, "unfit-query").await;
    problem(post("evaluate", &json!({ "w": 1 })), 422, "invalid-request").await;
    problem(post("evaluate", &json!({ "wi": vec![[1, 1]; 1001], "wo": [[1, 1]] })), 422, "invalid-request").await;
    problem(post("sample", &json!({ "wi": [30, 0], "count": 1001 })), 422, "invalid-request").await;
    problem(post("sample", &json!({ "wi": [30, 0], "count": 0 })), 422, "invalid-request").await;
    problem(service.post(&format!("{path}/pdf")).body("{}"), 415, "unsupported-media-type").await;

    let exported = service.get(&format!("{path}/export?format=npy")).send().await.unwrap().bytes().await.unwrap();
    assert!(exported.starts_with(b"\x93NUMPY") && exported.len() > 4 * 64 * 3 * 4);
    let manifest: Value =
        service.get(&format!("{path}/export?format=manifest")).send().await.unwrap().json().await.unwrap();
    assert_eq!((&manifest["quantity"], manifest["axes"].as_array().unwrap().len()), (&json!("brdf"), 3));
    let refusal = problem(service.get(&format!("{path}/export?format=merl")), 422, "not-available").await;
    assert!(refusal["detail"].as_str().unwrap().contains("npy"));
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_root_says_what_this_is_and_how_it_is() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    for (path, expected) in
        [("/", "curl"), ("/healthz", "ok"), ("/readyz", "ready"), ("/metrics", "wavelume_uploads_running")]
    {
        let response = service.get(path).send().await.unwrap();
        assert_eq!(response.status(), StatusCode::OK);
        assert!(response.headers().contains_key("request-id"));
        assert!(response.text().await.unwrap().contains(expected), "{path}");
    }
    let formats: Value = service.get("/v1/formats").send().await.unwrap().json().await.unwrap();
    assert!(formats.as_array().unwrap().iter().any(|format| format["name"] == "npy"));
    let bases: Value = service.get("/v1/bases").send().await.unwrap().json().await.unwrap();
    assert!(bases.as_array().unwrap().iter().any(|basis| basis["name"] == "bior4.4"));
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn whatever_goes_wrong_is_a_problem() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    problem(service.get("/v1/nothing"), 404, "not-found").await;
    problem(service.post("/nothing").body("x"), 404, "not-found").await;
    let wrong = service.request(Method::PUT, "/v1/jobs").send().await.unwrap();
    assert_eq!(wrong.headers()["allow"], "POST");
    problem_of(wrong, 405, "method-not-allowed").await;
    problem(service.get("/v1/measurements/nonsense"), 404, "not-found").await;
    problem(service.post("/v1/measurements?quantity=brd").body("x"), 400, "bad-query").await;
    problem(service.post("/v1/measurements?name=").body("x"), 400, "bad-query").await;
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn other_origins_read_and_do_not_write() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let read = service.get("/v1/formats").header("origin", "https://example.org").send().await.unwrap();
    assert_eq!(read.headers()["access-control-allow-origin"], "*");
    let write = service.post("/v1/measurements").header("origin", "https://example.org").body(D65);
    problem(write, 403, "cross-origin-write").await;
    let own = service.post("/v1/measurements").header("origin", &service.base).body(D65).send().await.unwrap();
    assert_eq!(own.status(), StatusCode::CREATED);
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn slow_and_broken_clients_are_not_waited_for() {
    let data = tempfile::tempdir().unwrap();
    let mut config = config(data.path());
    config.work.limits.idle = Duration::from_millis(300);
    let service = Service::start(config).await;
    let address = service.base.trim_start_matches("http://").to_owned();
    let talk = async |words: &[u8]| -> String {
        let mut stream = tokio::net::TcpStream::connect(&address).await.unwrap();
        stream.write_all(words).await.unwrap();
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer).await;
        String::from_utf8_lossy(&answer).into_owned()
    };
    let half_a_body = b"POST /v1/measurements HTTP/1.1\r\nhost: x\r\ncontent-length: 1000\r\n\r\nhalf";
    assert!(talk(half_a_body).await.contains("urn:wavelume:problem:too-slow"));
    let half_a_header = b"POST /v1/measurements HTTP/1.1\r\nho";
    let answer = talk(half_a_header).await;
    assert!(answer.is_empty() || answer.starts_with("HTTP/1.1 408"), "{answer}");
    let oversize =
        b"POST /v1/measurements HTTP/1.1\r\nhost: x\r\nconnection: close\r\ncontent-length: 99999999999\r\n\r\n";
    assert!(talk(oversize).await.contains("urn:wavelume:problem:too-large"));

    let mut stream = tokio::net::TcpStream::connect(&address).await.unwrap();
    stream.write_all(half_a_body).await.unwrap();
    drop(stream);

    let large = npy(&[100, 1024, 75]);
    let path = service.upload("", large.clone()).await["links"]["content"].as_str().unwrap().to_owned();
    let mut deaf = tokio::net::TcpStream::connect(&address).await.unwrap();
    deaf.write_all(format!("GET {path} HTTP/1.1\r\nhost: x\r\n\r\n").as_bytes()).await.unwrap();
    tokio::time::sleep(Duration::from_secs(2)).await;
    let mut heard = Vec::new();
    let _ = deaf.read_to_end(&mut heard).await;
    assert!(heard.len() < large.len(), "a client that does not read is not waited for");
    service.upload("", D65).await;
    service.stop().await;
    assert_eq!(std::fs::read_dir(data.path().join("staging")).unwrap().count(), 0);
}

#[tokio::test(flavor = "multi_thread")]
async fn too_many_uploads_are_told_to_come_again() {
    let data = tempfile::tempdir().unwrap();
    let mut config = config(data.path());
    config.work.limits.uploads = 0;
    let service = Service::start(config).await;
    let busy = service.post("/v1/measurements").body(D65).send().await.unwrap();
    assert!(busy.headers().contains_key("retry-after"));
    problem_of(busy, 503, "overloaded").await;
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_second_start_finds_what_is_there_and_two_at_once_share_it() {
    let data = tempfile::tempdir().unwrap();
    let first = Service::start(config(data.path())).await;
    let id = first.material().await;
    let second = Service::start(config(data.path())).await;
    second.get(&format!("/v1/materials/{id}")).send().await.unwrap().error_for_status().unwrap();
    first.stop().await;
    assert_eq!(second.material().await, id);
    second.stop().await;
    let third = Service::start(config(data.path())).await;
    third.get(&format!("/v1/materials/{id}/content")).send().await.unwrap().error_for_status().unwrap();

    let taken: std::net::SocketAddr = third.base.trim_start_matches("http://").parse().unwrap();
    let mut other = config(data.path());
    other.listen = taken;
    let error = Server::bind(other).await.unwrap_err();
    assert!(matches!(error, ServeError::Listen { .. }));
    assert!(error.to_string().contains(&taken.to_string()) && error.to_string().contains("--listen"), "{error}");
    third.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stop_hands_the_running_job_to_the_next() {
    let data = tempfile::tempdir().unwrap();
    let mut short = config(data.path());
    short.work.limits.drain = Duration::from_millis(200);
    let service = Service::start(short).await;
    let array = service.upload("", npy(&LONG_SHAPE)).await;
    let job: Value =
        service.post("/v1/jobs").json(&long_request(&array["id"])).send().await.unwrap().json().await.unwrap();
    let path = job["links"]["self"].as_str().unwrap();
    while service.get(path).send().await.unwrap().json::<Value>().await.unwrap()["state"] == "queued" {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    service.stop().await;
    let mut idle = config(data.path());
    idle.work.workers = 0;
    let next = Service::start(idle).await;
    let state = next.get(path).send().await.unwrap().json::<Value>().await.unwrap();
    assert_eq!((state["state"].as_str(), state["attempts"].as_u64()), (Some("queued"), Some(0)), "{state}");
    next.stop().await;
}

#[test]
fn the_committed_description_is_the_generated_one() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/openapi.yaml");
    let generated = wavelume::api::openapi().to_yaml().unwrap();
    if std::env::var_os("UPDATE_OPENAPI").is_some() {
        std::fs::write(file, &generated).unwrap();
    }
    let committed = std::fs::read_to_string(file).unwrap_or_default();
    assert!(committed == generated, "openapi.yaml is not what the router says: run `wavelume openapi > openapi.yaml`");
}

#[tokio::test(flavor = "multi_thread")]
async fn the_description_and_the_router_have_the_same_routes() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let described: Value = service.get("/openapi.json").send().await.unwrap().json().await.unwrap();
    let paths = described["paths"].as_object().unwrap();
    assert!(paths.len() >= 20, "{}", paths.len());
    let operations = paths.values().flat_map(|operations| operations.as_object().unwrap().values());
    let mut names: Vec<&str> = operations.map(|operation| operation["operationId"].as_str().unwrap()).collect();
    let count = names.len();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), count, "an operation has a name of its own");
    for (path, operations) in paths {
        let path = path.replace("{id}", "b3-0").replace("{digest}", "b3-0");
        for method in ["get", "post", "delete", "put", "patch"] {
            let request = service.request(method.to_uppercase().parse().unwrap(), &path);
            let response = request.send().await.unwrap();
            let status = response.status();
            let text = response.text().await.unwrap();
            assert!(!text.contains("no route is at"), "{path}");
            let there = status != StatusCode::METHOD_NOT_ALLOWED;
            assert_eq!(there, operations.get(method).is_some(), "{method} {path}: {status}");
        }
    }
    // Nothing is routed beside the description.
    for entry in std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/src/api")).unwrap() {
        let path = entry.unwrap().path();
        let source = std::fs::read_to_string(&path).unwrap();
        assert!(!source.contains(".route("), "{} adds a route that the description does not know", path.display());
    }
    service.stop().await;
}
