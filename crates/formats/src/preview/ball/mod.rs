//! A ball of a material on dark ground: under a square key light and a strip from behind, in soft surroundings; one that
//! lets light through has a lamp inside.
//!
//! Radiance is computed as it is (white paper in front of the key light is just below white), then exposed if the ball is
//! much darker or brighter than that, bent towards white above 0.8 at constant hue, and mapped into the gamut.

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

/// Nine tenths of the ball are darker than this: as bright, and as dark, as they may be without exposure.
const BRIGHT: f32 = 0.9;
const DARK: f32 = 0.10;
/// Where the curve to white begins.
const SHOULDER: f32 = 0.75;

/// The picture of entry `index` as a PNG of `size` × `size`.
pub(super) fn picture(
    material: &Material,
    index: &[usize],
    channels: &Channels,
    size: usize,
) -> Result<Vec<u8>, PreviewError> {
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

/// What the ball's radiance is multiplied by.
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

/// Exposed, and bent towards 1 above the shoulder: all channels by the same factor, so that hue stays.
fn bent(linear: Rgb, exposure: f32) -> [f64; 3] {
    let linear = linear.map(|c| exposure * c);
    let light = luminance(linear);
    let factor = if light > SHOULDER {
        let room = 1.0 - SHOULDER;
        let over = (light - SHOULDER) / room;
        // Slope 1 at the shoulder, 1 at infinity; rational, so that it is the same everywhere.
        (SHOULDER + room * over / (1.0 + over)) / light
    } else {
        1.0
    };
    linear.map(|c| f64::from(factor * c))
}
