//! MERL isotropic BRDFs (`.binary`): tables of RGB over half and difference angles, read and written.
//!
//! A file holds three i32 (90, 90, 180), then f64 `[channel, theta_h, theta_d, phi_d]`, little-endian. f = value ·
//! scale of the channel; a negative value is missing. `theta_h` is spaced by its square root. `phi_d` covers half a
//! turn and the other half follows by reciprocity (Matusik et al. 2003; Rusinkiewicz 1998). Tables of 90 × 90 × 360
//! cover the whole turn. A value is constant over its cell, as in the lookup code published with the data.

use super::acquisition::{Acquisition, Angles, DirectionalFunction, Modelled, ParseReport, Samples, Written, lifted};
use super::error::{FormatError, FormatErrorKind};
use super::instrument::Instrument;
use super::interpretation::Interpretation;
use super::reader::{Format, Reader, Sample};
use crate::domain::vector::{Vector, about_y, about_z, add, dot, norm, scale, sub};
use crate::domain::{Axis, Direction, Quantity, Unit};
use crate::notes::ScatteringNote;
use rayon::prelude::*;
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::Arc;

const NAME: &str = "merl";

pub(super) const READER: Reader = Reader {
    about: Format {
        name: NAME,
        description: "MERL isotropic BRDF, RGB over half and difference angles (.binary)",
        extensions: &["binary"],
        reads: true,
        writes: true,
    },
    options: &[],
    probe,
    read,
};

const HALF: usize = 90;
const DIFFERENCE: usize = 90;
/// Number of cells of a MERL table over the half turn of the azimuth `phi_d`; a table of a whole turn has twice as
/// many.
const AZIMUTHS: usize = 180;
const HEAD: usize = 12;
/// Factor from a stored number of a MERL table to sr⁻¹, for red, green and blue.
const SCALES: [f64; 3] = [1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0];
/// Step in degrees between the incident elevations at which a MERL table is evaluated for averages over triangles.
/// Raising it makes the averages coarser.
const ELEVATION_STEP: usize = 3;
/// Spacing of neighbouring outgoing directions of a MERL table in degrees: 1° in the half vector is 2° in the outgoing
/// direction.
const SPACING: f64 = 2.0;

/// Returns the first three 32-bit numbers of a MERL file, which are the lengths of its table along the three axes, in
/// little-endian and in big-endian order. The flag is true for big-endian.
fn dimensions(bytes: &[u8]) -> Option<[(bool, [i32; 3]); 2]> {
    let (words, _) = bytes.first_chunk::<HEAD>()?.as_chunks::<4>();
    let little = [0, 1, 2].map(|i| i32::from_le_bytes(words[i]));
    Some([(false, little), (true, little.map(i32::swap_bytes))])
}

/// Returns the number of cells along the azimuth `phi_d`, which is the third dimension of a MERL table; `None` if the
/// three given dimensions are not those of a MERL table.
fn azimuths([half, difference, azimuth]: [i32; 3]) -> Option<usize> {
    let azimuth = usize::try_from(azimuth).ok()?;
    let known = half == HALF as i32 && difference == DIFFERENCE as i32;
    (known && (azimuth == AZIMUTHS || azimuth == 2 * AZIMUTHS)).then_some(azimuth)
}

fn probe(sample: &Sample<'_>) -> u8 {
    let Some(orders) = dimensions(sample.bytes) else { return 0 };
    if orders.iter().any(|&(_, dimensions)| azimuths(dimensions).is_some()) {
        return 100;
    }
    // A file of the same layout with other dimensions: the three words match the number of RGB cells of f64.
    let cells = |words: [i32; 3]| {
        let positive = words.map(|word| usize::try_from(word).ok().filter(|&n| n > 0));
        positive.into_iter().try_fold(24_usize, |product, n| product.checked_mul(n?))?.checked_add(HEAD)
    };
    if cells(orders[0].1) == Some(sample.bytes.len()) { 60 } else { 0 }
}

fn read(bytes: &[u8], how: &Interpretation) -> Result<Acquisition, FormatError> {
    let needs = |message: String| Err(FormatError::new(FormatErrorKind::NeedsOption, NAME, message));
    if how.unit.is_some_and(|unit| unit != Unit::PerSteradian) {
        return needs("a unit was asked for that this format does not have, expected 1/sr".to_owned());
    }
    if let Some(quantity) = how.quantity().filter(|&quantity| quantity != Quantity::Brdf) {
        return needs(format!("quantity {quantity} was asked for, expected brdf, which the file holds"));
    }
    let mut report = ParseReport::default();
    let table = Table::read(bytes, &mut report)?;
    let numbers = table.values.len();
    let missing = table.values.iter().filter(|value| value.is_nan()).count();
    report.note(ScatteringNote::LinearSrgb);
    let theta = (0..HALF).step_by(ELEVATION_STEP).map(|degrees| degrees as f64).collect();
    Ok(Acquisition {
        format: NAME,
        dialect: format!("isotropic, {HALF} × {DIFFERENCE} × {} cells, RGB", table.azimuths),
        quantity: Quantity::Brdf,
        unit: Unit::PerSteradian,
        samples: Samples::Function(Modelled {
            stated: None,
            incoming: Angles { theta, covers: (0.0, 90.0), phi: None },
            outgoing_spacing: SPACING,
            spectral: Some(Axis::Rgb),
            numbers,
            missing,
            function: Arc::new(table),
        }),
        spectral_factor: None,
        instrument: Instrument::default(),
        report,
    })
}

/// Values of a MERL table in sr⁻¹, `[theta_h, theta_d, phi_d, channel]` in half and difference angles; NaN = missing.
#[derive(Debug)]
struct Table {
    azimuths: usize,
    values: Vec<f32>,
}

impl Table {
    fn read(bytes: &[u8], report: &mut ParseReport) -> Result<Self, FormatError> {
        let malformed =
            |offset: usize, message: String| FormatError::at_byte(FormatErrorKind::Malformed, NAME, offset, message);
        let Some(orders) = dimensions(bytes) else {
            return Err(malformed(
                bytes.len(),
                format!("a file of {} bytes, expected a table behind {HEAD} bytes", bytes.len()),
            ));
        };
        let Some((swapped, azimuths)) =
            orders.into_iter().find_map(|(swapped, dimensions)| Some((swapped, azimuths(dimensions)?)))
        else {
            let [a, b, c] = orders[0].1;
            let message = format!(
                "a MERL table of {a} × {b} × {c} cells, expected {HALF} × {DIFFERENCE} × {AZIMUTHS} or {HALF} × {DIFFERENCE} × {}",
                2 * AZIMUTHS
            );
            return Err(FormatError::at_byte(FormatErrorKind::Unsupported, NAME, 0, message));
        };
        let cells = HALF * DIFFERENCE * azimuths;
        let expected = HEAD + 24 * cells;
        if bytes.len() != expected {
            let message =
                format!("{} bytes, expected {expected} for {HALF} × {DIFFERENCE} × {azimuths} cells", bytes.len());
            return Err(malformed(bytes.len().min(expected), message));
        }
        if swapped {
            report.note(ScatteringNote::BigEndian);
        }
        if azimuths != AZIMUTHS {
            report.note(ScatteringNote::WholeTurn { cells: azimuths });
        }
        let (words, _) = bytes[HEAD..].as_chunks::<8>();
        let stored = |word: &[u8; 8]| if swapped { f64::from_be_bytes(*word) } else { f64::from_le_bytes(*word) };
        let (mut negative, mut lowest, mut finite) = (0_usize, 0.0_f64, true);
        let mut values = Vec::with_capacity(3 * cells);
        let (red, others) = words.split_at(cells);
        let (green, blue) = others.split_at(cells);
        for ((red, green), blue) in red.iter().zip(green).zip(blue) {
            for (word, scale) in [red, green, blue].into_iter().zip(SCALES) {
                let stored = stored(word);
                let value = (stored * scale) as f32;
                finite &= value.is_finite();
                negative += usize::from(stored < 0.0);
                lowest = lowest.min(stored);
                values.push(if stored < 0.0 { f32::NAN } else { value });
            }
        }
        if !finite {
            let wrong = |i: &usize| !((stored(&words[*i]) * SCALES[*i / cells]) as f32).is_finite();
            let i = (0..words.len()).find(wrong).unwrap_or_default();
            let message = format!("value {i} is {:e}, expected a finite number", stored(&words[i]));
            return Err(malformed(HEAD + 8 * i, message));
        }
        if negative > 0 {
            report.note(ScatteringNote::NegativeMasked { values: negative, of: 3 * cells, lowest });
        }
        Ok(Self { azimuths, values })
    }

    /// Returns the index of the MERL cell that contains a pair of unit directions above the surface.
    fn cell(&self, wi: Vector, wo: Vector) -> usize {
        let sum = add(wi, wo);
        let length = norm(sum);
        // Opposite grazing directions have no unique half vector; the normal is used.
        let h = if length > 1e-9 { scale(sum, 1.0 / length) } else { [0.0, 0.0, 1.0] };
        let theta_h = libm::acos(h[2].clamp(-1.0, 1.0));
        let phi_h = libm::atan2(h[1], h[0]);
        let d = about_y(about_z(wi, -phi_h), -theta_h);
        let theta_d = libm::acos(d[2].clamp(-1.0, 1.0));
        let phi_d = libm::atan2(d[1], d[0]);
        let index = |x: f64, cells: usize| (libm::floor(x.max(0.0)) as usize).min(cells - 1);
        let i = index(libm::sqrt(theta_h / FRAC_PI_2) * HALF as f64, HALF);
        let j = index(theta_d / FRAC_PI_2 * DIFFERENCE as f64, DIFFERENCE);
        let turn = if self.azimuths == AZIMUTHS { PI } else { TAU };
        let phi_d = if phi_d < 0.0 { phi_d + turn } else { phi_d };
        let k = index(phi_d / turn * self.azimuths as f64, self.azimuths);
        (i * DIFFERENCE + j) * self.azimuths + k
    }
}

impl DirectionalFunction for Table {
    /// Writes the BRDF in sr⁻¹ without the factor cos θo, one value for red, green and blue; 0 if a direction is below
    /// the surface.
    fn evaluate(&self, wi: Direction, wo: Direction, values: &mut [f64]) {
        debug_assert_eq!(values.len(), 3, "one value a channel");
        let (wi, wo) = (wi.xyz(), wo.xyz());
        if wi[2] < 0.0 || wo[2] < 0.0 {
            values.fill(0.0);
            return;
        }
        let cell = self.cell(wi, wo);
        for (value, &stored) in values.iter_mut().zip(&self.values[3 * cell..]) {
            *value = f64::from(stored);
        }
    }
}

/// Writes an isotropic BRDF of three channels (linear sRGB) as a MERL table: 90 × 90 × 180 cells with the values at
/// their centres.
///
/// The format implies f(wi, wo) = f(wo, wi): a cell holds the mean of both. If one direction of a cell is below the
/// horizon, it is raised to the horizon: some readers do not understand negative numbers.
pub fn write_merl(function: &dyn DirectionalFunction) -> Result<Written, FormatError> {
    let cells = HALF * DIFFERENCE * AZIMUTHS;
    let rows: Vec<Row> = (0..HALF * DIFFERENCE).into_par_iter().map(|row| Row::of(function, row)).collect();
    let mut bytes = Vec::with_capacity(HEAD + 24 * cells);
    for n in [HALF, DIFFERENCE, AZIMUTHS] {
        bytes.extend((n as i32).to_le_bytes());
    }
    for (channel, scale) in SCALES.into_iter().enumerate() {
        for value in rows.iter().flat_map(|row| &row.values[channel * AZIMUTHS..][..AZIMUTHS]) {
            if !(f64::from(f32::MIN)..=f64::from(f32::MAX)).contains(value) {
                let message = format!("the BRDF is {value:e}, expected a finite number");
                return Err(FormatError::new(FormatErrorKind::Malformed, NAME, message));
            }
            bytes.extend((value / scale).to_le_bytes());
        }
    }
    let sum = |part: fn(&Row) -> usize| rows.iter().map(part).sum();
    Ok(Written { bytes, filled: sum(|row| row.filled), clipped: sum(|row| row.clipped) })
}

/// Values of the MERL cells with one `theta_h` and one `theta_d`, `[channel, phi_d]`.
struct Row {
    values: Vec<f64>,
    filled: usize,
    clipped: usize,
}

impl Row {
    fn of(function: &dyn DirectionalFunction, row: usize) -> Self {
        let (i, j) = (row / DIFFERENCE, row % DIFFERENCE);
        let centre = (i as f64 + 0.5) / HALF as f64;
        let theta_h = centre * centre * FRAC_PI_2;
        let theta_d = (j as f64 + 0.5) / DIFFERENCE as f64 * FRAC_PI_2;
        let h = Direction::from_radians(theta_h, 0.0).xyz();
        let mut row = Self { values: vec![0.0; 3 * AZIMUTHS], filled: 0, clipped: 0 };
        for k in 0..AZIMUTHS {
            let phi_d = (k as f64 + 0.5) / AZIMUTHS as f64 * PI;
            let wi = about_y(Direction::from_radians(theta_d, phi_d).xyz(), theta_h);
            let wo = sub(scale(h, 2.0 * dot(wi, h)), wi);
            let [wi, wo] = [wi, wo].map(lifted);
            let (mut there, mut back) = ([0.0; 3], [0.0; 3]);
            function.evaluate(wi, wo, &mut there);
            function.evaluate(wo, wi, &mut back);
            for (channel, (a, b)) in there.into_iter().zip(back).enumerate() {
                let mean = match (a.is_nan(), b.is_nan()) {
                    (false, false) => 0.5 * (a + b),
                    (true, false) => b,
                    (false, true) => a,
                    (true, true) => f64::NAN,
                };
                row.filled += usize::from(mean.is_nan());
                row.clipped += usize::from(mean < 0.0);
                // NaN becomes 0 as well.
                row.values[channel * AZIMUTHS + k] = mean.max(0.0);
            }
        }
        row
    }
}

#[cfg(test)]
mod tests {
    use super::super::Position;
    use super::*;

    /// Returns a MERL file whose stored numbers are `value(i)`, in little-endian or big-endian order.
    fn file(azimuths: usize, swapped: bool, value: impl Fn(usize) -> f64) -> Vec<u8> {
        let words = [HALF, DIFFERENCE, azimuths].map(|n| n as i32);
        let mut bytes: Vec<u8> =
            words.iter().flat_map(|w| if swapped { w.to_be_bytes() } else { w.to_le_bytes() }).collect();
        for i in 0..3 * HALF * DIFFERENCE * azimuths {
            bytes.extend(if swapped { value(i).to_be_bytes() } else { value(i).to_le_bytes() });
        }
        bytes
    }

    fn modelled(bytes: &[u8]) -> (Modelled, Acquisition) {
        let acquisition = super::super::read(bytes, &Interpretation::default()).unwrap();
        let Samples::Function(modelled) = acquisition.samples.clone() else { panic!("a function") };
        (modelled, acquisition)
    }

    #[derive(Debug)]
    struct Lobe;

    impl DirectionalFunction for Lobe {
        fn evaluate(&self, wi: Direction, wo: Direction, values: &mut [f64]) {
            let h = crate::domain::vector::unit(add(wi.xyz(), wo.xyz()));
            let lobe = libm::exp(-4.0 * (h[0] * h[0] + h[1] * h[1]) / (h[2] * h[2]));
            values.iter_mut().enumerate().for_each(|(i, v)| *v = 0.1 + 0.2 * i as f64 + lobe);
        }
    }

    #[derive(Debug)]
    struct Huge;

    impl DirectionalFunction for Huge {
        fn evaluate(&self, _: Direction, _: Direction, values: &mut [f64]) {
            values.fill(f64::INFINITY);
        }
    }

    #[test]
    fn what_is_written_reads_back_as_the_function_to_the_size_of_cells() {
        let written = write_merl(&Lobe).unwrap();
        assert_eq!((written.bytes.len(), written.filled, written.clipped), (34_992_012, 0, 0));
        let (modelled, acquisition) = modelled(&written.bytes);
        assert_eq!((acquisition.format, acquisition.dialect.as_str()), (NAME, "isotropic, 90 × 90 × 180 cells, RGB"));
        assert_eq!((modelled.numbers, modelled.missing), (3 * 90 * 90 * 180, 0));
        let (mut found, mut wanted) = ([0.0; 3], [0.0; 3]);
        for k in 0..3000 {
            let k = f64::from(k);
            let wi = Direction::from_degrees((k * 37.3) % 89.0, (k * 17.9) % 360.0);
            let wo = Direction::from_degrees((k * 23.7) % 89.0, (k * 71.7) % 360.0);
            modelled.function.evaluate(wi, wo, &mut found);
            Lobe.evaluate(wi, wo, &mut wanted);
            for (found, wanted) in found.iter().zip(wanted) {
                assert!((found - wanted).abs() < 0.03, "{k}: {found} {wanted}");
            }
        }
    }

    #[test]
    fn centres_of_cells_find_their_own_cell() {
        for azimuths in [AZIMUTHS, 2 * AZIMUTHS] {
            let table = Table { azimuths, values: Vec::new() };
            for (i, j, k) in [(0, 0, 0), (3, 20, 179), (30, 10, 90), (44, 44, 3), (60, 2, azimuths - 1)] {
                let theta_h = libm::pow((i as f64 + 0.5) / 90.0, 2.0) * FRAC_PI_2;
                let theta_d = (j as f64 + 0.5).to_radians();
                let phi_d = (k as f64 + 0.5).to_radians();
                let wi = about_z(about_y(Direction::from_radians(theta_d, phi_d).xyz(), theta_h), 0.3);
                let h = Direction::from_radians(theta_h, 0.3).xyz();
                let wo = sub(scale(h, 2.0 * dot(wi, h)), wi);
                assert_eq!(table.cell(wi, wo), (i * 90 + j) * azimuths + k);
            }
        }
    }

    #[test]
    fn negative_numbers_are_masked_and_either_byte_order_is_read() {
        let value = |i: usize| if i % 7 == 3 { -1.0 } else { i as f64 };
        let (little, acquisition) = modelled(&file(180, false, value));
        assert_eq!(little.missing, (3 * 90 * 90 * 180_usize - 3).div_ceil(7));
        assert!(acquisition.report.notes.iter().any(|n| n.message.contains("negative, down to -1")));
        let (big, acquisition) = modelled(&file(180, true, value));
        assert!(acquisition.report.notes.iter().any(|n| n.message.contains("big-endian")));
        let (wi, wo) = (Direction::from_degrees(20.0, 10.0), Direction::from_degrees(50.0, 150.0));
        let (mut a, mut b) = ([0.0; 3], [0.0; 3]);
        little.function.evaluate(wi, wo, &mut a);
        big.function.evaluate(wi, wo, &mut b);
        assert_eq!(a.map(f64::to_bits), b.map(f64::to_bits));
        little.function.evaluate(wi, Direction::from_degrees(91.0, 0.0), &mut a);
        assert_eq!(a, [0.0; 3]);
    }

    #[test]
    fn a_whole_turn_of_difference_azimuths_is_not_folded() {
        // The value of a cell of red is its phi_d.
        let (whole, _) = modelled(&file(360, false, |i| (i % 360) as f64));
        let at = |phi_d: f64| {
            let h = Direction::from_degrees(20.0, 0.0).xyz();
            let wi = about_y(Direction::from_degrees(30.0, phi_d).xyz(), 20.0_f64.to_radians());
            let wo = sub(scale(h, 2.0 * dot(wi, h)), wi);
            let mut values = [0.0; 3];
            whole.function.evaluate(Direction::from_unit(wi), Direction::from_unit(wo), &mut values);
            libm::round(values[0] * 1500.0)
        };
        assert_eq!([at(10.5), at(190.5), at(359.5)], [10.0, 190.0, 359.0]);
    }

    #[test]
    fn refusals_name_their_variant() {
        use FormatErrorKind::{Malformed, NeedsOption, Unsupported};
        let refusal = |bytes: &[u8]| super::super::read(bytes, &Interpretation::default()).unwrap_err();
        let mut bytes = file(180, false, |_| 1.0);
        let whole = bytes.len();
        let cut = refusal(&bytes[..whole - 8]);
        assert_eq!((cut.kind, cut.position), (Malformed, Some(Position::Byte(whole - 8))), "{cut}");
        assert!(cut.message.contains("34992004 bytes, expected 34992012"), "{cut}");
        let at = HEAD + 8 * 1000;
        bytes[at..at + 8].copy_from_slice(&f64::NAN.to_le_bytes());
        let nan = refusal(&bytes);
        assert_eq!((nan.kind, nan.position), (Malformed, Some(Position::Byte(at))), "{nan}");
        let mut other: Vec<u8> = [90_i32, 2, 1].iter().flat_map(|w| w.to_le_bytes()).collect();
        other.resize(HEAD + 24 * 180, 0);
        let other = refusal(&other);
        assert_eq!(other.kind, Unsupported);
        assert!(other.message.contains("MERL table of 90 × 2 × 1"), "{other}");
        let asked = Interpretation { quantity: Some(Quantity::Btdf.into()), ..Interpretation::default() };
        let asked = super::super::read(&file(180, false, |_| 1.0), &asked).unwrap_err();
        assert_eq!(asked.kind, NeedsOption);
        let asked = Interpretation { unit: Some(crate::domain::Unit::Candela), ..Interpretation::default() };
        let asked = super::super::read(&file(180, false, |_| 1.0), &asked).unwrap_err();
        assert!(asked.kind == NeedsOption && asked.message.contains("expected 1/sr"), "{asked}");
        assert_eq!(write_merl(&Huge).unwrap_err().kind, Malformed);
    }
}
