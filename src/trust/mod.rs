//! Trust: tenants, keys, the scopes that they give, and the tokens and links that are made from them. Knows no clock,
//! database or network: whoever checks a credential passes the time and the facts of its key.

mod grant;
mod key;
mod link;
mod redact;
mod scope;
mod set;
mod signing;
mod tenant;
mod token;

pub(crate) use grant::{Grant, KeyFacts, LONGEST, MaterialId, Method, Methods, Reach, Refused, SKEW};
pub(crate) use key::{Key, KeyError, KeyId, NotAKeyId, SecretHash};
pub(crate) use link::Link;
pub(crate) use redact::{holds_secret, without_secrets};
pub(crate) use scope::{Scope, Scopes};
pub(crate) use signing::{NoSigner, Signer, Verifier};
pub(crate) use tenant::{NotATenant, Tenant};
pub(crate) use token::Token;
