//! Requests that no honest client makes: each is refused by its own fault, none by a bug of the service.

use crate::service::{Service, config, problem};
use serde_json::Value;

/// Status of the answer to `line` with `headers` and `body`, which must be a problem.
async fn refusal(service: &Service, line: &str, headers: &str, body: &[u8]) -> (u16, String) {
    let length = body.len();
    let mut words = format!("{line} HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n{headers}").into_bytes();
    if length > 0 {
        words.extend(format!("content-length: {length}\r\n").bytes());
    }
    words.extend(b"\r\n");
    words.extend(body);
    let answer = service.talk(&words).await;
    let status = answer.split(' ').nth(1).and_then(|status| status.parse().ok()).unwrap_or_default();
    let body = answer.split("\r\n\r\n").nth(1).unwrap_or_default().to_owned();
    assert!(answer.contains("application/problem+json"), "{line}: {answer}");
    (status, body)
}

#[tokio::test(flavor = "multi_thread")]
async fn paths_and_query_strings_are_text_within_limits() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let material = service.material().await;
    let spectrum = format!("/v1/materials/{material}/spectrum");
    let long = "x".repeat(20_000);
    let cases = [
        ("/v1/../../etc/passwd".to_owned(), 404),
        ("/v1/blobs/..%2f..%2fcatalog.sqlite".to_owned(), 404),
        ("/v1/blobs/%00".to_owned(), 404),
        ("/v1/measurements/%ff".to_owned(), 404),
        ("/v1/formats/%ff/template".to_owned(), 404),
        ("/v1/jobs/%c3%28".to_owned(), 404),
        (format!("/v1/nothing/{long}"), 404),
        ("/v1/materials?q=%00".to_owned(), 400),
        ("/v1/measurements?q=a%00b".to_owned(), 400),
        ("/v1/measurements?q=%ff".to_owned(), 400),
        (format!("/v1/materials?q={}", "x".repeat(256)), 400),
        (format!("/v1/materials?tag={}", "%25".repeat(5000)), 400),
        (format!("/v1/measurements?format={}", "x".repeat(256)), 400),
        (format!("/v1/materials?q={long}"), 414),
        ("/v1/materials?limit=99999999999999999999".to_owned(), 400),
        ("/v1/materials?cursor=1.%00".to_owned(), 400),
        (format!("/v1/materials?cursor={}.b3-0", "f".repeat(40)), 400),
        (format!("{spectrum}?wavelengths=1:1e300:1e-300"), 400),
        (format!("{spectrum}?wavelengths=nan"), 400),
        (format!("{spectrum}?index=99999999999999999999"), 400),
    ];
    for (path, expected) in cases {
        let (status, body) = refusal(&service, &format!("GET {path}"), "", b"").await;
        assert_eq!(status, expected, "{path}: {body}");
        assert!(body.len() < 5_000, "{}", body.len());
    }
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_transfer_coding_other_than_chunked_is_refused() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let post = async |coding: &str| {
        let head =
            "POST /v1/jobs HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\ncontent-type: application/json\r\n";
        let words = format!("{head}transfer-encoding: {coding}\r\n\r\n2\r\n{{}}\r\n0\r\n\r\n");
        service.talk(words.as_bytes()).await
    };
    let chunked = post("chunked").await;
    assert!(chunked.starts_with("HTTP/1.1 422"), "{chunked}");
    let other = post("gzip, chunked").await;
    assert!(other.starts_with("HTTP/1.1 400") && other.contains("Transfer-Encoding"), "{other}");
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn bodies_are_refused_by_what_is_wrong_with_them() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let deep = [b"[".repeat(100_000), b"{\"a\":".repeat(100_000)];
    let json = "content-type: application/json\r\n";
    for (body, expected) in [
        (&deep[0][..], 400),
        (&deep[1], 400),
        (b"{\"a\":\"\xff\"", 400),
        (b"{\"measurement\":\"\xff\"}", 422),
        (b"{\"kind\":\"paper\",\"tables\":[1e400]}", 422),
        (b"{\"kind\":\"paper\",\"tables\":[99999999999999999999]}", 422),
        (b"{\"measurement\":\"\\ud800\"}", 422),
        (b"\0\0\0", 400),
        (b"\xef\xbb\xbf{}", 400),
    ] {
        let (status, text) = refusal(&service, "POST /v1/jobs", json, body).await;
        assert_eq!(status, expected, "{}: {text}", String::from_utf8_lossy(&body[..body.len().min(40)]));
    }
    for (headers, body, expected) in [
        ("content-encoding: gzip\r\n", &b"plain"[..], 400),
        ("content-encoding: gzip, gzip\r\n", b"plain", 415),
        ("", b"\x93NUMPY\x01\x00\x40\x00{'descr': '<f4', 'shape': (4294967296, 4294967296, 4294967296)}", 422),
        ("", b"PK\x03\x04\xff\xff\xff\xff", 422),
    ] {
        let (status, text) = refusal(&service, "POST /v1/measurements", headers, body).await;
        assert_eq!(status, expected, "{headers}: {text}");
    }
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_problem_repeats_a_bounded_piece_of_what_it_complains_of() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(config(data.path())).await;
    let material = service.material().await;
    let key = format!("{}\n\u{1b}[31m", "k".repeat(8 << 20));
    let body = serde_json::json!({ (key.as_str()): 1 }).to_string();
    let evaluate = service.post(&format!("/v1/materials/{material}/evaluate"));
    let long = problem(evaluate.header("content-type", "application/json").body(body), 422, "invalid-request").await;
    let detail = long["detail"].as_str().unwrap();
    assert!(detail.len() < 5_000 && !detail.contains(char::is_control), "{}", detail.len());
    assert!(detail.contains("unknown field `kkk") && detail.contains("expected one of"), "{detail}");
    let tall =
        problem(service.request("BREW".repeat(2000).parse().unwrap(), "/v1/jobs"), 405, "method-not-allowed").await;
    assert!(tall["detail"].as_str().unwrap().len() < 200, "{tall}");
    let healthy: Value = service.get("/v1/formats").send().await.unwrap().json().await.unwrap();
    assert!(healthy.is_array());
    service.stop().await;
}
