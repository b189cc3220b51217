//! Who may do what: tenants, keys and what they allow. Imports nothing of ours.

mod tenant;

pub(crate) use tenant::{NotATenant, Tenant};
