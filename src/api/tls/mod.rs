//! TLS of the listener: the certificate and its key, read again when their files change, and the handshake.

mod certificate;
mod current;
mod der;
mod examine;
mod handshake;
#[cfg(test)]
mod made;
mod pair;
mod wire;

pub(super) use current::Current;
pub(crate) use examine::certificate_found;
pub(super) use handshake::Handshake;
pub use pair::TlsFiles;
pub(super) use wire::Wire;
