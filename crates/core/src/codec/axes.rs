//! Compact byte form of axes: one byte for triangles, a few for even grids, coded second differences for uneven ones.
//!
//! ```text
//! axis     u8 128 + 32 · domain + level: triangles; otherwise u8 kind + 8 · form (form 0 if the kind needs none), and
//!   0 even grid   number start, number step, varint count (wavelengths, nm)
//!   1 uneven grid list (wavelengths, nm)
//!   2 elevation   list (degrees)
//!   3 index       varint count
//!   4 rgb         no fields
//!   5 polar       list (degrees), then u8 frame + 4 · dark + 8 · mirrored + 16 · azimuths + 32 · low + 64 · high;
//!                 low: an f64 follows, the smallest polar angle covered (default: the first of the list);
//!                 high: an f64 follows, the largest polar angle covered (default: the last of the list);
//!                 azimuths: an axis of kind 6 follows, which shares one axis of the tensor with this one
//!   6 azimuth     list (degrees), then u8 extent
//!                 frames: 0 surface, 1 type C, 2 type B, 3 type A;
//!                 dark: values outside the covered angles are 0, otherwise masked;
//!                 mirrored: latitude H has the values of latitude -H;
//!                 extents: 0 circle, 1 closed, 2 sector, 3 mirrored across 0 and 180°, 4 mirrored across 90° and 270°,
//!                 5 quadrant
//! number   form d ≤ 9: varint k, the number is k / 10^d;  form 15: an f64
//! list     varint count; then
//!          form 13: u8 rule + 16 · d, then both ends as numbers of form d (signed, zigzag varints); the rule gives all
//!          entries between them
//!          form 15: `count` f64
//!          form d ≤ 9 (integers k, entries k / 10^d) or form 14 (k are f32 bit patterns): u8 c, then c f64, the
//!          Chebyshev coefficients of a polynomial on −1 … 1; then varint length and range-coded integers (zigzag,
//!          Exp-Golomb):
//!          if c = 0 the second differences of k, else the differences between k and the polynomial at
//!          2i / (count − 1) − 1
//! ```

use super::bytes::{Reader, Writer};
use super::error::CodecError;
use super::model::Model;
use super::polynomial::{MAX_DEGREE, Polynomial};
use super::range::{BitCoder, Decoder, Encoder};
use super::spacing::{Rule, Spacing};
use super::symbols::{GOLOMB_SLOTS, code_golomb};
use crate::domain::limits::{MAX_ENTRIES, MAX_WAVELENGTHS};
use crate::domain::{
    Axis, AzimuthExtent, Azimuths, DirectionGrid, Domain, Frame, Outside, TriangleMesh, WavelengthGrid,
};

const MAX_DECIMALS: u8 = 9;
const FORM_SPACED: u8 = 13;
const FORM_F32: u8 = 14;
const FORM_F64: u8 = 15;
const TRIANGLES: u8 = 0x80;
/// Smallest number of entries of a list for which a polynomial is tried as predictor; for shorter lists its
/// coefficients cost more than they save.
const CURVED: usize = 64;
/// Exclusive upper bound on the integers as which a list of numbers is stored, so that their second differences fit in
/// 32 bits.
const LIST_LIMIT: f64 = 268_435_456.0;

/// Writes the axes of a tensor to a file; their number and their labels are not written.
pub(crate) fn write_axes(w: &mut Writer, axes: &[Axis]) {
    for axis in axes {
        match axis {
            Axis::Triangles(mesh) => w.u8(TRIANGLES | mesh.domain().code() << 5 | mesh.level()),
            Axis::Wavelength(WavelengthGrid::Even { start, step, count }) => {
                let numbers = [*start, *step];
                let form = decimals_of(&numbers).unwrap_or(FORM_F64);
                w.u8(form << 3);
                for number in numbers {
                    match as_decimal(number, form.min(MAX_DECIMALS)) {
                        Some(integer) if form != FORM_F64 => w.varint(integer.unsigned_abs()),
                        _ => w.f64(number),
                    }
                }
                w.varint(*count as u64);
            }
            Axis::Wavelength(WavelengthGrid::Uneven(values)) => write_list(w, 1, values),
            Axis::Elevation(values) => write_list(w, 2, values),
            Axis::Index { count, .. } => {
                w.u8(3);
                w.varint(*count as u64);
            }
            Axis::Rgb => w.u8(4),
            Axis::Grid(grid) => write_grid(w, grid),
        }
    }
}

const DARK: u8 = 4;
const MIRRORED: u8 = 8;
const AZIMUTHS: u8 = 16;
const LOW: u8 = 32;
const HIGH: u8 = 64;

fn write_grid(w: &mut Writer, grid: &DirectionGrid) {
    let polar = grid.polar();
    write_list(w, 5, polar);
    let (low, high) = grid.covers();
    let ends =
        [(low, polar.first(), LOW), (high, polar.last(), HIGH)].map(|(end, own, flag)| (end, own != Some(&end), flag));
    let flags = [
        (grid.outside() == Outside::Dark, DARK),
        (grid.is_polar_mirrored(), MIRRORED),
        (grid.azimuths().is_some(), AZIMUTHS),
    ];
    let flags = flags.into_iter().chain(ends.map(|(_, stated, flag)| (stated, flag)));
    w.u8(grid.frame().code() + flags.filter(|(set, _)| *set).map(|(_, flag)| flag).sum::<u8>());
    for (end, stated, _) in ends {
        if stated {
            w.f64(end);
        }
    }
    if let Some(azimuths) = grid.azimuths() {
        write_list(w, 6, &azimuths.angles);
        w.u8(azimuths.extent.code());
    }
}

/// Reads `count` axes of a tensor from a file. Limits of each axis are checked; the product of the lengths is not.
pub(crate) fn read_axes(r: &mut Reader<'_>, count: usize) -> Result<Vec<Axis>, CodecError> {
    (0..count).map(|_| read_axis(r)).collect()
}

fn read_axis(r: &mut Reader<'_>) -> Result<Axis, CodecError> {
    let first = r.u8("axis")?;
    if first >= TRIANGLES {
        let (domain, level) = (first >> 5 & 3, first & 31);
        let mesh = Domain::from_code(domain).and_then(|domain| TriangleMesh::new(domain, level));
        return mesh
            .map(Axis::Triangles)
            .ok_or_else(|| r.malformed(format!("no triangle mesh has domain {domain} and level {level}")));
    }
    let (kind, form) = (first & 7, first >> 3);
    match (kind, form) {
        (0..=2 | 5, 0..=MAX_DECIMALS | FORM_F64) | (1..=2 | 5, FORM_SPACED | FORM_F32) | (3..=4, 0) => {}
        _ => {
            return Err(r.malformed(format!(
                "found an axis of kind {kind} whose numbers have the encoding {form}, expected kind 0 to 5 and an \
                     encoding of that kind"
            )));
        }
    }
    match kind {
        0 => {
            let (start, step) = (read_number(r, form, "first wavelength")?, read_number(r, form, "wavelength step")?);
            let count = r.size(MAX_WAVELENGTHS, "number of wavelengths")?;
            let grid = WavelengthGrid::even(start, step, count).map_err(|e| r.malformed(e.to_string()))?;
            Ok(Axis::Wavelength(grid))
        }
        1 => {
            let values = read_list(r, form, MAX_WAVELENGTHS, "wavelengths")?;
            Ok(Axis::Wavelength(WavelengthGrid::listed(values).map_err(|e| r.malformed(e.to_string()))?))
        }
        2 => Ok(Axis::Elevation(read_list(r, form, MAX_ENTRIES, "elevations")?)),
        5 => read_grid(r, form).map(Axis::Grid),
        3 => Ok(Axis::Index { count: r.size(MAX_ENTRIES, "index axis length")?, labels: Vec::new() }),
        _ => Ok(Axis::Rgb),
    }
}

fn read_grid(r: &mut Reader<'_>, form: u8) -> Result<DirectionGrid, CodecError> {
    let polar = read_list(r, form, MAX_ENTRIES, "polar angles")?;
    let flags = r.u8("frame and flags of polar angles")?;
    let has = |flag: u8| flags & flag != 0;
    if has(0x80) {
        return Err(r.malformed(format!("the flags {flags:#04x} of the polar angles of a grid are unknown")));
    }
    let frame = Frame::from_code(flags & 3).unwrap_or(Frame::Surface);
    let mut end = |flag, what| if has(flag) { r.f64(what).map(Some) } else { Ok(None) };
    let (low, high) = (end(LOW, "least polar angle covered")?, end(HIGH, "largest polar angle covered")?);
    let azimuths = if has(AZIMUTHS) { Some(read_azimuths(r)?) } else { None };
    let made = DirectionGrid::new(frame, polar, azimuths).and_then(|grid| {
        let (first, last) = grid.covers();
        let grid = grid.covering(low.unwrap_or(first), high.unwrap_or(last))?;
        let grid = grid.with_outside(if has(DARK) { Outside::Dark } else { Outside::Masked });
        if has(MIRRORED) { grid.mirrored() } else { Ok(grid) }
    });
    made.map_err(|e| r.malformed(e.to_string()))
}

fn read_azimuths(r: &mut Reader<'_>) -> Result<Azimuths, CodecError> {
    let first = r.u8("azimuths")?;
    let (kind, form) = (first & 7, first >> 3);
    if kind != 6 || !matches!(form, 0..=MAX_DECIMALS | FORM_SPACED | FORM_F32 | FORM_F64) {
        return Err(r.malformed(format!(
            "found an axis of kind {kind} with the encoding {form} after polar angles, expected azimuths, kind 6"
        )));
    }
    let angles = read_list(r, form, MAX_ENTRIES, "azimuths")?;
    let code = r.u8("extent of azimuths")?;
    let extent = AzimuthExtent::from_code(code)
        .ok_or_else(|| r.malformed(format!("the code {code} of the extent of azimuths is unknown")))?;
    Ok(Azimuths { angles, extent })
}

/// Returns `value · 10^decimals` if it is an integer from which `value` is restored exactly.
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

/// Returns the smallest number of decimals with which all values are restored exactly from integers.
fn decimals_of(values: &[f64]) -> Option<u8> {
    (0..=MAX_DECIMALS).find(|&d| values.iter().all(|&v| as_decimal(v, d).is_some()))
}

fn read_number(r: &mut Reader<'_>, form: u8, what: &'static str) -> Result<f64, CodecError> {
    if form == FORM_F64 {
        return r.f64(what);
    }
    Ok(r.varint(what)? as f64 / power_of_ten(form))
}

fn write_list(w: &mut Writer, kind: u8, values: &[f64]) {
    let decimals = (0..=MAX_DECIMALS).find_map(|d| {
        let integers: Option<Vec<i64>> =
            values.iter().map(|&v| as_decimal(v, d).filter(|&k| (k as f64).abs() < LIST_LIMIT)).collect();
        Some((d, integers?))
    });
    if decimals.is_none()
        && let Some(spacing) = Spacing::of(values)
    {
        w.u8(kind | FORM_SPACED << 3);
        w.varint(values.len() as u64);
        return write_spacing(w, spacing);
    }
    let single = || {
        let exact = values.iter().all(|&v| f64::from(v as f32) == v);
        // Bit patterns of positive f32, shifted into the range of a list.
        exact.then(|| (FORM_F32, values.iter().map(|&v| i64::from((v as f32).to_bits())).collect::<Vec<_>>()))
    };
    let Some((form, integers)) = decimals.or_else(single) else {
        w.u8(kind | FORM_F64 << 3);
        w.varint(values.len() as u64);
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
            let cost = |curve: Option<&Polynomial>| curve.map_or(0, |curve| 8 * curve.coefficients.len());
            if bytes.len() + cost(Some(&curve)) < best.0.len() + cost(best.1.as_ref()) {
                best = (bytes, Some(curve));
            }
        }
    }
    let coefficients = best.1.map_or_else(Vec::new, |curve| curve.coefficients);
    w.u8(kind | form << 3);
    w.varint(values.len() as u64);
    w.u8(coefficients.len() as u8);
    for c in coefficients {
        w.f64(c);
    }
    w.varint(best.0.len() as u64);
    w.raw(&best.0);
}

fn write_spacing(w: &mut Writer, spacing: Spacing) {
    let ends = [spacing.start, spacing.end];
    let form = decimals_of(&ends).unwrap_or(FORM_F64);
    w.u8(spacing.rule.code() | form << 4);
    for end in ends {
        match as_decimal(end, form.min(MAX_DECIMALS)) {
            Some(integer) if form != FORM_F64 => w.varint(zigzag(integer)),
            _ => w.f64(end),
        }
    }
}

fn read_spacing(r: &mut Reader<'_>, what: &'static str) -> Result<Spacing, CodecError> {
    let first = r.u8(what)?;
    let (rule, form) = (Rule::ALL.get(usize::from(first & 15)), first >> 4);
    let (Some(&rule), 0..=MAX_DECIMALS | FORM_F64) = (rule, form) else {
        return Err(r.malformed(format!(
            "{what} are spaced by rule {} between ends in form {form}, expected a known rule and form",
            first & 15
        )));
    };
    let mut end = || match form {
        FORM_F64 => r.f64(what),
        _ => Ok(unzigzag(r.varint(what)?) as f64 / power_of_ten(form)),
    };
    Ok(Spacing { rule, start: end()?, end: end()? })
}

/// Returns the integer that a polynomial predicts for entry `i` of a list of `count` integers.
fn on_curve(form: u8, curve: &Polynomial, i: usize, count: usize) -> i64 {
    let value = curve.at(i, count);
    if form == FORM_F32 {
        i64::from((value as f32).to_bits())
    } else {
        // Rounds identically on every machine and cannot overflow, whatever the coefficients.
        libm::round(value * power_of_ten(form)).clamp(-LIST_LIMIT, LIST_LIMIT) as i64
    }
}

fn read_list(r: &mut Reader<'_>, form: u8, limit: usize, what: &'static str) -> Result<Vec<f64>, CodecError> {
    let count = r.size(limit, what)?;
    if form == FORM_F64 {
        // Each value takes 8 bytes, so the bytes themselves bound the allocation.
        return (0..count).map(|_| r.f64(what)).collect();
    }
    if form == FORM_SPACED {
        let spacing = read_spacing(r, what)?;
        let values = (0..count).map(|i| Some(spacing.at(i, count)).filter(|value| value.is_finite()));
        return values
            .collect::<Option<Vec<_>>>()
            .ok_or_else(|| r.malformed(format!("{what} contain a value that is no finite number")));
    }
    let coefficients = usize::from(r.u8(what)?);
    if coefficients > MAX_DEGREE + 1 {
        let most = MAX_DEGREE + 1;
        return Err(
            r.malformed(format!("{what} follow a polynomial of {coefficients} coefficients, expected at most {most}"))
        );
    }
    let coefficients = (0..coefficients).map(|_| r.f64(what)).collect::<Result<Vec<_>, _>>()?;
    let curve = (!coefficients.is_empty()).then_some(Polynomial { coefficients });
    let length = r.size(usize::MAX >> 1, what)?;
    let coded = r.take(length, what)?;
    let mut integers = vec![0_i64; count];
    code_differences(&mut Decoder::new(coded), curve.is_some(), &mut integers);
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
    values
        .collect::<Option<Vec<_>>>()
        .ok_or_else(|| r.malformed(format!("{what} contain a value that is no finite number")))
}

/// Encodes or decodes a list of integers below 2^32 as second differences. If `curved` is true, the integers are coded
/// directly, because they already are deviations of the entries of an axis from a fitted polynomial.
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
    use crate::numeric::drawn::{any_list, list, number};
    use arbtest::arbtest;

    fn round_trip(axes: &[Axis]) -> usize {
        let mut w = Writer::default();
        write_axes(&mut w, axes);
        let bytes = w.into_bytes();
        let mut r = Reader::new(&bytes, 0);
        assert_eq!(read_axes(&mut r, axes.len()).unwrap(), axes);
        r.end("axes").unwrap();
        bytes.len()
    }

    fn wavelengths(values: Vec<f64>) -> Axis {
        Axis::Wavelength(WavelengthGrid::listed(values).unwrap())
    }

    #[test]
    fn grids_of_angles_round_trip_in_few_bytes() {
        let every = |step: f64, count: usize| (0..count).map(|i| i as f64 * step).collect::<Vec<f64>>();
        let azimuths = |angles, extent| Some(Azimuths { angles, extent });
        let lamp =
            DirectionGrid::new(Frame::TypeC, every(2.5, 37), azimuths(every(10.0, 37), AzimuthExtent::Closed)).unwrap();
        assert!(round_trip(&[Axis::Grid(lamp.with_outside(Outside::Dark))]) <= 20);
        let polar = every(2.0, 45);
        let paint = DirectionGrid::new(
            Frame::Surface,
            polar.clone(),
            azimuths(every(180.0 / 89.0, 90), AzimuthExtent::Mirrored),
        );
        let paint = paint.unwrap().covering(0.0, 90.0).unwrap();
        assert!(round_trip(&[Axis::Grid(paint.clone())]) <= 24);
        round_trip(&[Axis::Elevation(polar), Axis::Grid(paint), Axis::Rgb]);
        for frame in [Frame::TypeA, Frame::TypeB] {
            let listed = azimuths(vec![-30.5, 0.125, 7.0], AzimuthExtent::Sector);
            let grid = DirectionGrid::new(frame, vec![0.0, 0.1, 1.0 / 3.0, 80.0], listed).unwrap();
            round_trip(&[Axis::Grid(grid.clone())]);
            round_trip(&[Axis::Grid(grid.covering(-1.5, 90.0).unwrap())]);
            let south = DirectionGrid::new(frame, vec![-90.0, -22.5, 17.25], None).unwrap();
            round_trip(&[Axis::Grid(south)]);
            round_trip(&[Axis::Grid(DirectionGrid::new(frame, vec![0.0, 22.5], None).unwrap().mirrored().unwrap())]);
        }
    }

    #[test]
    fn axes_round_trip_in_few_bytes() {
        let mesh = |domain, level| Axis::Triangles(TriangleMesh::new(domain, level).unwrap());
        let even = Axis::Wavelength(WavelengthGrid::even(380.0, 5.0, 75).unwrap());
        assert!(round_trip(&[mesh(Domain::Hemisphere, 1), mesh(Domain::Lower, 4), even]) <= 7);
        assert!(round_trip(&[Axis::Elevation((0..45).map(|i| f64::from(i) * 2.0).collect()), Axis::Rgb]) <= 10);
        round_trip(&[Axis::Index { count: 24, labels: vec![] }, wavelengths(vec![403.1, 405.5, 407.0, 436.0])]);
        round_trip(&[wavelengths(vec![0.1 + 0.2, 1.0, std::f64::consts::PI])]);
        // A spectrometer's polynomial in f32.
        let pixels = (0..1360).map(|i| f64::from((199.998 + 0.1697 * f64::from(i) - 1e-6 * f64::from(i * i)) as f32));
        assert!(round_trip(&[wavelengths(pixels.collect())]) < 150);
    }

    #[test]
    fn lists_of_wavelengths_and_elevations_round_trip() {
        arbtest(|u| {
            let steps = list(u, 1..=39, |u| {
                let drawn = number(u, 1e-3..1e3)?;
                u.choose(&[drawn, 0.25, 5.0]).copied()
            })?;
            let values: Vec<f64> = steps
                .iter()
                .scan(100.0, |at, step| {
                    *at += step;
                    Some(*at)
                })
                .collect();
            round_trip(&[wavelengths(values.clone())]);
            round_trip(&[wavelengths(values.iter().map(|&v| f64::from(v as f32)).collect())]);
            let many: Vec<f64> =
                (0..200).map(|i| values[0] + 0.7 * f64::from(i) + 1e-3 * steps[i as usize % steps.len()]).collect();
            round_trip(&[Axis::Elevation(many.iter().map(|v| (v * 100.0).round() / 100.0).collect())]);
            Ok(())
        });
    }

    #[test]
    fn any_bytes_are_axes_or_an_error() {
        arbtest(|u| {
            let bytes: Vec<u8> = any_list(u, 0..=59)?;
            let _ = read_axes(&mut Reader::new(&bytes, 0), 3);
            Ok(())
        });
    }
}
