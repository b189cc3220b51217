//! Caller of a request: on whose behalf it reads and writes.

use crate::trust::Tenant;
use axum::http::Extensions;

/// Caller of a request, an extension of the request.
#[derive(Clone, Debug, Default)]
pub(crate) struct Caller {
    /// Owner of what the request reads and writes.
    pub(crate) tenant: Tenant,
}

impl Caller {
    /// Returns the caller in a service without keys: the default tenant.
    pub(crate) fn off() -> Self {
        Self::default()
    }

    /// Returns a caller with the data of a tenant, in a service with keys.
    #[cfg(test)]
    pub(crate) fn of_tenant(tenant: Tenant) -> Self {
        Self { tenant }
    }

    /// Returns the caller of the request with these extensions.
    pub(crate) fn of_extensions(extensions: &Extensions) -> Self {
        extensions.get().cloned().unwrap_or_else(Self::off)
    }
}
