//! Notes for the user: a kind, a stable code, typed values, and the sentence made from them.

mod declare;
mod record;
mod value;

pub use declare::NoteTemplate;
pub use record::{Note, NoteKind};
pub use value::{NoteValue, ToNoteValue};

#[cfg(test)]
mod tests {
    use super::*;

    crate::declare_notes! {
        /// Remarks to the user that serve as test data for their names, values and sentences.
        TrialNote {
            Warning SamplesLost { lost: usize, of: u64, share_percent: f64 } =>
                "{lost} of {of} samples ({share_percent:.1} %) are lost{mark}", mark = if lost > 1 { "!" } else { "" };
            Assumed NamesKept { name: String, noise: Option<f64>, lowest: f32 } => "{name} down to {lowest}{noise}",
                noise = noise.map_or(String::new(), |noise| format!(" ({noise})"));
            Chosen Nothing => "nothing to choose";
        }
    }

    #[test]
    fn a_note_has_a_code_values_and_a_sentence() {
        let note = Note::from(TrialNote::SamplesLost { lost: 2, of: 8, share_percent: 25.0 });
        let json = r#"{"kind":"warning","message":"2 of 8 samples (25.0 %) are lost!","code":"trial-samples-lost","values":{"lost":2,"of":8,"share_percent":25}}"#;
        assert_eq!(serde_json::to_string(&note).unwrap(), json);
        assert_eq!(serde_json::from_str::<Note>(json).unwrap(), note);
        let note = Note::from(TrialNote::NamesKept { name: "a".to_owned(), noise: Some(f64::NAN), lowest: -0.1 });
        let values = [("lowest", NoteValue::Number(-0.1)), ("name", NoteValue::Text("a".to_owned()))];
        assert_eq!(note.values, values.map(|(name, value)| (name.to_owned(), value)).into());
        assert_eq!(note.about("lamp").to_string(), "lamp: a down to -0.1 (NaN)");
    }

    #[test]
    fn notes_without_code_and_values_can_be_read() {
        let old = r#"{"kind":"chosen","message":"nothing to choose"}"#;
        let note: Note = serde_json::from_str(old).unwrap();
        assert_eq!((note.kind, note.code.as_str(), note.values.len()), (NoteKind::Chosen, "", 0));
        assert_eq!(serde_json::to_string(&note).unwrap(), old);
        assert_eq!(Note::from(TrialNote::Nothing).message, note.message);
    }

    #[test]
    fn templates_list_the_notes_in_order() {
        let templates: Vec<_> = TrialNote::TEMPLATES.iter().map(|t| (t.kind.name(), t.code(), t.sentence())).collect();
        let [lost, kept, nothing] = &templates[..] else { panic!("{templates:?}") };
        assert_eq!(lost.2, "{lost} of {of} samples ({share_percent} %) are lost{mark}");
        assert_eq!((kept.0, kept.1.as_str()), ("assumed", "trial-names-kept"));
        assert_eq!(*nothing, ("chosen", "trial-nothing".to_owned(), "nothing to choose".to_owned()));
    }
}
