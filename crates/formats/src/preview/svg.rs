//! Diagrams as SVG 1.1: shapes and text that stay sharp at any size.

use super::ink::{Ink, Point};
use std::fmt::Write as _;

/// Number of colours along a shape whose colour varies from left to right. Raising it makes files larger.
const STOPS: usize = 65;

/// Picture in SVG while it is drawn.
pub(super) struct Svg {
    body: String,
    gradients: usize,
}

impl Svg {
    pub(super) fn new(size: usize, paper: Ink) -> Self {
        let body = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{size}\" height=\"{size}\" viewBox=\"0 0 {size} {size}\">\n\
             <rect width=\"{size}\" height=\"{size}\" fill=\"{}\"/>\n",
            hex(paper)
        );
        Self { body, gradients: 0 }
    }

    /// Fills a polygon. `ink` returns the colour and opacity at a point; they may vary from left to right.
    pub(super) fn fill(&mut self, polygon: &[Point], ink: impl Fn(Point) -> (Ink, f32)) {
        let left = polygon.iter().map(|p| p[0]).fold(f64::INFINITY, f64::min);
        let right = polygon.iter().map(|p| p[0]).fold(f64::NEG_INFINITY, f64::max);
        if !(left.is_finite() && right.is_finite()) {
            return;
        }
        let y = polygon.first().map_or(0.0, |p| p[1]);
        let at = |i: usize| ink([left + (right - left) * i as f64 / (STOPS - 1) as f64, y]);
        let (first, opacity) = at(0);
        let colours: Vec<String> = (0..STOPS).map(|i| hex(at(i).0)).collect();
        let fill = if colours.iter().all(|colour| *colour == colours[0]) {
            hex(first)
        } else {
            self.gradients += 1;
            let id = format!("g{}", self.gradients);
            let _ = write!(
                self.body,
                "<linearGradient id=\"{id}\" gradientUnits=\"userSpaceOnUse\" x1=\"{left:.2}\" y1=\"0\" x2=\"{right:.2}\" \
                 y2=\"0\">"
            );
            for (i, colour) in colours.iter().enumerate() {
                let offset = i as f64 / (STOPS - 1) as f64;
                let _ = write!(self.body, "<stop offset=\"{offset:.4}\" stop-color=\"{colour}\"/>");
            }
            self.body.push_str("</linearGradient>\n");
            format!("url(#{id})")
        };
        self.body.push_str("<polygon points=\"");
        for [x, y] in polygon {
            let _ = write!(self.body, "{x:.2},{y:.2} ");
        }
        let _ = writeln!(self.body, "\" fill=\"{fill}\" fill-opacity=\"{opacity}\" fill-rule=\"evenodd\"/>");
    }

    /// Draws a line through points with gaps where a point is `None`; `dashes` are the lengths of a dash and a gap.
    pub(super) fn line(&mut self, points: &[Option<Point>], width: f64, ink: Ink, dashes: Option<(f64, f64)>) {
        self.body.push_str("<path d=\"");
        let mut is_down = false;
        for point in points {
            if let Some([x, y]) = point {
                let _ = write!(self.body, "{}{x:.2} {y:.2}", if is_down { "L" } else { "M" });
            }
            is_down = point.is_some();
        }
        let _ = write!(self.body, "\" fill=\"none\" stroke=\"{}\" stroke-width=\"{width:.2}\"", hex(ink));
        match dashes {
            Some((on, off)) => {
                let _ = write!(self.body, " stroke-dasharray=\"{on:.2} {off:.2}\"");
            }
            None => self.body.push_str(" stroke-linecap=\"round\" stroke-linejoin=\"round\""),
        }
        self.body.push_str("/>\n");
    }

    /// Writes a text whose box has its upper left corner at `at` and is `height` high; each character takes `step`.
    pub(super) fn text(&mut self, [x, y]: Point, height: f64, step: f64, text: &str, ink: Ink) {
        let (size, length) = (1.35 * height, step * text.chars().count() as f64);
        let _ = write!(
            self.body,
            "<text x=\"{x:.2}\" y=\"{:.2}\" font-family=\"sans-serif\" font-size=\"{size:.2}\" textLength=\"{:.2}\" \
             lengthAdjust=\"spacingAndGlyphs\" fill=\"{}\">",
            y + height,
            0.95 * length,
            hex(ink)
        );
        for c in text.chars() {
            match c {
                '<' => self.body.push_str("&lt;"),
                '&' => self.body.push_str("&amp;"),
                c if c.is_control() => self.body.push(' '),
                c => self.body.push(c),
            }
        }
        self.body.push_str("</text>\n");
    }

    pub(super) fn finish(mut self) -> Vec<u8> {
        self.body.push_str("</svg>\n");
        self.body.into_bytes()
    }
}

/// Returns a colour as SVG writes it, such as `#16171a`.
fn hex(ink: Ink) -> String {
    let [r, g, b] = ink.map(|c| (255.0 * c.clamp(0.0, 1.0) + 0.5) as u8);
    format!("#{r:02x}{g:02x}{b:02x}")
}
