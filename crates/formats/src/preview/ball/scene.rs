//! Camera, lights and ground, and the part of them seen by each pixel.

use super::super::error::PreviewError;
use super::lattice::{Rgb, Vector};
use super::shade::shaded;
use super::surface::{Side, Surface};
use crate::domain::vector::{add, cross, dot, norm, scale, sub, unit};
use rayon::prelude::*;

/// Scene of a preview: a ball of radius 1 at the origin lies on the ground at z = −1. x points to the right, y away
/// from the camera.
pub(super) struct Scene<'a> {
    surface: &'a Surface<'a>,
    size: usize,
    eye: Vector,
    /// Camera axes to the right, up and ahead. The axes to the right and up are scaled to half the picture's width at
    /// unit distance.
    frame: [Vector; 3],
    /// Axis of the rendered ball, vertical in the picture; the surface's x axis follows the latitude circles about it.
    axis: Vector,
    /// Directions to the points of distant lights, with the irradiance of each on a surface facing it.
    lights: Vec<(Vector, f32)>,
    /// Directions from the rendered ball to points of the main light, from which the ball's shadow on the ground is
    /// computed.
    key: Vec<Vector>,
    /// Points of the lamp inside a translucent ball, and the irradiance of each at distance 1; `None` for an opaque
    /// ball.
    lamp: Option<(Vec<Vector>, f32)>,
    uniform: f32,
    gradient: f32,
}

/// Rectangular light at infinite distance that lights the rendered ball in the preview picture of a material.
#[derive(Clone, Copy)]
struct Panel {
    towards: Vector,
    /// Tangents of half the angular width, and of half the angular height, of a rectangular light as seen from the
    /// rendered ball.
    half: [f64; 2],
    /// Total irradiance of the light on a surface that faces `towards`.
    irradiance: f64,
}

/// Radiance of the ball and colour of the ground in one pixel of a material's preview picture, with the fraction of the
/// pixel that the ball covers.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Pixel {
    /// Fraction, 0 to 1, of a pixel of the preview picture that the rendered ball covers.
    pub(super) coverage: f32,
    /// Mean radiance of the ball in the covered part of the pixel, in linear sRGB.
    pub(super) ball: Rgb,
    /// Colour of the ground that shows beside the ball in this pixel, in linear sRGB within the gamut.
    pub(super) ground: Rgb,
}

/// Number of subpixels along a side of a pixel at the edge of the ball. Raising it smooths the edge.
const EDGE: usize = 4;
const DISTANCE: f64 = 7.0;
/// Height of the point that the camera looks at, relative to the centre of the ball, in radii of the ball. Raising it
/// moves the ball down in the picture.
const AIM: f64 = -0.07;
/// Half of the picture's width at the distance of the ball, in radii of the ball. Raising it shows the ball smaller.
const WIDTH: f64 = 1.24;

/// Key light of the scene from above on the left, and a strip light from behind on the right.
const KEY: Panel = Panel { towards: [-0.62, -0.62, 0.72], half: [0.30, 0.30], irradiance: 2.35 };
const STRIP: Panel = Panel { towards: [0.95, 0.30, 0.42], half: [0.10, 0.42], irradiance: 1.1 };
/// Candidate numbers of points that represent a rectangular light, counted along a side that is 0.6 long at unit
/// distance; tried in this order.
const POINTS: [usize; 6] = [3, 4, 6, 9, 13, 19];
/// Largest difference in radiance on the ball at which fewer points may represent a rectangular light, as a fraction of
/// the brightest of the compared radiances. Raising it is faster and shows single points in glossy highlights.
const ENOUGH: f32 = 0.01;
/// Number of points, along a side of a square grid on a quarter of a highlight, at which the ball is rendered to
/// compare a light of fewer points with one of more. Raising it is slower and finds more differences.
const PROBES: usize = 5;

impl<'a> Scene<'a> {
    pub(super) fn of(surface: &'a Surface<'a>, size: usize) -> Result<Self, PreviewError> {
        let eye = scale(unit([0.0, -1.0, 0.23]), DISTANCE);
        let ahead = unit([-eye[0], -eye[1], AIM - eye[2]]);
        let right = [1.0, 0.0, 0.0];
        let up = cross(right, ahead);
        let half = WIDTH / DISTANCE;
        let through = surface.has(Side::Transmitted);
        // A lamp inside requires a darker room.
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

    /// Returns the fewest point lights that light this ball almost like a rectangular light: direction and irradiance
    /// of each. A rough surface needs few; a glossy one would show each of them.
    fn enough(&self, panel: Panel) -> Result<Vec<(Vector, f32)>, PreviewError> {
        let [middle, right, up] = panel.frame();
        let mirror = unit(add(unit(self.eye), middle));
        let mut normals = Vec::new();
        for i in 0..PROBES * PROBES {
            // From the centre of the light's image to beyond a corner.
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

    /// Returns the fraction, 0 to 1, of pixel (x, y) of the preview picture that the rendered ball covers.
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

    /// Returns the viewing direction of the camera through the position (s, t) within pixel (x, y); s and t are 0 to 1.
    fn ray(&self, x: usize, y: usize, s: f64, t: f64) -> Vector {
        let u = 2.0 * (x as f64 + s) / self.size as f64 - 1.0;
        let v = 1.0 - 2.0 * (y as f64 + t) / self.size as f64;
        let [right, up, ahead] = self.frame;
        unit([0, 1, 2].map(|k| u * right[k] + v * up[k] + ahead[k]))
    }

    /// Returns the point of a ray from the camera that is closest to the centre of the ball.
    fn closest(&self, ray: Vector) -> Vector {
        sub(self.eye, scale(ray, dot(self.eye, ray)))
    }

    /// Returns the point where a ray from the camera meets the ball, or the nearest point of the ball's rim.
    fn nearest(&self, ray: Vector) -> Vector {
        let distance = first(self.eye, ray);
        unit(distance.map_or_else(|| self.closest(ray), |distance| add(self.eye, scale(ray, distance))))
    }

    /// Returns the radiance towards the camera from the point of the rendered ball with the outward normal `normal`,
    /// lit by `lights`. Masked samples count as the mean of the other samples; the result is NaN if all are masked.
    ///
    /// If `else_too` is true, light from the surroundings is added, and that of the lamp inside a translucent ball.
    fn radiance(
        &self,
        normal: Vector,
        lights: &[(Vector, f32)],
        else_too: bool,
        spectrum: &mut [f32],
    ) -> Result<Rgb, PreviewError> {
        // The reference direction follows latitude circles about the picture's vertical axis, whose poles are at the
        // edge of the ball.
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
                // The light is on the inner side, which is the surface's upper side; the eye is on the other.
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

    /// Returns the colour of the ground, with the ball's shadow, in a viewing direction. The ground rises into a wall
    /// at the back.
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
        // Cosine-weighted fraction of the hemisphere hidden by a ball of radius 1.
        let apart = from_ball * from_ball + 1.0;
        let open = 1.0 - 1.0 / (apart * apart.sqrt());
        let far = 1.0 / (1.0 + 0.045 * (from_ball * from_ball));
        let light = 0.085 * far * (0.70 * lit + 0.30 * open * open);
        // Distant ground is wall.
        tint(light + wall * (1.0 - far))
    }
}

/// Returns the distance along a ray from its start to the point where it first meets the rendered ball, a unit sphere
/// about the origin. Returns `None` if it misses the ball.
fn first(from: Vector, ray: Vector) -> Option<f64> {
    let middle = -dot(from, ray);
    let apart = dot(from, from) - middle * middle;
    (apart < 1.0 && middle > 0.0).then(|| middle - (1.0 - apart).sqrt())
}

/// Sum of the light that a point of the ball reflects towards the camera, over the lights for which the material has
/// values. Also sums the irradiance of these lights, and that of all lights.
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
    /// Returns three orthogonal unit vectors: from the rendered ball to the centre of a rectangular light, along the
    /// width of the light to the right, and along its height upwards.
    fn frame(self) -> [Vector; 3] {
        let middle = unit(self.towards);
        let right = unit(cross([0.0, 0.0, 1.0], middle));
        [middle, right, cross(middle, right)]
    }

    /// Divides a rectangular light into equal parts, and returns the direction to the centre of each with its
    /// irradiance. `fine` is the number of parts along a side that is 0.6 long at unit distance.
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
