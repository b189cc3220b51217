//! Tenant: owner of rows and of stored bytes, named by a short id.

use serde::{Serialize, Serializer};
use std::fmt;
use std::str::FromStr;
use std::sync::{Arc, LazyLock};

/// Id of the tenant that owns everything in a service without keys.
const DEFAULT: &str = "default";

/// Upper bound on the characters of a tenant's id. Raising it lengthens the names of stored objects.
const LONGEST: usize = 40;

/// Owner of rows and of stored bytes, named by its id: 1 to 40 of a–z, 0–9 and `-`, the first one a letter. Cheap to
/// clone.
#[derive(Clone, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) struct Tenant(Arc<str>);

/// Error for a text that is not the id of a tenant.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("found `{0}`, expected the id of a tenant: 1 to 40 of a–z, 0–9 and `-`, the first one a letter")]
pub(crate) struct NotATenant(String);

impl Tenant {
    /// Returns true for the tenant that owns everything in a service without keys.
    pub(crate) fn is_default(&self) -> bool {
        &*self.0 == DEFAULT
    }

    /// Returns a tenant that owns nothing, and never will: no tenant can have its id.
    pub(crate) fn nobody() -> Self {
        static TENANT: LazyLock<Arc<str>> = LazyLock::new(|| "".into());
        Self(Arc::clone(&TENANT))
    }

    /// Returns the id of the tenant as text.
    pub(crate) fn as_str(&self) -> &str {
        &self.0
    }
}

impl Default for Tenant {
    /// Returns the tenant that owns everything in a service without keys.
    fn default() -> Self {
        static TENANT: LazyLock<Arc<str>> = LazyLock::new(|| DEFAULT.into());
        Self(Arc::clone(&TENANT))
    }
}

impl FromStr for Tenant {
    type Err = NotATenant;

    fn from_str(text: &str) -> Result<Self, NotATenant> {
        if text == DEFAULT {
            return Ok(Self::default());
        }
        let known = |b: u8| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'-';
        let is_id = text.len() <= LONGEST && text.starts_with(|c: char| c.is_ascii_lowercase());
        if is_id && text.bytes().all(known) {
            Ok(Self(text.into()))
        } else {
            // The text that is echoed to the user is bounded.
            Err(NotATenant(text.chars().take(80).collect()))
        }
    }
}

impl Serialize for Tenant {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.0)
    }
}

impl fmt::Display for Tenant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl fmt::Debug for Tenant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_are_short_and_plain() {
        for id in ["a", "default", "lab-2", "x-", &"a".repeat(40)] {
            assert_eq!(id.parse::<Tenant>().unwrap().to_string(), id);
        }
        for other in ["", "2lab", "-a", "Lab", "a_b", "a b", "a/b", "é", "a\n", &"a".repeat(41)] {
            let error = other.parse::<Tenant>().unwrap_err().to_string();
            assert!(error.contains("expected the id of a tenant"), "{error}");
        }
        assert!(Tenant::nobody().to_string().parse::<Tenant>().is_err());
        assert_eq!(Tenant::default(), "default".parse().unwrap());
    }
}
