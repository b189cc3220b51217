//! Lobes between measured incoming directions: interpolation by a material, compared with the truth.
//!
//! `cargo run --release -p wavelume-formats --example lobes -- lobes.svg`; without a file name it draws nothing.
//!
//! A gloss (GGX, α = 0.15, over a diffuse base) is measured at incoming elevations 0, 15, 35, 55 and 75°. It is opened
//! with two interpolations: a cross-fade between neighbouring incoming directions, and one that keeps the half vector.
//! The table has er(L2) in % against the analytic surface, for incoming elevations in the gap of 20°. It covers 4,000
//! outgoing directions down to 80°, and those within 20° of the mirror direction. The picture shows the lobes in the
//! plane of incidence at 25°.
//!
//! It fails (exit code 1) if fading is nowhere worse than moving.

mod common;
mod gloss;

use gloss::{Gloss, Vector, dot};
use std::error::Error;
use std::fmt::Write as _;
use std::io::Write;
use std::process::ExitCode;
use wavelume_core::domain::{Axis, Direction, Domain, Measurement, Quantity, Sampling, Tensor, TriangleMesh, Unit};
use wavelume_core::evaluate::{Alignment, Interpolation, Material, Place};

const SURFACE: Gloss = Gloss { alpha: 0.15, diffuse: 0.3 };
const LAMBDA: f64 = 550.0;
const MEASURED: [f64; 5] = [0.0, 15.0, 35.0, 55.0, 75.0];
const LEVEL: u8 = 5;
/// Level difference of the triangles over which a sample is averaged.
const FINER: u8 = 2;
/// Incoming elevations in degrees of the table, and that of the picture.
const BETWEEN: [f64; 5] = [15.0, 20.0, 25.0, 30.0, 35.0];
const DRAWN: f64 = 25.0;
const POINTS: usize = 4000;
const LOWEST: f64 = 0.17;
/// The cosine of 20°.
const NEAR: f64 = 0.94;

fn main() -> ExitCode {
    common::main("lobes", run)
}

/// Prints the table and draws the picture to `path`; returns true if moving the lobe is better than fading.
pub(crate) fn run(path: Option<&str>, out: &mut impl Write) -> Result<bool, Box<dyn Error>> {
    let measured = measurement()?;
    let faded = Material::with_alignment(measured.clone(), Alignment::None)?;
    let moved = Material::with_alignment(measured.clone(), Alignment::HalfVector)?;
    writeln!(out, "| wi | cross-fade | near the mirror | half vector kept | near the mirror |")?;
    writeln!(out, "|--:|--:|--:|--:|--:|")?;
    let mut better = true;
    for theta in BETWEEN {
        let (fade, kept) = (errors(&faded, theta)?, errors(&moved, theta)?);
        writeln!(out, "| {theta}° | {:.2} | {:.2} | {:.2} | {:.2} |", fade[0], fade[1], kept[0], kept[1])?;
        better &= MEASURED.contains(&theta) || kept[1] < fade[1];
    }
    let found = Material::of(measured)?.report().alignment;
    writeln!(out, "\nThe material chooses by itself: {found:?}.")?;
    if let Some(path) = path {
        std::fs::write(path, picture(&faded, &moved)?)?;
    }
    Ok(better && found == Alignment::HalfVector)
}

fn incoming(theta: f64) -> Direction {
    Direction::from_degrees(theta, 0.0)
}

/// Returns a measurement by an ideal instrument: averages over triangles.
fn measurement() -> Result<Measurement, Box<dyn Error>> {
    let mesh = |level| TriangleMesh::new(Domain::Hemisphere, level).ok_or("no such level");
    let (coarse, fine) = (mesh(LEVEL)?, mesh(LEVEL + FINER)?);
    let parts = fine.len() / coarse.len();
    let mut samples = Vec::with_capacity(MEASURED.len() * coarse.len());
    for theta in MEASURED {
        let wi = incoming(theta).xyz();
        for cell in 0..coarse.len() {
            let (mut sum, mut area) = (0.0, 0.0);
            for part in cell * parts..(cell + 1) * parts {
                sum += fine.solid_angle(part) * SURFACE.value(wi, fine.centroid(part).xyz(), LAMBDA);
                area += fine.solid_angle(part);
            }
            samples.push((sum / area) as f32);
        }
    }
    let tensor = Tensor::new(vec![Axis::Elevation(MEASURED.to_vec()), Axis::Triangles(coarse)], samples)?;
    Ok(Measurement::new(Quantity::Brdf, Unit::PerSteradian, Sampling::Average, tensor)?)
}

fn value(material: &Material, wi: Direction, wo: Direction) -> Result<f64, Box<dyn Error>> {
    let mut out = [0.0];
    material.evaluate(Place { index: &[], wi: Some(wi), wo: Some(wo) }, Interpolation::Smooth, &mut out)?;
    Ok(f64::from(out[0]))
}

/// Returns er(L2) in % over all outgoing directions, and over those near the mirror direction.
fn errors(material: &Material, theta: f64) -> Result<[f64; 2], Box<dyn Error>> {
    let wi = incoming(theta);
    let [x, y, z] = wi.xyz();
    let mut sums = [(0.0, 0.0); 2];
    for i in 0..POINTS {
        // R2 (Roberts 2018): even in solid angle.
        let [u, v] = [0.754_877_666_246_693, 0.569_840_290_998_053].map(|step| (0.5 + i as f64 * step).fract());
        let wo = Direction::from_radians((LOWEST + (1.0 - LOWEST) * u).acos(), std::f64::consts::TAU * v);
        let truth = SURFACE.value(wi.xyz(), wo.xyz(), LAMBDA);
        let square = (value(material, wi, wo)? / truth - 1.0).powi(2);
        let near = dot(wo.xyz(), [-x, -y, z]) > NEAR;
        for (sum, _) in sums.iter_mut().zip([true, near]).filter(|(_, counts)| *counts) {
            *sum = (sum.0 + square, sum.1 + 1.0);
        }
    }
    Ok(sums.map(|(sum, count): (f64, f64)| 100.0 * (sum / count).sqrt()))
}

/// Outgoing elevations in the plane of incidence, in degrees: negative on the side of wi.
fn in_plane() -> impl Iterator<Item = f64> {
    (-170..=170).map(|i| f64::from(i) / 2.0)
}

fn outgoing(theta: f64) -> Direction {
    Direction::from_degrees(theta.abs(), if theta < 0.0 { 0.0 } else { 180.0 })
}

/// Draws the lobes above the surface on the left, and their values by outgoing elevation on the right.
fn picture(faded: &Material, moved: &Material) -> Result<String, Box<dyn Error>> {
    let wi = incoming(DRAWN);
    let of = |material: &Material| -> Result<Vec<(f64, f64)>, Box<dyn Error>> {
        in_plane().map(|theta| Ok((theta, value(material, wi, outgoing(theta))?))).collect()
    };
    let truth = |at: Vector| -> Vec<(f64, f64)> {
        in_plane().map(|theta| (theta, SURFACE.value(at, outgoing(theta).xyz(), LAMBDA))).collect()
    };
    let curves = [
        ("analytic truth", "stroke=\"#b8b8b8\" stroke-width=\"5\"", truth(wi.xyz())),
        ("cross-fade", "stroke=\"#d95f02\" stroke-width=\"1.6\"", of(faded)?),
        ("half vector kept", "stroke=\"#1b5e9e\" stroke-width=\"1.6\" stroke-dasharray=\"5 3\"", of(moved)?),
    ];
    let measured = [15.0, 35.0].map(|theta| truth(incoming(theta).xyz()));
    let mut svg = String::new();
    svg.push_str("<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 800 360\" font-family=\"sans-serif\" font-size=\"12\">\n");
    svg.push_str("<rect width=\"800\" height=\"360\" fill=\"#fff\"/>\n");
    // The lobes: 0.1 per steradian are 82 units.
    let polar = |&(theta, f): &(f64, f64)| {
        let (sin, cos) = theta.to_radians().sin_cos();
        (190.0 + 820.0 * f * sin, 285.0 - 820.0 * f * cos)
    };
    for f in [0.1_f64, 0.2, 0.3] {
        let r = 820.0 * f;
        let x = r.min(180.0);
        let y = (r * r - x * x).sqrt();
        let (left, right, top) = (190.0 - x, 190.0 + x, 285.0 - y);
        writeln!(
            svg,
            "<path d=\"M{left:.1} {top:.1}A{r:.1} {r:.1} 0 0 1 {right:.1} {top:.1}\" fill=\"none\" stroke=\"#e4e4e4\"/>"
        )?;
    }
    svg.push_str("<path d=\"M10 285H370\" stroke=\"#444\"/>\n");
    let (sin, cos) = DRAWN.to_radians().sin_cos();
    let at = |length: f64| (190.0 - length * sin, 285.0 - length * cos);
    let ((ax, ay), (tx, ty)) = (at(240.0), at(252.0));
    writeln!(svg, "<path d=\"M{ax:.1} {ay:.1}L190 285\" stroke=\"#444\" stroke-dasharray=\"2 3\"/>")?;
    writeln!(svg, "<text x=\"{tx:.1}\" y=\"{ty:.1}\" text-anchor=\"middle\">wi {DRAWN}°</text>")?;
    for (_, style, curve) in &curves {
        path(&mut svg, style, curve.iter().map(polar))?;
    }
    // Horizontal axis: elevation in degrees.
    let plot = |&(theta, f): &(f64, f64)| (455.0 + 3.2 * (theta + 20.0), 285.0 - 820.0 * f);
    let shown = |curve: &[(f64, f64)]| -> Vec<(f64, f64)> {
        curve.iter().filter(|(theta, _)| (-20.0..=80.0).contains(theta)).copied().collect()
    };
    for f in [0.0, 0.1, 0.2, 0.3] {
        let (x, y) = plot(&(-20.0, f));
        writeln!(svg, "<path d=\"M{x:.1} {y:.1}H775\" stroke=\"{}\"/>", if f > 0.0 { "#e4e4e4" } else { "#444" })?;
        writeln!(svg, "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{f}</text>", x - 6.0, y + 4.0)?;
    }
    for theta in (-20..=80).step_by(20) {
        let (x, y) = plot(&(f64::from(theta), 0.0));
        writeln!(svg, "<text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{theta}°</text>", y + 16.0)?;
    }
    svg.push_str("<text x=\"615\" y=\"321\" text-anchor=\"middle\">outgoing elevation</text>\n");
    svg.push_str("<text x=\"430\" y=\"24\">f, 1/sr</text>\n");
    for curve in &measured {
        path(&mut svg, "stroke=\"#888\" stroke-width=\"1\" stroke-dasharray=\"1 3\"", shown(curve).iter().map(plot))?;
    }
    for (_, style, curve) in &curves {
        path(&mut svg, style, shown(curve).iter().map(plot))?;
    }
    let dots = ("measured at 15° and 35°", "stroke=\"#888\" stroke-width=\"1\" stroke-dasharray=\"1 3\"");
    for (i, (name, style)) in curves.iter().map(|(name, style, _)| (*name, *style)).chain([dots]).enumerate() {
        let x = 40 + 190 * i;
        writeln!(svg, "<path d=\"M{x} 346h28\" {style}/><text x=\"{}\" y=\"350\">{name}</text>", x + 34)?;
    }
    svg.push_str("</svg>\n");
    Ok(svg)
}

fn path(svg: &mut String, style: &str, points: impl Iterator<Item = (f64, f64)>) -> Result<(), Box<dyn Error>> {
    svg.push_str("<path d=\"");
    for (i, (x, y)) in points.enumerate() {
        write!(svg, "{}{x:.1} {y:.1}", if i == 0 { 'M' } else { 'L' })?;
    }
    Ok(writeln!(svg, "\" fill=\"none\" {style}/>")?)
}
