//! Certificates of the tests, made by `openssl`, and clients that trust them.

use reqwest::{Certificate, Client, ClientBuilder};
use std::path::Path;
use std::process::Command;
use wavelume::api::TlsFiles;

/// Certificate authority of a test, in a directory of its own.
pub(crate) struct Authority {
    pub(crate) directory: tempfile::TempDir,
}

/// Names of this machine.
pub(crate) const HERE: &str = "DNS:localhost,DNS:lab.example.org,IP:127.0.0.1";

impl Authority {
    pub(crate) fn new() -> Self {
        let authority = Self { directory: tempfile::tempdir().unwrap() };
        authority.make("ca", &["-subj", "/CN=authority of the tests"]);
        authority
    }

    /// Makes a certificate for these names.
    pub(crate) fn issue(&self, stem: &str, names: &str) -> TlsFiles {
        let (ca, key, names) = (self.path("ca.pem"), self.path("ca.key"), format!("subjectAltName={names}"));
        let own = ["-CA", &ca, "-CAkey", &key, "-subj", "/CN=test", "-addext", &names];
        let end = ["-addext", "basicConstraints=critical,CA:FALSE"];
        self.make(stem, &[&own[..], &end[..]].concat());
        TlsFiles { chain: self.path(&format!("{stem}.pem")).into(), key: self.path(&format!("{stem}.key")).into() }
    }

    /// Path of a file of this authority: `ca.pem` is the certificate that clients trust.
    pub(crate) fn path(&self, name: &str) -> String {
        self.directory.path().join(name).display().to_string()
    }

    fn make(&self, stem: &str, options: &[&str]) {
        let (pem, key) = (self.path(&format!("{stem}.pem")), self.path(&format!("{stem}.key")));
        let kind = ["req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes"];
        let place = ["-keyout", &key, "-out", &pem, "-days", "90"];
        let output = Command::new("openssl").args([&kind[..], &place[..], options].concat()).output();
        let output =
            output.unwrap_or_else(|error| panic!("openssl: {error}; install it (Debian: apt install openssl)"));
        assert!(output.status.success(), "{options:?}: {}", String::from_utf8_lossy(&output.stderr));
    }

    /// A client that trusts this authority alone.
    pub(crate) fn client(&self) -> ClientBuilder {
        let pem = std::fs::read(self.path("ca.pem")).unwrap();
        Client::builder().no_proxy().tls_certs_only([Certificate::from_pem(&pem).unwrap()])
    }
}

/// Returns the bytes of the first certificate in a PEM file.
pub(crate) fn der(pem: &Path) -> Vec<u8> {
    use rustls::pki_types::pem::PemObject;
    rustls::pki_types::CertificateDer::from_pem_file(pem).unwrap().to_vec()
}
