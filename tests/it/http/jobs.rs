//! Jobs, their events and their ends.

use crate::cli::noisy_lobe;
use crate::service::{CHECKER, D65, LAMP, LONG_SHAPE, Service, config, long_request, npy, problem, problem_of};
use reqwest::{Method, StatusCode};
use serde_json::{Value, json};
use std::time::Duration;
use wavelume::Archive;
use wavelume::store::Digest;

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
        let bad = json!({ "measurement": id, "target": target });
        let refusal = problem(service.post("/v1/jobs").json(&bad), 422, "bad-setting").await;
        assert!(refusal["detail"].as_str().unwrap().contains("expected more than 0"), "{refusal}");
    }
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_interpolation_of_a_job_is_written_into_the_file_and_obeyed() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let lamp = service.upload("", LAMP).await["id"].clone();
    let request = |curve: &str| json!({ "measurement": lamp, "target": { "er_l2": 0.01 }, "interpolation": curve });
    let mut made = Vec::new();
    for curve in ["cubic", "linear"] {
        let job = service.compress(&request(curve)).await;
        assert_eq!(job["state"], "succeeded", "{job}");
        made.push(format!("/v1/materials/{}", job["material"].as_str().unwrap()));
    }
    let value = async |path: &str, gamma: f64, how: &str| -> f64 {
        let query = format!("{path}/spectrum?wo={},0&interpolation={how}", 180.0 - gamma);
        let answer: Value = service.get(&query).send().await.unwrap().json().await.unwrap();
        answer["values"][0].as_f64().unwrap_or_else(|| panic!("{query}: {answer}"))
    };
    // Rows of the file are 2.5 degrees apart.
    for (path, is_linear) in [(&made[0], false), (&made[1], true)] {
        let stated = [value(path, 40.0, "smooth").await, value(path, 42.5, "smooth").await];
        let between = value(path, 41.25, "smooth").await;
        let is_mean = (between / (0.5 * (stated[0] + stated[1])) - 1.0).abs() < 1e-6;
        assert_eq!(is_mean, is_linear, "{stated:?} {between}");
        assert_eq!(value(path, 42.0, "constant").await, value(path, 42.5, "constant").await);
    }
    let answer: Value = service.get(&made[1]).send().await.unwrap().json().await.unwrap();
    assert_eq!(answer["provenance"]["request"]["interpolation"], "linear", "{answer}");
    let refusal = problem(service.post("/v1/jobs").json(&request("smooth")), 422, "invalid-request").await;
    assert!(refusal["detail"].as_str().unwrap().contains("cubic"), "{refusal}");
    let mut triangles = request("linear");
    triangles["domain"] = json!("triangles");
    let job = service.compress(&triangles).await;
    assert_eq!(job["problem"]["type"], "urn:wavelume:problem:bad-setting", "{job}");
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_a_material_adds_to_the_noise_is_stated_or_refused() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let scan = service.upload("?filename=lobe.csv", noisy_lobe()).await;
    let request = |strict: bool| json!({ "measurement": scan["id"], "target": { "er_l2": 0.01 }, "outgoing_level": 1, "strict": strict });
    let job = service.compress(&request(false)).await;
    let path = format!("/v1/materials/{}", job["material"].as_str().unwrap());
    let material: Value = service.get(&path).send().await.unwrap().json().await.unwrap();
    let number = |name: &str| material["scattered"][name].as_f64().unwrap();
    assert!(number("added") > number("allowed") && number("fit") > number("noise"), "{material}");
    assert_eq!(material["er_l2"], material["scattered"]["fit"], "{material}");
    let job = service.compress(&request(true)).await;
    assert_eq!((job["state"].as_str(), job["attempts"].as_u64()), (Some("failed"), Some(1)), "{job}");
    assert_eq!(job["problem"]["type"], "urn:wavelume:problem:unreachable-target", "{job}");
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
    for (setting, value, reason) in [
        ("basis", json!("nonsense"), "option basis: unknown basis `nonsense`, expected auto"),
        ("wavelengths", json!("780:380:5"), "option wavelengths: "),
        (
            "floor",
            json!(1),
            "option floor: found 1.0, expected more than 0 and less than 1, a fraction of the largest sample",
        ),
        ("incoming_level", json!(9), "option incoming_level: found 9, expected a whole number from 0 to 8"),
    ] {
        let mut request = json!({ "measurement": id, "target": { "er_l2": 0.01 } });
        request[setting] = value;
        let refusal = problem(service.post("/v1/jobs").json(&request), 422, "bad-setting").await;
        assert!(refusal["detail"].as_str().unwrap().starts_with(reason), "{refusal}");
    }
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_without_a_target_promises_one_per_cent() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let id = service.upload("", D65).await["id"].clone();
    let job = service.compress(&json!({ "measurement": id })).await;
    let stated = service.compress(&json!({ "measurement": id, "target": { "er_l2": 0.01 } })).await;
    assert_eq!((&job["state"], &job["material"]), (&json!("succeeded"), &stated["material"]));
    let path = format!("/v1/materials/{}", job["material"].as_str().unwrap());
    let material: Value = service.get(&path).send().await.unwrap().json().await.unwrap();
    assert_eq!(material["provenance"]["request"]["target"], json!({ "er_l2": 0.01 }), "{material}");
    assert!(material["er_l2"].as_f64().unwrap() <= 0.01, "{material}");
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_report_on_the_papers_tables_is_a_job() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let post = |body: Value| service.post("/v1/jobs").header("prefer", "wait=60").json(&body);
    for (tables, found) in [(json!([0]), "found 0"), (json!([1, 300]), "found 300"), (json!([]), "an empty list")] {
        let refusal = problem(post(json!({ "kind": "paper", "tables": tables })), 422, "invalid-request").await;
        assert!(refusal["detail"].as_str().unwrap().contains(found), "{refusal}");
    }
    problem(post(json!({ "kind": "paper", "target": "lossless" })), 422, "invalid-request").await;
    let refusal = problem(post(json!({ "kind": "poster" })), 422, "invalid-request").await;
    assert!(refusal["detail"].as_str().unwrap().starts_with("unknown variant `poster`, expected "), "{refusal}");

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

    let archive = Archive::serve(&config(data.path()).work.site).await.unwrap();
    let swept = archive.sweep().await.unwrap();
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
    let ids: Vec<&str> = text.lines().filter_map(|line| line.strip_prefix("id: ")).collect();
    assert_eq!(ids.len(), states.len(), "{text}");
    assert!(ids.windows(2).all(|pair| pair[0] != pair[1]), "{ids:?}");
    // A browser asks again when a stream has ended: for what has changed since, and not at all after the end.
    let again = async |last: Option<&str>| {
        let request = service.get(job["links"]["events"].as_str().unwrap());
        let answer = last.map_or(request.try_clone().unwrap(), |last| request.header("last-event-id", last));
        let answer = answer.send().await.unwrap();
        (answer.status(), answer.text().await.unwrap())
    };
    assert_eq!(again(ids.last().copied()).await, (StatusCode::NO_CONTENT, String::new()));
    for last in [None, Some("another"), Some(ids[0])] {
        let (status, rest) = again(last).await;
        assert_eq!((status, rest.matches("event: ").count()), (StatusCode::OK, 1), "{last:?}: {rest}");
        assert!(rest.contains("event: state") && rest.contains("\"state\":\"cancelled\""), "{last:?}: {rest}");
    }
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

#[tokio::test(flavor = "multi_thread")]
async fn a_priority_is_shown_obeyed_and_no_part_of_the_key() {
    let data = tempfile::tempdir().unwrap();
    let mut idle = config(data.path());
    idle.work.workers = 0;
    let service = Service::start(idle).await;
    let id = service.upload("", D65).await["id"].clone();
    let queue = async |priority: Value| -> Value {
        let body = json!({ "measurement": id, "target": { "er_l2": 0.01 }, "priority": priority });
        let response = service.post("/v1/jobs").header("idempotency-key", "one").json(&body).send().await.unwrap();
        assert_eq!(response.status(), StatusCode::ACCEPTED);
        response.json().await.unwrap()
    };
    let (batch, again) = (queue(json!(1)).await, queue(json!(-1)).await);
    assert_eq!((&batch["id"], &again["priority"]), (&again["id"], &json!(1)), "the first request counts");
    for wrong in [json!(2), json!(-2), json!(0.5), json!("urgent"), json!(null)] {
        let body = json!({ "kind": "paper", "tables": [2], "priority": wrong });
        let refusal = problem(service.post("/v1/jobs").json(&body), 422, "invalid-request").await;
        assert!(refusal["detail"].as_str().unwrap().contains("expected"), "{refusal}");
    }
    let urgent = json!({ "kind": "paper", "tables": [2], "priority": -1 });
    let urgent: Value = service.post("/v1/jobs").json(&urgent).send().await.unwrap().json().await.unwrap();
    let page: Value = service.get("/v1/jobs").send().await.unwrap().json().await.unwrap();
    let shown: Vec<&Value> = page["items"].as_array().unwrap().iter().map(|job| &job["priority"]).collect();
    assert_eq!(shown, [&json!(-1), &json!(1)]);
    service.stop().await;
    let worker = Service::start(config(data.path())).await;
    let until = async |job: &Value| loop {
        let path = job["links"]["self"].as_str().unwrap();
        let job: Value = worker.get(path).send().await.unwrap().json().await.unwrap();
        if job["state"] == "succeeded" {
            return job["updated_ms"].as_i64().unwrap();
        }
        tokio::time::sleep(Duration::from_millis(20)).await;
    };
    let (batch, urgent) = (until(&batch).await, until(&urgent).await);
    assert!(urgent <= batch, "the urgent job ended at {urgent} ms, the batch job at {batch} ms");
    worker.stop().await;
}
