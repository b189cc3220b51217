//! Many clients of one address that hold all places they can get, and a client of another address that is answered all
//! the same.

use crate::service::{D65, LONG_SHAPE, Service, config, long_request, npy, problem_of};
use reqwest::{Client, RequestBuilder, Response, StatusCode};
use serde_json::{Value, json};
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::Path;
use std::time::{Duration, Instant};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpSocket, TcpStream};
use wavelume::api::Limits;

/// Address that takes all it can; below, one that asks for little.
const GREEDY: Ipv4Addr = Ipv4Addr::LOCALHOST;
/// Time after which a request without its body is sent again.
const PATIENCE: Duration = Duration::from_secs(5);
const HONEST: Ipv4Addr = Ipv4Addr::new(127, 0, 0, 2);

/// A service with few places, to be taken by few clients.
async fn narrow(data: &Path, limits: impl FnOnce(&mut Limits)) -> Service {
    let mut config = config(data);
    config.work.limits = Limits {
        connections: 24,
        connections_each: 8,
        health_connections: 4,
        health_connections_each: 2,
        requests: 16,
        requests_each: 6,
        uploads: 4,
        uploads_each: 2,
        streams: 4,
        streams_each: 2,
        exports: 4,
        exports_each: 2,
        followers: 4,
        followers_each: 2,
        json_bytes: 1 << 20,
        bodies_bytes: 2 << 20,
        bodies_bytes_each: 1 << 20,
        drain: Duration::from_secs(5),
        ..Limits::default()
    };
    limits(&mut config.work.limits);
    Service::start(config).await
}

async fn connect(service: &Service, from: Ipv4Addr) -> TcpStream {
    let to: SocketAddr = service.base.trim_start_matches("http://").parse().unwrap();
    let socket = TcpSocket::new_v4().unwrap();
    socket.bind((from, 0).into()).unwrap();
    socket.connect(to).await.unwrap()
}

async fn send(service: &Service, from: Ipv4Addr, words: &str) -> TcpStream {
    let mut stream = connect(service, from).await;
    // A connection beyond all places may be closed already.
    let _ = stream.write_all(words.as_bytes()).await;
    stream
}

/// Reads until the server closes.
async fn rest(mut stream: TcpStream) -> String {
    let mut bytes = Vec::new();
    let _ = stream.read_to_end(&mut bytes).await;
    String::from_utf8_lossy(&bytes).into_owned()
}

fn client(from: Ipv4Addr) -> Client {
    Client::builder().no_proxy().local_address(IpAddr::from(from)).build().unwrap()
}

fn get(service: &Service, from: Ipv4Addr, path: &str) -> RequestBuilder {
    client(from).get(format!("{}{path}", service.base))
}

fn post(service: &Service, from: Ipv4Addr, path: &str) -> RequestBuilder {
    client(from).post(format!("{}{path}", service.base))
}

/// Health, a read, an upload and a job of the honest client.
async fn everything_is_answered(service: &Service) {
    let client = client(HONEST);
    let ok = async |request: RequestBuilder| -> Response {
        let response = request.send().await.unwrap();
        assert!(response.status().is_success(), "{}", response.text().await.unwrap());
        response
    };
    for path in ["/healthz", "/readyz", "/v1/measurements"] {
        ok(client.get(format!("{}{path}", service.base))).await;
    }
    let upload: Value =
        ok(client.post(format!("{}/v1/measurements", service.base)).body(D65)).await.json().await.unwrap();
    let request = json!({ "measurement": upload["id"], "target": { "er_l2": 0.01 } });
    let job = client.post(format!("{}/v1/jobs", service.base)).header("prefer", "wait=60").json(&request);
    let job: Value = ok(job).await.json().await.unwrap();
    assert_eq!(job["state"], "succeeded", "{job}");
}

#[tokio::test(flavor = "multi_thread")]
async fn silent_connections_of_one_address_are_bounded_and_closed() {
    let data = tempfile::tempdir().unwrap();
    let service = narrow(data.path(), |limits| limits.first_bytes = Duration::from_secs(2)).await;
    let mut silent = Vec::new();
    for i in 0..40 {
        silent.push(send(&service, GREEDY, if i % 2 == 0 { "" } else { "PRI * HT" }).await);
    }
    everything_is_answered(&service).await;
    for stream in silent {
        assert_eq!(rest(stream).await, "", "a connection that says nothing is closed");
    }
    // The places are free again, also for the address that held them.
    while get(&service, GREEDY, "/v1/measurements").send().await.is_ok_and(|answer| answer.status() != StatusCode::OK) {
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn health_is_answered_when_every_ordinary_place_is_taken() {
    let data = tempfile::tempdir().unwrap();
    let service = narrow(data.path(), |limits| (limits.connections, limits.connections_each) = (3, 3)).await;
    let held = [connect(&service, GREEDY).await, connect(&service, GREEDY).await, connect(&service, GREEDY).await];
    for path in ["/healthz", "/readyz"] {
        let answer = get(&service, HONEST, path).send().await.unwrap();
        assert_eq!(answer.status(), StatusCode::OK, "{path}");
        assert_eq!(answer.headers()["connection"], "close");
    }
    let refused = get(&service, HONEST, "/v1/measurements").send().await.unwrap();
    assert!(refused.headers().contains_key("retry-after"));
    problem_of(refused, 503, "overloaded").await;
    drop(held);
    while get(&service, HONEST, "/v1/measurements").send().await.unwrap().status() != StatusCode::OK {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn followers_are_counted_by_address_and_a_wait_without_a_place_is_no_wait() {
    let data = tempfile::tempdir().unwrap();
    let service = narrow(data.path(), |_| {}).await;
    let array = service.upload("", npy(&LONG_SHAPE)).await;
    // The only worker is busy: the job behind it waits.
    let long: Value =
        service.post("/v1/jobs").json(&long_request(&array["id"])).send().await.unwrap().json().await.unwrap();
    let request = json!({ "measurement": array["id"], "quantity": "brdf", "target": { "er_l2": 0.5 },
        "axes": { "axes": ["hemi:1", "hemi:4", "lambda:380:5:75"] } });
    let job: Value = service.post("/v1/jobs").json(&request).send().await.unwrap().json().await.unwrap();
    let events = job["links"]["events"].as_str().unwrap();
    let first = get(&service, GREEDY, events).send().await.unwrap();
    let second = get(&service, GREEDY, events).send().await.unwrap();
    assert_eq!((first.status(), second.status()), (StatusCode::OK, StatusCode::OK));
    problem_of(get(&service, GREEDY, events).send().await.unwrap(), 429, "too-many-at-once").await;
    let waiting = post(&service, GREEDY, "/v1/jobs").header("prefer", "wait=60").json(&request).send().await.unwrap();
    assert_eq!(waiting.status(), StatusCode::ACCEPTED);
    assert!(!waiting.headers().contains_key("preference-applied"));
    assert_eq!(get(&service, HONEST, events).send().await.unwrap().status(), StatusCode::OK);
    drop((first, second));
    while get(&service, GREEDY, events).send().await.unwrap().status() != StatusCode::OK {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    service.post(long["links"]["cancel"].as_str().unwrap()).send().await.unwrap();
    everything_is_answered(&service).await;
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn slow_uploads_hold_the_places_of_their_address_and_not_for_long() {
    let data = tempfile::tempdir().unwrap();
    let service = narrow(data.path(), |limits| {
        limits.body_grace = Duration::from_millis(500);
        limits.body_window = Duration::from_millis(1500);
    })
    .await;
    let head = "POST /v1/measurements HTTP/1.1\r\nhost: localhost\r\ncontent-length: 100000\r\n\r\n";
    let mut slow = Vec::new();
    for _ in 0..2 {
        let (input, mut output) = send(&service, GREEDY, head).await.into_split();
        slow.push(input);
        tokio::spawn(async move {
            // A byte now and then is never idle.
            while output.write_all(b"x").await.is_ok() {
                tokio::time::sleep(Duration::from_millis(50)).await;
            }
        });
    }
    let places = async || {
        let metrics = service.get("/metrics").send().await.unwrap().text().await.unwrap();
        metrics.contains("wavelume_uploads_running 2")
    };
    while !places().await {
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    problem_of(post(&service, GREEDY, "/v1/measurements").body(D65).send().await.unwrap(), 429, "too-many-at-once")
        .await;
    everything_is_answered(&service).await;
    for mut stream in slow {
        let mut answer = [0; 2000];
        let count = stream.read(&mut answer).await.unwrap();
        let answer = String::from_utf8_lossy(&answer[..count]).into_owned();
        assert!(answer.starts_with("HTTP/1.1 408") && answer.contains("expected at least 16384 a second"), "{answer}");
    }
    service.upload("", D65).await;
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn json_bodies_take_memory_as_they_come_not_as_they_are_announced() {
    let data = tempfile::tempdir().unwrap();
    let service = narrow(data.path(), |_| {}).await;
    let path = format!("/v1/materials/{}/evaluate", service.material().await);
    let head = format!(
        "POST {path} HTTP/1.1\r\nhost: localhost\r\ncontent-type: application/json\r\ncontent-length: 1048576\r\n\r\n{{\"wi\""
    );
    let mut announced = Vec::new();
    for _ in 0..5 {
        announced.push(send(&service, GREEDY, &head).await);
    }
    everything_is_answered(&service).await;
    let answer = post(&service, HONEST, &path).json(&json!({})).send().await.unwrap();
    assert_eq!(answer.status(), StatusCode::OK, "{}", answer.text().await.unwrap());
    // Received bytes count: a body that stops short of its end fills the share of its address.
    let bodies = async |kib: usize| {
        let figure = format!("KiB of bodies\"}} {kib}\n");
        while !service.get("/metrics").send().await.unwrap().text().await.unwrap().contains(&figure) {
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    };
    drop(announced);
    bodies(0).await;
    let most = format!("{head}{}", " ".repeat(600_000));
    let first = send(&service, GREEDY, &most).await;
    bodies(1024).await;
    let mut second = connect(&service, GREEDY).await;
    second.write_all(head.as_bytes()).await.unwrap();
    let mut answer = [0; 12];
    second.read_exact(&mut answer).await.unwrap();
    assert_eq!(&answer, b"HTTP/1.1 429");
    everything_is_answered(&service).await;
    drop((first, second));
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn streams_and_exports_that_nobody_reads_leave_places_to_other_addresses() {
    let data = tempfile::tempdir().unwrap();
    let service = narrow(data.path(), |_| {}).await;
    let path = format!("/v1/materials/{}", service.brdf().await);
    let body = r#"{"wi":[30,0],"count":100000000}"#;
    let stream = format!(
        "POST {path}/sample HTTP/1.1\r\nhost: localhost\r\ncontent-type: application/json\r\naccept: application/octet-stream\r\n\
         content-length: {}\r\n\r\n{body}",
        body.len()
    );
    let asked = |from| {
        let request = post(&service, from, &format!("{path}/sample"));
        request.header("content-type", "application/json").header("accept", "application/octet-stream").body(body)
    };
    let mut unread = Vec::new();
    for _ in 0..2 {
        let mut held = send(&service, GREEDY, &stream).await;
        let mut answer = [0; 12];
        held.read_exact(&mut answer).await.unwrap();
        assert_eq!(&answer, b"HTTP/1.1 200");
        unread.push(held);
    }
    problem_of(asked(GREEDY).send().await.unwrap(), 429, "too-many-at-once").await;
    let mut honest = asked(HONEST).send().await.unwrap();
    assert_eq!(honest.status(), StatusCode::OK);
    assert!(!honest.chunk().await.unwrap().unwrap().is_empty());
    drop(honest);
    everything_is_answered(&service).await;
    drop(unread);
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn requests_of_one_address_are_bounded_on_whatever_connections() {
    let data = tempfile::tempdir().unwrap();
    let service = narrow(data.path(), |limits| (limits.requests_each, limits.queries_each) = (3, 1)).await;
    let material = service.material().await;
    let path = format!("/v1/materials/{material}/evaluate");
    let unfinished = format!(
        "POST {path} HTTP/1.1\r\nhost: localhost\r\ncontent-type: application/json\r\ncontent-length: 100\r\n\r\n"
    );
    let mut query = send(&service, GREEDY, &unfinished).await;
    let spectrum = format!("/v1/materials/{material}/spectrum");
    let mut sent = Instant::now();
    while get(&service, GREEDY, &spectrum).send().await.unwrap().status() != StatusCode::TOO_MANY_REQUESTS {
        // On a busy machine a request may have been given up for its silence before this one came.
        if sent.elapsed() > PATIENCE {
            (query, sent) = (send(&service, GREEDY, &unfinished).await, Instant::now());
        }
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    let upload = "POST /v1/measurements HTTP/1.1\r\nhost: localhost\r\ncontent-length: 100\r\n\r\n";
    let mut uploads = [send(&service, GREEDY, upload).await, send(&service, GREEDY, upload).await];
    sent = Instant::now();
    while get(&service, GREEDY, "/v1/formats").send().await.unwrap().status() != StatusCode::TOO_MANY_REQUESTS {
        if sent.elapsed() > PATIENCE {
            (query, sent) = (send(&service, GREEDY, &unfinished).await, Instant::now());
            uploads = [send(&service, GREEDY, upload).await, send(&service, GREEDY, upload).await];
        }
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    let refused = get(&service, GREEDY, "/v1/formats").send().await.unwrap();
    let refused = problem_of(refused, 429, "too-many-at-once").await;
    assert!(refused["detail"].as_str().unwrap().contains("127.0.0.1 holds all 3 places for requests"), "{refused}");
    assert_eq!(get(&service, GREEDY, "/healthz").send().await.unwrap().status(), StatusCode::OK);
    everything_is_answered(&service).await;
    drop((query, uploads));
    service.stop().await;
}
