//! Tests of random access: every block decodes independently to the samples of the whole, and damage stays within its
//! block.

use super::tests::{hurt, index, measurement, mesh, settings, shapes, wavelengths};
use super::*;
use crate::codec::{ChunkKind, Container, Reader, Writer, write_container};
use crate::domain::{Axis, Domain, ErrorReport, Quantity, Silent, Tensor};
use crate::numeric::cases::one_in;

fn random(target: Target) -> Settings {
    Settings { random_access: true, ..settings(target, Policy::Rd) }
}

/// Number of blocks (entries of the axes before the last triangle axis), and number of samples in one block.
fn blocks_of(m: &Measurement) -> Option<(usize, usize)> {
    let axes = m.tensor.axes();
    let at = axes.iter().rposition(|axis| matches!(axis, Axis::Triangles(_)))?;
    let length = axes[at..].iter().map(Axis::len).product();
    (at > 0).then(|| (m.tensor.len() / length, length))
}

/// Multiplies every sample by `factor` of its incoming index, outgoing index and wavelength index.
fn varied(mut m: Measurement, factor: impl Fn(usize, usize, usize) -> f64) -> Measurement {
    let axes = m.tensor.axes().to_vec();
    let [_, outgoing, length] = m.tensor.shape()[..] else { unreachable!() };
    let mut samples = m.tensor.clone().into_samples();
    for (at, s) in samples.iter_mut().enumerate() {
        *s *= factor(at / length / outgoing, at / length % outgoing, at % length) as f32;
    }
    m.tensor = Tensor::new(axes, samples).unwrap();
    m
}

/// Test materials with several mesh symmetries or none, with and without a lobe model, on index and elevation axes,
/// with and without spectra.
fn materials() -> Vec<Measurement> {
    let hemi = |level| mesh(Domain::Hemisphere, level);
    let folded = measurement(Quantity::Brdf, vec![hemi(1), hemi(3), wavelengths(9)], 0.001);
    let flat = varied(folded.clone(), |i, o, k| {
        let Axis::Triangles(incoming) = hemi(1) else { unreachable!() };
        let Axis::Triangles(outgoing) = hemi(3) else { unreachable!() };
        let [x, y, _] = outgoing.centroid(o).xyz();
        let [u, v, _] = incoming.centroid(i).xyz();
        1.0 / (0.05 + (x + u).powi(2) + (y + v).powi(2)) * (1.0 + 0.3 * (k as f64 * x).sin())
    });
    let rough = varied(folded.clone(), |i, o, k| 1.0 + 0.4 * ((i * 37 + o * 101 + k * 7) % 29) as f64);
    // Fully symmetric: constant over directions.
    let constant = varied(folded.clone(), |_, _, _| 1.0);
    let samples: Vec<f32> = (0..constant.tensor.len()).map(|at| 0.2 + (at % 9) as f32 * 0.01).collect();
    let constant = Measurement { tensor: Tensor::new(constant.tensor.axes().to_vec(), samples).unwrap(), ..constant };
    let scans = measurement(Quantity::Edf, vec![index(3), mesh(Domain::Sphere, 2), wavelengths(11)], 0.02);
    let phase = measurement(Quantity::Phase, vec![mesh(Domain::Sphere, 1), mesh(Domain::Sphere, 2)], 0.01);
    let mut all = vec![folded, flat, rough, constant, scans, phase];
    all.extend(shapes().into_iter().filter(|m| blocks_of(m).is_some()));
    all.iter().flat_map(|m| [m.clone(), hurt(m.clone())]).collect()
}

fn bits(samples: &[f32]) -> Vec<u32> {
    samples.iter().map(|s| s.to_bits()).collect()
}

/// Kinds and payloads of a file's chunks.
fn chunks(bytes: &[u8]) -> Vec<(ChunkKind, Vec<u8>)> {
    let (header, container) = Container::read(bytes, |r| {
        let header = header::Header::read(r)?;
        let announced = header.announced();
        Ok((header, announced))
    })
    .unwrap();
    let all = [ChunkKind::Classes, ChunkKind::Basis, ChunkKind::Pyramid, ChunkKind::Corrections, ChunkKind::Metadata];
    let present = all.into_iter().filter_map(|kind| Some((kind, container.get(kind)?.payload.to_vec())));
    std::iter::once((ChunkKind::Header, header.write())).chain(present).collect()
}

/// Replaces the chunk with the coded means and details of triangles (pyramid chunk) in a file. Adapts the chunk's
/// length in the header, and recomputes the chunk's checksum.
fn with_pyramid(bytes: &[u8], pyramid: Vec<u8>) -> Vec<u8> {
    let mut chunks = chunks(bytes);
    let header = header::Header::read(&mut crate::codec::Reader::new(&chunks[0].1, 0)).unwrap();
    chunks[0].1 = header::Header { pyramid_length: pyramid.len(), ..header }.write();
    chunks.iter_mut().find(|(kind, _)| *kind == ChunkKind::Pyramid).unwrap().1 = pyramid;
    write_container(&chunks)
}

fn pyramid_of(bytes: &[u8]) -> Vec<u8> {
    chunks(bytes).into_iter().find(|(kind, _)| *kind == ChunkKind::Pyramid).unwrap().1
}

#[test]
fn every_block_alone_is_that_of_the_whole_bit_for_bit() {
    let (mut models, mut foldings, mut planes) = ([0; 4], [0; 2], 0);
    for (number, m) in materials().into_iter().enumerate() {
        for target in one_in(2, number % 2, [Target::ErL2(0.02), Target::Bytes(60_000)]) {
            let compressed = compress(&m, &random(target), &Silent).unwrap();
            let bytes = &compressed.bytes;
            let whole = decode(bytes).unwrap();
            let errors =
                ErrorReport::measure(m.tensor.samples(), whole.measurement.tensor.samples(), compressed.summary.floor);
            assert_eq!(errors, compressed.summary.errors);
            let (blocks, length) = blocks_of(&m).unwrap();
            for block in 0..blocks {
                let own = decode_block(bytes, block).unwrap();
                let same = &whole.measurement.tensor.samples()[block * length..][..length];
                assert_eq!(bits(own.tensor.samples()), bits(same), "{:?} block {block}", m.tensor.shape());
                assert_eq!(own.summary, whole.summary);
                assert_eq!(own.tensor.axes(), &m.tensor.axes()[m.tensor.axes().len() - own.tensor.axes().len()..]);
            }
            let beyond = decode_block(bytes, blocks);
            assert!(matches!(beyond, Err(DecodeError::Malformed { .. })));
            // One level: the finest.
            let infos = levels(bytes).unwrap();
            assert_eq!(infos.len(), 1);
            for level in 0..infos[0].level {
                assert!(matches!(decode_level(bytes, level), Err(DecodeError::Malformed { .. })));
            }
            let finest = decode_level(bytes, infos[0].level).unwrap().measurement.tensor;
            assert_eq!(bits(finest.samples()), bits(whole.measurement.tensor.samples()));
            let pyramid = pyramid_of(bytes);
            let first = Reader::new(&pyramid[usize::from(infos[0].level > 0)..], 0).varint("plan").unwrap();
            assert_eq!(first >> 3 & 1, 1);
            models[(first & 3) as usize] += 1;
            foldings[usize::from(first >> 4 > 0)] += 1;
            planes += usize::from(first >> 2 & 1 == 1);
        }
    }
    assert!(models[0] > 0 && models[1] + models[2] > 0 && models[3] > 0, "{models:?}");
    assert!(foldings.iter().all(|&n| n > 0) && planes > 0, "{foldings:?} {planes}");
}

#[test]
fn blocks_of_other_materials_are_those_of_the_whole() {
    for m in shapes().into_iter().chain([hurt(shapes().remove(5))]) {
        for (target, policy) in [
            (Target::ErL2(0.02), Policy::Rd),
            (Target::MaxRelativeError(0.05), Policy::Rd),
            (Target::ErL2(0.05), Policy::Conventional),
            (Target::Lossless, Policy::Rd),
        ] {
            let bytes = compress(&m, &settings(target, policy), &Silent).unwrap().bytes;
            let whole = decode(&bytes).unwrap().measurement.tensor;
            let has_triangles = m.tensor.axes().iter().any(|axis| matches!(axis, Axis::Triangles(_)));
            let (blocks, length) = blocks_of(&m).unwrap_or((1, m.tensor.len()));
            let own = decode_block(&bytes, blocks - 1);
            if has_triangles {
                let last = &whole.samples()[(blocks - 1) * length..];
                assert_eq!(bits(own.unwrap().tensor.samples()), bits(last));
            } else {
                assert!(matches!(own, Err(DecodeError::Malformed { .. })));
            }
        }
    }
}

#[test]
fn damage_in_a_stream_is_an_error_or_stays_within_the_blocks_it_stands_for() {
    let axes = vec![mesh(Domain::Hemisphere, 1), mesh(Domain::Hemisphere, 3), wavelengths(9)];
    let rough =
        varied(measurement(Quantity::Brdf, axes, 0.01), |i, o, k| 1.0 + 0.4 * ((i * 37 + o * 101 + k * 7) % 29) as f64);
    for m in [rough.clone(), hurt(rough)] {
        let bytes = compress(&m, &random(Target::ErL2(0.02)), &Silent).unwrap().bytes;
        let (blocks, length) = blocks_of(&m).unwrap();
        let whole = decode(&bytes).unwrap().measurement.tensor;
        let pyramid = pyramid_of(&bytes);
        let mut r = Reader::new(&pyramid, 0);
        assert_eq!(r.u8("no levels").unwrap(), 0);
        let first = r.varint("plan").unwrap();
        assert_eq!((first >> 2 & 1, first >> 4), (0, 0), "a pyramid, nothing folded");
        let model = if first.is_multiple_of(4) { 0 } else { r.varint("length").unwrap() as usize };
        let lengths: Vec<usize> = (0..blocks).map(|_| r.varint("length").unwrap() as usize).collect();
        let mut at = r.offset() + model;
        assert_eq!(at + lengths.iter().sum::<usize>(), pyramid.len());
        for (block, &own) in lengths.iter().enumerate() {
            let mut damaged = pyramid.clone();
            damaged[at + own / 2] ^= 0x5A;
            at += own;
            let damaged = with_pyramid(&bytes, damaged);
            for other in (0..blocks).filter(|&other| other != block) {
                let same = bits(decode_block(&damaged, other).unwrap().tensor.samples());
                assert_eq!(same, bits(&whole.samples()[other * length..][..length]));
            }
            if let Ok(own) = decode_block(&damaged, block) {
                assert_ne!(bits(own.tensor.samples()), bits(&whole.samples()[block * length..][..length]));
            }
            let _ = decode(&damaged);
        }
        // Arbitrary, missing or extra bytes never panic.
        for i in 0..pyramid.len().min(200) {
            for flip in [1, 0x80, 0xFF] {
                let mut damaged = pyramid.clone();
                damaged[i] ^= flip;
                let damaged = with_pyramid(&bytes, damaged);
                let _ = (decode_block(&damaged, i % blocks), decode_level(&damaged, 1), levels(&damaged));
                if i < 8 {
                    let _ = decode(&damaged);
                }
            }
        }
        for pyramid in [pyramid[..pyramid.len() - 1].to_vec(), [pyramid.as_slice(), &[0]].concat(), Vec::new()] {
            let damaged = with_pyramid(&bytes, pyramid);
            assert!(decode_block(&damaged, 0).is_err() && decode(&damaged).is_err());
        }
        for end in (0..bytes.len()).step_by(97) {
            assert!(decode_block(&bytes[..end], 0).is_err());
        }
        // Streams after an index of levels are contradictory.
        let mut w = Writer::default();
        for _ in 0..3 {
            w.varint(1);
            w.u8(100);
        }
        w.varint(0);
        w.raw(&pyramid[1..]);
        let both = with_pyramid(&bytes, w.into_bytes());
        assert!(matches!(decode_level(&both, 1), Err(DecodeError::Malformed { .. } | DecodeError::Truncated { .. })));
    }
}

#[test]
fn random_access_is_refused_where_blocks_are_not_coded_by_themselves() {
    let axes = vec![mesh(Domain::Hemisphere, 0), mesh(Domain::Hemisphere, 2), wavelengths(9)];
    let brdf = measurement(Quantity::Brdf, axes, 0.01);
    let edf = measurement(Quantity::Edf, vec![mesh(Domain::Sphere, 2), wavelengths(9)], 0.01);
    let table = measurement(Quantity::Reflectance, vec![index(40), wavelengths(80)], 0.01);
    let er = Target::ErL2(0.02);
    let random_of = |target, policy| Settings { random_access: true, ..settings(target, policy) };
    for (m, settings, found) in [
        (&brdf, random_of(er, Policy::Conventional), "policy conventional codes"),
        (&brdf, random_of(Target::Lossless, Policy::Rd), "policy lossless codes"),
        (&brdf, random_of(Target::MaxRelativeError(0.02), Policy::Rd), "bounds the error of every sample"),
        (&brdf, random_of(Target::MaxAbsoluteError(0.02), Policy::Rd), "bounds the error of every sample"),
        (&brdf, Settings { basis: "haar".to_owned(), ..random(er) }, "basis haar codes"),
        (&edf, random(er), "nor numbered entries (an index axis) for random access in the axes [sphere"),
        (&table, random(er), "nor numbered entries (an index axis) for random access in the axes ["),
    ] {
        match compress(m, &settings, &Silent) {
            Err(CompressError::Setting(error @ SettingError::RandomAccess(_))) => {
                let reason = error.to_string();
                assert!(reason.starts_with("random_access: ") && reason.contains(found), "{reason}");
            }
            other => panic!("{found}: {:?}", other.map(|c| c.bytes.len())),
        }
    }
    assert!(compress(&brdf, &Settings { basis: "klt".to_owned(), ..random(er) }, &Silent).is_ok());
}

#[test]
fn every_other_target_is_kept_and_bytes_do_not_depend_on_threads() {
    let axes = vec![mesh(Domain::Hemisphere, 1), mesh(Domain::Hemisphere, 2), wavelengths(73)];
    let m = measurement(Quantity::Brdf, axes, 0.02);
    for target in [
        Target::ErL1(0.01),
        Target::RelativeRmse(0.01),
        Target::DeltaE(DeltaE { at_most: 1.0, illuminant: crate::domain::colour::Illuminant::D65 }),
        Target::Ratio(40.0),
        Target::Bytes(2_000),
    ] {
        let compressed = compress(&m, &random(target), &Silent).unwrap();
        assert!(!matches!(target, Target::Bytes(most) if compressed.bytes.len() as u64 > most));
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        assert_eq!(pool.install(|| compress(&m, &random(target), &Silent)).unwrap().bytes, compressed.bytes);
    }
}
