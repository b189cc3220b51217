//! Data model of measurements: directions, wavelengths, triangles, axes, quantities, tensors, colours, and errors
//! between two measurements.
//!
//! # Conventions
//! * **Surface frame**: right-handed, `+z` is the outward normal, `+x` the reference direction of the sample. `wi`
//!   points to the source, `wo` to the detector, both away from the surface; transmission has `wo.z < 0`. `theta`
//!   counts from `+z`, `phi` counter-clockwise from `+x`.
//! * **Luminaire frame**: `-z` is nadir (gamma 0), `+x` lies in the C0 half-plane, so theta = 180° − gamma.
//! * **Values**: BSDF in sr⁻¹ *without* the cosine; phase functions integrate to 1 over the sphere; intensity in its
//!   declared unit; wavelengths in nm, strictly increasing. Missing samples are masked (NaN in memory), never 0.
//! * **Axes** in order `[incoming, outgoing, wavelength]`, row-major, wavelength contiguous; `f32` samples, `f64` for
//!   geometry and accumulation.
//! * **Reproducibility**: where bits matter (all geometry here), elementary functions come from the pure Rust `libm`,
//!   so that equal input gives equal bytes on every machine.

mod axis;
pub mod colour;
mod direction;
mod direction_grid;
mod errors;
mod lattice;
pub mod limits;
mod lobe;
mod note;
mod option;
mod progress;
mod quantity;
mod restated;
mod schema;
mod shared;
mod tensor;
mod totals;
mod triangles;
pub mod vector;
mod views;
mod wavelengths;

#[doc(hidden)]
pub use axis::check_axes;
pub use axis::{Axis, AxisError, Layout};
pub use direction::Direction;
pub use direction_grid::{AzimuthExtent, Azimuths, DirectionGrid, DirectionGridError, Frame, Outside, WIDEST_GAP};
pub use errors::{DEFAULT_ERROR, ErrorAccumulator, ErrorReport};
pub use lattice::Symmetry;
pub(crate) use lattice::{MOST_NEIGHBOURS, Neighbours};
pub use lobe::{CENTRES, Lobe, LobeCentre, LobeError, LobeParameters, LobeUnder};
#[doc(hidden)]
pub use lobe::{ROUGHNESS_OF_WIDTH, microfacets};
#[doc(hidden)]
pub use note::ToNoteValue;
pub use note::{Note, NoteKind, NoteTemplate, NoteValue};
pub use option::{Declared, Limits, Values, any_text};
pub use progress::{Cancelled, Progress, Silent};
#[doc(hidden)]
pub use quantity::named;
pub use quantity::{Quantity, Sampling, Unit, UnknownName};
pub use restated::cancelling_samples;
pub(crate) use restated::{MeanErrors, Restated};
#[cfg(feature = "schema")]
#[doc(hidden)]
pub use schema::{object_of, one_of, schema_of, values_of};
pub use shared::Shared;
#[doc(hidden)]
pub use tensor::first_where;
pub use tensor::{Measurement, Tensor, TensorError};
pub(crate) use totals::Totals;
pub use triangles::{Domain, TriangleMesh};
pub use triangles::{Vertices, centroid, child, solid_angle};
#[cfg(feature = "schema")]
#[doc(hidden)]
pub use utoipa;
pub use views::{Brdf, Reflectance, Spectrum};
pub use wavelengths::{WavelengthError, WavelengthGrid, readable};
