//! Camera, lights, ground, and what of them a pixel sees.

use super::lattice::{Rgb, Vector};
use super::lobes::{Lobes, Side};
use crate::domain::vector::{cross, dot, norm, scale, unit};

/// The ball has radius 1 about the origin and stands on the ground at z = −1; x is to the right, y away from the camera.
pub(super) struct Scene<'a> {
    lobes: &'a Lobes,
    size: usize,
    eye: Vector,
    /// To the right, up and ahead; the first two as long as half the picture is wide, one unit ahead.
    frame: [Vector; 3],
    /// What the reference direction runs round.
    axis: Vector,
    /// Distant light: direction, irradiance across it.
    lights: Vec<(Vector, f32)>,
    key: usize,
    /// Points of the lamp inside, and the irradiance of each at distance 1.
    lamp: Option<(Vec<Vector>, f32)>,
    uniform: f32,
    gradient: f32,
    /// Shaded parts of a pixel of the ball, along a side.
    parts: usize,
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

impl<'a> Scene<'a> {
    pub(super) fn of(lobes: &'a Lobes, size: usize) -> Self {
        let eye = scale(unit([0.0, -1.0, 0.23]), DISTANCE);
        let ahead = unit([-eye[0], -eye[1], AIM - eye[2]]);
        let right = [1.0, 0.0, 0.0];
        let up = cross(right, ahead);
        let half = WIDTH / DISTANCE;
        let through = lobes.has(Side::Transmitted);
        let reflects = lobes.has(Side::Reflected);
        let mut lights = Vec::new();
        // With a lamp inside, the room is darker.
        let room = if through { 0.45 } else { 1.0 };
        if reflects {
            panel(&mut lights, [-0.62, -0.62, 0.72], [0.30, 0.30], 5, 5, room * 2.35);
        }
        let key = lights.len();
        if reflects {
            panel(&mut lights, [0.95, 0.30, 0.42], [0.10, 0.42], 2, 6, room * 1.1);
        }
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
        Self {
            lobes,
            size,
            eye,
            frame: [scale(right, half), scale(up, half), ahead],
            axis: up,
            lights,
            key,
            lamp,
            uniform: room as f32 * 0.20,
            gradient: room as f32 * 0.14,
            parts: if size > 160 { 1 } else { 2 },
        }
    }

    pub(super) fn pixel(&self, x: usize, y: usize) -> Pixel {
        let corners = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (0.5, 0.5)];
        let inside = corners.iter().filter(|&&(s, t)| self.hit(self.ray(x, y, s, t)).is_some()).count();
        let mut pixel = Pixel::default();
        if inside < corners.len() {
            pixel.ground = self.ground(self.ray(x, y, 0.5, 0.5));
        }
        if inside == 0 {
            return pixel;
        }
        let parts = if inside == corners.len() { self.parts } else { EDGE };
        let mut hits = 0;
        for part in 0..parts * parts {
            let s = ((part % parts) as f64 + 0.5) / parts as f64;
            let t = ((part / parts) as f64 + 0.5) / parts as f64;
            let ray = self.ray(x, y, s, t);
            if let Some(point) = self.hit(ray) {
                let radiance = self.radiance(point, ray);
                pixel.ball = [0, 1, 2].map(|k| pixel.ball[k] + radiance[k]);
                hits += 1;
            }
        }
        pixel.coverage = hits as f32 / (parts * parts) as f32;
        pixel.ball = pixel.ball.map(|c| c / hits.max(1) as f32);
        pixel
    }

    /// The direction in which the part (s, t) of a pixel looks.
    fn ray(&self, x: usize, y: usize, s: f64, t: f64) -> Vector {
        let u = 2.0 * (x as f64 + s) / self.size as f64 - 1.0;
        let v = 1.0 - 2.0 * (y as f64 + t) / self.size as f64;
        let [right, up, ahead] = self.frame;
        unit([0, 1, 2].map(|k| u * right[k] + v * up[k] + ahead[k]))
    }

    /// Where a ray from the eye meets the ball.
    fn hit(&self, ray: Vector) -> Option<Vector> {
        let distance = first(self.eye, ray)?;
        Some(unit([0, 1, 2].map(|k| self.eye[k] + distance * ray[k])))
    }

    /// What the ball sends from `normal`, which is also its point, against `ray`.
    fn radiance(&self, normal: Vector, ray: Vector) -> Rgb {
        // The reference direction runs round an axis that is upright in the picture: its poles are on the edge of the ball.
        let along = cross(self.axis, normal);
        let length = norm(along);
        let x = if length > 1e-9 { scale(along, 1.0 / length) } else { [1.0, 0.0, 0.0] };
        let y = cross(normal, x);
        let local = |w: Vector| [dot(w, x), dot(w, y), dot(w, normal)];
        let mut wo = local(scale(ray, -1.0));
        wo[2] = wo[2].max(1e-4);
        let mut sum = [0.0; 3];
        let mut add = |value: Rgb, light: f32| sum = [0, 1, 2].map(|k| sum[k] + light * value[k]);
        for &(direction, irradiance) in &self.lights {
            let wi = local(direction);
            if wi[2] > 0.0 {
                add(self.lobes.at(Side::Reflected, wi, wo), irradiance * wi[2] as f32);
            }
        }
        if self.lobes.has(Side::Reflected) {
            let up = [x[2], y[2], normal[2]];
            add(self.lobes.surrounded(wo, up, self.uniform, self.gradient), 1.0);
        }
        if let Some((points, irradiance)) = &self.lamp {
            for point in points {
                let to = [0, 1, 2].map(|k| point[k] - normal[k]);
                let distance = norm(to);
                let [a, b, c] = local(scale(to, 1.0 / distance));
                // The light is on the inner side, which is the surface's upper one; the eye on the other.
                let light = irradiance * (-c) as f32 / (distance * distance) as f32;
                add(self.lobes.at(Side::Transmitted, [a, b, -c], wo), light);
            }
        }
        sum
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
        let key = &self.lights[..self.key];
        let lit = key.iter().filter(|(light, _)| first(point, *light).is_none()).count();
        let lit = if key.is_empty() { 0.35 } else { lit as f64 / key.len() as f64 };
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

/// A square light as points: around a direction, `half` its half width and height as tangents, `columns` × `rows` of
/// them; `irradiance` is the sum across it.
fn panel(
    lights: &mut Vec<(Vector, f32)>,
    towards: Vector,
    half: [f64; 2],
    columns: usize,
    rows: usize,
    irradiance: f64,
) {
    let middle = unit(towards);
    let right = unit(cross([0.0, 0.0, 1.0], middle));
    let up = cross(middle, right);
    let each = (irradiance / (columns * rows) as f64) as f32;
    for i in 0..columns * rows {
        let u = half[0] * (2.0 * ((i % columns) as f64 + 0.5) / columns as f64 - 1.0);
        let v = half[1] * (2.0 * ((i / columns) as f64 + 0.5) / rows as f64 - 1.0);
        lights.push((unit([0, 1, 2].map(|k| middle[k] + u * right[k] + v * up[k])), each));
    }
}
