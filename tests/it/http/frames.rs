//! HTTP/2 spoken by hand: floods that end the connection, answers that the client does not let through, headers that
//! are too large.

use crate::service::{Service, config};
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

const PREFACE: &[u8] = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";
const HEADERS: u8 = 1;
const RST_STREAM: u8 = 3;
const SETTINGS: u8 = 4;
const PING: u8 = 6;
const CONTINUATION: u8 = 9;
const END_STREAM: u8 = 1;
const END_HEADERS: u8 = 4;
const ACK: u8 = 1;

fn frame(kind: u8, flags: u8, stream: u32, payload: &[u8]) -> Vec<u8> {
    let length = (payload.len() as u32).to_be_bytes();
    [&length[1..], &[kind, flags], &stream.to_be_bytes(), payload].concat()
}

/// A string of HPACK, not Huffman-coded; its length fits the prefix of seven bits.
fn string(text: &str) -> Vec<u8> {
    assert!(text.len() < 127, "{text}");
    [&[text.len() as u8], text.as_bytes()].concat()
}

/// Fields of `GET path`: the static table has the method, the scheme and the names of the rest.
fn fields(path: &str) -> Vec<u8> {
    [&[0x82, 0x86, 0x04][..], &string(path), &[0x01], &string("127.0.0.1")].concat()
}

async fn open(service: &Service, settings: &[u8]) -> TcpStream {
    let mut stream = TcpStream::connect(service.base.trim_start_matches("http://")).await.unwrap();
    stream.write_all(&[PREFACE, &frame(SETTINGS, 0, 0, settings)].concat()).await.unwrap();
    stream
}

/// Reads the kinds and payloads of all frames until the server closes.
async fn rest(mut stream: TcpStream) -> Vec<(u8, Vec<u8>)> {
    let mut bytes = Vec::new();
    // A reset by the server ends the reading, too.
    let _ = stream.read_to_end(&mut bytes).await;
    let mut frames = Vec::new();
    let mut rest = &bytes[..];
    while rest.len() >= 9 {
        let length = u32::from_be_bytes([0, rest[0], rest[1], rest[2]]) as usize;
        let end = rest.len().min(9 + length);
        frames.push((rest[3], rest[9..end].to_vec()));
        rest = &rest[end..];
    }
    frames
}

#[tokio::test(flavor = "multi_thread")]
async fn floods_of_resets_and_of_continuations_end_the_connection() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let mut resets = open(&service, &[]).await;
    let mut flood = Vec::new();
    for stream in (1..4000).step_by(2) {
        flood.extend(frame(HEADERS, END_STREAM | END_HEADERS, stream, &fields("/v1/formats")));
        flood.extend(frame(RST_STREAM, 0, stream, &8_u32.to_be_bytes()));
    }
    // The server may close before it has taken everything.
    let _ = resets.write_all(&flood).await;
    let frames = rest(resets).await;
    assert!(frames.iter().filter(|(kind, _)| *kind == HEADERS).count() < 1000, "the flood was not answered whole");

    let mut endless = open(&service, &[]).await;
    let mut flood = frame(HEADERS, END_STREAM, 1, &fields("/v1/formats"));
    for i in 0..2000 {
        let field = [&[0x00][..], &string(&format!("x-{i}")), &string(&"y".repeat(100))].concat();
        flood.extend(frame(CONTINUATION, 0, 1, &field));
    }
    let _ = endless.write_all(&flood).await;
    rest(endless).await;

    service.upload("", crate::service::D65).await;
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_answer_that_the_client_lets_not_come_gives_its_place_back() {
    let data = tempfile::tempdir().unwrap();
    let mut config = config(data.path());
    config.work.limits.idle = Duration::from_millis(500);
    config.work.limits.exports = 1;
    let service = Service::start(config).await;
    let material = service.brdf().await;
    // SETTINGS_INITIAL_WINDOW_SIZE = 0: no byte of a body may be sent.
    let mut stream = open(&service, &[0, 4, 0, 0, 0, 0]).await;
    let path = format!("/v1/materials/{material}/export?format=npy");
    let request = frame(HEADERS, END_STREAM | END_HEADERS, 1, &fields(&path));
    stream.write_all(&request).await.unwrap();
    // Answers every ping, so that only the unread answer can end the connection.
    let (mut input, mut output) = stream.into_split();
    let mut head = [0; 9];
    while input.read_exact(&mut head).await.is_ok() {
        let mut payload = vec![0; u32::from_be_bytes([0, head[0], head[1], head[2]]) as usize];
        if input.read_exact(&mut payload).await.is_err() {
            break;
        }
        if head[3] == PING && head[4] & ACK == 0 {
            let _ = output.write_all(&frame(PING, ACK, 0, &payload)).await;
        }
    }
    let again = service.get(&path).send().await.unwrap();
    assert_eq!(again.status(), reqwest::StatusCode::OK, "{}", again.text().await.unwrap());
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn connections_that_only_answer_pings_are_closed() {
    let data = tempfile::tempdir().unwrap();
    let mut config = config(data.path());
    config.work.limits.idle = Duration::from_millis(300);
    let service = Service::start(config).await;
    let (mut input, mut output) = open(&service, &[]).await.into_split();
    let mut head = [0; 9];
    while input.read_exact(&mut head).await.is_ok() {
        let mut payload = vec![0; u32::from_be_bytes([0, head[0], head[1], head[2]]) as usize];
        let _ = input.read_exact(&mut payload).await;
        if head[3] == PING && head[4] & ACK == 0 {
            let _ = output.write_all(&frame(PING, ACK, 0, &payload)).await;
        }
    }
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn headers_larger_than_the_limit_are_refused() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let fits = service.get("/v1/formats").header("x-long", "y".repeat(20 << 10)).send().await.unwrap();
    assert_eq!(fits.status(), reqwest::StatusCode::OK);
    let long = service.get("/v1/formats").header("x-long", "y".repeat(40 << 10)).send().await.unwrap();
    assert_eq!(long.status(), reqwest::StatusCode::REQUEST_HEADER_FIELDS_TOO_LARGE);
    service.stop().await;
}
