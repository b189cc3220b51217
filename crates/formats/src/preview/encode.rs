//! Encoding of linear sRGB as PNG.

use super::error::PreviewError;
use crate::domain::colour::{linear_to_srgb, srgb_to_linear};

/// Table that converts linear values to eight-bit sRGB by lookup instead of a power function.
pub(super) struct Transfer {
    /// Smallest linear sRGB value that is gamma-encoded as each byte from 1 to 255.
    thresholds: [f32; 255],
}

impl Transfer {
    pub(super) fn new() -> Self {
        let mut thresholds = [0.0; 255];
        for (i, threshold) in thresholds.iter_mut().enumerate() {
            *threshold = srgb_to_linear((i as f64 + 0.5) / 255.0) as f32;
        }
        Self { thresholds }
    }

    pub(super) fn byte(&self, linear: f32) -> u8 {
        self.thresholds.partition_point(|&threshold| threshold <= linear) as u8
    }
}

/// Returns the gamma-encoded sRGB values (0 to 1) of linear values from 0 to 1.
pub(super) fn encoded(linear: [f64; 3]) -> [f32; 3] {
    linear.map(|c| linear_to_srgb(c.clamp(0.0, 1.0)) as f32)
}

/// Returns a PNG of `size` × `size` sRGB pixels, from their bytes red, green and blue, row by row.
pub(super) fn png(size: usize, pixels: &[u8]) -> Result<Vec<u8>, PreviewError> {
    let refused = |error: png::EncodingError| PreviewError::Encode(error.to_string());
    let mut bytes = Vec::with_capacity(size * size);
    let mut encoder = png::Encoder::new(&mut bytes, size as u32, size as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    encoder.set_compression(png::Compression::Balanced);
    let mut writer = encoder.write_header().map_err(refused)?;
    writer.write_image_data(pixels).map_err(refused)?;
    writer.finish().map_err(refused)?;
    Ok(bytes)
}
