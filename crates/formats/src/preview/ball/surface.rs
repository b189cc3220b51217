//! Surface of the rendered ball: the material's smooth function in linear sRGB, and its reflection of soft
//! surroundings.

use super::super::error::{PreviewError, QuestionError, unfit};
use super::lattice::{Lattice, Rgb, Vector};
use crate::appearance::Channels;
use crate::domain::{Axis, Direction, Domain, Quantity, TriangleMesh};
use crate::evaluate::{Interpolation, Material, Place};
use rayon::prelude::*;
use std::f64::consts::FRAC_1_PI;

/// Surface of the rendered ball: BRDF, BTDF or BSDF f(wi, wo) of one entry of a material, in a frame with wi.z ≥ 0.
pub(super) struct Surface<'a> {
    material: &'a Material,
    index: &'a [usize],
    channels: &'a Channels,
    /// Sign of the z axis of the material's frame in the frame of the rendered surface: −1 if incident light comes from
    /// below.
    side: f64,
    /// Two flags: the material has values for reflection, and the material has values for transmission.
    sides: [bool; 2],
    has_outgoing: bool,
    /// Factor from the stored values to f in sr⁻¹: 1/π for a reflectance, which is treated as a diffuser, else 1.
    share: f32,
    nodes: Nodes,
    /// Light reflected towards each tabulated outgoing direction, computed by reciprocity: from uniform surroundings of
    /// radiance 1, and from surroundings whose radiance is the direction's x, y or z component in the surface's frame.
    surroundings: Vec<[Rgb; 4]>,
}

/// Side of the surface on which scattered light leaves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    /// Light leaves on the side of the incident light.
    Reflected = 0,
    /// Light leaves on the side opposite to the incident light.
    Transmitted = 1,
}

/// Outgoing directions at which the reflected light of the surroundings is tabulated.
enum Nodes {
    Lattice(Lattice),
    /// Elevations at equal steps from 0 to 90 degrees, at azimuth 0, for isotropic materials.
    Elevations,
}

/// Upper bound on the magnitude of values of f in sr⁻¹: far brighter than any lit surface, and finite. Raising it risks
/// infinite sums.
const LARGEST: f32 = 1e30;
/// Largest n of the square lattice |x| + |y| ≤ n of directions at which the light reflected from the surroundings is
/// tabulated. Raising it costs time and improves the soft light.
const NODES: usize = 6;
/// Number of polar angles from 0 to 90 degrees at which the light reflected from the surroundings is tabulated, for
/// isotropic materials. Raising it costs time and improves the soft light.
const ELEVATIONS: usize = 19;
/// Largest subdivision level of the triangles of directions over which the light of the surroundings is summed. Raising
/// it costs time and improves the soft light.
const PARTS: u8 = 4;

impl<'a> Surface<'a> {
    /// Creates the surface of the rendered ball from entry `index` of a BRDF, BTDF or BSDF. A reflectance by incoming
    /// direction is treated as a diffuser.
    pub(super) fn of(material: &'a Material, index: &'a [usize], channels: &'a Channels) -> Result<Self, PreviewError> {
        let (layout, axes) = (material.layout(), material.axes());
        let Some(incoming) = layout.incoming.map(|axis| &axes[axis]) else {
            return unfit(QuestionError::NoIncoming);
        };
        let outgoing = layout.outgoing.map(|axis| &axes[axis]);
        let flip = matches!(incoming, Axis::Triangles(mesh) if mesh.domain() == Domain::Lower);
        let sides = match outgoing {
            Some(Axis::Triangles(mesh)) => match mesh.domain() {
                Domain::Sphere => [true, true],
                Domain::Hemisphere => [!flip, flip],
                Domain::Lower => [flip, !flip],
            },
            _ => [true, false],
        };
        let nodes = match incoming {
            // The lattice is no finer than the measurement.
            Axis::Triangles(mesh) => Nodes::Lattice(Lattice::new((2 << mesh.level()).min(NODES))),
            _ => Nodes::Elevations,
        };
        let parts = if let Some(Axis::Triangles(mesh)) = outgoing { mesh.level().min(PARTS) } else { 0 };
        let mut surface = Self {
            material,
            index,
            channels,
            side: if flip { -1.0 } else { 1.0 },
            sides,
            has_outgoing: outgoing.is_some(),
            share: if material.quantity() == Quantity::Reflectance { FRAC_1_PI as f32 } else { 1.0 },
            nodes,
            surroundings: Vec::new(),
        };
        surface.surroundings = surface.surroundings(parts)?;
        Ok(surface)
    }

    pub(super) fn has(&self, side: Side) -> bool {
        self.sides[side as usize]
    }

    /// Returns a buffer for the spectrum of one evaluation.
    pub(super) fn spectrum(&self) -> Vec<f32> {
        vec![0.0; self.material.lambdas()]
    }

    /// Returns f in sr⁻¹, as linear sRGB, for unit vectors `wi` and `wo`. A transmitted `wo` is given mirrored, with z
    /// ≥ 0. The result is NaN if all samples are masked.
    pub(super) fn at(&self, side: Side, wi: Vector, wo: Vector, spectrum: &mut [f32]) -> Result<Rgb, PreviewError> {
        let below = if side == Side::Transmitted { -self.side } else { self.side };
        let wo = Direction::from_unit([wo[0], wo[1], below * wo[2].max(0.0)]);
        let wi = Direction::from_unit([wi[0], wi[1], self.side * wi[2].max(0.0)]);
        let place = Place { index: self.index, wi: Some(wi), wo: self.has_outgoing.then_some(wo) };
        self.material.evaluate(place, Interpolation::Smooth, spectrum)?;
        // NaN stays NaN.
        Ok(self.channels.linear(spectrum).map(|c| (self.share * c).clamp(-LARGEST, LARGEST)))
    }

    /// Returns the light reflected towards `wo` from surroundings of radiance `uniform + gradient · z`, z being the
    /// world's vertical. `up` is the world's vertical in the surface's frame. Assumes reciprocity.
    pub(super) fn surrounded(&self, wo: Vector, up: Vector, uniform: f32, gradient: f32) -> Rgb {
        let (around, [cos, sin]) = self.nodes.around(wo);
        let up = [cos * up[0] + sin * up[1], cos * up[1] - sin * up[0], up[2]].map(|c| c as f32);
        let mut sum = [0.0; 3];
        for (node, weight) in around {
            let [all, x, y, z] = &self.surroundings[node];
            for k in 0..3 {
                sum[k] += weight * (uniform * all[k] + gradient * (up[0] * x[k] + up[1] * y[k] + up[2] * z[k]));
            }
        }
        sum
    }

    fn surroundings(&self, level: u8) -> Result<Vec<[Rgb; 4]>, PreviewError> {
        let mut tables = vec![[[0.0; 3]; 4]; self.nodes.len()];
        let mesh = TriangleMesh::new(Domain::Hemisphere, level).filter(|_| self.has(Side::Reflected));
        let Some(mesh) = mesh else { return Ok(tables) };
        let parts: Vec<(Vector, f64)> =
            (0..mesh.len()).map(|i| (mesh.centroid(i).xyz(), mesh.projected_solid_angle(i))).collect();
        let of = |spectrum: &mut Vec<f32>, &(place, wi): &(usize, Vector)| {
            let (mut sums, mut known, mut all) = ([[0.0_f64; 3]; 4], 0.0, 0.0);
            for &(wo, measure) in &parts {
                all += measure;
                let value = self.at(Side::Reflected, wi, wo, spectrum)?;
                if value.iter().any(|c| c.is_nan()) {
                    continue;
                }
                known += measure;
                for (sum, factor) in sums.iter_mut().zip([1.0, wo[0], wo[1], wo[2]]) {
                    for (sum, value) in sum.iter_mut().zip(value) {
                        *sum += measure * factor * f64::from(value);
                    }
                }
            }
            // Masked directions count as the mean of the others.
            let scale = if known > 0.0 { all / known } else { f64::NAN };
            Ok((place, sums.map(|rgb| rgb.map(|c| (scale * c) as f32))))
        };
        let found: Vec<(usize, [Rgb; 4])> =
            self.nodes.directions().par_iter().map_init(|| self.spectrum(), of).collect::<Result<_, PreviewError>>()?;
        for (place, sums) in found {
            tables[place] = sums;
        }
        match &self.nodes {
            Nodes::Lattice(lattice) => lattice.fill(&mut tables),
            Nodes::Elevations => fill(&mut tables),
        }
        Ok(tables)
    }
}

impl Nodes {
    fn len(&self) -> usize {
        match self {
            Self::Lattice(lattice) => lattice.len(),
            Self::Elevations => ELEVATIONS,
        }
    }

    /// Returns the directions at which the light reflected from the surroundings is tabulated, each with its index in
    /// the table.
    fn directions(&self) -> Vec<(usize, Vector)> {
        match self {
            Self::Lattice(lattice) => lattice.nodes(),
            Self::Elevations => {
                let theta = |i: usize| 90.0 * i as f64 / (ELEVATIONS - 1) as f64;
                (0..ELEVATIONS).map(|i| (i, Direction::from_degrees(theta(i), 0.0).xyz())).collect()
            }
        }
    }

    /// Returns the tabulated directions around a direction, as indices in the table with weights for interpolation.
    /// Also returns the cosine and sine of the azimuth by which the direction is turned away from the tabulated ones.
    fn around(&self, direction: Vector) -> ([(usize, f32); 3], [f64; 2]) {
        match self {
            Self::Lattice(lattice) => (lattice.corners(direction), [1.0, 0.0]),
            Self::Elevations => {
                let [x, y, z] = direction;
                let place = libm::acos(z.clamp(0.0, 1.0)) * (2.0 * FRAC_1_PI) * (ELEVATIONS - 1) as f64;
                let below = (place as usize).min(ELEVATIONS - 2);
                let t = (place - below as f64) as f32;
                let length = (x * x + y * y).sqrt();
                let azimuth = if length > 0.0 { [x / length, y / length] } else { [1.0, 0.0] };
                ([(below, 1.0 - t), (below + 1, t), (below, 0.0)], azimuth)
            }
        }
    }
}

/// Fills entries without a colour (NaN), in a table over incoming elevations, from a neighbouring entry, the one at the
/// lower index first. All become 0 if no entry has a colour.
fn fill(table: &mut [[Rgb; 4]]) {
    let is_empty = |value: &[Rgb; 4]| value.as_flattened().iter().any(|c| c.is_nan());
    for _ in 0..2 {
        for i in 1..table.len() {
            if is_empty(&table[i]) {
                table[i] = table[i - 1];
            }
        }
        table.reverse();
    }
    table.iter_mut().filter(|value| is_empty(value)).for_each(|value| *value = [[0.0; 3]; 4]);
}
