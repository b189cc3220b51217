//! Resumable uploads by the protocol tus 1.0: continued through another node after each break, and used like a body.

use crate::crash::Program;
use crate::service::{D65, LAMP, Service, config, npy, objects, problem, problem_of};
use reqwest::{Method, RequestBuilder, Response, StatusCode};
use serde_json::Value;
use std::path::Path;
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use wavelume::store::Digest;
use wavelume::{Archive, Check};

const KIND: (&str, &str) = ("content-type", "application/offset+octet-stream");

fn tus(service: &Service, method: &str, path: &str) -> RequestBuilder {
    service.request(method.parse().unwrap(), path).header("tus-resumable", "1.0.0")
}

fn number(response: &Response, name: &str) -> u64 {
    response.headers()[name].to_str().unwrap().parse().unwrap()
}

async fn begin(service: &Service, length: usize) -> String {
    let begun = tus(service, "POST", "/v1/uploads").header("upload-length", length).send().await.unwrap();
    assert_eq!(begun.status(), StatusCode::CREATED);
    assert_eq!(begun.headers()["tus-resumable"], "1.0.0");
    begun.headers()["location"].to_str().unwrap().to_owned()
}

fn patch(service: &Service, path: &str, offset: usize, bytes: &[u8]) -> RequestBuilder {
    tus(service, "PATCH", path).header(KIND.0, KIND.1).header("upload-offset", offset).body(bytes.to_vec())
}

async fn send(service: &Service, path: &str, offset: usize, bytes: &[u8]) {
    let response = patch(service, path, offset, bytes).send().await.unwrap();
    assert_eq!(response.status(), StatusCode::NO_CONTENT);
    assert_eq!(number(&response, "upload-offset"), (offset + bytes.len()) as u64);
}

async fn offset(service: &Service, path: &str) -> u64 {
    let head = tus(service, "HEAD", path).send().await.unwrap();
    assert_eq!(head.status(), StatusCode::OK);
    assert_eq!(head.headers()["cache-control"], "no-store");
    number(&head, "upload-offset")
}

fn id(path: &str) -> &str {
    path.rsplit('/').next().unwrap()
}

async fn parts(data: &Path, path: &str) -> usize {
    let archive = Archive::look_after(&config(data).work.site).await.unwrap();
    let report = archive.check_within(Check::default()).await.unwrap();
    assert_eq!(report.faults, []);
    objects(data, id(path)).await.len()
}

#[tokio::test(flavor = "multi_thread")]
async fn an_upload_is_continued_through_another_node_and_becomes_a_measurement() {
    let data = tempfile::tempdir().unwrap();
    let nodes = [Service::start(config(data.path())).await, Service::start(config(data.path())).await];
    let options = nodes[0].request(Method::OPTIONS, "/v1/uploads").send().await.unwrap();
    assert_eq!((options.status(), number(&options, "tus-max-size")), (StatusCode::NO_CONTENT, 256 << 20));
    assert!(options.headers()["tus-extension"].to_str().unwrap().contains("creation-with-upload"));

    let begun = tus(&nodes[0], "POST", "/v1/uploads").header("upload-length", LAMP.len());
    let begun = begun.header("upload-metadata", "filename bGFtcC5pZXM=,private").send().await.unwrap();
    let path = begun.headers()["location"].to_str().unwrap().to_owned();
    assert_eq!((number(&begun, "upload-offset"), begun.headers().contains_key("upload-expires")), (0, true));
    let mut sent = 0;
    for (turn, piece) in LAMP.chunks(LAMP.len() / 7).enumerate() {
        send(&nodes[turn % 2], &path, sent, piece).await;
        sent += piece.len();
        assert_eq!(offset(&nodes[(turn + 1) % 2], &path).await, sent as u64);
        if turn == 3 {
            let used = nodes[0].post(&format!("/v1/measurements?upload={}", id(&path)));
            let refusal = problem(used, 409, "incomplete-upload").await;
            assert!(
                refusal["detail"].as_str().unwrap().contains(&format!("{sent} bytes of {}", LAMP.len())),
                "{refusal}"
            );
        }
    }
    assert!(parts(data.path(), &path).await >= 7);
    let head = tus(&nodes[1], "HEAD", &path).send().await.unwrap();
    assert_eq!(number(&head, "upload-length"), LAMP.len() as u64);
    assert_eq!(head.headers()["upload-metadata"], "filename bGFtcC5pZXM=,private");

    let use_path = format!("/v1/measurements?upload={}&name=Lamp", id(&path));
    problem(nodes[1].post(&use_path).body("more"), 400, "bad-body").await;
    let used = nodes[1].post(&use_path).send().await.unwrap();
    assert_eq!(used.status(), StatusCode::CREATED);
    let lamp: Value = used.json().await.unwrap();
    assert_eq!(
        (lamp["id"].as_str().unwrap(), &lamp["file_name"]),
        (&*Digest::of(LAMP).to_string(), &"lamp.ies".into())
    );
    problem(nodes[1].post(&use_path), 404, "not-found").await;
    problem(tus(&nodes[0], "PATCH", &path).header(KIND.0, KIND.1).header("upload-offset", 0), 404, "not-found").await;
    Archive::look_after(&config(data.path()).work.site).await.unwrap().sweep().await.unwrap();
    assert!(parts(data.path(), &path).await >= 7, "the parts wait for readers");
    for node in nodes {
        node.stop().await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_arrived_before_a_break_is_kept() {
    let data = tempfile::tempdir().unwrap();
    let nodes = [Service::start(config(data.path())).await, Service::start(config(data.path())).await];
    let path = begin(&nodes[0], LAMP.len()).await;
    let mut sent = 0_usize;
    let mut turn = 0;
    while sent < LAMP.len() {
        let (node, left) = (&nodes[turn % 2], LAMP.len() - sent);
        let address = node.base.trim_start_matches("http://").to_owned();
        let mut stream = TcpStream::connect(&address).await.unwrap();
        let head = format!(
            "PATCH {path} HTTP/1.1\r\nHost: {address}\r\nTus-Resumable: 1.0.0\r\nContent-Type: {}\r\n\
             Upload-Offset: {sent}\r\nContent-Length: {left}\r\n\r\n",
            KIND.1
        );
        stream.write_all(head.as_bytes()).await.unwrap();
        let some = (LAMP.len() / 4).min(left);
        stream.write_all(&LAMP[sent..sent + some]).await.unwrap();
        stream.flush().await.unwrap();
        // The connection breaks behind the bytes, once the service has begun with the request.
        tokio::time::sleep(Duration::from_millis(500)).await;
        drop(stream);
        turn += 1;
        let found = loop {
            let found = offset(&nodes[turn % 2], &path).await as usize;
            if found > sent {
                break found;
            }
            tokio::time::sleep(Duration::from_millis(50)).await;
        };
        assert_eq!(found, sent + some);
        sent = found;
    }
    let used = nodes[0].post(&format!("/v1/measurements?upload={}", id(&path))).send().await.unwrap();
    assert_eq!(used.json::<Value>().await.unwrap()["id"], Digest::of(LAMP).to_string());
    for node in nodes {
        node.stop().await;
    }
}

const MIB: usize = 1 << 20;

/// Begins a request of `length` bytes over a connection of its own, to which its bytes are written.
async fn sending(base: &str, method: &str, path: &str, headers: &str, length: usize) -> TcpStream {
    let address = base.trim_start_matches("http://");
    let mut stream = TcpStream::connect(address).await.unwrap();
    let head = format!(
        "{method} {path} HTTP/1.1\r\nHost: {address}\r\nTus-Resumable: 1.0.0\r\nContent-Type: {}\r\n{headers}\
         Content-Length: {length}\r\n\r\n",
        KIND.1
    );
    stream.write_all(head.as_bytes()).await.unwrap();
    stream
}

/// Waits until so many parts are being received that have `mib` MiB at least and are not complete.
async fn staged(data: &Path, files: usize, mib: usize) {
    let begun = (mib * MIB) as u64..(15 * MIB) as u64;
    loop {
        let entries = std::fs::read_dir(data.join("staging")).unwrap();
        // A file may be published meanwhile.
        let sizes: Vec<u64> = entries.filter_map(|entry| Some(entry.ok()?.metadata().ok()?.len())).collect();
        if sizes.iter().filter(|size| begun.contains(size)).count() == files {
            return;
        }
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stop_keeps_what_has_come_answers_and_frees_the_upload() {
    let data = tempfile::tempdir().unwrap();
    let [first, second] = [Service::start(config(data.path())).await, Service::start(config(data.path())).await];
    let array = npy(&[64, 1024, 75]);
    assert!(array.len() > 18 * MIB);
    let path = begin(&first, array.len()).await;
    let offset_0 = "Upload-Offset: 0\r\n";
    let mut long = sending(&first.base, "PATCH", &path, offset_0, array.len()).await;
    long.write_all(&array[..18 * MIB]).await.unwrap();
    // The client learns the address of this one only from the answer.
    let length = format!("Upload-Length: {}\r\n", array.len());
    let mut begun = sending(&first.base, "POST", "/v1/uploads", &length, array.len()).await;
    begun.write_all(&array[..3 * MIB]).await.unwrap();
    // Nothing of a checksum's request is kept unless all of it comes, for which it has the drain time.
    let checked = begin(&first, LAMP.len()).await;
    let sum = format!("{offset_0}Upload-Checksum: sha256 {}\r\n", ring_sha256(LAMP));
    let mut summed = sending(&first.base, "PATCH", &checked, &sum, LAMP.len()).await;
    summed.write_all(&LAMP[..50]).await.unwrap();
    // The second part of the first one, the first part of the other, and the one with a checksum.
    while std::fs::read_dir(data.path().join("staging")).unwrap().count() != 3 {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    staged(data.path(), 2, 2).await;
    let stopped = tokio::spawn(first.stop());
    let mut answers = [String::new(), String::new(), String::new()];
    long.read_to_string(&mut answers[0]).await.unwrap();
    assert!(answers[0].starts_with("HTTP/1.1 503") && answers[0].contains("the service stops"), "{}", answers[0]);
    begun.read_to_string(&mut answers[1]).await.unwrap();
    assert!(answers[1].starts_with("HTTP/1.1 201"), "{}", answers[1]);
    summed.write_all(&LAMP[50..]).await.unwrap();
    summed.read_to_string(&mut answers[2]).await.unwrap();
    assert!(answers[2].starts_with("HTTP/1.1 204"), "{}", answers[2]);
    stopped.await.unwrap();
    // Nothing is locked. Writes to temporary files lag behind by less than a MiB.
    let kept = offset(&second, &path).await as usize;
    assert!((17 * MIB..=18 * MIB).contains(&kept), "{kept}");
    assert_eq!(objects(data.path(), id(&path)).await.len(), 2);
    assert_eq!(offset(&second, &checked).await, LAMP.len() as u64);
    let location = answers[1].lines().find_map(|line| line.strip_prefix("location: ")).unwrap();
    assert!(offset(&second, location).await as usize >= 2 * MIB);
    send(&second, &path, kept, &array[kept..]).await;
    let used = second.post(&format!("/v1/measurements?upload={}", id(&path))).send().await.unwrap();
    assert_eq!(used.json::<Value>().await.unwrap()["id"], Digest::of(&array).to_string());
    second.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_killed_process_loses_one_part_of_a_long_request() {
    let data = tempfile::tempdir().unwrap();
    let program = Program::start(data.path());
    let client = reqwest::Client::builder().no_proxy().build().unwrap();
    let bytes = vec![7; 40 * MIB];
    let begun = client.post(format!("{}/v1/uploads", program.base)).header("tus-resumable", "1.0.0");
    let begun = begun.header("upload-length", bytes.len()).send().await.unwrap();
    let path = begun.headers()["location"].to_str().unwrap().to_owned();
    let mut stream = sending(&program.base, "PATCH", &path, "Upload-Offset: 0\r\n", bytes.len()).await;
    stream.write_all(&bytes[..39 * MIB]).await.unwrap();
    // The third part: the second one is kept.
    while std::fs::read_dir(data.path().join("uploads")).map_or(0, Iterator::count) < 2 {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    staged(data.path(), 1, 3).await;
    program.kill();
    let program = Program::start(data.path());
    let kept = loop {
        let head =
            client.head(format!("{}{path}", program.base)).header("tus-resumable", "1.0.0").send().await.unwrap();
        if head.status() == StatusCode::OK {
            break number(&head, "upload-offset") as usize;
        }
        assert_eq!(head.status(), StatusCode::LOCKED, "until the lease ends");
    };
    assert!((30 * MIB..32 * MIB).contains(&kept), "{kept}");
    program.kill();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_long_request_with_a_checksum_is_kept_whole_or_not_at_all_and_few_parts_take_all() {
    let data = tempfile::tempdir().unwrap();
    let mut config = config(data.path());
    config.work.limits.partial_parts = 3;
    let service = Service::start(config).await;
    let bytes = vec![7; 17 * MIB];
    let path = begin(&service, 4 * bytes.len()).await;
    let checked = |sum: &str| patch(&service, &path, 0, &bytes).header("upload-checksum", format!("sha256 {sum}"));
    problem(checked(&ring_sha256(b"other")), 460, "checksum-mismatch").await;
    assert_eq!(offset(&service, &path).await, 0);
    assert_eq!(checked(&ring_sha256(&bytes)).send().await.unwrap().status(), StatusCode::NO_CONTENT);
    assert_eq!(parts(data.path(), &path).await, 1);
    send(&service, &path, bytes.len(), &bytes.repeat(3)).await;
    assert_eq!(parts(data.path(), &path).await, 3, "the last part that is allowed takes the rest");
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn each_refusal_of_the_protocol_has_its_status() {
    let data = tempfile::tempdir().unwrap();
    let mut config = config(data.path());
    config.work.limits.upload_bytes = 64 << 10;
    config.work.limits.partial_uploads_each = 4;
    config.work.limits.partial_bytes_each = 190 << 10;
    config.work.limits.partial_parts = 3;
    config.work.limits.partial_keep = Duration::from_mins(10);
    let service = Service::start(config).await;
    let path = begin(&service, D65.len()).await;
    let post = || tus(&service, "POST", "/v1/uploads");

    let other = problem_of(
        service.post("/v1/uploads").header("upload-length", 1).send().await.unwrap(),
        412,
        "unknown-version",
    );
    assert!(other.await["detail"].as_str().unwrap().contains("expected 1.0.0"));
    let refused = service.post("/v1/uploads").header("tus-resumable", "0.2.2").send().await.unwrap();
    assert_eq!(
        (&refused.headers()["tus-version"], &refused.headers()["tus-resumable"]),
        (&"1.0.0".parse().unwrap(), &"1.0.0".parse().unwrap())
    );
    problem(post(), 400, "bad-header").await;
    problem(post().header("upload-length", "x"), 400, "bad-header").await;
    problem(post().header("upload-length", 1).header("upload-metadata", "a ?"), 400, "bad-header").await;
    problem(post().header("upload-length", (64 << 10) + 1), 413, "too-large").await;

    send(&service, &path, 0, &D65[..100]).await;
    problem(patch(&service, &path, 99, b"x"), 409, "wrong-offset").await;
    let text = tus(&service, "PATCH", &path).header(KIND.0, "text/plain").header("upload-offset", 100).body("x");
    problem(text, 415, "unsupported-media-type").await;
    problem(patch(&service, &path, 100, &vec![b'x'; 60 << 10]), 413, "too-large").await;
    let checked = |sum: &str| patch(&service, &path, 100, &D65[100..111]).header("upload-checksum", sum);
    problem(checked("crc32 AAAA"), 400, "bad-header").await;
    problem(checked("sha1 Kq5sNclPz7QV2+lfQIuc6R7oRu0="), 460, "checksum-mismatch").await;
    assert_eq!(offset(&service, &path).await, 100);
    let digest = ring_sha256(&D65[100..111]);
    assert_eq!(checked(&format!("sha256 {digest}")).send().await.unwrap().status(), StatusCode::NO_CONTENT);
    // A network that passes only POST.
    let rest = tus(&service, "POST", &path).header("x-http-method-override", "PATCH").header(KIND.0, KIND.1);
    let rest = rest.header("upload-offset", 111).body(D65[111..200].to_vec()).send().await.unwrap();
    assert_eq!(number(&rest, "upload-offset"), 200);
    problem(patch(&service, &path, 200, b"x"), 422, "over-limit").await;
    problem(tus(&service, "POST", &path), 400, "bad-header").await;

    // The first bytes come with the beginning, and the size later.
    let begun = post().header("upload-defer-length", 1).header(KIND.0, KIND.1).body(D65[..9].to_vec());
    let begun = begun.send().await.unwrap();
    assert_eq!((begun.status(), number(&begun, "upload-offset")), (StatusCode::CREATED, 9));
    let late = begun.headers()["location"].to_str().unwrap().to_owned();
    let head = tus(&service, "HEAD", &late).send().await.unwrap();
    assert_eq!((number(&head, "upload-defer-length"), head.headers().contains_key("upload-length")), (1, false));
    problem(service.post(&format!("/v1/measurements?upload={}", id(&late))), 409, "incomplete-upload").await;
    let rest = patch(&service, &late, 9, &D65[9..]).header("upload-length", D65.len()).send().await.unwrap();
    assert_eq!(rest.status(), StatusCode::NO_CONTENT);
    let refused = service.post(&format!("/v1/materials?upload={}", id(&late)));
    problem(refused, 422, "malformed-material").await;
    let used = service.post(&format!("/v1/measurements?upload={}", id(&late))).send().await.unwrap();
    assert_eq!(used.json::<Value>().await.unwrap()["id"], Digest::of(D65).to_string(), "a refusal leaves the upload");

    // An upload whose first bytes are refused is gone: it does not count for the limits below.
    for _ in 0..4 {
        let first = post().header("upload-length", 64 << 10).header(KIND.0, KIND.1);
        let first = first.header("upload-checksum", "sha1 Kq5sNclPz7QV2+lfQIuc6R7oRu0=").body(D65[..9].to_vec());
        problem(first, 460, "checksum-mismatch").await;
    }

    // Limits of one address, in bytes and in uploads; an address beside it has its own.
    begin(&service, 64 << 10).await;
    begin(&service, 64 << 10).await;
    problem(post().header("upload-length", 64 << 10), 429, "too-many-at-once").await;
    begin(&service, 1).await;
    problem(post().header("upload-length", 1), 429, "too-many-at-once").await;
    let other = reqwest::Client::builder().no_proxy().local_address(Some([127, 0, 0, 9].into())).build().unwrap();
    let other = other.post(format!("{}/v1/uploads", service.base)).header("tus-resumable", "1.0.0");
    assert_eq!(other.header("upload-length", 64 << 10).send().await.unwrap().status(), StatusCode::CREATED);
    assert_eq!(tus(&service, "DELETE", &path).send().await.unwrap().status(), StatusCode::NO_CONTENT);
    problem(tus(&service, "DELETE", &path), 404, "not-found").await;
    problem(tus(&service, "DELETE", "/v1/uploads/x"), 404, "not-found").await;
    begin(&service, 1).await;
    service.stop().await;
}

fn ring_sha256(bytes: &[u8]) -> String {
    use base64::Engine;
    base64::engine::general_purpose::STANDARD.encode(ring::digest::digest(&ring::digest::SHA256, bytes))
}

#[tokio::test(flavor = "multi_thread")]
async fn one_request_at_a_time_holds_an_upload_and_an_expired_one_is_gone() {
    let data = tempfile::tempdir().unwrap();
    let mut config = config(data.path());
    config.work.limits.partial_keep = Duration::from_secs(9);
    let service = Service::start(config).await;
    let path = begin(&service, LAMP.len()).await;
    let (mut sender, body) = tokio::io::duplex(1 << 16);
    sender.write_all(&LAMP[..50]).await.unwrap();
    let body = reqwest::Body::wrap_stream(tokio_util::io::ReaderStream::new(body));
    let first = tus(&service, "PATCH", &path).header(KIND.0, KIND.1).header("upload-offset", 0).body(body);
    let first = tokio::spawn(first.send());
    tokio::time::sleep(Duration::from_millis(500)).await;
    let refusal = problem(patch(&service, &path, 0, LAMP), 423, "locked").await;
    assert!(refusal["detail"].as_str().unwrap().contains("another request"), "{refusal}");
    sender.write_all(&LAMP[50..99]).await.unwrap();
    drop(sender);
    assert_eq!(number(&first.await.unwrap().unwrap(), "upload-offset"), 99);
    send(&service, &path, 99, &LAMP[99..]).await;
    loop {
        let head = tus(&service, "HEAD", &path).send().await.unwrap();
        if head.status() == StatusCode::GONE {
            break;
        }
        tokio::time::sleep(Duration::from_millis(300)).await;
    }
    problem(patch(&service, &path, LAMP.len(), b""), 410, "gone").await;
    problem(service.post(&format!("/v1/measurements?upload={}", id(&path))), 410, "gone").await;
    service.stop().await;
}
