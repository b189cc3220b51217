//! A certificate chain and its private key, read from two files and compared.

use super::certificate::Certificate;
use rustls::crypto::ring::default_provider;
use rustls::pki_types::pem::{Error as PemError, PemObject};
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use rustls::sign::CertifiedKey;
use rustls::{Error, InconsistentKeys};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Files of a TLS certificate, both in PEM.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TlsFiles {
    /// PEM file with the certificate, followed by the certificates that lead from it to one that clients know (the
    /// *chain*).
    pub chain: PathBuf,
    /// File of the private key of the certificate, without a passphrase.
    pub key: PathBuf,
}

/// Upper bound in bytes on each of the files of a certificate and its private key. Raising it admits longer chains; a
/// usual one has 4 to 8 KiB.
const LARGEST: u64 = 1 << 20;

/// Contents of the files of a TLS certificate and its private key, as read.
pub(super) struct Contents {
    chain: Vec<u8>,
    key: Vec<u8>,
}

/// TLS certificate chain and private key that the service can use for handshakes.
#[derive(Debug)]
pub(super) struct Pair {
    /// Certificate chain and private key, checked to belong together.
    pub(super) key: Arc<CertifiedKey>,
    /// Facts of each certificate of the chain, in the order of the file; at least one.
    pub(super) chain: Vec<Certificate>,
}

impl TlsFiles {
    /// Reads the files of a certificate and its private key. Blocks the thread.
    pub(super) fn read(&self) -> Result<Contents, String> {
        Ok(Contents { chain: read(&self.chain)?, key: read(&self.key)? })
    }

    /// Reads the files of a certificate and its private key, parses them and checks that they belong together. Blocks
    /// the thread.
    pub(super) fn load(&self) -> Result<Pair, String> {
        Pair::new(self, &self.read()?)
    }
}

fn read(path: &Path) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    let read = File::open(path).and_then(|file| file.take(LARGEST + 1).read_to_end(&mut bytes));
    match read {
        Err(error) => Err(format!("{}: {error}", path.display())),
        Ok(_) if bytes.len() as u64 > LARGEST => Err(format!("{}: more than {LARGEST} bytes", path.display())),
        Ok(_) => Ok(bytes),
    }
}

impl Contents {
    /// Digest of the contents of the certificate file and the key file, by which a change is found.
    pub(super) fn digest(&self) -> blake3::Hash {
        let mut hasher = blake3::Hasher::new();
        hasher.update(&(self.chain.len() as u64).to_le_bytes()).update(&self.chain).update(&self.key).finalize()
    }
}

impl Pair {
    /// Parses the contents of `files` and checks that certificate and key belong together. An error names the file.
    pub(super) fn new(files: &TlsFiles, contents: &Contents) -> Result<Self, String> {
        let at = |path: &Path, fault: &str| format!("{}: {fault}", path.display());
        let ders: Vec<CertificateDer<'static>> = CertificateDer::pem_slice_iter(&contents.chain)
            .collect::<Result<_, _>>()
            .map_err(|error| at(&files.chain, &damaged(&error)))?;
        if ders.is_empty() {
            return Err(at(&files.chain, "found no certificate, expected PEM that begins with BEGIN CERTIFICATE"));
        }
        let parse = |(place, der): (usize, &CertificateDer<'_>)| {
            Certificate::parse(der).ok_or_else(|| at(&files.chain, &format!("certificate {} is damaged", place + 1)))
        };
        let chain = ders.iter().enumerate().map(parse).collect::<Result<Vec<_>, _>>()?;
        let key = PrivateKeyDer::from_pem_slice(&contents.key).map_err(|error| {
            let is_locked = String::from_utf8_lossy(&contents.key).contains("ENCRYPTED");
            at(&files.key, &match error {
                PemError::NoItemsFound if is_locked => {
                    "found a key with a passphrase, expected one without: write it by `openssl pkey -in FILE -out NEW`"
                        .to_owned()
                }
                PemError::NoItemsFound => {
                    "found no private key, expected PEM that begins with BEGIN PRIVATE KEY".to_owned()
                }
                other => damaged(&other),
            })
        })?;
        match CertifiedKey::from_der(ders, key, &default_provider()) {
            Ok(key) => Ok(Self { key: Arc::new(key), chain }),
            Err(Error::InconsistentKeys(InconsistentKeys::KeyMismatch)) => Err(format!(
                "the private key in {} is not that of the first certificate in {}",
                files.key.display(),
                files.chain.display()
            )),
            Err(Error::General(_)) => {
                Err(at(&files.key, "this kind of private key is not known, expected one for RSA, ECDSA or Ed25519"))
            }
            Err(error) => Err(at(&files.chain, &format!("the first certificate cannot be used: {error}"))),
        }
    }

    /// Earliest time at which a certificate of the chain expires, in seconds since 1970. From then on clients refuse
    /// the chain.
    pub(super) fn ends(&self) -> i64 {
        self.chain.iter().map(|certificate| certificate.ends).min().unwrap_or(i64::MIN)
    }
}

fn damaged(error: &PemError) -> String {
    match error {
        PemError::MissingSectionEnd { .. } => "a PEM block has no END line: is the file written in part?".to_owned(),
        PemError::IllegalSectionStart { .. } => "a BEGIN line of PEM is damaged".to_owned(),
        PemError::Base64Decode(_) => "the Base64 of a PEM block is damaged".to_owned(),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::made::made;
    use super::*;

    #[test]
    fn a_pair_that_fits_is_read_and_each_fault_is_told_with_its_file() {
        let directory = tempfile::tempdir().unwrap();
        let [a, b] = ["a.example", "b.example"]
            .map(|name| made(directory.path(), name, &format!("subjectAltName=DNS:{name}"), 90));
        let pair = a.load().unwrap();
        assert_eq!(pair.chain[0].names, ["a.example"]);
        assert_eq!(pair.ends(), pair.chain[0].ends);
        let both = TlsFiles { chain: directory.path().join("both"), ..a.clone() };
        let text = [std::fs::read(&a.chain).unwrap(), std::fs::read(&b.chain).unwrap()];
        std::fs::write(&both.chain, text.concat()).unwrap();
        assert_eq!(both.load().unwrap().chain.len(), 2);
        assert_ne!(a.read().unwrap().digest(), both.read().unwrap().digest());

        let fault = |files: &TlsFiles| files.load().unwrap_err();
        let mixed = fault(&TlsFiles { key: b.key.clone(), ..a.clone() });
        assert!(
            mixed.contains("b.example.key is not that of the first certificate in") && mixed.contains("a.example.pem"),
            "{mixed}"
        );
        let missing = fault(&TlsFiles { key: directory.path().join("none"), ..a.clone() });
        assert!(missing.contains("none: No such file"), "{missing}");
        for (content, expected) in [
            ("", "found no private key"),
            ("-----BEGIN PRIVATE KEY-----\nMIGH", "no END line"),
            ("-----BEGIN PRIVATE KEY-----\nM!GH\n-----END PRIVATE KEY-----\n", "Base64"),
            ("-----BEGIN PRIVATE KEY-----\nMIGH\n-----END PRIVATE KEY-----\n", "not known"),
            ("-----BEGIN ENCRYPTED PRIVATE KEY-----\nMIGH\n-----END ENCRYPTED PRIVATE KEY-----\n", "passphrase"),
        ] {
            std::fs::write(&b.key, content).unwrap();
            let told = fault(&b);
            assert!(told.contains("b.example.key: ") && told.contains(expected), "{told}");
        }
        let large = vec![b'x'; 1 << 21];
        for (content, expected) in [
            (&b""[..], "found no certificate"),
            (&text[0][..text[0].len() / 2], "no END line"),
            (b"-----BEGIN CERTIFICATE-----\nMIGH\n-----END CERTIFICATE-----\n", "certificate 1 is damaged"),
            (&large[..], "more than 1048576 bytes"),
        ] {
            std::fs::write(&a.chain, content).unwrap();
            let told = fault(&a);
            assert!(told.contains("a.example.pem: ") && told.contains(expected), "{told}");
        }
    }
}
