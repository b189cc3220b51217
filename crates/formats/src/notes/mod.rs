//! Notes and warnings by subject: each is a variant with a kind, fields and the sentence for the user.
//!
//! To add one, add a variant here and pass it to [`ParseReport::note`](crate::formats::ParseReport::note) or to the
//! list of notes that a function returns. `docs/notes.md` lists them all.

mod check;
mod display;
mod fit;
mod lobe;
mod luminaire;
mod material;
mod phase;
mod projection;
mod scattering;
mod spectrum;
mod text;
mod values;

pub(crate) use check::CheckNote;
pub(crate) use display::{Brief, Quoted};
pub(crate) use fit::FitNote;
pub(crate) use lobe::LobeNote;
pub(crate) use luminaire::LuminaireNote;
pub(crate) use material::MaterialNote;
pub(crate) use phase::PhaseNote;
pub(crate) use projection::ProjectionNote;
pub(crate) use scattering::ScatteringNote;
pub(crate) use spectrum::SpectrumNote;
pub(crate) use text::TextNote;
pub(crate) use values::ValueNote;
