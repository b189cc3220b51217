//! Random measurements on grids of angles keep all guarantees: errors, classes, slices, levels, and evaluation at the
//! stated angles.
//!
//! The environment variable `WAVELUME_GRIDS` sets the number of cases (default 300), `WAVELUME_GRIDS_FROM` the first
//! seed. A case is identified and determined by its seed.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test's helper fails by panicking, like the test")]

use wavelume_core::compress::{
    CompressError, Policy, Settings, Target, compress, decode, decode_block, decode_level, levels,
};
use wavelume_core::domain::{
    Axis, AzimuthExtent, Azimuths, Direction, DirectionGrid, Frame, Measurement, Quantity, Sampling, Silent, Tensor,
    WavelengthGrid,
};
use wavelume_core::evaluate::{Interpolation, Material, Place, state_levels, straight_lines_for_flux};

/// Deterministic pseudorandom sequence (Steele, Lea & Flood 2014, `SplitMix`).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// Returns an integer below `n`.
    fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }

    /// Returns a number in 0..1.
    fn share(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Returns true with probability `share`.
    fn chance(&mut self, share: f64) -> bool {
        self.share() < share
    }

    fn one_of<T: Copy>(&mut self, all: &[T]) -> T {
        all[self.below(all.len())]
    }

    /// Returns up to `most` increasing angles in a range, even or uneven, sometimes including its ends.
    fn angles(&mut self, (low, high): (f64, f64), most: usize) -> Vec<f64> {
        let count = 1 + self.below(most);
        let mut angles: Vec<f64> = if self.chance(0.5) {
            (0..count).map(|i| low + (high - low) * i as f64 / count as f64).collect()
        } else {
            (0..count).map(|_| low + (high - low) * self.share()).collect()
        };
        if self.chance(0.5) {
            angles.push(low);
        }
        if self.chance(0.5) {
            angles.push(high);
        }
        // Neighbours are at least a thousandth of a degree apart.
        for angle in &mut angles {
            *angle = (*angle * 1000.0).round() / 1000.0;
        }
        angles.sort_by(f64::total_cmp);
        angles.dedup();
        angles
    }

    fn azimuths(&mut self, most: usize) -> Option<Azimuths> {
        let extent = self.one_of(AzimuthExtent::ALL);
        let angles = match extent {
            AzimuthExtent::Circle => self.angles((-90.0, 269.0), most),
            AzimuthExtent::Sector => self.angles((-40.0, 110.0), most),
            AzimuthExtent::Mirrored => self.angles((0.0, 180.0), most),
            AzimuthExtent::MirroredAt90 => self.angles((90.0, 270.0), most),
            AzimuthExtent::Quadrant => self.angles((0.0, 90.0), most),
            AzimuthExtent::Closed => {
                let inner = self.angles((1.0, 359.0), most);
                [0.0].into_iter().chain(inner).chain([360.0]).collect()
            }
        };
        self.chance(0.85).then_some(Azimuths { angles, extent })
    }

    fn grid(&mut self, is_upper: bool, most: [usize; 2]) -> DirectionGrid {
        let frame = if is_upper { Frame::Surface } else { self.one_of(Frame::ALL) };
        let (low, high) = if is_upper { (0.0, 90.0) } else { frame.polar_range() };
        let is_mirrored = low < 0.0 && self.chance(0.3);
        let polar = self.angles((if is_mirrored { 0.0 } else { low }, high), most[0]);
        let (first, last) = (polar[0], polar[polar.len() - 1]);
        let grid = DirectionGrid::new(frame, polar, self.azimuths(most[1])).unwrap();
        let grid = if is_mirrored { grid.mirrored().unwrap() } else { grid };
        if self.chance(0.5) {
            grid.covering(0.5 * (first + low.max(if is_mirrored { 0.0 } else { low })), last).unwrap()
        } else {
            grid
        }
    }

    /// Returns smooth values with noise, including negative, zero and masked ones and repeated slices.
    fn samples(&mut self, shape: &[usize], azimuths: usize) -> Vec<f32> {
        let scale = libm::exp((self.share() - 0.5) * 2.0 * 68.0);
        let (waves, noise) = (3.0 * self.share(), self.one_of(&[0.0, 0.0, 0.01, 0.3]));
        let [negative, zero, masked] =
            [0.1, 0.1, 0.1].map(|most| if self.chance(0.4) { most * self.share() } else { 0.0 });
        let count: usize = shape.iter().product();
        let mut samples = Vec::with_capacity(count);
        let repeats = self.chance(0.3);
        let behind = shape.last().copied().filter(|_| shape.len() > 1).unwrap_or(1);
        for flat in 0..count {
            let mut rest = flat;
            let mut log = 0.0;
            for (axis, n) in shape.iter().enumerate().rev() {
                log += waves * libm::sin((rest % n) as f64 * 2.0 / *n as f64 + axis as f64);
                rest /= n;
            }
            let value = scale * libm::exp(log) * (1.0 + noise * (self.share() - 0.5));
            let value = value.clamp(1e-30, 1e30);
            let class = self.share();
            samples.push(if class < negative {
                -0.1 * value
            } else if class < negative + zero {
                0.0
            } else if class < negative + zero + masked {
                f64::NAN
            } else {
                value
            } as f32);
            // Repeats the values of the previous azimuth.
            if repeats && flat / behind % azimuths > 0 && flat / behind % azimuths % 3 == 1 {
                samples[flat] = samples[flat - behind];
            }
        }
        samples
    }

    fn measurement(&mut self) -> Measurement {
        let last = match self.below(4) {
            0 | 1 => None,
            2 => Some(Axis::Rgb),
            _ => Some(Axis::Wavelength(WavelengthGrid::even(400.0, 10.0, 2 + self.below(6)).unwrap())),
        };
        let (quantity, incoming) = match self.below(3) {
            0 => (Quantity::Edf, None),
            1 => (Quantity::Brdf, Some(Axis::Elevation(self.angles((0.0, 90.0), 5)))),
            _ => (Quantity::Brdf, Some(Axis::Grid(self.grid(true, [3, 4])))),
        };
        let most = if incoming.is_some() { [6, 6] } else { [16, 16] };
        let outgoing = self.grid(incoming.is_some(), most);
        let azimuths = outgoing.shape()[1];
        let axes: Vec<Axis> = incoming.into_iter().chain([Axis::Grid(outgoing)]).chain(last).collect();
        let shape: Vec<usize> = axes.iter().map(Axis::len).collect();
        let samples = self.samples(&shape, azimuths);
        let tensor = Tensor::new(axes, samples).unwrap();
        Measurement::new(quantity, quantity.default_unit(), Sampling::Point, tensor).unwrap()
    }

    /// Returns a small BRDF of many bands, noisy and with negative, zero and masked values.
    fn spectral(&mut self) -> Measurement {
        let incoming = Axis::Elevation(self.angles((0.0, 90.0), 4));
        let outgoing = self.grid(true, [6, 6]);
        let azimuths = outgoing.shape()[1];
        let bands = WavelengthGrid::even(400.0, 10.0, 30 + self.below(190)).unwrap();
        let axes = vec![incoming, Axis::Grid(outgoing), Axis::Wavelength(bands)];
        let shape: Vec<usize> = axes.iter().map(Axis::len).collect();
        let samples = self.samples(&shape, azimuths);
        let tensor = Tensor::new(axes, samples).unwrap();
        Measurement::new(Quantity::Brdf, Quantity::Brdf.default_unit(), Sampling::Point, tensor).unwrap()
    }

    fn settings(&mut self, measurement: &Measurement) -> Settings {
        let has_incoming = matches!(measurement.quantity, Quantity::Brdf);
        let is_lossless = self.chance(0.12);
        let error = 0.001 * libm::pow(200.0, self.share());
        let target = if is_lossless { Target::Lossless } else { Target::ErL2(error) };
        Settings {
            target,
            policy: if is_lossless { Policy::Lossless } else { Policy::Rd },
            floor: self.chance(0.15).then(|| 0.5 * self.share() + 1e-6),
            albedo_error: (!is_lossless && self.chance(0.15)).then_some(0.01),
            random_access: !is_lossless && has_incoming && self.chance(0.3),
            straight_lines: self.one_of(&[0, 0, straight_lines_for_flux(measurement).unwrap(), 1, 100, 255]),
            ..Settings::default()
        }
    }
}

fn bits(samples: &[f32]) -> Vec<u32> {
    samples.iter().map(|&s| if s.is_nan() { f32::NAN } else { s }.to_bits()).collect()
}

/// Returns the directions of all entries of an axis, each with the number of the first entry of the same direction:
/// poles and both ends of a closed circle are stated several times.
fn directions(axis: &Axis) -> Vec<(Option<Direction>, usize)> {
    match axis {
        Axis::Elevation(angles) => {
            let own = |(entry, &angle): (usize, &f64)| (Some(Direction::from_degrees(angle, 0.0)), entry);
            angles.iter().enumerate().map(own).collect()
        }
        Axis::Grid(grid) => {
            let [_, width] = grid.shape();
            let (low, high) = grid.frame().polar_range();
            let closed = grid.azimuths().is_some_and(|azimuths| azimuths.extent == AzimuthExtent::Closed);
            let first = |entry: usize| {
                let polar = grid.polar()[entry / width];
                let is_pole = polar == low || polar == high;
                let is_end = closed && entry % width == width - 1;
                if is_pole || is_end { entry / width * width } else { entry }
            };
            (0..grid.len()).map(|entry| (Some(grid.direction(entry)), first(entry))).collect()
        }
        _ => vec![(None, 0)],
    }
}

/// Sums over the values stated for one direction.
#[derive(Clone, Copy, Default)]
struct Values {
    count: f64,
    stated: f64,
    size: f64,
    decoded: f64,
}

/// Checks that decoded samples keep all guarantees of the settings.
fn check_samples(measurement: &Measurement, settings: &Settings, floor: f64, found: &[f32]) {
    let samples = measurement.tensor.samples();
    if settings.policy == Policy::Lossless {
        assert_eq!(bits(found), bits(samples));
        return;
    }
    let largest = samples.iter().fold(0.0_f32, |largest, &s| largest.max(-s));
    let (mut sum, mut count) = (0.0, 0.0);
    for (&s, &d) in samples.iter().zip(found) {
        assert_eq!(s.is_nan(), d.is_nan());
        let (wanted, decoded) = (f64::from(s), f64::from(d));
        if s > 0.0 && wanted >= floor {
            sum += (decoded / wanted - 1.0) * (decoded / wanted - 1.0);
            count += 1.0;
        } else if s == 0.0 {
            assert_eq!(d, 0.0, "a zero is not 0");
        } else if floor > 0.0 && wanted.abs() < floor {
            assert!((decoded - wanted).abs() <= floor * (1.0 + 1e-6), "{s} below the floor {floor}: {d}");
        } else if s < 0.0 {
            assert!(d <= 0.0 && (s - d).abs() <= largest, "a negative sample {s}: {d}");
        }
    }
    if let Target::ErL2(error) = settings.target
        && count > 0.0
    {
        let er_l2 = f64::sqrt(sum / count);
        assert!(er_l2 <= error * (1.0 + 1e-9), "er(L2) {er_l2}, promised {error}");
    }
}

/// Checks that the function at stated angles equals the sample, or the mean of those stated for one direction, and that
/// it keeps the error against the stated mean.
fn check_function(file: &[u8], measurement: &Measurement, settings: &Settings, floor: f64, found: &[f32]) {
    let material = Material::open(file).unwrap();
    let axes = measurement.tensor.axes();
    let at = axes.iter().rposition(|axis| matches!(axis, Axis::Grid(_))).unwrap();
    let wis = if at > 0 { directions(&axes[0]) } else { vec![(None, 0)] };
    let mut wos = directions(&axes[at]);
    if let Axis::Grid(grid) = &axes[at]
        && (at, grid.frame(), grid.azimuths()) == (1, Frame::Surface, None)
    {
        // Polar angles alone lie on the mirror's side of the plane of incidence.
        for (wo, _) in &mut wos {
            *wo = wo.map(|wo| Direction::from_degrees(wo.theta_degrees(), 180.0));
        }
    }
    let mut spectrum = vec![0.0; material.lambdas()];
    let largest = found.iter().fold(0.0_f32, |largest, s| largest.max(s.abs()));
    let is_linear = found.iter().any(|&s| s < 0.0);
    let pairs: Vec<_> = wis.iter().flat_map(|wi| wos.iter().map(move |wo| (*wi, *wo))).collect();
    let first_of = |pair: usize| (pairs[pair].0.1 * wos.len() + pairs[pair].1.1) * spectrum.len();
    let mut values = vec![Values::default(); found.len()];
    for (flat, (&s, &d)) in measurement.tensor.samples().iter().zip(found).enumerate() {
        let value = &mut values[first_of(flat / spectrum.len()) + flat % spectrum.len()];
        if !s.is_nan() {
            let (s, d) = (f64::from(s), f64::from(d));
            let Values { count, stated, size, decoded } = *value;
            *value = Values { count: count + 1.0, stated: stated + s, size: size + s.abs(), decoded: decoded + d };
        }
    }
    let starts: Vec<usize> = (0..pairs.len()).map(first_of).collect();
    let (mut sum, mut count) = (0.0, 0.0);
    let stated = measurement.tensor.samples().chunks_exact(spectrum.len());
    for ((&((wi, _), (wo, _)), &start), stated) in pairs.iter().zip(&starts).zip(stated) {
        material.evaluate(Place { index: &[], wi, wo }, Interpolation::Smooth, &mut spectrum).unwrap();
        for ((&value, &own), of) in spectrum.iter().zip(stated).zip(&values[start..]) {
            let wanted = (of.decoded / of.count) as f32;
            // Rounding of angles mixes in a small part of a neighbour, which matters where values are not logarithms.
            let rounding = if is_linear { 2e-6 * largest } else { 0.0 };
            let is_near = (value - wanted).abs() <= 1e-5 * wanted.abs() + rounding;
            assert!(
                is_near || value.is_nan() && of.count == 0.0,
                "evaluated {value}, decoded {wanted} at {wi:?} {wo:?}"
            );
            // Values of both signs may cancel.
            let mean = of.stated / of.count;
            if !own.is_nan() && mean > 0.0 && mean >= floor && of.stated >= 0.5 * of.size {
                sum += (of.decoded / of.stated - 1.0).powi(2);
                count += 1.0;
            }
        }
    }
    if let Target::ErL2(error) = settings.target
        && count > 0.0
    {
        let er_l2 = f64::sqrt(sum / count);
        assert!(er_l2 <= error * (1.0 + 1e-9), "er(L2) of means {er_l2}, promised {error}");
    }
}

/// Checks that slices and levels agree with the whole.
fn check_parts(file: &[u8], measurement: &Measurement, found: &[f32]) {
    let at = measurement.tensor.axes().iter().rposition(|axis| matches!(axis, Axis::Grid(_))).unwrap();
    let blocks: usize = measurement.tensor.axes()[..at].iter().map(Axis::len).product();
    for (block, own) in found.chunks_exact(found.len() / blocks).enumerate() {
        assert_eq!(bits(decode_block(file, block).unwrap().tensor.samples()), bits(own));
    }
    let stated = state_levels(file.to_vec(), measurement).unwrap();
    for info in levels(&stated).unwrap() {
        let coarse = decode_level(&stated[..info.bytes as usize], info.level).unwrap();
        let whole = decode_level(&stated, info.level).unwrap();
        assert_eq!(bits(coarse.measurement.tensor.samples()), bits(whole.measurement.tensor.samples()));
        assert!(info.er_l2.is_finite());
    }
}

/// Seeds of grids that broke a promise once: a negative sample was further off than the largest one under a floor.
const ONCE_BROKEN: [u64; 1] = [6384];

#[test]
fn random_grids_keep_every_promise() {
    let number = |name: &str, usual: u64| std::env::var(name).map_or(usual, |text| text.parse().unwrap());
    let (count, first) = (number("WAVELUME_GRIDS", 300), number("WAVELUME_GRIDS_FROM", 0));
    let mut refused = 0;
    for seed in (first..first + count).chain(ONCE_BROKEN) {
        let mut random = Random(seed.wrapping_mul(0x2545_F491_4F6C_DD1D));
        let measurement = random.measurement();
        let settings = random.settings(&measurement);
        let case = std::panic::catch_unwind(|| {
            let compressed = match compress(&measurement, &settings, &Silent) {
                Ok(compressed) => compressed,
                // Random access needs several incoming entries, and a target size may be unreachable.
                Err(CompressError::Setting(_) | CompressError::Unreachable(_)) => return false,
                Err(error) => panic!("{error}"),
            };
            let decoded = decode(&compressed.bytes).unwrap();
            let found = decoded.measurement.tensor.samples();
            check_samples(&measurement, &settings, decoded.summary.floor, found);
            check_function(&compressed.bytes, &measurement, &settings, decoded.summary.floor, found);
            check_parts(&compressed.bytes, &measurement, found);
            true
        });
        let Ok(is_made) = case else { panic!("seed {seed}: {:?}, {settings:?}", measurement.tensor.axes()) };
        refused += u64::from(!is_made);
    }
    assert!(refused * 10 <= count.max(10), "{refused} of {count} were refused");
}

#[test]
fn random_spectra_on_grids_are_never_refused() {
    let count = std::env::var("WAVELUME_GRIDS").map_or(20, |text| text.parse().unwrap_or(20_u64)) / 5;
    for seed in 0..count.max(12) {
        let mut random = Random(seed.wrapping_mul(0x2545_F491_4F6C_DD1D) ^ 0x5EED);
        let measurement = random.spectral();
        let error = 0.001 * libm::pow(200.0, random.share());
        let settings = Settings { target: Target::ErL2(error), ..Settings::default() };
        let axes = measurement.tensor.axes();
        let compressed = compress(&measurement, &settings, &Silent)
            .unwrap_or_else(|refusal| panic!("seed {seed}, er(L2) {error}: {axes:?}: {refusal}"));
        let decoded = decode(&compressed.bytes).unwrap();
        check_samples(&measurement, &settings, decoded.summary.floor, decoded.measurement.tensor.samples());
    }
}

#[test]
fn the_smallest_numbers_are_evaluated_as_they_are_decoded() {
    let mut random = Random(29);
    let azimuths = Azimuths { angles: vec![0.0, 60.0, 120.0, 180.0], extent: AzimuthExtent::Mirrored };
    let grid = DirectionGrid::new(Frame::Surface, vec![10.0, 30.0, 50.0, 70.0], Some(azimuths)).unwrap();
    for last in [None, Some(Axis::Rgb), Some(Axis::Wavelength(WavelengthGrid::even(400.0, 10.0, 31).unwrap()))] {
        let axes: Vec<Axis> =
            [Axis::Elevation(vec![0.0, 40.0]), Axis::Grid(grid.clone())].into_iter().chain(last).collect();
        let count: usize = axes.iter().map(Axis::len).product();
        // From 1e-36 down to denormal numbers of ten bits.
        let samples = (0..count).map(|_| libm::pow(10.0, -36.0 - 6.0 * random.share()) as f32).collect();
        let tensor = Tensor::new(axes.clone(), samples).unwrap();
        let measurement =
            Measurement::new(Quantity::Brdf, Quantity::Brdf.default_unit(), Sampling::Point, tensor).unwrap();
        for target in [Target::Lossless, Target::ErL2(0.01)] {
            let file = compress(&measurement, &Settings { target, ..Settings::default() }, &Silent).unwrap();
            let decoded = decode(&file.bytes).unwrap();
            let material = Material::open(&file.bytes).unwrap();
            let mut found = Vec::new();
            let mut spectrum = vec![0.0; material.lambdas()];
            let [wis, wos] = [directions(&axes[0]), directions(&axes[1])];
            for ((wi, _), (wo, _)) in wis.iter().flat_map(|wi| wos.iter().map(move |wo| (*wi, *wo))) {
                let place = Place { index: &[], wi, wo };
                material.evaluate(place, Interpolation::Smooth, &mut spectrum).unwrap();
                found.extend_from_slice(&spectrum);
            }
            for (&found, &decoded) in found.iter().zip(decoded.measurement.tensor.samples()) {
                let most = 1e-5 * decoded + 2.0 * f32::from_bits(1);
                assert!((found - decoded).abs() <= most, "{target:?} evaluated {found:e}, decoded {decoded:e}");
            }
        }
    }
}
