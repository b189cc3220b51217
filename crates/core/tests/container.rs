//! The container format is frozen: golden files decode to identical bits, and measurements compress to identical bytes.
//!
//! `tests/container/golden/NAME.wlm` is the compressed measurement NAME below. `NAME.f32` are its decoded samples,
//! `NAME.level0.f32` those of its coarsest level, and `NAME.lobe.f32` the lobe beside its cells at the centroids of the
//! cells. Samples are little-endian and row-major, NaN if masked.
//!
//! If the environment variable `WAVELUME_REMAKE_GOLDEN` is set, the files are written instead of compared. Any change
//! of a file is a change of the format.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test's helper fails by panicking, like the test")]

use std::fs;
use std::path::PathBuf;
use wavelume_core::compress::{
    Between, Divisor, Numbers, Policy, Settings, Target, compress_numbers, decode, decode_block, decode_level,
    decode_numbers, levels,
};
use wavelume_core::domain::{
    Axis, AzimuthExtent, Azimuths, Direction, DirectionGrid, Domain, Frame, Lobe, LobeCentre, LobeParameters,
    Measurement, Outside, Quantity, Sampling, Silent, Tensor, TriangleMesh, Unit, WavelengthGrid,
};
use wavelume_core::evaluate::state_levels;

type Vector = [f64; 3];

/// Golden file: a measurement and its settings.
struct Golden {
    name: &'static str,
    measurement: Measurement,
    settings: Settings,
    /// Ratio of the samples to the numbers stored in the file.
    factor: f64,
}

fn mesh(domain: Domain, level: u8) -> Axis {
    Axis::Triangles(TriangleMesh::new(domain, level).unwrap())
}

fn wavelengths(count: usize) -> Axis {
    Axis::Wavelength(WavelengthGrid::even(400.0, 40.0, count).unwrap())
}

fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Returns a pseudorandom number in −1 … 1, identical on every machine.
fn noise(i: usize) -> f64 {
    let mixed = (i as u32).wrapping_add(1).wrapping_mul(2_654_435_761);
    let mixed = (mixed ^ mixed >> 15).wrapping_mul(2_246_822_519);
    f64::from(mixed ^ mixed >> 13) / f64::from(u32::MAX) * 2.0 - 1.0
}

/// Returns the samples `value(flat index, entry of each axis)`, which use additions, multiplications, divisions and
/// square roots only.
fn tensor(axes: Vec<Axis>, value: impl Fn(usize, &[usize]) -> f64) -> Tensor {
    let shape: Vec<usize> = axes.iter().map(Axis::len).collect();
    let count = shape.iter().product();
    let samples = (0..count).map(|flat| {
        let mut rest = flat;
        let mut at = vec![0; shape.len()];
        for (place, n) in at.iter_mut().zip(&shape).rev() {
            *place = rest % n;
            rest /= n;
        }
        value(flat, &at) as f32
    });
    let samples = samples.collect();
    Tensor::new(axes, samples).unwrap()
}

fn direction(axis: &Axis, i: usize) -> Vector {
    match axis {
        Axis::Triangles(mesh) => mesh.centroid(i).xyz(),
        Axis::Grid(grid) => grid.direction(i).xyz(),
        Axis::Elevation(degrees) => Direction::from_degrees(degrees[i], 0.0).xyz(),
        _ => panic!("no directions"),
    }
}

/// Returns the half vector of two directions of a hemisphere.
fn half(a: Vector, b: Vector) -> Vector {
    let sum = [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
    let length = dot(sum, sum).sqrt();
    sum.map(|x| x / length)
}

/// Returns a gloss lobe on a coloured ground, stretched by `stretch` along x.
fn gloss(axes: &[Axis], at: &[usize], stretch: f64) -> f64 {
    let (wi, wo) = (direction(&axes[0], at[0]), direction(&axes[1], at[1]));
    let h = half(wi, wo);
    let slope = (stretch * h[0] * h[0] + h[1] * h[1]) / (h[2] * h[2]);
    let colour = at.get(2).map_or(1.0, |&k| 0.2 + 0.1 * k as f64 + 0.02 * (k * k) as f64);
    0.3 * colour + 2.0 / ((1.0 + 6.0 * slope) * (1.0 + 6.0 * slope)) * (1.0 + 0.5 * (1.0 - dot(wi, h)))
}

/// Returns a narrow lobe about the mirror direction with the given steepness along x and y.
fn narrow(axes: &[Axis], at: &[usize], [along_x, along_y]: [f64; 2]) -> f64 {
    let h = half(direction(&axes[0], at[0]), direction(&axes[1], at[1]));
    let slope = (along_x * h[0] * h[0] + along_y * h[1] * h[1]) / (h[2] * h[2]);
    let colour = at.get(2).map_or(1.0, |&k| 0.5 + 0.2 * k as f64);
    0.3 * colour + 4.0 / ((1.0 + slope) * (1.0 + slope))
}

/// Returns a coloured ground under microfacets of the given roughness.
fn polished(axes: &[Axis], at: &[usize], roughness: f64) -> f64 {
    let (wi, wo) = (direction(&axes[0], at[0]), direction(&axes[1], at[1]));
    let (h, square) = (half(wi, wo), roughness * roughness);
    let root = |c: f64| (c * c + square * (1.0 - c * c)).sqrt();
    let masking = wo[2] * root(wi[2]) + wi[2] * root(wo[2]);
    let spread = h[0] * h[0] + h[1] * h[1] + square * h[2] * h[2];
    let fresnel = 0.04 + 0.96 * (1.0 - dot(wi, h)).powi(5);
    let colour = at.get(2).map_or(1.0, |&k| 0.5 + 0.2 * k as f64);
    0.25 * colour + fresnel * square / (spread * spread * masking)
}

fn golden(name: &'static str, quantity: Quantity, tensor: Tensor, target: Target) -> Golden {
    let measurement = Measurement::new(quantity, quantity.default_unit(), Sampling::Average, tensor).unwrap();
    let basis = "auto".to_owned();
    let settings = Settings {
        target,
        policy: Policy::Rd,
        basis,
        floor: None,
        albedo_error: None,
        straight_lines: 0,
        between: Between::default(),
        lobe: None,
        metadata: None,
        random_access: false,
    };
    Golden { name, measurement, settings, factor: 1.0 }
}

fn brdf_axes(count: usize) -> Vec<Axis> {
    vec![mesh(Domain::Hemisphere, 1), mesh(Domain::Hemisphere, 2), wavelengths(count)]
}

fn all() -> Vec<Golden> {
    vec![
        luminaire(),
        isotropic(),
        anisotropic(),
        zonal(),
        elevations(),
        hurt(),
        fixed(),
        patches(),
        spectrometer(),
        irregular(),
        channels(),
        octant(),
        random(),
        linear(),
        signed(),
        lossless(),
        stated(),
        multiplied(),
        lamp(),
        paint(),
        dark(),
        border(),
        leaf(),
        spot(),
        varnish(),
        brushed(),
        lacquer(),
        enamel(),
        glaze(),
        ground("chalk", Divisor::Cosines),
        ground("felt", Divisor::ProjectedAreas { roughness: 0.5 }),
        ground("slate", Divisor::Masking { roughness: 0.125 }),
        nacre(),
        silk(),
        reflector(),
        conventional(),
    ]
}

/// Prediction, spectral basis computed from the data, symmetries: the file that `docs/container.md` explains byte by
/// byte.
fn luminaire() -> Golden {
    let axes = vec![mesh(Domain::Lower, 1), wavelengths(4)];
    let data = tensor(axes.clone(), |i, at| {
        let down = -direction(&axes[0], at[0])[2];
        let spectrum = [0.5, 1.0, 0.8, 0.3][at[1]];
        (100.0 * down * down + 5.0) * (spectrum + 0.1 * down) * (1.0 + 0.002 * noise(i))
    });
    let mut golden = golden("luminaire", Quantity::Edf, data, Target::ErL2(0.02));
    golden.measurement.unit = Unit::WattPerSteradianNanometre;
    "klt".clone_into(&mut golden.settings.basis);
    golden.settings.metadata = Some(r#"{"name":"downlight"}"#.to_owned());
    golden
}

fn isotropic() -> Golden {
    let axes = brdf_axes(9);
    let data = tensor(axes.clone(), |i, at| gloss(&axes, at, 1.0) * (1.0 + 0.004 * noise(i)));
    golden("isotropic", Quantity::Brdf, data, Target::ErL2(0.01))
}

fn anisotropic() -> Golden {
    let axes = vec![mesh(Domain::Hemisphere, 2), mesh(Domain::Hemisphere, 2), wavelengths(2)];
    let data = tensor(axes.clone(), |i, at| gloss(&axes, at, 0.15) * (1.0 + 0.004 * noise(i)));
    golden("anisotropic", Quantity::Brdf, data, Target::ErL2(0.02))
}

/// No spectral axis.
fn zonal() -> Golden {
    let axes = vec![mesh(Domain::Sphere, 1), mesh(Domain::Sphere, 2)];
    let data = tensor(axes.clone(), |i, at| {
        let cosine = dot(direction(&axes[0], at[0]), direction(&axes[1], at[1]));
        0.05 / ((1.3 - cosine) * (1.3 - cosine)) * (1.0 + 0.002 * noise(i))
    });
    golden("zonal", Quantity::Phase, data, Target::ErL2(0.02))
}

/// Incoming elevations and colours.
fn elevations() -> Golden {
    let degrees = vec![0.0, 10.0, 25.0, 40.0, 55.5, 70.0, 90.0];
    let axes = vec![Axis::Elevation(degrees), mesh(Domain::Hemisphere, 2), Axis::Rgb];
    let data = tensor(axes.clone(), |i, at| {
        let wo = direction(&axes[1], at[1]);
        let away = wo[0] + 0.15 * at[0] as f64;
        (0.1 * (1 + at[2]) as f64 + 0.5 / (0.3 + away * away + wo[1] * wo[1])) * (1.0 + 0.004 * noise(i))
    });
    let mut golden = golden("elevations", Quantity::Brdf, data, Target::ErL1(0.02));
    "klt".clone_into(&mut golden.settings.basis);
    golden
}

/// Negative, zero and masked samples, dead triangles, and a bound on every sample.
fn hurt() -> Golden {
    let axes = brdf_axes(3);
    let data = tensor(axes.clone(), |i, at| {
        let value = gloss(&axes, at, 1.0) * (1.0 + 0.05 * noise(i));
        match (at[1], i % 53) {
            (0..=15 | 18 | 20..=22 | 33 | 35, _) => f64::NAN,
            (_, 7) => -0.2 * value,
            (_, 11 | 12) => 0.0,
            _ => value,
        }
    });
    let mut golden = golden("hurt", Quantity::Brdf, data, Target::MaxRelativeError(0.05));
    "klt".clone_into(&mut golden.settings.basis);
    golden
}

/// Fixed bases on all axes, and a floor.
fn fixed() -> Golden {
    let axes = brdf_axes(9);
    let data = tensor(axes.clone(), |i, at| match at[1] {
        40..=44 => f64::NAN,
        _ if i % 53 == 30 => 1e-4 * (1.0 + noise(i)),
        _ => gloss(&axes, at, 0.5) * (1.0 + 0.02 * noise(i)),
    });
    let mut golden = golden("fixed", Quantity::Brdf, data, Target::ErL2(0.02));
    golden.settings.floor = Some(0.01);
    "bior4.4".clone_into(&mut golden.settings.basis);
    golden
}

/// The data's own spectral basis without triangles, wavelengths in a list, labels.
fn patches() -> Golden {
    let labels = vec!["white".to_owned(), "red".to_owned(), "green".to_owned(), "blue".to_owned()];
    let list = vec![400.5, 420.0, 441.5, 460.0, 500.0, 550.0, 600.5, 650.0, 700.0];
    let list = Axis::Wavelength(WavelengthGrid::listed(list).unwrap());
    let data = tensor(vec![Axis::Index { count: 4, labels }, list], |i, at| {
        let t = at[1] as f64 / 8.0;
        let peak = at[0] as f64 / 4.0;
        (0.1 + 0.6 / (1.0 + 8.0 * (t - peak) * (t - peak))) * (1.0 + 0.01 * noise(i))
    });
    let mut golden = golden("patches", Quantity::Reflectance, data, Target::ErL2(0.02));
    "klt".clone_into(&mut golden.settings.basis);
    golden.settings.metadata = Some("{}".to_owned());
    golden
}

/// Wavelengths on a polynomial, in fixed bases.
fn spectrometer() -> Golden {
    let list = (0..70).map(|i| {
        let i = f64::from(i);
        f64::from((350.123 + 5.251 * i - 0.0031 * i * i) as f32)
    });
    let axis = Axis::Wavelength(WavelengthGrid::listed(list.collect()).unwrap());
    let data = tensor(vec![axis], |i, at| (1.0 + 0.3 * at[0] as f64) * (1.0 + 0.01 * noise(i)));
    let mut golden = golden("spectrometer", Quantity::Spectrum, data, Target::ErL2(0.01));
    "bior4.4".clone_into(&mut golden.settings.basis);
    golden
}

/// Wavelengths without a short form, in a basis of its own choice.
fn irregular() -> Golden {
    let list = (0..11).map(|i| 380.0 + 30.0 * f64::from(i) + noise(i as usize + 900)).collect();
    let axis = Axis::Wavelength(WavelengthGrid::listed(list).unwrap());
    let data = tensor(vec![axis], |i, at| (0.2 + 0.05 * at[0] as f64) * (1.0 + 0.01 * noise(i)));
    let mut golden = golden("irregular", Quantity::Reflectance, data, Target::MaxAbsoluteError(0.01));
    "bior2.2".clone_into(&mut golden.settings.basis);
    golden
}

/// Colours, of single samples that are points.
fn channels() -> Golden {
    let axes = vec![Axis::Elevation(vec![0.0, 20.0, 40.0, 60.0]), mesh(Domain::Hemisphere, 1), Axis::Rgb];
    let data = tensor(axes.clone(), |i, at| {
        let wo = direction(&axes[1], at[1]);
        (0.1 * (1 + at[2]) as f64 + (1.0 + wo[0]) * (at[0] + 1) as f64) * (1.0 + 0.02 * noise(i))
    });
    let mut golden = golden("channels", Quantity::Brdf, data, Target::ErL2(0.02));
    golden.measurement.sampling = Sampling::Point;
    "haar".clone_into(&mut golden.settings.basis);
    golden
}

/// Light in only one octant of the sphere.
fn octant() -> Golden {
    let axes = vec![mesh(Domain::Sphere, 2), wavelengths(5)];
    let data = tensor(axes.clone(), |i, at| match at[0] / 16 {
        5 => (2.0 + direction(&axes[0], at[0])[0]) * (1.0 + 0.2 * at[1] as f64) * (1.0 + 0.01 * noise(i)),
        _ => 0.0,
    });
    let mut golden = golden("octant", Quantity::Edf, data, Target::ErL2(0.02));
    "bior4.4".clone_into(&mut golden.settings.basis);
    golden
}

/// Random access to every block, and a bound on the error of the light of each block.
fn random() -> Golden {
    let axes = brdf_axes(3);
    let data = tensor(axes.clone(), |i, at| match at[1] {
        40..=44 | 48 => f64::NAN,
        k => {
            let [x, y, _] = direction(&axes[1], k);
            gloss(&axes, at, 0.3) * (1.3 + 0.6 * x + 0.3 * y) * (1.0 + 0.02 * noise(i))
        }
    });
    let mut golden = golden("random", Quantity::Brdf, data, Target::ErL2(0.03));
    golden.settings.random_access = true;
    golden.settings.albedo_error = Some(0.003);
    golden
}

/// Type C grid in chunk G: a seam, a pole with one value, repeated planes, angles without light.
fn lamp() -> Golden {
    let azimuths = Azimuths { angles: (0..13).map(|i| 30.0 * f64::from(i)).collect(), extent: AzimuthExtent::Closed };
    let polar: Vec<f64> = (0..16).map(|i| 6.0 * f64::from(i)).collect();
    let axes = vec![Axis::Grid(DirectionGrid::new(Frame::TypeC, polar, Some(azimuths)).unwrap())];
    let data = tensor(axes, |_, at| {
        let (polar, azimuth) = (at[0] / 13, at[0] % 13 % 12);
        let down = 1.0 - polar as f64 / 16.0;
        let side = if polar == 0 { 0.5 } else { (azimuth as f64 - 5.5).abs() / 6.0 };
        if polar == 15 && azimuth > 6 {
            0.0
        } else {
            900.0 * down * down * (1.0 + 0.4 * side * side) * if azimuth == 4 { 1.0 } else { 1.1 }
        }
    });
    let mut golden = golden("lamp", Quantity::Edf, data, Target::ErL2(0.01));
    golden.settings.straight_lines = 26;
    golden
}

/// Grids on incoming elevations in chunk G, with a separate stream per incoming entry: masks, zeros, negative samples.
fn paint() -> Golden {
    let azimuths = Azimuths { angles: (0..9).map(|i| 22.5 * f64::from(i)).collect(), extent: AzimuthExtent::Mirrored };
    let grid =
        DirectionGrid::new(Frame::Surface, vec![0.0, 8.0, 15.0, 30.0, 31.0, 50.0, 75.0], Some(azimuths)).unwrap();
    let axes = vec![Axis::Elevation(vec![0.0, 20.0, 21.0, 60.0]), Axis::Grid(grid), Axis::Rgb];
    let data = tensor(axes, |i, at| {
        let (polar, azimuth) = (at[1] / 9, at[1] % 9);
        let incoming = at[0] - usize::from(at[0] == 2);
        let far = (polar as f64 - 2.0 * incoming as f64) * 0.4;
        let value = (0.02 + 1.0 / (1.0 + far * far + 0.1 * azimuth as f64)) * [0.2, 0.5, 1.0][at[2]];
        let other = noise(3 * (63 * incoming + at[1]) + at[2]);
        match i % 41 {
            _ if polar == 6 && azimuth == 3 => f64::NAN,
            _ if polar == 5 && azimuth > 5 && at[2] == 0 => 0.01 * other,
            _ => value * (1.0 + 0.01 * other),
        }
    });
    let mut golden = golden("paint", Quantity::Brdf, data, Target::ErL2(0.02));
    golden.settings.random_access = true;
    golden.settings.albedo_error = Some(0.001);
    golden
}

/// Grid in chunk G with a floor that negative samples exceed in magnitude: they weigh like positive ones, and need
/// corrections of the light.
fn dark() -> Golden {
    let azimuths = Azimuths { angles: (0..8).map(|i| 45.0 * f64::from(i)).collect(), extent: AzimuthExtent::Circle };
    let grid = DirectionGrid::new(Frame::Surface, vec![0.0, 10.0, 25.0, 45.0, 70.0], Some(azimuths)).unwrap();
    let data = tensor(vec![Axis::Elevation(vec![0.0, 30.0, 60.0]), Axis::Grid(grid)], |i, at| {
        let (polar, azimuth) = (at[1] / 8, at[1] % 8);
        let value = (0.1 + 1.0 / (1.0 + (polar as f64 - at[0] as f64).abs())) * (1.0 + 0.02 * noise(i));
        // Negative samples of a magnitude that the positive neighbours do not predict.
        if polar == 4 && azimuth > 3 { -[0.9, 0.2][azimuth % 2] } else { value }
    });
    let mut golden = golden("dark", Quantity::Brdf, data, Target::ErL2(0.02));
    golden.settings.floor = Some(0.1);
    golden.settings.albedo_error = Some(0.002);
    golden
}

/// Grid whose classes are in wide contexts: a border of zeros that moves with incidence and lane and is as uneven at
/// each incidence, with masks and negative samples beside it.
fn border() -> Golden {
    let azimuths = Azimuths { angles: (0..12).map(|i| 30.0 * f64::from(i)).collect(), extent: AzimuthExtent::Circle };
    let polar: Vec<f64> = (0..12).map(|i| 7.5 * f64::from(i)).collect();
    let grid = DirectionGrid::new(Frame::Surface, polar, Some(azimuths)).unwrap();
    let incoming = Axis::Elevation((0..6).map(|i| 12.0 * f64::from(i)).collect());
    let data = tensor(vec![incoming, Axis::Grid(grid), Axis::Rgb], |i, at| {
        let (polar, azimuth) = (at[1] / 12, at[1] % 12);
        let edge = 6.0 + 2.0 * noise(azimuth / 2 + 100 * (polar / 7)) + 0.3 * (at[0] + at[2]) as f64;
        match (polar as f64) - edge {
            beyond if beyond > 2.0 && noise(i / 3 % 144) > 0.9 => f64::NAN,
            beyond if beyond > 0.0 => 0.0,
            beyond if beyond > -1.0 && noise(at[1] + 500) > 0.5 => -0.1,
            _ => 1.0 / (1.0 + 0.1 * (polar * polar) as f64),
        }
    });
    golden("border", Quantity::Brdf, data, Target::ErL2(0.05))
}

/// Grid in chunk G with the spectral basis computed from the data and corrections: a circle with an odd number of
/// azimuths, latitudes.
fn leaf() -> Golden {
    let azimuths = Azimuths { angles: (0..7).map(|i| 50.0 * f64::from(i)).collect(), extent: AzimuthExtent::Circle };
    let polar: Vec<f64> = (0..9).map(|i| -90.0 + 22.5 * f64::from(i)).collect();
    let grid = DirectionGrid::new(Frame::TypeA, polar, Some(azimuths)).unwrap();
    let axes = vec![Axis::Grid(grid), wavelengths(12)];
    let data = tensor(axes, |i, at| {
        let (polar, azimuth) = ((at[0] / 7) as f64 - 4.0, (at[0] % 7) as f64 - 3.0);
        let shape = 1.0 / (1.0 + 0.2 * polar * polar + 0.1 * azimuth * azimuth);
        let spectrum = 0.1 + shape * (at[1] as f64 / 12.0) + 0.02 * (at[1] % 5) as f64;
        if i % 97 < 3 { f64::NAN } else { spectrum * (1.0 + 0.02 * noise(i)) }
    });
    let mut golden = golden("leaf", Quantity::Edf, data, Target::MaxRelativeError(0.05));
    "klt".clone_into(&mut golden.settings.basis);
    golden
}

/// Grid in chunk G with a coarser level: a closed circle, a pole with one value, repeated planes, zeros and masks.
fn spot() -> Golden {
    let azimuths = Azimuths { angles: (0..41).map(|i| 9.0 * f64::from(i)).collect(), extent: AzimuthExtent::Closed };
    let polar: Vec<f64> = (0..50).map(|i| 1.8 * f64::from(i)).collect();
    let axes = vec![Axis::Grid(DirectionGrid::new(Frame::TypeC, polar, Some(azimuths)).unwrap())];
    let data = tensor(axes, |_, at| {
        let (polar, azimuth) = (at[0] / 41, at[0] % 41 % 40);
        let azimuth = if polar == 0 { 0 } else { azimuth - usize::from(azimuth == 7) };
        match (polar, azimuth) {
            (49, 3..9) => 0.0,
            (40..44, 20..22) => f64::NAN,
            _ => 900.0 / (1.0 + 0.01 * (polar * polar) as f64) * (1.0 + 0.3 * noise(64 * polar + azimuth)),
        }
    });
    golden("spot", Quantity::Edf, data, Target::ErL2(0.01))
}

/// Returns the axes of a small isotropic measurement: six incidences, half a hemisphere of outgoing directions, four
/// wavelengths.
fn goniometer() -> Vec<Axis> {
    let azimuths = Azimuths { angles: (0..13).map(|i| 15.0 * f64::from(i)).collect(), extent: AzimuthExtent::Mirrored };
    let polar = (0..9).map(|i| 10.0 * f64::from(i)).collect();
    let grid = DirectionGrid::new(Frame::Surface, polar, Some(azimuths)).unwrap();
    vec![Axis::Elevation(vec![0.0, 15.0, 30.0, 45.0, 60.0, 75.0]), Axis::Grid(grid), wavelengths(4)]
}

/// Returns azimuths all the way round.
fn circle(step: f64, count: usize) -> Azimuths {
    let angles = (0..count).map(|i| step * i as f64).collect();
    Azimuths { angles, extent: AzimuthExtent::Circle }
}

/// Grid in chunk G with the isotropic model, the spectral basis computed from the data, and a coarser level.
fn varnish() -> Golden {
    let axes = goniometer();
    let data = tensor(axes.clone(), |i, at| match i % 301 {
        0 => f64::NAN,
        _ => narrow(&axes, at, [40.0, 40.0]) * (1.0 + 0.03 * noise(i)),
    });
    let mut golden = golden("varnish", Quantity::Brdf, data, Target::ErL2(0.005));
    "klt".clone_into(&mut golden.settings.basis);
    golden
}

/// Grids in chunk G with the anisotropic model, and a separate stream per incoming direction.
fn brushed() -> Golden {
    let incoming = DirectionGrid::new(Frame::Surface, vec![20.0, 40.0, 60.0], Some(circle(90.0, 4))).unwrap();
    let polar = (0..8).map(|i| 10.0 * f64::from(i)).collect();
    let outgoing = DirectionGrid::new(Frame::Surface, polar, Some(circle(15.0, 24))).unwrap();
    let axes = vec![Axis::Grid(incoming), Axis::Grid(outgoing)];
    let data = tensor(axes.clone(), |i, at| narrow(&axes, at, [10.0, 60.0]) * (1.0 + 0.002 * noise(i)));
    let mut golden = golden("brushed", Quantity::Brdf, data, Target::ErL2(0.005));
    golden.settings.random_access = true;
    golden
}

/// Interpolation between incidences: cubic through four of them, with a model divided out; coarser levels state it,
/// too.
fn lacquer() -> Golden {
    let degrees = vec![0.0, 15.0, 30.0, 45.0, 60.0, 75.0];
    let axes = vec![Axis::Elevation(degrees), mesh(Domain::Hemisphere, 2), Axis::Rgb];
    let data = tensor(axes.clone(), |i, at| gloss(&axes, at, 1.0) * (1.0 + 0.004 * noise(i)));
    let mut golden = golden("lacquer", Quantity::Brdf, data, Target::ErL2(0.01));
    let divisor = Divisor::Model { roughness: 0.3, reflectance: 0.04, base: 0.25 };
    golden.settings.between = Between { divisor, cubic: true, retro: false };
    golden
}

/// Grid in chunk G with samples divided by the model of the interpolation between incidences, masks, a coarser level.
fn enamel() -> Golden {
    let axes = goniometer();
    let data = tensor(axes.clone(), |i, at| match i % 301 {
        0 => f64::NAN,
        _ => polished(&axes, at, 0.1) * (1.0 + 0.03 * noise(i)),
    });
    let mut golden = golden("enamel", Quantity::Brdf, data, Target::ErL2(0.005));
    let divisor = Divisor::Model { roughness: 0.1, reflectance: 0.04, base: 0.25 };
    golden.settings.between = Between { divisor, cubic: true, retro: false };
    golden
}

/// Grids in chunk G with samples divided by a model, and a separate stream per incoming direction.
fn glaze() -> Golden {
    let incoming = DirectionGrid::new(Frame::Surface, vec![0.0, 35.0, 55.0, 75.0], Some(circle(90.0, 4))).unwrap();
    let outgoing =
        DirectionGrid::new(Frame::Surface, (0..9).map(|i| 10.0 * f64::from(i)).collect(), Some(circle(30.0, 12)))
            .unwrap();
    let axes = vec![Axis::Grid(incoming), Axis::Grid(outgoing)];
    let data = tensor(axes.clone(), |i, at| polished(&axes, at, 0.3) * (1.0 + 0.002 * noise(i)));
    let mut golden = golden("glaze", Quantity::Brdf, data, Target::ErL2(0.005));
    let divisor = Divisor::Model { roughness: 0.3, reflectance: 0.04, base: 0.1 };
    golden.settings.between = Between { divisor, cubic: false, retro: false };
    golden.settings.random_access = true;
    golden
}

/// Grid in chunk G with samples divided by a function that has no lobe.
fn ground(name: &'static str, divisor: Divisor) -> Golden {
    let azimuths = Azimuths { angles: (0..4).map(|i| 40.0 * f64::from(i)).collect(), extent: AzimuthExtent::Sector };
    let grid =
        DirectionGrid::new(Frame::Surface, (0..8).map(|i| 12.0 * f64::from(i)).collect(), Some(azimuths)).unwrap();
    let axes = vec![Axis::Elevation(vec![0.0, 25.0, 50.0, 70.0, 86.0]), Axis::Grid(grid)];
    let data = tensor(axes.clone(), |i, at| {
        let (ci, co) = (direction(&axes[0], at[0])[2], direction(&axes[1], at[1])[2]);
        let root = |c: f64, a: f64| (c * c + a * a * (1.0 - c * c)).sqrt();
        let value = match divisor {
            Divisor::ProjectedAreas { .. } => 1.0 / ((ci + root(ci, 0.5)) * (co + root(co, 0.5))),
            Divisor::Masking { .. } => 1.0 / (co * root(ci, 0.125) + ci * root(co, 0.125)),
            _ => 1.0 / (ci + co),
        };
        value * (1.0 + 0.002 * noise(i))
    });
    let mut golden = golden(name, Quantity::Brdf, data, Target::ErL2(0.002));
    golden.settings.between = Between { divisor, cubic: false, retro: false };
    golden
}

/// Lobe about the mirror direction, narrower than the cells and stored beside them, with a colour factor per band.
fn nacre() -> Golden {
    let axes = vec![Axis::Elevation(vec![0.0, 20.0, 40.0, 60.0]), mesh(Domain::Hemisphere, 2), wavelengths(4)];
    let lobe = LobeParameters {
        centre: LobeCentre::Mirror,
        peak: [5.5, 0.25, -0.125],
        range: [0.0, 0.6875],
        widths: [0.0125, 0.0125],
        angle: 0.0,
        tail: 0.0,
        colours: vec![0.7, 0.9, 1.1, 1.3],
    };
    beside("nacre", &axes, &lobe)
}

/// Anisotropic lobe in half vectors, with the tail of GGX.
fn silk() -> Golden {
    let axes = vec![mesh(Domain::Hemisphere, 1), mesh(Domain::Hemisphere, 2), Axis::Rgb];
    let lobe = LobeParameters {
        centre: LobeCentre::HalfVector,
        peak: [4.0, 0.5, 0.0],
        range: [0.0, 1.0],
        widths: [0.03, 0.01],
        angle: 0.7,
        tail: 0.5,
        colours: vec![1.0, 0.5, 0.25],
    };
    beside("silk", &axes, &lobe)
}

/// Lobe of one colour about the direction back to the source, beside lossless samples.
fn reflector() -> Golden {
    let axes = vec![Axis::Elevation(vec![10.0, 30.0, 50.0]), mesh(Domain::Hemisphere, 1)];
    let lobe = LobeParameters {
        centre: LobeCentre::Source,
        peak: [6.0, -0.5, 0.0],
        range: [0.0, 0.5],
        widths: [0.008, 0.008],
        angle: 0.0,
        tail: 0.3,
        colours: vec![1.0],
    };
    let mut golden = beside("reflector", &axes, &lobe);
    (golden.settings.target, golden.settings.policy) = (Target::Lossless, Policy::Lossless);
    golden
}

/// Returns a coloured ground with a lobe beside its cells.
fn beside(name: &'static str, axes: &[Axis], lobe: &LobeParameters) -> Golden {
    let data = tensor(axes.to_vec(), |i, at| {
        let colour = at.get(2).map_or(1.0, |&k| 0.4 + 0.1 * k as f64);
        (0.1 + 0.05 * direction(&axes[1], at[1])[2]) * colour * (1.0 + 0.01 * noise(i))
    });
    let mut golden = golden(name, Quantity::Brdf, data, Target::ErL2(0.02));
    golden.settings.lobe = Some(Lobe::new(lobe.clone()).unwrap());
    golden
}

/// Returns the values of a lobe at the incidences and the centroids of the outgoing triangles, over the axes of the
/// samples.
fn lobe_values(axes: &[Axis], lobe: &Lobe) -> Vec<f32> {
    let at = |axis: usize, i: usize| Direction::from_unit(direction(&axes[axis], i));
    let pairs = (0..axes[0].len()).flat_map(|i| (0..axes[1].len()).map(move |o| (i, o)));
    let values = pairs.flat_map(|(i, o)| {
        let shape = lobe.shape(at(0, i), at(1, o));
        lobe.colours().iter().map(move |&colour| (shape * f64::from(colour)) as f32)
    });
    values.collect()
}

/// Samples coded without logarithms, none of them negative.
fn linear() -> Golden {
    let axes = vec![mesh(Domain::Hemisphere, 2), wavelengths(6)];
    let data = tensor(axes.clone(), |i, at| {
        let z = direction(&axes[0], at[0])[2];
        let value = z * z * z * (1.0 + 0.3 * at[1] as f64) * (1.0 + 0.02 * noise(i));
        if z < 0.3 { 0.02 * (1.0 + noise(i)) } else { value }
    });
    let mut golden = golden("linear", Quantity::Edf, data, Target::MaxAbsoluteError(0.05));
    "klt".clone_into(&mut golden.settings.basis);
    golden
}

/// Samples coded without logarithms, of either sign.
fn signed() -> Golden {
    let axes = vec![mesh(Domain::Sphere, 1), mesh(Domain::Sphere, 1)];
    let data = tensor(axes.clone(), |i, at| {
        let cosine = dot(direction(&axes[0], at[0]), direction(&axes[1], at[1]));
        0.05 + 0.1 * cosine + 0.01 * noise(i)
    });
    golden("signed", Quantity::Phase, data, Target::RelativeRmse(0.05))
}

fn lossless() -> Golden {
    let axes = vec![mesh(Domain::Hemisphere, 1), wavelengths(7)];
    let data = tensor(axes.clone(), |i, at| match i {
        20..=30 => f64::NAN,
        50 => -0.0,
        51 => -3.25,
        52 => f64::from(f32::MIN_POSITIVE) / 4.0,
        _ => direction(&axes[0], at[0])[2] * (1.0 + 0.1 * at[1] as f64) * (1.0 + 0.01 * noise(i)),
    });
    golden("lossless", Quantity::Edf, data, Target::Lossless)
}

/// Grid of directions with every field that an axis can have.
fn stated() -> Golden {
    let azimuths = Azimuths { angles: vec![0.0, 22.5, 90.0, 157.5, 180.0], extent: AzimuthExtent::Mirrored };
    let grid = DirectionGrid::new(Frame::Surface, vec![0.0, 10.5, 30.0, 75.25], Some(azimuths)).unwrap();
    let grid = grid.covering(0.0, 90.0).unwrap().with_outside(Outside::Dark);
    let axes = vec![Axis::Elevation(vec![0.0, 20.0, 60.0]), Axis::Grid(grid), Axis::Rgb];
    let data = tensor(axes, |i, at| match i {
        7..=9 => f64::NAN,
        12 => 0.0,
        13 => -0.25,
        _ => (1.0 + at[0] as f64) / (1.0 + at[1] as f64) * (1.0 + 0.1 * noise(i)),
    });
    let mut golden = golden("stated", Quantity::Brdf, data, Target::Lossless);
    let digest = "0123456789abcdef".repeat(4);
    golden.settings.metadata = Some(format!(r#"{{"source":{{"content_digest":"b3-{digest}","format":"mbsdf"}}}}"#));
    golden.settings.straight_lines = 255;
    golden
}

/// Numbers with a common factor, on C planes: the numbers are lossless, not their products with the factor.
fn multiplied() -> Golden {
    let azimuths = Azimuths { angles: vec![0.0, 90.0, 180.0, 270.0, 360.0], extent: AzimuthExtent::Closed };
    let grid = DirectionGrid::new(Frame::TypeC, vec![0.0, 30.0, 60.0, 90.0], Some(azimuths)).unwrap();
    let data = tensor(vec![Axis::Grid(grid)], |i, at| match i {
        3 => f64::NAN,
        19 => 0.0,
        _ => f64::from(((9.7 - 0.4 * at[0] as f64) * (1.0 + 0.1 * noise(i))) as f32),
    });
    Golden { factor: MULTIPLIER, ..golden("multiplied", Quantity::Edf, data, Target::Lossless) }
}

/// Candela multiplier times ballast factor.
const MULTIPLIER: f64 = 1.1 * 0.93;

/// Policy of the paper.
fn conventional() -> Golden {
    let axes = brdf_axes(9);
    let data = tensor(axes.clone(), |i, at| match i {
        100..=140 => f64::NAN,
        _ => gloss(&axes, at, 0.5) * (1.0 + 0.02 * noise(i)),
    });
    let mut golden = golden("conventional", Quantity::Brdf, data, Target::ErL2(0.05));
    golden.settings.policy = Policy::Conventional;
    "bior4.4".clone_into(&mut golden.settings.basis);
    golden
}

fn path(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../tests/container/golden").join(name)
}

/// Compares bytes with the golden file of this name, or writes it.
fn same(name: &str, bytes: &[u8]) {
    let path = path(name);
    if std::env::var_os("WAVELUME_REMAKE_GOLDEN").is_some() {
        fs::write(path, bytes).unwrap();
        return;
    }
    let stored = fs::read(path).unwrap();
    let differs = stored.iter().zip(bytes).position(|(a, b)| a != b);
    assert!(stored == bytes, "{name}: {} bytes, stored {}, first difference {differs:?}", bytes.len(), stored.len());
}

/// Returns the samples as bytes, with a canonical NaN, because files do not store NaN payloads.
fn bytes_of(samples: &[f32]) -> Vec<u8> {
    samples.iter().flat_map(|&s| if s.is_nan() { f32::NAN } else { s }.to_le_bytes()).collect()
}

#[test]
fn golden_files_are_made_and_decoded_to_the_last_bit() {
    for Golden { name, mut measurement, settings, factor } in all() {
        let numbers = measurement.tensor.clone();
        if factor != 1.0 {
            let samples = numbers.samples().iter().map(|&number| (f64::from(number) * factor) as f32).collect();
            measurement.tensor = Tensor::new(numbers.axes().to_vec(), samples).unwrap();
        }
        let stated = Numbers { values: numbers.samples(), factor };
        let compressed = compress_numbers(&measurement, Some(stated), &settings, &Silent).unwrap();
        assert_eq!(compressed.summary.factor, factor);
        let bytes = state_levels(compressed.bytes, &measurement).unwrap();
        same(&format!("{name}.wlm"), &bytes);
        let stored = fs::read(path(&format!("{name}.wlm"))).unwrap();
        let decoded = decode(&stored).unwrap();
        same(&format!("{name}.f32"), &bytes_of(decoded.measurement.tensor.samples()));
        if let Some(lobe) = &decoded.summary.lobe {
            same(&format!("{name}.lobe.f32"), &bytes_of(&lobe_values(decoded.measurement.tensor.axes(), lobe)));
        }
        let kept = decode_numbers(&stored).unwrap();
        assert_eq!(kept.is_some(), factor != 1.0, "{name}");
        if let Some(kept) = &kept {
            assert_eq!(bytes_of(kept), bytes_of(numbers.samples()), "{name}");
        }
        if settings.random_access {
            let samples = decoded.measurement.tensor.samples();
            let count = measurement.tensor.axes()[0].len();
            for (k, own) in samples.chunks_exact(samples.len() / count).enumerate() {
                let block = decode_block(&stored, k).unwrap();
                assert_eq!(bytes_of(block.tensor.samples()), bytes_of(own), "{name}: block {k}");
            }
        }
        let all_levels = levels(&stored).unwrap();
        if all_levels.len() > 1 {
            // A prefix of the file suffices for the level.
            let prefix = &stored[..all_levels[0].bytes as usize];
            let coarse = decode_level(prefix, 0).unwrap();
            same(&format!("{name}.level0.f32"), &bytes_of(coarse.measurement.tensor.samples()));
        }
    }
}

/// Golden files in forms that the encoder no longer writes.
const BEFORE: [&str; 1] = ["paint_before"];

#[test]
fn files_of_earlier_forms_decode_to_the_last_bit() {
    for name in BEFORE {
        let stored = fs::read(path(&format!("{name}.wlm"))).unwrap();
        let samples = fs::read(path(&format!("{name}.f32"))).unwrap();
        assert_eq!(bytes_of(decode(&stored).unwrap().measurement.tensor.samples()), samples, "{name}");
    }
}

#[test]
fn the_document_shows_the_bytes_of_the_file_it_explains() {
    let document = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../docs/container.md");
    let document = fs::read_to_string(document).unwrap();
    let (_, dump) = document.split_once("<!-- dump -->\n```text\n").unwrap();
    let (dump, _) = dump.split_once("\n```").unwrap();
    let mut shown = Vec::new();
    for line in dump.lines() {
        // Offset, two spaces, 16 bytes in hexadecimal, two spaces, text.
        assert_eq!(usize::from_str_radix(&line[..4], 16), Ok(shown.len()), "{line}");
        let bytes = line[6..line.len().min(53)].split_whitespace();
        shown.extend(bytes.map(|byte| u8::from_str_radix(byte, 16).unwrap()));
    }
    assert_eq!(shown, fs::read(path("luminaire.wlm")).unwrap());
}
