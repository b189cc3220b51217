//! The service as a whole: its root, its description, its clients, its starts and stops.

use crate::service::{D65, Service, config, npy, problem, problem_of};
use reqwest::{Method, StatusCode};
use serde_json::Value;
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use wavelume::api::{ServeError, Server};

#[tokio::test(flavor = "multi_thread")]
async fn the_root_says_what_this_is_and_how_it_is() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    for (path, expected) in [
        ("/", "curl"),
        ("/healthz", "ok"),
        ("/readyz", "ready"),
        ("/metrics", "wavelume_uploads_running"),
        ("/metrics", "wavelume_http_request_duration_seconds_bucket{"),
    ] {
        let response = service.get(path).send().await.unwrap();
        assert_eq!(response.status(), StatusCode::OK);
        assert!(response.headers().contains_key("request-id"));
        assert!(response.text().await.unwrap().contains(expected), "{path}");
    }
    let formats: Value = service.get("/v1/formats").send().await.unwrap().json().await.unwrap();
    assert!(formats.as_array().unwrap().iter().any(|format| format["name"] == "npy"));
    let template = service.get("/v1/formats/radiometric-csv/template").send().await.unwrap();
    assert!(template.headers()["content-type"].to_str().unwrap().starts_with("text/csv"));
    assert!(template.text().await.unwrap().starts_with("# radiometric-csv: 1"));
    let axes: Value = service.get("/v1/formats/npy-manifest/template").send().await.unwrap().json().await.unwrap();
    assert_eq!(axes["quantity"], "brdf");
    assert_eq!(service.get("/v1/formats/lm-63/template").send().await.unwrap().status(), 404);
    let bases: Value = service.get("/v1/bases").send().await.unwrap().json().await.unwrap();
    for name in ["bior4.4", "klt"] {
        assert!(bases.as_array().unwrap().iter().any(|basis| basis["name"] == name), "{name}");
    }
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn whatever_goes_wrong_is_a_problem() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    problem(service.get("/v1/nothing"), 404, "not-found").await;
    problem(service.post("/nothing").body("x"), 404, "not-found").await;
    let wrong = service.request(Method::PUT, "/v1/jobs").send().await.unwrap();
    assert_eq!(wrong.headers()["allow"], "GET,HEAD,POST");
    problem_of(wrong, 405, "method-not-allowed").await;
    problem(service.get("/v1/measurements/nonsense"), 404, "not-found").await;
    problem(service.post("/v1/measurements?quantity=brd").body("x"), 400, "bad-query").await;
    problem(service.post("/v1/measurements?name=").body("x"), 400, "bad-query").await;
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
    let half_a_body = b"POST /v1/measurements HTTP/1.1\r\nhost: localhost\r\ncontent-length: 1000\r\n\r\nhalf";
    assert!(talk(half_a_body).await.contains("urn:wavelume:problem:too-slow"));
    let half_a_header = b"POST /v1/measurements HTTP/1.1\r\nho";
    let answer = talk(half_a_header).await;
    assert!(answer.is_empty() || answer.starts_with("HTTP/1.1 408"), "{answer}");
    let oversize =
        b"POST /v1/measurements HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\ncontent-length: 99999999999\r\n\r\n";
    assert!(talk(oversize).await.contains("urn:wavelume:problem:too-large"));

    let mut stream = tokio::net::TcpStream::connect(&address).await.unwrap();
    stream.write_all(half_a_body).await.unwrap();
    drop(stream);

    let large = npy(&[100, 1024, 75]);
    let path = service.upload("", large.clone()).await["links"]["content"].as_str().unwrap().to_owned();
    let mut deaf = tokio::net::TcpStream::connect(&address).await.unwrap();
    deaf.write_all(format!("GET {path} HTTP/1.1\r\nhost: localhost\r\n\r\n").as_bytes()).await.unwrap();
    tokio::time::sleep(Duration::from_secs(2)).await;
    let mut heard = Vec::new();
    let _ = deaf.read_to_end(&mut heard).await;
    assert!(heard.len() < large.len(), "a client that does not read is not waited for");
    service.upload("", D65).await;
    service.stop().await;
    assert_eq!(std::fs::read_dir(data.path().join("staging")).unwrap().count(), 0);
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
    let mut directories = vec![std::path::PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/src/api"))];
    while let Some(directory) = directories.pop() {
        for entry in std::fs::read_dir(directory).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                directories.push(path);
                continue;
            }
            // The metrics of a worker, which serves nothing else.
            if path.ends_with("figures.rs") {
                continue;
            }
            let source = std::fs::read_to_string(&path).unwrap();
            assert!(!source.contains(".route("), "{} adds a route that the description does not know", path.display());
        }
    }
    service.stop().await;
}
