//! Result of every parser: samples as the instrument took them, and a report of all assumptions.

use super::instrument::Instrument;
use super::stated_grid::StatedGrid;
use crate::domain::vector::{Vector, unit};
use crate::domain::{Axis, Direction, Note, Quantity, Sampling, Tensor, Unit, WavelengthGrid};
use serde::Serialize;
use std::fmt::Debug;
use std::sync::Arc;

/// One measurement as read from a file, before projection.
#[derive(Clone, Debug)]
pub struct Acquisition {
    /// The format's name in the table of formats.
    pub format: &'static str,
    /// Revision and flavour, for people: `LM-63-2002, type C, no symmetry`.
    pub dialect: String,
    /// The radiometric quantity.
    pub quantity: Quantity,
    /// The unit of a value, after the spectral factor.
    pub unit: Unit,
    /// The samples.
    pub samples: Samples,
    /// A spectrum joined with the samples: value(direction, λ) = sample(direction) · factor(λ).
    pub spectral_factor: Option<SpectralFactor>,
    /// Angles of the instrument below which nothing is resolved, where the file states them.
    pub instrument: Instrument,
    /// Everything the parser assumed, filled, skipped or found odd, and the file's own keywords.
    pub report: ParseReport,
}

/// Samples in the form the instrument took them.
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant, reason = "there is one of it, and its data are on the heap")]
pub enum Samples {
    /// Already on their final axes.
    OnAxes {
        /// The samples.
        tensor: Tensor,
        /// Meaning of a sample on a triangle axis.
        sampling: Sampling,
    },
    /// On a grid of angles.
    Grid(AngleGrid),
    /// At individual directions that form no grid.
    Scattered(Scattered),
    /// A function defined by the file's own model, which can be evaluated anywhere.
    Function(Modelled),
}

/// Samples at individual directions, `[theta, phi]` in degrees of the surface frame. Values are row-major
/// `[direction, spectral]`; NaN = missing.
///
/// A direction (or pair of directions) may occur more than once; each occurrence is a separate sample.
#[derive(Clone, Debug, PartialEq)]
pub struct Scattered {
    /// `wi` of each direction; empty where the quantity has none.
    pub incoming: Vec<[f64; 2]>,
    /// `wo` of each direction; empty where the quantity has none.
    pub outgoing: Vec<[f64; 2]>,
    /// Isotropic: every `wi` has phi 0, and the phi of `wo` is relative to it.
    pub isotropic: bool,
    /// Wavelengths, if there are any.
    pub spectral: Option<Axis>,
    /// The values.
    pub values: Vec<f32>,
    /// Standard uncertainties of the values (k = 1), of the same shape and unit, if the file states them. NaN and
    /// non-positive numbers mean not stated.
    pub sigma: Option<Vec<f32>>,
}

impl Scattered {
    /// Returns the number of directions, or of direction pairs.
    pub fn directions(&self) -> usize {
        self.incoming.len().max(self.outgoing.len())
    }
}

/// A BRDF as the function that its file defines, with the directions and the count of the measured data.
#[derive(Clone, Debug)]
pub struct Modelled {
    /// Incoming angles at which the file holds data. Without azimuth the function is isotropic and is evaluated at
    /// these elevations.
    pub incoming: Angles,
    /// Mean distance between neighbouring outgoing directions of the file, in degrees.
    pub outgoing_spacing: f64,
    /// Wavelengths or colour channels.
    pub spectral: Option<Axis>,
    /// Number of values that the function interpolates.
    pub numbers: usize,
    /// Number of these values that are missing.
    pub missing: usize,
    /// Table of a phase function over the scattering angle, as the file states it. Light comes from `+z`, so that polar
    /// angles are 180° minus the scattering angle. Elsewhere the function depends on the angle between the directions.
    pub stated: Option<Box<StatedGrid>>,
    /// The function.
    pub function: Arc<dyn DirectionalFunction>,
}

/// Function of two directions, above the surface unless the caller states otherwise.
pub trait DirectionalFunction: Debug + Send + Sync {
    /// Writes f(wi, wo) in the acquisition's unit, one value per channel of the spectral axis (one value without such
    /// an axis). A BRDF excludes the cosine. NaN = missing.
    fn evaluate(&self, wi: Direction, wo: Direction, values: &mut [f64]);
}

/// Bytes of a written file, with counts of the values that the format could not hold.
#[derive(Clone, Debug, PartialEq)]
pub struct Written {
    /// The file.
    pub bytes: Vec<u8>,
    /// Number of values written as 0 because the function is undefined there; the format has no mask that renderers
    /// understand.
    pub filled: usize,
    /// Number of values written as 0 because the function is negative there, which the format cannot hold.
    pub clipped: usize,
}

/// Cosine that replaces smaller ones near the horizon, where quotients by the cosine diverge.
pub(super) const HORIZON: f64 = 1e-3;

/// Returns the unit vector as a direction, raised to the horizon if it lies below.
pub(super) fn lifted(direction: Vector) -> Direction {
    let [x, y, z] = direction;
    Direction::from_unit(if z >= HORIZON { direction } else { unit([x, y, HORIZON]) })
}

/// Full grid of angles. Values are row-major `[index…, theta_i, phi_i, theta_o, phi_o, spectral]` without absent axes;
/// NaN = missing.
#[derive(Clone, Debug)]
pub struct AngleGrid {
    /// Leading index axes.
    pub index: Vec<Axis>,
    /// Incoming angles; without azimuth the data are isotropic and `phi_o` is relative to the incoming azimuth.
    pub incoming: Option<Angles>,
    /// Outgoing angles; without azimuth the data are rotationally symmetric about `z`.
    pub outgoing: Option<Angles>,
    /// Wavelength or colour channels.
    pub spectral: Option<Axis>,
    /// Value outside the covered angles.
    pub outside: Outside,
    /// The values.
    pub values: Vec<f32>,
    /// The grid as the file states it, if it differs from this one: see [`AngleGrid::as_stated`].
    pub stated: Option<Box<StatedGrid>>,
    /// Standard uncertainties of the values (k = 1) in the same unit and on the same grid, if the file states them. NaN
    /// and non-positive numbers mean not stated.
    pub sigma: Option<Box<AngleGrid>>,
}

/// The angles of one direction, in degrees of the surface frame (theta from `+z`; a luminaire's theta = 180° − gamma).
#[derive(Clone, Debug, PartialEq)]
pub struct Angles {
    /// Strictly increasing.
    pub theta: Vec<f64>,
    /// Range of theta that the grid represents. The first and last values are constant out to its ends.
    pub covers: (f64, f64),
    /// The azimuths, if there are any.
    pub phi: Option<Azimuths>,
}

/// Azimuths in degrees, strictly increasing.
#[derive(Clone, Debug, PartialEq)]
pub struct Azimuths {
    /// The azimuths measured.
    pub phi: Vec<f64>,
    /// Extension to the full circle.
    pub extent: AzimuthExtent,
}

/// Extension of measured azimuths to the full circle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AzimuthExtent {
    /// Full circle: the last azimuth connects to the first + 360° (360° itself is not listed).
    Circle,
    /// 0..=180 measured, mirrored to the other half: `phi` and `360 − phi` have equal values.
    Mirrored,
    /// Only the sector from the first to the last was measured.
    Sector,
}

/// Value outside the samples of a grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outside {
    /// 0, as the standard states (LM-63, EULUMDAT).
    Zero,
    /// Unmeasured: masked.
    Masked,
}

/// Spectrum that multiplies every sample, normalised by the parser that attached it.
#[derive(Clone, Debug, PartialEq)]
pub struct SpectralFactor {
    /// Wavelengths of the factors.
    pub grid: WavelengthGrid,
    /// One factor per wavelength, in nm⁻¹.
    pub factors: Vec<f64>,
}

/// Report for the user: assumptions, fillings, skips, warnings, and the file's own keywords in order.
#[derive(Clone, Debug, Default, Serialize)]
pub struct ParseReport {
    /// Remarks in order of occurrence.
    pub notes: Vec<Note>,
    /// Keywords and header fields of the file, in order.
    pub metadata: Vec<(String, String)>,
    /// Indices of the notes that concern triangles only, not the file's own grid: seams merged, poles averaged, angles
    /// resampled.
    #[serde(skip)]
    unfolding: Vec<usize>,
}

impl ParseReport {
    /// Adds a remark.
    pub fn note(&mut self, note: impl Into<Note>) {
        self.notes.push(note.into());
    }

    /// Adds a remark on a change that only the form for triangles needs.
    pub(super) fn note_unfolding(&mut self, note: impl Into<Note>) {
        self.unfolding.push(self.notes.len());
        self.note(note);
    }

    /// Returns the remarks that apply to a measurement; `on_grid` leaves out those that concern triangles only.
    pub fn notes_of(&self, on_grid: bool) -> impl Iterator<Item = &Note> {
        let holds = move |number: &usize| !on_grid || !self.unfolding.contains(number);
        self.notes.iter().enumerate().filter(move |(number, _)| holds(number)).map(|(_, note)| note)
    }
}
