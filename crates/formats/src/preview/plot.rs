//! Plots of spectra over wavelength: a single one filled with the colours of its wavelengths, several as lines in their
//! own colours. Data without wavelengths are shown as patches.

use super::canvas::{Canvas, Hold};
use super::encode::encoded;
use super::error::PreviewError;
use super::ink::{Ink, Point};
use super::look::{Look, Palette};
use super::scale::{short, step};
use crate::appearance::Channels;
use crate::domain::colour::{Observer, Xyz, map_to_gamut, xyz_to_linear};
use crate::domain::{Axis, Direction, Quantity};
use crate::evaluate::{Interpolation, Material, Place};

/// Upper bound on the number of curves in one plot; of more spectra, evenly spaced ones are drawn. Raising it fills the
/// picture.
const MOST_CURVES: usize = 48;
/// Upper bound on the curves whose names are listed in a plot. Raising it covers more of the curves.
const MOST_NAMES: usize = 12;
/// Upper bound on the characters of a name that are listed in a plot. Raising it covers more of the curves.
const LONGEST_NAME: usize = 18;
/// Angles of incidence, in degrees, at which a plot shows the spectra of a directional reflectance.
const INCIDENCES: [f64; 4] = [0.0, 45.0, 65.0, 80.0];

/// Draws a table of spectra: curves over wavelength, or patches of colour without wavelengths.
pub(super) fn spectra(
    material: &Material,
    index: Option<&[usize]>,
    channels: &Channels,
    look: Look<'_>,
) -> Result<Vec<u8>, PreviewError> {
    let (rows, names) = rows(material, index)?;
    let scale = brightness(material, channels, &rows);
    let inks: Vec<Ink> = rows.iter().map(|row| ink_of(channels, row, scale, look.palette())).collect();
    match material.wavelengths() {
        Some(wavelengths) if wavelengths.len() > 1 => curves(material, &wavelengths, &rows, &names, &inks, look),
        _ => patches(&inks, look),
    }
}

/// Returns the spectra to draw in a plot, and their names, which are empty if unknown. The spectra are those of the
/// entry `index`, or of evenly spaced entries if `index` is `None`.
fn rows(material: &Material, index: Option<&[usize]>) -> Result<(Vec<Vec<f32>>, Vec<String>), PreviewError> {
    let layout = material.layout();
    let axes = &material.axes()[..layout.indices];
    let count: usize = axes.iter().map(Axis::len).product();
    let picked: Vec<Vec<usize>> = if let Some(index) = index {
        vec![index.to_vec()]
    } else {
        let most = count.min(MOST_CURVES);
        (0..most).map(|i| material.index_of(i * count / most)).collect()
    };
    let (mut rows, mut names) = (Vec::new(), Vec::new());
    for index in &picked {
        let mut row = vec![0.0; material.lambdas()];
        if layout.incoming.is_some() && picked.len() == 1 {
            for theta in INCIDENCES {
                let wi = Some(Direction::from_degrees(theta, 0.0));
                material.evaluate(Place { index, wi, wo: None }, Interpolation::Smooth, &mut row)?;
                rows.push(row.clone());
                names.push(format!("{theta}°"));
            }
        } else {
            let wi = layout.incoming.map(|axis| super::colours::normal(&material.axes()[axis]));
            material.evaluate(Place { index, wi, wo: None }, Interpolation::Smooth, &mut row)?;
            rows.push(row);
            names.push(name_of(axes, index));
        }
    }
    Ok((rows, names))
}

fn curves(
    material: &Material,
    wavelengths: &[f64],
    rows: &[Vec<f32>],
    names: &[String],
    inks: &[Ink],
    look: Look<'_>,
) -> Result<Vec<u8>, PreviewError> {
    let samples = || rows.iter().flatten().copied().filter(|v| !v.is_nan()).map(f64::from);
    let largest = samples().fold(0.0, f64::max);
    let smallest = samples().fold(0.0, f64::min);
    if largest == 0.0 && smallest == 0.0 {
        return Err(crate::domain::colour::ColourError::Dark.into());
    }
    let mut canvas = Canvas::new(look);
    let palette = canvas.palette();
    let whole = canvas.size();
    let divisions = if look.size >= 200 { 5 } else { 3 };
    // Noise below 0 is shown, but does not enlarge the axis.
    let low = if smallest < -0.02 * largest { smallest } else { 0.0 };
    let high = if largest > low { largest } else { 0.0 };
    let span = high - low;
    let up = step(span, divisions);
    let ticks: Vec<f64> = {
        let first = libm::ceil(low / up - 1e-9);
        (0..32).map(|i| (first + f64::from(i)) * up).take_while(|v| *v <= high + 1e-9 * span).collect()
    };
    let widest = ticks.iter().map(|v| canvas.extent(&short(*v)).0).fold(0.0, f64::max);
    let (_, height) = canvas.extent("0");
    let (left, bottom, top, right) = if canvas.is_labelled() {
        (widest + 10.0, whole - 2.0 * height - 8.0, 2.0 * height + 6.0, whole - 12.0)
    } else {
        (4.0, whole - 4.0, 4.0, whole - 4.0)
    };
    let (first, last) = (wavelengths[0], wavelengths[wavelengths.len() - 1]);
    let x = |nm: f64| left + (nm - first) / (last - first) * (right - left);
    let y = |v: f64| bottom - (v - low) / (1.04 * span) * (bottom - top);
    let nm_of = |px: f64| first + (px - left) / (right - left) * (last - first);
    let lines = canvas.stroke(1.0);
    let across = step(last - first, divisions);
    let nanometres: Vec<f64> = {
        let begin = libm::ceil(first / across - 1e-9);
        (0..32).map(|i| (begin + f64::from(i)) * across).take_while(|v| *v <= last + 1e-9).collect()
    };
    for &nm in &nanometres {
        canvas.segment([x(nm), top], [x(nm), bottom], lines, palette.grid);
    }
    for &v in &ticks {
        canvas.segment([left, y(v)], [right, y(v)], lines, palette.grid);
    }
    let colours = Colours::new();
    if let [row] = rows {
        for piece in pieces(wavelengths, row) {
            let mut outline: Vec<Point> = piece.iter().map(|&(nm, v)| [x(nm), y(v)]).collect();
            if let (Some(a), Some(b)) = (outline.first().copied(), outline.last().copied()) {
                outline.push([b[0], y(0.0)]);
                outline.push([a[0], y(0.0)]);
            }
            canvas.fill(&outline, |p| (colours.at(nm_of(p[0])), 0.85));
        }
        let points: Vec<Option<Point>> = points(wavelengths, row, &x, &y);
        canvas.line(&points, canvas.stroke(1.5), palette.curve);
    } else {
        // Strip on the axis with the colours of the wavelengths.
        let strip = canvas.stroke(4.0);
        canvas.fill(&[[left, bottom], [right, bottom], [right, bottom + strip], [left, bottom + strip]], |p| {
            (colours.at(nm_of(p[0])), 1.0)
        });
        let width = canvas.stroke(if rows.len() > 12 { 1.25 } else { 1.75 });
        for (row, ink) in rows.iter().zip(inks) {
            canvas.line(&points(wavelengths, row, &x, &y), width, *ink);
        }
        legend(&mut canvas, [right, top], names, inks);
    }
    canvas.segment([left, y(0.0)], [right, y(0.0)], lines, palette.axis);
    canvas.segment([left, top], [left, bottom], lines, palette.axis);
    for &nm in &nanometres {
        canvas.label([x(nm), bottom + height + 2.0], Hold::Middle, &short(nm), palette.text);
    }
    for &v in &ticks {
        canvas.label([left - 4.0, y(v)], Hold::Right, &short(v), palette.text);
    }
    canvas.label([right, top - height], Hold::Right, "nm", palette.text);
    let unit = match material.unit() {
        crate::domain::Unit::One => "",
        unit => unit.name(),
    };
    canvas.label([4.0, top - height], Hold::Left, unit, palette.text);
    if let Some(peak) = peak(wavelengths, rows) {
        canvas.label([0.5 * (left + right), top - height], Hold::Middle, &peak, palette.text);
    }
    canvas.finish()
}

/// Returns the name of an entry of a table: the label of its column, if there is one.
fn name_of(axes: &[Axis], index: &[usize]) -> String {
    let labels = axes.iter().zip(index).filter_map(|(axis, &i)| match axis {
        Axis::Index { labels, .. } => labels.get(i).cloned(),
        _ => None,
    });
    labels.collect::<Vec<_>>().join(", ")
}

/// Returns the largest value of all spectra and its wavelength, in words.
fn peak(wavelengths: &[f64], rows: &[Vec<f32>]) -> Option<String> {
    let samples = rows.iter().flat_map(|row| wavelengths.iter().zip(row)).filter(|(_, v)| !v.is_nan());
    let (nm, value) = samples.max_by(|(_, a), (_, b)| a.total_cmp(b))?;
    Some(format!("max {} at {} nm", short(f64::from(*value)), short(*nm)))
}

/// Lists the names of curves in their colours at the upper right corner, if there are few and all have one.
fn legend(canvas: &mut Canvas<'_>, [right, top]: Point, names: &[String], inks: &[Ink]) {
    if names.len() > MOST_NAMES || names.iter().any(String::is_empty) {
        return;
    }
    let (_, height) = canvas.extent("0");
    for (i, (name, ink)) in names.iter().zip(inks).enumerate() {
        let shown: String = name.chars().take(LONGEST_NAME).collect();
        canvas.label([right - 4.0, top + 1.5 * height * (i as f64 + 0.7)], Hold::Right, &shown, *ink);
    }
}

fn points(wavelengths: &[f64], row: &[f32], x: &impl Fn(f64) -> f64, y: &impl Fn(f64) -> f64) -> Vec<Option<Point>> {
    wavelengths.iter().zip(row).map(|(nm, v)| (!v.is_nan()).then(|| [x(*nm), y(f64::from(*v))])).collect()
}

/// Returns the runs of consecutive measured samples of a spectrum, as pairs of wavelength and value.
fn pieces(wavelengths: &[f64], row: &[f32]) -> Vec<Vec<(f64, f64)>> {
    let mut pieces = vec![Vec::new()];
    for (nm, v) in wavelengths.iter().zip(row) {
        if v.is_nan() {
            pieces.push(Vec::new());
        } else if let Some(piece) = pieces.last_mut() {
            piece.push((*nm, f64::from(*v)));
        }
    }
    pieces.retain(|piece| piece.len() > 1);
    pieces
}

/// Draws a square patch of colour for each entry of data without wavelengths.
fn patches(inks: &[Ink], look: Look<'_>) -> Result<Vec<u8>, PreviewError> {
    let mut canvas = Canvas::new(look);
    let whole = canvas.size();
    let columns = (1..=inks.len()).find(|n| n * n >= inks.len()).unwrap_or(1);
    let cell = whole / columns as f64;
    for (i, ink) in inks.iter().enumerate() {
        let (left, top) = ((i % columns) as f64 * cell, (i / columns) as f64 * cell);
        let inset = 0.06 * cell;
        let (a, b, c, d) = (left + inset, top + inset, left + cell - inset, top + cell - inset);
        canvas.fill(&[[a, b], [c, b], [c, d], [a, d]], |_| (*ink, 1.0));
    }
    canvas.finish()
}

/// Returns the factor by which spectra are scaled for display; the brightest of relative spectra gets luminance 0.9.
fn brightness(material: &Material, channels: &Channels, rows: &[Vec<f32>]) -> f64 {
    let lights = rows.iter().map(|row| {
        let [r, g, b] = channels.linear(row).map(f64::from);
        0.2126 * r + 0.7152 * g + 0.0722 * b
    });
    let brightest = lights.filter(|l| l.is_finite()).fold(0.0, f64::max);
    match material.quantity() {
        Quantity::Reflectance if brightest <= 1.5 => 1.0,
        Quantity::Brdf | Quantity::Btdf | Quantity::Bsdf => std::f64::consts::PI,
        _ if brightest > 0.0 => 0.9 / brightest,
        _ => 1.0,
    }
}

/// Returns the display colour of the curve of a spectrum, lightened or darkened if it would be invisible on the paper.
fn ink_of(channels: &Channels, row: &[f32], scale: f64, palette: &Palette) -> Ink {
    let linear = channels.linear(row).map(|c| f64::from(c) * scale);
    if linear.iter().any(|c| !c.is_finite()) {
        return palette.text;
    }
    palette.visible(encoded(map_to_gamut(linear)), 0.45)
}

/// Display colours of wavelengths for the area under a curve: spectral colours mapped into the gamut at equal
/// brightness, dark at both ends.
struct Colours(Vec<Ink>);

impl Colours {
    fn new() -> Self {
        let observer = Observer::cie_1931();
        let of = |nm: usize| {
            let lambda = 360.0 + nm as f64;
            let xyz = Xyz { x: observer.x.at(lambda), y: observer.y.at(lambda), z: observer.z.at(lambda) };
            let linear = xyz_to_linear(xyz.scaled(100.0));
            // Desaturated until no channel is negative, which is smooth along the spectrum.
            let lowest = linear.iter().copied().fold(0.0, f64::min);
            let lifted = linear.map(|c| c - lowest);
            let brightest = lifted.iter().copied().fold(0.0, f64::max).max(1e-12);
            // Fades out at the limits of vision: 0 at 380 and 740 nm, full from 430 to 660 nm.
            let end = ((lambda - 375.0) / 55.0).min((745.0 - lambda) / 85.0).clamp(0.0, 1.0);
            let strength = 0.16 + 0.74 * end * end * (3.0 - 2.0 * end);
            let grey = if end > 0.0 { 0.0 } else { 1.0 };
            let ink = encoded(lifted.map(|c| c / brightest));
            ink.map(|c| {
                let dark = 0.30;
                let lit = c * strength as f32;
                if grey > 0.0 { dark } else { lit + dark * (1.0 - end as f32) * (1.0 - c) }
            })
        };
        Self((0..=400).map(of).collect())
    }

    fn at(&self, nm: f64) -> Ink {
        self.0[(nm - 360.0).clamp(0.0, 400.0) as usize]
    }
}
