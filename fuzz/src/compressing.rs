//! Compression of arbitrary float32 samples to arbitrary targets.

use wavelume_core::compress::{self, CompressError, Policy, Settings, Target};
use wavelume_core::domain::{
    Axis, Domain, ErrorReport, Measurement, Quantity, Sampling, Silent, Tensor, TriangleMesh, WavelengthGrid,
};

/// Bytes in front of the samples: shape, target, policy and basis, floor, and eight of the target's number.
const OPENING: usize = 12;

/// Compresses the samples after the opening. Checks that a file decodes to samples with the errors of its report,
/// within the target, and that a refusal has a message.
pub fn compress(bytes: &[u8]) {
    let Some((opening, samples)) = bytes.split_first_chunk::<OPENING>() else { return };
    let samples = samples.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let Some(measurement) = measurement(opening[0], samples.collect()) else { return };
    let number = f64::from_le_bytes(opening[4..].try_into().expect("eight bytes"));
    let settings = Settings {
        target: target(opening[1], number),
        policy: [Policy::Rd, Policy::Conventional, Policy::Generic, Policy::Adaptive][usize::from(opening[2] & 3)],
        basis: ["bior4.4", "klt", "haar", "auto"][usize::from(opening[2] >> 2 & 3)].to_owned(),
        floor: (opening[3] > 0).then(|| f64::from(opening[3]) / 256.0),
        ..Settings::default()
    };
    match compress::compress(&measurement, &settings, &Silent) {
        Ok(compressed) => {
            let decoded = compress::decode(&compressed.bytes).expect("what is written decodes");
            let (before, after) = (measurement.tensor.samples(), decoded.measurement.tensor.samples());
            let errors = ErrorReport::measure(before, after, compressed.summary.floor);
            assert_eq!(errors, compressed.summary.errors);
            if let Target::Bytes(most) = settings.target {
                assert!(compressed.bytes.len() as u64 <= most);
            }
        }
        Err(CompressError::Cancelled(_)) => unreachable!("nobody stops it"),
        Err(error) => assert!(error.to_string().len() > 20, "{error}"),
    }
}

fn measurement(shape: u8, mut samples: Vec<f32>) -> Option<Measurement> {
    let mesh = |domain, level| TriangleMesh::new(domain, level).map(Axis::Triangles);
    let (quantity, outer) = match shape & 3 {
        0 => (Quantity::Spectrum, Vec::new()),
        1 => (Quantity::Edf, vec![mesh(Domain::Sphere, 1)?]),
        2 => (Quantity::Reflectance, vec![Axis::Index { count: 3, labels: Vec::new() }]),
        _ => (Quantity::Brdf, vec![mesh(Domain::Hemisphere, 0)?, mesh(Domain::Hemisphere, 1)?]),
    };
    let rows: usize = outer.iter().map(Axis::len).product();
    let count = (usize::from(shape >> 2) % 24 + 1).max(2);
    samples.resize(rows * count, 1.0);
    let wavelengths = Axis::Wavelength(WavelengthGrid::even(400.0, 10.0, count).ok()?);
    let tensor = Tensor::new(outer.into_iter().chain([wavelengths]).collect(), samples).ok()?;
    Measurement::new(quantity, quantity.default_unit(), Sampling::Point, tensor).ok()
}

fn target(kind: u8, number: f64) -> Target {
    match kind % 9 {
        0 => Target::ErL2(number),
        1 => Target::ErL1(number),
        2 => Target::MaxRelativeError(number),
        3 => Target::MaxAbsoluteError(number),
        4 => Target::RelativeRmse(number),
        5 => Target::Ratio(number),
        6 => Target::Bytes(number as u64),
        7 => Target::Step(number),
        _ => Target::Lossless,
    }
}
