//! Declaration of notes: kind, name, fields and sentence in one place.

use super::record::NoteKind;
use std::fmt::Write as _;

/// Declaration of a kind of note (remark for the user), without the values of a single case.
#[derive(Clone, Copy, Debug)]
pub struct NoteTemplate {
    /// Kind of the note, such as a warning or an assumption.
    pub kind: NoteKind,
    /// Name of the Rust enum that declares this kind of remark for the user.
    #[doc(hidden)]
    pub subject: &'static str,
    /// Name of the variant, in a Rust enum, that declares this kind of remark for the user.
    #[doc(hidden)]
    pub variant: &'static str,
    /// Format string of the sentence that states the remark to the user, with the names of its values in braces.
    #[doc(hidden)]
    pub format: &'static str,
}

impl NoteTemplate {
    /// Returns the stable name of the note for programs: `TextNote::DecodedAs` is `text-decoded-as`.
    pub fn code(&self) -> String {
        let mut code = String::new();
        for c in self.subject.trim_end_matches("Note").chars().chain(self.variant.chars()) {
            if c.is_ascii_uppercase() && !code.is_empty() {
                code.push('-');
            }
            code.push(c.to_ascii_lowercase());
        }
        code
    }

    /// Returns the sentence of the note, with `{name}` in place of each part that varies.
    pub fn sentence(&self) -> String {
        let mut sentence = String::new();
        let mut rest = self.format;
        while let Some((before, (part, after))) =
            rest.split_once('{').and_then(|(before, rest)| Some((before, rest.split_once('}')?)))
        {
            let _ = write!(sentence, "{before}{{{}}}", part.split(':').next().unwrap_or(part));
            rest = after;
        }
        sentence + rest
    }
}

/// Declares an enum of notes (remarks for the user). Each variant has a kind, typed fields and the sentence for the
/// user:
///
/// ```text
/// declare_notes! {
///     /// Notes on the text of a file.
///     TextNote {
///         Assumed DecodedAs { encoding: &'static str } => "text decoded as {encoding}";
///         Warning RowsLost { rows: usize } => "{rows} row{s} lost", s = if rows == 1 { " is" } else { "s are" };
///     }
/// }
/// ```
///
/// The sentence is a format string over the fields and the named arguments after it. The fields are the values of the
/// note; an `Option` that is `None` is left out. `From` makes a [`Note`](crate::domain::Note) of a variant.
#[doc(hidden)]
#[macro_export]
macro_rules! declare_notes {
    (
        $(#[$meta:meta])*
        $name:ident {
            $(
                $kind:ident $variant:ident $({ $($field:ident: $type:ty),+ $(,)? })? =>
                    $sentence:literal $(, $argument:ident = $value:expr)* $(,)?;
            )+
        }
    ) => {
        $(#[$meta])*
        #[derive(Clone, Debug, PartialEq)]
        pub(crate) enum $name {
            $($variant $({ $($field: $type),+ })?,)+
        }

        impl $name {
            /// Name, kind and sentence of each remark for the user that this Rust enum declares, in order of
            /// declaration.
            pub(crate) const TEMPLATES: &'static [$crate::domain::NoteTemplate] = &[$(
                $crate::domain::NoteTemplate {
                    kind: $crate::domain::NoteKind::$kind,
                    subject: stringify!($name),
                    variant: stringify!($variant),
                    format: $sentence,
                },
            )+];
        }

        impl From<$name> for $crate::domain::Note {
            fn from(note: $name) -> Self {
                match note {
                    $($name::$variant $({ $($field),+ })? => {
                        let values: &[(&str, Option<$crate::domain::NoteValue>)] =
                            &[$($((stringify!($field), $crate::domain::ToNoteValue::to_value(&$field)),)+)?];
                        let template = $crate::domain::NoteTemplate {
                            kind: $crate::domain::NoteKind::$kind,
                            subject: stringify!($name),
                            variant: stringify!($variant),
                            format: $sentence,
                        };
                        Self {
                            kind: template.kind,
                            code: template.code(),
                            values: values
                                .iter()
                                .filter_map(|(name, value)| Some(((*name).to_owned(), value.clone()?)))
                                .collect(),
                            message: format!($sentence $(, $argument = $value)*),
                        }
                    })+
                }
            }
        }
    };
}
