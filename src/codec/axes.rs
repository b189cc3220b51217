//! Axes as bytes: triangles in two, even grids in a few, uneven ones as differences of differences.
//!
//! ```text
//! axes     varint count, then each: u8 kind and
//!   0 triangles   u8 domain, u8 level
//!   1 even grid   number start, number step, varint count (wavelengths, nm)
//!   2 uneven grid list (wavelengths, nm)
//!   3 elevation   list (degrees)
//!   4 index       varint count
//!   5 rgb         nothing
//! number   u8 d ≤ 9 and a zigzag varint k: k / 10^d;  or u8 255 and an f64
//! list     varint count, u8 form; then
//!          form 255: `count` f64
//!          else varint length, range-coded second differences (zigzag, Exp-Golomb) of integers:
//!               form 0..=9: k / 10^form;  form 254: f32 bit patterns
//!          form + 100 (0..=9) and form 253 (254): before the length u8 degree d ≤ 12 and d + 1 f64, Chebyshev coefficients of
//!               a polynomial p on −1 … 1; the integers, as they are, are then those of the values less those of p at 2i / (count − 1) − 1
//! ```

use super::bytes::{Reader, Writer};
use super::error::CodecError;
use super::model::Model;
use super::polynomial::{MAX_DEGREE, Polynomial};
use super::range::{BitCoder, Decoder, Encoder};
use super::symbols::{GOLOMB_SLOTS, code_golomb};
use crate::domain::limits::{MAX_AXES, MAX_ENTRIES, MAX_WAVELENGTHS};
use crate::domain::{Axis, Domain, TriangleMesh, WavelengthGrid};

const MAX_DECIMALS: u8 = 9;
const FORM_F32: u8 = 254;
const FORM_F64: u8 = 255;
const FORM_F32_CURVE: u8 = 253;
const DECIMAL_CURVE: u8 = 100;
/// Shorter lists have no polynomial worth its coefficients.
const CURVED: usize = 64;
/// Integers of a list stay below this, so that second differences fit in 32 bits with room.
const LIST_LIMIT: f64 = 268_435_456.0;

/// Writes axes without their labels.
pub fn write_axes(w: &mut Writer, axes: &[Axis]) {
    w.varint(axes.len() as u64);
    for axis in axes {
        match axis {
            Axis::Triangles(mesh) => {
                w.u8(0);
                w.u8(mesh.domain().code());
                w.u8(mesh.level());
            }
            Axis::Wavelength(WavelengthGrid::Even { start, step, count }) => {
                w.u8(1);
                write_number(w, *start);
                write_number(w, *step);
                w.varint(*count as u64);
            }
            Axis::Wavelength(WavelengthGrid::Uneven(values)) => {
                w.u8(2);
                write_list(w, values);
            }
            Axis::Elevation(values) => {
                w.u8(3);
                write_list(w, values);
            }
            Axis::Index { count, .. } => {
                w.u8(4);
                w.varint(*count as u64);
            }
            Axis::Rgb => w.u8(5),
        }
    }
}

/// Reads axes; their own limits are checked, the product of their lengths is not.
pub fn read_axes(r: &mut Reader<'_>) -> Result<Vec<Axis>, CodecError> {
    let count = r.size(MAX_AXES, "number of axes")?;
    (0..count).map(|_| read_axis(r)).collect()
}

fn read_axis(r: &mut Reader<'_>) -> Result<Axis, CodecError> {
    match r.u8("axis kind")? {
        0 => {
            let domain = r.u8("triangle domain")?;
            let level = r.u8("triangle level")?;
            let mesh = Domain::from_code(domain).and_then(|domain| TriangleMesh::new(domain, level));
            mesh.map(Axis::Triangles).ok_or_else(|| r.malformed(format!("triangle domain {domain} at level {level}")))
        }
        1 => {
            let (start, step) = (read_number(r, "first wavelength")?, read_number(r, "wavelength step")?);
            let count = r.size(MAX_WAVELENGTHS, "number of wavelengths")?;
            let grid = WavelengthGrid::even(start, step, count).map_err(|e| r.malformed(e.to_string()))?;
            Ok(Axis::Wavelength(grid))
        }
        2 => {
            let values = read_list(r, MAX_WAVELENGTHS, "wavelengths")?;
            Ok(Axis::Wavelength(WavelengthGrid::listed(values).map_err(|e| r.malformed(e.to_string()))?))
        }
        3 => Ok(Axis::Elevation(read_list(r, MAX_ENTRIES, "elevations")?)),
        4 => Ok(Axis::Index { count: r.size(MAX_ENTRIES, "index axis length")?, labels: Vec::new() }),
        5 => Ok(Axis::Rgb),
        kind => Err(r.malformed(format!("axis kind {kind}, expected 0 to 5"))),
    }
}

/// `value · 10^decimals` if that is an integer from which `value` comes back exactly.
fn as_decimal(value: f64, decimals: u8) -> Option<i64> {
    let scale = power_of_ten(decimals);
    let scaled = libm::round(value * scale);
    (scaled.abs() < 9e15 && scaled / scale == value).then_some(scaled as i64)
}

fn power_of_ten(decimals: u8) -> f64 {
    (0..decimals).fold(1.0, |power, _| power * 10.0)
}

fn zigzag(value: i64) -> u64 {
    (value << 1 ^ value >> 63) as u64
}

fn unzigzag(value: u64) -> i64 {
    (value >> 1) as i64 ^ -((value & 1) as i64)
}

fn write_number(w: &mut Writer, value: f64) {
    if let Some((decimals, integer)) = (0..=MAX_DECIMALS).find_map(|d| Some((d, as_decimal(value, d)?))) {
        w.u8(decimals);
        w.varint(zigzag(integer));
    } else {
        w.u8(FORM_F64);
        w.f64(value);
    }
}

fn read_number(r: &mut Reader<'_>, what: &'static str) -> Result<f64, CodecError> {
    match r.u8(what)? {
        FORM_F64 => r.f64(what),
        decimals if decimals <= MAX_DECIMALS => Ok(unzigzag(r.varint(what)?) as f64 / power_of_ten(decimals)),
        form => Err(r.malformed(format!("{what} in form {form}, expected 0 to 9 or 255"))),
    }
}

fn write_list(w: &mut Writer, values: &[f64]) {
    w.varint(values.len() as u64);
    let decimals = (0..=MAX_DECIMALS).find_map(|d| {
        let integers: Option<Vec<i64>> =
            values.iter().map(|&v| as_decimal(v, d).filter(|&k| (k as f64).abs() < LIST_LIMIT)).collect();
        Some((d, integers?))
    });
    let single = || {
        let exact = values.iter().all(|&v| f64::from(v as f32) == v);
        // Positive f32 bit patterns shifted into the range of a list.
        exact.then(|| (FORM_F32, values.iter().map(|&v| i64::from((v as f32).to_bits())).collect::<Vec<_>>()))
    };
    let Some((form, integers)) = decimals.or_else(single) else {
        w.u8(FORM_F64);
        for &value in values {
            w.f64(value);
        }
        return;
    };
    let coded = |curved: bool, integers: &mut [i64]| {
        let mut encoder = Encoder::default();
        code_differences(&mut encoder, curved, integers);
        encoder.finish()
    };
    let mut best = (coded(false, &mut integers.clone()), None);
    if values.len() >= CURVED {
        for degree in 2..=MAX_DEGREE {
            let curve = Polynomial::fit(values, degree);
            let mut residuals: Vec<i64> =
                integers.iter().enumerate().map(|(i, k)| k - on_curve(form, &curve, i, values.len())).collect();
            let bytes = coded(true, &mut residuals);
            let cost = |curve: Option<&Polynomial>| curve.map_or(0, |curve| 1 + 8 * curve.coefficients.len());
            if bytes.len() + cost(Some(&curve)) < best.0.len() + cost(best.1.as_ref()) {
                best = (bytes, Some(curve));
            }
        }
    }
    match &best.1 {
        None => w.u8(form),
        Some(curve) => {
            w.u8(if form == FORM_F32 { FORM_F32_CURVE } else { form + DECIMAL_CURVE });
            w.u8(curve.coefficients.len() as u8 - 1);
            for &c in &curve.coefficients {
                w.f64(c);
            }
        }
    }
    w.varint(best.0.len() as u64);
    w.raw(&best.0);
}

/// The integer of a polynomial's value.
fn on_curve(form: u8, curve: &Polynomial, i: usize, count: usize) -> i64 {
    let value = curve.at(i, count);
    if form == FORM_F32 {
        i64::from((value as f32).to_bits())
    } else {
        // The same rounding everywhere, and no overflow for any coefficients.
        libm::round(value * power_of_ten(form)).clamp(-LIST_LIMIT, LIST_LIMIT) as i64
    }
}

fn read_list(r: &mut Reader<'_>, limit: usize, what: &'static str) -> Result<Vec<f64>, CodecError> {
    let count = r.size(limit, what)?;
    let form = r.u8(what)?;
    if form == FORM_F64 {
        // Each value takes 8 bytes, so the bytes themselves bound the allocation.
        return (0..count).map(|_| r.f64(what)).collect();
    }
    let (form, curved) = match form {
        FORM_F32 | 0..=MAX_DECIMALS => (form, false),
        FORM_F32_CURVE => (FORM_F32, true),
        curve if curve >= DECIMAL_CURVE && curve - DECIMAL_CURVE <= MAX_DECIMALS => (curve - DECIMAL_CURVE, true),
        _ => return Err(r.malformed(format!("{what} in form {form}, expected 0 to 9, 100 to 109 or 253 to 255"))),
    };
    let curve = if curved { Some(read_curve(r, what)?) } else { None };
    let length = r.size(usize::MAX >> 1, what)?;
    let coded = r.take(length, what)?;
    let mut integers = vec![0_i64; count];
    code_differences(&mut Decoder::new(coded), curved, &mut integers);
    if let Some(curve) = curve {
        for (i, k) in integers.iter_mut().enumerate() {
            *k = k.wrapping_add(on_curve(form, &curve, i, count));
        }
    }
    let scale = power_of_ten(form.min(MAX_DECIMALS));
    let value = |k: i64| match form {
        FORM_F32 => u32::try_from(k).ok().map(|bits| f64::from(f32::from_bits(bits))),
        _ => Some(k as f64 / scale),
    };
    let values = integers.into_iter().map(|k| value(k).filter(|v| v.is_finite()));
    values.collect::<Option<Vec<_>>>().ok_or_else(|| r.malformed(format!("{what} out of range")))
}

fn read_curve(r: &mut Reader<'_>, what: &'static str) -> Result<Polynomial, CodecError> {
    let degree = usize::from(r.u8(what)?);
    if degree > MAX_DEGREE {
        return Err(r.malformed(format!("{what} on a polynomial of degree {degree}, expected at most {MAX_DEGREE}")));
    }
    Ok(Polynomial { coefficients: (0..=degree).map(|_| r.f64(what)).collect::<Result<_, _>>()? })
}

/// Codes integers below 2^32 as differences of differences, or as they are beside a curve.
fn code_differences<C: BitCoder>(coder: &mut C, curved: bool, integers: &mut [i64]) {
    let mut model = Model::new(3 * GOLOMB_SLOTS, 1);
    let (mut last, mut difference) = (0_i64, 0_i64);
    for (i, integer) in integers.iter_mut().enumerate() {
        let guess = if curved { 0 } else { last.wrapping_add(difference) };
        let residual = zigzag(integer.wrapping_sub(guess));
        let first = i.min(2) * GOLOMB_SLOTS;
        // High and low halves, because a code word holds 31 bits.
        let high = code_golomb(coder, &mut model, first, (residual >> 30) as u32);
        let low = if high > 0 {
            coder.bits(residual as u32 & 0x3FFF_FFFF, 30)
        } else {
            code_golomb(coder, &mut model, first, residual as u32 & 0x3FFF_FFFF)
        };
        let residual = unzigzag(u64::from(high) << 30 | u64::from(low & 0x3FFF_FFFF));
        let value = guess.wrapping_add(residual);
        difference = if i == 0 { 0 } else { value.wrapping_sub(last) };
        last = value;
        *integer = value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn round_trip(axes: &[Axis]) -> usize {
        let mut w = Writer::default();
        write_axes(&mut w, axes);
        let bytes = w.into_bytes();
        let mut r = Reader::new(&bytes, 0);
        assert_eq!(read_axes(&mut r).unwrap(), axes);
        r.end("axes").unwrap();
        bytes.len()
    }

    fn wavelengths(values: Vec<f64>) -> Axis {
        Axis::Wavelength(WavelengthGrid::listed(values).unwrap())
    }

    #[test]
    fn axes_round_trip_in_few_bytes() {
        let mesh = |domain, level| Axis::Triangles(TriangleMesh::new(domain, level).unwrap());
        let even = Axis::Wavelength(WavelengthGrid::even(380.0, 5.0, 75).unwrap());
        assert!(round_trip(&[mesh(Domain::Hemisphere, 1), mesh(Domain::Lower, 4), even]) <= 16);
        assert!(round_trip(&[Axis::Elevation((0..45).map(|i| f64::from(i) * 2.0).collect()), Axis::Rgb]) <= 16);
        round_trip(&[Axis::Index { count: 24, labels: vec![] }, wavelengths(vec![403.1, 405.5, 407.0, 436.0])]);
        round_trip(&[wavelengths(vec![0.1 + 0.2, 1.0, std::f64::consts::PI])]);
        // A spectrometer's polynomial in f32.
        let pixels = (0..1360).map(|i| f64::from((199.998 + 0.1697 * f64::from(i) - 1e-6 * f64::from(i * i)) as f32));
        assert!(round_trip(&[wavelengths(pixels.collect())]) < 150);
    }

    proptest! {
        #[test]
        fn any_list_round_trips(steps in prop::collection::vec(prop_oneof![1e-3..1e3_f64, Just(0.25), Just(5.0)], 1..40)) {
            let values: Vec<f64> = steps.iter().scan(100.0, |at, step| { *at += step; Some(*at) }).collect();
            round_trip(&[wavelengths(values.clone())]);
            round_trip(&[wavelengths(values.iter().map(|&v| f64::from(v as f32)).collect())]);
            let many: Vec<f64> = (0..200).map(|i| values[0] + 0.7 * f64::from(i) + 1e-3 * steps[i as usize % steps.len()]).collect();
            round_trip(&[Axis::Elevation(many.iter().map(|v| (v * 100.0).round() / 100.0).collect())]);
        }

        #[test]
        fn any_bytes_are_axes_or_an_error(bytes in prop::collection::vec(any::<u8>(), 0..60)) {
            let _ = read_axes(&mut Reader::new(&bytes, 0));
        }
    }
}
