//! Grants: what a token or a link allows and for how long, and what must hold of the key that made it.

use super::key::KeyId;
use super::scope::{Scope, Scopes};
use super::set::{Member, Set};
use super::signing::{NoSigner, Signature, Verifier};
use std::fmt;

/// Longest time in seconds for which a token or link may be made, and for which one that is presented may still hold:
/// 7 days. Raising it prolongs the use of a leaked one whose key nobody revokes.
pub(crate) const LONGEST: u64 = 7 * 24 * 60 * 60;

/// Allowed difference in seconds between the clock that made a token or link and the clock that checks it. Raising it
/// prolongs every token and link by as much.
pub(crate) const SKEW: u64 = 30;

/// HTTP method of a request. `GET` includes `HEAD`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Method {
    Get,
    Post,
    Put,
    Patch,
    Delete,
}

/// HTTP methods that a token allows. The text `GET,POST` lists them in the order of [`Method`].
pub(crate) type Methods = Set<Method>;

impl Member for Method {
    const NOUN: &'static str = "method";
    const ALL: &'static [Self] = &[Self::Get, Self::Post, Self::Put, Self::Patch, Self::Delete];

    fn name(self) -> &'static str {
        match self {
            Self::Get => "GET",
            Self::Post => "POST",
            Self::Put => "PUT",
            Self::Patch => "PATCH",
            Self::Delete => "DELETE",
        }
    }
}

/// Id of a material: `b3-` and 64 lower-case hexadecimal digits.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) struct MaterialId(blake3::Hash);

/// Materials that the holder of a token or link may access.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Reach {
    /// All materials that the key of the token may access, and all other resources, too.
    All,
    /// The material with this id, and nothing else.
    One(MaterialId),
}

/// Facts of the row of a key, on which the answer to its tokens and links depends. A key belongs to one tenant for as
/// long as it exists, so the tenant of this row is the tenant of the token or link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct KeyFacts {
    pub(crate) scopes: Scopes,
    pub(crate) verifier: Verifier,
    /// End of the key in Unix seconds; `None` if it does not expire.
    pub(crate) expires: Option<u64>,
    pub(crate) is_revoked: bool,
}

/// Verified permission of a token or link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Grant {
    pub(crate) key: KeyId,
    pub(crate) scopes: Scopes,
    pub(crate) methods: Methods,
    pub(crate) reach: Reach,
    /// End of the permission in Unix seconds, at which its key may end, too.
    pub(crate) expires: u64,
}

/// Reason to refuse a token or link. No message contains a part of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum Refused {
    /// The text does not have the form of a token.
    #[error("found a text that is not a token, expected `wlt_`, its claims, a dot and a signature")]
    NotAToken,
    /// The path and query do not have the form of a signed link.
    #[error(
        "found a query that is not one of a signed link, expected `key=…&expires=…&signature=…` and nothing else, at the \
         content of a material"
    )]
    NotALink,
    /// The token or link has expired.
    #[error("the token or link has expired: make a new one")]
    Expired,
    /// The token or link ends further in the future than any that can be made now.
    #[error(
        "the token or link ends more than 7 days from now: make a shorter one, and check the clocks of both machines"
    )]
    TooLong,
    /// The signature of the token or link was not made with the key that it names.
    #[error("the signature does not match: the token or link was changed, or its key does not exist")]
    Forged,
    /// The key that made the token or link was revoked.
    #[error("the key of the token or link was revoked: make a new one with another key")]
    KeyRevoked,
    /// The key that made the token or link has expired.
    #[error("the key of the token or link has expired: make a new one with another key")]
    KeyExpired,
    /// The key has fewer scopes than the token or link claims.
    #[error("the key of the token or link has the scopes {has}, and not all of {needs}")]
    KeyScopes { has: Scopes, needs: Scopes },
}

/// Reason not to make a token or link.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum NotMade {
    /// The requested validity of the token or link is zero or longer than [`LONGEST`].
    #[error("found a time that is 0 or longer than 7 days, expected for example 12h or 7d")]
    Time,
    /// The token would have no scope, or one that only keys may have.
    #[error("found the scopes {0}, expected some of {tokens}", tokens = token_scopes())]
    Scopes(Scopes),
    /// The token would allow no HTTP method.
    #[error("found no methods, expected for example GET,POST")]
    Methods,
    /// The token or link cannot be signed.
    #[error(transparent)]
    Signer(#[from] NoSigner),
}

/// Returns the scopes that a token may have. Administration needs the key itself.
pub(crate) fn token_scopes() -> Scopes {
    [Scope::Read, Scope::Write, Scope::Jobs].into_iter().collect()
}

/// Returns the end in Unix seconds of a token or link that is made at `now` for `seconds`.
pub(crate) fn end(now: u64, seconds: u64) -> Result<u64, NotMade> {
    if seconds == 0 || seconds > LONGEST {
        return Err(NotMade::Time);
    }
    Ok(now.saturating_add(seconds))
}

/// Checks at `now` the stated end of a token or link. Needs no key, so that nothing is looked up for an expired one.
pub(super) fn check_end(expires: u64, now: u64) -> Result<(), Refused> {
    if now >= expires.saturating_add(SKEW) {
        return Err(Refused::Expired);
    }
    if expires > now.saturating_add(LONGEST).saturating_add(SKEW) {
        return Err(Refused::TooLong);
    }
    Ok(())
}

impl KeyFacts {
    /// Checks a token or link at `now`: the signature first, so that nobody learns about a key without a signature of
    /// it, then the key itself. Returns the grant, which ends with the key.
    pub(super) fn check(&self, text: &str, signature: &Signature, grant: Grant, now: u64) -> Result<Grant, Refused> {
        if !self.verifier.verifies(text, signature) {
            return Err(Refused::Forged);
        }
        if self.is_revoked {
            return Err(Refused::KeyRevoked);
        }
        let expires = self.expires.unwrap_or(u64::MAX);
        if now >= expires {
            return Err(Refused::KeyExpired);
        }
        check_end(grant.expires, now)?;
        if !grant.scopes.is_within(self.scopes) {
            return Err(Refused::KeyScopes { has: self.scopes, needs: grant.scopes });
        }
        Ok(Grant { expires: grant.expires.min(expires), ..grant })
    }
}

impl Grant {
    /// Returns true if the grant allows a request with this method and path. The path is compared as it was sent: a
    /// percent-encoded spelling is another path.
    pub(crate) fn allows(&self, method: &str, path: &str) -> bool {
        let method = if method == "HEAD" { "GET" } else { method };
        let is_reached = match self.reach {
            Reach::All => true,
            Reach::One(material) => {
                let rest = path.strip_prefix(MATERIALS).and_then(|rest| rest.strip_prefix(&material.to_string()));
                rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
            }
        };
        is_reached && self.methods.iter().any(|allowed| allowed.name() == method)
    }
}

/// URL path below which the service has its materials.
pub(super) const MATERIALS: &str = "/v1/materials/";

impl MaterialId {
    /// Reads the id of a material; `None` for any other text.
    pub(crate) fn read(text: &str) -> Option<Self> {
        let digits = text.strip_prefix("b3-").filter(|digits| digits.bytes().all(|b| !b.is_ascii_uppercase()))?;
        blake3::Hash::from_hex(digits).ok().map(Self)
    }
}

impl fmt::Display for MaterialId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "b3-{}", self.0.to_hex())
    }
}

impl fmt::Debug for MaterialId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl fmt::Display for Reach {
    /// Writes the materials that a token reaches as text: `all`, or the id of one material.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::All => f.write_str("all"),
            Self::One(material) => material.fmt(f),
        }
    }
}

impl Reach {
    /// Parses the materials that a token reaches: `all` or the id of one material; `None` for any other text.
    pub(super) fn read(text: &str) -> Option<Self> {
        if text == "all" { Some(Self::All) } else { MaterialId::read(text).map(Self::One) }
    }
}

#[cfg(test)]
pub(super) mod fixed {
    //! Fixed key, material and time that the tests of tokens and links use.

    use super::super::key::Key;
    use super::super::signing::Signer;
    use super::*;

    /// Fixed time of the tests of tokens and links in Unix seconds: 2026-11-26.
    pub(crate) const NOW: u64 = 1_795_651_200;

    pub(crate) fn key() -> Key {
        "wlm_0123456xyz_-06h9Eea7UCT5jmM3zKF2Ct-0SR3yh1wwxZpvA9itQg_30ofMo".parse().unwrap()
    }

    pub(crate) fn material() -> MaterialId {
        MaterialId::read(&format!("b3-{}", "0123456789abcdef".repeat(4))).unwrap()
    }

    pub(crate) fn facts() -> KeyFacts {
        let verifier = Signer::of(&key()).unwrap().verifier().unwrap();
        KeyFacts { scopes: Scopes::all(), verifier, expires: None, is_revoked: false }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grant(methods: &str, reach: Reach) -> Grant {
        let (key, scopes) = (fixed::key().id(), token_scopes());
        Grant { key, scopes, methods: methods.parse().unwrap(), reach, expires: fixed::NOW }
    }

    #[test]
    fn a_grant_for_one_material_reaches_it_and_what_is_below() {
        let id = fixed::material();
        let one = grant("GET,POST", Reach::One(id));
        for below in ["", "/content", "/preview.png", "/evaluate"] {
            assert!(one.allows("GET", &format!("/v1/materials/{id}{below}")), "{below}");
        }
        for other in [
            String::new(),
            "/".to_owned(),
            "/metrics".to_owned(),
            "/v1/materials".to_owned(),
            "/v1/materials/".to_owned(),
            format!("/v1/materials/{id}0"),
            format!("/v1/materials/{}", &id.to_string()[..66]),
            format!("/v1/materials/%62{}", &id.to_string()[1..]),
            format!("/v1/materials/{}", id.to_string().to_uppercase()),
            format!("//v1/materials/{id}"),
            format!("/v1/materials//{id}"),
            format!("/v1/measurements/{id}"),
            format!("/v1/blobs/{id}"),
            format!("/x/v1/materials/{id}"),
        ] {
            assert!(!one.allows("GET", &other), "{other}");
            assert!(grant("GET", Reach::All).allows("GET", &other), "{other}");
        }
    }

    #[test]
    fn a_grant_allows_its_methods_alone() {
        let path = format!("/v1/materials/{}", fixed::material());
        for method in Method::ALL {
            let alone = grant(method.name(), Reach::All);
            for other in ["GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS", "TRACE", "CONNECT", "get", ""] {
                let expected = other == method.name() || (other == "HEAD" && *method == Method::Get);
                assert_eq!(alone.allows(other, &path), expected, "{method:?} {other}");
            }
        }
    }

    #[test]
    fn ids_of_materials_have_one_text() {
        let id = fixed::material();
        assert_eq!(MaterialId::read(&id.to_string()), Some(id));
        assert_eq!(Reach::read(&Reach::One(id).to_string()), Some(Reach::One(id)));
        assert_eq!(Reach::read(&Reach::All.to_string()), Some(Reach::All));
        let text = id.to_string();
        for wrong in [
            "",
            "all ",
            "ALL",
            "b3-",
            &text[3..],
            &text[..66],
            &text.to_uppercase(),
            &format!("{text}0"),
            &text.replace('f', "g"),
        ] {
            assert_eq!(Reach::read(wrong), None, "{wrong}");
        }
    }
}
