//! Texts that a user chooses: names, file names, licences, tags.

use utoipa::openapi::schema::{ArrayBuilder, ObjectBuilder, Schema, Type};
use utoipa::openapi::{Ref, RefOr};
use utoipa::{PartialSchema, ToSchema};

/// Upper bound in characters on a name, file name, licence or tag.
const MAX_TEXT: usize = 200;
/// Regular expression of texts without control characters.
const PATTERN: &str = r"^[^\x00-\x1f\x7f-\x9f]*$";

/// Schema, in the OpenAPI description, of a text that a user chooses: 1 to 200 characters, no control characters.
#[derive(Debug)]
pub(crate) struct Text;

impl PartialSchema for Text {
    fn schema() -> RefOr<Schema> {
        let text = ObjectBuilder::new().schema_type(Type::String).min_length(Some(1)).max_length(Some(MAX_TEXT));
        text.pattern(Some(PATTERN)).description(Some("Text without control characters.")).into()
    }
}

impl ToSchema for Text {}

/// Upper bound on the tags that a client gives to a material at once.
pub(crate) const MAX_TAGS: usize = 32;

/// Tags of a material in the HTTP description: a list of at most [`MAX_TAGS`] texts.
pub(crate) struct Tags;

impl PartialSchema for Tags {
    fn schema() -> RefOr<Schema> {
        let tags = ArrayBuilder::new().items(Ref::from_schema_name(Text::name())).max_items(Some(MAX_TAGS));
        tags.description(Some("Tags of a material.")).into()
    }
}

impl ToSchema for Tags {
    fn schemas(schemas: &mut Vec<(String, RefOr<Schema>)>) {
        schemas.push((Text::name().into_owned(), Text::schema()));
    }
}

/// Checks a text that a user chose: 1 to [`MAX_TEXT`] characters, none of them a control character.
pub(crate) fn check_text(what: &str, text: &str) -> Result<(), String> {
    let length = text.chars().count();
    if length == 0 || length > MAX_TEXT {
        return Err(format!("a {what} of {length} characters, expected 1 to {MAX_TEXT}"));
    }
    if text.chars().any(char::is_control) {
        return Err(format!("a {what} with control characters"));
    }
    Ok(())
}
