//! The handshake of TLS, and the answer to a client that speaks plain HTTP instead.

use super::current::Current;
use super::wire::Wire;
use rustls::ServerConfig;
use rustls::crypto::ring::default_provider;
use std::io;
use std::sync::Arc;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio_rustls::TlsAcceptor;

/// Protocols that a client may choose (ALPN), the preferred one first.
const PROTOCOLS: [&[u8]; 2] = [b"h2", b"http/1.1"];

/// Text of the answer to a plain HTTP request on a TLS port, which a browser shows.
const PLAIN: &str = "this port speaks HTTPS: begin the address with https://\n";

/// Upper bound in bytes on the part of a plain HTTP request that is read before a TLS port refuses it, so that the
/// client gets the answer. Raising it lets larger requests end without a reset.
const READ_AWAY: u64 = 64 << 10;

/// Server side of the TLS handshakes of a listener.
#[derive(Clone)]
pub(crate) struct Handshake {
    acceptor: TlsAcceptor,
}

impl Handshake {
    /// Prepares handshakes of TLS 1.2 and 1.3, each with the certificate that is in use at its time.
    pub(crate) fn new(certificate: Arc<Current>) -> Result<Self, rustls::Error> {
        let mut config = ServerConfig::builder_with_provider(Arc::new(default_provider()))
            .with_safe_default_protocol_versions()?
            .with_no_client_auth()
            .with_cert_resolver(certificate);
        config.alpn_protocols = PROTOCOLS.map(<[u8]>::to_vec).into();
        Ok(Self { acceptor: TlsAcceptor::from(Arc::new(config)) })
    }

    /// Makes the TLS handshake with a client. Returns `None` if the client closes before its first byte, or has sent
    /// plain HTTP and was told to use HTTPS.
    pub(crate) async fn accept(&self, mut stream: TcpStream) -> io::Result<Option<Wire>> {
        let mut first = [0];
        if stream.peek(&mut first).await? == 0 {
            return Ok(None);
        }
        // TLS begins with 22 or 21, a method of HTTP with a letter.
        if first[0].is_ascii_alphabetic() {
            refuse(&mut stream).await?;
            return Ok(None);
        }
        let secure = self.acceptor.accept(stream).await?;
        Ok(Some(Wire::Secure(Box::new(secure))))
    }
}

/// Tells a client that spoke plain HTTP to use TLS, and closes the connection.
async fn refuse(stream: &mut TcpStream) -> io::Result<()> {
    let answer = format!(
        "HTTP/1.1 400 Bad Request\r\ncontent-type: text/plain; charset=utf-8\r\ncontent-length: {}\r\n\
         x-content-type-options: nosniff\r\nconnection: close\r\n\r\n{PLAIN}",
        PLAIN.len()
    );
    stream.write_all(answer.as_bytes()).await?;
    stream.shutdown().await?;
    // Closing with unread bytes would reset the connection, and the client might lose the answer.
    tokio::io::copy(&mut stream.take(READ_AWAY), &mut tokio::io::sink()).await.map(drop)
}
