//! Tests of the fit of a lobe alone.

use super::candidates::candidate;
use super::choose::{Found, best};
use super::scan::Scan;
use crate::domain::vector::Vector;
use crate::domain::{CENTRES, Direction, Lobe, LobeCentre, LobeParameters, Quantity};
use crate::formats::Scattered;
use crate::projection::AxesRequest;
use crate::projection::scattered::incidences::incidences;
use crate::projection::scattered::plan::Plan;
use crate::projection::scattered::rows::Rows;
use crate::projection::scattered::tests::acquisition;
use std::borrow::Cow;

/// Independent numbers, even between 0 and 1 (`SplitMix64`, Steele and others 2014).
pub(super) struct Random(pub(super) u64);

impl Random {
    pub(super) fn even(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Of standard deviation 1 (Box and Muller 1958).
    pub(super) fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.even()).ln()).sqrt() * (std::f64::consts::TAU * self.even()).cos()
    }
}

const ELEVATIONS: [f64; 8] = [0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0];
pub(super) const BASE: f64 = 0.3 / std::f64::consts::PI;

/// A lobe that is `width` degrees wide at half its maximum and takes 0.3 of the light of each elevation.
fn truth(centre: LobeCentre, width: f64, tail: f64) -> impl Fn(Direction, Direction) -> f64 + Copy {
    let half = width.to_radians() * if centre == LobeCentre::HalfVector { 0.25 } else { 0.5 };
    let widths = [half, half];
    move |wi: Direction, wo: Direction| {
        let parameters =
            LobeParameters { centre, peak: [0.0; 3], range: [0.0, 2.0], widths, angle: 0.0, tail, colours: vec![] };
        let under = Lobe::new(parameters).unwrap().under(wi).unwrap();
        // Light that is lost below the horizon is not made up for.
        let whole = std::f64::consts::PI * half * half
            * if tail == 0.0 { 1.0 / 2_f64.ln() } else { tail / ((2_f64.powf(tail) - 1.0) * (1.0 - tail)) };
        let cos = wi.cos_theta();
        let light = whole * if centre == LobeCentre::HalfVector { 4.0 * cos * cos } else { cos };
        0.3 / light * under.shape(wo)
    }
}

/// Samples under a spiral, turned from each elevation to the next.
fn spiral(truth: impl Fn(Direction, Direction) -> f64, elevations: &[f64], noise: f64, seed: u64) -> Scattered {
    let mut random = Random(seed);
    let (mut incoming, mut outgoing, mut values) = (Vec::new(), Vec::new(), Vec::new());
    for &theta in elevations {
        let turned = 360.0 * random.even();
        for i in 0..4000 {
            let z = 1.0 - (f64::from(i) + 0.5) / 4000.0;
            let wo = [z.acos().to_degrees(), (222.492_235_949 * f64::from(i) + turned) % 360.0];
            if z < 0.02 {
                continue;
            }
            let value = truth(Direction::from_degrees(theta, 0.0), Direction::from_degrees(wo[0], wo[1]));
            values.push((value * (1.0 + noise * random.normal())) as f32);
            incoming.push([theta, 0.0]);
            outgoing.push(wo);
        }
    }
    Scattered { incoming, outgoing, isotropic: true, spectral: None, values, sigma: None }
}

fn found(scattered: &Scattered) -> Option<Found> {
    let rows = Rows::new(Cow::Borrowed(&scattered.values), None, 1);
    let plan = Plan::new(Quantity::Brdf, scattered, &rows, &AxesRequest::default(), 1).unwrap();
    let incidences = incidences(Quantity::Brdf, &plan, true);
    let scan = Scan::new(&plan, &rows, &incidences);
    [LobeCentre::Mirror, LobeCentre::Source]
        .into_iter()
        .filter_map(|centre| best(&scan, &candidate(&scan, centre, &[])?))
        .max_by(|a, b| a.gain.total_cmp(&b.gain))
}

#[test]
#[ignore = "figures"]
fn figures() {
    let seeds = std::env::var("SEEDS").ok().and_then(|n| n.parse().ok()).unwrap_or(1);
    for (centre, tail) in [(LobeCentre::Mirror, 0.0), (LobeCentre::HalfVector, 0.5), (LobeCentre::Source, 0.0)] {
        for width in [0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0] {
            for seed in 0..seeds {
                let lobe = truth(centre, width, tail);
                let data = spiral(|wi, wo| BASE + lobe(wi, wo), &ELEVATIONS, 0.01, 77 + seed);
                let start = std::time::Instant::now();
                let Some(found) = found(&data) else {
                    eprintln!("{centre:?} {tail} {width}: none ({:?})", start.elapsed());
                    continue;
                };
                let carried = Lobe::new(found.shape.parameters(found.near.mean_t, found.near.range())).unwrap();
                let ratios: Vec<f64> = ELEVATIONS
                    .iter()
                    .map(|&theta| {
                        let wi = Direction::from_degrees(theta, 0.0);
                        let half = width.to_radians() * if centre == LobeCentre::HalfVector { 0.25 } else { 0.5 };
                        let parameters = LobeParameters {
                            centre,
                            peak: [0.0; 3],
                            range: [0.0, 2.0],
                            widths: [half; 2],
                            angle: 0.0,
                            tail,
                            colours: vec![],
                        };
                        let under = Lobe::new(parameters).unwrap().under(wi).unwrap();
                        let [x, y, z] = wi.xyz();
                        let at = if centre == LobeCentre::Source { wi } else { Direction::new(-x, -y, z).unwrap() };
                        let scale = lobe(wi, at) / under.shape(at);
                        carried.under(wi).unwrap().light() / (under.light() * scale)
                    })
                    .collect();
                eprintln!(
                    "{centre:?} {tail} {width}: {carried} tail {:.3} gain {:.0} noise {:.4}: {:.3?} {:?}",
                    found.shape.numbers[4],
                    found.gain,
                    found.noise,
                    ratios,
                    start.elapsed()
                );
            }
        }
    }
    let _ = (CENTRES, acquisition as fn(_, _) -> _, [0.0; 3] as Vector);
}
