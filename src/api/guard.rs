//! Mode of access of a service, and the state by which requests are admitted or refused.

use super::decisions::Decisions;
use super::guesses::Guesses;
use crate::jobs::Limits;
use std::fmt;
use std::sync::Arc;

/// Rule by which a service decides who may use it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AuthMode {
    /// Everybody who reaches the service may do everything; meant for a loopback address.
    #[default]
    Off,
    /// Requests need a key.
    Keys,
    /// Requests need a key, but for reading public materials.
    KeysAndAnonymousRead,
}

impl fmt::Display for AuthMode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Off => "off",
            Self::Keys => "keys",
            Self::KeysAndAnonymousRead => "keys+anonymous-read",
        })
    }
}

/// State by which requests are admitted or refused.
#[derive(Debug)]
pub(crate) struct Guard {
    /// Rule by which the service decides who may use it.
    pub(crate) mode: AuthMode,
    /// True if a service without keys may be reached from other machines and through proxies.
    pub(crate) is_insecure: bool,
    /// Remembered decisions about keys.
    pub(crate) decisions: Decisions,
    /// Wrong keys of each address.
    pub(crate) guesses: Arc<Guesses>,
}

impl Guard {
    pub(crate) fn new(mode: AuthMode, is_insecure: bool, limits: &Limits) -> Arc<Self> {
        let guesses = Guesses::new(limits.wrong_keys);
        Arc::new(Self { mode, is_insecure, decisions: Decisions::default(), guesses })
    }
}
