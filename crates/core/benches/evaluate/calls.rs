//! Speed of each kind of call, single and in batches.

use super::surfaces::{Vector, brdf, compressed, direction, isotropic_brdf, lamp, large, opened, point, uniform};
use std::hint::black_box;
use std::ops::Range;
use std::time::Instant;
use wavelume_core::compress::{Between, Divisor};
use wavelume_core::domain::Direction;
use wavelume_core::evaluate::{
    Beyond, Chosen, Density, Directions, Drawings, Interpolation, Material, Pairs, Place, SampleOptions,
};

const CALLS: usize = 1024;
const RUNS: usize = 200;
const FORMS: [Interpolation; 2] = [Interpolation::Constant, Interpolation::Smooth];
const DENSITIES: [Density; 2] = [Density::Uniform, Density::Linear];
const WAVELENGTHS: [f64; 4] = [412.3, 503.1, 555.5, 641.9];

/// Arguments of the queries: pairs of directions, and points of the unit square.
struct Questions {
    pairs: Vec<(Option<Direction>, Option<Direction>)>,
    points: Vec<[f64; 2]>,
    coordinates_of_points: [Vec<f32>; 2],
    /// Coordinates x, y, z of `wi`, then of `wo`.
    coordinates: [Vec<f32>; 6],
}

impl Questions {
    fn new(count: usize) -> Self {
        let vectors: Vec<(Vector, Vector)> = (0..count).map(|i| (uniform(i * 7 + 3, 0.1), uniform(i, 0.0))).collect();
        let of = |k: usize| vectors.iter().map(|(wi, wo)| if k < 3 { wi[k] } else { wo[k - 3] } as f32).collect();
        Self {
            pairs: vectors.iter().map(|&(wi, wo)| (direction(wi), direction(wo))).collect(),
            points: (0..count).map(point).collect(),
            coordinates_of_points: [0, 1].map(|k| (0..count).map(|i| point(i)[k] as f32).collect()),
            coordinates: std::array::from_fn(of),
        }
    }

    fn place(&self, i: usize) -> Place<'_> {
        Place { index: &[], wi: self.pairs[i].0, wo: self.pairs[i].1 }
    }

    fn all(&self) -> Pairs<'_> {
        self.some(0..self.pairs.len())
    }

    fn some(&self, range: Range<usize>) -> Pairs<'_> {
        let [wx, wy, wz, ox, oy, oz] = self.coordinates.each_ref().map(|coordinates| &coordinates[range.clone()]);
        Pairs { index: &[], wi: Some(Directions::new(wx, wy, wz)), wo: Some(Directions::new(ox, oy, oz)) }
    }
}

/// Named query; one execution runs it `CALLS` times.
type Call<'a> = (String, Box<dyn FnMut() -> f32 + 'a>);

fn each<'a>(name: String, mut call: impl FnMut(usize) -> f32 + 'a) -> Call<'a> {
    (name, Box::new(move || (0..CALLS).map(&mut call).sum()))
}

/// Returns all kinds of queries of a BRDF.
fn calls<'a>(material: &'a Material, chosen: &'a Chosen<'a>, asked: &'a Questions) -> Vec<Call<'a>> {
    let lambdas = material.lambdas();
    let place = |i| asked.place(i);
    let mut calls = Vec::new();
    for how in FORMS {
        let mut out = vec![0.0; lambdas];
        calls.push(each(format!("spectrum of {lambdas}, {how:?}"), move |i| {
            material.evaluate(place(i), how, &mut out).map_or(0.0, |()| out[7])
        }));
        let mut all = vec![0.0; lambdas * CALLS];
        calls.push((
            format!("spectrum of {lambdas}, {how:?}, of a batch"),
            Box::new(move || material.spectra(asked.all(), how, &mut all).map_or(0.0, |()| all[7])),
        ));
        let mut four = [0.0; 4];
        calls.push(each(format!("4 wavelengths, {how:?}"), move |i| {
            let found = material.at_wavelengths(place(i), how, Beyond::Nearest, &WAVELENGTHS, &mut four);
            found.map_or(0.0, |()| four[0])
        }));
        calls.push(each(format!("4 wavelengths chosen before, {how:?}"), move |i| {
            chosen.at(place(i), how).map_or(0.0, |values| values[0])
        }));
        let mut all = vec![0.0; 4 * CALLS];
        calls.push((
            format!("4 wavelengths chosen before, {how:?}, of a batch"),
            Box::new(move || chosen.values(asked.all(), how, &mut all).map_or(0.0, |()| all[7])),
        ));
    }
    for density in DENSITIES {
        let options = SampleOptions { density, ..SampleOptions::default() };
        calls.push(each(format!("pdf, {density:?}"), move |i| {
            let (wi, wo) = asked.pairs[i];
            wo.and_then(|wo| material.pdf(&[], wi, wo, options).ok()).unwrap_or(0.0) as f32
        }));
        let mut all = vec![0.0; CALLS];
        calls.push((
            format!("pdf, {density:?}, of a batch"),
            Box::new(move || material.pdfs(asked.all(), options, &mut all).map_or(0.0, |()| all[7] as f32)),
        ));
        calls.push(each(format!("direction and pdf, {density:?}"), move |i| {
            let drawn = material.draw(&[], asked.pairs[i].0, asked.points[i], options);
            drawn.ok().flatten().map_or(0.0, |(wo, _)| wo.cos_theta() as f32)
        }));
        calls.push(each(format!("direction, pdf and 4 weights, {density:?}"), move |i| {
            let drawn = chosen.sample(&[], asked.pairs[i].0, asked.points[i], options);
            drawn.ok().flatten().map_or(0.0, |sample| sample.weights[0])
        }));
        let [mut x, mut y, mut z, mut pdf] = [(); 4].map(|()| vec![0.0; CALLS]);
        let mut weights = vec![0.0; 4 * CALLS];
        calls.push((
            format!("direction, pdf and 4 weights, {density:?}, of a batch"),
            Box::new(move || {
                let out = Drawings { x: &mut x, y: &mut y, z: &mut z, pdf: &mut pdf, weights: &mut weights };
                let [u, v] = &asked.coordinates_of_points;
                chosen.samples(&[], asked.all().wi, [u, v], options, out).map_or(0.0, |()| weights[7])
            }),
        ));
    }
    calls
}

/// Returns queries of spectra of the BRDF, with incident directions on triangles and on elevations: with the default
/// interpolation between incidences, and with straight lines and cubics over the masking function.
fn between<'a>(materials: &'a [(String, Material)], asked: &'a Questions) -> Vec<Call<'a>> {
    let mut calls: Vec<Call<'_>> = Vec::new();
    for (name, material) in materials {
        let lambdas = material.lambdas();
        let mut out = vec![0.0; lambdas];
        calls.push(each(format!("{name}: spectrum of {lambdas}, Smooth"), move |i| {
            material.evaluate(asked.place(i), Interpolation::Smooth, &mut out).map_or(0.0, |()| out[0])
        }));
        let mut all = vec![0.0; lambdas * CALLS];
        calls.push((
            format!("{name}: spectrum of {lambdas}, Smooth, of a batch"),
            Box::new(move || material.spectra(asked.all(), Interpolation::Smooth, &mut all).map_or(0.0, |()| all[0])),
        ));
    }
    calls
}

/// Returns the materials for [`between`].
fn ways_between() -> Vec<(String, Material)> {
    let masking = Divisor::Masking { roughness: 0.2 };
    let ways = [
        ("nothing stated", Between::default()),
        ("straight", Between { divisor: masking, cubic: false, retro: false }),
        ("cubic", Between { divisor: masking, cubic: true, retro: false }),
    ];
    let sources = [("triangles", brdf()), ("elevations", isotropic_brdf())];
    let named = sources.into_iter().flat_map(|(source, measurement)| {
        ways.map(|(way, between)| {
            let material = Material::with_between(measurement.clone(), between);
            (format!("{source}, {way}"), material.unwrap_or_else(|e| unreachable!("{e}")))
        })
    });
    named.collect()
}

/// Returns all kinds of queries of an emission and of a spectrum.
fn emission<'a>(lamp: &'a Material, spectrum: &'a Material, asked: &'a Questions) -> Vec<Call<'a>> {
    let lambdas = lamp.lambdas();
    let mut calls: Vec<Call<'_>> = Vec::new();
    for how in FORMS {
        let mut out = vec![0.0; lambdas];
        calls.push(each(format!("EDF, spectrum of {lambdas}, {how:?}"), move |i| {
            let place = Place { index: &[], wi: None, wo: asked.pairs[i].1 };
            lamp.evaluate(place, how, &mut out).map_or(0.0, |()| out[7])
        }));
        let mut all = vec![0.0; lambdas * CALLS];
        calls.push((
            format!("EDF, spectrum of {lambdas}, {how:?}, of a batch"),
            Box::new(move || {
                let pairs = Pairs { wi: None, ..asked.all() };
                lamp.spectra(pairs, how, &mut all).map_or(0.0, |()| all[7])
            }),
        ));
    }
    let mut out = vec![0.0; lambdas];
    calls.push(each(format!("SPD, spectrum of {lambdas}"), move |_| {
        let found = spectrum.evaluate(black_box(Place::default()), Interpolation::Smooth, &mut out);
        found.map_or(0.0, |()| out[7])
    }));
    calls
}

/// Returns the best time of many runs, in ns per call; different calls run alternately.
fn times(calls: &mut [Call<'_>]) -> Vec<f64> {
    let mut best = vec![f64::INFINITY; calls.len()];
    for _ in 0..RUNS {
        for ((_, call), best) in calls.iter_mut().zip(&mut best) {
            black_box(call());
            let start = Instant::now();
            black_box(call());
            *best = best.min(start.elapsed().as_secs_f64() * 1e9 / CALLS as f64);
        }
    }
    best
}

pub(crate) fn speed(only: &str) {
    let bytes = compressed(&brdf());
    let start = Instant::now();
    let material = Material::open(&bytes).unwrap_or_else(|e| unreachable!("{e}"));
    println!(
        "\nBRDF 16 x 1024 x 75 in {} bytes, opened in {:.0} ms: {:?}\n",
        bytes.len(),
        start.elapsed().as_secs_f64() * 1e3,
        material.report()
    );
    let [lamp, spectrum] = lamp().map(|measurement| opened(&measurement));
    let asked = Questions::new(CALLS);
    let chosen = material.choose(&WAVELENGTHS, Beyond::Nearest).unwrap_or_else(|e| unreachable!("{e}"));
    let isotropic = opened(&isotropic_brdf());
    let of_isotropic = isotropic.choose(&WAVELENGTHS, Beyond::Nearest).unwrap_or_else(|e| unreachable!("{e}"));
    let ways = ways_between();
    let mut all = calls(&material, &chosen, &asked);
    all.extend(emission(&lamp, &spectrum, &asked));
    let drawn = calls(&isotropic, &of_isotropic, &asked).into_iter().filter(|(name, _)| name.contains("pdf"));
    all.extend(drawn.map(|(name, call)| (format!("isotropic: {name}"), call)));
    let (samples, mut copy) = ((0..1 << 19).map(|i| i as f32).collect::<Vec<_>>(), vec![0.0; 75]);
    all.push(each("copy of 75 samples from 2 MiB of float32".to_owned(), move |i| {
        copy.copy_from_slice(&samples[(i * 7919 * 75) % (samples.len() - 75)..][..75]);
        copy[7]
    }));
    all.extend(between(&ways, &asked));
    all.retain(|(name, _)| name.contains(only));
    let best = times(&mut all);
    println!("| one call, one thread, material in cache | ns |\n|---|--:|");
    for ((name, _), ns) in all.iter().zip(&best) {
        println!("| {name} | {ns:.0} |");
    }
    let of = |start: &str| {
        let matching = all.iter().zip(&best).filter(|((name, _), _)| name.starts_with(start));
        matching.map(|(_, ns)| *ns).fold(f64::INFINITY, f64::min)
    };
    println!("\n[CPB06] table 8, one spectrum (theirs on an Athlon XP 1800+, 90 wavelengths):\n");
    println!("| | paper, us | here, us | paper / here |\n|---|--:|--:|--:|");
    for (name, start, paper) in [("SPD", "SPD", 23.0), ("EDF", "EDF", 72.0), ("BRDF", "spectrum", 117.0)] {
        println!("| {name} | {paper} | {:.3} | {:.0} |", of(start) / 1e3, paper * 1e3 / of(start));
    }
}

/// Measures spectra of a material larger than all caches.
pub(crate) fn from_memory() {
    const MANY: usize = 1 << 18;
    let material = Material::of(large()).unwrap_or_else(|e| unreachable!("{e}"));
    let report = material.report();
    println!(
        "\nBRDF 256 x 4096 x 75 with {:?} planes, {:.0} MiB; {MANY} random pairs\n",
        report.planes,
        report.memory as f64 / f64::from(1 << 20)
    );
    println!("| from memory, one thread | ns |\n|---|--:|");
    let asked = Questions::new(MANY);
    let mut out = vec![0.0; 75];
    let mut all = vec![0.0; 75 * CALLS];
    for how in FORMS {
        let [mut single, mut batch] = [f64::INFINITY; 2];
        for _ in 0..5 {
            let start = Instant::now();
            for i in 0..MANY {
                black_box(material.evaluate(asked.place(i), how, &mut out).is_ok());
            }
            single = single.min(start.elapsed().as_secs_f64() * 1e9 / MANY as f64);
            let start = Instant::now();
            for from in (0..MANY).step_by(CALLS) {
                black_box(material.spectra(asked.some(from..from + CALLS), how, &mut all).is_ok());
            }
            batch = batch.min(start.elapsed().as_secs_f64() * 1e9 / MANY as f64);
        }
        println!("| spectrum of 75, {how:?} | {single:.0} |\n| spectrum of 75, {how:?}, of a batch | {batch:.0} |");
    }
}

/// Runs every kind of call for a program that counts instructions within `counted`, and prints the names in the same
/// order.
pub(crate) fn count() {
    let material = opened(&brdf());
    let [lamp, spectrum] = lamp().map(|measurement| opened(&measurement));
    let asked = Questions::new(CALLS);
    let chosen = material.choose(&WAVELENGTHS, Beyond::Nearest).unwrap_or_else(|e| unreachable!("{e}"));
    // Not those of `between`: valgrind 3.19 does not know an instruction of theirs. `speed` compares their times.
    let mut all = calls(&material, &chosen, &asked);
    all.extend(emission(&lamp, &spectrum, &asked));
    for (name, call) in &mut all {
        black_box(call());
        black_box(counted(call));
        println!("{CALLS} {name}");
    }
}

#[inline(never)]
fn counted(call: &mut dyn FnMut() -> f32) -> f32 {
    call()
}
