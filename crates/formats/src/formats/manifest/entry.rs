//! Parser of one axis of a manifest: a short form or an object, checked against the array's length on that axis.

use super::fields::{named, text};
use super::refusal::{over_limit, unfit};
use crate::domain::limits::{MAX_ENTRIES, MAX_LEVEL};
use crate::domain::{Axis, Azimuths, DirectionGrid, Domain, Outside, TriangleMesh, WavelengthError, WavelengthGrid};
use crate::formats::acquisition::AzimuthExtent;
use crate::formats::error::FormatError;
use crate::formats::interpretation::Interpretation;
use crate::formats::text::{Brief, snippet};
use serde_json::{Map, Value};

/// One axis of an array according to its manifest: a complete axis, or one angle of a grid.
pub(super) enum Entry {
    Axis(Axis),
    Angle(Angle),
}

impl Entry {
    /// Returns the number of entries along the axis.
    pub(super) fn len(&self) -> usize {
        match self {
            Self::Axis(axis) => axis.len(),
            Self::Angle(angle) => angle.values.len(),
        }
    }
}

pub(super) struct Angle {
    /// Number of the axis in the array, from 0, for messages.
    pub(super) axis: usize,
    pub(super) role: Role,
    pub(super) values: Vec<f64>,
    pub(super) covers: Option<(f64, f64)>,
    pub(super) extent: Option<AzimuthExtent>,
}

/// Kind of an axis in a grid of angles, in the order in which the axes must come.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Role {
    Index,
    ThetaI,
    PhiI,
    ThetaO,
    PhiO,
    Spectral,
}

impl Role {
    fn of(name: &str) -> Option<Self> {
        match name {
            "theta_i" => Some(Self::ThetaI),
            "phi_i" => Some(Self::PhiI),
            "theta_o" => Some(Self::ThetaO),
            "phi_o" => Some(Self::PhiO),
            _ => None,
        }
    }

    fn is_azimuth(self) -> bool {
        matches!(self, Self::PhiI | Self::PhiO)
    }
}

const KINDS: &str = "\"hemi:LEVEL\", \"lower:LEVEL\", \"sphere:LEVEL\", \"lambda:START:STEP:COUNT\", \"rgb\", \"index\", or \
                     an object with `kind` triangles, directions, wavelength, elevation, theta_i, phi_i, theta_o, phi_o or index";

/// Parses axis number `axis` of a manifest, and refuses it if it does not have `length` entries as the array has.
pub(super) fn parse(axis: usize, value: &Value, length: usize, how: &Interpretation) -> Result<Entry, FormatError> {
    let entry = described(axis, value, length, how)?;
    let what = match &entry {
        Entry::Axis(axis) => axis.describe(),
        Entry::Angle(_) => "the angles listed".to_owned(),
    };
    let found = entry.len();
    if found != length {
        return Err(unfit(format!("axis {axis}: {found} entries ({what}), expected {length} as the array has there")));
    }
    Ok(entry)
}

/// Parses axis number `axis` of a manifest. `length` is the number of entries of an axis that does not state its own.
pub(super) fn described(axis: usize, value: &Value, length: usize, how: &Interpretation) -> Result<Entry, FormatError> {
    let unknown = |found: &str| unfit(format!("axis {axis}: found {}, expected {KINDS}", snippet(found)));
    let entry = match value {
        Value::String(short) => short_form(axis, short, length, how)?.map(Entry::Axis),
        Value::Object(fields) => {
            let kind = match text(fields, "kind")? {
                Some(kind) => kind,
                None => text(fields, "name")?.ok_or_else(|| unknown(&value.to_string()))?,
            };
            match (Role::of(kind), Object { axis, fields }) {
                (Some(role), object) => Some(Entry::Angle(angle(&object, role)?)),
                (None, object) => full_form(&object, kind, length, how)?.map(Entry::Axis),
            }
        }
        _ => None,
    };
    entry.ok_or_else(|| unknown(&value.to_string()))
}

fn short_form(axis: usize, short: &str, length: usize, how: &Interpretation) -> Result<Option<Axis>, FormatError> {
    let (kind, rest) = short.split_once(':').map_or((short, None), |(kind, rest)| (kind, Some(rest)));
    match (kind, rest) {
        ("rgb", None) => Ok(Some(Axis::Rgb)),
        ("index", None) => Ok(Some(Axis::Index { count: length, labels: Vec::new() })),
        ("lambda" | "wavelength", None) => bare_wavelengths(axis, length, how).map(Some),
        ("lambda" | "wavelength", Some(range)) => {
            let parts: Vec<&str> = range.split(':').collect();
            let &[start, step, count] = parts.as_slice() else { return Ok(None) };
            let (Ok(start), Ok(step), Ok(count)) = (start.parse(), step.parse(), count.parse()) else {
                return Ok(None);
            };
            let grid = WavelengthGrid::even(start, step, count).map_err(|e| wavelength_error(axis, &e))?;
            Ok(Some(Axis::Wavelength(grid)))
        }
        (domain, Some(level)) => {
            let (Some(domain), Ok(level)) = (domain_of(domain), level.parse()) else { return Ok(None) };
            triangles(axis, domain, level).map(Some)
        }
        _ => Ok(None),
    }
}

fn domain_of(name: &str) -> Option<Domain> {
    if name == "hemi" { Some(Domain::Hemisphere) } else { name.parse().ok() }
}

fn triangles(axis: usize, domain: Domain, level: u64) -> Result<Axis, FormatError> {
    let mesh = u8::try_from(level).ok().and_then(|level| TriangleMesh::new(domain, level));
    let mesh = mesh.ok_or_else(|| over_limit(format!("axis {axis}: level {level}, expected 0 to {MAX_LEVEL}")))?;
    Ok(Axis::Triangles(mesh))
}

/// Returns the wavelength axis for `"lambda"` without numbers: the user names the wavelengths, and their count must
/// match the array's length.
fn bare_wavelengths(axis: usize, length: usize, how: &Interpretation) -> Result<Axis, FormatError> {
    let Some(range) = &how.wavelengths else {
        return Err(unfit(format!(
            "axis {axis}: \"lambda\" does not say which {length} wavelengths, expected the option \
             wavelengths=START:STOP:STEP in nm, or \"lambda:START:STEP:COUNT\" in the manifest"
        )));
    };
    let grid = WavelengthGrid::parse_range(range).map_err(|e| wavelength_error(axis, &e))?;
    if grid.len() != length {
        return Err(unfit(format!(
            "axis {axis}: the range {} has {} wavelengths, expected {length} as the array has there",
            snippet(range),
            grid.len()
        )));
    }
    Ok(Axis::Wavelength(grid))
}

/// JSON object that describes an axis, and the number of the axis.
struct Object<'a> {
    axis: usize,
    fields: &'a Map<String, Value>,
}

impl Object<'_> {
    fn unfit(&self, message: impl std::fmt::Display) -> FormatError {
        unfit(format!("axis {}: {message}", self.axis))
    }

    fn only(&self, allowed: &[&str]) -> Result<(), FormatError> {
        let known = |key: &str| allowed.contains(&key) || matches!(key, "kind" | "name" | "unit");
        match self.fields.keys().find(|key| !known(key)) {
            None => Ok(()),
            Some(key) => Err(self.unfit(format!("field {}, expected {}", snippet(key), allowed.join(", ")))),
        }
    }

    fn has(&self, key: &str) -> bool {
        self.fields.contains_key(key)
    }

    fn number(&self, key: &str) -> Result<f64, FormatError> {
        let value = self.fields.get(key).and_then(Value::as_f64);
        value.ok_or_else(|| self.unfit(format!("field `{key}` is missing or not a number, expected a number")))
    }

    fn whole(&self, key: &str) -> Result<u64, FormatError> {
        let value = self.fields.get(key).and_then(Value::as_u64);
        value.ok_or_else(|| self.unfit(format!("field `{key}` is missing or not a whole number, expected one from 0")))
    }

    fn numbers(&self, key: &str) -> Result<Vec<f64>, FormatError> {
        let Some(Value::Array(values)) = self.fields.get(key) else {
            return Err(self.unfit(format!(
                "field `{key}` is missing or not a list, expected a list of numbers (files are not opened)"
            )));
        };
        if values.len() > MAX_ENTRIES {
            return Err(over_limit(format!(
                "axis {}: {} entries, expected at most {MAX_ENTRIES}",
                self.axis,
                values.len()
            )));
        }
        let number = |value: &Value| {
            value
                .as_f64()
                .ok_or_else(|| self.unfit(format!("`{key}` holds {}, expected a number", snippet(&value.to_string()))))
        };
        values.iter().map(number).collect()
    }

    fn unit(&self, known: &[(&str, f64)]) -> Result<f64, FormatError> {
        let Some(unit) = text(self.fields, "unit")? else { return Ok(1.0) };
        let factor = known.iter().find(|(name, _)| *name == unit).map(|&(_, factor)| factor);
        factor.ok_or_else(|| {
            let names: Vec<&str> = known.iter().map(|&(name, _)| name).collect();
            self.unfit(format!("unit {}, expected {}", snippet(unit), names.join(", ")))
        })
    }
}

const DEGREES: &[(&str, f64)] = &[("deg", 1.0), ("degrees", 1.0)];
const NANOMETRES: &[(&str, f64)] = &[("nm", 1.0), ("um", 1000.0)];

fn full_form(
    object: &Object<'_>,
    kind: &str,
    length: usize,
    how: &Interpretation,
) -> Result<Option<Axis>, FormatError> {
    match kind {
        "triangles" => {
            object.only(&["domain", "level"])?;
            let domain = text(object.fields, "domain")?.and_then(domain_of);
            let domain = domain.ok_or_else(|| object.unfit("no `domain`, expected hemisphere, lower or sphere"))?;
            triangles(object.axis, domain, object.whole("level")?).map(Some)
        }
        "directions" => directions(object).map(|grid| Some(Axis::Grid(grid))),
        "wavelength" | "lambda" => {
            object.only(&["start", "step", "count", "values"])?;
            let factor = object.unit(NANOMETRES)?;
            let grid = if object.has("values") {
                WavelengthGrid::listed(object.numbers("values")?.into_iter().map(|v| v * factor).collect())
            } else if object.has("start") {
                let count = usize::try_from(object.whole("count")?).unwrap_or(usize::MAX);
                WavelengthGrid::even(object.number("start")? * factor, object.number("step")? * factor, count)
            } else {
                return bare_wavelengths(object.axis, length, how).map(Some);
            };
            Ok(Some(Axis::Wavelength(grid.map_err(|e| wavelength_error(object.axis, &e))?)))
        }
        "elevation" => {
            object.only(&["values"])?;
            object.unit(DEGREES)?;
            Ok(Some(Axis::Elevation(object.numbers("values")?)))
        }
        "rgb" => Ok(Some(Axis::Rgb)),
        "index" => {
            object.only(&["count", "labels"])?;
            let labels = match object.fields.get("labels") {
                None => Vec::new(),
                Some(Value::Array(labels)) => labels
                    .iter()
                    .map(|label| {
                        label
                            .as_str()
                            .map(str::to_owned)
                            .ok_or_else(|| object.unfit("a label in `labels` is not text, expected a list of text"))
                    })
                    .collect::<Result<_, _>>()?,
                Some(_) => return Err(object.unfit("`labels` is not a list, expected a list of text")),
            };
            let count = if object.has("count") { object.whole("count")? as usize } else { length };
            Ok(Some(Axis::Index { count, labels }))
        }
        _ => Ok(None),
    }
}

/// Returns the grid of directions that forms one axis of an array, `[polar, azimuth]` row-major.
fn directions(object: &Object<'_>) -> Result<DirectionGrid, FormatError> {
    object.only(&["frame", "polar", "azimuths", "extent", "covers", "outside", "mirrored"])?;
    object.unit(DEGREES)?;
    let need = |key: &str| text(object.fields, key)?.ok_or_else(|| object.unfit(format!("no `{key}`, expected one")));
    let azimuths = if object.has("azimuths") {
        Some(Azimuths { angles: object.numbers("azimuths")?, extent: named(need("extent")?)? })
    } else {
        None
    };
    let made = |made: Result<DirectionGrid, _>| made.map_err(|e| object.unfit(e));
    let mut grid = made(DirectionGrid::new(named(need("frame")?)?, object.numbers("polar")?, azimuths))?;
    if let Some((low, high)) = covers(object)? {
        grid = made(grid.covering(low, high))?;
    }
    if let Some(outside) = text(object.fields, "outside")? {
        grid = grid.with_outside(named::<Outside>(outside)?);
    }
    match object.fields.get("mirrored") {
        None | Some(Value::Bool(false)) => Ok(grid),
        Some(Value::Bool(true)) => made(grid.mirrored()),
        Some(other) => {
            Err(object.unfit(format!("`mirrored` is {}, expected true or false", snippet(&other.to_string()))))
        }
    }
}

/// Returns the field `covers`: the first and the last polar angle, in degrees, of the range in which the grid has
/// values. Returns `None` if the field is absent.
fn covers(object: &Object<'_>) -> Result<Option<(f64, f64)>, FormatError> {
    if !object.has("covers") {
        return Ok(None);
    }
    match object.numbers("covers")?.as_slice() {
        &[low, high] => Ok(Some((low, high))),
        _ => Err(object.unfit("`covers` has not two numbers, expected [first, last] in degrees")),
    }
}

fn angle(object: &Object<'_>, role: Role) -> Result<Angle, FormatError> {
    object.only(if role.is_azimuth() { &["values", "extent"] } else { &["values", "covers"] })?;
    object.unit(DEGREES)?;
    let values = object.numbers("values")?;
    if values.is_empty() {
        return Err(object.unfit("no angles in `values`, expected at least one"));
    }
    if let Some(&[a, b]) = values.array_windows().find(|[a, b]| b <= a) {
        return Err(object.unfit(format!(
            "{b}° after {a}°, expected strictly increasing angles",
            a = Brief(a),
            b = Brief(b)
        )));
    }
    let covers = covers(object)?;
    let extent = match text(object.fields, "extent")? {
        None => None,
        Some("circle") => Some(AzimuthExtent::Circle),
        Some("mirrored") => Some(AzimuthExtent::Mirrored),
        Some("sector") => Some(AzimuthExtent::Sector),
        Some(other) => {
            return Err(object.unfit(format!("`extent` is {}, expected circle, mirrored or sector", snippet(other))));
        }
    };
    Ok(Angle { axis: object.axis, role, values, covers, extent })
}

fn wavelength_error(axis: usize, error: &WavelengthError) -> FormatError {
    let message = format!("axis {axis}: {error}");
    if matches!(error, WavelengthError::TooMany { .. }) { over_limit(message) } else { unfit(message) }
}
