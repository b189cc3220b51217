//! Certificates of the tests, made by another program.

use super::pair::TlsFiles;
use std::path::Path;
use std::process::Command;

/// Runs `openssl` and returns what it prints.
pub(super) fn openssl(args: &[&str]) -> String {
    let output = Command::new("openssl").args(args).output();
    let output = output.unwrap_or_else(|error| panic!("openssl: {error}; install it (Debian: apt install openssl)"));
    assert!(output.status.success(), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// Makes a certificate that expires after the given number of days, and its private key. `names` is an extension such
/// as `subjectAltName=DNS:lab.example.org`.
pub(super) fn made(directory: &Path, stem: &str, names: &str, days: u32) -> TlsFiles {
    let [chain, key] = ["pem", "key"].map(|ending| directory.join(format!("{stem}.{ending}")));
    let (pem, secret, days) = (chain.to_str().unwrap(), key.to_str().unwrap(), days.to_string());
    let kind = ["req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes"];
    let place = ["-keyout", secret, "-out", pem, "-days", &days, "-subj", "/CN=test", "-addext", names];
    openssl(&[&kind[..], &place[..]].concat());
    TlsFiles { chain, key }
}
