//! Access by keys: every route with every scope and without a key, keys that end, guesses, and what nobody may read.

use crate::service::{D65, Service, config, problem, problem_of};
use futures::StreamExt;
use reqwest::header::HeaderValue;
use reqwest::{Body, Method, RequestBuilder, StatusCode};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::process::Command;
use std::time::{Duration, Instant};
use tokio::io::AsyncWriteExt;
use wavelume::api::{AuthMode, ServeConfig, ServeError, Server, openapi};

const SCOPES: [&str; 5] = ["read", "write", "jobs", "tenant", "instance"];

/// Returns the text of a new key.
fn generated() -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_wavelume")).args(["keys", "generate"]).output().unwrap();
    String::from_utf8(output.stdout).unwrap().trim().to_owned()
}

/// Configuration of a service with keys, and the text of its first key.
pub(super) fn guarded(data: &std::path::Path) -> (ServeConfig, String) {
    let mut config = config(data);
    let first = generated();
    config.auth = AuthMode::Keys;
    config.bootstrap_key = Some(first.parse().unwrap());
    (config, first)
}

/// Makes a key with the scopes, and returns its text and its id.
async fn made(service: &Service, by: &str, request: &Value) -> (String, String) {
    let answer = service.post("/v1/keys").bearer_auth(by).json(request).send().await.unwrap();
    assert_eq!(answer.status(), StatusCode::CREATED, "{}", answer.text().await.unwrap());
    assert_eq!(answer.headers()["cache-control"], "no-store");
    let made: Value = answer.json().await.unwrap();
    (made["key"].as_str().unwrap().to_owned(), made["id"].as_str().unwrap().to_owned())
}

/// A route of the description: method, path and the scope that it names; `None` if it is public.
fn routes() -> Vec<(Method, String, Option<String>)> {
    let description: Value = serde_json::from_str(&openapi().to_json().unwrap()).unwrap();
    let mut routes = Vec::new();
    for (path, item) in description["paths"].as_object().unwrap() {
        for (method, operation) in item.as_object().unwrap() {
            let Ok(method) = Method::from_bytes(method.to_uppercase().as_bytes()) else { continue };
            let Some(operation) = operation.as_object().filter(|operation| operation.contains_key("operationId"))
            else {
                continue;
            };
            let scope = operation.get("security").map(|security| {
                assert_eq!(security[0], json!({}), "a service without keys needs none");
                security[1]["key"][0].as_str().unwrap().to_owned()
            });
            routes.push((method.clone(), path.clone(), scope.clone()));
            if method == Method::GET {
                routes.push((Method::HEAD, path.clone(), scope));
            }
        }
    }
    routes
}

/// A service with a measurement, a material and a job, and a path of the description that leads to them.
pub(super) struct Filled {
    measurement: String,
    pub(super) material: String,
    job: String,
}

impl Filled {
    pub(super) async fn new(service: &Service, key: &str) -> Self {
        let posted = service.post("/v1/measurements?filename=d65.csv").bearer_auth(key).body(D65).send().await.unwrap();
        let measurement: Value = posted.json().await.unwrap();
        let body = json!({ "measurement": measurement["id"], "target": { "er_l2": 0.01 } });
        let posted = service.post("/v1/jobs").bearer_auth(key).header("prefer", "wait=60").json(&body);
        let job: Value = posted.send().await.unwrap().json().await.unwrap();
        let text = |value: &Value| value.as_str().unwrap_or_else(|| panic!("{job}")).to_owned();
        Self { measurement: text(&measurement["id"]), material: text(&job["material"]), job: text(&job["id"]) }
    }

    /// Returns a request for a route: of what is there, but for deletions, which find nothing.
    fn request(&self, service: &Service, method: &Method, path: &str) -> RequestBuilder {
        let absent = "b3-0000000000000000000000000000000000000000000000000000000000000000";
        let deletes = *method == Method::DELETE;
        let id = match path {
            _ if path.starts_with("/v1/jobs") => &self.job,
            _ if path.starts_with("/v1/uploads") => "00000000000000000000000000000000",
            _ if path.starts_with("/v1/keys") => "0000000000",
            _ if deletes => absent,
            _ if path.starts_with("/v1/measurements") => &self.measurement,
            _ => &self.material,
        };
        let path = path.replace("{id}", id).replace("{digest}", &self.material).replace("{name}", "npy-manifest");
        let path = path.replace("{tenant}", "default");
        let request = service.request(method.clone(), &path).header("tus-resumable", "1.0.0");
        match *method {
            Method::POST if path.ends_with("/evaluate") => request.json(&json!({ "wo": [[0, 0]] })),
            Method::POST if path.starts_with("/v1/uploads/") => {
                request.header("x-http-method-override", "DELETE").body("")
            }
            Method::POST => request.json(&json!({})),
            _ => request,
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn every_route_asks_for_its_scope_and_no_other_opens_it() {
    let data = tempfile::tempdir().unwrap();
    let (mut config, first) = guarded(data.path());
    // Two hundred refusals are no guesses; nor are they the ones of this test.
    config.work.limits.wrong_keys = 100_000;
    let service = Service::start(config).await;
    let filled = Filled::new(&service, &first).await;
    let mut keys = Vec::new();
    for scope in SCOPES {
        keys.push((scope, made(&service, &first, &json!({ "scopes": [scope], "name": scope })).await.0));
    }
    let routes = routes();
    assert!(routes.len() > 50, "{}", routes.len());
    for (method, path, needed) in &routes {
        let request = || filled.request(&service, method, path);
        let name = format!("{method} {path}");
        let bare = request().send().await.unwrap();
        let unknown = request().bearer_auth(generated()).send().await.unwrap();
        let Some(needed) = needed else {
            assert!(![401, 403].contains(&bare.status().as_u16()), "{name}: {}", bare.status());
            assert_eq!(unknown.status(), bare.status(), "{name}");
            continue;
        };
        for refused in [bare, unknown] {
            assert_eq!(refused.status(), StatusCode::UNAUTHORIZED, "{name}");
            assert_eq!(refused.headers()["www-authenticate"], "Bearer realm=\"wavelume\"", "{name}");
            if *method != Method::HEAD {
                problem_of(refused, 401, "unauthorized").await;
            }
        }
        for (scope, key) in &keys {
            let answer = request().bearer_auth(key).send().await.unwrap();
            let status = answer.status().as_u16();
            if scope == needed || needed == "tenant" && *scope == "instance" {
                assert!(![401, 403].contains(&status) && status < 500, "{name} with {scope}: {status}");
                assert!(answer.headers().get_all("vary").iter().any(|value| value == "authorization"), "{name}");
                let cached = answer.headers().get("cache-control").map(|value| value.to_str().unwrap().to_owned());
                assert!(cached.is_none_or(|value| !value.contains("public")), "{name}");
            } else {
                assert_eq!(status, 403, "{name} with {scope}");
                if *method != Method::HEAD {
                    let problem = problem_of(answer, 403, "missing-scope").await;
                    assert!(problem["detail"].as_str().unwrap().contains(needed.as_str()), "{problem}");
                }
            }
        }
    }
    // Methods that a path does not have, and paths that do not exist, tell nothing and reach nothing.
    let wrong = service.request(Method::PUT, "/v1/jobs").send().await.unwrap();
    assert_eq!(wrong.headers()["allow"], "POST,GET,HEAD");
    problem_of(wrong, 405, "method-not-allowed").await;
    problem(service.get("/v1/nothing"), 404, "not-found").await;
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_a_key_made_warm_is_not_served_without_one() {
    let data = tempfile::tempdir().unwrap();
    let (config, first) = guarded(data.path());
    let service = Service::start(config).await;
    let Filled { material, .. } = Filled::new(&service, &first).await;
    for path in ["content", "spectrum", "preview.png?wi=0,0"] {
        let path = format!("/v1/materials/{material}/{path}");
        let warm = service.get(&path).bearer_auth(&first).send().await.unwrap();
        let tag = warm.headers().get("etag").cloned();
        problem(service.get(&path), 401, "unauthorized").await;
        if let Some(tag) = tag {
            problem(service.get(&path).header("if-none-match", tag.clone()), 401, "unauthorized").await;
            problem(service.get(&path).header("if-range", tag).header("range", "bytes=0-1"), 401, "unauthorized").await;
        }
    }
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_revoked_key_is_refused_at_once_here_and_within_five_seconds_elsewhere() {
    let data = tempfile::tempdir().unwrap();
    let (config, first) = guarded(data.path());
    let (here, elsewhere) = (Service::start(config.clone()).await, Service::start(config).await);
    let (key, id) = made(&here, &first, &json!({ "scopes": ["read", "jobs"] })).await;
    for service in [&here, &elsewhere] {
        let read = service.get("/v1/materials").bearer_auth(&key).send().await.unwrap();
        assert_eq!(read.status(), StatusCode::OK);
    }
    // A stream that goes on for as long as the job waits.
    let long = here.post("/v1/jobs").bearer_auth(&key).json(&json!({ "kind": "paper" })).send().await.unwrap();
    let long: Value = long.json().await.unwrap();
    let events = elsewhere.get(long["links"]["events"].as_str().unwrap()).bearer_auth(&key).send().await.unwrap();
    assert_eq!(events.status(), StatusCode::OK);
    let mut events = events.bytes_stream();
    events.next().await.unwrap().unwrap();

    let revoked = here.request(Method::DELETE, &format!("/v1/keys/{id}")).bearer_auth(&first).send().await.unwrap();
    assert_eq!(revoked.status(), StatusCode::NO_CONTENT);
    let since = Instant::now();
    let refusal = problem(here.get("/v1/materials").bearer_auth(&key), 401, "unauthorized").await;
    assert!(refusal["detail"].as_str().unwrap().contains("revoked"), "{refusal}");
    while elsewhere.get("/v1/materials").bearer_auth(&key).send().await.unwrap().status() == StatusCode::OK {
        assert!(since.elapsed() < Duration::from_secs(5), "still accepted");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    problem(elsewhere.get("/v1/materials").bearer_auth(&key), 401, "unauthorized").await;
    let end = async { while events.next().await.is_some_and(|piece| piece.is_ok()) {} };
    tokio::time::timeout(Duration::from_secs(5), end).await.expect("the stream of a revoked key ends");

    here.post(long["links"]["cancel"].as_str().unwrap()).bearer_auth(&first).send().await.unwrap();
    here.stop().await;
    elsewhere.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_under_way_is_refused_when_its_key_is_revoked_and_nothing_is_named() {
    let data = tempfile::tempdir().unwrap();
    let (config, first) = guarded(data.path());
    let (here, elsewhere) = (Service::start(config.clone()).await, Service::start(config).await);
    let (key, id) = made(&here, &first, &json!({ "scopes": ["read", "write", "jobs"] })).await;
    let begun = here.post("/v1/uploads").bearer_auth(&key).header("tus-resumable", "1.0.0");
    let begun = begun.header("upload-length", D65.len()).send().await.unwrap();
    let upload = begun.headers()["location"].to_str().unwrap().to_owned();
    let mut senders = Vec::new();
    let mut slow = |request: RequestBuilder| {
        let (sender, body) = tokio::io::duplex(1 << 16);
        let request = request.bearer_auth(&key).body(Body::wrap_stream(tokio_util::io::ReaderStream::new(body)));
        senders.push(sender);
        tokio::spawn(request.send())
    };
    let part = elsewhere.request(Method::PATCH, &upload).header("tus-resumable", "1.0.0");
    let part = part.header("upload-offset", 0).header("content-type", "application/offset+octet-stream");
    let mut under_way = vec![
        slow(here.post("/v1/measurements?filename=d65.csv")),
        slow(elsewhere.post("/v1/measurements?filename=d65.csv")),
        slow(elsewhere.post("/v1/materials")),
        slow(part),
    ];
    for sender in &mut senders {
        sender.write_all(&D65[..D65.len() / 2]).await.unwrap();
    }
    let waiting = elsewhere.post("/v1/jobs").bearer_auth(&key).header("prefer", "wait=60");
    under_way.push(tokio::spawn(waiting.json(&json!({ "kind": "paper" })).send()));
    let jobs = async || -> Value {
        here.get("/v1/jobs").bearer_auth(&first).send().await.unwrap().json::<Value>().await.unwrap()["items"].clone()
    };
    while jobs().await.as_array().unwrap().is_empty() {
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    let revoked = here.request(Method::DELETE, &format!("/v1/keys/{id}")).bearer_auth(&first).send().await.unwrap();
    assert_eq!(revoked.status(), StatusCode::NO_CONTENT);
    for request in under_way {
        let answer = tokio::time::timeout(Duration::from_secs(20), request).await.expect("it is refused");
        let refusal = problem_of(answer.unwrap().unwrap(), 401, "unauthorized").await;
        assert!(refusal["detail"].as_str().unwrap().contains("revoked while"), "{refusal}");
    }
    for mut sender in senders {
        // The connection is closed.
        let _ = sender.write_all(&D65[D65.len() / 2..]).await;
    }
    for path in ["/v1/measurements", "/v1/materials"] {
        let list: Value = here.get(path).bearer_auth(&first).send().await.unwrap().json().await.unwrap();
        assert_eq!(list["items"], json!([]), "{path}");
    }
    // Another key of the tenant goes on with the upload, of which the cut request has left nothing.
    let head = here.request(Method::HEAD, &upload).bearer_auth(&first).header("tus-resumable", "1.0.0");
    let head = head.send().await.unwrap();
    assert_eq!((head.status(), &head.headers()["upload-offset"]), (StatusCode::OK, &HeaderValue::from_static("0")));
    // The job was accepted while the key was valid.
    let job = jobs().await[0].clone();
    assert!(job["state"] == "queued" || job["state"] == "running", "{job}");
    here.post(job["links"]["cancel"].as_str().unwrap()).bearer_auth(&first).send().await.unwrap();
    here.stop().await;
    elsewhere.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn keys_expire_and_give_no_more_than_their_makers_have() {
    let data = tempfile::tempdir().unwrap();
    let (config, first) = guarded(data.path());
    let service = Service::start(config).await;
    let (brief, _) = made(&service, &first, &json!({ "scopes": ["read"], "valid_s": 1 })).await;
    let (admin, admin_id) = made(&service, &first, &json!({ "scopes": ["read", "tenant"], "name": "admin" })).await;
    let (_, own) = made(&service, &admin, &json!({ "scopes": ["read"] })).await;

    let ask = |body: Value| service.post("/v1/keys").bearer_auth(&admin).json(&body);
    problem(ask(json!({ "scopes": ["read", "write"] })), 403, "missing-scope").await;
    problem(ask(json!({ "scopes": ["instance"] })), 403, "missing-scope").await;
    problem(ask(json!({ "scopes": ["read"], "tenant": "other" })), 403, "missing-scope").await;
    problem(ask(json!({ "scopes": [] })), 422, "invalid-request").await;
    problem(ask(json!({ "scopes": ["root"] })), 422, "invalid-request").await;
    problem(ask(json!({ "scopes": ["read"], "valid_s": 0 })), 422, "invalid-request").await;
    problem(ask(json!({ "scopes": ["read"], "valid_s": 366 * 86_400 })), 422, "invalid-request").await;
    problem(ask(json!({ "scopes": ["read"], "name": "a\nb" })), 422, "invalid-request").await;
    let nobody = service.post("/v1/keys").bearer_auth(&first).json(&json!({ "scopes": ["read"], "tenant": "nobody" }));
    problem(nobody, 422, "invalid-request").await;

    let list: Value = service.get("/v1/keys?limit=3").bearer_auth(&admin).send().await.unwrap().json().await.unwrap();
    assert_eq!((list["items"].as_array().unwrap().len(), &list["items"][0]["id"]), (3, &json!(own)));
    assert_eq!(list["items"][0]["created_by"], format!("key {admin_id}"));
    let rest = format!("/v1/keys?cursor={}", list["next"].as_str().unwrap());
    let rest: Value = service.get(&rest).bearer_auth(&admin).send().await.unwrap().json().await.unwrap();
    assert_eq!((&rest["items"][0]["name"], &rest["next"]), (&json!("bootstrap"), &Value::Null));
    problem(service.get("/v1/keys?tenant=other").bearer_auth(&admin), 403, "missing-scope").await;
    problem(service.get("/v1/keys?tenant=A").bearer_auth(&admin), 400, "bad-query").await;
    problem(service.request(Method::DELETE, "/v1/keys/0000000000").bearer_auth(&admin), 404, "not-found").await;
    problem(service.request(Method::DELETE, "/v1/keys/x").bearer_auth(&admin), 404, "not-found").await;

    tokio::time::sleep(Duration::from_millis(1100)).await;
    let refusal = problem(service.get("/v1/materials").bearer_auth(&brief), 401, "unauthorized").await;
    assert!(refusal["detail"].as_str().unwrap().contains("expired"), "{refusal}");
    // A key for the whole service is not revoked by the administrator of its tenant.
    let operator = format!("/v1/keys/{}", &first[4..14]);
    let refusal = problem(service.request(Method::DELETE, &operator).bearer_auth(&admin), 403, "missing-scope").await;
    assert!(refusal["detail"].as_str().unwrap().contains("scope `instance`"), "{refusal}");
    assert_eq!(service.get("/v1/keys").bearer_auth(&first).send().await.unwrap().status(), StatusCode::OK);
    let audit: Value = service.get("/v1/audit?limit=2").bearer_auth(&admin).send().await.unwrap().json().await.unwrap();
    let newest = &audit["items"][0];
    assert_eq!((&newest["action"], &newest["subject"]), (&json!("key.create"), &json!(own)), "{audit}");
    assert_eq!((&newest["actor"], &newest["address"]), (&json!(format!("key {admin_id}")), &json!("127.0.0.1")));
    assert!(newest["request"].is_string() && audit["next"].is_string(), "{audit}");
    problem(service.get("/v1/audit?unowned=true").bearer_auth(&admin), 403, "missing-scope").await;
    let filled = Filled::new(&service, &first).await;
    let path = format!("/v1/materials/{}", filled.material);
    assert_eq!(service.request(Method::DELETE, &path).bearer_auth(&first).send().await.unwrap().status(), 204);
    assert_eq!(service.request(Method::DELETE, &path).bearer_auth(&first).send().await.unwrap().status(), 404);
    let audit: Value = service.get("/v1/audit?limit=3").bearer_auth(&admin).send().await.unwrap().json().await.unwrap();
    let acts: Vec<_> = audit["items"].as_array().unwrap().iter().map(|act| (&act["action"], &act["subject"])).collect();
    let expected = [
        ("material.delete", &filled.material),
        ("job.create", &filled.job),
        ("measurement.upload", &filled.measurement),
    ];
    assert_eq!(
        acts,
        expected.map(|(action, id)| (json!(action), json!(id))).iter().map(|(a, b)| (a, b)).collect::<Vec<_>>()
    );
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_key_makes_none_that_outlives_it_and_a_tenant_has_so_many() {
    let data = tempfile::tempdir().unwrap();
    let (mut config, first) = guarded(data.path());
    config.work.limits.keys_each = 4;
    let service = Service::start(config).await;
    let lab = service.post("/v1/tenants").bearer_auth(&first).json(&json!({ "id": "lab" })).send().await.unwrap();
    assert_eq!(lab.status(), StatusCode::CREATED);
    let hour = json!({ "scopes": ["read", "tenant"], "tenant": "lab", "valid_s": 3600 });
    let (admin, _) = made(&service, &first, &hour).await;
    let ask = |body: Value| service.post("/v1/keys").bearer_auth(&admin).json(&body);
    let refusal = problem(ask(json!({ "scopes": ["read"], "valid_s": 3700 })), 422, "invalid-request").await;
    assert!(refusal["detail"].as_str().unwrap().contains("when the key that makes it ends"), "{refusal}");
    let child: Value = ask(json!({ "scopes": ["read"] })).send().await.unwrap().json().await.unwrap();
    let list: Value = service.get("/v1/keys").bearer_auth(&admin).send().await.unwrap().json().await.unwrap();
    let ends: Vec<_> =
        list["items"].as_array().unwrap().iter().map(|key| key["expires_ms"].as_i64().unwrap()).collect();
    assert!(ends[0] <= ends[1] && ends[0] > ends[1] - 10_000, "{list}");
    let long = json!({ "scopes": ["tenant"], "tenant": "lab", "valid_s": 7200 });
    made(&service, &first, &long).await;
    made(&service, &admin, &json!({ "scopes": ["read"], "valid_s": 60 })).await;

    let refusal = problem(ask(json!({ "scopes": ["read"], "valid_s": 60 })), 403, "quota-exceeded").await;
    assert_eq!((&refusal["limit"], &refusal["used"]), (&json!(4), &json!(4)), "{refusal}");
    let child = format!("/v1/keys/{}", child["id"].as_str().unwrap());
    let revoked = service.request(Method::DELETE, &child).bearer_auth(&admin).send().await.unwrap();
    assert_eq!(revoked.status(), StatusCode::NO_CONTENT);
    made(&service, &admin, &json!({ "scopes": ["read"], "valid_s": 60 })).await;
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn guesses_at_once_are_no_more_than_guesses_in_turn_and_headers_of_others_are_none() {
    let data = tempfile::tempdir().unwrap();
    let (mut config, first) = guarded(data.path());
    config.work.limits.connections_each = 256;
    let service = Service::start(config).await;
    let (late, _) = made(&service, &first, &json!({ "scopes": ["read"] })).await;
    let guesser = reqwest::Client::builder().no_proxy().local_address(Some([127, 0, 0, 7].into())).build().unwrap();
    let url = format!("{}/v1/materials", service.base);
    // Neither the password of an outer proxy nor a query that is no link is a guess at a key.
    let odd = format!("{}/v1/materials/b3-{}/content?signature=x", service.base, "0".repeat(64));
    for _ in 0..15 {
        problem_of(guesser.get(&url).basic_auth("a", Some("b")).send().await.unwrap(), 401, "unauthorized").await;
        problem_of(guesser.get(&odd).send().await.unwrap(), 401, "unauthorized").await;
    }
    let wrong: Vec<String> = (0..200).map(|_| generated()).collect();
    let answers = futures::future::join_all(wrong.iter().map(async |key| {
        let answer = guesser.get(&url).bearer_auth(key).send().await.unwrap();
        answer.status().as_u16()
    }));
    let others = async {
        for _ in 0..20 {
            let read = service.get("/v1/materials").bearer_auth(&first).send().await.unwrap();
            assert_eq!(read.status(), StatusCode::OK);
        }
        service.get("/v1/materials").bearer_auth(&late).send().await.unwrap().status()
    };
    let (answers, others) = tokio::join!(answers, others);
    assert_eq!(others, StatusCode::OK, "a key that was not known yet, from another address");
    let count = |status: u16| answers.iter().filter(|found| **found == status).count();
    assert_eq!((count(401), count(429)), (10, 190), "{answers:?}");
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn guesses_are_few_leave_a_trace_and_delay_nobody_else() {
    let data = tempfile::tempdir().unwrap();
    let (config, first) = guarded(data.path());
    let service = Service::start(config).await;
    let right = service.get("/v1/materials").bearer_auth(&first);
    assert_eq!(right.send().await.unwrap().status(), StatusCode::OK);
    let guesser = reqwest::Client::builder().no_proxy().local_address(Some([127, 0, 0, 7].into())).build().unwrap();
    let url = format!("{}/v1/materials", service.base);
    let guess = async |text: String| guesser.get(&url).bearer_auth(text).send().await.unwrap();
    let mut statuses = Vec::new();
    let wrong = generated();
    for number in 0..500 {
        // Some are well-formed, some are not.
        let text = if number % 3 == 0 { format!("wlm_{number}") } else { wrong.clone() };
        let answer = guess(text).await;
        if answer.status() == StatusCode::TOO_MANY_REQUESTS {
            let seconds: u64 = answer.headers()["retry-after"].to_str().unwrap().parse().unwrap();
            assert!((1..=60).contains(&seconds));
        }
        statuses.push(answer.status().as_u16());
    }
    assert_eq!(statuses[..10], [401; 10]);
    assert!(statuses[10..].iter().all(|status| *status == 429), "{statuses:?}");
    problem_of(guess(wrong.clone()).await, 429, "too-many-requests").await;
    // Whoever is known already goes on, even from there; and other addresses are not touched.
    assert_eq!(guess(first.clone()).await.status(), StatusCode::OK);
    problem(service.get("/v1/materials").bearer_auth(&wrong), 401, "unauthorized").await;
    let (other, _) = made(&service, &first, &json!({ "scopes": ["read"] })).await;
    let others = service.get("/v1/materials").bearer_auth(&other).send().await.unwrap();
    assert_eq!(others.status(), StatusCode::OK);

    let trail = async || -> Value {
        let page = service.get("/v1/audit?unowned=true").bearer_auth(&first).send().await.unwrap();
        page.json::<Value>().await.unwrap()["items"].clone()
    };
    let mut refused = Vec::new();
    for _ in 0..100 {
        refused = trail().await.as_array().unwrap().clone();
        refused.retain(|act| act["action"] == "key.refused" && act["address"] == "127.0.0.7");
        if refused.len() >= 2 {
            break;
        }
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    assert!((2..=10).contains(&refused.len()), "{refused:?}");
    assert!(refused.iter().any(|act| act["detail"].as_str().unwrap().contains("refused with 429")), "{refused:?}");
    assert!(!json!(refused).to_string().contains(&wrong[15..]), "{refused:?}");
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_service_without_keys_is_for_this_machine_alone() {
    let data = tempfile::tempdir().unwrap();
    for address in ["0.0.0.0:0", "[::]:0"] {
        let mut open = config(data.path());
        open.listen = address.parse().unwrap();
        let error = Server::bind(open.clone()).await.unwrap_err();
        assert!(matches!(error, ServeError::Unguarded { .. }));
        let text = error.to_string();
        for part in ["wavelume keys create", "wavelume serve", "--auth keys", "--insecure", address] {
            assert!(text.contains(part), "{text}");
        }
    }
    let service = Service::start(config(data.path())).await;
    for (name, value) in [("forwarded", "for=10.0.0.1"), ("x-forwarded-for", "10.0.0.1"), ("via", "1.1 proxy")] {
        for path in ["/", "/healthz", "/v1/materials", "/v1/nothing"] {
            let refusal = problem(service.get(path).header(name, value), 403, "passed-on").await;
            assert!(refusal["detail"].as_str().unwrap().contains(name), "{refusal}");
        }
    }
    let read = service.get("/v1/materials").header("authorization", "Bearer x").send().await.unwrap();
    assert_eq!(read.status(), StatusCode::OK, "without keys a key is not looked at");
    assert!(read.headers().get("vary").is_none());
    let (_, id) = made(&service, "x", &json!({ "scopes": ["instance"] })).await;
    let listed: Value = service.get("/v1/keys").send().await.unwrap().json().await.unwrap();
    assert_eq!((&listed["items"][0]["id"], &listed["items"][0]["created_by"]), (&json!(id), &json!("everybody")));
    service.stop().await;

    let mut insecure = config(data.path());
    insecure.insecure = true;
    let service = Service::start(insecure).await;
    let read = service.get("/v1/materials").header("x-forwarded-for", "10.0.0.1").send().await.unwrap();
    assert_eq!(read.status(), StatusCode::OK);
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn without_a_key_only_public_materials_are_read() {
    let data = tempfile::tempdir().unwrap();
    let (mut config, first) = guarded(data.path());
    config.auth = AuthMode::KeysAndAnonymousRead;
    let service = Service::start(config).await;
    let Filled { material, measurement, .. } = Filled::new(&service, &first).await;
    let others = ["/v1/jobs", "/v1/measurements", "/v1/keys", "/v1/audit", "/metrics"].map(str::to_owned);
    for path in others.into_iter().chain([format!("/v1/measurements/{measurement}")]) {
        problem(service.get(&path), 401, "unauthorized").await;
    }
    problem(service.post("/v1/materials").body("x"), 401, "unauthorized").await;
    problem(service.get("/v1/materials").bearer_auth(generated()), 401, "unauthorized").await;
    let one = format!("/v1/materials/{material}");
    let paths = ["", "/content", "/spectrum", "/preview.png"].map(|part| format!("{one}{part}"));
    for path in paths.iter().chain([&format!("/v1/blobs/{material}")]) {
        let warm = service.get(path).bearer_auth(&first).send().await.unwrap();
        assert_eq!(warm.status(), StatusCode::OK, "{path}");
        problem(service.get(path), 404, "not-found").await;
    }
    let list: Value = service.get("/v1/materials").send().await.unwrap().json().await.unwrap();
    assert_eq!(list["items"], json!([]));

    let open = service.request(Method::PATCH, &one).bearer_auth(&first).json(&json!({ "visibility": "public" }));
    assert_eq!(open.send().await.unwrap().status(), StatusCode::OK);
    let cached = async |path: &str, key: Option<&str>| {
        let request = service.get(path);
        let answer = key.map_or(request.try_clone().unwrap(), |key| request.bearer_auth(key)).send().await.unwrap();
        assert_eq!(answer.status(), StatusCode::OK, "{path}");
        let text = |name: &str| answer.headers().get(name).map(|value| value.to_str().unwrap().to_owned());
        (text("cache-control").unwrap_or_default(), text("etag"), text("vary").unwrap_or_default())
    };
    for path in &paths {
        cached(path, None).await;
    }
    let kept = [&paths[1], &paths[3], &format!("/v1/blobs/{material}"), &format!("{one}/export?format=manifest")];
    for path in kept {
        let (cache, etag, vary) = cached(path, None).await;
        assert_eq!((cache.as_str(), vary.as_str()), ("public, max-age=300, must-revalidate", ""), "{path}");
        let same = service.get(path).header("if-none-match", etag.unwrap()).send().await.unwrap();
        assert_eq!(same.status(), StatusCode::NOT_MODIFIED, "{path}");
        assert_eq!(same.headers()["cache-control"], "public, max-age=300, must-revalidate", "{path}");
        let (cache, _, vary) = cached(path, Some(&first)).await;
        assert_eq!(
            (cache.as_str(), vary.as_str()),
            ("private, max-age=31536000, immutable", "authorization"),
            "{path}"
        );
    }
    let list: Value = service.get("/v1/materials?visible=public").send().await.unwrap().json().await.unwrap();
    assert_eq!(list["items"][0]["id"], json!(material));
    problem(service.request(Method::DELETE, &one), 401, "unauthorized").await;
    // Private again: a cache that asks with the entity tag hears so.
    let close = service.request(Method::PATCH, &one).bearer_auth(&first).json(&json!({ "visibility": "private" }));
    assert_eq!(close.send().await.unwrap().status(), StatusCode::OK);
    for path in kept {
        problem(service.get(path).header("if-none-match", "*"), 404, "not-found").await;
    }
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn tokens_and_links_of_a_key_reach_what_they_name_and_end_with_it() {
    let data = tempfile::tempdir().unwrap();
    let (config, first) = guarded(data.path());
    let service = Service::start(config).await;
    let Filled { material, .. } = Filled::new(&service, &first).await;
    let (key, id) = made(&service, &first, &json!({ "scopes": ["read"] })).await;
    let printed = |args: &[&str]| {
        let output =
            Command::new(env!("CARGO_BIN_EXE_wavelume")).args(args).env("WAVELUME_KEY", &key).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap().trim().to_owned()
    };
    let link = printed(&["link", "--url", &service.base, "--material", &material]);
    let token = printed(&["token", "--material", &material]);
    let content = format!("/v1/materials/{material}/content");
    let fetch = async |url: &str| service.client.get(url).send().await.unwrap();
    let with = async |path: &str| service.get(path).bearer_auth(&token).send().await.unwrap().status().as_u16();
    assert_eq!(fetch(&link).await.status(), StatusCode::OK);
    assert_eq!(with(&content).await, 200);
    assert_eq!(with(&format!("/v1/materials/{material}/spectrum")).await, 200);
    for path in ["/v1/materials", "/v1/jobs", "/v1/keys"] {
        assert_eq!(with(path).await, 403, "{path}");
    }
    let wrong = link.replace("signature=", "signature=A");
    problem_of(fetch(&wrong).await, 401, "unauthorized").await;
    // The id of a key that does not exist is told like the changed signature of one that does.
    let at = link.find("signature=").unwrap() + "signature=".len();
    let forged = format!("{}{}{}", &link[..at], if link[at..].starts_with('A') { 'B' } else { 'A' }, &link[at + 1..]);
    let refusals = [fetch(&forged).await, fetch(&forged.replace(&id, "0123456xyz")).await];
    let [existing, absent] = refusals.map(|refused| problem_of(refused, 401, "unauthorized"));
    assert_eq!(existing.await, absent.await);
    problem_of(fetch(&link.replace("/content", "")).await, 401, "unauthorized").await;
    problem(service.client.delete(&link), 405, "method-not-allowed").await;
    let revoked = service.request(Method::DELETE, &format!("/v1/keys/{id}")).bearer_auth(&first).send().await.unwrap();
    assert_eq!(revoked.status(), StatusCode::NO_CONTENT);
    let refusal = problem_of(fetch(&link).await, 401, "unauthorized").await;
    assert!(refusal["detail"].as_str().unwrap().contains("revoked"), "{refusal}");
    assert_eq!(with(&content).await, 401);
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_audit_trail_has_jobs() {
    let data = tempfile::tempdir().unwrap();
    let (config, first) = guarded(data.path());
    let service = Service::start(config).await;
    let Filled { measurement, .. } = Filled::new(&service, &first).await;
    let post = async |path: &str, body: &Value| -> Value {
        let answer = service.post(path).bearer_auth(&first).json(body).send().await.unwrap();
        assert!(answer.status().is_success(), "{}", answer.status());
        answer.json().await.unwrap()
    };
    // A job on the tables of the paper takes long enough to be cancelled.
    let job = post("/v1/jobs", &json!({ "kind": "paper", "tables": [1, 2, 3, 4, 5, 6, 7], "priority": 1 })).await;
    let job = job["id"].as_str().unwrap();
    post(&format!("/v1/jobs/{job}/cancel"), &json!({})).await;
    let since = Instant::now();
    while post(&format!("/v1/jobs/{job}/cancel"), &json!({})).await["state"] != "cancelled" {
        assert!(since.elapsed() < Duration::from_mins(1));
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    post(&format!("/v1/jobs/{job}/retry"), &json!({})).await;
    let audit: Value = service.get("/v1/audit").bearer_auth(&first).send().await.unwrap().json().await.unwrap();
    let items = audit["items"].as_array().unwrap();
    let acts = |subject: &str| -> BTreeSet<&str> {
        let about = items.iter().filter(|item| item["subject"] == subject);
        about.map(|item| item["action"].as_str().unwrap()).collect()
    };
    assert_eq!(acts(job), ["job.create", "job.cancel", "job.retry"].into_iter().collect(), "{audit}");
    assert_eq!(acts(&measurement), ["measurement.upload"].into_iter().collect());
    post(&format!("/v1/jobs/{job}/cancel"), &json!({})).await;
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_key_acts_for_its_tenant_until_the_tenant_is_closed() {
    let data = tempfile::tempdir().unwrap();
    let (config, first) = guarded(data.path());
    let service = Service::start(config).await;
    let Filled { material, .. } = Filled::new(&service, &first).await;
    let tenant = service.post("/v1/tenants").bearer_auth(&first).json(&json!({ "id": "lab" })).send().await.unwrap();
    assert_eq!(tenant.status(), StatusCode::CREATED);
    let (lab, id) = made(&service, &first, &json!({ "scopes": ["read", "tenant"], "tenant": "lab" })).await;
    problem(service.get(&format!("/v1/materials/{material}")).bearer_auth(&lab), 404, "not-found").await;
    for (path, ids) in [("/v1/keys", vec![id.clone()]), ("/v1/materials", vec![])] {
        let list: Value = service.get(path).bearer_auth(&lab).send().await.unwrap().json().await.unwrap();
        let found: Vec<_> = list["items"].as_array().unwrap().iter().map(|item| item["id"].as_str().unwrap()).collect();
        assert_eq!(found, ids);
    }
    let own = service.get("/v1/tenants/lab").bearer_auth(&lab).send().await.unwrap();
    assert_eq!(own.status(), StatusCode::OK);
    problem(service.get("/v1/tenants/default").bearer_auth(&lab), 404, "not-found").await;
    let audit: Value = service.get("/v1/audit").bearer_auth(&lab).send().await.unwrap().json().await.unwrap();
    assert_eq!(audit["items"][0]["action"], "key.create", "{audit}");
    let other: Value = service.get("/v1/keys").bearer_auth(&first).send().await.unwrap().json().await.unwrap();
    let foreign = format!("/v1/keys/{}", other["items"][0]["id"].as_str().unwrap());
    problem(service.request(Method::DELETE, &foreign).bearer_auth(&lab), 404, "not-found").await;

    let set = async |change: Value| {
        let request = service.request(Method::PATCH, "/v1/tenants/lab").bearer_auth(&first).json(&change);
        assert_eq!(request.send().await.unwrap().status(), StatusCode::OK);
    };
    set(json!({ "max_requests": 2 })).await;
    let since = Instant::now();
    let refused = loop {
        let answer = service.get("/v1/materials").bearer_auth(&lab).send().await.unwrap();
        if answer.status() != StatusCode::OK {
            break answer;
        }
        assert!(since.elapsed() < Duration::from_secs(10), "still accepted");
        tokio::time::sleep(Duration::from_millis(50)).await;
    };
    let wait: u64 = refused.headers()["retry-after"].to_str().unwrap().parse().unwrap();
    assert!((1..=31).contains(&wait), "{wait}");
    problem_of(refused, 429, "too-many-requests").await;
    assert_eq!(service.get("/v1/materials").bearer_auth(&first).send().await.unwrap().status(), StatusCode::OK);
    set(json!({ "max_requests": null })).await;
    let audit = async || -> Value {
        loop {
            let answer = service.get("/v1/audit").bearer_auth(&lab).send().await.unwrap();
            if answer.status() == StatusCode::OK {
                return answer.json().await.unwrap();
            }
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    };
    let last = &audit().await["items"][0];
    assert_eq!((&last["action"], &last["detail"]), (&json!("tenant.change"), &json!("max_requests none")));
    assert!(last["actor"].as_str().unwrap().starts_with("key ") && last["address"].is_null(), "{last}");

    set(json!({ "state": "closed" })).await;
    let since = Instant::now();
    while service.get("/v1/materials").bearer_auth(&lab).send().await.unwrap().status() == StatusCode::OK {
        assert!(since.elapsed() < Duration::from_secs(5), "still accepted");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    problem(service.get("/v1/materials").bearer_auth(&lab), 403, "missing-scope").await;
    service.stop().await;
}
