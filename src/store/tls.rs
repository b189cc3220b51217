//! Cryptography of outgoing TLS connections.

/// Selects the library *ring* for the cryptography of all TLS clients of this process. Every HTTP client needs a
/// selection, also for plain HTTP; further calls change nothing.
pub fn provide_tls() {
    // An error says that there is one already.
    let _ = rustls::crypto::ring::default_provider().install_default();
}
