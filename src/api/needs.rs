//! Scopes that the routes need: one table of every method and path of the interface.

use crate::trust::{Scope, Scopes};
use axum::http::Method;

/// Scope that a caller needs for a route.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Need {
    /// The route answers everybody, without a key: health checks, the introduction to the service, its OpenAPI
    /// description, and lists that are the same everywhere, such as that of file formats.
    Public,
    /// The route reads or queries materials. A service may answer it without a key for public materials.
    Material,
    /// The route reads something other than materials, such as measurements or jobs.
    Read,
    /// The route uploads or deletes measurements or materials.
    Write,
    /// The route queues, cancels or repeats jobs.
    Jobs,
    /// The route administers one tenant, and is open to whoever administers the whole service, too.
    Tenant,
    /// The route administers the whole service.
    Instance,
}

/// Methods and paths of the HTTP interface, each with the scope that it needs. A route that is missing here is refused;
/// `HEAD` needs the scope of `GET`.
pub(crate) const NEEDS: &[(&str, &str, Need)] = &[
    ("GET", "/", Need::Public),
    ("GET", "/healthz", Need::Public),
    ("GET", "/readyz", Need::Public),
    ("GET", "/metrics", Need::Instance),
    ("GET", "/openapi.json", Need::Public),
    ("GET", "/v1/formats", Need::Public),
    ("GET", "/v1/formats/{name}/template", Need::Public),
    ("GET", "/v1/bases", Need::Public),
    ("POST", "/v1/measurements", Need::Write),
    ("GET", "/v1/measurements", Need::Read),
    ("GET", "/v1/measurements/{id}", Need::Read),
    ("DELETE", "/v1/measurements/{id}", Need::Write),
    ("GET", "/v1/measurements/{id}/content", Need::Read),
    ("OPTIONS", "/v1/uploads", Need::Public),
    ("POST", "/v1/uploads", Need::Write),
    ("HEAD", "/v1/uploads/{id}", Need::Write),
    ("PATCH", "/v1/uploads/{id}", Need::Write),
    ("DELETE", "/v1/uploads/{id}", Need::Write),
    ("POST", "/v1/uploads/{id}", Need::Write),
    ("POST", "/v1/jobs", Need::Jobs),
    ("GET", "/v1/jobs", Need::Read),
    ("GET", "/v1/jobs/{id}", Need::Read),
    ("GET", "/v1/jobs/{id}/events", Need::Read),
    ("POST", "/v1/jobs/{id}/cancel", Need::Jobs),
    ("POST", "/v1/jobs/{id}/retry", Need::Jobs),
    ("POST", "/v1/materials", Need::Write),
    ("GET", "/v1/materials", Need::Material),
    ("GET", "/v1/materials/{id}", Need::Material),
    ("DELETE", "/v1/materials/{id}", Need::Write),
    ("PATCH", "/v1/materials/{id}", Need::Write),
    ("GET", "/v1/materials/{id}/content", Need::Material),
    ("GET", "/v1/blobs/{digest}", Need::Material),
    ("GET", "/v1/materials/{id}/spectrum", Need::Material),
    ("GET", "/v1/materials/{id}/albedo", Need::Material),
    ("POST", "/v1/materials/{id}/albedo", Need::Material),
    ("POST", "/v1/materials/{id}/evaluate", Need::Material),
    ("POST", "/v1/materials/{id}/pdf", Need::Material),
    ("POST", "/v1/materials/{id}/sample", Need::Material),
    ("GET", "/v1/materials/{id}/color", Need::Material),
    ("GET", "/v1/materials/{id}/physics", Need::Material),
    ("GET", "/v1/materials/{id}/preview.png", Need::Material),
    ("GET", "/v1/materials/{id}/export", Need::Material),
    ("POST", "/v1/keys", Need::Tenant),
    ("GET", "/v1/keys", Need::Tenant),
    ("DELETE", "/v1/keys/{id}", Need::Tenant),
    ("GET", "/v1/audit", Need::Tenant),
    ("GET", "/v1/tenants", Need::Instance),
    ("POST", "/v1/tenants", Need::Instance),
    ("GET", "/v1/tenants/{tenant}", Need::Tenant),
    ("PATCH", "/v1/tenants/{tenant}", Need::Instance),
];

impl Need {
    /// Returns true if a caller with these scopes may use the route.
    pub(crate) fn allows(self, scopes: Scopes) -> bool {
        match self {
            Self::Public => true,
            Self::Material | Self::Read => scopes.has(Scope::Read),
            Self::Write => scopes.has(Scope::Write),
            Self::Jobs => scopes.has(Scope::Jobs),
            Self::Tenant => scopes.has(Scope::Tenant) || scopes.has(Scope::Instance),
            Self::Instance => scopes.has(Scope::Instance),
        }
    }

    /// Returns the name of the scope that a route needs, for messages; `none` if it needs none.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Public => "none",
            Self::Material | Self::Read => "read",
            Self::Write => "write",
            Self::Jobs => "jobs",
            Self::Tenant => "tenant",
            Self::Instance => "instance",
        }
    }
}

/// Returns the scope that a route needs, by its method and the pattern of its path; `None` if there is no such route.
pub(crate) fn need(method: &str, path: &str) -> Option<Need> {
    let listed =
        |method: &str| NEEDS.iter().find(|(known, at, _)| *known == method && *at == path).map(|(_, _, need)| *need);
    listed(method).or_else(|| if method == Method::HEAD.as_str() { listed("GET") } else { None })
}

/// Returns the name under which the audit trail records a successful request for a route; `None` if such requests are
/// not recorded, or if their handler records them itself.
pub(crate) fn act(method: &str, path: &str) -> Option<&'static str> {
    Some(match (method, path) {
        ("POST", "/v1/materials") => "material.upload",
        ("PATCH", "/v1/materials/{id}") => "material.change",
        ("DELETE", "/v1/materials/{id}") => "material.delete",
        ("POST", "/v1/measurements") => "measurement.upload",
        ("DELETE", "/v1/measurements/{id}") => "measurement.delete",
        ("POST", "/v1/tenants") => "tenant.create",
        ("PATCH", "/v1/tenants/{tenant}") => "tenant.change",
        _ => return None,
    })
}

/// Returns the HTTP methods of the routes with this path pattern, as the header `Allow` lists them.
pub(crate) fn methods(path: &str) -> String {
    let mut methods = Vec::new();
    for (method, _, _) in NEEDS.iter().filter(|(_, known, _)| *known == path) {
        methods.push(*method);
        if *method == "GET" {
            methods.push("HEAD");
        }
    }
    methods.join(",")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn the_table_has_every_route_of_the_description_and_no_other() {
        let openapi = crate::api::openapi();
        let mut described = BTreeSet::new();
        for (path, item) in &openapi.paths.paths {
            for (method, operation) in [
                ("GET", &item.get),
                ("HEAD", &item.head),
                ("POST", &item.post),
                ("PUT", &item.put),
                ("PATCH", &item.patch),
                ("DELETE", &item.delete),
                ("OPTIONS", &item.options),
                ("TRACE", &item.trace),
            ] {
                if operation.is_some() {
                    described.insert((method, path.as_str()));
                }
            }
        }
        let table: BTreeSet<_> = NEEDS.iter().map(|(method, path, _)| (*method, *path)).collect();
        assert_eq!(table.len(), NEEDS.len(), "each route once");
        assert_eq!(table, described);
    }

    #[test]
    fn a_head_needs_what_a_get_needs_and_nothing_else_is_guessed() {
        assert_eq!(need("HEAD", "/v1/materials/{id}/content"), Some(Need::Material));
        assert_eq!(need("HEAD", "/v1/uploads/{id}"), Some(Need::Write));
        for (method, path) in [("PUT", "/v1/jobs"), ("GET", "/v1/uploads/{id}"), ("GET", "/v1/nothing"), ("get", "/")] {
            assert_eq!(need(method, path), None, "{method} {path}");
        }
        assert_eq!(methods("/v1/jobs"), "POST,GET,HEAD");
    }

    #[test]
    fn each_need_is_met_by_its_own_scope() {
        let allowed = |need: Need| {
            let scopes = Scopes::all().iter().filter(|scope| need.allows([*scope].into_iter().collect()));
            scopes.collect::<Scopes>().to_string()
        };
        for (need, scopes) in [
            (Need::Public, "read,write,jobs,tenant,instance"),
            (Need::Material, "read"),
            (Need::Read, "read"),
            (Need::Write, "write"),
            (Need::Jobs, "jobs"),
            (Need::Tenant, "tenant,instance"),
            (Need::Instance, "instance"),
        ] {
            assert_eq!(allowed(need), scopes);
            assert!(need == Need::Public || !need.allows(Scopes::none()));
        }
    }
}
