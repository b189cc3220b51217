//! The axes manifest of an array: JSON ⇄ axes, from full objects and short forms such as `"hemi:4"`.

use super::acquisition::{
    Acquisition, AngleGrid, Angles, AzimuthExtent, Azimuths, NoteKind, Outside, ParseReport, Samples,
};
use super::azimuth::{Closing, circle, closing, merge_repeated};
use super::error::{FormatError, FormatErrorKind};
use super::text::snippet;
use super::{Interpretation, npy};
use crate::domain::limits::{MAX_ENTRIES, MAX_LEVEL};
use crate::domain::{
    Axis, Domain, Layout, Measurement, Quantity, Sampling, Tensor, TriangleMesh, Unit, WavelengthError, WavelengthGrid,
};
use serde_json::{Map, Value, json};

/// The manifest of a tensor, which reads back as the same axes: `quantity`, `value_unit`, `sampling` and `axes`.
pub fn manifest_of(measurement: &Measurement) -> Value {
    let axes: Vec<Value> = measurement.tensor.axes().iter().map(describe).collect();
    json!({
        "quantity": measurement.quantity,
        "value_unit": measurement.unit,
        "sampling": measurement.sampling,
        "axes": axes,
    })
}

fn describe(axis: &Axis) -> Value {
    match axis {
        Axis::Triangles(mesh) => json!({"kind": "triangles", "domain": mesh.domain(), "level": mesh.level()}),
        Axis::Elevation(values) => json!({"kind": "elevation", "values": values}),
        Axis::Wavelength(WavelengthGrid::Even { start, step, count }) => {
            json!({"kind": "wavelength", "start": start, "step": step, "count": count})
        }
        Axis::Wavelength(WavelengthGrid::Uneven(values)) => json!({"kind": "wavelength", "values": values}),
        Axis::Index { count, labels } if labels.is_empty() => json!({"kind": "index", "count": count}),
        Axis::Index { count, labels } => json!({"kind": "index", "count": count, "labels": labels}),
        Axis::Rgb => json!("rgb"),
    }
}

/// The lengths of the axes that `manifest` describes, for data that are made to fit it.
pub(super) fn shape(manifest: &Value, how: &Interpretation) -> Result<Vec<usize>, FormatError> {
    let Some(axes) = manifest.get("axes").and_then(Value::as_array) else {
        return Err(unfit("no list `axes`, expected {\"quantity\": …, \"axes\": […]}"));
    };
    let bare = how.wavelengths.as_deref().and_then(|range| WavelengthGrid::parse_range(range).ok());
    let length = bare.map_or(1, |grid| grid.len());
    let lengths = axes.iter().enumerate().map(|(i, axis)| Ok(described(i, axis, length, how)?.len()));
    lengths.collect()
}

/// Gives `samples` of `shape` (row-major) the axes, quantity and unit that the manifest and the user name.
pub(super) fn interpret(
    manifest: &Value,
    shape: &[usize],
    samples: Vec<f32>,
    how: &Interpretation,
    mut report: ParseReport,
) -> Result<Acquisition, FormatError> {
    let nothing = Map::new();
    let (fields, axes) = match manifest {
        Value::Array(axes) => (&nothing, axes),
        Value::Object(fields) => match fields.get("axes") {
            Some(Value::Array(axes)) => (fields, axes),
            _ => return Err(unfit("no list `axes`, expected {\"quantity\": …, \"axes\": […]}")),
        },
        _ => return Err(unfit("expected {\"quantity\": …, \"axes\": […]}")),
    };
    if axes.len() != shape.len() {
        return Err(unfit(format!("{} axes for an array of {} (shape {shape:?})", axes.len(), shape.len())));
    }
    let quantity = quantity(fields, how, &mut report)?;
    let unit = unit(fields, how, quantity, &mut report)?;
    let sampling = match text(fields, "sampling")? {
        None => Sampling::default(),
        Some(name) => name.parse().map_err(|e: crate::domain::UnknownName| unfit(e.to_string()))?,
    };
    other_fields(fields, &mut report)?;
    let entries: Vec<Entry> = axes
        .iter()
        .zip(shape)
        .enumerate()
        .map(|(i, (axis, &length))| entry(i, axis, length, how))
        .collect::<Result<_, _>>()?;
    let samples = if entries.iter().any(|entry| matches!(entry, Entry::Angle(_))) {
        Samples::Grid(grid(quantity, entries, samples, &mut report)?)
    } else {
        let axes =
            entries.into_iter().filter_map(|entry| if let Entry::Axis(axis) = entry { Some(axis) } else { None });
        let tensor = Tensor::new(axes.collect(), samples).map_err(|e| unfit(e.to_string()))?;
        Layout::of(quantity, tensor.axes()).map_err(|e| unfit(e.to_string()))?;
        Samples::OnAxes { tensor, sampling }
    };
    let dialect = format!("NumPy array of shape {shape:?}");
    Ok(Acquisition { format: npy::NAME, dialect, quantity, unit, samples, spectral_factor: None, report })
}

fn unfit(message: impl std::fmt::Display) -> FormatError {
    FormatError::new(FormatErrorKind::NeedsOption, npy::NAME, format!("manifest: {message}"))
}

fn over_limit(message: impl std::fmt::Display) -> FormatError {
    FormatError::new(FormatErrorKind::OverLimit, npy::NAME, format!("manifest: {message}"))
}

fn wavelength_error(axis: usize, error: &WavelengthError) -> FormatError {
    let message = format!("axis {axis}: {error}");
    if matches!(error, WavelengthError::TooMany { .. }) { over_limit(message) } else { unfit(message) }
}

fn text<'a>(fields: &'a Map<String, Value>, key: &str) -> Result<Option<&'a str>, FormatError> {
    match fields.get(key) {
        None | Some(Value::Null) => Ok(None),
        Some(Value::String(text)) => Ok(Some(text)),
        Some(other) => Err(unfit(format!("`{key}` is {}, expected text", snippet(&other.to_string())))),
    }
}

fn quantity(
    fields: &Map<String, Value>,
    how: &Interpretation,
    report: &mut ParseReport,
) -> Result<Quantity, FormatError> {
    let stated = match text(fields, "quantity")? {
        None => None,
        Some(name) => Some(name.parse::<Quantity>().map_err(|e| unfit(e.to_string()))?),
    };
    match (how.quantity, stated) {
        (Some(asked), Some(stated)) if asked != stated => {
            report.note(NoteKind::Warning, format!("taken as {asked} as asked; the manifest says {stated}"));
            Ok(asked)
        }
        (Some(quantity), _) | (None, Some(quantity)) => Ok(quantity),
        (None, None) => {
            let known: Vec<&str> = Quantity::ALL.iter().map(|quantity| quantity.name()).collect();
            Err(unfit(format!("no quantity, expected `quantity` in it or as an option: {}", known.join(", "))))
        }
    }
}

fn unit(
    fields: &Map<String, Value>,
    how: &Interpretation,
    quantity: Quantity,
    report: &mut ParseReport,
) -> Result<Unit, FormatError> {
    let stated = match text(fields, "value_unit")?.or(text(fields, "unit")?) {
        None => None,
        Some(name) => Some(name.parse::<Unit>().map_err(|e| unfit(e.to_string()))?),
    };
    if let (Some(asked), Some(stated)) = (how.unit, stated)
        && asked != stated
    {
        report.note(NoteKind::Warning, format!("unit taken as {asked} as asked; the manifest says {stated}"));
    }
    Ok(how.unit.or(stated).unwrap_or_else(|| {
        let unit = quantity.default_unit();
        report.note(NoteKind::Assumed, format!("no unit stated, taken as {unit}"));
        unit
    }))
}

/// Keeps what does not matter here as metadata, and refuses what would change the meaning of the numbers.
fn other_fields(fields: &Map<String, Value>, report: &mut ParseReport) -> Result<(), FormatError> {
    for (key, value) in fields {
        match (key.as_str(), value) {
            ("axes" | "quantity" | "value_unit" | "unit" | "sampling", _) | ("cosine_included", Value::Bool(false)) => {
            }
            ("cosine_included", _) => {
                return Err(unfit("cosine_included: expected false; divide by |cos theta_o| before sending"));
            }
            ("valid" | "sigma", _) => {
                report.note(NoteKind::Skipped, format!("`{key}` names another file, which is not opened"));
            }
            (_, Value::String(text)) => report.metadata.push((key.clone(), text.clone())),
            _ => report.metadata.push((key.clone(), value.to_string())),
        }
    }
    Ok(())
}

/// One axis of a manifest.
enum Entry {
    Axis(Axis),
    Angle(Angle),
}

impl Entry {
    fn len(&self) -> usize {
        match self {
            Self::Axis(axis) => axis.len(),
            Self::Angle(angle) => angle.values.len(),
        }
    }
}

struct Angle {
    /// Position of the axis, for messages.
    axis: usize,
    role: Role,
    values: Vec<f64>,
    covers: Option<(f64, f64)>,
    extent: Option<AzimuthExtent>,
}

/// The order of axes in a grid of angles.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Role {
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
                     an object with `kind` triangles, wavelength, elevation, theta_i, phi_i, theta_o, phi_o or index";

/// What `value` describes; `length` is that of an axis that does not say its own.
fn described(axis: usize, value: &Value, length: usize, how: &Interpretation) -> Result<Entry, FormatError> {
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

/// What `value` describes, for an array of `length` there.
fn entry(axis: usize, value: &Value, length: usize, how: &Interpretation) -> Result<Entry, FormatError> {
    let entry = described(axis, value, length, how)?;
    let what = match &entry {
        Entry::Axis(axis) => axis.describe(),
        Entry::Angle(_) => "the angles listed".to_owned(),
    };
    let found = entry.len();
    if found != length {
        return Err(unfit(format!("axis {axis}: {found} entries ({what}), the array has {length} there")));
    }
    Ok(entry)
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

/// `"lambda"` without numbers: the user names the wavelengths, and their number must be the array's.
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
            "axis {axis}: the wavelengths {} are {}, the array has {length} there",
            snippet(range),
            grid.len()
        )));
    }
    Ok(Axis::Wavelength(grid))
}

/// An axis object and its position.
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
        value.ok_or_else(|| self.unfit(format!("no number `{key}`")))
    }

    fn whole(&self, key: &str) -> Result<u64, FormatError> {
        let value = self.fields.get(key).and_then(Value::as_u64);
        value.ok_or_else(|| self.unfit(format!("no whole number `{key}`")))
    }

    fn numbers(&self, key: &str) -> Result<Vec<f64>, FormatError> {
        let Some(Value::Array(values)) = self.fields.get(key) else {
            return Err(self.unfit(format!("no list `{key}`, expected numbers (files are not opened)")));
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
                        label.as_str().map(str::to_owned).ok_or_else(|| object.unfit("a label that is no text"))
                    })
                    .collect::<Result<_, _>>()?,
                Some(_) => return Err(object.unfit("`labels`, expected a list of text")),
            };
            let count = if object.has("count") { object.whole("count")? as usize } else { length };
            Ok(Some(Axis::Index { count, labels }))
        }
        _ => Ok(None),
    }
}

fn angle(object: &Object<'_>, role: Role) -> Result<Angle, FormatError> {
    object.only(if role.is_azimuth() { &["values", "extent"] } else { &["values", "covers"] })?;
    object.unit(DEGREES)?;
    let values = object.numbers("values")?;
    if values.is_empty() {
        return Err(object.unfit("no angles"));
    }
    if let Some(&[a, b]) = values.array_windows().find(|[a, b]| b <= a) {
        return Err(object.unfit(format!("{b}° after {a}°, expected strictly increasing angles")));
    }
    let covers = if object.has("covers") {
        let &[low, high] = object.numbers("covers")?.as_slice() else {
            return Err(object.unfit("`covers`, expected [first, last]"));
        };
        Some((low, high))
    } else {
        None
    };
    let extent = match text(object.fields, "extent")? {
        None => None,
        Some("circle") => Some(AzimuthExtent::Circle),
        Some("mirrored") => Some(AzimuthExtent::Mirrored),
        Some("sector") => Some(AzimuthExtent::Sector),
        Some(other) => {
            return Err(object.unfit(format!("extent {}, expected circle, mirrored or sector", snippet(other))));
        }
    };
    Ok(Angle { axis: object.axis, role, values, covers, extent })
}

/// Puts angle axes together; they must come in the order of [`Role`].
fn grid(
    quantity: Quantity,
    entries: Vec<Entry>,
    mut values: Vec<f32>,
    report: &mut ParseReport,
) -> Result<AngleGrid, FormatError> {
    let mut lengths: Vec<usize> = entries.iter().map(Entry::len).collect();
    let (mut index, mut spectral, mut angles) = (Vec::new(), None, [const { None::<Angle> }; 4]);
    let mut last = Role::Index;
    for (i, entry) in entries.into_iter().enumerate() {
        let role = match &entry {
            Entry::Angle(angle) => angle.role,
            Entry::Axis(Axis::Index { .. }) => Role::Index,
            Entry::Axis(axis) if axis.is_spectral() => Role::Spectral,
            Entry::Axis(axis) => {
                return Err(unfit(format!(
                    "axis {i}: {} beside angles, expected angles for both directions",
                    axis.describe()
                )));
            }
        };
        if role < last || (role == last && role != Role::Index) {
            return Err(unfit(format!(
                "axis {i}: expected the order index, theta_i, phi_i, theta_o, phi_o, wavelength, each once (transpose the array)"
            )));
        }
        last = role;
        match entry {
            Entry::Angle(angle) => angles[role as usize - 1] = Some(angle),
            Entry::Axis(axis) if role == Role::Index => index.push(axis),
            Entry::Axis(axis) => spectral = Some(axis),
        }
    }
    let [theta_i, phi_i, theta_o, phi_o] = angles;
    let expected = match quantity {
        Quantity::Spectrum => return Err(unfit("a spectrum has no angles")),
        Quantity::Reflectance => (true, false),
        Quantity::Edf => (false, true),
        Quantity::Brdf | Quantity::Btdf | Quantity::Bsdf | Quantity::Phase => (true, true),
    };
    if (theta_i.is_some(), theta_o.is_some()) != expected {
        let names = match expected {
            (true, true) => "theta_i and theta_o",
            (true, false) => "theta_i alone",
            _ => "theta_o alone",
        };
        return Err(unfit(format!(
            "a {quantity} on a grid of angles, expected {names} (with phi where it was measured)"
        )));
    }
    let isotropic = expected == (true, true) && phi_i.is_none();
    // The inner azimuths first: closing them changes the stride of the outer ones.
    let phi_o = azimuths(phi_o, isotropic, &mut lengths, &mut values, report)?;
    let phi_i = azimuths(phi_i, false, &mut lengths, &mut values, report)?;
    let theta_range = |theta_o: bool| match (quantity, theta_o) {
        (Quantity::Brdf, _) | (Quantity::Reflectance | Quantity::Btdf | Quantity::Bsdf, false) => (0.0, 90.0),
        (Quantity::Btdf, true) => (90.0, 180.0),
        _ => (0.0, 180.0),
    };
    let incoming = theta_i.map(|theta| polar(theta, phi_i, theta_range(false))).transpose()?;
    let outgoing = theta_o.map(|theta| polar(theta, phi_o, theta_range(true))).transpose()?;
    Ok(AngleGrid { index, incoming, outgoing, spectral, outside: Outside::Masked, values })
}

fn polar(theta: Angle, phi: Option<Azimuths>, (low, high): (f64, f64)) -> Result<Angles, FormatError> {
    let Angle { axis, values, .. } = theta;
    let (first, last) = (values[0], values[values.len() - 1]);
    let covers = theta.covers.unwrap_or((first, last));
    if first < low || last > high {
        return Err(unfit(format!("axis {axis}: theta from {first}° to {last}°, expected within {low}° to {high}°")));
    }
    if !(low <= covers.0 && covers.0 <= first && last <= covers.1 && covers.1 <= high) {
        return Err(unfit(format!(
            "axis {axis}: covers {}° to {}°, expected a range from {low}° to {high}° around the angles",
            covers.0, covers.1
        )));
    }
    Ok(Angles { theta: values, covers, phi })
}

fn azimuths(
    phi: Option<Angle>,
    mirror: bool,
    lengths: &mut [usize],
    values: &mut Vec<f32>,
    report: &mut ParseReport,
) -> Result<Option<Azimuths>, FormatError> {
    let Some(phi) = phi else { return Ok(None) };
    let axis = phi.axis;
    let azimuths = extent(phi, mirror, lengths[axis + 1..].iter().product(), values, report)?;
    lengths[axis] = azimuths.phi.len();
    Ok(Some(azimuths))
}

/// What the azimuths stand for: as stated, else as their spacing tells.
fn extent(
    phi: Angle,
    mirror: bool,
    inner: usize,
    values: &mut Vec<f32>,
    report: &mut ParseReport,
) -> Result<Azimuths, FormatError> {
    let Angle { axis, values: mut angles, extent, .. } = phi;
    let (first, last) = (angles[0], angles[angles.len() - 1]);
    if first < -360.0 || last > 720.0 || last - first > 360.0 {
        return Err(unfit(format!("axis {axis}: azimuths from {first}° to {last}°, expected at most one turn")));
    }
    match (extent, closing(&angles)) {
        (None | Some(AzimuthExtent::Circle | AzimuthExtent::Sector), Closing::Repeated) => {
            let difference = merge_repeated(&mut angles, values, inner);
            if difference > 0.0 {
                let percent = 100.0 * difference;
                report.note(
                    NoteKind::Warning,
                    format!("axis {axis}: values at {first}° and {last}° differ by up to {percent:.2} %, averaged"),
                );
            }
            Ok(circle(angles))
        }
        (Some(AzimuthExtent::Circle), _) | (None, Closing::Open) => Ok(circle(angles)),
        (Some(AzimuthExtent::Mirrored), _) if first < 0.0 || last > 180.0 => {
            Err(unfit(format!("axis {axis}: mirrored azimuths from {first}° to {last}°, expected 0° to 180°")))
        }
        (None, Closing::Gap) if mirror && first == 0.0 && last == 180.0 => {
            report.note(
                NoteKind::Assumed,
                format!(
                    "axis {axis}: isotropic, azimuths 0° to 180° taken as mirrored (else say \"extent\": \"sector\")"
                ),
            );
            Ok(Azimuths { phi: angles, extent: AzimuthExtent::Mirrored })
        }
        (None, Closing::Gap) => {
            report.note(
                NoteKind::Assumed,
                format!(
                    "axis {axis}: azimuths {first}° to {last}° taken as all there is, the rest of the circle is masked"
                ),
            );
            Ok(Azimuths { phi: angles, extent: AzimuthExtent::Sector })
        }
        (Some(extent), _) => Ok(Azimuths { phi: angles, extent }),
    }
}
