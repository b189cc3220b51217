//! Table of all notes, for documentation and for programs that look at codes.

use crate::domain::NoteTemplate;
use crate::notes::{
    CheckNote, FitNote, LobeNote, LuminaireNote, MaterialNote, PhaseNote, ProjectionNote, ScatteringNote, SpectrumNote,
    TextNote, ValueNote,
};
use crate::{compress, evaluate};

/// Declarations of all notes that tell users how their file was read and compressed, grouped by subject.
const SUBJECTS: &[(&str, &[NoteTemplate])] = &[
    ("Text, lines and columns", TextNote::TEMPLATES),
    ("Numbers, units and quantities", ValueNote::TEMPLATES),
    ("Luminaires", LuminaireNote::TEMPLATES),
    ("Spectra", SpectrumNote::TEMPLATES),
    ("Phase functions", PhaseNote::TEMPLATES),
    ("Surfaces", ScatteringNote::TEMPLATES),
    ("Checks of a file against physics", CheckNote::TEMPLATES),
    ("Axes and cells", ProjectionNote::TEMPLATES),
    ("Fits to samples at scattered directions", FitNote::TEMPLATES),
    ("Narrow lobes", LobeNote::TEMPLATES),
    ("Targets", compress::NOTES),
    ("Compressed materials", MaterialNote::TEMPLATES),
    ("Incoming directions", evaluate::NOTES),
];

/// Returns the declarations of all notes that the library can give, grouped by subject.
pub fn note_templates() -> impl Iterator<Item = &'static NoteTemplate> {
    SUBJECTS.iter().flat_map(|(_, templates)| templates.iter())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;
    use std::fmt::Write as _;

    const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/notes.md");
    const BEGIN: &str = "<!-- notes begin -->\n";
    const END: &str = "<!-- notes end -->";

    fn tables() -> String {
        let mut text = String::new();
        for (subject, templates) in SUBJECTS {
            write!(text, "\n## {subject}\n\n| Code | Kind | Sentence |\n|---|---|---|\n").unwrap();
            for template in *templates {
                let sentence = template.sentence().replace('|', "\\|").replace('<', "&lt;");
                writeln!(text, "| `{}` | {} | {sentence} |", template.code(), template.kind.name()).unwrap();
            }
        }
        text.push('\n');
        text
    }

    #[test]
    fn the_documented_notes_are_those_of_the_program() {
        let file = std::fs::read_to_string(FILE).unwrap();
        let (before, rest) = file.split_once(BEGIN).unwrap();
        let (documented, after) = rest.split_once(END).unwrap();
        if std::env::var_os("UPDATE_NOTES").is_some() {
            std::fs::write(FILE, format!("{before}{BEGIN}{}{END}{after}", tables())).unwrap();
            return;
        }
        assert!(
            documented == tables(),
            "docs/notes.md is not what the program says: UPDATE_NOTES=1 cargo test -p wavelume-formats documented_notes"
        );
    }

    #[test]
    fn codes_are_unique_and_in_kebab_case() {
        let codes: Vec<String> = note_templates().map(NoteTemplate::code).collect();
        let unique: BTreeSet<&String> = codes.iter().collect();
        assert_eq!(unique.len(), codes.len());
        let is_kebab = |code: &String| code.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-');
        assert!(codes.iter().all(is_kebab), "{codes:?}");
    }
}
