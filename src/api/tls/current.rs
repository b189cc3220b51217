//! TLS certificate in use, and its replacement when its files have changed.

use super::certificate::date;
use super::pair::{Contents, Pair, TlsFiles};
use rustls::server::{ClientHello, ResolvesServerCert};
use rustls::sign::CertifiedKey;
use std::sync::{Arc, PoisonError, RwLock};
use std::time::Duration;

/// Interval at which the files of the TLS certificate and its key are read again. Changed files are used once two
/// readings agree, so that files being written are left alone. Raising it delays a new certificate.
const INTERVAL: Duration = Duration::from_secs(2);

/// Certificate that the service shows to clients, and the files that it came from.
#[derive(Debug)]
pub(crate) struct Current {
    files: TlsFiles,
    shown: RwLock<Arc<CertifiedKey>>,
    /// Digest of the certificate file and the key file at the start of the service.
    first: blake3::Hash,
}

/// Digests of the certificate files at the latest reading, and at the latest one whose contents were tried as a
/// certificate.
struct Watch {
    latest: blake3::Hash,
    judged: blake3::Hash,
}

impl Watch {
    /// Notes the digest of the certificate files as just read. Returns true if the files are to be tried as a
    /// certificate now: the digest equals that of the reading before, and differs from that of the files tried last.
    fn is_settled(&mut self, reading: blake3::Hash) -> bool {
        let is_settled = reading == self.latest && reading != self.judged;
        self.latest = reading;
        if is_settled {
            self.judged = reading;
        }
        is_settled
    }
}

impl Current {
    /// Reads the TLS certificate and its private key for the first time. Blocks the thread.
    pub(crate) fn open(files: TlsFiles) -> Result<Self, String> {
        let contents = files.read()?;
        let pair = Pair::new(&files, &contents)?;
        announce(&pair);
        Ok(Self { shown: RwLock::new(Arc::clone(&pair.key)), first: contents.digest(), files })
    }

    /// Watches the certificate files for as long as the service runs, and uses a changed certificate once its files are
    /// complete. A faulty one is logged once, and the previous one stays in use.
    pub(crate) async fn keep_up(self: Arc<Self>) {
        let mut watch = Watch { latest: self.first, judged: self.first };
        loop {
            tokio::time::sleep(INTERVAL).await;
            let files = self.files.clone();
            // A file system over a network may not answer.
            let Ok(read) = tokio::task::spawn_blocking(move || files.read()).await else { continue };
            let reading = match &read {
                Ok(contents) => contents.digest(),
                Err(reason) => blake3::hash(reason.as_bytes()),
            };
            if watch.is_settled(reading) {
                self.judge(read);
            }
        }
    }

    fn judge(&self, read: Result<Contents, String>) {
        match read.and_then(|contents| Pair::new(&self.files, &contents)) {
            Ok(pair) => {
                announce(&pair);
                *self.shown.write().unwrap_or_else(PoisonError::into_inner) = pair.key;
            }
            Err(reason) => tracing::warn!(reason, "the new certificate is not used, the one before stays"),
        }
    }
}

/// Logs a certificate that is used from now on, and sets the metric of its expiry.
fn announce(pair: &Pair) {
    let (ends, names) = (pair.ends(), pair.chain.first().map(|first| first.names.join(", ")).unwrap_or_default());
    tracing::info!(names, ends = date(ends), "certificate in use");
    metrics::gauge!("wavelume_certificate_end_timestamp_seconds").set(ends as f64);
}

impl ResolvesServerCert for Current {
    fn resolve(&self, _: ClientHello<'_>) -> Option<Arc<CertifiedKey>> {
        Some(Arc::clone(&self.shown.read().unwrap_or_else(PoisonError::into_inner)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_is_judged_once_and_only_when_it_has_settled() {
        let [a, b, c] = ["a", "b", "c"].map(|text| blake3::hash(text.as_bytes()));
        let mut watch = Watch { latest: a, judged: a };
        for (reading, is_judged) in [
            (a, false),
            // Being written.
            (b, false),
            (c, false),
            (c, true),
            (c, false),
            // Back to what was in use: judged again, as the one between may have been used.
            (a, false),
            (a, true),
            (b, false),
            (a, false),
            (a, false),
        ] {
            assert_eq!(watch.is_settled(reading), is_judged);
        }
    }
}
