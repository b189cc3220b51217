//! Drawing of diagrams: filled shapes, lines and labels, antialiased by subpixels. Colours are sRGB values of 0..=1.

use super::encode::png;
use super::error::PreviewError;
use super::font::{HEIGHT, STEP, WIDTH, glyph};

pub(super) type Ink = [f32; 3];
pub(super) type Point = [f64; 2];

/// Square picture in which lines, polygons and labels are drawn; (0, 0) is the upper left corner, (size, size) the
/// lower right one.
pub(super) struct Canvas {
    size: usize,
    /// Number of subpixels along a side of a pixel, for smooth edges.
    parts: usize,
    pixels: Vec<Ink>,
    labels: Vec<(Point, String, Ink)>,
}

/// Horizontal anchor of a label: the part of its text that is placed at the given point.
#[derive(Clone, Copy, Debug)]
pub(super) enum Hold {
    Left,
    Middle,
    Right,
}

/// Colour of the background of pictures, gamma-encoded sRGB from 0 to 1.
pub(super) const PAPER: Ink = [0.085, 0.09, 0.10];
/// Colour of grid lines in pictures, gamma-encoded sRGB from 0 to 1.
pub(super) const GRID: Ink = [0.22, 0.23, 0.25];
/// Colour of axes in pictures, gamma-encoded sRGB from 0 to 1.
pub(super) const AXIS: Ink = [0.40, 0.42, 0.45];
/// Colour of labels in pictures, gamma-encoded sRGB from 0 to 1.
pub(super) const TEXT: Ink = [0.72, 0.74, 0.77];

impl Canvas {
    pub(super) fn new(size: usize) -> Self {
        let parts = if size > 256 { 3 } else { 4 };
        Self { size, parts, pixels: vec![PAPER; size * size * parts * parts], labels: Vec::new() }
    }

    pub(super) fn size(&self) -> f64 {
        self.size as f64
    }

    /// Returns the size in pixels of one dot of the bitmap font for labels.
    pub(super) fn dot(&self) -> usize {
        if self.size >= 448 { 2 } else { 1 }
    }

    /// Returns true if the picture is large enough for labels.
    pub(super) fn is_labelled(&self) -> bool {
        self.size >= 128
    }

    /// Returns a line width in pixels for this picture size; `at_256` is the width in a picture of 256 pixels.
    pub(super) fn stroke(&self, at_256: f64) -> f64 {
        (at_256 * self.size() / 256.0).max(0.75)
    }

    /// Fills a polygon by the even-odd rule. `ink` returns the colour and opacity at the centre of each subpixel.
    pub(super) fn fill(&mut self, polygon: &[Point], ink: impl Fn(Point) -> (Ink, f32)) {
        let scale = self.parts as f64;
        let side = self.size * self.parts;
        let top = polygon.iter().map(|p| p[1]).fold(f64::INFINITY, f64::min) * scale;
        let bottom = polygon.iter().map(|p| p[1]).fold(f64::NEG_INFINITY, f64::max) * scale;
        let rows = top.floor().clamp(0.0, side as f64) as usize..bottom.ceil().clamp(0.0, side as f64) as usize;
        let mut crossings = Vec::new();
        for row in rows {
            let y = row as f64 + 0.5;
            crossings.clear();
            for (i, a) in polygon.iter().enumerate() {
                let b = polygon[(i + 1) % polygon.len()];
                let (a, b) = (a.map(|c| c * scale), b.map(|c| c * scale));
                if (a[1] <= y) != (b[1] <= y) {
                    crossings.push(a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]));
                }
            }
            crossings.sort_by(f64::total_cmp);
            for pair in crossings.chunks_exact(2) {
                let end = |x: f64| (x + 0.5).floor().clamp(0.0, side as f64) as usize;
                for x in end(pair[0])..end(pair[1]) {
                    let (colour, cover) = ink([(x as f64 + 0.5) / scale, y / scale]);
                    let under = &mut self.pixels[row * side + x];
                    *under = [0, 1, 2].map(|k| under[k] + cover * (colour[k] - under[k]));
                }
            }
        }
    }

    /// Draws an opaque line through points, `width` pixels wide, with a gap at each point that is `None`.
    pub(super) fn line(&mut self, points: &[Option<Point>], width: f64, ink: Ink) {
        for pair in points.windows(2) {
            if let &[Some(a), Some(b)] = pair {
                self.segment(a, b, width, ink);
            }
        }
    }

    /// Draws a straight line from `a` to `b`, `width` pixels wide, with round ends.
    pub(super) fn segment(&mut self, a: Point, b: Point, width: f64, ink: Ink) {
        let r = 0.5 * width;
        let along = [b[0] - a[0], b[1] - a[1]];
        let squared = along[0] * along[0] + along[1] * along[1];
        let (scale, side) = (self.parts as f64, self.size * self.parts);
        let range = |k: usize| {
            let end = |v: f64| (v * scale).clamp(0.0, side as f64);
            end(a[k].min(b[k]) - r).floor() as usize..end(a[k].max(b[k]) + r).ceil() as usize
        };
        for y in range(1) {
            for x in range(0) {
                let p = [(x as f64 + 0.5) / scale - a[0], (y as f64 + 0.5) / scale - a[1]];
                let t =
                    if squared > 0.0 { ((p[0] * along[0] + p[1] * along[1]) / squared).clamp(0.0, 1.0) } else { 0.0 };
                let off = [p[0] - t * along[0], p[1] - t * along[1]];
                if off[0] * off[0] + off[1] * off[1] <= r * r {
                    self.pixels[y * side + x] = ink;
                }
            }
        }
    }

    /// Draws a circle with a line `width` pixels wide.
    pub(super) fn circle(&mut self, centre: Point, radius: f64, width: f64, ink: Ink) {
        let points: Vec<Option<Point>> = (0..=180)
            .map(|i| {
                let (sin, cos) = libm::sincos(f64::from(i) * std::f64::consts::TAU / 180.0);
                Some([centre[0] + radius * cos, centre[1] + radius * sin])
            })
            .collect();
        self.line(&points, width, ink);
    }

    /// Draws a label with the middle of its text line at the height of `at`, moved if necessary to stay within the
    /// picture.
    pub(super) fn label(&mut self, at: Point, hold: Hold, text: &str, ink: Ink) {
        if !self.is_labelled() {
            return;
        }
        let (width, height) = self.extent(text);
        let left = match hold {
            Hold::Left => at[0],
            Hold::Middle => at[0] - 0.5 * width,
            Hold::Right => at[0] - width,
        };
        let most = |size: f64| (self.size() - size - 2.0).max(2.0);
        let at = [left.clamp(2.0, most(width)), (at[1] - 0.5 * height).clamp(2.0, most(height))];
        self.labels.push((at, text.to_owned(), ink));
    }

    /// Returns the width and height of a label in pixels.
    pub(super) fn extent(&self, text: &str) -> (f64, f64) {
        let dot = self.dot();
        ((text.chars().count() * STEP * dot) as f64, (HEIGHT * dot) as f64)
    }

    /// Returns the picture as the bytes of a PNG.
    pub(super) fn finish(self) -> Result<Vec<u8>, PreviewError> {
        let (size, parts, side) = (self.size, self.parts, self.size * self.parts);
        let share = 1.0 / (parts * parts) as f32;
        let mut picture: Vec<Ink> = (0..size * size)
            .map(|i| {
                let (x, y) = (i % size * parts, i / size * parts);
                let mut sum = [0.0; 3];
                for row in self.pixels.chunks_exact(side).skip(y).take(parts) {
                    for ink in &row[x..x + parts] {
                        sum = [0, 1, 2].map(|k| sum[k] + share * ink[k]);
                    }
                }
                sum
            })
            .collect();
        let dot = self.dot();
        for (at, text, ink) in &self.labels {
            let (left, top) = (at[0] as usize, at[1] as usize);
            for (i, c) in text.chars().enumerate() {
                for (row, bits) in glyph(c).into_iter().enumerate() {
                    for column in (0..WIDTH).filter(|column| bits >> (WIDTH - 1 - column) & 1 == 1) {
                        for part in 0..dot * dot {
                            let x = left + (i * STEP + column) * dot + part % dot;
                            let y = top + row * dot + part / dot;
                            if x < size && y < size {
                                picture[y * size + x] = *ink;
                            }
                        }
                    }
                }
            }
        }
        let bytes: Vec<u8> = picture.iter().flatten().map(|c| (255.0 * c.clamp(0.0, 1.0) + 0.5) as u8).collect();
        png(size, &bytes)
    }
}
