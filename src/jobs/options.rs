//! Options for reading the bytes of a measurement, and the identity that they give it.

use crate::domain::Unit;
use crate::formats::{ArrayManifest, Interpretation, Normalization, StatedQuantity};
use crate::store::Digest;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use utoipa::ToSchema;

/// Options for reading the bytes of a measurement; kept in its document. An option unknown to this version is an error:
/// bytes read without it would be read wrongly.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
#[schema(as = ReadingOptions)]
pub(crate) struct Options {
    /// The measurement whose content is the spectrum to join.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spectrum: Option<Digest>,
    /// Quantity, if the file does not state it; reflectance factors are divided by π.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quantity: Option<StatedQuantity>,
    /// The unit of a value.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<Unit>,
    /// The unit of wavelengths.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wavelength_unit: Option<String>,
    /// The column of a table.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub column: Option<String>,
    /// Integral of the values of a phase table over the sphere.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub normalization: Option<Normalization>,
    /// The axes of an array, from the manifest beside it in an archive.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<ArrayManifest>)]
    pub axes: Option<serde_json::Value>,
}

impl Options {
    /// Returns true if no option is stated.
    pub(super) fn is_default(&self) -> bool {
        *self == Self::default()
    }

    /// Returns the options as the parsers take them.
    pub(crate) fn interpretation(&self) -> Interpretation {
        Interpretation {
            quantity: self.quantity,
            unit: self.unit,
            wavelength_unit: self.wavelength_unit.clone(),
            column: self.column.clone(),
            normalization: self.normalization,
            member: None,
            axes: self.axes.clone(),
            wavelengths: None,
        }
    }

    /// Returns the identity of `content` read with these options. Without options it is the content's digest. Otherwise
    /// it is the digest of `{"content":"b3-…","options":{…}}`: JSON without white space, keys in alphabetical order,
    /// values as text.
    pub(crate) fn identity(&self, content: Digest) -> Digest {
        if self.is_default() {
            return content;
        }
        let mut options = BTreeMap::new();
        options.extend(self.spectrum.map(|v| ("spectrum", v.to_string())));
        options.extend(self.quantity.map(|v| ("quantity", v.name().to_owned())));
        options.extend(self.unit.map(|v| ("unit", v.name().to_owned())));
        options.extend(self.wavelength_unit.clone().map(|v| ("wavelength_unit", v)));
        options.extend(self.column.clone().map(|v| ("column", v)));
        options.extend(self.normalization.map(|v| ("normalization", v.name().to_owned())));
        options.extend(self.axes.as_ref().map(|v| ("axes", v.to_string())));
        let quoted = |text: &str| serde_json::Value::from(text).to_string();
        let listed: Vec<String> =
            options.iter().map(|(key, value)| format!("{}:{}", quoted(key), quoted(value))).collect();
        Digest::of(format!("{{\"content\":\"{content}\",\"options\":{{{}}}}}", listed.join(",")).as_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Quantity;

    #[test]
    fn options_are_part_of_the_identity() {
        let content = Digest::of(b"table");
        let none = Options::default();
        assert_eq!(none.identity(content), content);
        let column = Options { column: Some("light \"skin\"".to_owned()), ..none.clone() };
        let both = Options { quantity: Some(Quantity::Reflectance.into()), ..column.clone() };
        let text = format!(
            "{{\"content\":\"{content}\",\"options\":{{\"column\":\"light \\\"skin\\\"\",\"quantity\":\"reflectance\"}}}}"
        );
        assert_eq!(both.identity(content), Digest::of(text.as_bytes()));
        assert_ne!(column.identity(content), both.identity(content));
        assert_ne!(column.identity(content), content);
    }
}
