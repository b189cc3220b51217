//! The route of a request: the pattern of the interface that its path matches.

use super::needs::NEEDS;
use axum::http::Extensions;

/// Pattern of the path of a route, for example `/v1/jobs/{id}`. Requests have it in their extensions; those without
/// one have no route.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Route(&'static str);

impl Route {
    /// Returns the path pattern of the route of a request with these extensions; `None` if it has no route.
    pub(crate) fn of(extensions: &Extensions) -> Option<&'static str> {
        extensions.get::<Self>().map(|route| route.0)
    }
}

/// Routes of the interface by the patterns of their paths, in the syntax of axum.
pub(crate) struct Routes(matchit::Router<Route>);

impl Routes {
    /// Builds the look-up of routes from the table of all routes.
    pub(crate) fn new() -> Self {
        let mut patterns = matchit::Router::new();
        for (_, path, _) in NEEDS {
            // A path with several methods is there already.
            let _ = patterns.insert(*path, Route(path));
        }
        Self(patterns)
    }

    /// Returns the route of a path.
    pub(crate) fn at(&self, path: &str) -> Option<Route> {
        self.0.at(path).ok().map(|found| *found.value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_path_of_the_table_finds_its_route_and_no_other() {
        let routes = Routes::new();
        for (_, path, _) in NEEDS {
            let mut request = (*path).to_owned();
            for (parameter, text) in [("{name}", "a%20b"), ("{id}", "b3-1"), ("{tenant}", "lab")] {
                request = request.replace(parameter, text);
            }
            assert_eq!(routes.at(&request), Some(Route(path)));
        }
        for other in ["", "*", "/v1", "/v1/jobs/", "/v1/jobs/1/2", "//", "/v1/materials/b3-1/"] {
            assert_eq!(routes.at(other), None, "{other}");
        }
    }
}
