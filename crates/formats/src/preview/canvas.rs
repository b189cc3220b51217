//! Drawing of diagrams as pixels or as SVG: filled shapes, lines and labels. Colours are sRGB values of 0..=1.

use super::encode::png;
use super::error::PreviewError;
use super::font::{HEIGHT, STEP, WIDTH, glyph};
use super::ink::{Ink, Point};
use super::look::{Look, Palette};
use super::svg::Svg;

/// Square picture in which lines, polygons and labels are drawn; (0, 0) is the upper left corner, (size, size) the
/// lower right one. With a title, the square is smaller and lies below it.
pub(super) struct Canvas<'a> {
    look: Look<'a>,
    /// Height in pixels of the strip with the title at the top; 0 without one.
    strip: f64,
    surface: Surface,
    labels: Vec<Label>,
}

/// Text in a picture, with the upper left corner of its box.
struct Label {
    at: Point,
    text: String,
    ink: Ink,
}

/// Medium of a picture.
enum Surface {
    /// Subpixels, row by row, and their number along a side of a pixel, for smooth edges.
    Pixels(Vec<Ink>, usize),
    Svg(Svg),
}

/// Horizontal anchor of a label: the part of its text that is placed at the given point.
#[derive(Clone, Copy, Debug)]
pub(super) enum Hold {
    Left,
    Middle,
    Right,
}

impl<'a> Canvas<'a> {
    pub(super) fn new(look: Look<'a>) -> Self {
        let size = look.size;
        let paper = look.palette().paper;
        let parts = match size {
            0..=256 => 4,
            257..=512 => 3,
            _ => 2,
        };
        let surface = if look.is_svg {
            Surface::Svg(Svg::new(size, paper))
        } else {
            Surface::Pixels(vec![paper; size * size * parts * parts], parts)
        };
        let mut canvas = Self { look, strip: 0.0, surface, labels: Vec::new() };
        if look.title.is_some() {
            canvas.strip = 3.0 * canvas.extent("0").1;
        }
        canvas
    }

    /// Returns the side in pixels of the square to draw in.
    pub(super) fn size(&self) -> f64 {
        self.look.size as f64 - self.strip
    }

    pub(super) fn palette(&self) -> &'static Palette {
        self.look.palette()
    }

    /// Returns the size in pixels of one dot of the bitmap font for labels.
    pub(super) fn dot(&self) -> usize {
        ((self.look.size + 64) / 256).max(1)
    }

    /// Returns true if the picture is large enough for labels.
    pub(super) fn is_labelled(&self) -> bool {
        self.look.size >= 128
    }

    /// Returns a line width in pixels for this picture size; `at_256` is the width in a picture of 256 pixels.
    pub(super) fn stroke(&self, at_256: f64) -> f64 {
        (at_256 * self.size() / 256.0).max(0.75)
    }

    /// Returns the place in the picture of a point of the square to draw in.
    fn placed(&self, [x, y]: Point) -> Point {
        [x + 0.5 * self.strip, y + self.strip]
    }

    /// Fills a polygon by the even-odd rule. `ink` returns the colour and opacity at a point, which may vary from left
    /// to right, but not from top to bottom.
    pub(super) fn fill(&mut self, polygon: &[Point], ink: impl Fn(Point) -> (Ink, f32)) {
        let corners: Vec<Point> = polygon.iter().map(|&point| self.placed(point)).collect();
        let back = [0.5 * self.strip, self.strip];
        let ink = |[x, y]: Point| ink([x - back[0], y - back[1]]);
        let size = self.look.size;
        match &mut self.surface {
            Surface::Pixels(pixels, parts) => fill(pixels, size, *parts, &corners, ink),
            Surface::Svg(svg) => svg.fill(&corners, ink),
        }
    }

    /// Draws an opaque line through points, `width` pixels wide, with a gap at each point that is `None`.
    pub(super) fn line(&mut self, points: &[Option<Point>], width: f64, ink: Ink) {
        if let Surface::Svg(_) = self.surface {
            let points: Vec<Option<Point>> = points.iter().map(|point| point.map(|point| self.placed(point))).collect();
            if let Surface::Svg(svg) = &mut self.surface {
                svg.line(&points, width, ink, None);
            }
            return;
        }
        for pair in points.windows(2) {
            if let &[Some(a), Some(b)] = pair {
                self.segment(a, b, width, ink);
            }
        }
    }

    /// Draws a dashed line through points, `width` pixels wide, with a gap at each point that is `None`.
    pub(super) fn dashed(&mut self, points: &[Option<Point>], width: f64, ink: Ink) {
        let (on, off) = (3.0 * width, 2.5 * width);
        if let Surface::Svg(_) = self.surface {
            let points: Vec<Option<Point>> = points.iter().map(|point| point.map(|point| self.placed(point))).collect();
            if let Surface::Svg(svg) = &mut self.surface {
                svg.line(&points, width, ink, Some((on, off)));
            }
            return;
        }
        let mut travelled = 0.0;
        for pair in points.windows(2) {
            let &[Some(a), Some(b)] = pair else { continue };
            let length = libm::hypot(b[0] - a[0], b[1] - a[1]);
            let pieces = (length / (0.5 * width)).ceil().max(1.0);
            for i in 0..pieces as usize {
                let at = |t: f64| [a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t];
                let (s, t) = (i as f64 / pieces, (i + 1) as f64 / pieces);
                if (travelled + s * length) % (on + off) < on {
                    self.segment(at(s), at(t), width, ink);
                }
            }
            travelled += length;
        }
    }

    /// Draws a straight line from `a` to `b`, `width` pixels wide, with round ends.
    pub(super) fn segment(&mut self, a: Point, b: Point, width: f64, ink: Ink) {
        let (a, b, size) = (self.placed(a), self.placed(b), self.look.size);
        match &mut self.surface {
            Surface::Pixels(pixels, parts) => segment(pixels, size, *parts, [a, b], (width, ink)),
            Surface::Svg(svg) => svg.line(&[Some(a), Some(b)], width, ink, None),
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
        self.labels.push(Label { at: self.placed(at), text: text.to_owned(), ink });
    }

    /// Returns the width and height of a label in pixels.
    pub(super) fn extent(&self, text: &str) -> (f64, f64) {
        let dot = self.dot();
        ((text.chars().count() * STEP * dot) as f64, (HEIGHT * dot) as f64)
    }

    /// Draws the title over a strip of paper at the top.
    fn entitle(&mut self) {
        let Some(title) = self.look.title else { return };
        let (strip, side) = (self.strip, self.look.size as f64);
        let palette = self.palette();
        let (left, top) = (-0.5 * strip, -strip);
        let corners = [[left, top], [left + side, top], [left + side, 0.0], [left, 0.0]];
        self.fill(&corners, |_| (palette.paper, 1.0));
        let (width, height) = self.extent("0");
        let fitting = (side / width).floor().max(1.0) as usize;
        let text: String = title.chars().take(fitting).collect();
        let at = [(0.5 * (side - self.extent(&text).0)).max(2.0), 0.5 * (strip - height)];
        self.labels.push(Label { at, text, ink: palette.text });
    }

    /// Returns the picture as the bytes of a PNG or SVG.
    pub(super) fn finish(mut self) -> Result<Vec<u8>, PreviewError> {
        self.entitle();
        let (size, dot) = (self.look.size, self.dot());
        match self.surface {
            Surface::Svg(mut svg) => {
                for label in &self.labels {
                    svg.text(label.at, (HEIGHT * dot) as f64, (STEP * dot) as f64, &label.text, label.ink);
                }
                Ok(svg.finish())
            }
            Surface::Pixels(pixels, parts) => {
                let mut picture = reduced(&pixels, size, parts);
                for label in &self.labels {
                    write(&mut picture, size, dot, label);
                }
                let bytes: Vec<u8> =
                    picture.iter().flatten().map(|c| (255.0 * c.clamp(0.0, 1.0) + 0.5) as u8).collect();
                png(size, &bytes)
            }
        }
    }
}

/// Fills a polygon by the even-odd rule with the colour and opacity that `ink` returns at the centre of each subpixel.
fn fill(pixels: &mut [Ink], size: usize, parts: usize, polygon: &[Point], ink: impl Fn(Point) -> (Ink, f32)) {
    let scale = parts as f64;
    let side = size * parts;
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
                let under = &mut pixels[row * side + x];
                *under = [0, 1, 2].map(|k| under[k] + cover * (colour[k] - under[k]));
            }
        }
    }
}

/// Draws a straight line with round ends into subpixels.
fn segment(pixels: &mut [Ink], size: usize, parts: usize, [a, b]: [Point; 2], (width, ink): (f64, Ink)) {
    let r = 0.5 * width;
    let along = [b[0] - a[0], b[1] - a[1]];
    let squared = along[0] * along[0] + along[1] * along[1];
    let (scale, side) = (parts as f64, size * parts);
    let range = |k: usize| {
        let end = |v: f64| (v * scale).clamp(0.0, side as f64);
        end(a[k].min(b[k]) - r).floor() as usize..end(a[k].max(b[k]) + r).ceil() as usize
    };
    for y in range(1) {
        for x in range(0) {
            let p = [(x as f64 + 0.5) / scale - a[0], (y as f64 + 0.5) / scale - a[1]];
            let t = if squared > 0.0 { ((p[0] * along[0] + p[1] * along[1]) / squared).clamp(0.0, 1.0) } else { 0.0 };
            let off = [p[0] - t * along[0], p[1] - t * along[1]];
            if off[0] * off[0] + off[1] * off[1] <= r * r {
                pixels[y * side + x] = ink;
            }
        }
    }
}

/// Returns the mean of the subpixels of each pixel.
fn reduced(pixels: &[Ink], size: usize, parts: usize) -> Vec<Ink> {
    let (side, share) = (size * parts, 1.0 / (parts * parts) as f32);
    (0..size * size)
        .map(|i| {
            let (x, y) = (i % size * parts, i / size * parts);
            let mut sum = [0.0; 3];
            for row in pixels.chunks_exact(side).skip(y).take(parts) {
                for ink in &row[x..x + parts] {
                    sum = [0, 1, 2].map(|k| sum[k] + share * ink[k]);
                }
            }
            sum
        })
        .collect()
}

/// Writes a label in the bitmap font, whose dots are `dot` pixels wide.
fn write(picture: &mut [Ink], size: usize, dot: usize, label: &Label) {
    let (left, top) = (label.at[0] as usize, label.at[1] as usize);
    for (i, c) in label.text.chars().enumerate() {
        for (row, bits) in glyph(c).into_iter().enumerate() {
            for column in (0..WIDTH).filter(|column| bits >> (WIDTH - 1 - column) & 1 == 1) {
                for part in 0..dot * dot {
                    let x = left + (i * STEP + column) * dot + part % dot;
                    let y = top + row * dot + part / dot;
                    if x < size && y < size {
                        picture[y * size + x] = label.ink;
                    }
                }
            }
        }
    }
}
