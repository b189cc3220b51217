//! What every parser gives: samples as the instrument took them, and a report of all that was assumed.

use super::instrument::Instrument;
use super::stated_grid::StatedGrid;
use crate::domain::vector::{Vector, unit};
use crate::domain::{Axis, Direction, Quantity, Sampling, Tensor, Unit, WavelengthGrid};
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
        /// What a sample on a triangle axis stands for.
        sampling: Sampling,
    },
    /// On a grid of angles.
    Grid(AngleGrid),
    /// At directions of their own, which make no grid.
    Scattered(Scattered),
    /// A function that the file's own model evaluates anywhere.
    Function(Modelled),
}

/// Samples at directions of their own, in degrees of the surface frame as `[theta, phi]`; values row-major
/// `[direction, spectral]`, NaN = missing.
///
/// A direction (or pair of them) may come more than once: each is a sample of its own.
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
    /// Standard uncertainties of the values (k = 1), of their shape and in their unit, if the file states them;
    /// NaN, or anything that is not positive, = not stated.
    pub sigma: Option<Vec<f32>>,
}

impl Scattered {
    /// How many directions, or pairs of them, there are.
    pub fn directions(&self) -> usize {
        self.incoming.len().max(self.outgoing.len())
    }
}

/// A BRDF as the function that its file defines, and what is known of where that function was measured.
#[derive(Clone, Debug)]
pub struct Modelled {
    /// Incoming angles at which the file holds data; without azimuth the function is isotropic, and evaluated at these
    /// elevations.
    pub incoming: Angles,
    /// The mean distance between neighbouring outgoing directions of the file, in degrees.
    pub outgoing_spacing: f64,
    /// Wavelengths or colour channels.
    pub spectral: Option<Axis>,
    /// How many numbers the function interpolates.
    pub numbers: usize,
    /// How many of them are missing.
    pub missing: usize,
    /// The list of a phase function over the scattering angle, which the file states: light comes from `+z`, so that its
    /// polar angles are 180° less the scattering angle. Elsewhere the function depends on the angle between the directions.
    pub stated: Option<Box<StatedGrid>>,
    /// The function.
    pub function: Arc<dyn DirectionalFunction>,
}

/// A function of two directions, above the surface unless its user says otherwise.
pub trait DirectionalFunction: Debug + Send + Sync {
    /// Writes f(wi, wo) in the acquisition's unit, one value a channel of its spectral axis (one without); a BRDF is
    /// without the cosine. NaN = missing.
    fn evaluate(&self, wi: Direction, wo: Direction, values: &mut [f64]);
}

/// A function as the bytes of a format, and what the format could not hold.
#[derive(Clone, Debug, PartialEq)]
pub struct Written {
    /// The file.
    pub bytes: Vec<u8>,
    /// Numbers that are 0 because the function has none there (the format has no mask that renderers know).
    pub filled: usize,
    /// Numbers that are 0 because the function is negative there, which the format cannot say.
    pub clipped: usize,
}

/// The cosine that stands for the horizon itself.
pub(super) const HORIZON: f64 = 1e-3;

/// A unit vector lifted to the horizon if it lies below.
pub(super) fn lifted(direction: Vector) -> Direction {
    let [x, y, z] = direction;
    Direction::from_unit(if z >= HORIZON { direction } else { unit([x, y, HORIZON]) })
}

/// A full grid of angles; values row-major in the order
/// `[index…, theta_i, phi_i, theta_o, phi_o, spectral]`, absent axes left out; NaN = missing.
#[derive(Clone, Debug)]
pub struct AngleGrid {
    /// Leading opaque axes.
    pub index: Vec<Axis>,
    /// Incoming angles; without azimuth the data are isotropic and `phi_o` is relative to the incoming azimuth.
    pub incoming: Option<Angles>,
    /// Outgoing angles; without azimuth the data are rotationally symmetric about `z`.
    pub outgoing: Option<Angles>,
    /// Wavelength or colour channels.
    pub spectral: Option<Axis>,
    /// What holds outside the angles covered.
    pub outside: Outside,
    /// The values.
    pub values: Vec<f32>,
    /// The grid as the file states it, where that is not this one: see [`AngleGrid::as_stated`].
    pub stated: Option<Box<StatedGrid>>,
    /// Standard uncertainties of the values (k = 1) in their unit, on the same grid, if the file states them; NaN, or
    /// anything that is not positive, = not stated.
    pub sigma: Option<Box<AngleGrid>>,
}

/// The angles of one direction, in degrees of the surface frame (theta from `+z`; a luminaire's theta = 180° − gamma).
#[derive(Clone, Debug, PartialEq)]
pub struct Angles {
    /// Strictly increasing.
    pub theta: Vec<f64>,
    /// The range of theta that the grid stands for: values are held from the first and last theta to its ends.
    pub covers: (f64, f64),
    /// The azimuths, if there are any.
    pub phi: Option<Azimuths>,
}

/// Azimuths in degrees, strictly increasing.
#[derive(Clone, Debug, PartialEq)]
pub struct Azimuths {
    /// The azimuths measured.
    pub phi: Vec<f64>,
    /// How they extend to the full circle.
    pub extent: AzimuthExtent,
}

/// How measured azimuths extend to the full circle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AzimuthExtent {
    /// They go round: the last connects to the first + 360° (360° itself is not listed).
    Circle,
    /// 0..=180 measured, the other half is its mirror image: `phi` and `360 − phi` have the same value.
    Mirrored,
    /// Only the sector from the first to the last was measured.
    Sector,
}

/// What holds where a grid has no samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outside {
    /// The standard says the value is 0 (LM-63, EULUMDAT).
    Zero,
    /// Unmeasured: masked.
    Masked,
}

/// A spectrum that multiplies every sample, normalised by the parser that joined it.
#[derive(Clone, Debug, PartialEq)]
pub struct SpectralFactor {
    /// Its wavelengths.
    pub grid: WavelengthGrid,
    /// One factor a wavelength, in nm⁻¹.
    pub factors: Vec<f64>,
}

/// What the user must see: assumptions, fillings, skips, warnings, and the file's own keywords in order.
#[derive(Clone, Debug, Default, Serialize)]
pub struct ParseReport {
    /// In the order they came up.
    pub notes: Vec<Note>,
    /// Keywords and header fields of the file, in order.
    pub metadata: Vec<(String, String)>,
    /// Notes, by their number, on what triangles need and the file's own grid does not: seams merged, poles averaged,
    /// angles resampled.
    #[serde(skip)]
    unfolding: Vec<usize>,
}

/// One remark of a parser.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Note {
    /// What kind of remark.
    pub kind: NoteKind,
    /// A sentence for the user.
    pub message: String,
}

/// What a remark is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum NoteKind {
    /// The file did not say; this was taken to hold.
    Assumed,
    /// Values that the file does not contain were supplied.
    Filled,
    /// Something in the file was not used.
    Skipped,
    /// Something the user should look at.
    Warning,
    /// A check of the values against physics, for the user to judge.
    Checked,
}

impl ParseReport {
    /// Adds a remark.
    pub fn note(&mut self, kind: NoteKind, message: impl Into<String>) {
        self.notes.push(Note { kind, message: message.into() });
    }

    /// Adds a remark on what the form for triangles changes and the grid of the file keeps.
    pub(super) fn note_unfolding(&mut self, kind: NoteKind, message: impl Into<String>) {
        self.unfolding.push(self.notes.len());
        self.note(kind, message);
    }

    /// The remarks that hold for a measurement, on the grid of its file or not.
    pub fn notes_of(&self, on_grid: bool) -> impl Iterator<Item = &Note> {
        let holds = move |number: &usize| !on_grid || !self.unfolding.contains(number);
        self.notes.iter().enumerate().filter(move |(number, _)| holds(number)).map(|(_, note)| note)
    }
}
