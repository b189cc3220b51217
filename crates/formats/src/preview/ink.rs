//! Colours and points of a drawing.

/// Colour of a drawing, gamma-encoded sRGB from 0 to 1.
pub(super) type Ink = [f32; 3];
/// Point of a drawing in pixels, to the right and down from the upper left corner.
pub(super) type Point = [f64; 2];
