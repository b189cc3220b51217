//! Result of every parser: samples as the instrument took them, and a report of all assumptions.

use super::instrument::Instrument;
use super::stated_grid::StatedGrid;
use super::text::Source;
use crate::domain::vector::{Vector, unit};
use crate::domain::{Axis, Direction, Note, Quantity, Sampling, Shared, Tensor, Unit, WavelengthGrid};
use crate::notes::{TextNote, ValueNote};
use serde::Serialize;
use std::fmt::Debug;
use std::sync::Arc;

/// One measurement as a parser read it from a file, before it is projected onto axes.
#[derive(Clone, Debug)]
pub struct Acquisition {
    /// Name of the file's format in the table of formats.
    pub format: &'static str,
    /// Revision and flavour of the format, for people: `LM-63-2002, type C, no symmetry`.
    pub dialect: String,
    /// Radiometric quantity of the measurement.
    pub quantity: Quantity,
    /// Unit of a measured value. If the samples are joined with a spectrum, it is the unit of their product.
    pub unit: Unit,
    /// Measured samples in the form in which the file holds them.
    pub samples: Samples,
    /// Spectrum joined with the samples: value(direction, λ) = sample(direction) · factor(λ); `None` if there is none.
    pub spectral_factor: Option<SpectralFactor>,
    /// Angular resolution of the instrument, where the file states it; narrower features cannot be resolved.
    pub instrument: Instrument,
    /// Report on everything that the parser assumed, filled, skipped or found odd, with the file's own keywords.
    pub report: ParseReport,
}

/// Samples of a measurement in the form in which the instrument took them.
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant, reason = "there is one of it, and its data are on the heap")]
pub enum Samples {
    /// Samples on axes that a compressed material can keep, such as wavelengths or triangles of directions. They change
    /// only if the user asks for coarser triangles or other wavelengths.
    OnAxes {
        /// Samples with their axes.
        tensor: Tensor,
        /// Meaning of a sample at a triangle of directions: a point value or an average over the triangle.
        sampling: Sampling,
    },
    /// Samples on a grid that combines every angle of one direction with every angle of the other.
    Grid(AngleGrid),
    /// Samples at individual directions that do not form a grid.
    Scattered(Scattered),
    /// Function defined by the file's own model, which can be evaluated at any directions.
    Function(Modelled),
}

/// Samples at individual directions, given as `[theta, phi]` in degrees of the surface frame. Values are row-major
/// `[direction, spectral]`; NaN = missing.
///
/// A direction (or pair of directions) may occur more than once; each occurrence is a separate sample.
#[derive(Clone, Debug, PartialEq)]
pub struct Scattered {
    /// Incoming direction `wi` of each sample, `[theta, phi]` in degrees; empty where the quantity has none.
    pub incoming: Vec<[f64; 2]>,
    /// Outgoing direction `wo` of each sample, `[theta, phi]` in degrees; empty where the quantity has none.
    pub outgoing: Vec<[f64; 2]>,
    /// True for isotropic samples: every `wi` has phi 0, and the phi of `wo` is relative to the azimuth of `wi`.
    pub isotropic: bool,
    /// Wavelengths or colour channels of each sample; `None` if each has a single value.
    pub spectral: Option<Axis>,
    /// Measured values, row-major `[direction, spectral]`; NaN = missing.
    pub values: Vec<f32>,
    /// Standard uncertainties of the values (k = 1), of equal shape and unit, if the file states them. NaN and
    /// non-positive numbers mean that the uncertainty is unknown.
    pub sigma: Option<Vec<f32>>,
}

impl Scattered {
    /// Returns the number of samples: of directions, or of pairs of an incoming and an outgoing direction.
    pub fn directions(&self) -> usize {
        self.incoming.len().max(self.outgoing.len())
    }
}

/// BRDF or phase function as the function that its file defines, with the directions and the number of the measured
/// values.
#[derive(Clone, Debug)]
pub struct Modelled {
    /// Incoming angles at which the file holds data. Without azimuth the function is isotropic and is evaluated at
    /// these polar angles.
    pub incoming: Angles,
    /// Mean distance between neighbouring outgoing directions in the file, in degrees.
    pub outgoing_spacing: f64,
    /// Wavelengths or colour channels of the function; `None` if it has a single value.
    pub spectral: Option<Axis>,
    /// Number of measured values, missing ones included, that the BRDF or phase function interpolates.
    pub numbers: usize,
    /// Number of missing values among the measured values that the BRDF or phase function interpolates.
    pub missing: usize,
    /// Table of a phase function over the scattering angle, as the file lists it; `None` for other functions. Light
    /// comes from `+z`, so that polar angles are 180° minus the scattering angle.
    pub stated: Option<Box<StatedGrid>>,
    /// Function of an incoming and an outgoing direction that can be evaluated anywhere.
    pub function: Arc<dyn DirectionalFunction>,
}

/// Function, such as a BRDF, that can be evaluated at any incoming and outgoing direction. Both are above the surface
/// unless the caller states otherwise.
pub trait DirectionalFunction: Debug + Send + Sync {
    /// Writes f(wi, wo) in the unit of the measurement, one value per wavelength or channel. The value of a BRDF
    /// excludes the factor cos θo. NaN = missing.
    fn evaluate(&self, wi: Direction, wo: Direction, values: &mut [f64]);
}

/// Bytes of a written file, with counts of the values that the format could not hold.
#[derive(Clone, Debug, PartialEq)]
pub struct Written {
    /// Bytes of the written file.
    pub bytes: Vec<u8>,
    /// Number of values written as 0 because the function has no value at their directions. The file format has no mark
    /// for missing values that renderers understand.
    pub filled: usize,
    /// Number of values written as 0 because the function is negative at their directions; the file format cannot hold
    /// negative values.
    pub clipped: usize,
}

/// Least cosine from the normal of the directions that [`lifted`] returns; nearer to the horizon, quotients by the
/// cosine diverge. Raising it makes extreme angles less accurate.
pub(super) const HORIZON: f64 = 1e-3;

/// Returns a unit vector as a direction, raised to just above the horizon if it lies below.
pub(super) fn lifted(direction: Vector) -> Direction {
    let [x, y, z] = direction;
    Direction::from_unit(if z >= HORIZON { direction } else { unit([x, y, HORIZON]) })
}

/// Samples on a full grid of angles. Values are row-major `[index…, theta_i, phi_i, theta_o, phi_o, spectral]` without
/// absent axes; NaN = missing.
#[derive(Clone, Debug)]
pub struct AngleGrid {
    /// Leading axes of the values, which number the specimens or spectra that one file holds together.
    pub index: Vec<Axis>,
    /// Incoming angles; without azimuth the data are isotropic and `phi_o` is relative to the incoming azimuth.
    pub incoming: Option<Angles>,
    /// Outgoing angles; without azimuth the data are rotationally symmetric about `z`.
    pub outgoing: Option<Angles>,
    /// Wavelengths or colour channels; `None` if each direction has a single value.
    pub spectral: Option<Axis>,
    /// Value of the grid at directions outside its angles: 0, or masked.
    pub outside: Outside,
    /// Measured values, row-major in the order of the axes; NaN = missing. Clones and tensors of the grid share them.
    pub values: Shared,
    /// Grid of angles as the file lists it, if its angles were unfolded, merged or resampled on reading: see
    /// [`AngleGrid::as_stated`].
    pub stated: Option<Box<StatedGrid>>,
    /// Standard uncertainties of the values (k = 1) in the unit and on the grid of the values, if the file states them.
    /// NaN and non-positive numbers mean that the uncertainty is unknown.
    pub sigma: Option<Box<AngleGrid>>,
}

/// Angles of the incoming or of the outgoing directions, in degrees of the surface frame (theta from `+z`; a
/// luminaire's theta = 180° − gamma).
#[derive(Clone, Debug, PartialEq)]
pub struct Angles {
    /// Polar angles theta in degrees, strictly increasing.
    pub theta: Vec<f64>,
    /// Range of theta in degrees that the grid represents. The values at the first and last theta hold out to its ends.
    pub covers: (f64, f64),
    /// Azimuths phi in degrees; `None` for isotropic or rotationally symmetric data.
    pub phi: Option<Azimuths>,
}

/// Measured azimuths with their extension to the full circle.
#[derive(Clone, Debug, PartialEq)]
pub struct Azimuths {
    /// Measured azimuths in degrees, strictly increasing.
    pub phi: Vec<f64>,
    /// Rule that extends the measured azimuths to the full circle.
    pub extent: AzimuthExtent,
}

/// Rule that extends measured azimuths to the full circle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AzimuthExtent {
    /// The azimuths cover the full circle: the last one connects to the first + 360° (360° itself is not listed).
    Circle,
    /// Azimuths from 0° to 180° are measured and mirrored to the other half: `phi` and `360 − phi` have equal values.
    Mirrored,
    /// Only the sector from the first to the last azimuth was measured.
    Sector,
}

/// Value that a grid of angles gives at directions outside it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outside {
    /// Value 0 at directions outside the grid, as the standards of luminaire files (LM-63, EULUMDAT) define it.
    Zero,
    /// No value at directions outside the grid: they are unmeasured and masked.
    Masked,
}

/// Spectrum of a lamp as a factor for each wavelength, by which every intensity of a luminaire is multiplied. The
/// factors are scaled so that the product, integrated over wavelength, is the intensity (for candela with the weight
/// 683 lm/W · V(λ)).
#[derive(Clone, Debug, PartialEq)]
pub struct SpectralFactor {
    /// Wavelengths at which the factors of the lamp's spectrum are given.
    pub grid: WavelengthGrid,
    /// Factor by which the intensities are multiplied at each wavelength, in nm⁻¹; for candela in W·sr⁻¹·nm⁻¹ per cd.
    pub factors: Vec<f64>,
}

/// Report of a parser for the user: assumptions, fillings, skips, warnings, and the file's own keywords in order.
#[derive(Clone, Debug, Default, Serialize)]
pub struct ParseReport {
    /// Notes of the parser (assumptions, fillings, skips and warnings) in order of occurrence.
    pub notes: Vec<Note>,
    /// Keywords and header fields of the file, in the order of the file.
    pub metadata: Vec<(String, String)>,
    /// Indices in `notes` of the notes on changes of the samples that only averages over triangles need, not the file's
    /// own grid of angles: seams merged, poles averaged, angles resampled.
    #[serde(skip)]
    unfolding: Vec<usize>,
}

impl ParseReport {
    /// Adds a note to the report of the parser.
    pub fn note(&mut self, note: impl Into<Note>) {
        self.notes.push(note.into());
    }

    /// Adds a note on the encoding in which a text was decoded, unless it is plain UTF-8.
    pub(super) fn note_encoding(&mut self, source: &Source) {
        if let Some(encoding) = source.odd_encoding() {
            self.note(TextNote::DecodedAs { encoding });
        }
    }

    /// Adds a note on the number of negative values, which are kept, if there are any.
    pub(super) fn note_negative(&mut self, values: &[f32]) {
        let negative = values.iter().filter(|value| **value < 0.0).count();
        if negative > 0 {
            let lowest = values.iter().copied().fold(0.0, f32::min);
            self.note(ValueNote::Negative { values: negative, lowest });
        }
    }

    /// Adds a note on a change of the samples, such as a merged seam, to the parser's report. The note applies only if
    /// the samples are averaged over triangles.
    pub(super) fn note_unfolding(&mut self, note: impl Into<Note>) {
        self.unfolding.push(self.notes.len());
        self.note(note);
    }

    /// Returns the notes that apply to a measurement. `on_grid` leaves out the notes that apply only to averages over
    /// triangles.
    pub fn notes_of(&self, on_grid: bool) -> impl Iterator<Item = &Note> {
        let holds = move |number: &usize| !on_grid || !self.unfolding.contains(number);
        self.notes.iter().enumerate().filter(move |(number, _)| holds(number)).map(|(_, note)| note)
    }
}
