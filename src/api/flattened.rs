//! Flattened structs in the description: one object with all properties, where each part is described apart.

use std::collections::{BTreeMap, BTreeSet};
use utoipa::openapi::schema::{AdditionalProperties, AllOf, Object, Schema};
use utoipa::openapi::{Components, OpenApi, RefOr};

/// Upper bound on how deeply `allOf` schemas nested in one another are merged into one OpenAPI object schema. The bound
/// ends the merging of a schema that contains itself. Raising it merges more deeply nested schemas.
const DEEPEST: usize = 8;

/// Replaces every OpenAPI schema that combines several objects (`allOf`) by one object with the properties of all. The
/// result refuses unknown properties if one of the parts does.
pub(super) fn flatten(components: &mut Components) {
    let known: BTreeMap<String, RefOr<Schema>> =
        components.schemas.iter().map(|(name, schema)| (name.clone(), schema.clone())).collect();
    for schema in components.schemas.values_mut() {
        if let RefOr::T(Schema::AllOf(parts)) = &*schema
            && let Some(object) = merged(parts, &known, DEEPEST)
        {
            *schema = RefOr::T(Schema::Object(object));
        }
    }
}

/// Removes the OpenAPI schemas that nothing refers to any more, because their properties were copied into other
/// schemas.
pub(super) fn prune(openapi: &mut OpenApi) {
    loop {
        let Ok(text) = openapi.to_json() else { return };
        let Some(components) = &mut openapi.components else { return };
        let before = components.schemas.len();
        let named = text.split("\"#/components/schemas/").skip(1).filter_map(|rest| rest.split('"').next());
        let named: BTreeSet<&str> = named.collect();
        components.schemas.retain(|name, _| named.contains(name.as_str()));
        if components.schemas.len() == before {
            return;
        }
    }
}

/// Merges the parts of an `allOf` schema into one object schema; `None` if one of the parts is no object.
fn merged(parts: &AllOf, known: &BTreeMap<String, RefOr<Schema>>, depth: usize) -> Option<Object> {
    let mut whole = Object::new();
    whole.description.clone_from(&parts.description);
    for part in &parts.items {
        let object = object_of(part, known, depth.checked_sub(1)?)?;
        whole.required.extend(object.required);
        whole.properties.extend(object.properties);
        if matches!(object.additional_properties.as_deref(), Some(AdditionalProperties::FreeForm(false))) {
            whole.additional_properties = object.additional_properties;
        }
    }
    Some(whole)
}

fn object_of(part: &RefOr<Schema>, known: &BTreeMap<String, RefOr<Schema>>, depth: usize) -> Option<Object> {
    match part {
        RefOr::T(Schema::Object(object)) => Some(object.clone()),
        RefOr::T(Schema::AllOf(parts)) => merged(parts, known, depth),
        // A part that may be absent: null, or the object with nothing required.
        RefOr::T(Schema::OneOf(either)) => {
            let mut objects = either.items.iter().filter_map(|item| object_of(item, known, depth.checked_sub(1)?));
            let mut object = objects.find(|object| !object.properties.is_empty())?;
            object.required.clear();
            Some(object)
        }
        RefOr::Ref(reference) => {
            let name = reference.ref_location.rsplit('/').next()?;
            object_of(known.get(name)?, known, depth.checked_sub(1)?)
        }
        RefOr::T(_) => None,
    }
}
