//! Templates of input files; each is a valid file as it is.

use serde::Serialize;

/// Template of a measurement file for the user to fill in.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Template {
    /// Stable name of the template of a measurement file: that of its format, followed by its form if the format has
    /// several.
    pub name: &'static str,
    /// Description for people of the file that results when a user fills in a template with measurements.
    pub description: &'static str,
    /// Media type of a template of a measurement file, such as `text/csv; charset=utf-8`.
    pub media_type: &'static str,
    /// Text of a template of a measurement file, which is a valid file as it is.
    #[serde(skip)]
    pub text: &'static str,
}

const CSV: &str = "text/csv; charset=utf-8";

/// Templates of the files that users may write themselves, by hand or with a script.
pub const TEMPLATES: &[Template] = &[
    Template {
        name: "radiometric-csv-long",
        description: "one value a row",
        media_type: CSV,
        text: include_str!("templates/radiometric-csv-long.csv"),
    },
    Template {
        name: "radiometric-csv-wide",
        description: "one spectrum a row",
        media_type: CSV,
        text: include_str!("templates/radiometric-csv-wide.csv"),
    },
    Template {
        name: "npy-manifest",
        description: "the axes of an array, beside it as NAME.axes.json",
        media_type: "application/json",
        text: include_str!("templates/npy-manifest.json"),
    },
    Template {
        name: "radiometric-arrow-python",
        description: "a script that writes an Arrow stream, one list a row",
        media_type: "text/x-python; charset=utf-8",
        text: include_str!("templates/radiometric-arrow.py"),
    },
    Template {
        name: "phase-table",
        description: "scattering angles and values",
        media_type: "text/plain; charset=utf-8",
        text: include_str!("templates/phase-table.txt"),
    },
];

/// Returns the template called `name`. A bare format name selects the first template of that format.
pub fn template(name: &str) -> Option<&'static Template> {
    let of_format = |template: &&Template| template.name.strip_prefix(name).is_some_and(|rest| rest.starts_with('-'));
    TEMPLATES.iter().find(|template| template.name == name).or_else(|| {
        let is_format = super::probing::formats().iter().any(|format| format.name == name);
        TEMPLATES.iter().find(of_format).filter(|_| is_format)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::{Interpretation, NoteKind, Samples, read, write_npy};

    #[test]
    fn every_template_reads_as_it_is() {
        for template in TEMPLATES.iter().filter(|template| template.media_type == CSV) {
            let acquisition = read(template.text.as_bytes(), &Interpretation::default()).unwrap();
            assert!(matches!(acquisition.samples, Samples::Grid(_)), "{}", template.name);
            let warnings: Vec<_> =
                acquisition.report.notes.iter().filter(|note| note.kind == NoteKind::Warning).collect();
            assert!(warnings.is_empty(), "{}: {warnings:?}", template.name);
            assert!(acquisition.report.metadata.contains(&("sample".to_owned(), "velvet-03".to_owned())));
        }
        let phase = read(template("phase-table").unwrap().text.as_bytes(), &Interpretation::default()).unwrap();
        assert!(matches!(phase.samples, Samples::Function(_)), "{:?}", phase.dialect);
        let volume = phase.report.notes.iter().find(|note| note.message.contains("volume scattering"));
        assert!(volume.is_none(), "{volume:?}");
        let axes = serde_json::from_str(template("npy").unwrap().text).unwrap();
        let how = Interpretation { axes: Some(axes), ..Interpretation::default() };
        let array = write_npy(&[3, 5, 5, 31], &[0.5; 3 * 5 * 5 * 31]);
        assert!(matches!(read(&array, &how).unwrap().samples, Samples::Grid(_)));
    }

    #[test]
    fn names_are_those_of_templates_and_formats() {
        assert_eq!(template("radiometric-csv").unwrap().name, "radiometric-csv-long");
        assert_eq!(template("radiometric-csv-wide").unwrap().description, "one spectrum a row");
        for unknown in ["", "radiometric", "lm-63", "npy-"] {
            assert!(template(unknown).is_none(), "{unknown}");
        }
    }
}
