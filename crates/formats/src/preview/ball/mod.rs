//! Rendering of a ball of a material on dark ground: a square key light, a strip light from behind, and soft
//! surroundings. A ball that transmits light has a lamp inside.
//!
//! Radiance is computed in absolute terms; white paper facing the key light is just below white. A ball much darker or
//! brighter than that is exposed. Luminance above 0.75 is compressed towards white at constant hue, and colours are
//! mapped into the gamut.

mod lattice;
mod scene;
mod shade;
mod surface;

use super::encode::{Transfer, png};
use super::error::PreviewError;
use crate::appearance::Channels;
use crate::domain::colour::map_to_gamut;
use crate::evaluate::Material;
use lattice::Rgb;
use rayon::prelude::*;
use scene::Scene;
use surface::Surface;

/// Upper and lower bound on the 90th percentile of the luminance of the rendered ball. A brighter or darker ball is
/// scaled to the bound. Raising them makes pictures brighter.
const BRIGHT: f32 = 0.9;
const DARK: f32 = 0.10;
/// Luminance above which the rendered ball is compressed towards white. Raising it keeps more tones linear and hardens
/// highlights.
const SHOULDER: f32 = 0.75;

/// Renders one entry of a material as a ball; returns a PNG of `size` × `size` pixels. `index` selects the entry by one
/// number for each index axis of the material.
pub(super) fn picture(
    material: &Material,
    index: &[usize],
    channels: &Channels,
    size: usize,
) -> Result<Vec<u8>, PreviewError> {
    material.needs_whole("picture of a ball")?;
    let surface = Surface::of(material.over_triangles()?, index, channels)?;
    let scene = Scene::of(&surface, size)?;
    let pixels = scene.pixels()?;
    let exposure = exposure(&pixels);
    let transfer = Transfer::new();
    let mut bytes = vec![0; size * size * 3];
    bytes.par_chunks_mut(size * 3).zip(pixels.par_chunks(size)).for_each(|(out, row)| {
        for (out, pixel) in out.chunks_exact_mut(3).zip(row) {
            let ball = map_to_gamut(bent(pixel.ball, exposure));
            for k in 0..3 {
                out[k] = transfer.byte(pixel.coverage * ball[k] as f32 + (1.0 - pixel.coverage) * pixel.ground[k]);
            }
        }
    });
    png(size, &bytes)
}

/// Returns the exposure, a factor on the radiance of the rendered ball that brings its luminance into range.
fn exposure(pixels: &[scene::Pixel]) -> f32 {
    let mut lights: Vec<f32> = pixels.iter().filter(|p| p.coverage == 1.0).map(|p| luminance(p.ball)).collect();
    lights.sort_by(f32::total_cmp);
    match lights.get(lights.len() * 9 / 10) {
        Some(&light) if light > BRIGHT => BRIGHT / light,
        Some(&light) if light > 1e-30 && light < DARK => DARK / light,
        _ => 1.0,
    }
}

fn luminance([r, g, b]: Rgb) -> f32 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// Applies the exposure to a linear RGB colour and compresses luminance above [`SHOULDER`] towards 1. All channels are
/// scaled equally, which keeps the hue.
fn bent(linear: Rgb, exposure: f32) -> [f64; 3] {
    let linear = linear.map(|c| exposure * c);
    let light = luminance(linear);
    let factor = if light > SHOULDER {
        let room = 1.0 - SHOULDER;
        let over = (light - SHOULDER) / room;
        // Slope 1 at the shoulder, limit 1 at infinity. A rational function gives equal bits on every machine.
        (SHOULDER + room * over / (1.0 + over)) / light
    } else {
        1.0
    };
    linear.map(|c| f64::from(factor * c))
}
