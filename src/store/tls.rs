//! Cryptography of outgoing TLS connections.

/// Makes ring the cryptography of the TLS clients of this process. Every client needs one, also for plain HTTP; further
/// calls change nothing.
pub fn provide_tls() {
    // An error says that there is one already.
    let _ = rustls::crypto::ring::default_provider().install_default();
}
