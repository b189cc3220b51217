//! Polar diagrams: intensity of a luminaire in two planes, and a phase function over the scattering angle.

use super::canvas::{Canvas, Hold};
use super::encode::encoded;
use super::error::PreviewError;
use super::ink::{Ink, Point};
use super::look::{Look, Palette};
use super::scale::{short, step};
use crate::appearance::{Channels, Viewing};
use crate::domain::colour::map_to_gamut;
use crate::domain::{Axis, Direction, Unit};
use crate::evaluate::{Interpolation, Material, Place};

/// Ratio of largest to smallest scattered light above which a polar diagram has a logarithmic radius. Raising it draws
/// more diagrams linearly.
const LINEAR_SPAN: f64 = 12.0;
/// Upper bound on the number of decades that a logarithmic radius of a polar diagram shows. Raising it shows weaker
/// light.
const DECADES: f64 = 4.0;

/// Position of a polar diagram in the picture: its centre, and its radius in pixels for a value of 1.
struct Dial {
    centre: Point,
    radius: f64,
}

impl Dial {
    /// Returns the point of a polar diagram at a radius of 0..=1 and an angle in degrees; 0 points down and angles
    /// increase counter-clockwise.
    fn at(&self, r: f64, degrees: f64) -> Point {
        let (sin, cos) = libm::sincos(degrees.to_radians());
        [self.centre[0] + self.radius * r * sin, self.centre[1] + self.radius * r * cos]
    }
}

/// Draws a polar diagram of the intensity of entry `index` of a luminaire in the planes C 0°–180° (filled) and C
/// 90°–270° (dashed). Gamma 0° points down.
pub(super) fn luminaire(
    material: &Material,
    index: &[usize],
    channels: &Channels,
    viewing: &Viewing,
    look: Look<'_>,
) -> Result<Vec<u8>, PreviewError> {
    let amount = Amount::of(material, viewing);
    let mut spectrum = vec![0.0; material.lambdas()];
    let mut light = [0.0_f64; 3];
    let mut planes = [Vec::new(), Vec::new()];
    for (plane, values) in planes.iter_mut().enumerate() {
        // Angles −180° to 180° are gamma: positive in the plane C, negative in the opposite plane.
        for angle in -180..=180_i32 {
            let c = 90.0 * plane as f64 + if angle < 0 { 180.0 } else { 0.0 };
            let wo = Direction::from_luminaire_degrees(c, f64::from(angle.abs()));
            material.evaluate(Place { index, wi: None, wo: Some(wo) }, Interpolation::Smooth, &mut spectrum)?;
            let value = amount.of_spectrum(&spectrum);
            if value.is_finite() && value > 0.0 {
                let rgb = channels.linear(&spectrum);
                light = [0, 1, 2].map(|k| light[k] + f64::from(if rgb[k].is_nan() { 0.0 } else { rgb[k] }));
            }
            values.push(value);
        }
    }
    let largest = planes.iter().flatten().copied().filter(|v| v.is_finite()).fold(0.0, f64::max);
    if largest <= 0.0 {
        return Err(crate::domain::colour::ColourError::Dark.into());
    }
    // With little upward light the centre moves up.
    let up = planes.iter().flat_map(|p| p.iter().enumerate()).filter(|(i, _)| (*i as i32 - 180).abs() > 100);
    let up = up.map(|(_, v)| *v).filter(|v| v.is_finite()).fold(0.0, f64::max);
    let half = up < 0.04 * largest;
    let mut canvas = Canvas::new(look);
    let palette = canvas.palette();
    let whole = canvas.size();
    let dial = dial(&canvas, half, &planes, largest);
    let (lines, wide) = (canvas.stroke(1.0), canvas.stroke(2.0));
    // Rings extend to the corners.
    let rings = step(largest, 4);
    let farthest = whole * if half { 1.4 } else { 0.9 } / dial.radius * largest;
    for ring in (1..64).map(|i| f64::from(i) * rings).take_while(|r| *r <= farthest) {
        canvas.circle(dial.centre, dial.radius * ring / largest, lines, palette.grid);
    }
    for angle in (0..360).step_by(30) {
        canvas.segment(dial.at(0.0, 0.0), dial.at(4.0, f64::from(angle)), lines, palette.grid);
    }
    let ink = ink_of(light, channels.coloured(), palette);
    let point = |i: usize, v: f64| dial.at(v.max(0.0) / largest, i as f64 - 180.0);
    let outline: Vec<Point> =
        planes[0].iter().enumerate().map(|(i, v)| point(i, if v.is_finite() { *v } else { 0.0 })).collect();
    let line = |plane: &[f64]| -> Vec<Option<Point>> {
        plane.iter().enumerate().map(|(i, v)| v.is_finite().then(|| point(i, *v))).collect()
    };
    canvas.fill(&outline, |_| (ink, 0.38));
    canvas.dashed(&line(&planes[1]), wide, mixed(ink, palette.text, 0.45));
    canvas.line(&line(&planes[0]), wide, ink);
    canvas.segment(dial.at(0.0, 0.0), dial.at(0.0, 0.0), 2.0 * wide, palette.axis);
    label_angles(&mut canvas, &dial, half);
    // Labels lie along 15°, between the rays.
    let shown = (1..64).map(|i| f64::from(i) * rings).take_while(|r| *r <= 1.05 * largest);
    for ring in shown {
        canvas.label(dial.at(ring / largest, 15.0), Hold::Middle, &short(ring), palette.text);
    }
    legend(&mut canvas, amount.unit, largest, &[("C0-180", false), ("C90-270", true)]);
    canvas.finish()
}

/// Draws a polar diagram of the phase function of entry `index` over the scattering angle. 0° is forward and points
/// right. Each direction has the colour of its scattered light.
pub(super) fn phase(
    material: &Material,
    index: &[usize],
    channels: &Channels,
    look: Look<'_>,
) -> Result<Vec<u8>, PreviewError> {
    let layout = material.layout();
    let axes = material.axes();
    let wi = layout.incoming.map(|axis| super::colours::normal(&axes[axis]));
    let mut spectrum = vec![0.0; material.lambdas()];
    // Angles 0..360°. wi points to the source, so that forward is −wi. The curve is the mean over wavelengths.
    let mut values = Vec::new();
    let mut inks = Vec::new();
    for angle in 0..=360_u32 {
        let wo = Direction::from_degrees(
            180.0 - f64::from(if angle > 180 { 360 - angle } else { angle }),
            if angle > 180 { 180.0 } else { 0.0 },
        );
        material.evaluate(Place { index, wi, wo: Some(wo) }, Interpolation::Smooth, &mut spectrum)?;
        let measured: Vec<f64> = spectrum.iter().filter(|v| !v.is_nan()).map(|v| f64::from(*v)).collect();
        values.push(measured.iter().sum::<f64>() / measured.len() as f64);
        inks.push(ink_of(channels.linear(&spectrum).map(f64::from), channels.coloured(), look.palette()));
    }
    let positive = || values.iter().copied().filter(|v| v.is_finite() && *v > 0.0);
    let (smallest, largest) = (positive().fold(f64::INFINITY, f64::min), positive().fold(0.0, f64::max));
    if largest <= 0.0 {
        return Err(crate::domain::colour::ColourError::Dark.into());
    }
    let logarithmic = largest > LINEAR_SPAN * smallest;
    let mut canvas = Canvas::new(look);
    let palette = canvas.palette();
    let whole = canvas.size();
    let dial = Dial { centre: [0.5 * whole, 0.5 * whole], radius: 0.40 * whole };
    let (low, high) = if logarithmic {
        let high = libm::ceil(libm::log10(largest) - 1e-9);
        (libm::floor(libm::log10(smallest) + 1e-9).max(high - DECADES) - 0.5, high)
    } else {
        (0.0, largest)
    };
    let radius = |v: f64| {
        let v = if logarithmic { libm::log10(v.max(1e-300)) } else { v };
        ((v - low) / (high - low)).clamp(0.0, 1.0)
    };
    // 0° points right; angles of the dial start downward.
    let at = |r: f64, degrees: f64| dial.at(r, degrees + 90.0);
    let (lines, wide) = (canvas.stroke(1.0), canvas.stroke(2.0));
    let rings: Vec<f64> = if logarithmic {
        (0..=16).map(|i| libm::ceil(low) + f64::from(i)).take_while(|r| *r <= high).collect()
    } else {
        let step = step(largest, 4);
        (1..16).map(|i| f64::from(i) * step).take_while(|r| *r <= 1.05 * largest).collect()
    };
    let of_ring = |ring: f64| (ring - low) / (high - low) * dial.radius;
    for &ring in &rings {
        canvas.circle(dial.centre, of_ring(ring), lines, palette.grid);
    }
    for angle in (0..360).step_by(30) {
        canvas.segment(dial.centre, at(1.0, f64::from(angle)), lines, palette.grid);
    }
    let outline: Vec<Option<Point>> =
        values.iter().enumerate().map(|(i, v)| v.is_finite().then(|| at(radius(*v), i as f64))).collect();
    for (i, pair) in outline.windows(2).enumerate() {
        if let &[Some(a), Some(b)] = pair {
            let ink = inks[i];
            canvas.fill(&[dial.centre, a, b], |_| (ink, 0.55));
        }
    }
    for (i, pair) in outline.windows(2).enumerate() {
        if let &[Some(a), Some(b)] = pair {
            canvas.segment(a, b, wide, inks[i]);
        }
    }
    arrow(&mut canvas, &dial);
    for angle in (0..360_u32).step_by(30) {
        let shown = if angle > 180 { 360 - angle } else { angle };
        canvas.label(at(1.13, f64::from(angle)), Hold::Middle, &format!("{shown}°"), palette.text);
    }
    for &ring in &rings {
        let value = if logarithmic { libm::pow(10.0, ring) } else { ring };
        canvas.label(at((ring - low) / (high - low), 75.0), Hold::Middle, &short(value), palette.text);
    }
    legend(&mut canvas, symbol(material.unit()), largest, &[]);
    canvas.finish()
}

/// Draws the unit and the largest value in the upper left corner of a polar diagram and the key to its line styles in
/// the upper right one.
fn legend(canvas: &mut Canvas<'_>, unit: &str, largest: f64, lines: &[(&str, bool)]) {
    let text = canvas.palette().text;
    let (_, height) = canvas.extent("0");
    let whole = canvas.size();
    canvas.label([4.0, 0.5 * height + 4.0], Hold::Left, unit, text);
    canvas.label([4.0, 2.0 * height + 4.0], Hold::Left, &format!("max {}", short(largest)), text);
    if !canvas.is_labelled() {
        return;
    }
    for (i, (name, is_dashed)) in lines.iter().enumerate() {
        let y = 0.5 * height + 4.0 + i as f64 * 1.5 * height;
        canvas.label([whole - 3.0, y], Hold::Right, name, text);
        let (width, _) = canvas.extent("C90-270");
        let (end, stroke) = (whole - width - 6.0, canvas.stroke(1.5));
        let points = [Some([end - 9.0 * stroke, y]), Some([end, y])];
        if *is_dashed { canvas.dashed(&points, stroke, text) } else { canvas.line(&points, stroke, text) }
    }
}

/// Draws the incident light of a phase function as an arrow from the left to the centre.
fn arrow(canvas: &mut Canvas<'_>, dial: &Dial) {
    let width = canvas.stroke(1.5);
    let at = |r: f64, across: f64| [dial.centre[0] - dial.radius * r, dial.centre[1] + dial.radius * across];
    let text = canvas.palette().text;
    canvas.segment(at(0.98, 0.0), at(0.06, 0.0), width, text);
    canvas.fill(&[at(0.0, 0.0), at(0.09, 0.04), at(0.09, -0.04)], |_| (text, 1.0));
}

/// Reduction of a luminaire's spectrum to the one number that a polar diagram shows.
enum Sum {
    /// Luminous intensity in cd from a spectrum of radiant intensity per nm: the sum of its samples, each times a
    /// photometric weight. Holds the weight of each sample.
    Luminous(Vec<f32>),
    /// Integral over wavelengths of a spectral intensity per nm: the sum of its samples, each times a weight. Holds the
    /// weight of each sample.
    Integral(Vec<f64>),
    Mean,
}

struct Amount {
    sum: Sum,
    unit: &'static str,
}

impl Amount {
    fn of(material: &Material, viewing: &Viewing) -> Self {
        let unit = material.unit();
        let Some(Axis::Wavelength(grid)) = material.axes().last() else {
            return Self { sum: Sum::Mean, unit: symbol(unit) };
        };
        let watts = match unit {
            Unit::WattPerSteradianNanometre => Some(1.0),
            Unit::MilliwattPerSteradianNanometre => Some(1e-3),
            Unit::MicrowattPerSteradianNanometre => Some(1e-6),
            _ => None,
        };
        if let (Some(watts), true, Ok(weights)) = (watts, viewing.is_photometric(), viewing.emission(grid)) {
            let weights = weights.weights().iter().map(|w| (watts * w[1]) as f32).collect();
            return Self { sum: Sum::Luminous(weights), unit: "cd" };
        }
        let summed = match unit {
            Unit::WattPerSteradianNanometre => "W/sr",
            Unit::MilliwattPerSteradianNanometre => "mW/sr",
            Unit::MicrowattPerSteradianNanometre => "uW/sr",
            Unit::MicromolePerSecondSteradianNanometre => "umol/s/sr",
            Unit::RelativePerNanometre => "relative",
            other => return Self { sum: Sum::Mean, unit: symbol(other) },
        };
        Self { sum: Sum::Integral(grid.weights()), unit: summed }
    }

    /// Returns the number that a polar diagram shows for a spectrum; NaN if all samples are masked.
    fn of_spectrum(&self, spectrum: &[f32]) -> f64 {
        let weight = |i: usize| match &self.sum {
            Sum::Luminous(weights) => f64::from(weights[i]),
            Sum::Integral(weights) => weights[i],
            Sum::Mean => 1.0 / spectrum.len() as f64,
        };
        let measured = spectrum.iter().enumerate().filter(|(_, v)| !v.is_nan());
        let (sum, count) = measured.fold((0.0, 0), |(sum, n), (i, v)| (sum + weight(i) * f64::from(*v), n + 1));
        if count > 0 { sum } else { f64::NAN }
    }
}

fn symbol(unit: Unit) -> &'static str {
    match unit {
        Unit::One => "",
        other => other.name(),
    }
}

/// Returns the position of a polar diagram with the largest radius that leaves room for the labels.
fn dial(canvas: &Canvas<'_>, half: bool, planes: &[Vec<f64>; 2], largest: f64) -> Dial {
    let whole = canvas.size();
    let (text, height) = if canvas.is_labelled() { canvas.extent("180°") } else { (0.0, 0.0) };
    let centre = if half { [0.5 * whole, 0.13 * whole + height] } else { [0.5 * whole, 0.5 * whole] };
    let unit = Dial { centre: [0.0, 0.0], radius: 1.0 };
    let room = [0.5 * whole - text - 6.0, whole - centre[1] - height - 8.0, centre[1] - height - 8.0];
    let mut radius = whole;
    for (i, v) in planes.iter().flat_map(|p| p.iter().enumerate()) {
        if v.is_finite() && *v > 0.0 {
            let [x, y] = unit.at(v / largest, i as f64 - 180.0);
            let (down, above) = (y.max(1e-9), (-y).max(1e-9));
            radius = radius.min(room[0] / x.abs().max(1e-9)).min(room[1] / down).min(room[2] / above);
        }
    }
    Dial { centre, radius }
}

/// Labels the rays of a polar diagram with their angles along the edge of the picture.
fn label_angles(canvas: &mut Canvas<'_>, dial: &Dial, half: bool) {
    let whole = canvas.size();
    let (_, height) = canvas.extent("0");
    let (inset, side) = (0.5 * height + 4.0, 4.0);
    for angle in (0..360_u32).step_by(30) {
        let shown = if angle > 180 { 360 - angle } else { angle };
        // The legend occupies the position of 150°.
        if shown == 150 || half && shown > 90 {
            continue;
        }
        let (sin, cos) = libm::sincos(f64::from(angle).to_radians());
        // Extends to the nearest edge along the ray.
        let room = |c: f64, s: f64, inset: f64| {
            if s > 1e-9 {
                (whole - inset - c) / s
            } else if s < -1e-9 {
                (inset - c) / s
            } else {
                f64::INFINITY
            }
        };
        let (across, along) = (room(dial.centre[0], sin, side), room(dial.centre[1], cos, inset));
        let t = across.min(along);
        let at = [dial.centre[0] + t * sin, dial.centre[1] + t * cos];
        let hold = if along <= across {
            Hold::Middle
        } else if sin > 0.0 {
            Hold::Right
        } else {
            Hold::Left
        };
        let text = canvas.palette().text;
        canvas.label(at, hold, &format!("{shown}°"), text);
    }
}

/// Returns the display colour of light given in linear sRGB, scaled to full brightness and lightened enough to be
/// visible on dark paper, or darkened for white.
fn ink_of(light: [f64; 3], coloured: bool, palette: &Palette) -> Ink {
    let brightest = light.iter().copied().fold(0.0, f64::max);
    if !coloured || brightest <= 0.0 || light.iter().any(|c| c.is_nan()) {
        return palette.neutral;
    }
    let ink = encoded(map_to_gamut(light.map(|c| 0.9 * c / brightest)));
    if palette.paper[0] > 0.5 {
        return palette.visible(ink, 0.0);
    }
    // Deep blue would be invisible on dark paper.
    let seen = ink.iter().sum::<f32>() / 3.0;
    if seen < 0.35 { mixed(ink, palette.text, f64::from(0.35 - seen)) } else { ink }
}

fn mixed(a: Ink, b: Ink, t: f64) -> Ink {
    [0, 1, 2].map(|k| a[k] + (b[k] - a[k]) * t as f32)
}
