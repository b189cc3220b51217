//! Tests of prefixes: a material cut at a level is a coarser material, keeps its stated errors, and has the light of
//! the original.

use super::tests::{hurt, measurement, mesh, settings, shapes, wavelengths};
use super::*;
use crate::domain::{Axis, Domain, ErrorReport, Quantity, Silent, TriangleMesh};
use crate::numeric::cases::one_in;

/// Means of the original samples over the triangles of a coarser `level` of the last triangle axis, computed by
/// definition.
fn averages(m: &Measurement, level: u8) -> Vec<f32> {
    let axes = m.tensor.axes();
    let at = axes.iter().rposition(|axis| matches!(axis, Axis::Triangles(_))).unwrap();
    let Axis::Triangles(mesh) = axes[at] else { unreachable!() };
    let inner: usize = axes[at + 1..].iter().map(Axis::len).product();
    let below = 1 << (2 * (mesh.level() - level));
    let samples = m.tensor.samples();
    (0..samples.len() / below)
        .map(|i| {
            let (cell, lane) = (i / inner, i % inner);
            let leaves = (0..below).map(|k| samples[(cell * below + k) * inner + lane]);
            let live: Vec<f64> = leaves.filter(|s| !s.is_nan()).map(f64::from).collect();
            (live.iter().sum::<f64>() / live.len() as f64) as f32
        })
        .collect()
}

/// Light for each incoming direction: all samples summed, each weighted by the (projected) solid angle of its outgoing
/// triangle. A triangle has `length` samples, one for each wavelength.
fn light(m: &Measurement, mesh: TriangleMesh, length: usize, samples: &[f32]) -> Vec<f64> {
    let weight = |i| if m.quantity.has_cosine() { mesh.projected_solid_angle(i) } else { mesh.solid_angle(i) };
    let weights: Vec<f64> = (0..mesh.len()).map(weight).collect();
    let row = |row: &[f32]| row.iter().filter(|s| !s.is_nan()).map(|&s| f64::from(s)).sum::<f64>();
    let rows = |block: &[f32]| block.chunks_exact(length).zip(&weights).map(|(s, w)| w * row(s)).sum();
    samples.chunks_exact(mesh.len() * length).map(rows).collect()
}

fn pyramids() -> Vec<Measurement> {
    let mut all: Vec<Measurement> = shapes()
        .into_iter()
        .filter(|m| m.tensor.axes().iter().any(|axis| matches!(axis, Axis::Triangles(_))))
        .flat_map(|m| [m.clone(), hurt(m)])
        .collect();
    let axes = vec![mesh(Domain::Hemisphere, 1), mesh(Domain::Hemisphere, 4), wavelengths(9)];
    all.push(measurement(Quantity::Brdf, axes, 0.001));
    all
}

fn check_levels(m: &Measurement, target: Target) -> usize {
    let compressed =
        compress(m, &Settings { basis: "klt".to_owned(), ..settings(target, Policy::Rd) }, &Silent).unwrap();
    let bytes = &compressed.bytes;
    let infos = levels(bytes).unwrap();
    let finest = infos.last().unwrap();
    let without =
        compress(m, &Settings { metadata: None, basis: "klt".to_owned(), ..settings(target, Policy::Rd) }, &Silent);
    assert_eq!(finest.bytes, without.unwrap().bytes.len() as u64);
    assert_eq!(finest.er_l2, inspect(bytes).unwrap().errors.er_l2);
    let whole = decode(bytes).unwrap().measurement.tensor;
    for cut in [bytes.len(), bytes.len() - 1, finest.bytes as usize] {
        let again = decode_level(&bytes[..cut], finest.level).unwrap().measurement.tensor;
        assert!(again.samples().iter().zip(whole.samples()).all(|(a, b)| a.to_bits() == b.to_bits()));
    }
    assert!(infos.is_sorted_by(|a, b| a.level < b.level && a.bytes <= b.bytes));
    for info in &infos[..infos.len() - 1] {
        let cut = &bytes[..info.bytes as usize];
        let decoded = decode_level(cut, info.level).unwrap();
        assert_eq!(decoded.summary, Summary { metadata: None, ..decoded.summary.clone() });
        let coarse = decoded.measurement.tensor;
        let last = coarse.axes().iter().rfind(|axis| matches!(axis, Axis::Triangles(_)));
        let Some(&Axis::Triangles(mesh)) = last else { unreachable!() };
        assert_eq!(mesh.level(), info.level);
        let original = averages(m, info.level);
        let errors = ErrorReport::measure(&original, coarse.samples(), compressed.summary.floor);
        assert_eq!(errors.mask_mismatches, 0);
        assert!(errors.er_l2 <= info.er_l2 && info.er_l2 < errors.er_l2 * 1.1 + 1e-9, "{} {info:?}", errors.er_l2);
        let length = coarse.axes().last().filter(|axis| !matches!(axis, Axis::Triangles(_))).map_or(1, Axis::len);
        let (wanted, found) = (light(m, mesh, length, &original), light(m, mesh, length, coarse.samples()));
        // Blocks that are coded together differ by their noise.
        let close = |(w, f): (&f64, &f64)| (f / w - 1.0).abs() < 0.013;
        assert!(wanted.iter().zip(&found).all(close), "{:?} {info:?}: {wanted:?} {found:?}", m.quantity);
        // A longer prefix changes nothing; a shorter one is an error.
        assert!(coarse == decode_level(bytes, info.level).unwrap().measurement.tensor || coarse.masked() > 0);
        let cut = decode_level(&bytes[..info.bytes as usize - 1], info.level);
        assert!(matches!(cut, Err(DecodeError::Truncated { .. })));
    }
    let above = decode_level(bytes, finest.level + 1);
    assert!(matches!(above, Err(DecodeError::Malformed { .. })));
    infos.len()
}

#[test]
fn every_level_keeps_its_error_and_its_light() {
    let mut pyramids_of_levels = 0;
    for (number, m) in pyramids().into_iter().enumerate() {
        for target in one_in(2, number % 2, [Target::ErL2(0.01), Target::MaxRelativeError(0.03)]) {
            pyramids_of_levels += usize::from(check_levels(&m, target) > 2);
        }
    }
    assert!(pyramids_of_levels > 4, "{pyramids_of_levels}");
}

#[test]
fn a_prefix_of_any_length_decodes_to_what_it_holds() {
    let axes = vec![mesh(Domain::Hemisphere, 1), mesh(Domain::Hemisphere, 3), wavelengths(9)];
    for m in [measurement(Quantity::Brdf, axes.clone(), 0.01), hurt(measurement(Quantity::Brdf, axes, 0.01))] {
        let klt = Settings { basis: "klt".to_owned(), ..settings(Target::ErL2(0.02), Policy::Rd) };
        let bytes = compress(&m, &klt, &Silent).unwrap().bytes;
        let infos = levels(&bytes).unwrap();
        assert_eq!(infos.len(), 4);
        for end in
            (0..bytes.len()).filter(|end| end % 97 == 0 || infos.iter().any(|i| i.bytes.abs_diff(*end as u64) < 2))
        {
            for info in &infos {
                let decoded = decode_level(&bytes[..end], info.level);
                assert_eq!(decoded.is_ok(), end as u64 >= info.bytes, "{end} of {info:?}: {:?}", decoded.err());
            }
            // A cut chunk is not verified, and any bytes in it decode to some material.
            let mut damaged = bytes[..end].to_vec();
            if let Some(last) = damaged.last_mut() {
                *last ^= 0xA5;
            }
            let _ = decode_level(&damaged, 1);
        }
    }
}

#[test]
fn other_policies_have_their_finest_level_alone() {
    let m = measurement(Quantity::Edf, vec![mesh(Domain::Sphere, 3), wavelengths(9)], 0.01);
    for settings in [
        settings(Target::ErL2(0.05), Policy::Generic),
        settings(Target::Lossless, Policy::Rd),
        Settings { basis: "haar".to_owned(), ..settings(Target::ErL2(0.05), Policy::Rd) },
    ] {
        let bytes = compress(&m, &settings, &Silent).unwrap().bytes;
        let infos = levels(&bytes).unwrap();
        assert_eq!((infos.len(), infos[0].level), (1, 3));
        assert!(decode_level(&bytes, 3).is_ok());
        assert!(matches!(decode_level(&bytes, 2), Err(DecodeError::Malformed { .. })));
    }
    let spectrum = measurement(Quantity::Spectrum, vec![wavelengths(31)], 0.01);
    let bytes = compress(&spectrum, &settings(Target::ErL2(0.05), Policy::Rd), &Silent).unwrap().bytes;
    assert_eq!(levels(&bytes).unwrap()[0].level, 0);
    assert_eq!(decode_level(&bytes, 0).unwrap().measurement.tensor, decode(&bytes).unwrap().measurement.tensor);
}

#[test]
fn the_index_of_a_folded_material_is_small() {
    let axes = vec![mesh(Domain::Hemisphere, 1), mesh(Domain::Hemisphere, 4), wavelengths(31)];
    let m = measurement(Quantity::Brdf, axes, 0.003);
    let bytes = compress(&m, &settings(Target::ErL2(0.01), Policy::Rd), &Silent).unwrap().bytes;
    let (header, container) = crate::codec::Container::read(&bytes, |r| {
        let header = header::Header::read(r)?;
        let announced = header.announced();
        Ok((header, announced))
    })
    .unwrap();
    assert!(header.predicted);
    let mut r = container.require(crate::codec::ChunkKind::Pyramid).unwrap().reader();
    let start = r.offset();
    let length = r.remaining();
    rd::levels::LevelIndex::read(&mut r, 4, length).unwrap();
    assert!(r.offset() - start <= 14, "{}", r.offset() - start);
}
