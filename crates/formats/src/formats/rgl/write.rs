//! Writes a BRDF as a tensor file that the readers of RGL materials accept, without any fitting.
//!
//! `ndf` is 4 and `sigma` 1 everywhere, so that the numbers are f · cos θo under any reader, whatever it does with
//! `jacobian`. The density that replaces the visible normals is half uniform and half the lobe's own light, so that
//! narrow lobes have nodes.

use super::super::acquisition::{DirectionalFunction, Written, lifted};
use super::super::error::{FormatError, FormatErrorKind};
use super::about::NAME;
use super::container::MAGIC;
use super::limits::{LARGEST, MAX_TEXT};
use super::warp::{Warp, unit_to_azimuth, unit_to_elevation};
use crate::domain::limits::{MAX_SAMPLES, MAX_WAVELENGTHS};
use crate::domain::vector::{Vector, dot, scale, sub, unit};
use crate::domain::{Direction, WavelengthGrid};
use rayon::prelude::*;

/// Directions, wavelengths and resolution with which a BRDF is written as an RGL file.
#[derive(Clone, Debug, PartialEq)]
pub struct RglGrid {
    /// Polar angles of the incident directions in degrees, 0..=90, strictly increasing.
    pub theta_i: Vec<f64>,
    /// Azimuths of the incident directions in degrees, strictly increasing, including both −180 and 180. Empty for an
    /// isotropic BRDF, which is evaluated at azimuth 0.
    pub phi_i: Vec<f64>,
    /// Wavelengths in nm; `None` for the three channels of RGB.
    pub wavelengths: Option<WavelengthGrid>,
    /// Number of nodes along a side of the square table of values for each incident direction, at least 2; usually 32
    /// to 128. More nodes reduce the interpolation error.
    pub side: usize,
    /// Description of the measurement, stored as text in the file.
    pub description: String,
}

/// Number of nodes along a side of the square table of the density of outgoing light. Raising it resolves narrower
/// lobes and enlarges files.
const DENSITY_SIDE: usize = 64;
/// Fraction of the density of outgoing light that is uniform over the unit square of microfacet directions. Raising it
/// puts fewer nodes on lobes.
const UNIFORM: f64 = 0.5;
/// Depth below the horizon, as a cosine, down to which f · cos θo is continued, because interpolation at the horizon
/// needs nodes beyond it.
const BELOW: f64 = 0.15;

/// Writes the BRDF `function` as an RGL file; it must have the channels of `grid`.
///
/// Readers interpolate between nodes; more nodes reproduce the function more closely.
pub fn write_rgl(grid: &RglGrid, function: &dyn DirectionalFunction) -> Result<Written, FormatError> {
    let channels = grid.wavelengths.as_ref().map_or(3, WavelengthGrid::len);
    check(grid, channels)?;
    let azimuths = if grid.phi_i.is_empty() { vec![0.0] } else { grid.phi_i.clone() };
    let incident: Vec<(f64, f64)> =
        azimuths.iter().flat_map(|&phi| grid.theta_i.iter().map(move |&theta| (theta, phi))).collect();
    let (p, t, n, d) = (azimuths.len(), grid.theta_i.len(), grid.side, DENSITY_SIDE);
    let radians = |degrees: &[f64]| degrees.iter().map(|d| d.to_radians() as f32).collect::<Vec<f32>>();
    let mut file = Tensors::default();
    file.add("description", 1, &[grid.description.len()], Some(grid.description.as_bytes().to_vec()));
    file.floats("phi_i", &[p], &radians(&azimuths));
    file.floats("theta_i", &[t], &radians(&grid.theta_i));
    if let Some(wavelengths) = &grid.wavelengths {
        let values: Vec<f32> = wavelengths.values().into_iter().map(|nm| nm as f32).collect();
        file.floats("wavelengths", &[channels], &values);
    }
    file.floats("ndf", &[2, 2], &[4.0; 4]);
    file.floats("sigma", &[2, 2], &[1.0; 4]);
    file.later("vndf", &[p, t, d, d]);
    file.later("luminance", &[p, t, n, n]);
    file.later(if grid.wavelengths.is_some() { "spectra" } else { "rgb" }, &[p, t, channels, n, n]);
    file.add("jacobian", 1, &[1], Some(vec![1]));
    let Laid { mut bytes, mut rooms } = file.lay();
    // The three large fields are written in place.
    let mut rest = &mut bytes[..];
    let mut before = 0;
    let mut next = || {
        let (at, length) = rooms.next().unwrap_or((before, 0));
        let (_, from) = std::mem::take(&mut rest).split_at_mut(at - before);
        let (field, after) = from.split_at_mut(length);
        (rest, before) = (after, at + length);
        field
    };
    let (densities, luminances, values) = (next(), next(), next());
    let sampler = Sampler { grid, function, channels };
    let counts = densities
        .par_chunks_mut(4 * d * d)
        .zip(luminances.par_chunks_mut(4 * n * n))
        .zip(values.par_chunks_mut(4 * channels * n * n))
        .zip(incident)
        .map(|(((density, luminance), values), wi)| sampler.slice(wi, &mut Slice { density, luminance, values }))
        .collect::<Result<Vec<_>, _>>()?;
    let (filled, clipped) = counts.into_iter().fold((0, 0), |sum, counts| (sum.0 + counts.0, sum.1 + counts.1));
    Ok(Written { bytes, filled, clipped })
}

fn refuse(kind: FormatErrorKind, message: String) -> FormatError {
    FormatError::new(kind, NAME, message)
}

fn check(grid: &RglGrid, channels: usize) -> Result<(), FormatError> {
    let malformed = |message: String| Err(refuse(FormatErrorKind::NeedsOption, message));
    let increasing = |values: &[f64]| values.array_windows().all(|[a, b]| (*a as f32) < (*b as f32));
    let theta = &grid.theta_i;
    if theta.is_empty() || !increasing(theta) || theta.iter().any(|t| !(0.0..=90.0).contains(t)) {
        return malformed("incident elevations, expected at least one, 0° to 90°, strictly increasing".to_owned());
    }
    let phi = &grid.phi_i;
    let whole = phi.len() >= 3 && phi.first() == Some(&-180.0) && phi.last() == Some(&180.0);
    let usable = phi.is_empty() || (whole && increasing(phi));
    if !usable {
        return malformed("incident azimuths, expected at least 3 from -180° to 180°, strictly increasing".to_owned());
    }
    if channels > MAX_WAVELENGTHS || grid.wavelengths.as_ref().is_some_and(|grid| !increasing(&grid.values())) {
        return malformed(format!("wavelengths, expected at most {MAX_WAVELENGTHS}, strictly increasing as float32"));
    }
    if grid.side < 2 {
        return malformed(format!("{} nodes along a side of the outgoing table, expected at least 2", grid.side));
    }
    if grid.description.len() > MAX_TEXT {
        let message = format!("a description of {} bytes, expected at most {MAX_TEXT}", grid.description.len());
        return Err(refuse(FormatErrorKind::OverLimit, message));
    }
    let slices = phi.len().max(1).checked_mul(theta.len());
    let numbers = slices.and_then(|slices| {
        let values = channels.checked_mul(grid.side)?.checked_mul(grid.side)?;
        slices.checked_mul(values.max(DENSITY_SIDE * DENSITY_SIDE))
    });
    if numbers.is_none_or(|n| n > MAX_SAMPLES) {
        let message = format!(
            "{} × {} incident directions with {channels} channels of {} × {} are more than {MAX_SAMPLES} numbers",
            phi.len().max(1),
            theta.len(),
            grid.side,
            grid.side
        );
        return Err(refuse(FormatErrorKind::OverLimit, message));
    }
    Ok(())
}

struct Sampler<'a> {
    grid: &'a RglGrid,
    function: &'a dyn DirectionalFunction,
    channels: usize,
}

/// Output buffers for the numbers of one incident direction, little-endian f32.
struct Slice<'a> {
    /// Buffer for the density of outgoing light, `[row, column]` on the nodes of the square of microfacet directions.
    density: &'a mut [u8],
    /// Buffer for the luminance from which renderers that read the RGL file draw random outgoing directions, `[row,
    /// column]` on the nodes of the square table of outgoing directions.
    luminance: &'a mut [u8],
    /// Buffer for the BRDF times cos θo, `[channel, row, column]`; rows and columns are those of the square table of
    /// outgoing directions.
    values: &'a mut [u8],
}

fn put(room: &mut [u8], at: usize, value: f32) {
    room[4 * at..4 * at + 4].copy_from_slice(&value.to_le_bytes());
}

impl Sampler<'_> {
    /// Computes the density, luminance and BRDF values of an RGL file for one incident direction, and writes them to
    /// `slice`, the output buffers for that direction. Returns the number of missing values, and that of negative
    /// values.
    fn slice(&self, (theta, phi): (f64, f64), slice: &mut Slice<'_>) -> Result<(usize, usize), FormatError> {
        // Isotropic functions are stored relative to the incident azimuth, which is 0 here.
        let wi = Direction::from_degrees(theta, phi);
        let mut values = vec![0.0; self.channels];
        let density = self.density(wi, &mut values);
        density.iter().enumerate().for_each(|(node, &value)| put(slice.density, node, value));
        let warp = Warp::new(DENSITY_SIDE, DENSITY_SIDE, density)
            .map_err(|_| refuse(FormatErrorKind::Malformed, format!("no density at theta_i {theta}°, a bug")))?;
        let n = self.grid.side;
        let nodes = n * n;
        let (mut filled, mut clipped) = (0, 0);
        for node in 0..nodes {
            let at = |i: usize| i as f64 / (n - 1) as f64;
            let (u, density) = warp.warp(&[(0, 1.0)], [at(node % n), at(node / n)]);
            let (wo, weight) = outgoing(wi.xyz(), u);
            let (missing, negative) = self.light(wi, wo, &mut values);
            filled += missing;
            clipped += negative;
            for (channel, &value) in values.iter().enumerate() {
                let value = value as f32;
                if value.is_nan() || value.abs() > LARGEST {
                    let message = format!("the BRDF times the cosine is {value:e}, expected at most {LARGEST:e}");
                    return Err(refuse(FormatErrorKind::Malformed, message));
                }
                put(slice.values, channel * nodes + node, value);
            }
            // Importance of the light not captured by the density; offset so that it is never 0 everywhere.
            let rest = mean(&values).max(0.0) * weight / density.max(1e-6);
            put(slice.luminance, node, (rest + 1e-6) as f32);
        }
        Ok((filled, clipped))
    }

    /// Returns the density of outgoing light per area of the unit square of microfacet directions, at its nodes. Half
    /// of the density is uniform over the square, the other half follows the light that the BRDF scatters.
    fn density(&self, wi: Direction, values: &mut [f64]) -> Vec<f32> {
        let d = DENSITY_SIDE;
        let light: Vec<f64> = (0..d * d)
            .map(|node| {
                let at = |i: usize| i as f64 / (d - 1) as f64;
                let (wo, weight) = outgoing(wi.xyz(), [at(node % d), at(node / d)]);
                if wo[2] <= 0.0 {
                    return 0.0;
                }
                self.light(wi, wo, values);
                mean(values).max(0.0) * weight
            })
            .collect();
        let total = light.iter().sum::<f64>() / light.len() as f64;
        let scale = if total > 0.0 && total.is_finite() { (1.0 - UNIFORM) / total } else { 0.0 };
        // Non-finite values are refused later, with their node.
        let density = |value: f64| if value.is_finite() { UNIFORM + value * scale } else { UNIFORM };
        light.into_iter().map(|value| density(value) as f32).collect()
    }

    /// Writes f · cos θo for a unit vector `wo`. Below the horizon it continues with the slope at the horizon. Negative
    /// f becomes 0, because readers use the values unchecked. Returns the number of missing values, and that of
    /// negative values.
    fn light(&self, wi: Direction, wo: Vector, values: &mut [f64]) -> (usize, usize) {
        self.function.evaluate(wi, lifted(wo), values);
        let cosine = wo[2].max(-BELOW);
        let (mut missing, mut negative) = (0, 0);
        for value in values.iter_mut() {
            missing += usize::from(value.is_nan());
            negative += usize::from(*value < 0.0);
            *value = if *value > 0.0 { *value * cosine } else { 0.0 };
        }
        (missing, negative)
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Returns the outgoing direction whose microfacet normal lies at the point `u` of the unit square, and the solid angle
/// of outgoing directions per area of the square there. A constant factor of the solid angle is left out.
fn outgoing(wi: Vector, u: [f64; 2]) -> (Vector, f64) {
    let theta = unit_to_elevation(u[0]);
    let m = Direction::from_radians(theta, unit_to_azimuth(u[1])).xyz();
    let cosine = dot(wi, m);
    (unit(sub(scale(m, 2.0 * cosine), wi)), u[0] * libm::sin(theta) * cosine.max(0.0))
}

/// Field of a tensor file: name, code of the number type, shape, and its data unless they are written later.
type Entry = (&'static str, u8, Vec<usize>, Option<Vec<u8>>);

/// Fields of a tensor file that is being written.
#[derive(Default)]
struct Tensors {
    fields: Vec<Entry>,
}

/// Tensor file with reserved space for numbers that are written later: byte offset and length of each such field, in
/// order.
struct Laid {
    bytes: Vec<u8>,
    rooms: std::vec::IntoIter<(usize, usize)>,
}

impl Tensors {
    fn add(&mut self, name: &'static str, code: u8, shape: &[usize], data: Option<Vec<u8>>) {
        self.fields.push((name, code, shape.to_vec(), data));
    }

    fn floats(&mut self, name: &'static str, shape: &[usize], values: &[f32]) {
        debug_assert_eq!(values.len(), shape.iter().product::<usize>(), "{name}");
        self.add(name, 10, shape, Some(values.iter().flat_map(|v| v.to_le_bytes()).collect()));
    }

    /// Adds a named array of f32 numbers to a tensor file and reserves space for its numbers, which are written later.
    fn later(&mut self, name: &'static str, shape: &[usize]) {
        self.add(name, 10, shape, None);
    }

    /// Lays out the tensor file in memory: the list of named arrays (fields), then their data at multiples of 8 bytes.
    fn lay(self) -> Laid {
        let entry = |(name, _, shape, _): &Entry| 13 + name.len() + 8 * shape.len();
        let size =
            |(_, _, shape, data): &Entry| data.as_ref().map_or_else(|| 4 * shape.iter().product::<usize>(), Vec::len);
        let mut bytes = MAGIC.to_vec();
        bytes.extend([1, 0]);
        bytes.extend((self.fields.len() as u32).to_le_bytes());
        let mut at = 18 + self.fields.iter().map(entry).sum::<usize>();
        let mut places = Vec::with_capacity(self.fields.len());
        for field in &self.fields {
            let (name, code, shape, _) = field;
            at = at.next_multiple_of(8);
            places.push(at);
            bytes.extend((name.len() as u16).to_le_bytes());
            bytes.extend(name.as_bytes());
            bytes.extend((shape.len() as u16).to_le_bytes());
            bytes.push(*code);
            bytes.extend((at as u64).to_le_bytes());
            bytes.extend(shape.iter().flat_map(|&n| (n as u64).to_le_bytes()));
            at += size(field);
        }
        bytes.reserve_exact(at - bytes.len());
        bytes.resize(at, 0);
        let mut rooms = Vec::new();
        for (field, at) in self.fields.iter().zip(places) {
            match &field.3 {
                Some(data) => bytes[at..at + data.len()].copy_from_slice(data),
                None => rooms.push((at, size(field))),
            }
        }
        Laid { bytes, rooms: rooms.into_iter() }
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::{Interpretation, Samples};
    use super::super::read;
    use super::*;

    /// Test BRDF of a rough lobe on a diffuse base, anisotropic, with a different value for each channel.
    #[derive(Debug)]
    struct Lobe;

    impl DirectionalFunction for Lobe {
        fn evaluate(&self, wi: Direction, wo: Direction, values: &mut [f64]) {
            let [x, y, z] = unit(crate::domain::vector::add(wi.xyz(), wo.xyz()));
            let lobe = libm::exp(-6.0 * (x * x + 0.5 * y * y) / (z * z));
            values.iter_mut().enumerate().for_each(|(i, v)| *v = 0.2 + (1.0 + i as f64) * lobe);
        }
    }

    /// Change to the requested directions, wavelengths or resolution of a written file; the changed request is invalid.
    type Change = fn(&mut RglGrid);

    #[derive(Debug)]
    struct Nothing(f64);

    impl DirectionalFunction for Nothing {
        fn evaluate(&self, _: Direction, _: Direction, values: &mut [f64]) {
            values.fill(self.0);
        }
    }

    fn grid(side: usize) -> RglGrid {
        RglGrid {
            theta_i: vec![0.0, 20.0, 40.0, 60.0, 80.0],
            phi_i: (0..=12).map(|i| f64::from(30 * i - 180)).collect(),
            wavelengths: Some(WavelengthGrid::even(400.0, 100.0, 2).unwrap()),
            side,
            description: "a lobe".to_owned(),
        }
    }

    #[test]
    fn what_is_written_reads_back_as_the_function() {
        let mut before = f64::MAX;
        for side in [16, 32, 64] {
            let written = write_rgl(&grid(side), &Lobe).unwrap();
            assert_eq!(written.filled, 0);
            let acquisition = read(&written.bytes, &Interpretation::default()).unwrap();
            let Samples::Function(modelled) = acquisition.samples else { panic!("a function") };
            let (mut squared, mut signal) = (0.0, 0.0);
            for k in 0..2000 {
                let k = f64::from(k);
                // At the slices themselves: between them the error is that of the incident grid.
                let wi = Direction::from_degrees([0.0, 20.0, 40.0, 60.0][k as usize % 4], 30.0 * (k % 12.0) - 180.0);
                let wo = Direction::from_degrees((k * 37.3) % 80.0, (k * 71.7) % 360.0);
                let (mut found, mut expected) = ([0.0; 2], [0.0; 2]);
                modelled.function.evaluate(wi, wo, &mut found);
                Lobe.evaluate(wi, wo, &mut expected);
                squared += (found[0] - expected[0]).powi(2);
                signal += expected[0].powi(2);
            }
            let error = (squared / signal).sqrt();
            assert!(error < 0.45 * before, "{side}: {error} after {before}");
            before = error;
        }
        assert!(before < 4e-3, "{before}");
    }

    #[test]
    fn isotropic_and_rgb_files_have_their_fields() {
        let iso = RglGrid { phi_i: Vec::new(), wavelengths: None, ..grid(8) };
        let written = write_rgl(&iso, &Nothing(0.5)).unwrap();
        let acquisition = read(&written.bytes, &Interpretation::default()).unwrap();
        assert_eq!(acquisition.dialect, "isotropic, 5 elevations, 8 × 8 outgoing, RGB");
        let Samples::Function(modelled) = acquisition.samples else { panic!("a function") };
        let mut values = [0.0; 3];
        // Nodes below the horizon continue f · cos.
        for theta in [0.0, 45.0, 75.0] {
            modelled.function.evaluate(
                Direction::from_degrees(20.0, 100.0),
                Direction::from_degrees(theta, 30.0),
                &mut values,
            );
            assert!((values[0] - 0.5).abs() < 0.05, "{theta}: {values:?}");
        }
        let missing = write_rgl(&iso, &Nothing(f64::NAN)).unwrap();
        assert_eq!((missing.filled, missing.clipped), (5 * 64 * 3, 0));
        let negative = write_rgl(&iso, &Nothing(-0.5)).unwrap();
        assert_eq!((negative.filled, negative.clipped), (0, 5 * 64 * 3));
    }

    #[test]
    fn grids_that_no_reader_would_take_are_refused() {
        use FormatErrorKind::{Malformed, NeedsOption, OverLimit};
        let cases: &[(Change, FormatErrorKind)] = &[
            (|g| g.theta_i.clear(), NeedsOption),
            (|g| g.theta_i[0] = -1.0, NeedsOption),
            (|g| g.theta_i[4] = f64::NAN, NeedsOption),
            (|g| g.theta_i[1] = 40.0, NeedsOption),
            (|g| g.phi_i.truncate(5), NeedsOption),
            (|g| g.phi_i[3] = 100.0, NeedsOption),
            (|g| g.wavelengths = WavelengthGrid::even(400.0, 1e-9, 2).ok(), NeedsOption),
            (|g| g.side = 1, NeedsOption),
            (|g| g.side = 1 << 13, OverLimit),
            (|g| g.side = usize::MAX, OverLimit),
        ];
        for (change, kind) in cases {
            let mut grid = grid(4);
            change(&mut grid);
            assert_eq!(write_rgl(&grid, &Lobe).unwrap_err().kind, *kind, "{grid:?}");
        }
        for huge in [1e30, f64::INFINITY] {
            assert_eq!(write_rgl(&grid(4), &Nothing(huge)).unwrap_err().kind, Malformed);
        }
        let long = RglGrid { description: "x".repeat(MAX_TEXT + 1), ..grid(4) };
        assert_eq!(write_rgl(&long, &Lobe).unwrap_err().kind, OverLimit);
    }
}
