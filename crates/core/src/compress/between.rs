//! Interpolation between measured incidences as a file states it: chunk V.
//!
//! ```text
//! u8   divisor + 8 · cubic + 16 · retro; not 0
//!      divisor: 0 none, 1 the cosines, 2 the projected areas, 3 the masking, 4 the model
//! u16  divisors 2, 3, 4: the roughness;  each the high 16 bits of an f32
//! u16  divisor 4: the reflectance at normal incidence
//! u16  divisor 4: the base
//! ```

use crate::codec::{CodecError, Reader, Writer};
use crate::domain::{Axis, Layout, Quantity};
use serde::{Deserialize, Serialize};

/// Bits of the byte in which a file states its interpolation between incoming directions: kind of function that samples
/// are divided by (3 bits), cubic interpolation, alignment with retro-reflection.
const DIVISOR: u8 = 7;
const CUBIC: u8 = 8;
const RETRO: u8 = 16;
/// Smallest and largest GGX roughness that a file can state; both are exact in the 16 bits that it stores.
const ROUGHNESS: [f32; 2] = [1.0 / 1024.0, 4.0];
/// Smallest and largest reflectance at normal incidence that a file can state.
const REFLECTANCE: [f32; 2] = [1.0 / 8192.0, 1.0];
/// Smallest and largest constant (diffuse) term that a file can state for a microfacet model, which is this term plus a
/// specular term of fixed scale.
const BASE: [f32; 2] = [0.0, 1_048_576.0];

/// Function of incoming and outgoing direction by which samples are divided before their logarithms are interpolated
/// between incoming directions. The result is multiplied by it again. Samples on grids of angles may also be divided by
/// it before they are coded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Divisor {
    /// No function divides the samples before they are interpolated between incoming directions.
    #[default]
    None,
    /// Samples are divided by V = 1 / (c + d) before interpolation, with c and d the cosines of the incoming and the
    /// outgoing direction.
    Cosines,
    /// Samples are divided by V = 1 / (σ(c)·σ(d)) before interpolation, for cosines c and d of the incoming and
    /// outgoing direction. σ(c) = c + √(c² + a²·(1 − c²)) is twice the projected area of a GGX surface of roughness a.
    ProjectedAreas {
        /// Roughness of the GGX distribution.
        roughness: f32,
    },
    /// Samples are divided by V = 1 / (d·r(c) + c·r(d)) before interpolation: height-correlated GGX masking over the
    /// cosines c and d of the incoming and outgoing direction. r(c) = √(c² + a²·(1 − c²)), with a the roughness.
    Masking {
        /// Roughness of the GGX distribution.
        roughness: f32,
    },
    /// Samples are divided by a microfacet model before interpolation: V = base + F·D / (d·r(c) + c·r(d)), for cosines
    /// c and d of the incoming and outgoing direction and a constant `base`. r(c) = √(c² + a²·(1 − c²)), with a the
    /// roughness. D = a² / (x² + y² + a²·z²)² for the unit half vector (x, y, z). F is Schlick's Fresnel factor at the
    /// angle between half vector and incoming direction.
    Model {
        /// Roughness of the GGX distribution.
        roughness: f32,
        /// Fresnel reflectance at normal incidence.
        reflectance: f32,
        /// Constant (diffuse) term that the microfacet model adds to its specular term, which is the product of the
        /// Fresnel factor, the GGX distribution and masking over cosines.
        base: f32,
    },
}

impl Divisor {
    /// Parameters of the function by which samples are divided before interpolation: roughness, reflectance at normal
    /// incidence, constant (diffuse) term, as many of these in order as it has.
    fn parameters(self) -> Vec<f32> {
        match self {
            Self::None | Self::Cosines => Vec::new(),
            Self::ProjectedAreas { roughness } | Self::Masking { roughness } => vec![roughness],
            Self::Model { roughness, reflectance, base } => vec![roughness, reflectance, base],
        }
    }

    /// Returns this divisor (function by which samples are divided before interpolation between incoming directions)
    /// with its parameters as a file stores them: clamped to their bounds, rounded to the high 16 bits of an f32.
    #[must_use]
    pub fn stated(self) -> Self {
        let short = |x: f32, [low, high]: [f32; 2]| {
            f32::from_bits(x.max(low).min(high).to_bits().wrapping_add(0x7FFF) & 0xFFFF_0000)
        };
        match self {
            Self::None | Self::Cosines => self,
            Self::ProjectedAreas { roughness } => Self::ProjectedAreas { roughness: short(roughness, ROUGHNESS) },
            Self::Masking { roughness } => Self::Masking { roughness: short(roughness, ROUGHNESS) },
            Self::Model { roughness, reflectance, base } => Self::Model {
                roughness: short(roughness, ROUGHNESS),
                reflectance: short(reflectance, REFLECTANCE),
                base: short(base, BASE),
            },
        }
    }
}

/// Interpolation between measured incoming directions. The default is linear in the logarithms of the samples; a file
/// that states no interpolation has it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Between {
    /// Function that divides the samples before interpolation between incoming directions; the result is multiplied by
    /// it.
    pub divisor: Divisor,
    /// True for interpolation by a cubic through four incoming directions (on triangles a quadratic through six), false
    /// for a straight line through two.
    pub cubic: bool,
    /// True if interpolation combines samples at outgoing directions with equal offsets from the direction back to the
    /// source, around which retro-reflectors have their lobe.
    pub retro: bool,
}

impl Between {
    /// Returns true for the default interpolation between incoming directions, linear in the logarithms of the samples.
    /// A file does not state it.
    pub fn is_default(&self) -> bool {
        *self == Self::default()
    }

    /// Returns the interpolation between incoming directions with its parameters rounded as a file states them; `None`
    /// for the default, which a file does not state.
    pub(crate) fn stated(&self) -> Option<Self> {
        (!self.is_default()).then(|| Self { divisor: self.divisor.stated(), ..*self })
    }

    /// Returns true if this way of interpolating between incoming directions suits a measurement of `quantity` on
    /// `axes`.
    ///
    /// It needs incoming directions. Division of the samples by a function, and the treatment of retro-reflection, also
    /// need a BRDF.
    pub(crate) fn fits(&self, quantity: Quantity, axes: &[Axis]) -> bool {
        let Ok(layout) = Layout::of(quantity, axes) else { return false };
        let is_reflected = quantity == Quantity::Brdf && layout.outgoing.is_some();
        let needs_reflection = self.divisor != Divisor::None || self.retro;
        layout.incoming.is_some() && (is_reflected || !needs_reflection)
    }

    /// Writes the payload of the file chunk that states the interpolation between incoming directions.
    pub(crate) fn write(&self) -> Vec<u8> {
        let divisor = match self.divisor {
            Divisor::None => 0,
            Divisor::Cosines => 1,
            Divisor::ProjectedAreas { .. } => 2,
            Divisor::Masking { .. } => 3,
            Divisor::Model { .. } => 4,
        };
        let mut w = Writer::default();
        w.u8(divisor | if self.cubic { CUBIC } else { 0 } | if self.retro { RETRO } else { 0 });
        for parameter in self.divisor.stated().parameters() {
            w.low_bytes(parameter.to_bits() >> 16, 2);
        }
        w.into_bytes()
    }

    /// Reads the payload of the file chunk that states the interpolation between incoming directions.
    pub(crate) fn read(r: &mut Reader<'_>) -> Result<Self, CodecError> {
        let first = r.u8("interpolation between incidences")?;
        let mut number = |what: &'static str, [low, high]: [f32; 2]| {
            let number = f32::from_bits(r.low_bytes(2, what)? << 16);
            let is_held = number.is_sign_positive() && (low..=high).contains(&number);
            if is_held {
                Ok(number)
            } else {
                Err(r.malformed(format!("the {what} of the interpolation is {number}, expected {low} to {high}")))
            }
        };
        let divisor = match first & DIVISOR {
            0 => Divisor::None,
            1 => Divisor::Cosines,
            2 => Divisor::ProjectedAreas { roughness: number("roughness", ROUGHNESS)? },
            3 => Divisor::Masking { roughness: number("roughness", ROUGHNESS)? },
            4 => Divisor::Model {
                roughness: number("roughness", ROUGHNESS)?,
                reflectance: number("reflectance", REFLECTANCE)?,
                base: number("base", BASE)?,
            },
            other => {
                return Err(r.malformed(format!("the code {other} of the divisor of the interpolation is unknown")));
            }
        };
        if first == 0 || first & !(DIVISOR | CUBIC | RETRO) != 0 {
            return Err(r.malformed(format!(
                "the code {first:#04x} of the interpolation between incoming directions is unknown"
            )));
        }
        r.end("interpolation between incidences")?;
        Ok(Self { divisor, cubic: first & CUBIC != 0, retro: first & RETRO != 0 })
    }
}

impl std::fmt::Display for Between {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(if self.cubic { "cubic" } else { "linear" })?;
        f.write_str(if self.retro { ", about the direction back to the source" } else { "" })?;
        match self.divisor {
            Divisor::None => Ok(()),
            Divisor::Cosines => f.write_str(", over 1 / (cos θi + cos θo)"),
            Divisor::ProjectedAreas { roughness } => {
                write!(f, ", over the projected areas of a surface of roughness {roughness:.3}")
            }
            Divisor::Masking { roughness } => write!(f, ", over the masking of a surface of roughness {roughness:.3}"),
            Divisor::Model { roughness, reflectance, .. } => {
                write!(f, ", over a microfacet model of roughness {roughness:.3} and reflectance {reflectance:.2}")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::{Domain, TriangleMesh};

    fn all() -> Vec<Between> {
        let model = Divisor::Model { roughness: 0.123, reflectance: 0.0404, base: 0.0 };
        let areas = Divisor::ProjectedAreas { roughness: 9.0 };
        let divisors = [Divisor::None, Divisor::Cosines, areas, Divisor::Masking { roughness: 1e-9 }, model];
        let ways = [(false, false), (true, false), (false, true), (true, true)];
        let all = divisors
            .into_iter()
            .flat_map(|divisor| ways.map(|(cubic, retro)| Between { divisor: divisor.stated(), cubic, retro }));
        all.filter(|between| !between.is_default()).collect()
    }

    #[test]
    fn what_is_written_is_read() {
        for between in all() {
            let bytes = between.write();
            assert_eq!(Between::read(&mut Reader::new(&bytes, 0)), Ok(between));
            for end in 0..bytes.len() {
                assert!(Between::read(&mut Reader::new(&bytes[..end], 0)).is_err());
            }
            let longer = [&bytes[..], &[0]].concat();
            assert!(Between::read(&mut Reader::new(&longer, 0)).is_err());
        }
    }

    #[test]
    fn unknown_codes_and_numbers_out_of_bounds_are_refused() {
        for bytes in [&[0][..], &[5], &[32], &[129], &[2, 0, 0], &[3, 0x80, 0x7F], &[3, 0, 0xBF], &[2, 0, 0x41]] {
            assert!(
                matches!(Between::read(&mut Reader::new(bytes, 0)), Err(CodecError::Malformed { .. })),
                "{bytes:?}"
            );
        }
    }

    #[test]
    fn divisors_are_for_reflection_and_all_is_for_incidences() {
        let mesh = || Axis::Triangles(TriangleMesh::new(Domain::Hemisphere, 1).unwrap());
        let elevations = || vec![Axis::Elevation(vec![0.0, 30.0]), mesh()];
        for between in all() {
            assert!(between.fits(Quantity::Brdf, &elevations()), "{between}");
            assert!(between.fits(Quantity::Brdf, &[mesh(), mesh()]), "{between}");
            let is_plain = between.divisor == Divisor::None && !between.retro;
            assert_eq!(between.fits(Quantity::Bsdf, &elevations()), is_plain, "{between}");
            assert!(!between.fits(Quantity::Edf, &[mesh()]), "{between}");
        }
    }
}
