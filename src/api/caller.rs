//! Caller of a request: the tenant for which it acts, its scopes, and how it has shown who it is.

use super::places::Peer;
use super::problem::Problem;
use crate::catalog::Act;
use crate::jobs::Client;
use crate::trust::{KeyId, Reach, Scope, Scopes, Tenant};
use axum::extract::FromRequestParts;
use axum::http::{Extensions, request::Parts};
use std::convert::Infallible;
use std::fmt;
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Caller of a request. The step [`authorise`](super::authorise) puts it into every request with a route.
#[derive(Clone, Debug)]
pub(crate) struct Caller {
    /// Tenant whose stored data (materials, measurements, jobs, keys) the request sees and changes.
    pub(crate) tenant: Tenant,
    /// Scopes of the caller: what it may do.
    pub(crate) scopes: Scopes,
    /// Way in which the caller has identified itself: by key, token or link, or not at all.
    pub(crate) actor: Actor,
    /// Materials to which the token or link of the caller is limited; the path of the request was checked against them.
    pub(crate) reach: Reach,
    /// Time at which the rights of the caller end, in Unix seconds; `None` if they do not end.
    until: Option<u64>,
    peer: Peer,
    request: Option<RequestId>,
}

/// Way in which the caller of a request has identified itself: by key, token or link, or not at all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Actor {
    /// The service runs without keys, and everybody who reaches it may do everything.
    Off,
    /// The caller has sent no key, token or link.
    Anonymous,
    /// The caller has sent the access key with this id.
    Key(KeyId),
    /// The caller has sent a token that was made from the key with this id.
    Token(KeyId),
    /// The caller follows a signed link that was made from the key with this id.
    Link(KeyId),
}

/// Key on which the rights of a caller depend, and the end of the token or link that was made from it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Watched {
    /// Id of the key that the caller has sent, or from which its token or link was made.
    pub(crate) key: KeyId,
    /// Time at which the token or link of the caller ends; `None` for a key, whose end the database tells.
    pub(crate) end: Option<Instant>,
}

/// Largest difference allowed between the clock of this machine and that of the machine that made a token or a link.
const SKEW: Duration = Duration::from_secs(crate::trust::SKEW);

/// Id of an HTTP request, stored in the extensions of the request.
#[derive(Clone, Debug)]
pub(crate) struct RequestId(pub(crate) Arc<str>);

impl Caller {
    /// Returns the caller stored in the extensions of a request. Fails if there is none, because the request has not
    /// passed the step that identifies callers.
    pub(crate) fn of_extensions(extensions: &Extensions) -> Result<&Self, Problem> {
        extensions.get().ok_or_else(|| Problem::internal(&"a route without a caller"))
    }

    /// Builds a caller with all scopes that acts for the given tenant, as in a service with keys.
    #[cfg(test)]
    pub(crate) fn of_tenant(tenant: Tenant) -> Self {
        Self::new(tenant, Scopes::all(), Actor::Off, &Extensions::new())
    }

    /// Builds a caller from its tenant, scopes and actor; the extensions of the request give its address and the
    /// request id.
    pub(crate) fn new(tenant: Tenant, scopes: Scopes, actor: Actor, extensions: &Extensions) -> Self {
        let request = extensions.get::<RequestId>().cloned();
        let (reach, until) = (Reach::All, None);
        Self { tenant, scopes, actor, reach, until, peer: Peer::of_extensions(extensions), request }
    }

    /// Limits the caller to the materials `reach`, and its rights to the time before `until` in Unix seconds (`None`
    /// for no end).
    pub(crate) fn limited(self, reach: Reach, until: Option<u64>) -> Self {
        Self { reach, until, ..self }
    }

    /// Returns the time from now until the rights of the caller end; `None` if they do not end.
    pub(crate) fn left(&self) -> Option<Duration> {
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        self.until.map(|until| Duration::from_secs(until).saturating_sub(now))
    }

    /// Returns what the rights of the caller depend on while its request is under way; `None` without a key.
    pub(crate) fn watched(&self) -> Option<Watched> {
        let key = self.actor.key()?;
        let end = match self.actor {
            // The machine that made it may have another clock, as when the request came.
            Actor::Token(_) | Actor::Link(_) => self.left().map(|left| Instant::now() + left + SKEW),
            // The database has the better clock.
            Actor::Key(_) | Actor::Off | Actor::Anonymous => None,
        };
        Some(Watched { key, end })
    }

    /// Returns true if the caller administers the whole service.
    pub(crate) fn is_operator(&self) -> bool {
        self.scopes.has(Scope::Instance)
    }

    /// Returns the client to whom limits apply: the address of the caller, and its tenant in a service with keys.
    pub(crate) fn client(&self) -> Client {
        let tenant = (self.actor != Actor::Off).then(|| self.tenant.clone());
        Client { tenant, ..self.peer.into() }
    }

    /// Builds the audit-trail record of an act of this caller. `subject` is the id of the object that the act
    /// concerned.
    pub(crate) fn act(&self, action: &'static str, subject: impl fmt::Display) -> Act {
        Act {
            tenant: Some(self.tenant.clone()),
            actor: self.actor.to_string(),
            action,
            subject: Some(subject.to_string()),
            detail: None,
            address: Some(self.peer.to_string()),
            request: self.request.as_ref().map(|id| id.0.to_string()),
        }
    }
}

impl Actor {
    /// Returns the id of the key that the caller has sent, or from which its token or link was made.
    pub(crate) fn key(self) -> Option<KeyId> {
        match self {
            Self::Off | Self::Anonymous => None,
            Self::Key(id) | Self::Token(id) | Self::Link(id) => Some(id),
        }
    }
}

impl fmt::Display for Actor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Off => f.write_str("everybody"),
            Self::Anonymous => f.write_str("anonymous"),
            Self::Key(id) => write!(f, "key {id}"),
            Self::Token(id) => write!(f, "token of key {id}"),
            Self::Link(id) => write!(f, "link of key {id}"),
        }
    }
}

/// Returns the client to whom limits on the request with these extensions apply.
pub(crate) fn client(extensions: &Extensions) -> Client {
    extensions.get().map_or_else(|| Peer::of_extensions(extensions).into(), Caller::client)
}

impl<S: Sync> FromRequestParts<S> for Client {
    type Rejection = Infallible;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, Infallible> {
        Ok(client(&parts.extensions))
    }
}

impl<S: Sync> FromRequestParts<S> for Caller {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, Problem> {
        Self::of_extensions(&parts.extensions).cloned()
    }
}
