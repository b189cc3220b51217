//! Reproduces Table 9 of \[CPB06\]: the remaining variance, level by level, on an analytic surface.
//!
//! The surface is GGX (α = 0.2, height-correlated Smith shadowing, Schlick's Fresnel term with F0 = 0.04) over a
//! diffuse base 0.5·(0.6 + 0.4/(1 + e^(−(λ−520)/30)))/π, 380 to 750 nm every 5 nm. The tree is built from cell
//! integrals of the mean over wavelengths at the exact wi. Variances are those of f·cos/pdf with the analytic f.

use super::{Density, Measure, SampleOptions, WarpMesh, Warps};
use crate::domain::{Direction, Domain, TriangleMesh};
use rand::RngExt;
use rand_pcg::Pcg32;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

fn lambdas() -> impl Iterator<Item = f64> {
    (0..75).map(|i| 380.0 + 5.0 * f64::from(i))
}

fn diffuse(lambda: f64) -> f64 {
    0.5 * (0.6 + 0.4 / (1.0 + (-(lambda - 520.0) / 30.0).exp())) / PI
}

fn mean_diffuse() -> f64 {
    lambdas().map(diffuse).sum::<f64>() / 75.0
}

/// Returns the GGX specular BRDF in sr⁻¹ with roughness α = 0.2, height-correlated Smith shadowing and a reflectance of
/// 0.04 at normal incidence.
fn ggx(wi: [f64; 3], wo: [f64; 3]) -> f64 {
    let a2 = 0.04;
    let sum = [0, 1, 2].map(|k| wi[k] + wo[k]);
    let length = sum.iter().map(|x| x * x).sum::<f64>().sqrt();
    let h = sum.map(|x| x / length);
    let ndf = a2 / (PI * (h[2] * h[2] * (a2 - 1.0) + 1.0).powi(2));
    let lambda = |c: f64| 0.5 * ((1.0 + a2 * (1.0 / (c * c) - 1.0)).sqrt() - 1.0);
    let shadowing = 1.0 / (1.0 + lambda(wi[2]) + lambda(wo[2]));
    let cosine = wi.iter().zip(h).map(|(a, b)| a * b).sum::<f64>();
    ndf * shadowing * (0.04 + 0.96 * (1.0 - cosine).powi(5)) / (4.0 * wi[2] * wo[2])
}

/// Mean over wavelengths of f·cos θo of the test surface.
fn value(wi: [f64; 3], wo: [f64; 3]) -> f64 {
    let z = wo[2].max(1e-9);
    (mean_diffuse() + ggx(wi, [wo[0], wo[1], z])) * z
}

/// Test surface under one incoming direction, with its sampling tree.
struct Scene {
    wi: [f64; 3],
    warps: Warps,
}

impl Scene {
    fn new(mesh: &Arc<WarpMesh>, wi: Direction) -> Self {
        let wi = wi.xyz();
        // 64 pieces of every leaf.
        let fine = TriangleMesh::new(Domain::Hemisphere, mesh.mesh().level() + 3).unwrap();
        let points = mesh.vertices().to_vec();
        let angles: Vec<f64> = fine.all_vertices().into_iter().map(crate::domain::solid_angle).collect();
        let warps = Warps::new(Arc::clone(mesh), 1, |_, integrals, values| {
            for (i, vertices) in fine.all_vertices().into_iter().enumerate() {
                integrals[i / 64] += value(wi, crate::domain::centroid(vertices).xyz()) * angles[i];
            }
            values.iter_mut().zip(&points).for_each(|(to, point)| *to = value(wi, point.xyz()));
        });
        Self { wi, warps }
    }

    /// Mean and variance of the sample weights f·cos/pdf over `n` × `n` jittered points.
    fn moments(&self, n: usize, options: &SampleOptions) -> [f64; 2] {
        moments(n, |u| {
            let drawn = self.warps.sample(0, u, options).unwrap();
            value(self.wi, drawn.direction.xyz()) / drawn.pdf
        })
    }

    fn uniform(&self, n: usize) -> [f64; 2] {
        moments(n, |[u, v]| {
            let r = (1.0 - u * u).sqrt();
            value(self.wi, [r * (TAU * v).cos(), r * (TAU * v).sin(), u]) * TAU
        })
    }
}

/// Returns mean and variance of `weight` over one random point in each cell of an n × n grid on the unit square,
/// accurate to about a percent.
fn moments(n: usize, weight: impl Fn([f64; 2]) -> f64) -> [f64; 2] {
    let mut rng = Pcg32::new(0x7a_b1e9, 1);
    let mut sums = [0.0; 2];
    for i in 0..n * n {
        let u = [i / n, i % n].map(|k| (k as f64 + rng.random::<f64>()) / n as f64);
        let w = weight(u);
        sums[0] += w;
        sums[1] += w * w;
    }
    let [mean, square] = sums.map(|s| s / (n * n) as f64);
    [mean, square - mean * mean]
}

fn hemisphere() -> Arc<WarpMesh> {
    Arc::new(WarpMesh::new(TriangleMesh::new(Domain::Hemisphere, 4).unwrap(), Measure::Projected))
}

/// Variance of f·cos/pdf, averaged over incoming directions and divided by that of uniform sampling: for densities
/// constant and linear inside triangles, and for sampling trees that follow the function down to subdivision level 0,
/// 1, 2, 3 or 4.
fn table(mesh: &Arc<WarpMesh>, cosines: [f64; 2]) -> [[f64; 5]; 2] {
    let mut rng = Pcg32::new(0x7_ab1e, 9);
    let (mut uniform, mut tree) = (0.0, [[0.0; 5]; 2]);
    for _ in 0..24 {
        let z: f64 = cosines[0] + (cosines[1] - cosines[0]) * rng.random::<f64>();
        let scene = Scene::new(mesh, Direction::from_radians(z.acos(), TAU * rng.random::<f64>()));
        let [reference, variance] = scene.uniform(200);
        uniform += variance;
        for (which, density) in [Density::Uniform, Density::Linear].into_iter().enumerate() {
            for level in 0..5 {
                let options = SampleOptions { level: Some(level), density, defensive: 0.0 };
                let [mean, variance] = scene.moments(100, &options);
                assert!((mean / reference - 1.0).abs() < 0.05, "{mean} {reference}");
                tree[which][usize::from(level)] += variance;
            }
        }
    }
    tree.map(|densities| densities.map(|variance| variance / uniform))
}

#[test]
fn table_9() {
    let mesh = hemisphere();
    let front = table(&mesh, [0.5, 1.0]);
    let all = table(&mesh, [0.05, 1.0]);
    println!("variance over that of uniform sampling, end levels 0 to 4 (the paper: .39 .22 .15 .13 .13)");
    for (name, [constant, linear]) in [("cos θi 0.50 to 1", front), ("cos θi 0.05 to 1", all)] {
        println!("{name}  constant {constant:.4?}");
        println!("{name}  linear   {linear:.4?}");
    }
    for (level, bound) in [0.12, 0.06, 0.03, 0.01, 0.005].into_iter().enumerate() {
        assert!(front[1][level] <= bound, "level {level}: {}", front[1][level]);
    }
    for (level, bound) in [(2, 0.14), (3, 0.05), (4, 0.02)] {
        assert!(all[1][level] <= bound, "level {level}: {}", all[1][level]);
    }
}

/// Tests the variance of the weight f·cos/pdf of drawn directions relative to its squared mean, averaged over four
/// incoming directions. The descent of the sampling tree ends at the finest triangles. Cases: piecewise constant f with
/// a constant density (only the cosine varies in a triangle), and the analytic f with constant and linear densities.
#[test]
fn the_weight_hardly_varies_at_level_4() {
    let mesh = hemisphere();
    let mut relative = [0.0; 3];
    for theta in [0.0, 20.0, 40.0, 60.0] {
        let scene = Scene::new(&mesh, Direction::from_degrees(theta, 33.0));
        let constant = SampleOptions { density: Density::Uniform, ..SampleOptions::default() };
        let piecewise = moments(300, |u| {
            let drawn = scene.warps.sample(0, u, &constant).unwrap();
            scene.warps.mean(0, drawn.leaf) * drawn.direction.cos_theta() / drawn.pdf
        });
        let all = [piecewise, scene.moments(300, &constant), scene.moments(300, &SampleOptions::default())];
        for (sum, [mean, variance]) in relative.iter_mut().zip(all) {
            *sum += 0.25 * variance / (mean * mean);
        }
    }
    let [piecewise, constant, linear] = relative;
    println!("relative variance of the weight: f piecewise constant {piecewise:.5}; f analytic, density constant");
    println!("{constant:.5}, linear {linear:.5}");
    assert!(piecewise <= 0.005 && constant <= 0.006 && linear <= 0.0002, "{relative:?}");
}
