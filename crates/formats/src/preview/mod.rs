//! Previews of a material: its colours under a named light, and a picture as PNG.
//!
//! # Conventions
//! * **Reflectance** is relative to the perfect diffuser, which is white: radiance factors π·f, albedos, reflectances.
//!   Relative values are relative to the brightest requested spectrum.
//! * **Lights** are also relative to the brightest requested spectrum, beside a white of the illuminant's chromaticity.
//!   Their sRGB is as bright as possible without turning white: the largest channel is 1.
//! * **sRGB** is adapted from the illuminant's white to D65 (linear Bradford), so that the perfect diffuser is white in
//!   any light. Out of gamut, hue and lightness are kept and chroma is reduced ([`map_to_gamut`]).
//! * **RGB data** are taken as linear sRGB.
//! * **Pictures** are the same bytes on every machine and number of threads.
//!
//! [`map_to_gamut`]: crate::domain::colour::map_to_gamut

mod ball;
mod canvas;
mod colours;
mod encode;
mod error;
mod font;
mod ink;
mod look;
mod plot;
mod polar;
mod scale;
mod svg;

pub use crate::appearance::Viewing;
pub use colours::{Colour, Colours, Question, colours};
pub use error::{PreviewError, QuestionError};
pub use look::{DEFAULT_SIZE, Look, SIZES, Style};

use crate::appearance::Channels;
use crate::domain::{Axis, Quantity};
use crate::evaluate::Material;
use error::unfit;

/// Returns a picture of `material` as PNG or SVG with the given look. A BRDF, BTDF or BSDF is shown as a ball, a
/// luminaire or a phase function as a polar diagram, and spectra as a plot. `index` selects an entry of the leading
/// index axes. Without it all spectra are drawn; other materials show their first entry.
pub fn picture(
    material: &Material,
    index: Option<&[usize]>,
    viewing: &Viewing,
    look: Look<'_>,
) -> Result<Vec<u8>, PreviewError> {
    let size = look.size;
    if !SIZES.contains(&size) {
        let (low, high) = (*SIZES.start(), *SIZES.end());
        return unfit(QuestionError::Size { found: size, low, high });
    }
    let layout = material.layout();
    let axes = &material.axes()[..layout.indices];
    if let Some(index) = index {
        let fits = index.len() == axes.len() && index.iter().zip(axes).all(|(i, axis)| *i < axis.len());
        if !fits {
            let shape: Vec<usize> = axes.iter().map(Axis::len).collect();
            return unfit(QuestionError::Index { found: index.to_vec(), shape });
        }
    }
    let channels = Channels::of(material, viewing)?;
    let first = vec![0; axes.len()];
    let entry = index.unwrap_or(&first);
    match material.quantity() {
        Quantity::Phase if layout.outgoing.is_some() => polar::phase(material, entry, &channels, look),
        Quantity::Edf if layout.outgoing.is_some() => polar::luminaire(material, entry, &channels, viewing, look),
        Quantity::Reflectance if layout.incoming.is_some() && material.wavelengths().is_none() => {
            ball(material, entry, &channels, look)
        }
        Quantity::Brdf | Quantity::Btdf | Quantity::Bsdf if layout.incoming.is_some() => {
            ball(material, entry, &channels, look)
        }
        _ => plot::spectra(material, index, &channels, look),
    }
}

/// Renders a ball. It is made of pixels on dark ground, and has no other look.
fn ball(material: &Material, entry: &[usize], channels: &Channels, look: Look<'_>) -> Result<Vec<u8>, PreviewError> {
    if look.is_svg || look.title.is_some() || look.style != Style::Dark {
        return unfit(QuestionError::Ball);
    }
    ball::picture(material, entry, channels, look.size)
}

/// Returns the remark that the wavelengths of a material give no exact colours in its picture; `None` if they do, or if
/// the material has no wavelengths.
pub fn colour_remark(material: &Material, viewing: &Viewing) -> Result<Option<String>, PreviewError> {
    let Some(Axis::Wavelength(grid)) = material.axes().last() else { return Ok(None) };
    Ok(Channels::of(material, viewing)?.remark(grid))
}

#[cfg(test)]
mod tests;
