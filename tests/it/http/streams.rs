//! Batches as lines and as f32: their content, their end, and that they hold no place for ever.

use crate::service::{Service, config, problem, problem_of};
use reqwest::{Body, RequestBuilder, StatusCode};
use serde_json::{Value, json};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use wavelume::domain::Direction;
use wavelume::evaluate::{Interpolation, Material, Place};

const LINES: &str = "application/x-ndjson";
const FLOATS: &str = "application/octet-stream";

/// Angles that are exact in f32: `[theta_i, phi_i, theta_o, phi_o]`.
fn pairs(count: usize) -> Vec<[f32; 4]> {
    let turn = |i: usize, step: f32, most: f32| (i as f32 * step) % most;
    (0..count).map(|i| [turn(i, 1.25, 80.0), turn(i, 7.5, 360.0), turn(i, 2.5, 88.0), turn(i, 11.25, 360.0)]).collect()
}

fn packed(records: &[[f32; 4]]) -> Vec<u8> {
    records.iter().flatten().flat_map(|value| value.to_le_bytes()).collect()
}

fn lined(records: &[[f32; 4]]) -> Vec<u8> {
    let line = |[a, b, c, d]: &[f32; 4]| format!("{}\n", json!({ "wi": [a, b], "wo": [c, d] }));
    records.iter().map(line).collect::<String>().into_bytes()
}

fn floats(bytes: &[u8]) -> Vec<f32> {
    bytes.chunks_exact(4).map(|bytes| f32::from_le_bytes(bytes.try_into().unwrap())).collect()
}

fn lines(bytes: &[u8]) -> Vec<Value> {
    std::str::from_utf8(bytes).unwrap().lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

fn numbers(values: &Value) -> Vec<f32> {
    values.as_array().unwrap().iter().map(|value| value.as_f64().map_or(f32::NAN, |value| value as f32)).collect()
}

async fn bytes(request: RequestBuilder) -> Vec<u8> {
    let response = request.send().await.unwrap();
    let status = response.status();
    let bytes = response.bytes().await.unwrap().to_vec();
    assert_eq!(status, StatusCode::OK, "{}", String::from_utf8_lossy(&bytes));
    bytes
}

/// A body in pieces of `size` bytes, without a declared length.
fn pieces(bytes: &[u8], size: usize) -> Body {
    let pieces: Vec<Result<Vec<u8>, std::io::Error>> = bytes.chunks(size).map(|piece| Ok(piece.to_vec())).collect();
    Body::wrap_stream(futures::stream::iter(pieces))
}

struct Asked {
    service: Service,
    material: Material,
    path: String,
}

impl Asked {
    async fn start(data: &std::path::Path, limits: impl FnOnce(&mut wavelume::api::Limits)) -> Self {
        let mut config = config(data);
        limits(&mut config.work.limits);
        let service = Service::start(config).await;
        let path = format!("/v1/materials/{}", service.brdf().await);
        let content = service.get(&format!("{path}/content")).send().await.unwrap().bytes().await.unwrap();
        Self { service, material: Material::open(&content).unwrap(), path }
    }

    fn post(&self, what: &str, media: &str, body: impl Into<Body>) -> RequestBuilder {
        self.service.post(&format!("{}/{what}", self.path)).header("content-type", media).body(body)
    }

    /// Computes the spectrum of one pair with the library.
    fn spectrum(&self, [a, b, c, d]: [f32; 4]) -> Vec<f32> {
        let direction = |theta: f32, phi: f32| Some(Direction::from_degrees(theta.into(), phi.into()));
        let mut out = vec![0.0; self.material.lambdas()];
        let place = Place { index: &[], wi: direction(a, b), wo: direction(c, d) };
        self.material.evaluate(place, Interpolation::Smooth, &mut out).unwrap();
        out
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn three_encodings_and_the_library_agree() {
    let data = tempfile::tempdir().unwrap();
    let asked = Asked::start(data.path(), |_| {}).await;
    // More than a block, and no multiple of anything.
    let records = pairs(4096 + 600 + 7);
    let side = |at: usize| records.iter().map(|record| [record[at], record[at + 1]]).collect::<Vec<_>>();
    let whole = json!({ "wi": side(0), "wo": side(2) });
    let wi: Vec<u8> = records.iter().flat_map(|r| [r[0], r[1]]).flat_map(f32::to_le_bytes).collect();

    let expected: Vec<f32> = records.iter().flat_map(|&record| asked.spectrum(record)).collect();
    let found = floats(&bytes(asked.post("evaluate", FLOATS, packed(&records))).await);
    assert_eq!(found, expected, "f32");
    let found = lines(&bytes(asked.post("evaluate", LINES, lined(&records))).await);
    assert_eq!(found.iter().flat_map(|line| numbers(&line["values"])).collect::<Vec<_>>(), expected, "lines");
    let json: Value = asked
        .service
        .post(&format!("{}/evaluate", asked.path))
        .json(&whole)
        .send()
        .await
        .unwrap()
        .json()
        .await
        .unwrap();
    assert_eq!(json["values"].as_array().unwrap().iter().flat_map(numbers).collect::<Vec<_>>(), expected, "JSON");
    // One encoding in, another out.
    let crossed = asked.post("evaluate", FLOATS, packed(&records)).header("accept", LINES);
    assert_eq!(lines(&bytes(crossed).await), found);
    let crossed = asked.post("evaluate", "application/json", whole.to_string()).header("accept", FLOATS);
    assert_eq!(floats(&bytes(crossed).await), expected);
    // Options stand in the query string; what is masked is null and NaN.
    let options = "evaluate?wavelengths=300,450&interpolation=constant";
    let some = floats(&bytes(asked.post(options, FLOATS, packed(&records))).await);
    assert!(some.len() == 2 * records.len() && some[0].is_nan() && some[1] > 0.0);
    let line = lines(&bytes(asked.post(options, LINES, lined(&records[..1]))).await);
    assert_eq!((&line[0]["values"][0], numbers(&line[0]["values"])[1]), (&Value::Null, some[1]));

    let found = floats(&bytes(asked.post("pdf", FLOATS, packed(&records))).await);
    let by_line = lines(&bytes(asked.post("pdf", LINES, lined(&records))).await);
    let json: Value =
        asked.service.post(&format!("{}/pdf", asked.path)).json(&whole).send().await.unwrap().json().await.unwrap();
    assert_eq!(by_line.iter().map(|line| line["pdf"].clone()).collect::<Value>(), json["pdf"]);
    assert_eq!(numbers(&json["pdf"]), found);

    let found = floats(&bytes(asked.post("sample?seed=5", FLOATS, wi.clone())).await);
    let request = json!({ "wi": side(0), "seed": 5 });
    let json: Value = asked
        .service
        .post(&format!("{}/sample", asked.path))
        .json(&request)
        .send()
        .await
        .unwrap()
        .json()
        .await
        .unwrap();
    let by_line = asked.post("sample", "application/json", request.to_string()).header("accept", LINES);
    let by_line = lines(&bytes(by_line).await);
    assert_eq!((found.len(), by_line.len()), (4 * records.len(), records.len()));
    for (i, line) in by_line.iter().enumerate() {
        assert_eq!((&line["direction"], &line["weight"]), (&json["directions"][i], &json["weight"][i]));
        let drawn =
            [numbers(&json["directions"][i]), vec![numbers(&json["pdf"])[i], numbers(&json["weight"])[i]]].concat();
        assert_eq!(found[4 * i..][..4], drawn);
    }

    let found = floats(&bytes(asked.post("albedo", FLOATS, wi)).await);
    let json: Value = asked
        .service
        .post(&format!("{}/albedo", asked.path))
        .json(&json!({ "wi": side(0) }))
        .send()
        .await
        .unwrap()
        .json()
        .await
        .unwrap();
    assert_eq!(json["values"].as_array().unwrap().iter().flat_map(numbers).collect::<Vec<_>>(), found);
    asked.service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn pieces_of_any_size_say_the_same() {
    let data = tempfile::tempdir().unwrap();
    let asked = Asked::start(data.path(), |_| {}).await;
    let records = pairs(50);
    let expected: Vec<f32> = records.iter().flat_map(|&record| asked.spectrum(record)).collect();
    for size in [1, 3, 16, 100] {
        let found = bytes(asked.post("evaluate", FLOATS, pieces(&packed(&records), size))).await;
        assert_eq!(floats(&found), expected, "{size}");
        let found = lines(&bytes(asked.post("evaluate", LINES, pieces(&lined(&records), size))).await);
        assert_eq!(found.iter().flat_map(|line| numbers(&line["values"])).collect::<Vec<_>>(), expected, "{size}");
    }
    for media in [LINES, FLOATS] {
        assert_eq!(bytes(asked.post("evaluate", media, Vec::new())).await, b"");
    }
    let blank = bytes(asked.post("evaluate", LINES, "\n\r\n  \n".to_owned())).await;
    assert_eq!(blank, b"");
    asked.service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_line_in_is_a_line_out_before_the_next() {
    let data = tempfile::tempdir().unwrap();
    let asked = Asked::start(data.path(), |_| {}).await;
    let records = pairs(3);
    let (send, receive) = tokio::sync::mpsc::unbounded_channel::<Result<Vec<u8>, std::io::Error>>();
    let body = Body::wrap_stream(tokio_stream::wrappers::UnboundedReceiverStream::new(receive));
    send.send(Ok(lined(&records[..1]))).unwrap();
    let mut response = asked.post("evaluate", LINES, body).send().await.unwrap();
    for i in 0..records.len() {
        let line = response.chunk().await.unwrap().unwrap();
        assert_eq!(numbers(&lines(&line)[0]["values"]), asked.spectrum(records[i]));
        if i + 1 < records.len() {
            send.send(Ok(lined(&records[i + 1..][..1]))).unwrap();
        }
    }
    drop(send);
    assert_eq!(response.chunk().await.unwrap(), None);
    asked.service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_wrong_in_a_stream_ends_it() {
    let data = tempfile::tempdir().unwrap();
    let asked = Asked::start(data.path(), |_| {}).await;
    let good = lined(&pairs(5000));
    let bad = [&good[..], b"\n{\"wi\":[1,2],\"wo\":[200,2]}\n", &good].concat();
    for size in [64, bad.len()] {
        let found = lines(&bytes(asked.post("evaluate", LINES, pieces(&bad, size))).await);
        assert_eq!(found.len(), 5001);
        let last = &found[5000];
        assert_eq!((&last["type"], &last["status"]), (&json!("urn:wavelume:problem:invalid-request"), &json!(422)));
        assert!(last["detail"].as_str().unwrap().starts_with("line 5002: wo: found [200, 2]"), "{last}");
    }
    for (text, status, code) in [
        ("{\"wi\":[1,2],\"wo\":[200,2]}\n", 422, "invalid-request"),
        ("{\"wi\":[120,2],\"wo\":[1,2]}\n", 422, "unfit-query"),
        ("{\"wo\":[1,2]}", 422, "unfit-query"),
        ("[[1,2],[3,4]]\n", 422, "invalid-request"),
        ("{\"wi\":\n", 400, "bad-body"),
    ] {
        let refused = problem(asked.post("evaluate", LINES, text), status, code).await;
        assert!(refused["detail"].as_str().unwrap().starts_with("line 1: "), "{refused}");
    }
    problem(asked.post("evaluate", LINES, " ".repeat(9000)), 413, "too-large").await;

    let mut records = pairs(5000);
    records[4900][0] = f32::NAN;
    let (found, whole) = read(asked.post("evaluate", FLOATS, packed(&records))).await;
    assert!(!whole && found.len() <= 4900 * 12, "{}", found.len());
    let second = [records[0], [100.0, 0.0, 0.0, 0.0]];
    let refused = problem(asked.post("evaluate", FLOATS, packed(&second)), 422, "unfit-query").await;
    assert!(refused["detail"].as_str().unwrap().starts_with("record 2: wi has theta = 100"), "{refused}");
    records[0][0] = 100.0;
    let refused = problem(asked.post("evaluate", FLOATS, packed(&records)), 422, "unfit-query").await;
    assert!(refused["detail"].as_str().unwrap().starts_with("record 1: wi has theta = 100"), "{refused}");

    let odd = &packed(&pairs(3))[..45];
    let refused = problem(asked.post("evaluate", FLOATS, odd.to_vec()), 400, "bad-body").await;
    assert!(refused["detail"].as_str().unwrap().contains("13 bytes into a record of 16"), "{refused}");
    problem(asked.post("evaluate", FLOATS, pieces(&odd[..7], 2)), 400, "bad-body").await;
    let (_, whole) = read(asked.post("evaluate", FLOATS, pieces(odd, 2))).await;
    assert!(!whole, "a cut record is no whole answer");
    asked.service.stop().await;
}

/// Reads an answer: the bytes received, and true if it ended as it should. A cut may come before any other byte.
async fn read(request: RequestBuilder) -> (Vec<u8>, bool) {
    let mut found = Vec::new();
    let Ok(mut response) = request.send().await else { return (found, false) };
    assert_eq!(response.status(), StatusCode::OK);
    loop {
        match response.chunk().await {
            Ok(Some(piece)) => found.extend(piece),
            Ok(None) => return (found, true),
            Err(_) => return (found, false),
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn media_types_are_negotiated() {
    let data = tempfile::tempdir().unwrap();
    let asked = Asked::start(data.path(), |_| {}).await;
    let pair = packed(&pairs(1));
    for what in ["evaluate", "pdf", "sample", "albedo"] {
        problem(asked.post(what, "text/plain", "1 2 3 4"), 415, "unsupported-media-type").await;
        problem(asked.post(what, FLOATS, pair.clone()).header("accept", "text/html"), 406, "not-acceptable").await;
        problem(asked.post(what, LINES, "{}").header("accept", "application/json"), 406, "not-acceptable").await;
        problem(asked.post(what, "application/json", "{}").header("accept", "image/png"), 406, "not-acceptable").await;
        problem(asked.post(what, FLOATS, pair.clone()).header("content-encoding", "gzip"), 415, "unsupported-encoding")
            .await;
        problem(asked.post(&format!("{what}?nonsense=1"), FLOATS, pair.clone()), 400, "bad-query").await;
        problem(asked.post(&format!("{what}?index=x"), FLOATS, pair.clone()), 400, "bad-query").await;
        let absent = wavelume::store::Digest::of(b"absent");
        let nowhere = asked.service.post(&format!("/v1/materials/{absent}/{what}")).header("content-type", FLOATS);
        problem(nowhere.body(pair.clone()), 404, "not-found").await;
    }
    // A spectrum has no directions that a record could hold.
    let spectrum = asked.service.material().await;
    let records = asked.service.post(&format!("/v1/materials/{spectrum}/evaluate")).header("content-type", FLOATS);
    problem(records.body(pair), 422, "unfit-query").await;
    let lines = asked.service.post(&format!("/v1/materials/{spectrum}/evaluate")).header("content-type", LINES);
    assert!(bytes(lines.body("{}\n{}\n")).await.starts_with(b"{\"values\":["));
    asked.service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn huge_counts_cost_nothing() {
    let data = tempfile::tempdir().unwrap();
    let asked = Asked::start(data.path(), |limits| limits.streams = 1).await;
    let sample =
        |count: u64| asked.post("sample", "application/json", json!({ "wi": [30, 0], "count": count }).to_string());
    problem(sample(1 << 62), 422, "invalid-request").await;
    problem(sample(1 << 62).header("accept", FLOATS), 422, "invalid-request").await;
    problem(sample(5_000_000), 422, "invalid-request").await;
    problem(
        asked.post(
            "evaluate",
            "application/json",
            json!({ "wi": [[1, 1]], "wo": [[1, 1]], "wavelengths": vec![450.0; 70_000] }).to_string(),
        ),
        422,
        "invalid-request",
    )
    .await;
    let mut endless = sample(1_000_000_000).header("accept", FLOATS).send().await.unwrap();
    assert!(!endless.chunk().await.unwrap().unwrap().is_empty());
    drop(endless);
    free(&asked).await;

    // A declared length is believed only as far as it is read.
    let address = asked.service.base.trim_start_matches("http://").to_owned();
    for length in [(1_u64 << 60).to_string(), (u64::MAX - 15).to_string()] {
        let mut stream = tokio::net::TcpStream::connect(&address).await.unwrap();
        let head = format!(
            "POST {}/evaluate HTTP/1.1\r\nhost: localhost\r\ncontent-type: {FLOATS}\r\ncontent-length: {length}\r\n\r\n",
            asked.path
        );
        stream.write_all(&[head.as_bytes(), &packed(&pairs(1))].concat()).await.unwrap();
        let mut answer = [0; 12];
        stream.read_exact(&mut answer).await.unwrap();
        assert!(answer.starts_with(b"HTTP/1.1 "), "{answer:?}");
        drop(stream);
        free(&asked).await;
    }
    asked.service.stop().await;
}

/// Waits until the only place for streams is free again.
async fn free(asked: &Asked) {
    for _ in 0..500 {
        let response = asked.post("evaluate", FLOATS, packed(&pairs(1))).send().await.unwrap();
        if response.status() == StatusCode::OK {
            assert_eq!(response.bytes().await.unwrap().len(), 12);
            return;
        }
        assert!(response.headers().contains_key("retry-after"));
        problem_of(response, 503, "overloaded").await;
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    panic!("a stream that nobody reads holds its place");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_client_that_does_not_read_is_not_read_from_and_nobody_waits_for_it() {
    let data = tempfile::tempdir().unwrap();
    let asked = Asked::start(data.path(), |limits| limits.streams = 1).await;
    let address = asked.service.base.trim_start_matches("http://").to_owned();
    let (mut input, mut output) = tokio::net::TcpStream::connect(&address).await.unwrap().into_split();
    let head = format!(
        "POST {}/evaluate HTTP/1.1\r\nhost: localhost\r\ncontent-type: {FLOATS}\r\ncontent-length: {}\r\n\r\n",
        asked.path,
        1_u64 << 40
    );
    output.write_all(head.as_bytes()).await.unwrap();
    let sent = Arc::new(AtomicUsize::new(0));
    let sending = tokio::spawn({
        let (sent, piece) = (Arc::clone(&sent), packed(&pairs(4096)));
        async move {
            while output.write_all(&piece).await.is_ok() {
                sent.fetch_add(piece.len(), Ordering::Relaxed);
            }
        }
    });
    let mut before = 0;
    loop {
        tokio::time::sleep(Duration::from_millis(300)).await;
        let now = sent.load(Ordering::Relaxed);
        if now == before {
            break;
        }
        assert!(now < 256 << 20, "{now} bytes were taken from a client that reads nothing");
        before = now;
    }
    let one = format!("{}/spectrum?wi=30,0&wo=10,20", asked.path);
    assert_eq!(asked.service.get(&one).send().await.unwrap().status(), StatusCode::OK);
    problem(asked.post("evaluate", FLOATS, packed(&pairs(1))), 503, "overloaded").await;
    // It goes on where it stood.
    let (mut read, mut some) = (0, vec![0; 1 << 20]);
    while read < 32 << 20 {
        read += input.read(&mut some).await.unwrap();
    }
    assert!(sent.load(Ordering::Relaxed) > before);
    sending.abort();
    let _ = sending.await;
    drop(input);
    free(&asked).await;
    asked.service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_material_larger_than_the_cache_answers_too() {
    let data = tempfile::tempdir().unwrap();
    let asked = Asked::start(data.path(), |limits| {
        limits.opened_bytes = 0;
        limits.content_bytes = 0;
    })
    .await;
    let record = pairs(1);
    for _ in 0..2 {
        let found = bytes(asked.post("evaluate", FLOATS, packed(&record))).await;
        assert_eq!(floats(&found), asked.spectrum(record[0]));
        bytes(asked.service.get(&format!("{}/content", asked.path))).await;
    }
    assert_eq!(asked.service.request(reqwest::Method::DELETE, &asked.path).send().await.unwrap().status(), 204);
    problem(asked.service.get(&format!("{}/content", asked.path)), 404, "not-found").await;
    problem(asked.post("evaluate", FLOATS, packed(&record)), 404, "not-found").await;
    asked.service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_deleted_material_is_gone_from_every_cache() {
    let data = tempfile::tempdir().unwrap();
    let asked = Asked::start(data.path(), |_| {}).await;
    let content = format!("{}/content", asked.path);
    let one = format!("{}/spectrum?wi=30,0&wo=10,20", asked.path);
    let ask = |path: &str| asked.service.get(path);
    let all = futures::future::join_all((0..16).map(|_| bytes(ask(&one)))).await;
    assert!(all.iter().all(|answer| *answer == all[0]));
    let file = bytes(ask(&content)).await;
    assert_eq!(bytes(ask(&content)).await, file);
    assert_eq!(asked.service.request(reqwest::Method::DELETE, &asked.path).send().await.unwrap().status(), 204);
    problem(ask(&content), 404, "not-found").await;
    problem(ask(&one), 404, "not-found").await;
    asked.service.stop().await;
}
