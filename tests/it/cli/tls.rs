//! A service with a certificate as its operator meets it: start, health, clients that trust it, log, doctor, settings.

use super::settings::with;
use super::{at, done, refused};
use crate::service::certificates::{Authority, HERE};
use serde_json::Value;
use std::fs::{self, File};
use std::io::{BufRead, BufReader};
use std::os::unix::fs::PermissionsExt;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// A service that is killed with the test.
struct Secured {
    child: Child,
    address: String,
}

impl Secured {
    fn start(args: &[&str], log: &str) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_wavelume"))
            .args(["serve", "--listen", "127.0.0.1:0"])
            .args(args)
            .env_remove("RUST_LOG")
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(File::create(log).unwrap())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.as_mut().unwrap()).read_line(&mut line).unwrap();
        let address = line.trim().strip_prefix("listening on https://").unwrap_or_else(|| panic!("{line}")).to_owned();
        Self { child, address }
    }
}

impl Drop for Secured {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[test]
fn a_service_with_a_certificate_is_asked_by_those_who_trust_it() {
    let (dir, authority) = (tempfile::tempdir().unwrap(), Authority::new());
    let files = authority.issue("a", HERE);
    let (cert, key, log) = (authority.path("a.pem"), authority.path("a.key"), at(&dir, "log"));
    let (data, ca) = (at(&dir, "data"), authority.path("ca.pem"));
    let service = Secured::start(&["--data", &data, "--tls-cert", &cert, "--tls-key", &key], &log);
    let (url, port) = (format!("https://{}", service.address), service.address.rsplit(':').next().unwrap());
    let named = format!("https://localhost:{port}");
    done(&["health", &url, "--ca-cert", &ca]);
    done(&["health", &named, "--ca-cert", &ca]);
    // On the machine itself, whatever the name of the certificate is.
    done(&["health", "--listen", &service.address, "--tls-cert", &cert]);
    assert_eq!(done(&["jobs", "list", "--url", &named, "--ca-cert", &ca]), "no jobs\n");
    let stranger = refused(1, &["jobs", "list", "--url", &named]);
    assert!(stranger.contains("UnknownIssuer: name the authority") && stranger.contains("--ca-cert"), "{stranger}");
    assert!(refused(1, &["health", &format!("http://{}", service.address)]).contains("400"));
    authority.issue("b", HERE);
    refused(1, &["health", "--listen", &service.address, "--tls-cert", &authority.path("b.pem")]);
    let wrong = refused(1, &["jobs", "list", "--url", &named, "--ca-cert", &key]);
    assert!(wrong.contains("a.key: found no certificate"), "{wrong}");

    // A pair that does not fit is told once in the log, and then the one that does.
    fs::copy(authority.path("b.pem"), &files.chain).unwrap();
    let logged = |words: &str| {
        let start = Instant::now();
        while !fs::read_to_string(&log).unwrap().contains(words) {
            assert!(start.elapsed() < Duration::from_secs(30), "{words}: {}", fs::read_to_string(&log).unwrap());
            std::thread::sleep(Duration::from_millis(50));
        }
    };
    logged("the new certificate is not used, the one before stays");
    logged("is not that of the first certificate in");
    fs::copy(authority.path("b.key"), &files.key).unwrap();
    while fs::read_to_string(&log).unwrap().matches("certificate in use").count() < 2 {
        std::thread::sleep(Duration::from_millis(50));
    }
    assert_eq!(fs::read_to_string(&log).unwrap().matches("the new certificate is not used").count(), 1);
    done(&["health", "--listen", &service.address, "--tls-cert", &authority.path("b.pem")]);
    let log = fs::read_to_string(&log).unwrap();
    assert!(log.contains("lab.example.org") && !log.contains("PRIVATE"), "{log}");
}

#[test]
fn certificate_and_key_are_settings_that_come_together() {
    let (dir, authority) = (tempfile::tempdir().unwrap(), Authority::new());
    authority.issue("a", HERE);
    let (cert, key, data) = (authority.path("a.pem"), authority.path("a.key"), at(&dir, "data"));
    let serve = ["serve", "--listen", "127.0.0.1:0", "--data", &data];
    let alone = refused(2, &[&serve[..], &["--tls-cert", &cert]].concat());
    assert!(alone.contains("--tls-cert needs --tls-key"), "{alone}");
    let alone = refused(2, &[&serve[..], &["--tls-key", &key]].concat());
    assert!(alone.contains("--tls-key needs --tls-cert"), "{alone}");
    let missing = refused(1, &[&serve[..], &["--tls-cert", &cert, "--tls-key", "/nowhere/key"]].concat());
    assert!(missing.contains("the certificate cannot be used: /nowhere/key: No such file"), "{missing}");
    assert!(!dir.path().join("data").exists(), "nothing is made before");

    // From the file, the environment and a flag.
    let file = at(&dir, "wavelume.toml");
    fs::write(&file, format!("ca_cert = \"ca\"\n[server]\ntls_cert = {cert:?}\ntls_key = \"file\"\n")).unwrap();
    let variables = [("WAVELUME_CONFIG", file.as_str()), ("WAVELUME_TLS_KEY", &key)];
    let shown = String::from_utf8(with(&variables, &["config"]).stdout).unwrap();
    for line in [
        format!("tls_cert = {cert:?} # {file}:3"),
        format!("tls_key = {key:?} # environment WAVELUME_TLS_KEY"),
        format!("ca_cert = \"ca\" # {file}:1"),
    ] {
        let is_there = shown.lines().any(|shown| shown.split_whitespace().eq(line.split_whitespace()));
        assert!(is_there, "{line} is missing in\n{shown}");
    }
    let doctor = |variables: &[(&str, &str)], args: &[&str]| {
        let output = with(variables, &[&["doctor", "--json", "--data", &data], args].concat());
        let report: Value = serde_json::from_slice(&output.stdout).unwrap();
        let findings = report["findings"].as_array().unwrap().clone();
        findings.into_iter().find(|finding| finding["check"] == "local certificate")
    };
    assert_eq!(doctor(&[], &[]), None);
    let healthy = doctor(&variables, &["--name", "lab.example.org"]).unwrap();
    assert_eq!(healthy["verdict"], "ok", "{healthy}");
    let found = healthy["found"].as_str().unwrap();
    assert!(found.starts_with("for localhost, lab.example.org, 127.0.0.1, until 20"), "{found}");
    let other = doctor(&variables, &["--name", "other.example.org"]).unwrap();
    assert!(
        other["verdict"] == "warning" && other["remedy"].as_str().unwrap().contains("other.example.org"),
        "{other}"
    );
    fs::set_permissions(&key, fs::Permissions::from_mode(0o644)).unwrap();
    let open = doctor(&variables, &[]).unwrap();
    assert!(open["verdict"] == "warning" && open["remedy"].as_str().unwrap().contains("chmod o= "), "{open}");
    let wrong = doctor(&[], &["--tls-cert", &cert, "--tls-key", &authority.path("ca.key")]).unwrap();
    assert!(wrong["verdict"] == "fault" && wrong["found"].as_str().unwrap().contains("is not that of"), "{wrong}");
}
