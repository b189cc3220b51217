//! Tests with damaged files of every kind of material: a flip or a cut is an error or changes no sample. With corrected
//! checksums a flip may change samples, but never panics.

use super::*;
use crate::domain::Direction;
use std::collections::BTreeSet;

/// Bit masks that damage a byte: each single bit, and all eight at once.
const FLIPS: [u8; 9] = [0x01, 0x02, 0x04, 0x08, 0x10, 0x20, 0x40, 0x80, 0xFF];

/// Test measurement over two direction axes whose function `f` a lobe model fits well.
fn scattering(
    quantity: Quantity,
    (domain, level): (Domain, u8),
    f: impl Fn(Direction, Direction) -> f64,
) -> Measurement {
    let mesh = TriangleMesh::new(domain, level).unwrap();
    let places = (0..mesh.len()).flat_map(|i| (0..mesh.len()).map(move |o| [i, o].map(|t| mesh.centroid(t))));
    let samples = places.map(|[wi, wo]| f(wi, wo) as f32).collect();
    let tensor = Tensor::new(vec![Axis::Triangles(mesh); 2], samples).unwrap();
    Measurement::new(quantity, quantity.default_unit(), Sampling::Average, tensor).unwrap()
}

fn measurements() -> Vec<Measurement> {
    let elevations = || Axis::Elevation((0..4).map(|i| f64::from(i) * 20.0).collect());
    let uneven = Axis::Wavelength(WavelengthGrid::listed(vec![400.0, 410.5, 433.3, 500.0, 501.0]).unwrap());
    let (hemi, lower, sphere) = (Domain::Hemisphere, Domain::Lower, Domain::Sphere);
    let shapes = [
        (Quantity::Spectrum, vec![wavelengths(20)]),
        (Quantity::Spectrum, vec![uneven]),
        (Quantity::Reflectance, vec![index(3), wavelengths(12)]),
        (Quantity::Edf, vec![mesh(sphere, 1)]),
        (Quantity::Edf, vec![mesh(sphere, 0), wavelengths(7)]),
        (Quantity::Brdf, vec![mesh(hemi, 0), mesh(hemi, 1)]),
        (Quantity::Brdf, vec![mesh(hemi, 0), mesh(hemi, 1), wavelengths(5)]),
        (Quantity::Brdf, vec![elevations(), mesh(hemi, 1), Axis::Rgb]),
        (Quantity::Btdf, vec![mesh(hemi, 0), mesh(lower, 1)]),
        (Quantity::Phase, vec![mesh(sphere, 0), mesh(sphere, 1)]),
        (Quantity::Brdf, vec![index(2), index(3), wavelengths(4)]),
    ];
    let shapes = shapes.map(|(quantity, axes)| measurement(quantity, axes, 0.01));
    let mut all: Vec<Measurement> = shapes.into_iter().flat_map(|m| [hurt(m.clone()), m]).collect();
    all.push(scattering(Quantity::Phase, (sphere, 2), |wi, wo| libm::exp(4.0 * wi.dot(wo))));
    all.push(scattering(Quantity::Brdf, (hemi, 1), |wi, wo| {
        let half: [f64; 3] = std::array::from_fn(|k| wi.xyz()[k] + wo.xyz()[k]);
        let length = half.iter().map(|x| x * x).sum::<f64>().sqrt();
        0.05 + libm::exp(8.0 * (half[2] / length - 1.0))
    }));
    all
}

/// One small test file of every kind of coding, with the name of its coding scheme.
fn files() -> Vec<(String, Vec<u8>)> {
    let wanted = [
        (Target::ErL2(0.02), Policy::Rd, "auto"),
        (Target::ErL2(0.02), Policy::Rd, "klt"),
        (Target::ErL2(0.02), Policy::Rd, "db2"),
        (Target::MaxRelativeError(0.05), Policy::Rd, "auto"),
        (Target::ErL2(0.05), Policy::Conventional, "bior4.4"),
        (Target::ErL2(0.05), Policy::Generic, "haar"),
        (Target::ErL2(0.05), Policy::Adaptive, "identity"),
        (Target::Lossless, Policy::Rd, "auto"),
    ];
    let wanted = wanted.map(|(target, policy, basis)| Settings { basis: basis.to_owned(), ..settings(target, policy) });
    let own = Settings { basis: "klt".to_owned(), ..settings(Target::RelativeRmse(0.05), Policy::Rd) };
    let lit = Settings { albedo_error: Some(1e-3), ..settings(Target::ErL2(0.1), Policy::Rd) };
    let random = Settings { random_access: true, ..settings(Target::ErL2(0.02), Policy::Rd) };
    let mut files = Vec::new();
    for m in measurements() {
        // Flipping every byte of a kilobyte file with thousands of samples takes minutes and finds nothing new.
        let many = m.tensor.len() > 4096;
        for settings in wanted.iter().chain([&own, &lit, &random]).take(if many { 1 } else { usize::MAX }) {
            // The metadata are the same in all files.
            let metadata = settings.metadata.clone().filter(|_| files.len() % 16 == 0);
            match compress(&m, &Settings { metadata, ..settings.clone() }, &Silent) {
                Ok(Compressed { bytes, summary, ranking, .. }) => {
                    let kind = if settings.random_access { ", random access" } else { "" };
                    files.push((format!("{} {}{kind}", summary.policy, ranking[0].basis), bytes));
                }
                // Not every shape has light or slices.
                Err(CompressError::Setting(_)) if settings.random_access || settings.albedo_error.is_some() => {}
                Err(error) => panic!("{settings:?}: {error}"),
            }
        }
    }
    files
}

/// Corrects every wrong checksum in a damaged file. Each checksum covers one chunk of the file: the letter that names
/// it, the length and the payload.
fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
    let mut last = None;
    while let Err(DecodeError::Checksum { at, chunk }) = inspect(&bytes) {
        assert!(last < Some(at), "the checksum of the {chunk} is not made as it is here");
        last = Some(at);
        let mut r = crate::codec::Reader::new(&bytes[at..], at);
        let length = r.size(usize::MAX >> 1, "length").unwrap();
        let end = r.offset() + length;
        let mut hasher = blake3::Hasher::new();
        hasher.update(&[letter(chunk)]).update(&bytes[at..end]);
        bytes[end..end + 4].copy_from_slice(&hasher.finalize().as_bytes()[..4]);
    }
    bytes
}

/// Returns the letter that names a kind of chunk in the file. The chunk's checksum covers this letter and the payload.
fn letter(chunk: &str) -> u8 {
    match chunk {
        "header chunk" => b'H',
        "classes chunk" => b'C',
        "basis chunk" => b'B',
        "pyramid chunk" => b'P',
        "coefficients chunk" => b'Q',
        "light chunk" => b'L',
        "corrections chunk" => b'R',
        "exact chunk" => b'X',
        "metadata chunk" => b'M',
        other => panic!("the {other} is unknown here"),
    }
}

fn bits(tensor: &Tensor) -> Vec<u32> {
    tensor.samples().iter().map(|s| s.to_bits()).collect()
}

#[test]
fn damage_is_an_error_or_changes_no_sample() {
    let files = files();
    let kinds: BTreeSet<&str> = files.iter().map(|(kind, _)| kind.as_str()).collect();
    let needed = [
        "rd klt",
        "rd db2",
        "rd predicted",
        "rd predicted, folded",
        "rd predicted, isotropic model",
        "rd predicted, anisotropic model",
        "rd predicted, zonal model",
        "rd predicted, random access",
        "conventional bior4.4",
        "generic haar",
        "adaptive identity",
        "lossless none",
    ];
    assert!(needed.iter().all(|kind| kinds.contains(kind)), "some kind is not among the files: {kinds:?}");
    for (kind, bytes) in one_in(3, 0, files) {
        let samples = |bytes: &[u8]| {
            let whole = decode(bytes).map(|decoded| bits(&decoded.measurement.tensor));
            let slice = decode_block(bytes, 0).map(|slice| bits(&slice.tensor));
            let level = |level| decode_level(bytes, level).map(|decoded| bits(&decoded.measurement.tensor)).ok();
            [whole.ok(), slice.ok()].into_iter().chain((0..3).map(level)).collect::<Vec<_>>()
        };
        let undamaged = samples(&bytes);
        assert!(undamaged[0].is_some(), "{kind}");
        let harmless = |damaged: &[u8], what: &str, at: usize| {
            let found = samples(damaged);
            let inspected = inspect(damaged);
            assert_eq!(found[0].is_some(), inspected.is_ok(), "{kind}, {what} {at}");
            for (found, expected) in found.iter().zip(&undamaged) {
                assert!(found.is_none() || found == expected, "{kind}, {what} {at}: other samples");
            }
        };
        for at in 0..bytes.len() {
            harmless(&bytes[..at], "cut at", at);
            for (i, flip) in FLIPS.into_iter().enumerate() {
                let mut flipped = bytes.clone();
                flipped[at] ^= flip;
                harmless(&flipped, "flip of byte", at);
                // Flips one of them with corrected checksums, and periodically decodes by all three entry points.
                match at % (5 * FLIPS.len()) {
                    some if some == i => drop(samples(&sealed(flipped))),
                    some if some % FLIPS.len() == i => drop(decode(&sealed(flipped))),
                    _ => {}
                }
            }
        }
    }
}
