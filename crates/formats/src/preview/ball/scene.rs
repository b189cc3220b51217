//! Camera, lights, ground, and what of them a pixel sees.

use super::super::error::PreviewError;
use super::lattice::{Rgb, Vector};
use super::shade::shaded;
use super::surface::{Side, Surface};
use crate::domain::vector::{add, cross, dot, norm, scale, sub, unit};
use rayon::prelude::*;

/// The ball has radius 1 about the origin and stands on the ground at z = −1; x is to the right, y away from the camera.
pub(super) struct Scene<'a> {
    surface: &'a Surface<'a>,
    size: usize,
    eye: Vector,
    /// To the right, up and ahead; the first two as long as half the picture is wide, one unit ahead.
    frame: [Vector; 3],
    /// What the reference direction runs round.
    axis: Vector,
    /// Distant light: points, and the irradiance of each across it.
    lights: Vec<(Vector, f32)>,
    /// Points of the key light, for its shadow.
    key: Vec<Vector>,
    /// Points of the lamp inside, and the irradiance of each at distance 1.
    lamp: Option<(Vec<Vector>, f32)>,
    uniform: f32,
    gradient: f32,
}

/// A rectangular light far away.
#[derive(Clone, Copy)]
struct Panel {
    towards: Vector,
    /// Half its width and height as tangents.
    half: [f64; 2],
    /// In all, across it.
    irradiance: f64,
}

/// What a pixel sees.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Pixel {
    /// How much of it is ball.
    pub(super) coverage: f32,
    /// The mean radiance of that part, linear sRGB.
    pub(super) ball: Rgb,
    /// The rest, in gamut.
    pub(super) ground: Rgb,
}

/// Parts of a pixel on the edge of the ball, along a side.
const EDGE: usize = 4;
const DISTANCE: f64 = 7.0;
/// Where the camera looks at, below the middle of the ball.
const AIM: f64 = -0.07;
/// Half the width of the picture in radii.
const WIDTH: f64 = 1.24;

/// The key light, from above on the left, and the strip from behind on the right.
const KEY: Panel = Panel { towards: [-0.62, -0.62, 0.72], half: [0.30, 0.30], irradiance: 2.35 };
const STRIP: Panel = Panel { towards: [0.95, 0.30, 0.42], half: [0.10, 0.42], irradiance: 1.1 };
/// Points of a light along 0.6 of a tangent: as many as it takes.
const POINTS: [usize; 6] = [3, 4, 6, 9, 13, 19];
/// What points that are enough may leave to finer ones, in parts of the brightest place.
const ENOUGH: f32 = 0.01;
/// Places of a highlight that are looked at for that, along a side of a quarter of it.
const PROBES: usize = 5;

impl<'a> Scene<'a> {
    pub(super) fn of(surface: &'a Surface<'a>, size: usize) -> Result<Self, PreviewError> {
        let eye = scale(unit([0.0, -1.0, 0.23]), DISTANCE);
        let ahead = unit([-eye[0], -eye[1], AIM - eye[2]]);
        let right = [1.0, 0.0, 0.0];
        let up = cross(right, ahead);
        let half = WIDTH / DISTANCE;
        let through = surface.has(Side::Transmitted);
        // With a lamp inside, the room is darker.
        let room = if through { 0.45 } else { 1.0 };
        let lamp = through.then(|| {
            let centre = [0.0, -0.05, -0.12];
            let point = |i: usize| {
                let around = std::f64::consts::TAU * i as f64 / 6.0;
                [centre[0] + 0.08 * libm::cos(around), centre[1], centre[2] + 0.08 * libm::sin(around)]
            };
            let points: Vec<Vector> = (0..6).map(point).chain([centre]).collect();
            let each = 2.6 / points.len() as f32;
            (points, each)
        });
        let mut scene = Self {
            surface,
            size,
            eye,
            frame: [scale(right, half), scale(up, half), ahead],
            axis: up,
            lights: Vec::new(),
            key: Vec::new(),
            lamp,
            uniform: room as f32 * 0.20,
            gradient: room as f32 * 0.14,
        };
        if surface.has(Side::Reflected) {
            scene.key = KEY.points(POINTS[2]).into_iter().map(|(point, _)| point).collect();
            for panel in [KEY, STRIP] {
                let panel = Panel { irradiance: room * panel.irradiance, ..panel };
                let points = scene.enough(panel)?;
                scene.lights.extend(points);
            }
        }
        Ok(scene)
    }

    pub(super) fn pixels(&self) -> Result<Vec<Pixel>, PreviewError> {
        let size = self.size;
        let mut pixels = vec![Pixel::default(); size * size];
        pixels.par_chunks_mut(size).enumerate().for_each(|(y, row)| {
            for (x, pixel) in row.iter_mut().enumerate() {
                pixel.coverage = self.coverage(x, y);
                if pixel.coverage < 1.0 {
                    pixel.ground = self.ground(self.ray(x, y, 0.5, 0.5));
                }
            }
        });
        let wanted: Vec<bool> = pixels.iter().map(|pixel| pixel.coverage > 0.0).collect();
        let radiance = |spectrum: &mut Vec<f32>, x: usize, y: usize| {
            let normal = self.nearest(self.ray(x, y, 0.5, 0.5));
            self.radiance(normal, &self.lights, true, spectrum)
        };
        let ball = shaded(size, &wanted, || self.surface.spectrum(), radiance)?;
        for (pixel, ball) in pixels.iter_mut().zip(ball).filter(|(pixel, _)| pixel.coverage > 0.0) {
            pixel.ball = ball;
        }
        Ok(pixels)
    }

    /// The points that stand for a light on this surface: on a rough one few do, a glossy one shows each of them.
    fn enough(&self, panel: Panel) -> Result<Vec<(Vector, f32)>, PreviewError> {
        let [middle, right, up] = panel.frame();
        let mirror = unit(add(unit(self.eye), middle));
        let mut normals = Vec::new();
        for i in 0..PROBES * PROBES {
            // From the middle of its image to beyond a corner.
            let [u, v] = [i % PROBES, i / PROBES].map(|k| 0.75 * k as f64 / PROBES as f64);
            let apart = add(scale(right, u * panel.half[0]), scale(up, v * panel.half[1]));
            normals.push(unit(add(mirror, apart)));
        }
        let lit = |points: &[(Vector, f32)]| -> Result<Vec<Rgb>, PreviewError> {
            let one = |spectrum: &mut Vec<f32>, normal: &Vector| self.radiance(*normal, points, false, spectrum);
            normals.par_iter().map_init(|| self.surface.spectrum(), one).collect()
        };
        let mut points = panel.points(POINTS[0]);
        let mut coarse = lit(&points)?;
        for count in &POINTS[1..] {
            let finer = panel.points(*count);
            let fine = lit(&finer)?;
            let brightest = fine.as_flattened().iter().fold(0.0_f32, |most, c| most.max(*c));
            let off = fine.as_flattened().iter().zip(coarse.as_flattened()).map(|(a, b)| (a - b).abs());
            if off.fold(0.0, f32::max) <= ENOUGH * brightest {
                break;
            }
            (points, coarse) = (finer, fine);
        }
        Ok(points)
    }

    /// How much of a pixel is ball.
    fn coverage(&self, x: usize, y: usize) -> f32 {
        let clearance = 1.0 - norm(self.closest(self.ray(x, y, 0.5, 0.5)));
        let pixel = 2.0 * WIDTH / self.size as f64;
        if clearance.abs() > pixel {
            return if clearance > 0.0 { 1.0 } else { 0.0 };
        }
        let hits = (0..EDGE * EDGE)
            .filter(|part| {
                let [s, t] = [part % EDGE, part / EDGE].map(|k| (k as f64 + 0.5) / EDGE as f64);
                first(self.eye, self.ray(x, y, s, t)).is_some()
            })
            .count();
        hits as f32 / (EDGE * EDGE) as f32
    }

    /// The direction in which the part (s, t) of a pixel looks.
    fn ray(&self, x: usize, y: usize, s: f64, t: f64) -> Vector {
        let u = 2.0 * (x as f64 + s) / self.size as f64 - 1.0;
        let v = 1.0 - 2.0 * (y as f64 + t) / self.size as f64;
        let [right, up, ahead] = self.frame;
        unit([0, 1, 2].map(|k| u * right[k] + v * up[k] + ahead[k]))
    }

    /// Where a ray from the eye comes closest to the middle of the ball.
    fn closest(&self, ray: Vector) -> Vector {
        sub(self.eye, scale(ray, dot(self.eye, ray)))
    }

    /// Where a ray from the eye meets the ball, or the point of its rim that is next to it.
    fn nearest(&self, ray: Vector) -> Vector {
        let distance = first(self.eye, ray);
        unit(distance.map_or_else(|| self.closest(ray), |distance| add(self.eye, scale(ray, distance))))
    }

    /// What the ball sends from `normal`, which is also its point, to the eye: of `lights`, and of what else there is. What is
    /// masked is taken to be like the rest; NaN where all is.
    fn radiance(
        &self,
        normal: Vector,
        lights: &[(Vector, f32)],
        else_too: bool,
        spectrum: &mut [f32],
    ) -> Result<Rgb, PreviewError> {
        // The reference direction runs round an axis that is upright in the picture: its poles are on the edge of the ball.
        let along = cross(self.axis, normal);
        let length = norm(along);
        let x = if length > 1e-9 { scale(along, 1.0 / length) } else { [1.0, 0.0, 0.0] };
        let y = cross(normal, x);
        let local = |w: Vector| [dot(w, x), dot(w, y), dot(w, normal)];
        let mut wo = local(unit(sub(self.eye, normal)));
        wo[2] = wo[2].max(1e-4);
        let mut sum = Sum::default();
        for &(direction, irradiance) in lights {
            let wi = local(direction);
            if wi[2] > 0.0 {
                sum.add(self.surface.at(Side::Reflected, wi, wo, spectrum)?, irradiance * wi[2] as f32);
            }
        }
        if !else_too {
            return Ok(sum.mean());
        }
        if let Some((points, irradiance)) = &self.lamp {
            for point in points {
                let to = sub(*point, normal);
                let distance = norm(to);
                let [a, b, c] = local(scale(to, 1.0 / distance));
                // The light is on the inner side, which is the surface's upper one; the eye on the other.
                let light = irradiance * (-c) as f32 / (distance * distance) as f32;
                sum.add(self.surface.at(Side::Transmitted, [a, b, -c], wo, spectrum)?, light);
            }
        }
        let mut radiance = sum.mean();
        if self.surface.has(Side::Reflected) {
            let around = self.surface.surrounded(wo, [x[2], y[2], normal[2]], self.uniform, self.gradient);
            radiance = [0, 1, 2].map(|k| radiance[k] + around[k]);
        }
        Ok(radiance)
    }

    /// Ground that runs up into a wall, with the ball's shadow.
    fn ground(&self, ray: Vector) -> Rgb {
        let wall = 0.017;
        let tint = |light: f64| [0.96, 1.0, 1.06].map(|c| (c * light) as f32);
        if ray[2] >= -1e-3 {
            return tint(wall);
        }
        let distance = (-1.0 - self.eye[2]) / ray[2];
        let point = [self.eye[0] + distance * ray[0], self.eye[1] + distance * ray[1], -1.0];
        let from_ball = (point[0] * point[0] + point[1] * point[1]).sqrt();
        let lit = self.key.iter().filter(|light| first(point, **light).is_none()).count();
        let lit = if self.key.is_empty() { 0.35 } else { lit as f64 / self.key.len() as f64 };
        // The part of a hemisphere that a ball of radius 1 hides, weighted by the cosine.
        let apart = from_ball * from_ball + 1.0;
        let open = 1.0 - 1.0 / (apart * apart.sqrt());
        let far = 1.0 / (1.0 + 0.045 * (from_ball * from_ball));
        let light = 0.085 * far * (0.70 * lit + 0.30 * open * open);
        // What is far is wall.
        tint(light + wall * (1.0 - far))
    }
}

/// The distance at which a ray meets the ball.
fn first(from: Vector, ray: Vector) -> Option<f64> {
    let middle = -dot(from, ray);
    let apart = dot(from, from) - middle * middle;
    (apart < 1.0 && middle > 0.0).then(|| middle - (1.0 - apart).sqrt())
}

/// Light that was added up, where it is known.
#[derive(Default)]
struct Sum {
    light: Rgb,
    known: f32,
    all: f32,
}

impl Sum {
    fn add(&mut self, value: Rgb, light: f32) {
        self.all += light;
        if value.iter().all(|c| !c.is_nan()) {
            self.known += light;
            self.light = [0, 1, 2].map(|k| self.light[k] + light * value[k]);
        }
    }

    fn mean(self) -> Rgb {
        if self.known == self.all { self.light } else { self.light.map(|c| c * (self.all / self.known)) }
    }
}

impl Panel {
    /// Its middle, to the right and up, in unit vectors.
    fn frame(self) -> [Vector; 3] {
        let middle = unit(self.towards);
        let right = unit(cross([0.0, 0.0, 1.0], middle));
        [middle, right, cross(middle, right)]
    }

    /// The middles of equal parts, `fine` along 0.6 of a tangent; with the irradiance of each.
    fn points(self, fine: usize) -> Vec<(Vector, f32)> {
        let [middle, right, up] = self.frame();
        let [columns, rows] = self.half.map(|half| libm::ceil(fine as f64 * half / 0.30 - 1e-9) as usize);
        let each = (self.irradiance / (columns * rows) as f64) as f32;
        let point = |i: usize| {
            let u = self.half[0] * (2.0 * ((i % columns) as f64 + 0.5) / columns as f64 - 1.0);
            let v = self.half[1] * (2.0 * ((i / columns) as f64 + 0.5) / rows as f64 - 1.0);
            (unit([0, 1, 2].map(|k| middle[k] + u * right[k] + v * up[k])), each)
        };
        (0..columns * rows).map(point).collect()
    }
}
