//! Choice of one emitter of a TM-33 file, and of one distribution of the emitter.
//!
//! Emitters stand at places of their own and may be dimmed apart, so that their intensities are not added up.

use super::about::NAME;
use super::distribution::{Distribution, Metric};
use super::document::Emitter;
use crate::domain::Unit;
use crate::formats::acquisition::ParseReport;
use crate::formats::error::{FormatError, FormatErrorKind};
use crate::formats::interpretation::Interpretation;
use crate::formats::text::{Source, snippet};
use crate::notes::LuminaireNote;

/// Names by which an emitter is asked for.
const NAMES: [&str; 4] = ["ID", "Id", "Description", "CatalogNumber"];
/// Upper bound on the number of emitters that a message lists.
const SHOWN: usize = 10;

fn needs(message: String) -> FormatError {
    FormatError::new(FormatErrorKind::NeedsOption, NAME, message)
}

/// Returns the index of the emitter that the user asks for, or else of the only one that has intensities.
pub(super) fn emitter(
    emitters: &[Emitter],
    how: &Interpretation,
    source: &Source,
    report: &mut ParseReport,
) -> Result<usize, FormatError> {
    let end = source.text().len();
    if emitters.is_empty() {
        return Err(source.malformed(end, "no element Emitter, expected one or more"));
    }
    if let Some(wanted) = &how.column {
        let by_number = wanted.parse().ok().and_then(|number: usize| number.checked_sub(1));
        let is_named = |emitter: &Emitter| {
            NAMES.iter().filter_map(|name| emitter.field(name)).any(|name| name.eq_ignore_ascii_case(wanted))
        };
        return by_number
            .filter(|&at| at < emitters.len())
            .or_else(|| emitters.iter().position(is_named))
            .ok_or_else(|| needs(format!("no emitter {}, expected one of: {}", snippet(wanted), listed(emitters))));
    }
    let mut lit = emitters.iter().enumerate().filter(|(_, emitter)| emitter.has_intensities());
    match (lit.next(), lit.count()) {
        (None, _) => {
            let mut found: Vec<&str> = emitters.iter().flat_map(|emitter| emitter.unread.iter().copied()).collect();
            found.sort_unstable();
            found.dedup();
            let found = if found.is_empty() { String::new() } else { format!(" but {}", found.join(", ")) };
            let message = format!("no intensities by direction{found}, expected {EXPECTED}");
            Err(source.error(FormatErrorKind::Unsupported, end, message))
        }
        (Some((only, _)), 0) => {
            if emitters.len() > 1 {
                report.note(LuminaireNote::OnlyEmitter { number: only + 1, of: emitters.len() });
            }
            Ok(only)
        }
        (Some(_), _) => Err(needs(format!(
            "{} emitters, whose intensities are not added up, expected the option column, the number or name of one: {}",
            emitters.len(),
            listed(emitters)
        ))),
    }
}

/// Elements of which a distribution is read.
const EXPECTED: &str = "LuminousData, RadiantData or PhotonData";

/// Returns the numbers and names of emitters for messages.
fn listed(emitters: &[Emitter]) -> String {
    let name = |emitter: &Emitter| NAMES.iter().find_map(|name| emitter.field(name)).map(snippet);
    let shown = emitters.iter().take(SHOWN).enumerate();
    let shown: Vec<String> =
        shown.map(|(at, emitter)| format!("{} ({})", at + 1, name(emitter).unwrap_or_default())).collect();
    let more = emitters.len().saturating_sub(SHOWN);
    format!("{}{}", shown.join(", "), if more > 0 { format!(" and {more} more") } else { String::new() })
}

/// Takes the distribution in the unit that the user asks for out of an emitter, or else the first of luminous, radiant
/// and photon intensities that it has.
pub(super) fn distribution(
    emitter: &mut Emitter,
    how: &Interpretation,
    source: &Source,
    report: &mut ParseReport,
) -> Result<Distribution, FormatError> {
    let mut found: Vec<Distribution> = std::mem::take(&mut emitter.distributions);
    found.retain(|distribution| !distribution.points.is_empty());
    let has = |metric: Metric| found.iter().any(|distribution| distribution.metric == metric);
    let held: Vec<Metric> =
        [Metric::Luminous, Metric::Radiant, Metric::Photon].into_iter().filter(|&m| has(m)).collect();
    let Some(&first) = held.first() else {
        return Err(needs(format!("the emitter has no intensities by direction, expected {EXPECTED}")));
    };
    let units = || held.iter().map(|metric| metric.unit().name()).collect::<Vec<_>>().join(", ");
    let wanted = match how.unit.filter(|&unit| unit != Unit::Relative) {
        None => first,
        Some(Unit::CandelaPerKilolumen) if has(Metric::Luminous) => Metric::Luminous,
        Some(unit) => *held
            .iter()
            .find(|metric| metric.unit() == unit)
            .ok_or_else(|| needs(format!("unit {unit} was asked for, expected what the emitter has: {}", units())))?,
    };
    if held.len() > 1 && how.unit.is_none() {
        report.note(LuminaireNote::OneOfUnits { unit: wanted.unit(), units: units() });
    }
    let mut of_metric = found.into_iter().filter(|distribution| distribution.metric == wanted);
    match (of_metric.next(), of_metric.next()) {
        (Some(_), Some(second)) => {
            let message = format!("a second {} in one emitter, expected one", wanted.name());
            Err(source.error(FormatErrorKind::Unsupported, second.offset, message))
        }
        (Some(only), None) if how.unit == Some(Unit::CandelaPerKilolumen) && only.is_absolute == Some(true) => {
            Err(needs(
                "unit cd/klm was asked for, but the file says that its photometry is absolute: expected cd".to_owned(),
            ))
        }
        (Some(only), None) => Ok(only),
        (None, _) => Err(needs(format!("the emitter has no intensities in {}", wanted.unit()))),
    }
}
