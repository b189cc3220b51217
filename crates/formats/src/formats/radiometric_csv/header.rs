//! Header of a radiometric-csv file: the `# key: value` lines that define the numbers.

use super::about::NAME;
use super::names::ValueUnit;
use super::problems::Problems;
use crate::domain::{Quantity, Unit};
use crate::formats::acquisition::{AzimuthExtent, ParseReport, Samples};
use crate::formats::error::{FormatError, FormatErrorKind};
use crate::formats::instrument::{self, Instrument};
use crate::formats::interpretation::Interpretation;
use crate::formats::normalization::Normalization;
use crate::formats::spectral_table::wavelength_unit::WavelengthUnit;
use crate::formats::stated::StatedQuantity;
use crate::formats::text::snippet;
use crate::notes::ValueNote;

/// One line `# key: value` in the header of a radiometric-csv file.
pub(super) struct Field {
    /// Key of the header line in lower case.
    pub(super) key: String,
    pub(super) value: String,
    pub(super) line: usize,
}

/// Contents of the header of a radiometric-csv file, after checks.
#[allow(clippy::struct_excessive_bools, reason = "each is a yes or no of the file")]
pub(super) struct Header {
    pub(super) quantity: Quantity,
    pub(super) unit: Unit,
    /// True if the values are reflectance factors, which are π times the BRDF.
    pub(super) is_factor: bool,
    /// True if the values are in percent.
    pub(super) is_percent: bool,
    /// True if angles are in radians, false if in degrees.
    pub(super) radians: bool,
    pub(super) wavelength_unit: WavelengthUnit,
    /// True if the file does not state the unit of wavelengths, so that it was assumed.
    pub(super) wavelength_unit_assumed: bool,
    /// True if the values include the cosine of the outgoing direction: `f · |cos theta_o|`.
    pub(super) cosine_included: bool,
    pub(super) isotropic: bool,
    /// True if angles are the luminaire angles C and gamma; `None` if the file does not state it.
    pub(super) luminaire: Option<bool>,
    /// Extents of the incoming and of the outgoing azimuths (full circle, mirrored half or sector); `None` where the
    /// file does not state one.
    pub(super) extents: [Option<AzimuthExtent>; 2],
    /// Range of theta in degrees in which the values are valid, for the incoming and for the outgoing directions;
    /// `None` if the file does not state it.
    pub(super) covers: [Option<(f64, f64)>; 2],
    /// Normalisation of a phase function: its integral over the sphere, if known.
    pub(super) normalization: Option<Normalization>,
    pub(super) instrument: Instrument,
}

impl Header {
    /// Returns the header of a radiometric CSV file for a BRDF in 1/sr, with angles in degrees and no optional fields.
    pub(super) fn of_brdf(isotropic: bool) -> Self {
        Self {
            quantity: Quantity::Brdf,
            unit: Unit::PerSteradian,
            is_factor: false,
            is_percent: false,
            radians: false,
            wavelength_unit: WavelengthUnit::Nanometre,
            wavelength_unit_assumed: false,
            cosine_included: false,
            isotropic,
            luminaire: None,
            extents: [None; 2],
            covers: [None; 2],
            normalization: None,
            instrument: Instrument::default(),
        }
    }

    /// Returns the unit of the samples after reading. A phase function over the scattering angle is normalised to 1/sr.
    pub(super) fn unit_of(&self, samples: &Samples) -> Unit {
        if matches!(samples, Samples::Function(_)) { Unit::PerSteradian } else { self.unit }
    }
}

/// Look-up of header lines by key, which records unreadable and repeated lines as problems of the file.
struct Fields<'a> {
    fields: &'a [Field],
    problems: &'a mut Problems,
}

impl Fields<'_> {
    /// Returns the value of the header field `key` parsed by `parse`; adds a problem if it is unreadable or stated
    /// twice.
    fn value<T>(&mut self, key: &str, expected: &str, parse: impl Fn(&str) -> Option<T>) -> Option<T> {
        let mut found = self.fields.iter().filter(|field| field.key == key);
        let field = found.next()?;
        if let Some(again) = found.next() {
            self.problems.add(again.line, 1, || format!("`{key}` twice, expected once"));
        }
        let value = parse(&field.value.to_lowercase());
        if value.is_none() {
            self.problems.add(field.line, 1, || format!("{key} {}, expected {expected}", snippet(&field.value)));
        }
        value
    }

    /// Returns the key that states the unit of the values: `value_unit`, or `unit` in its place.
    fn unit_key(&self) -> &'static str {
        if !self.stated("value_unit") && self.stated("unit") { "unit" } else { "value_unit" }
    }

    fn stated(&self, key: &str) -> bool {
        self.fields.iter().any(|field| field.key == key)
    }
}

/// Keys of the header that are not kept as keywords.
pub(super) const KNOWN: &[&str] = &[
    NAME,
    "quantity",
    "value_unit",
    "cosine_included",
    "angle_unit",
    "wavelength_unit",
    "direction_convention",
    "frame",
    "isotropic",
    "phi_i_extent",
    "phi_o_extent",
    "theta_i_covers",
    "theta_o_covers",
    "wavelengths",
    "radiometric-arrow",
];

/// Reads the header of a radiometric-csv file. Returns `None` after adding at least one problem if required keys are
/// missing or wrong.
pub(super) fn read(
    fields: &[Field],
    how: &Interpretation,
    report: &mut ParseReport,
    problems: &mut Problems,
) -> Result<Option<Header>, FormatError> {
    // Keys without text lines have line 0; a missing key then has no position.
    let first = fields.first().map_or(1, |field| field.line.min(1));
    let mut header = Fields { fields, problems };
    header.value(NAME, "1 (the version of the format)", |v| (v == "1").then_some(()));
    let stated = header.value("quantity", &StatedQuantity::names(), StatedQuantity::in_file);
    let Some(kind) = how.quantity.or(stated) else {
        if header.stated("quantity") {
            return Ok(None);
        }
        let message = format!("`quantity` is not stated, expected it, or the option: {}", StatedQuantity::names());
        return Err(FormatError::new(FormatErrorKind::NeedsOption, NAME, message));
    };
    if let Some(stated) = stated.filter(|stated| *stated != kind) {
        report.note(ValueNote::QuantityAsAsked { asked: kind.to_string(), stated: stated.to_string(), source: "file" });
    }
    let (quantity, is_factor) = (kind.quantity(), kind.is_factor());
    let unit_key = header.unit_key();
    if unit_key == "unit" {
        report.note(ValueNote::UnitForValueUnit);
    }
    let is_percent = how.unit.is_none()
        && (is_factor || quantity == Quantity::Reflectance)
        && fields.iter().any(|field| field.key == unit_key && ValueUnit::of(&field.value) == Some(ValueUnit::Percent));
    let unit = unit(&mut header, kind, how, report)?;
    let radians = header.value("angle_unit", "deg or rad", |v| match v {
        "deg" | "degree" | "degrees" | "°" => Some(false),
        "rad" | "radian" | "radians" => Some(true),
        _ => None,
    });
    if quantity.directions() > 0 && !header.stated("angle_unit") && quantity != Quantity::Reflectance {
        header.problems.add(first, 1, || "`angle_unit` is not stated, expected deg or rad".to_owned());
    }
    let truth = |v: &str| match v {
        "true" | "yes" => Some(true),
        "false" | "no" => Some(false),
        _ => None,
    };
    let cosine_included = header.value("cosine_included", "true or false", truth);
    if is_factor && cosine_included == Some(true) {
        header.problems.add(first, 1, || {
            "`cosine_included: true` of a reflectance factor, which holds no cosine: expected false".to_owned()
        });
    }
    if quantity.has_cosine() && !is_factor && !header.stated("cosine_included") {
        header.problems.add(first, 1, || {
            format!("`cosine_included` is not stated, expected true or false: whether values of a {quantity} hold |cos theta_o|")
        });
    }
    header.value("direction_convention", "outward: wi and wo both point away from the sample", |v| {
        v.starts_with("outward").then_some(())
    });
    let luminaire = header.value("frame", "surface (theta from the normal) or luminaire (c, gamma from nadir)", |v| {
        [("surface", false), ("luminaire", true)].into_iter().find(|(name, _)| v.starts_with(name)).map(|(_, is)| is)
    });
    let isotropic = header.value("isotropic", "true or false", truth);
    let wavelength_unit_assumed = how.wavelength_unit.is_none() && !header.stated("wavelength_unit");
    let wavelength_unit = wavelength_unit(&mut header, how, report)?;
    let extent = |v: &str| match v {
        "circle" => Some(AzimuthExtent::Circle),
        "mirrored" => Some(AzimuthExtent::Mirrored),
        "sector" => Some(AzimuthExtent::Sector),
        _ => None,
    };
    let extents = ["phi_i_extent", "phi_o_extent"].map(|key| header.value(key, "circle, mirrored or sector", extent));
    let covers = ["theta_i_covers", "theta_o_covers"].map(|key| header.value(key, "two angles in degrees", range));
    let angles = instrument::KEYS.map(|key| header.value(key, instrument::EXPECTED, instrument::angle));
    let is_volume = quantity == Quantity::Phase
        && fields.iter().any(|field| field.key == "value_unit" && field.value.eq_ignore_ascii_case(VOLUME));
    let is_known = |key: &str| KNOWN.contains(&key) || instrument::KEYS.contains(&key) || key == unit_key;
    let other = fields.iter().filter(|field| !is_known(&field.key));
    report.metadata.extend(other.map(|field| (field.key.clone(), field.value.clone())));
    Ok(unit.map(|unit| Header {
        quantity,
        unit,
        is_factor,
        is_percent,
        radians: radians.unwrap_or(false),
        wavelength_unit,
        wavelength_unit_assumed,
        cosine_included: quantity.has_cosine() && cosine_included.unwrap_or(false),
        isotropic: quantity.directions() == 2 && isotropic.unwrap_or(false),
        luminaire,
        extents,
        covers,
        normalization: how.normalization.or(match unit {
            _ if is_volume => Some(Normalization::Vsf),
            Unit::Relative => Some(Normalization::Relative),
            _ => None,
        }),
        instrument: Instrument::of(angles),
    }))
}

/// Parses a range written as `low high`, with or without a comma between the numbers.
fn range(text: &str) -> Option<(f64, f64)> {
    let mut numbers = text.split([' ', ',']).filter(|part| !part.is_empty()).map(crate::formats::text::number);
    match (numbers.next(), numbers.next(), numbers.next()) {
        (Some(Some(low)), Some(Some(high)), None) if low <= high => Some((low, high)),
        _ => None,
    }
}

/// Name of the unit of a volume scattering function, which is converted to a phase function in 1/sr.
const VOLUME: &str = "1/m/sr";

fn unit(
    header: &mut Fields<'_>,
    kind: StatedQuantity,
    how: &Interpretation,
    report: &mut ParseReport,
) -> Result<Option<Unit>, FormatError> {
    let (quantity, is_factor) = (kind.quantity(), kind.is_factor());
    let fits = |unit: Unit| if is_factor { unit == Unit::One } else { fits(quantity, unit) };
    let fitting: Vec<Unit> = Unit::ALL.iter().copied().filter(|&unit| fits(unit)).collect();
    let names = fitting.iter().map(|unit| unit.name()).collect::<Vec<_>>().join(", ");
    let expected = match quantity {
        _ if is_factor => "1, the unit of a reflectance factor, or %".to_owned(),
        Quantity::Phase => format!("a unit of a {quantity}: {names}, {VOLUME}"),
        Quantity::Edf => format!("a unit of an emission, by solid angle (a radiance times area and cosine): {names}"),
        _ => format!("a unit of a {quantity}: {names}"),
    };
    let key = header.unit_key();
    let stated = header.value(key, &expected, |value| {
        let is_volume = quantity == Quantity::Phase && value == VOLUME;
        let meant = match ValueUnit::of(value) {
            Some(ValueUnit::PerSteradian) => Some(Unit::PerSteradian),
            Some(ValueUnit::One) => Some(Unit::One),
            Some(ValueUnit::Percent) if is_factor || quantity == Quantity::Reflectance => Some(Unit::One),
            _ => None,
        };
        is_volume.then_some(Unit::PerSteradian).or_else(|| {
            let named = |unit: &Unit| Some(*unit) == meant || unit.name().eq_ignore_ascii_case(value);
            fitting.iter().copied().find(named)
        })
    });
    if let (Some(asked), Some(stated)) = (how.unit, stated)
        && asked != stated
    {
        report.note(ValueNote::UnitAsAsked { asked, stated, source: "file" });
    }
    if how.unit.is_none() && !header.stated(key) {
        let message = format!("`value_unit` is not stated, expected it, or the option: {names}");
        return Err(FormatError::new(FormatErrorKind::NeedsOption, NAME, message));
    }
    if is_factor {
        if let Some(other) = how.unit.filter(|unit| !matches!(unit, Unit::One | Unit::PerSteradian)) {
            let message = format!("unit {other} of a reflectance factor, expected 1");
            return Err(FormatError::new(FormatErrorKind::NeedsOption, NAME, message));
        }
        return Ok(how.unit.or(stated).map(|_| Unit::PerSteradian));
    }
    Ok(how.unit.or(stated))
}

fn fits(quantity: Quantity, unit: Unit) -> bool {
    match quantity {
        Quantity::Spectrum => true,
        Quantity::Reflectance => matches!(unit, Unit::One | Unit::Relative),
        Quantity::Edf => !matches!(unit, Unit::One | Unit::PerSteradian),
        Quantity::Brdf | Quantity::Btdf | Quantity::Bsdf | Quantity::Phase => {
            matches!(unit, Unit::PerSteradian | Unit::Relative)
        }
    }
}

fn wavelength_unit(
    header: &mut Fields<'_>,
    how: &Interpretation,
    report: &mut ParseReport,
) -> Result<WavelengthUnit, FormatError> {
    let names = WavelengthUnit::ALL.map(WavelengthUnit::name).join(", ");
    let stated = header.value("wavelength_unit", &names, WavelengthUnit::of_name);
    let Some(asked) = &how.wavelength_unit else { return Ok(stated.unwrap_or(WavelengthUnit::Nanometre)) };
    let asked = WavelengthUnit::of_name(asked).ok_or_else(|| {
        let message = format!("wavelength unit {}, expected one of {names}", snippet(asked));
        FormatError::new(FormatErrorKind::NeedsOption, NAME, message)
    })?;
    if let Some(stated) = stated.filter(|stated| *stated != asked) {
        report.note(ValueNote::WavelengthUnitAsAsked { asked: asked.name(), stated: stated.name() });
    }
    Ok(asked)
}
