//! TLS: both versions of HTTP, clients that do not speak it, handshakes that stall, and certificates that change.

use crate::service::certificates::{Authority, HERE, der};
use crate::service::{D65, Service, config};
use reqwest::{Client, StatusCode, Version, tls};
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::SeqCst};
use std::time::{Duration, Instant};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpSocket, TcpStream};
use wavelume::api::{Limits, ServeError, Server, TlsFiles};

/// Address that takes all it can; below, one that asks for little.
const GREEDY: Ipv4Addr = Ipv4Addr::LOCALHOST;
const HONEST: Ipv4Addr = Ipv4Addr::new(127, 0, 0, 2);

/// Longest wait for a changed certificate, on a busy machine.
const PATIENCE: Duration = Duration::from_secs(30);

async fn secure(data: &Path, authority: &Authority, files: TlsFiles, limits: impl FnOnce(&mut Limits)) -> Service {
    let mut config = config(data);
    config.tls = Some(files);
    config.names = vec!["lab.example.org".to_owned()];
    limits(&mut config.work.limits);
    Service::start_for(config, authority.client()).await
}

fn address(service: &Service) -> SocketAddr {
    service.base.trim_start_matches("https://").parse().unwrap()
}

async fn connect(service: &Service, from: Ipv4Addr) -> TcpStream {
    let socket = TcpSocket::new_v4().unwrap();
    socket.bind((from, 0).into()).unwrap();
    socket.connect(address(service)).await.unwrap()
}

/// Reads until the service closes.
async fn rest(mut stream: TcpStream) -> String {
    let mut bytes = Vec::new();
    let _ = stream.read_to_end(&mut bytes).await;
    String::from_utf8_lossy(&bytes).into_owned()
}

#[tokio::test(flavor = "multi_thread")]
async fn http_1_and_2_are_spoken_over_tls_1_2_and_1_3() {
    let (data, authority) = (tempfile::tempdir().unwrap(), Authority::new());
    let service = secure(data.path(), &authority, authority.issue("a", HERE), |_| {}).await;
    assert!(service.base.starts_with("https://127.0.0.1:"), "{}", service.base);
    let material = service.material().await;
    for version in [tls::Version::TLS_1_2, tls::Version::TLS_1_3] {
        let client = || {
            let named = authority.client().resolve("lab.example.org", address(&service));
            named.tls_version_min(version).tls_version_max(version)
        };
        for (client, http) in [(client(), Version::HTTP_2), (client().http1_only(), Version::HTTP_11)] {
            let client = client.build().unwrap();
            let content = client.get(format!("{}/v1/materials/{material}/content", service.base)).send().await.unwrap();
            assert_eq!((content.version(), content.status()), (http, StatusCode::OK));
            assert!(!content.headers().contains_key("strict-transport-security"), "a loopback address");
            assert!(content.bytes().await.unwrap().starts_with(b"\x89WLM"));
            let upload = client.post(format!("{}/v1/measurements", service.base)).body(D65).send().await.unwrap();
            assert!(upload.version() == http && upload.status().is_success(), "{upload:?}");
            let port = address(&service).port();
            for path in ["healthz", "v1/nothing"] {
                let named = client.get(format!("https://lab.example.org:{port}/{path}")).send().await.unwrap();
                assert_eq!(named.headers()["strict-transport-security"], "max-age=31536000");
            }
        }
    }
    let stranger = Client::builder().no_proxy().build().unwrap();
    let refused = stranger.get(format!("{}/healthz", service.base)).send().await.unwrap_err();
    assert!(format!("{refused:?}").contains("UnknownIssuer"), "{refused:?}");
    let metrics = service.get("/metrics").send().await.unwrap().text().await.unwrap();
    for name in ["wavelume_certificate_end_timestamp_seconds 1", "wavelume_handshakes_failed_total "] {
        assert!(metrics.contains(name), "{metrics}");
    }
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_client_without_tls_is_told_or_cut() {
    let (data, authority) = (tempfile::tempdir().unwrap(), Authority::new());
    let service = secure(data.path(), &authority, authority.issue("a", HERE), |_| {}).await;
    for words in [
        &b"GET / HTTP/1.1\r\nhost: localhost\r\n\r\n"[..],
        b"POST /v1/measurements HTTP/1.1\r\nhost: localhost\r\ncontent-length: 5\r\n\r\nhello",
        b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n",
    ] {
        let mut stream = connect(&service, GREEDY).await;
        stream.write_all(words).await.unwrap();
        // A client reads to the end, or to the stated length and then closes.
        stream.shutdown().await.unwrap();
        let answer = rest(stream).await;
        assert!(answer.starts_with("HTTP/1.1 400 Bad Request\r\ncontent-type: text/plain"), "{answer}");
        assert!(answer.ends_with("\r\n\r\nthis port speaks HTTPS: begin the address with https://\n"), "{answer}");
    }
    let plain = service.base.replace("https", "http");
    let told = Client::builder().no_proxy().build().unwrap().get(plain).send().await.unwrap();
    assert_eq!(told.status(), StatusCode::BAD_REQUEST);
    assert!(told.text().await.unwrap().contains("https://"));
    for garbage in [&b"\0\0\0\0\0\0\0\0"[..], b"\x16\x03\x01\xff\xff\xff\xff", &[0xff; 600]] {
        let mut stream = connect(&service, GREEDY).await;
        let _ = stream.write_all(garbage).await;
        let _ = stream.shutdown().await;
        assert!(!rest(stream).await.contains("HTTP"));
    }
    assert_eq!(service.get("/healthz").send().await.unwrap().status(), StatusCode::OK);
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_handshake_that_stalls_is_cut_and_keeps_nobody_out() {
    let (data, authority) = (tempfile::tempdir().unwrap(), Authority::new());
    let service = secure(data.path(), &authority, authority.issue("a", HERE), |limits| {
        (limits.connections, limits.connections_each, limits.health_connections_each) = (12, 6, 2);
        limits.first_bytes = Duration::from_secs(2);
    })
    .await;
    // The head of a hello of 512 bytes, of which few come.
    let hello = b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03";
    let start = Instant::now();
    let mut stalled = Vec::new();
    for i in 0..20 {
        let mut stream = connect(&service, GREEDY).await;
        let _ = stream.write_all(&hello[..if i % 2 == 0 { 1 } else { hello.len() }]).await;
        stalled.push(stream);
    }
    let honest = authority.client().local_address(IpAddr::from(HONEST)).build().unwrap();
    let url = format!("{}/v1/measurements", service.base);
    assert_eq!(honest.post(&url).body(D65).send().await.unwrap().status(), StatusCode::CREATED);
    for stream in stalled {
        assert_eq!(rest(stream).await, "");
    }
    // A byte now and then does not count as progress.
    let mut slow = connect(&service, GREEDY).await;
    let begun = Instant::now();
    let mut bytes = hello.iter().chain(std::iter::repeat(&0));
    while slow.write_all(&[*bytes.next().unwrap()]).await.is_ok() {
        tokio::time::sleep(Duration::from_millis(100)).await;
        assert!(begun.elapsed() < PATIENCE);
    }
    assert!(start.elapsed() < PATIENCE, "{:?}", start.elapsed());
    // The places are free again.
    assert_eq!(service.get("/v1/formats").send().await.unwrap().status(), StatusCode::OK);
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn idle_connections_of_one_address_keep_nobody_out() {
    let (data, authority) = (tempfile::tempdir().unwrap(), Authority::new());
    let service = secure(data.path(), &authority, authority.issue("a", HERE), |_| {}).await;
    let mut idle = Vec::new();
    for _ in 0..200 {
        idle.push(connect(&service, GREEDY).await);
    }
    let honest = authority.client().local_address(IpAddr::from(HONEST)).build().unwrap();
    let start = Instant::now();
    let answer = honest.post(format!("{}/v1/measurements", service.base)).body(D65).send().await.unwrap();
    assert_eq!(answer.status(), StatusCode::CREATED);
    for path in ["healthz", "readyz", "v1/measurements"] {
        let answer = honest.get(format!("{}/{path}", service.base)).send().await.unwrap();
        assert_eq!(answer.status(), StatusCode::OK, "{path}");
    }
    assert!(start.elapsed() < Duration::from_secs(9), "before any of them was closed: {:?}", start.elapsed());
    drop(idle);
    service.stop().await;
}

/// Certificate that a new connection gets.
async fn shown(authority: &Authority, service: &Service) -> Vec<u8> {
    let client = authority.client().tls_info(true).build().unwrap();
    let answer = client.get(format!("{}/healthz", service.base)).send().await.unwrap();
    answer.extensions().get::<tls::TlsInfo>().unwrap().peer_certificate().unwrap().to_vec()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_changed_certificate_is_used_without_a_failed_request_and_a_faulty_one_is_not() {
    let (data, authority) = (tempfile::tempdir().unwrap(), Authority::new());
    let files = authority.issue("used", HERE);
    let new = authority.issue("new", HERE);
    let (old, next) = (der(&files.chain), der(&new.chain));
    let service = secure(data.path(), &authority, files.clone(), |_| {}).await;
    // Requests one after another: on connections of their own, and on one that stays.
    let (ends, answered) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicUsize::new(0)));
    let mut load = Vec::new();
    for stays in [false, false, true] {
        let kept = stays.then(|| authority.client().build().unwrap());
        let root = reqwest::Certificate::from_pem(&std::fs::read(authority.path("ca.pem")).unwrap()).unwrap();
        let (ends, answered, url) = (Arc::clone(&ends), Arc::clone(&answered), format!("{}/v1/formats", service.base));
        load.push(tokio::spawn(async move {
            while !ends.load(SeqCst) {
                let client = kept
                    .clone()
                    .unwrap_or_else(|| Client::builder().no_proxy().tls_certs_only([root.clone()]).build().unwrap());
                assert_eq!(client.get(&url).send().await.unwrap().status(), StatusCode::OK);
                answered.fetch_add(1, SeqCst);
                tokio::time::sleep(Duration::from_millis(30)).await;
            }
        }));
    }
    assert_eq!(shown(&authority, &service).await, old);
    // A key without its certificate, a part of a certificate, and none at all: each for longer than two looks.
    let (pem, key) = (std::fs::read(&new.chain).unwrap(), std::fs::read(&new.key).unwrap());
    std::fs::write(&files.key, &key).unwrap();
    for faulty in [None, Some(&pem[..pem.len() / 2]), Some(&b""[..])] {
        if let Some(faulty) = faulty {
            std::fs::write(&files.chain, faulty).unwrap();
        }
        tokio::time::sleep(Duration::from_secs(5)).await;
        assert_eq!(shown(&authority, &service).await, old, "{faulty:?}");
    }
    std::fs::remove_file(&files.chain).unwrap();
    tokio::time::sleep(Duration::from_secs(5)).await;
    assert_eq!(shown(&authority, &service).await, old, "without a file");
    std::fs::write(&files.chain, &pem).unwrap();
    let written = Instant::now();
    while shown(&authority, &service).await != next {
        assert!(written.elapsed() < PATIENCE);
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    ends.store(true, SeqCst);
    for one in load {
        one.await.unwrap();
    }
    assert!(answered.load(SeqCst) > 100, "{answered:?}");
    service.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_service_does_not_start_with_a_faulty_certificate() {
    let (data, authority) = (tempfile::tempdir().unwrap(), Authority::new());
    let [a, b] = ["a", "b"].map(|stem| authority.issue(stem, HERE));
    for (chain, key, words) in [
        (&a.chain, &b.key, "is not that of the first certificate in"),
        (&a.chain, &a.chain, "a.pem: found no private key"),
        (&a.key, &a.key, "a.key: found no certificate"),
    ] {
        let mut wrong = config(data.path());
        wrong.tls = Some(TlsFiles { chain: chain.clone(), key: key.clone() });
        let error = Server::bind(wrong).await.unwrap_err();
        assert!(matches!(error, ServeError::Certificate(_)), "{error:?}");
        let told = error.to_string();
        assert!(told.starts_with("the certificate cannot be used: ") && told.contains(words), "{told}");
    }
}
