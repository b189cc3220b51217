//! First key of a service that nobody can administer yet: given by whoever starts the service.

use crate::catalog::{Act, CatalogError, NewKey};
use crate::jobs::Engine;
use crate::trust::{Key, NoSigner, Scopes, Signer, Tenant};
use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

/// First access key of a service, given by whoever starts it. Neither `Debug` nor an error shows its text.
#[derive(Clone)]
pub struct BootstrapKey(Arc<Key>);

/// Error for a text that was given as the first access key of a service, but is not a key.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}; `wavelume keys generate` prints one")]
pub struct NotAKey(String);

/// Failure to store the first access key of a service.
#[derive(Debug, thiserror::Error)]
pub(super) enum FirstKeyError {
    /// No key pair for signatures can be derived from the access key.
    #[error(transparent)]
    Signer(#[from] NoSigner),
    /// The catalog, the database of the service, cannot be used.
    #[error(transparent)]
    Catalog(#[from] CatalogError),
}

impl FromStr for BootstrapKey {
    type Err = NotAKey;

    fn from_str(text: &str) -> Result<Self, NotAKey> {
        text.trim()
            .parse()
            .map(|key| Self(Arc::new(key)))
            .map_err(|error: crate::trust::KeyError| NotAKey(error.to_string()))
    }
}

impl fmt::Debug for BootstrapKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// Stores the first access key of a service with all scopes, unless the service has ever had a key.
pub(super) async fn store(engine: &Engine, BootstrapKey(key): &BootstrapKey) -> Result<(), FirstKeyError> {
    let id = key.id();
    let verifier = Signer::of(key)?.verifier()?;
    let tenant = Tenant::default();
    let new = NewKey {
        id,
        tenant: tenant.clone(),
        name: "bootstrap".to_owned(),
        hash: key.secret().hash(),
        verifier: Some(verifier),
        scopes: Scopes::all(),
        life: engine.limits.key_age,
        created_by: "bootstrap".to_owned(),
    };
    let act = Act {
        tenant: Some(tenant),
        actor: "bootstrap".to_owned(),
        action: "key.create",
        subject: Some(id.to_string()),
        detail: Some(new.scopes.to_string()),
        ..Act::default()
    };
    if engine.archive.catalog.add_first_key(&new, &act).await? {
        tracing::info!(key = %id, "the bootstrap key was stored with all scopes");
    } else {
        tracing::info!(key = %id, "the bootstrap key is ignored: the database has keys");
    }
    Ok(())
}
