//! Heads of requests beyond the limits of size and number, in HTTP/1 and HTTP/2, and streams beyond theirs.

use crate::service::{Service, config};
use reqwest::{Client, StatusCode};
use std::net::SocketAddr;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

/// Most header fields of a request in HTTP/1, with `Host`.
const FIELDS: usize = 100;

#[tokio::test(flavor = "multi_thread")]
async fn headers_are_bounded_in_size_and_number() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let fields = |count: usize| (0..count).fold(String::new(), |text, i| text + &format!("x-{i}: 1\r\n"));
    for (headers, status) in [
        (fields(FIELDS - 2), 200),
        (fields(FIELDS - 1), 431),
        (fields(3000), 431),
        (format!("x: {}\r\n", "a".repeat(30 << 10)), 200),
        (format!("x: {}\r\n", "a".repeat(33 << 10)), 431),
        (format!("{}: 1\r\n", "x".repeat(33 << 10)), 431),
    ] {
        let words = format!("GET /healthz HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n{headers}\r\n");
        let answer = service.talk(words.as_bytes()).await;
        let start: String = words.chars().skip(60).take(20).collect();
        assert_eq!(answer.split(' ').nth(1), Some(status.to_string().as_str()), "{start:?}: {answer}");
    }
    // A head that does not end is cut off at the limit, before it fills the memory.
    let mut stream = TcpStream::connect(service.base.trim_start_matches("http://")).await.unwrap();
    stream.write_all(b"GET /healthz HTTP/1.1\r\nhost: localhost\r\n").await.unwrap();
    let mut sent = 0;
    while sent < 64 << 20 && stream.write_all(&[b'a'; 16 << 10]).await.is_ok() {
        sent += 16 << 10;
    }
    assert!(sent < 64 << 20, "{sent}");

    // HTTP/2 counts 32 bytes for each field besides its own.
    let client = Client::builder().no_proxy().http2_prior_knowledge().build().unwrap();
    for (count, length, is_answered) in [(800, 1, true), (1100, 1, false), (1, 33 << 10, false), (1, 30 << 10, true)] {
        let mut request = client.get(format!("{}/healthz", service.base));
        for i in 0..count {
            request = request.header(format!("x{i}"), "1".repeat(length));
        }
        let answered = request.send().await;
        let status = answered.as_ref().map(reqwest::Response::status);
        assert_eq!(status.as_ref().is_ok_and(|status| *status == StatusCode::OK), is_answered, "{count}: {answered:?}");
        assert!(is_answered || status.is_err() || status.is_ok_and(|status| status == 431), "{count}");
        assert_eq!(service.get("/healthz").send().await.unwrap().status(), StatusCode::OK);
    }
    service.stop().await;
}

/// Frame of HTTP/2.
struct Frame {
    kind: u8,
    stream: u32,
    payload: Vec<u8>,
}

const HEADERS: u8 = 1;
const RESET: u8 = 3;
const SETTINGS: u8 = 4;

fn framed(kind: u8, flags: u8, stream: u32, payload: &[u8]) -> Vec<u8> {
    let mut bytes = u32::try_from(payload.len()).unwrap().to_be_bytes()[1..].to_vec();
    bytes.extend([kind, flags]);
    bytes.extend(stream.to_be_bytes());
    bytes.extend(payload);
    bytes
}

async fn frame(stream: &mut TcpStream) -> Frame {
    let mut head = [0; 9];
    stream.read_exact(&mut head).await.unwrap();
    let mut payload = vec![0; u32::from_be_bytes([0, head[0], head[1], head[2]]) as usize];
    stream.read_exact(&mut payload).await.unwrap();
    Frame { kind: head[3], stream: u32::from_be_bytes([head[5], head[6], head[7], head[8]]), payload }
}

#[tokio::test(flavor = "multi_thread")]
async fn streams_of_a_connection_are_bounded() {
    let data = tempfile::tempdir().unwrap();
    let mut few = config(data.path());
    few.work.limits.h2_streams = 4;
    let service = Service::start(few).await;
    let address: SocketAddr = service.base.trim_start_matches("http://").parse().unwrap();
    let mut stream = TcpStream::connect(address).await.unwrap();
    stream.write_all(b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n").await.unwrap();
    stream.write_all(&framed(SETTINGS, 0, 0, &[])).await.unwrap();
    let settings = frame(&mut stream).await;
    assert_eq!(settings.kind, SETTINGS);
    let told = |number: u8| {
        let entry = settings.payload.chunks(6).find(|entry| entry[1] == number).unwrap();
        u32::from_be_bytes([entry[2], entry[3], entry[4], entry[5]])
    };
    let (streams, headers) = (told(3), told(6));
    assert_eq!((streams, headers), (4, 32 << 10));
    // Uploads whose bodies do not come: POST, http, path and authority.
    let path = b"/v1/measurements";
    let head = [&[0x83, 0x86, 0x44, path.len() as u8][..], path, &[0x41, 9], b"localhost"].concat();
    for number in 0..7 {
        stream.write_all(&framed(HEADERS, 4, 2 * number + 1, &head)).await.unwrap();
    }
    let mut refused = Vec::new();
    while refused.len() < 3 {
        let frame = frame(&mut stream).await;
        if frame.kind == RESET {
            // REFUSED_STREAM: the client may ask again.
            assert_eq!(frame.payload, [0, 0, 0, 7]);
            refused.push(frame.stream);
        }
    }
    assert_eq!(refused, [9, 11, 13]);
    assert_eq!(service.get("/healthz").send().await.unwrap().status(), StatusCode::OK);
    drop(stream);
    service.stop().await;
}
