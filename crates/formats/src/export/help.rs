//! Help texts of an export, made from the table of writers.

use super::writer::Writer;

/// Defaults of the options that only some formats take.
const DEFAULTS: [(&str, &str); 4] = [
    ("side", " Default: from the material's own axes; for mbsdf the angles of the source."),
    ("step", " Default: from the material's own axes; for luminaires the angles of the source."),
    ("rgb", ""),
    ("wavelength", " Default: the mean over wavelengths."),
];

/// Returns the help text of the option that chooses the export format: the name of each format with its description.
pub(super) fn of_formats<'a>(writers: impl Iterator<Item = &'a Writer>) -> String {
    let formats: Vec<String> = writers.map(|writer| format!("`{}` ({})", writer.name, writer.description)).collect();
    format!("Format to write: {}", one_of(&formats))
}

/// Returns the help text of an option that only some formats take: each meaning with its formats.
pub(super) fn of_option<'a>(option: &str, writers: impl Iterator<Item = &'a Writer>) -> Option<String> {
    let (_, default) = DEFAULTS.iter().find(|(name, _)| *name == option)?;
    let mut meanings: Vec<(&str, Vec<&str>)> = Vec::new();
    for writer in writers {
        let Some((_, meaning)) = writer.options.iter().find(|(name, _)| *name == option) else { continue };
        match meanings.iter_mut().find(|(known, _)| known == meaning) {
            Some((_, names)) => names.push(writer.name),
            None => meanings.push((meaning, vec![writer.name])),
        }
    }
    let meanings: Vec<String> =
        meanings.into_iter().map(|(meaning, names)| format!("{meaning} ({})", names.join(", "))).collect();
    let text = one_of(&meanings);
    let (first, rest) = text.split_at_checked(1)?;
    Some(format!("{}{rest}.{default}", first.to_uppercase()))
}

/// Lists alternatives: `A, B or C`.
fn one_of(parts: &[String]) -> String {
    match parts {
        [] => String::new(),
        [one] => one.clone(),
        [some @ .., last] => format!("{} or {last}", some.join(", ")),
    }
}
