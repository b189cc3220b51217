//! Texts that a user chooses: names, file names, licences, tags.

use utoipa::openapi::RefOr;
use utoipa::openapi::schema::{ObjectBuilder, Schema, Type};
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
