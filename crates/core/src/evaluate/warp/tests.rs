//! Every warp against its density and its inverse: measure × domain × level × end level × density.

use super::{Density, Measure, SampleOptions, WarpMesh, Warps};
use crate::domain::vector::{Vector, add, cross, dot, norm, scale, sub};
use crate::domain::{Direction, Domain, TriangleMesh};
use rand::RngExt;
use rand_pcg::Pcg32;
use std::sync::Arc;

const DENSITIES: [Density; 2] = [Density::Uniform, Density::Linear];
const MEASURES: [Measure; 2] = [Measure::Projected, Measure::SolidAngle];

/// Irregular test numbers: neighbours differ by up to a factor of 10, and some are exactly 0.
fn rough(i: usize) -> f64 {
    let x = (i.wrapping_mul(2_654_435_761) >> 7) % 61;
    if x < 6 { 0.0 } else { x as f64 / 30.0 }
}

/// Sampling trees of three test functions. The first two have irregular mean values on triangles and values at
/// vertices, some exactly 0; the third is 0 everywhere.
fn warps(domain: Domain, level: u8, measure: Measure) -> Warps {
    let mesh = Arc::new(WarpMesh::new(TriangleMesh::new(domain, level).unwrap(), measure));
    let measures = mesh.measures().to_vec();
    Warps::new(mesh, 3, |cell, integrals, values| {
        if cell < 2 {
            integrals.iter_mut().enumerate().for_each(|(i, x)| *x = rough(i + 1000 * cell) * measures[i]);
            values.iter_mut().enumerate().for_each(|(i, x)| *x = rough(i + 77 * cell));
        }
    })
}

fn options(level: Option<u8>, density: Density, defensive: f64) -> SampleOptions {
    SampleOptions { level, density, defensive }
}

/// All tested combinations of measure (solid angle or projected solid angle), domain and mesh level.
fn all(levels: std::ops::RangeInclusive<u8>) -> impl Iterator<Item = Warps> {
    MEASURES.into_iter().flat_map(move |measure| {
        let levels = levels.clone();
        Domain::ALL.iter().flat_map(move |&domain| levels.clone().map(move |level| warps(domain, level, measure)))
    })
}

fn direction(v: Vector) -> Direction {
    Direction::new(v[0], v[1], v[2]).unwrap()
}

/// Integral of the sampling density over the planar triangle `part`, a piece of the mesh triangle `leaf`. The density
/// with respect to area is linear, so that the value at the centroid times the area is exact. For a point p of a plane
/// with unit normal n, dω = (n·p)/|p|³ dA.
fn integral(warps: &Warps, cell: usize, leaf: [Vector; 3], part: [Vector; 3], options: &SampleOptions) -> f64 {
    let normal = cross(sub(leaf[1], leaf[0]), sub(leaf[2], leaf[0]));
    let normal = scale(normal, 1.0 / norm(normal));
    let distance = dot(normal, leaf[0]);
    let [p, q, r] = part.map(|ray| scale(ray, distance / dot(normal, ray)));
    let area = 0.5 * norm(cross(sub(q, p), sub(r, p)));
    let centre = scale(add(add(p, q), r), 1.0 / 3.0);
    let length = norm(centre);
    warps.pdf(cell, direction(centre), options) * distance.abs() / length.powi(3) * area
}

#[test]
fn densities_integrate_to_one() {
    for warps in all(0..=4) {
        let mesh = warps.mesh().mesh();
        for end in 0..=mesh.level() {
            for density in DENSITIES {
                let options = options(Some(end), density, 0.0);
                let total: f64 =
                    mesh.all_vertices().into_iter().map(|leaf| integral(&warps, 1, leaf, leaf, &options)).sum();
                assert!((total - 1.0).abs() < 1e-6, "{mesh:?} {options:?}: {total}");
            }
        }
    }
}

#[test]
fn triangles_of_the_end_level_have_their_share() {
    for warps in all(0..=3) {
        let mesh = warps.mesh().mesh();
        for end in 0..=mesh.level() {
            let below = 1 << (2 * (mesh.level() - end));
            for density in DENSITIES {
                let options = options(Some(end), density, 0.0);
                let each: Vec<f64> =
                    mesh.all_vertices().into_iter().map(|leaf| integral(&warps, 0, leaf, leaf, &options)).collect();
                for (node, found) in each.chunks(below).enumerate() {
                    let range = node * below..(node + 1) * below;
                    let expected = range.clone().map(|i| warps.mean(0, i) * warps.mesh().measures()[i]).sum::<f64>()
                        / warps.total(0);
                    assert!((found.iter().sum::<f64>() - expected).abs() < 1e-6);
                    // Within a triangle the leaves divide its probability by the measure.
                    let measure: f64 = range.clone().map(|i| warps.mesh().measures()[i]).sum();
                    for (i, share) in range.zip(found) {
                        assert!((share - expected * warps.mesh().measures()[i] / measure).abs() < 1e-6);
                    }
                }
            }
        }
    }
}

/// Standard normal deviate of a χ² value with `k` degrees of freedom (Wilson & Hilferty 1931).
fn z_score(chi2: f64, k: f64) -> f64 {
    ((chi2 / k).cbrt() - (1.0 - 2.0 / (9.0 * k))) / (2.0 / (9.0 * k)).sqrt()
}

/// χ² test that drawn directions follow their density, at each level at which the descent of a sampling tree can end on
/// a mesh. There are 2 measures (solid angle, projected or not) × 3 domains × (1 + 2 + 3 + 4 + 5) levels × 2 densities
/// (constant, linear) × 2 fractions of defensive sampling = 360 cases.
///
/// Each case is a one-sided test at significance 0.01 / 360 (Bonferroni): z < 4.03. A correct sampler fails with
/// probability 1 % for fresh seeds; these are fixed. Bins are the children of the leaves, which show the density within
/// a leaf, merged until 5 samples are expected in each.
#[test]
fn samples_follow_their_density() {
    const N: usize = 20_000;
    let mut tests = 0;
    for (case, warps) in all(0..=4).enumerate() {
        let mesh = warps.mesh().mesh();
        let bins = TriangleMesh::new(mesh.domain(), mesh.level() + 1).unwrap();
        let (leaves, parts) = (mesh.all_vertices(), bins.all_vertices());
        for end in 0..=mesh.level() {
            for density in DENSITIES {
                let tree = options(Some(end), density, 0.0);
                let shares: Vec<f64> = parts
                    .iter()
                    .enumerate()
                    .map(|(i, &part)| integral(&warps, 0, leaves[i / 4], part, &tree))
                    .collect();
                for defensive in [0.0, 0.3] {
                    let options = options(Some(end), density, defensive);
                    let mut rng = Pcg32::new(0x5eed, (case * 100 + tests) as u64);
                    let mut counts = vec![0.0; bins.len()];
                    for _ in 0..N {
                        let drawn = warps.sample(0, [rng.random(), rng.random()], &options).unwrap();
                        let pdf = warps.pdf(0, drawn.direction, &options);
                        assert!(drawn.pdf > 0.0 && (pdf / drawn.pdf - 1.0).abs() < 1e-5, "{pdf} {drawn:?}");
                        assert_eq!(mesh.locate(drawn.direction), Some(drawn.leaf));
                        counts[bins.locate(drawn.direction).unwrap()] += 1.0;
                    }
                    let measure = |i: usize| match warps.mesh().measure() {
                        Measure::Projected => bins.projected_solid_angle(i),
                        Measure::SolidAngle => bins.solid_angle(i),
                    };
                    let whole: f64 = (0..bins.len()).map(measure).sum();
                    let (mut chi2, mut degrees, mut found, mut expected) = (0.0, -1.0, 0.0, 0.0);
                    for (i, count) in counts.iter().enumerate() {
                        let share = (1.0 - defensive) * shares[i] + defensive * measure(i) / whole;
                        assert!(share > 0.0 || *count == 0.0, "a sample where the density is 0");
                        found += count;
                        expected += share * N as f64;
                        if expected >= 5.0 {
                            chi2 += (found - expected) * (found - expected) / expected;
                            degrees += 1.0;
                            (found, expected) = (0.0, 0.0);
                        }
                    }
                    let z = z_score(chi2, degrees);
                    assert!(z < 4.03, "{mesh:?} {options:?}: χ² = {chi2} of {degrees} degrees of freedom, z = {z}");
                    tests += 1;
                }
            }
        }
    }
    assert_eq!(tests, 360);
}

#[test]
fn directions_lead_back_to_their_point_of_the_square() {
    for warps in all(0..=5).chain(all(7..=7)) {
        let mesh = warps.mesh().mesh();
        let mut rng = Pcg32::new(21, u64::from(mesh.level()));
        let mut worst = 0.0_f64;
        for i in 0..100_000_usize {
            let level = (i % 8 < 7).then_some((i % 8) as u8);
            let options = options(level, DENSITIES[i / 8 % 2], if i % 3 == 0 { 0.25 } else { 0.0 });
            let u = [rng.random::<f64>() * if i % 3 == 0 { 0.75 } else { 1.0 }, rng.random::<f64>()];
            let drawn = warps.sample(0, u, &options).unwrap();
            let back = warps.invert(0, drawn.direction, &options).unwrap();
            worst = worst.max((u[0] - back[0]).abs()).max((u[1] - back[1]).abs());
            assert!(worst < 1e-5, "{mesh:?} {options:?} {u:?}: {back:?}");
        }
    }
}

#[test]
fn points_lead_back_to_their_direction() {
    let mut rng = Pcg32::new(22, 1);
    for warps in all(0..=4) {
        for i in 0..5_000 {
            let wo = Direction::from_radians((2.0 * rng.random::<f64>() - 1.0).acos(), 7.0 * rng.random::<f64>());
            let options = options([None, Some(0), Some(1)][i % 3], DENSITIES[i % 2], [0.0, 0.2][i / 6 % 2]);
            let pdf = warps.pdf(0, wo, &options);
            match warps.invert(0, wo, &options) {
                None => assert_eq!(pdf, 0.0),
                Some(u) => {
                    let drawn = warps.sample(0, u, &options).unwrap();
                    let apart = norm(sub(drawn.direction.xyz(), wo.xyz()));
                    // If the density is next to 0 (linear, at a vertex of value 0) many directions share a point.
                    let same = (drawn.pdf - pdf).abs() < 1e-4 * pdf && apart < 1e-6;
                    assert!(same || pdf < 1e-4, "{options:?} {wo:?} {drawn:?} {pdf}");
                }
            }
        }
    }
}

#[test]
fn equal_triangles_make_one_continuous_map() {
    for domain in Domain::ALL {
        let mesh = Arc::new(WarpMesh::new(TriangleMesh::new(*domain, 4).unwrap(), Measure::SolidAngle));
        let warps = Warps::new(mesh, 1, |_, integrals, values| {
            integrals.fill(1.0);
            values.fill(1.0);
        });
        let mut rng = Pcg32::new(23, 1);
        for i in 0..100_000 {
            let u: [f64; 2] = [rng.random(), rng.random()];
            let v = u.map(|x| (x + 1e-6 * (rng.random::<f64>() - 0.5)).clamp(0.0, 1.0));
            let options = options(None, DENSITIES[i % 2], 0.0);
            let [a, b] = [u, v].map(|u| warps.sample(0, u, &options).unwrap().direction.xyz());
            assert!(norm(sub(a, b)) < 1e-5, "{domain} {u:?} {v:?}");
        }
    }
}

#[test]
fn the_map_is_continuous_within_leaf_squares_and_jumps_only_between_them() {
    for warps in all(0..=4) {
        let shared = warps.mesh();
        let level = shared.mesh().level();
        let mut rng = Pcg32::new(24, 1);
        let mut apart = 0;
        for i in 0..20_000_usize {
            let options = options([None, Some(1)][i % 2], DENSITIES[i / 2 % 2], 0.0);
            let step = 1e-9;
            let u: [f64; 2] = [rng.random::<f64>() * (1.0 - step), rng.random::<f64>() * (1.0 - step)];
            let [a, b] = [u, u.map(|x| x + step)].map(|u| warps.sample(0, u, &options).unwrap());
            if shared.place(level, a.leaf) / 2 == shared.place(level, b.leaf) / 2 {
                // At most proportional to the cube root of the step, where the linear density vanishes.
                let distance = norm(sub(a.direction.xyz(), b.direction.xyz()));
                assert!(distance < 4.0 * step.cbrt(), "{u:?} {distance}");
            } else {
                apart += 1;
            }
        }
        // A step of 1e-9 meets a border of a few thousand segments with probability below 1e-5.
        assert!(apart <= 4, "{apart}");
    }
}

/// (0,2)-sequence of points: van der Corput and Sobol' in base 2, scrambled digit by digit by `shift`.
fn low_discrepancy(i: u32, shift: [u32; 2]) -> [f64; 2] {
    let mut second = 0_u32;
    let (mut direction, mut n) = (1_u32 << 31, i);
    while n > 0 {
        if n & 1 == 1 {
            second ^= direction;
        }
        n >>= 1;
        direction ^= direction >> 1;
    }
    [i.reverse_bits() ^ shift[0], second ^ shift[1]].map(|x| (f64::from(x) + 0.5) / 4_294_967_296.0)
}

/// Variance, over 100 randomisations, of estimates of the integral of a smooth function f from 1024 drawn points.
fn variances(warps: &Warps, f: impl Fn(Direction) -> f64, options: &SampleOptions) -> [f64; 3] {
    const N: u32 = 1024;
    const RUNS: usize = 100;
    let mut rng = Pcg32::new(25, 1);
    let mut sums = [[0.0; 2]; 3];
    for _ in 0..RUNS {
        let shift = [rng.random(), rng.random()];
        let mut estimate = [0.0; 3];
        for i in 0..N {
            let stratum = [f64::from(i / 32), f64::from(i % 32)].map(|s| (s + rng.random::<f64>()) / 32.0);
            let points = [[rng.random(), rng.random()], stratum, low_discrepancy(i, shift)];
            for (sum, u) in estimate.iter_mut().zip(points) {
                let drawn = warps.sample(0, u, options).unwrap();
                *sum += f(drawn.direction) / drawn.pdf / f64::from(N);
            }
        }
        for (sum, e) in sums.iter_mut().zip(estimate) {
            sum[0] += e;
            sum[1] += e * e;
        }
    }
    sums.map(|[s, s2]| (s2 - s * s / RUNS as f64) / (RUNS as f64 - 1.0))
}

#[test]
fn stratified_points_stay_stratified_at_every_end_level() {
    // A lobe and a floor times the cosine, on 64 leaves: about 16 points in each.
    let f = |wo: Direction| {
        let lobe = wo.dot(Direction::from_degrees(40.0, 30.0)).max(0.0).powi(20);
        (0.1 + lobe) * wo.cos_theta().abs()
    };
    let mesh = Arc::new(WarpMesh::new(TriangleMesh::new(Domain::Hemisphere, 2).unwrap(), Measure::Projected));
    let fine = TriangleMesh::new(Domain::Hemisphere, 6).unwrap();
    let points = mesh.vertices().to_vec();
    let warps = Warps::new(mesh, 1, |_, integrals, values| {
        (0..fine.len()).for_each(|i| integrals[i / 256] += f(fine.centroid(i)) * fine.solid_angle(i));
        values.iter_mut().zip(&points).for_each(|(value, &point)| *value = f(point));
    });
    for density in DENSITIES {
        for level in 0..=2 {
            let [random, jittered, sequence] = variances(&warps, f, &options(Some(level), density, 0.0));
            println!(
                "{density:?} {level}: random {random:.2e}, ÷ jittered {:.1}, ÷ (0,2) {:.1}",
                random / jittered,
                random / sequence
            );
            // At the full level the weight is a sawtooth with one tooth for each leaf; the remaining variance lies
            // within the teeth.
            let factor = if level == 2 { 1.5 } else { 4.0 };
            assert!(jittered < random / factor, "{density:?} {level}: {random} {jittered}");
            assert!(sequence < random / (2.0 * factor), "{density:?} {level}: {random} {sequence}");
        }
    }
}

#[test]
fn where_nothing_is_nothing_is_drawn() {
    for warps in all(0..=2) {
        let mesh = warps.mesh().mesh();
        let up = mesh.centroid(0);
        for density in DENSITIES {
            let tree = options(None, density, 0.0);
            assert_eq!(warps.sample(2, [0.5; 2], &tree), None);
            assert_eq!((warps.pdf(2, up, &tree), warps.invert(2, up, &tree)), (0.0, None));
            // All directions from the defensive part.
            let mixed = options(Some(0), density, 0.1);
            for u in [[0.0, 0.0], [0.3, 0.9], [1.0, 1.0]] {
                let drawn = warps.sample(2, u, &mixed).unwrap();
                assert!((warps.pdf(2, drawn.direction, &mixed) - drawn.pdf).abs() < 1e-12);
                let back = warps.invert(2, drawn.direction, &mixed).unwrap();
                // At the pole all azimuths are one.
                assert!(
                    (back[0] - u[0]).abs() < 1e-7 && (u[0] == 0.0 || (back[1] - u[1]).abs() < 1e-7),
                    "{u:?} {back:?}"
                );
            }
        }
        // One bright leaf: every sample is in it, for any corner of the square.
        for bright in 0..mesh.len() {
            let one = Warps::new(Arc::clone(warps.mesh()), 1, |_, integrals, _| {
                integrals[bright] = 3.0e38;
                integrals[(bright + 1) % mesh.len()] = f64::NAN;
                integrals[(bright + 2) % mesh.len()] = -1.0;
            });
            for u in [[0.0, 0.0], [1.0, 1.0], [0.0, 1.0], [1.0, 0.0], [0.3, 0.9]] {
                for density in DENSITIES {
                    let drawn = one.sample(0, u, &options(None, density, 0.0)).unwrap();
                    assert_eq!((drawn.leaf, mesh.locate(drawn.direction)), (bright, Some(bright)));
                    assert!(drawn.pdf > 0.0);
                }
            }
            let dark = mesh.centroid((bright + 1) % mesh.len());
            assert_eq!(one.pdf(0, dark, &options(None, Density::Linear, 0.0)), 0.0);
        }
    }
}

#[test]
fn with_a_defensive_part_every_direction_of_the_domain_is_drawn() {
    let mut rng = Pcg32::new(26, 1);
    for warps in all(0..=3) {
        let mesh = warps.mesh().mesh();
        for _ in 0..2_000 {
            let wo = Direction::from_radians((2.0 * rng.random::<f64>() - 1.0).acos(), 7.0 * rng.random::<f64>());
            let pdf = warps.pdf(0, wo, &options(None, Density::Linear, 0.05));
            assert_eq!(pdf > 0.0, mesh.locate(wo).is_some());
        }
    }
}

#[test]
fn memory_is_four_bytes_a_triangle_of_any_level_and_a_vertex() {
    let warps = warps(Domain::Hemisphere, 4, Measure::Projected);
    // 3 cells of 4 + 16 + … + 1024 triangles (the root group has four empty places) and 545 vertices.
    let expected = 3 * (4 * (4 + 4 + 16 + 64 + 256 + 1024) + 4 * 545 + 8);
    assert_eq!(warps.memory() - size_of::<Warps>(), expected);
    assert!(warps.mesh().memory() < 150_000, "{}", warps.mesh().memory());
}
