//! Hosts that are served, pages that may read, and the headers that every answer has.

use super::keys::guarded;
use crate::service::{D65, Service, config, problem, problem_of};
use reqwest::{Method, StatusCode};
use serde_json::json;
use wavelume::api::{ServeError, Server};

#[tokio::test(flavor = "multi_thread")]
async fn a_loopback_service_answers_requests_for_loopback_hosts_alone() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    for host in ["localhost", "LOCALHOST:1", "127.0.0.1:8080", "127.1.2.3", "[::1]:80"] {
        let answer = service.get("/v1/formats").header("host", host).send().await.unwrap();
        assert_eq!(answer.status(), StatusCode::OK, "{host}");
    }
    // DNS rebinding: the page's own name leads to this machine, so that Origin and Host are equal.
    for host in ["evil.example", "evil.example:8080", "localhost.evil.example", "127.0.0.1.evil.example", "192.168.0.7"]
    {
        problem(service.get("/v1/formats").header("host", host), 421, "misdirected").await;
        let origin = format!("http://{host}");
        let write = service.post("/v1/measurements").header("host", host).header("origin", origin).body(D65);
        problem(write, 421, "misdirected").await;
    }
    let none: serde_json::Value = service.get("/v1/measurements").send().await.unwrap().json().await.unwrap();
    assert_eq!(none["items"], json!([]));
    for (words, status) in [
        ("GET / HTTP/1.1\r\n", 400),
        ("GET / HTTP/1.1\r\nhost: localhost\r\nhost: localhost\r\n", 400),
        ("GET / HTTP/1.1\r\nhost:\r\n", 400),
        ("GET / HTTP/1.1\r\nhost: a b\r\n", 400),
        ("GET http://evil.example/ HTTP/1.1\r\nhost: localhost\r\n", 400),
        ("GET http://evil.example/ HTTP/1.1\r\nhost: evil.example\r\n", 421),
        ("GET http://localhost/ HTTP/1.1\r\nhost: localhost\r\n", 200),
        ("GET / HTTP/1.0\r\n", 421),
        ("GET / HTTP/1.0\r\nhost: localhost\r\n", 200),
    ] {
        let answer = service.talk(format!("{words}connection: close\r\n\r\n").as_bytes()).await;
        assert!(answer.split(' ').nth(1) == Some(&status.to_string()), "{words}: {answer}");
    }
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn on_every_address_a_host_name_has_to_be_given_and_ip_addresses_are_answered() {
    let data = tempfile::tempdir().unwrap();
    let (mut open, key) = guarded(data.path());
    open.listen = "0.0.0.0:0".parse().unwrap();
    open.names = vec!["lab.example.org".to_owned()];
    let service = Service::start(open).await;
    let read = |host: &str| service.get("/v1/materials").bearer_auth(&key).header("host", host);
    for host in ["localhost:8080", "127.0.0.1", "192.168.0.7:8080", "[2001:db8::1]", "lab.example.org:8443"] {
        assert_eq!(read(host).send().await.unwrap().status(), StatusCode::OK, "{host}");
    }
    for host in ["evil.example", "node:8080", "127.0.0.1.evil.example"] {
        let refusal = problem(read(host), 421, "misdirected").await;
        assert!(refusal["detail"].as_str().unwrap().contains("--name or WAVELUME_NAMES"), "{refusal}");
    }
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn names_and_origins_are_settings() {
    let data = tempfile::tempdir().unwrap();
    let mut open = config(data.path());
    open.names = vec!["lab.example.org".to_owned()];
    open.origins = vec!["https://app.example.org".to_owned()];
    let service = Service::start(open).await;
    let named = service.get("/v1/formats").header("host", "lab.example.org:8443").send().await.unwrap();
    assert_eq!(named.status(), StatusCode::OK);
    assert_eq!(named.headers()["vary"], "origin");
    problem(service.get("/v1/formats").header("host", "other.example.org"), 421, "misdirected").await;

    let app = "https://app.example.org";
    let read = service.get("/v1/formats").header("origin", app).send().await.unwrap();
    assert_eq!(read.headers()["access-control-allow-origin"], app);
    assert!(read.headers()["access-control-expose-headers"].to_str().unwrap().contains("etag"));
    let preflight = service
        .request(Method::OPTIONS, "/v1/materials/b3-0/evaluate")
        .header("origin", app)
        .header("access-control-request-method", "POST");
    let preflight = preflight.send().await.unwrap();
    assert_eq!(preflight.status(), StatusCode::NO_CONTENT);
    assert_eq!(preflight.headers()["access-control-allow-origin"], app);
    let question = service.post("/v1/materials/b3-0/evaluate").header("origin", app).json(&json!({}));
    let question = question.send().await.unwrap();
    assert_eq!(question.headers()["access-control-allow-origin"], app);
    problem_of(question, 404, "not-found").await;
    problem(service.post("/v1/measurements").header("origin", app).body(D65), 403, "cross-origin-write").await;
    service.stop().await;

    for (names, origins, expected) in [
        ("http://x", "", "a host name or an origin in the settings is invalid: --name"),
        ("", "*", "a host name or an origin in the settings is invalid: --origin"),
        ("", "app.example.org", "a host name or an origin in the settings is invalid: --origin"),
    ] {
        let mut wrong = config(data.path());
        (wrong.names, wrong.origins) = (vec![names.to_owned()], vec![origins.to_owned()]);
        let error = Server::bind(wrong).await.unwrap_err();
        assert!(matches!(error, ServeError::Setting(_)) && error.to_string().starts_with(expected), "{error}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn pages_of_other_origins_neither_read_nor_write() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    for origin in ["https://example.org", "null", "http://localhost:1"] {
        let read = service.get("/v1/formats").header("origin", origin).send().await.unwrap();
        assert!(!read.headers().keys().any(|name| name.as_str().starts_with("access-control")), "{:?}", read.headers());
        let preflight = service.request(Method::OPTIONS, "/v1/formats").header("origin", origin);
        let preflight = preflight.header("access-control-request-method", "GET").send().await.unwrap();
        assert!(!preflight.headers().keys().any(|name| name.as_str().starts_with("access-control")));
        let write = service.post("/v1/measurements").header("origin", origin).body(D65);
        problem(write, 403, "cross-origin-write").await;
        let question = service.post("/v1/materials/b3-0/evaluate").header("origin", origin).json(&json!({}));
        problem(question, 403, "cross-origin-write").await;
    }
    for (site, written) in [("cross-site", false), ("same-site", false), ("same-origin", true), ("none", true)] {
        let write = service.post("/v1/measurements").header("sec-fetch-site", site).body(D65).send().await.unwrap();
        assert_eq!(write.status().is_success(), written, "{site}");
        let read = service.get("/v1/formats").header("sec-fetch-site", site).send().await.unwrap();
        assert_eq!(read.status(), StatusCode::OK, "a link on another page may be followed");
    }
    let own = service.post("/v1/measurements").header("origin", &service.base).body(D65).send().await.unwrap();
    assert_eq!(own.status(), StatusCode::OK);
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn keys_are_taken_from_no_page_of_another_origin() {
    let data = tempfile::tempdir().unwrap();
    let mut open = config(data.path());
    open.origins = vec!["https://app.example.org".to_owned()];
    let service = Service::start(open).await;
    let read = |path: &str| service.get(path).header("authorization", "Bearer x");
    for path in ["/v1/formats", "/v1/materials", "/v1/nothing"] {
        for origin in ["https://example.org", "null", "http://localhost:1"] {
            problem(read(path).header("origin", origin), 403, "cross-origin-read").await;
        }
        problem(read(path).header("sec-fetch-site", "cross-site"), 403, "cross-origin-read").await;
    }
    let own = read("/v1/formats").header("origin", &service.base);
    let app = read("/v1/formats").header("origin", "https://app.example.org");
    for request in [read("/v1/formats"), own, app, read("/v1/formats").header("sec-fetch-site", "none")] {
        let answer = request.send().await.unwrap();
        assert_ne!(answer.status(), StatusCode::FORBIDDEN);
        assert!(!answer.headers().contains_key("access-control-allow-credentials"));
    }
    // A page may lead to what a signed link names, but not ask for it in the background.
    let content = format!("/v1/materials/b3-{}/content", "0".repeat(64));
    let link = |site: &str, mode: &str, place: &str| {
        let path = format!("{content}?key=0123456xyz&expires=1&signature=x");
        service.get(&path).header("sec-fetch-site", site).header("sec-fetch-mode", mode).header("sec-fetch-dest", place)
    };
    for (mode, place) in [("no-cors", "image"), ("navigate", "iframe"), ("cors", "empty")] {
        problem(link("cross-site", mode, place), 403, "cross-origin-read").await;
    }
    for request in [link("cross-site", "navigate", "document"), link("none", "no-cors", "image"), service.get(&content)]
    {
        assert_eq!(request.send().await.unwrap().status(), StatusCode::NOT_FOUND);
    }
    let preflight = service
        .request(Method::OPTIONS, "/v1/formats")
        .header("origin", "https://app.example.org")
        .header("access-control-request-method", "GET")
        .header("access-control-request-headers", "authorization");
    let preflight = preflight.send().await.unwrap();
    let allowed = preflight.headers()["access-control-allow-headers"].to_str().unwrap();
    assert!(allowed.split(", ").any(|name| name == "authorization"), "{allowed}");
    assert!(!preflight.headers().contains_key("access-control-allow-credentials"));
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn every_answer_is_no_page_and_has_an_id_of_its_own() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    for request in [
        service.get("/healthz"),
        service.get("/v1/nothing"),
        service.get("/healthz").header("host", "evil.example"),
        service.request(Method::PUT, "/v1/jobs"),
    ] {
        let answer = request.send().await.unwrap();
        let headers = answer.headers();
        assert_eq!(headers["x-content-type-options"], "nosniff");
        assert!(headers["content-security-policy"].to_str().unwrap().contains("default-src 'none'"));
        assert_eq!(headers["cross-origin-resource-policy"], "same-origin");
        assert_eq!(headers["referrer-policy"], "no-referrer");
        assert_eq!(headers["request-id"].len(), 36);
        assert!(!headers.contains_key("strict-transport-security"), "plain HTTP");
    }
    let long = "x".repeat(20_000);
    for (sent, kept) in [("trace-7", true), ("a b", false), (long.as_str(), false)] {
        let answer = service.get("/healthz").header("request-id", sent).send().await.unwrap();
        assert_eq!(answer.headers()["request-id"] == sent, kept);
        assert!(answer.headers()["request-id"].len() <= 128);
    }
    service.stop().await;
}
