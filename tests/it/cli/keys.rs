//! Access keys on the command line: made, listed and revoked beside a running service, and never in its log.

use super::service::Service;
use super::{at, done, json, refused, wavelume};
use serde_json::Value;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Command, Stdio};

const ALL: &str = "read,write,jobs,tenant,instance";

/// Sends a request, and returns the whole answer.
fn talk(service: &Service, words: &str, headers: &[String], body: &str) -> String {
    let mut stream = TcpStream::connect(&service.address).unwrap();
    let headers: String = headers.iter().map(|line| [line.as_str(), "\r\n"].concat()).collect();
    let length = body.len();
    let request = format!(
        "{words} HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\ncontent-type: application/json\r\ncontent-length: \
         {length}\r\n{headers}\r\n{body}"
    );
    stream.write_all(request.as_bytes()).unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    answer
}

fn bearer(key: &str) -> String {
    format!("authorization: Bearer {key}")
}

#[test]
fn keys_are_made_before_the_first_start_and_revoked_while_the_service_runs() {
    let dir = tempfile::tempdir().unwrap();
    let data = at(&dir, "data");
    let unguarded = refused(2, &["serve", "--data", &data, "--listen", "0.0.0.0:0"]);
    let create = format!("wavelume keys create --data {data} --name admin --scopes {ALL}");
    let serve = format!("wavelume serve --data {data} --listen 0.0.0.0:0 --auth keys");
    for part in [create.as_str(), serve.as_str(), "--tls-cert", "--insecure"] {
        assert!(unguarded.contains(part), "{unguarded}");
    }
    // As the refusal says.
    let words: Vec<&str> = create.split(' ').skip(1).collect();
    let admin = done(&words);
    let service = Service::start_with("", &data, &["--auth", "keys"], Stdio::null());
    let list = |key: &str| talk(&service, "GET /v1/materials", &[bearer(key)], "");
    assert!(list(admin.trim()).starts_with("HTTP/1.1 200"));

    let made =
        json(&["keys", "create", "--data", &data, "--scopes", "read", "--expires", "2d", "--name", "ü", "--json"]);
    let (key, id) = (made["key"].as_str().unwrap(), made["id"].as_str().unwrap());
    assert_eq!(made["expires_ms"].as_i64().unwrap() - made["created_ms"].as_i64().unwrap(), 2 * 86_400_000);
    assert!(list(key).starts_with("HTTP/1.1 200"));
    let listed = json(&["keys", "list", "--data", &data, "--json"]);
    assert_eq!((listed.as_array().unwrap().len(), &listed[0]["name"]), (2, &Value::from("ü")));
    assert!(!listed.to_string().contains(&key[15..]) && done(&["keys", "list", "--data", &data]).contains(id));

    let absent = refused(1, &["keys", "revoke", "--data", &data, "0000000000"]);
    assert!(absent.contains("there is no key 0000000000"), "{absent}");
    assert_eq!(done(&["keys", "revoke", "--data", &data, id]), format!("{id}  revoked\n"));
    let start = std::time::Instant::now();
    while list(key).starts_with("HTTP/1.1 200") {
        assert!(start.elapsed().as_secs() < 5, "a revoked key is still accepted");
        std::thread::sleep(std::time::Duration::from_millis(100));
    }
    let jobs = |key: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_wavelume"));
        command.args(["jobs", "list", "--url", &format!("http://{}", service.address)]).env("WAVELUME_KEY", key);
        command.output().unwrap()
    };
    assert_eq!(String::from_utf8(jobs(admin.trim()).stdout).unwrap(), "no jobs\n");
    assert!(String::from_utf8(jobs(key).stderr).unwrap().contains("401"));
}

#[test]
fn keys_that_travel_without_tls_to_other_machines_are_warned_of() {
    let dir = tempfile::tempdir().unwrap();
    let data = at(&dir, "data");
    let warned = |address: &str| {
        let mut child = Command::new(env!("CARGO_BIN_EXE_wavelume"))
            .args(["serve", "--data", &data, "--auth", "keys", "--listen", address])
            .env_remove("RUST_LOG")
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut log = BufReader::new(child.stderr.take().unwrap()).lines().map(Result::unwrap);
        assert!(log.any(|line| line.contains("serving")));
        assert!(Command::new("kill").arg(child.id().to_string()).status().unwrap().success());
        let warned = log.any(|line| line.contains("keys travel readable"));
        child.wait().unwrap();
        warned
    };
    assert!(warned("0.0.0.0:0") && !warned("127.0.0.1:0"));
}

#[test]
fn wrong_words_about_keys_are_told() {
    let dir = tempfile::tempdir().unwrap();
    let data = at(&dir, "data");
    for (args, part) in [
        (
            &["create", "--scopes", "root"][..],
            "expected scopes with commas between: read, write, jobs, tenant, instance",
        ),
        (&["create", "--expires", "400d"], "--expires: found 400d, expected at most 365d (--key-age)"),
        (&["create", "--expires", "soon"], "expected a time such as 12h or 90d"),
        (&["create", "--tenant", "Lab"], "expected the id of a tenant"),
        (&["create", "--tenant", "nobody"], "--tenant: there is no tenant nobody"),
        (&["revoke", "wlm_x"], "is no id of a key"),
    ] {
        let line = [&["keys", args[0], "--data", &data], &args[1..]].concat();
        let wrong = refused(2, &line);
        assert!(wrong.contains(part), "{wrong}");
    }
    refused(1, &["keys", "list", "--data", &at(&dir, "nowhere")]);
    let secret = done(&["keys", "generate"]).trim().replace("wlm_", "wlm_x");
    let output = Command::new(env!("CARGO_BIN_EXE_wavelume"))
        .args(["serve", "--data", &data, "--auth", "keys", "--listen", "127.0.0.1:0"])
        .env("WAVELUME_BOOTSTRAP_KEY", &secret)
        .output()
        .unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.code() == Some(2) && stderr.contains("WAVELUME_BOOTSTRAP_KEY: found"), "{stderr}");
    assert!(!stderr.contains(&secret[20..]), "{stderr}");
    assert_eq!(wavelume(&["demo", "--auth", "keys", "--data", &data]).status.code(), Some(2));
}

#[test]
fn no_key_is_in_a_log_or_in_an_answer_but_the_one_that_makes_it() {
    let dir = tempfile::tempdir().unwrap();
    let (data, log) = (at(&dir, "data"), at(&dir, "log"));
    let first = done(&["keys", "generate"]).trim().to_owned();
    let limits = format!("export RUST_LOG=debug WAVELUME_BOOTSTRAP_KEY={first}");
    let file = std::fs::File::create(&log).unwrap();
    let service = Service::start_with(&limits, &data, &["--auth", "keys"], file.into());
    let made = talk(&service, "POST /v1/keys", &[bearer(&first)], r#"{"scopes":["read"],"name":"r"}"#);
    assert!(made.starts_with("HTTP/1.1 201"), "{made}");
    let made: Value = serde_json::from_str(made.split("\r\n\r\n").nth(1).unwrap()).unwrap();
    let reader = made["key"].as_str().unwrap().to_owned();
    let unknown = done(&["keys", "generate"]).trim().to_owned();
    let mistyped = format!("{}x", &unknown[..64]);
    let secrets = [&first, &reader, &unknown, &mistyped].map(|key| key[15..50].to_owned());

    let mut answers = Vec::new();
    for key in [&first, &reader, &unknown, &mistyped] {
        let everywhere = [bearer(key), format!("request-id: {key}"), format!("referer: http://x/{key}")];
        for words in [
            "GET /v1/materials".to_owned(),
            "GET /v1/keys".to_owned(),
            "GET /v1/audit?unowned=true".to_owned(),
            format!("GET /v1/materials/{key}"),
            format!("GET /v1/jobs/{key}"),
            format!("GET /v1/uploads/{key}"),
            format!("DELETE /v1/keys/{key}"),
            format!("GET /{key}"),
            format!("GET /v1/materials?cursor={key}&q={key}&{key}=1"),
            format!("{key} /v1/materials"),
            "GET /metrics".to_owned(),
        ] {
            answers.push(talk(&service, &words, &everywhere, ""));
        }
        answers.push(talk(&service, "POST /v1/keys", &everywhere, &format!(r#"{{"scopes":["{key}"],"{key}":1}}"#)));
        answers.push(talk(&service, "POST /v1/jobs", &everywhere, &format!(r#"{{"kind":"{key}"}}"#)));
    }
    drop(service);
    let log = std::fs::read_to_string(&log).unwrap();
    assert!(log.contains("request answered") && log.contains("bootstrap key was stored"), "{log}");
    for secret in &secrets {
        assert!(!log.contains(secret), "{}", log.lines().find(|line| line.contains(secret)).unwrap());
        for answer in &answers {
            assert!(!answer.contains(secret), "{answer}");
        }
    }
    let wal = std::fs::read(format!("{data}/catalog.sqlite-wal")).unwrap_or_default();
    let stored = [std::fs::read(format!("{data}/catalog.sqlite")).unwrap(), wal].concat();
    for secret in &secrets {
        assert!(!stored.windows(secret.len()).any(|bytes| bytes == secret.as_bytes()), "stored as it is");
    }
}
