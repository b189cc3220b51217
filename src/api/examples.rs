//! Examples of JSON request bodies in the description of the interface, for each operation with such a body.

use serde_json::{Value, json};
use utoipa::openapi::example::ExampleBuilder;
use utoipa::openapi::path::Operation;
use utoipa::openapi::{Content, RefOr};

/// Media type of the request bodies that have examples.
const JSON: &str = "application/json";
/// Id of a measurement in the examples.
const MEASUREMENT: &str = "b3-f4fa294e77fea9c6952eb0776d9315b32c60da0839a4280b857fa070723d9737";

/// Returns the examples of an operation's request body, each with a name; empty for operations without a JSON body.
fn examples(operation: &str) -> Vec<(&'static str, Value)> {
    match operation {
        "post_job" => vec![
            ("compress", json!({ "measurement": MEASUREMENT, "target": { "er_l2": 0.01 }, "name": "office lamp" })),
            ("size", json!({ "measurement": MEASUREMENT, "target": { "bytes": 4096 }, "tags": ["preview"] })),
            (
                "colour",
                json!({ "measurement": MEASUREMENT, "target": { "delta_e": { "at_most": 1.0, "illuminant": "A" } } }),
            ),
            ("paper", json!({ "kind": "paper", "tables": [1, 7] })),
        ],
        "change_material" => vec![("share", json!({ "visibility": "private", "shared_with": ["lab"] }))],
        "albedo" => vec![("incidences", json!({ "wi": [[0.0, 0.0], [60.0, 0.0]] }))],
        "evaluate" => vec![
            (
                "surface",
                json!({ "wi": [[30.0, 0.0]], "wo": [[30.0, 180.0], [0.0, 0.0]], "wavelengths": [450.0, 550.0, 650.0] }),
            ),
            ("light", json!({ "wo": [[180.0, 0.0]] })),
        ],
        "pdf" => vec![("surface", json!({ "wi": [[30.0, 0.0]], "wo": [[30.0, 180.0]] }))],
        "sample" => vec![("surface", json!({ "wi": [30.0, 0.0], "count": 4, "seed": 1 }))],
        "create_tenant" => {
            vec![("limited", json!({ "id": "lab", "name": "Colour laboratory", "max_bytes": 10_000_000_000_u64 }))]
        }
        "change_tenant" => vec![("weight", json!({ "weight": 200 }))],
        "create_key" => vec![("reader", json!({ "name": "render farm", "scopes": ["read"], "valid_s": 2_592_000 }))],
        _ => Vec::new(),
    }
}

/// Adds the examples to the request body of an operation.
pub(super) fn add(operation: &mut Operation) {
    let examples = examples(operation.operation_id.as_deref().unwrap_or_default());
    let Some(RefOr::T(body)) = &mut operation.request_body else { return };
    let Some(RefOr::T(Content { examples: described, .. })) = body.content.get_mut(JSON) else { return };
    for (name, value) in examples {
        described.insert(name.to_owned(), RefOr::T(ExampleBuilder::new().value(Some(value)).build()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jobs::{JobRequest, KindOnly, Source};
    use serde::de::DeserializeOwned;

    struct Body(Value);

    impl Source for Body {
        type Error = serde_json::Error;

        fn read<T: DeserializeOwned>(&self) -> Result<T, Self::Error> {
            serde_json::from_value(self.0.clone())
        }
    }

    #[test]
    fn every_json_body_has_an_example() {
        let openapi = crate::api::openapi();
        let operations = openapi.paths.paths.values().flat_map(|path| [&path.post, &path.patch, &path.put]).flatten();
        let mut seen = 0;
        for operation in operations {
            let Some(RefOr::T(body)) = &operation.request_body else { continue };
            let Some(RefOr::T(content)) = body.content.get(JSON) else { continue };
            assert!(!content.examples.is_empty(), "{:?}", operation.operation_id);
            seen += 1;
        }
        assert_eq!(seen, 9);
    }

    #[test]
    fn the_examples_of_jobs_are_accepted() {
        for (name, value) in examples("post_job") {
            let kind = serde_json::from_value::<KindOnly>(value.clone()).unwrap().kind;
            let request = JobRequest::read(kind, &Body(value)).unwrap();
            assert!(request.check().is_ok(), "{name}");
        }
    }
}
