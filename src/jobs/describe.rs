//! Description of a measurement, which the user sees before anything is compressed.

use super::fingerprint::Fingerprint;
use super::options::Options;
use crate::domain::{Axis, Domain, Frame, Quantity, Sampling, Unit, WavelengthGrid};
use crate::formats::{
    Acquisition, AngleGrid, Angles, AzimuthExtent, Instrument, Modelled, Note, NoteKind, Outside, Samples,
};
use crate::projection;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Upper bound on the header fields of one file that are stored with its measurement; further fields are dropped.
const MAX_FIELDS: usize = 200;

/// Description of an uploaded file as it was parsed, and the reading options that the client stated.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub(crate) struct Understood {
    /// Name of the format of the uploaded measurement file.
    pub format: String,
    /// Revision and variant of the file format, e.g. LM-63-2002.
    pub dialect: Option<String>,
    /// Radiometric quantity of the file; null while it is unknown.
    pub quantity: Option<Quantity>,
    /// Unit of the values in the file; null while it is unknown.
    pub unit: Option<Unit>,
    /// Axes on which the file states its values, outermost first.
    pub axes: Vec<DescribedAxis>,
    /// Number of values in the uploaded measurement file, missing ones included; null if reading the file needs an
    /// option that the upload did not state.
    pub samples: Option<u64>,
    /// Smallest and largest value in the file.
    pub range: Option<[f64; 2]>,
    /// Range of directions that the file covers, and the value of directions outside it.
    pub coverage: Option<Extent>,
    /// Detector aperture and source divergence of the instrument, as far as the file states them.
    #[serde(default)]
    pub instrument: Instrument,
    /// Notes on facts that were assumed, filled in or skipped, and on values that contradict physics (an albedo above
    /// 1, broken reciprocity, negative values, a lobe no wider than the instrument resolves).
    pub warnings: Vec<Note>,
    /// Header fields of the file.
    pub fields: Vec<HeaderField>,
    /// Options still needed, at the upload or in the job, before the file can be compressed; empty if none.
    pub needs: Vec<String>,
    /// Reading options that the client stated when it uploaded the file.
    #[serde(default)]
    pub options: Options,
    /// Fingerprint of the values and coordinates that were read; absent while the file cannot be read without a further
    /// option, and for measurements that earlier versions have stored.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub fingerprint: Option<Fingerprint>,
}

/// Axis on which a file states its values; the kind of the axis decides which fields are present.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub(crate) struct DescribedAxis {
    /// Kind of coordinate on the axis, such as polar angles, wavelengths or numbered entries without geometry.
    pub kind: AxisKind,
    /// Description of the axis in words; empty for measurements that earlier versions have stored.
    #[serde(default)]
    #[schema(required = false)]
    pub description: String,
    /// Number of entries on this axis of the measurement.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub count: Option<usize>,
    /// First angle or wavelength on this axis of the measurement.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub first: Option<f64>,
    /// Last angle or wavelength on this axis of the measurement.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub last: Option<f64>,
    /// Unit, `degree` or `nm`, of the first and last entry of the axis (`first`, `last`) and of the mean distance
    /// between neighbouring entries (`spacing`).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub unit: Option<String>,
    /// Part of the sphere of directions that the triangles of the axis cover.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub domain: Option<Domain>,
    /// Subdivision level of the triangles of directions; one level more makes four triangles of each.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub level: Option<u8>,
    /// Coordinate frame of the angles in a grid of directions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub frame: Option<Frame>,
    /// Number of polar angles of a grid of directions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub polar: Option<usize>,
    /// Number of azimuths of a grid of directions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub azimuths: Option<usize>,
    /// Names of the entries on an axis without geometry, such as the columns of a table.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub labels: Option<Vec<String>>,
    /// Mean angle between neighbouring outgoing directions, in degrees.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub spacing: Option<f64>,
}

/// Kinds of the axes of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum AxisKind {
    /// Directions as the triangles of a subdivided octahedron.
    Triangles,
    /// Directions on a grid of angles, or a list of scattered directions.
    Directions,
    /// Outgoing directions of a BRDF or phase function that has a value in every direction, interpolated from the file.
    Outgoing,
    /// Polar angles of the incoming direction in data that do not depend on its azimuth.
    Elevation,
    /// Axis of the polar angles of the incoming directions, in degrees.
    ThetaI,
    /// Axis of the azimuths of the incoming directions, in degrees.
    PhiI,
    /// Axis of the polar angles of the outgoing directions, in degrees.
    ThetaO,
    /// Axis of the azimuths of the outgoing directions, in degrees.
    PhiO,
    /// Wavelengths of the data, in nm.
    Wavelength,
    /// Numbered entries of an axis without geometry, such as the columns of a table or scan positions, with or without
    /// names.
    Index,
    /// The channels red, green and blue.
    Rgb,
}

/// Range of directions that a measurement file covers, and facts on its values: sampling, uncertainties, missing
/// values.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub(crate) struct Extent {
    /// Meaning of a value on a triangle of directions: average over the triangle, or value at its centre.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub sampling: Option<Sampling>,
    /// Range of the incoming directions in a file.
    #[serde(default)]
    pub incoming: Option<DirectionExtent>,
    /// Range of the outgoing directions in a file.
    #[serde(default)]
    pub outgoing: Option<DirectionExtent>,
    /// True if scattered samples do not depend on the azimuth of the incoming direction.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub isotropic: Option<bool>,
    /// True if the file states uncertainties of its values.
    #[serde(default)]
    pub stated_uncertainties: bool,
    /// Value that stands for directions outside the measured range: 0, or none.
    pub outside: OutsideValue,
    /// Number of missing values in a file.
    #[serde(default)]
    pub missing_samples: usize,
}

/// Range of directions that a file covers, in degrees.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub(crate) struct DirectionExtent {
    /// Smallest and largest polar angle that a file covers, in degrees.
    pub theta: [f64; 2],
    /// Range of the azimuths in a file; null if it states none.
    pub phi: Option<AzimuthRange>,
}

/// Range of measured azimuths in degrees, and their continuation to the full circle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub(crate) struct AzimuthRange {
    /// First measured azimuth in degrees.
    pub first: Option<f64>,
    /// Last measured azimuth in degrees.
    pub last: Option<f64>,
    /// Continuation of the measured azimuths to the full circle.
    pub extent: ExtentKind,
}

/// Continuation of measured azimuths to the full circle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum ExtentKind {
    /// The measured azimuths go round the full circle.
    Circle,
    /// Azimuths from 0° to 180° were measured; the other half of the circle is their mirror image across the plane of
    /// azimuth 0° and 180°.
    Mirrored,
    /// Only a sector of the circle of azimuths was measured; nothing is known about the rest.
    Sector,
}

/// Value of directions that a file does not cover.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum OutsideValue {
    /// Directions outside the measured range have the value 0, as the standard of the file format says.
    Zero,
    /// Directions outside the measured range have no value.
    #[default]
    Masked,
}

/// Field in the header of a measurement file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub(crate) struct HeaderField {
    /// Name of one field in the header of a measurement file.
    pub name: String,
    /// Value of one field in the header of a measurement file, as text.
    pub value: String,
}

/// Describes a measurement that was read from a file with `options`.
pub(crate) fn describe(acquisition: &Acquisition, options: &Options) -> Understood {
    let (mut axes, values, coverage) = match &acquisition.samples {
        Samples::OnAxes { tensor, sampling } => {
            let axes: Vec<DescribedAxis> = tensor.axes().iter().map(axis).collect();
            (axes, tensor.samples(), Extent { sampling: Some(*sampling), ..Extent::default() })
        }
        Samples::Grid(grid) => (grid_axes(grid), grid.values.as_slice(), grid_coverage(grid)),
        Samples::Scattered(scattered) => {
            let count = scattered.directions();
            let description = format!("{count} scattered directions");
            let directions = DescribedAxis::new(AxisKind::Directions, count, description);
            let axes = std::iter::once(directions).chain(scattered.spectral.as_ref().map(axis)).collect();
            let coverage = Extent {
                isotropic: Some(scattered.isotropic),
                stated_uncertainties: scattered.sigma.is_some(),
                ..Extent::default()
            };
            (axes, scattered.values.as_slice(), coverage)
        }
        // The range of a function is known once it is projected.
        Samples::Function(modelled) => {
            let coverage = Extent { incoming: Some(direction_extent(&modelled.incoming)), ..Extent::default() };
            (function_axes(modelled), &[][..], coverage)
        }
    };
    let (samples, missing_samples) = match &acquisition.samples {
        Samples::Function(modelled) => (modelled.numbers, modelled.missing),
        _ => (values.len(), values.iter().filter(|s| s.is_nan()).count()),
    };
    let mut range = extremes(values.iter().map(|&s| f64::from(s)));
    if let Some(factor) = &acquisition.spectral_factor {
        axes.push(wavelengths(&factor.grid));
        // value = sample · factor is bilinear: its extremes are products of extremes.
        let factors = extremes(factor.factors.iter().copied());
        range = range.zip(factors).and_then(|((a, b), (c, d))| extremes([a * c, a * d, b * c, b * d]));
    }
    let fields = acquisition.report.metadata.iter().take(MAX_FIELDS);
    let checked = projection::plausibility(acquisition).remarks();
    Understood {
        format: acquisition.format.to_owned(),
        dialect: Some(acquisition.dialect.clone()),
        quantity: Some(acquisition.quantity),
        unit: Some(acquisition.unit),
        axes,
        samples: Some(samples as u64),
        range: range.map(|(low, high)| [low, high]),
        coverage: Some(Extent { missing_samples, ..coverage }),
        instrument: acquisition.instrument,
        warnings: acquisition.report.notes.iter().cloned().chain(checked).collect(),
        fields: fields.map(|(name, value)| HeaderField { name: name.clone(), value: value.clone() }).collect(),
        needs: Vec::new(),
        options: options.clone(),
        fingerprint: Some(Fingerprint::of(acquisition)),
    }
}

/// Describes a file that needs an option before it can be read.
pub(crate) fn describe_needy(format: &str, need: &str, options: &Options) -> Understood {
    Understood {
        format: format.to_owned(),
        dialect: None,
        quantity: None,
        unit: None,
        axes: Vec::new(),
        samples: None,
        range: None,
        coverage: None,
        instrument: Instrument::default(),
        warnings: vec![Note::plain(NoteKind::Warning, need)],
        fields: Vec::new(),
        needs: vec![need.to_owned()],
        options: options.clone(),
        fingerprint: None,
    }
}

impl DescribedAxis {
    fn of_kind(kind: AxisKind, description: String) -> Self {
        Self {
            kind,
            description,
            count: None,
            first: None,
            last: None,
            unit: None,
            domain: None,
            level: None,
            frame: None,
            polar: None,
            azimuths: None,
            labels: None,
            spacing: None,
        }
    }

    fn new(kind: AxisKind, count: usize, description: String) -> Self {
        Self { count: Some(count), ..Self::of_kind(kind, description) }
    }

    /// Sets the first and the last value of the described axis, and the name `unit` of their unit.
    fn between(self, first: Option<f64>, last: Option<f64>, unit: &str) -> Self {
        Self { first, last, unit: Some(unit.to_owned()), ..self }
    }
}

fn axis(axis: &Axis) -> DescribedAxis {
    match axis {
        Axis::Triangles(mesh) => DescribedAxis {
            domain: Some(mesh.domain()),
            level: Some(mesh.level()),
            ..DescribedAxis::new(AxisKind::Triangles, mesh.len(), axis.describe())
        },
        Axis::Grid(grid) => {
            let [polar, azimuths] = grid.shape();
            let (first, last) = grid.covers();
            let described = DescribedAxis::new(AxisKind::Directions, grid.len(), axis.describe());
            DescribedAxis {
                frame: Some(grid.frame()),
                polar: Some(polar),
                azimuths: Some(azimuths),
                ..described.between(Some(first), Some(last), "degree")
            }
        }
        Axis::Elevation(values) => {
            let described = DescribedAxis::new(AxisKind::Elevation, values.len(), axis.describe());
            described.between(values.first().copied(), values.last().copied(), "degree")
        }
        Axis::Wavelength(grid) => wavelengths(grid),
        Axis::Index { count, labels } => {
            let described = DescribedAxis::new(AxisKind::Index, *count, axis.describe());
            DescribedAxis { labels: Some(labels.clone()), ..described }
        }
        Axis::Rgb => DescribedAxis::new(AxisKind::Rgb, axis.len(), axis.describe()),
    }
}

fn wavelengths(grid: &WavelengthGrid) -> DescribedAxis {
    let (first, last) = grid.range();
    let description = Axis::Wavelength(grid.clone()).describe();
    DescribedAxis::new(AxisKind::Wavelength, grid.len(), description).between(Some(first), Some(last), "nm")
}

/// Describes an axis of angles. `name` is the name of the axis, and `continued` says in words how its azimuths
/// continue.
fn angles((kind, name): (AxisKind, &str), values: &[f64], continued: &str) -> DescribedAxis {
    let span = match values {
        [] => String::new(),
        [only] => only.to_string(),
        [first, .., last] => format!("{first}..{last}"),
    };
    let description = format!("{name} {span} deg ({}{continued})", values.len());
    let described = DescribedAxis::new(kind, values.len(), description);
    described.between(values.first().copied(), values.last().copied(), "degree")
}

fn grid_axes(grid: &AngleGrid) -> Vec<DescribedAxis> {
    let mut axes: Vec<DescribedAxis> = grid.index.iter().map(axis).collect();
    for (direction, names) in [(&grid.incoming, INCOMING), (&grid.outgoing, OUTGOING)] {
        axes.extend(direction.iter().flat_map(|direction| direction_axes(direction, names)));
    }
    axes.extend(grid.spectral.as_ref().map(axis));
    axes
}

/// Kinds and names of the axes of incoming directions: polar angles and azimuths.
const INCOMING: [(AxisKind, &str); 2] = [(AxisKind::ThetaI, "theta_i"), (AxisKind::PhiI, "phi_i")];
/// Kinds and names of the axes of outgoing directions: polar angles and azimuths.
const OUTGOING: [(AxisKind, &str); 2] = [(AxisKind::ThetaO, "theta_o"), (AxisKind::PhiO, "phi_o")];

fn direction_axes(direction: &Angles, [theta, phi]: [(AxisKind, &str); 2]) -> Vec<DescribedAxis> {
    let azimuths = direction.phi.iter().map(|azimuths| {
        let continued = match azimuths.extent {
            AzimuthExtent::Circle => "",
            AzimuthExtent::Mirrored => ", mirrored",
            AzimuthExtent::Sector => ", sector",
        };
        angles(phi, &azimuths.phi, continued)
    });
    std::iter::once(angles(theta, &direction.theta, "")).chain(azimuths).collect()
}

fn function_axes(modelled: &Modelled) -> Vec<DescribedAxis> {
    let mut axes = direction_axes(&modelled.incoming, INCOMING);
    // Two digits: the spacing is a mean.
    let description = format!("outgoing directions every {:.2} deg", modelled.outgoing_spacing);
    let outgoing = DescribedAxis::of_kind(AxisKind::Outgoing, description);
    axes.push(DescribedAxis { spacing: Some(modelled.outgoing_spacing), unit: Some("degree".to_owned()), ..outgoing });
    axes.extend(modelled.spectral.as_ref().map(axis));
    axes
}

fn grid_coverage(grid: &AngleGrid) -> Extent {
    Extent {
        incoming: grid.incoming.as_ref().map(direction_extent),
        outgoing: grid.outgoing.as_ref().map(direction_extent),
        stated_uncertainties: grid.sigma.is_some(),
        outside: match grid.outside {
            Outside::Zero => OutsideValue::Zero,
            Outside::Masked => OutsideValue::Masked,
        },
        ..Extent::default()
    }
}

fn direction_extent(angles: &Angles) -> DirectionExtent {
    let phi = angles.phi.as_ref().map(|azimuths| AzimuthRange {
        first: azimuths.phi.first().copied(),
        last: azimuths.phi.last().copied(),
        extent: match azimuths.extent {
            AzimuthExtent::Circle => ExtentKind::Circle,
            AzimuthExtent::Mirrored => ExtentKind::Mirrored,
            AzimuthExtent::Sector => ExtentKind::Sector,
        },
    });
    DirectionExtent { theta: [angles.covers.0, angles.covers.1], phi }
}

/// Returns the smallest and the largest of the values that are not NaN.
fn extremes(values: impl IntoIterator<Item = f64>) -> Option<(f64, f64)> {
    values.into_iter().filter(|v| !v.is_nan()).fold(None, |range, v| match range {
        None => Some((v, v)),
        Some((low, high)) => Some((low.min(v), high.max(v))),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::{Azimuths, Instrument, ParseReport, SpectralFactor};
    use serde_json::json;

    #[test]
    fn a_luminaire_with_a_spectrum_has_its_axes_and_range() {
        let grid = AngleGrid {
            index: vec![],
            incoming: None,
            outgoing: Some(Angles {
                theta: vec![90.0, 180.0],
                covers: (90.0, 180.0),
                phi: Some(Azimuths { phi: vec![0.0, 120.0, 240.0], extent: AzimuthExtent::Circle }),
            }),
            spectral: None,
            outside: Outside::Zero,
            values: vec![1.0, 2.0, 3.0, 4.0, f32::NAN, 0.5].into(),
            stated: None,
            sigma: None,
        };
        let factor = SpectralFactor { grid: WavelengthGrid::even(400.0, 10.0, 2).unwrap(), factors: vec![0.5, 2.0] };
        let acquisition = Acquisition {
            format: "ies",
            dialect: "LM-63-2002".to_owned(),
            quantity: Quantity::Edf,
            unit: Unit::Relative,
            samples: Samples::Grid(grid),
            spectral_factor: Some(factor),
            instrument: Instrument::default(),
            report: ParseReport::default(),
        };
        let described = json!(describe(&acquisition, &Options::default()));
        let kinds: Vec<&str> =
            described["axes"].as_array().unwrap().iter().map(|axis| axis["kind"].as_str().unwrap()).collect();
        assert_eq!(kinds, ["theta_o", "phi_o", "wavelength"]);
        assert_eq!(described["axes"][1]["description"], "phi_o 0..240 deg (3)");
        assert_eq!(described["range"], json!([0.25, 8.0]));
        assert_eq!(described["coverage"]["missing_samples"], 1);
        assert_eq!(described["coverage"]["outgoing"]["phi"]["extent"], "circle");
    }
}
