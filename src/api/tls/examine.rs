//! Verdict on the files of a certificate, for `wavelume doctor`.

use super::certificate::{Certificate, date};
use super::pair::{Pair, TlsFiles};
use crate::jobs::{DAY, Finding, unix_seconds};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

/// Remaining validity of a certificate in seconds below which a warning is given, equal to that of the alert
/// `WavelumeCertificateEnds`. Raising it warns earlier.
const SOON: i64 = 14 * DAY;

const CHECK: &str = "local certificate";

/// Checks a TLS certificate and its key: that they belong together, the validity period, the names, and who may read
/// the key. `names` are the hosts that requests may address.
pub(crate) fn certificate_found(files: &TlsFiles, names: &[String]) -> Finding {
    let is_public = |path: &Path| path.metadata().is_ok_and(|metadata| metadata.permissions().mode() & 0o004 != 0);
    match files.load() {
        Ok(pair) => judge(files, &pair, names, unix_seconds().cast_signed(), is_public(&files.key)),
        Err(reason) => Finding::fault(CHECK, reason, "`wavelume serve` does not start with these certificate files"),
    }
}

fn judge(files: &TlsFiles, pair: &Pair, names: &[String], now: i64, is_public: bool) -> Finding {
    let own = &pair.chain[..1];
    let names_of = |certificates: &[Certificate]| {
        let names: Vec<&str> =
            certificates.iter().flat_map(|certificate| &certificate.names).map(String::as_str).collect();
        if names.is_empty() { "no name".to_owned() } else { names.join(", ") }
    };
    let found = format!("for {}, until {}", names_of(own), date(pair.ends()));
    if let Some(late) = pair.chain.iter().find(|certificate| certificate.begins > now) {
        let remedy =
            format!("a certificate is valid only from {} on: is the clock of this machine right?", date(late.begins));
        return Finding::fault(CHECK, found, remedy);
    }
    let which = if pair.ends() == own[0].ends { "the certificate" } else { "a certificate of the chain" };
    if pair.ends() <= now {
        return Finding::fault(CHECK, found, format!("{which} has expired: get a new one"));
    }
    if pair.ends() - now < SOON {
        let left = (pair.ends() - now) / DAY;
        return Finding::warning(CHECK, found, format!("{which} expires in {left} days: get a new one"));
    }
    let missing: Vec<&str> =
        names.iter().map(|name| name.trim()).filter(|name| !name.is_empty() && !own[0].covers(name)).collect();
    if !missing.is_empty() {
        let remedy = format!(
            "clients refuse the certificate for {}: get one with that name (subjectAltName)",
            missing.join(", ")
        );
        return Finding::warning(CHECK, found, remedy);
    }
    if own[0].names.is_empty() {
        let remedy = "clients refuse a certificate without names: get one with the host's name (subjectAltName)";
        return Finding::warning(CHECK, found, remedy);
    }
    if is_public {
        let remedy = format!("every user may read the private key: chmod o= {}", files.key.display());
        return Finding::warning(CHECK, found, remedy);
    }
    Finding::ok(CHECK, found)
}

#[cfg(test)]
mod tests {
    use super::super::made::made;
    use super::*;
    use crate::jobs::Verdict;

    fn pair(names: &[&str], chain: &[(i64, i64)]) -> Pair {
        let directory = tempfile::tempdir().unwrap();
        let files = made(directory.path(), "a", "subjectAltName=DNS:a.example", 90);
        let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
        let certificates =
            chain.iter().map(|(begins, ends)| Certificate { begins: *begins, ends: *ends, names: names.clone() });
        Pair { chain: certificates.collect(), ..files.load().unwrap() }
    }

    #[test]
    fn each_fault_of_a_certificate_is_told() {
        let files = TlsFiles { chain: "cert.pem".into(), key: "key.pem".into() };
        let now = 1_800_000_000;
        let good = (now - DAY, now + 90 * DAY);
        for (names, chain, wanted, is_public, verdict, words) in [
            (&["a.example"][..], &[good][..], &["A.example"][..], false, Verdict::Ok, ""),
            (&["*.example"], &[good], &["a.example", ""], false, Verdict::Ok, ""),
            (
                &["a.example"],
                &[good],
                &["a.example", "b.example"],
                false,
                Verdict::Warning,
                "refuse the certificate for b.example:",
            ),
            (&[], &[good], &[], false, Verdict::Warning, "with the host's name"),
            (&["a.example"], &[good], &[], true, Verdict::Warning, "chmod o= key.pem"),
            (
                &["a.example"],
                &[(now - DAY, now + 13 * DAY)],
                &[],
                false,
                Verdict::Warning,
                "the certificate expires in 13 days",
            ),
            (&["a.example"], &[(now - DAY, now - 1)], &[], false, Verdict::Fault, "the certificate has expired"),
            (&["a.example"], &[good, (0, now)], &[], false, Verdict::Fault, "a certificate of the chain has expired"),
            (&["a.example"], &[(now + 60, now + 90 * DAY)], &[], false, Verdict::Fault, "is the clock"),
        ] {
            let wanted: Vec<String> = wanted.iter().map(|name| (*name).to_owned()).collect();
            let finding = judge(&files, &pair(names, chain), &wanted, now, is_public);
            assert_eq!((finding.verdict, finding.remedy.is_empty()), (verdict, verdict == Verdict::Ok), "{finding:?}");
            assert!(finding.remedy.contains(words), "{finding:?}");
        }
        let missing = certificate_found(&TlsFiles { chain: "/nowhere/cert".into(), ..files }, &[]);
        assert!(missing.verdict == Verdict::Fault && missing.found.contains("/nowhere/cert: No such file"));
    }
}
