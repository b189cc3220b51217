//! Colours of a material at a pair of directions: XYZ, CIELAB, sRGB, and the colour temperature of lights.

use super::error::{PreviewError, QuestionError, unfit};
use crate::appearance::{Viewing, emits};
use crate::domain::colour::{
    Adaptation, ColourError, ColourTemperature, Lab, Xyz, in_gamut, linear_to_bytes, linear_to_xyz, map_to_gamut,
    xyz_of, xyz_to_linear,
};
use crate::domain::{Axis, Direction, Quantity, Unit};
use crate::evaluate::{Interpolation, JOULES_PER_MICROMOLE, Material, Place};
use serde::Serialize;
use std::f64::consts::PI;

/// Upper bound on the number of colours in one answer. Raising it allows larger tables of spectra.
const MOST_COLOURS: usize = 4096;

/// Request for colours of a material: the entry (spectrum or specimen) and the directions for which they are computed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Question<'a> {
    /// Index of the one entry (spectrum or specimen) of a material whose colour is requested: its position on each
    /// leading index axis. Without an index, a table without directions gives a colour for every entry.
    pub index: Option<&'a [usize]>,
    /// Incoming direction; normal incidence by default.
    pub wi: Option<Direction>,
    /// Outgoing direction; by default the integral over all outgoing directions, an albedo or flux.
    pub wo: Option<Direction>,
}

/// Colours of a material, with the viewing conditions under which they were computed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Colours {
    /// Quantity whose colour is computed: `reflectance`, `radiance factor`, `directional albedo`, `intensity`, `flux`,
    /// `spectrum`, `phase function` (× 4π).
    pub of: &'static str,
    /// Name of the illuminant under which colours are computed.
    pub illuminant: String,
    /// Name of the observer for whom colours are computed.
    pub observer: String,
    /// Tristimulus values XYZ of the white point, scaled to Y = 100.
    pub white: [f64; 3],
    /// Colour of each requested entry (spectrum or specimen) of the material; `None` for an entry with too few measured
    /// wavelengths.
    pub colours: Vec<Option<Colour>>,
}

/// Colour of one entry of a material, in several colour spaces.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Colour {
    /// Index of the material's entry to which the colour belongs, one number for each index axis of the material.
    pub index: Vec<usize>,
    /// Name of the material's entry to which the colour belongs; `None` if the entry has no name.
    pub label: Option<String>,
    /// Tristimulus values XYZ of the colour; white has Y = 100.
    pub xyz: [f64; 3],
    /// Chromaticity (x, y) of the colour; `None` for black.
    pub xy: Option<[f64; 2]>,
    /// CIE 1976 L*a*b* coordinates of the colour, relative to white.
    pub lab: [f64; 3],
    /// Linear sRGB of the colour, possibly out of gamut. The colours of light sources are scaled by a common factor, so
    /// that the largest channel among all entries is 1.
    pub linear_srgb: [f64; 3],
    /// Linear sRGB of the colour after mapping into the gamut.
    pub mapped_srgb: [f64; 3],
    /// Colour within the sRGB gamut, gamma-encoded as `#rrggbb`.
    pub srgb: String,
    /// True if the colour lies within the sRGB gamut without mapping.
    pub in_gamut: bool,
    /// Correlated colour temperature of a light in K; `None` if it is too far from the Planckian locus.
    pub cct: Option<f64>,
    /// Distance of a light from the Planckian locus in CIE 1960 (u, v), positive towards green.
    pub duv: Option<f64>,
    /// Luminous flux (lm) or luminous intensity (cd) of a light whose unit is radiometric; `None` for others.
    pub luminous: Option<f64>,
}

/// Returns the colours of `material` at a pair of directions. Without `wo` they are those of an integral: the
/// directional albedo at `wi` of a BRDF, BTDF or BSDF, the integral of a phase function, or the flux of a luminaire. A
/// table without directions gives a colour for every entry.
pub fn colours(material: &Material, asked: &Question<'_>, viewing: &Viewing) -> Result<Colours, PreviewError> {
    let layout = material.layout();
    let view = Look::of(material, viewing)?;
    let (integrated, factor) = view.scale(asked, layout.outgoing.is_some());
    // Normal incidence of the hemisphere that contains the incoming directions.
    let wi = asked.wi.or_else(|| layout.incoming.map(|axis| normal(&material.axes()[axis])));
    if asked.wi.is_none() && asked.wo.is_some() && layout.incoming.is_some() {
        return unfit(QuestionError::LoneWo { quantity: material.quantity() });
    }
    let axes = &material.axes()[..layout.indices];
    let entries = match asked.index {
        Some(index) => vec![index.to_vec()],
        None if layout.incoming.or(layout.outgoing).is_some() && layout.indices > 0 => {
            return unfit(QuestionError::MissingIndex { expected: layout.indices });
        }
        None => every(material, axes)?,
    };
    let mut spectrum = vec![0.0; material.lambdas()];
    let mut found = Vec::with_capacity(entries.len());
    for index in &entries {
        if integrated {
            material.albedo(index, wi, Interpolation::Smooth, &mut spectrum)?;
        } else {
            material.evaluate(Place { index, wi, wo: asked.wo }, Interpolation::Smooth, &mut spectrum)?;
        }
        found.push(view.xyz(&spectrum).map(|xyz| xyz.scaled(factor)));
    }
    if found.iter().all(Option::is_none) {
        return Err(ColourError::Masked.into());
    }
    let scale = if view.is_relative() {
        let brightest = found.iter().flatten().map(|xyz| xyz.y).fold(0.0, f64::max);
        if brightest <= 0.0 {
            return Err(ColourError::Dark.into());
        }
        100.0 / brightest
    } else {
        1.0
    };
    let shown: Vec<Option<[f64; 3]>> = found.iter().map(|xyz| xyz.map(|xyz| view.linear(xyz.scaled(scale)))).collect();
    let peak = shown.iter().flatten().flatten().copied().fold(0.0, f64::max);
    // A light at the luminance of its white would be shown as white only.
    let display = if view.emits() && peak > 0.0 { 1.0 / peak } else { 1.0 };
    let colours = entries.into_iter().zip(found).zip(shown).map(|((index, xyz), linear)| {
        let label = label(axes, &index);
        let linear = linear.map(|linear| linear.map(|c| display * c));
        xyz.zip(linear).map(|(xyz, linear)| view.colour(index, label, xyz, scale, linear))
    });
    Ok(Colours {
        of: view.name(integrated),
        illuminant: viewing.illuminant().to_owned(),
        observer: viewing.observer().to_owned(),
        white: [view.white.x, view.white.y, view.white.z],
        colours: colours.collect(),
    })
}

/// Viewing conditions and weights with which the spectra of a material become colours.
struct Look<'a> {
    material: &'a Material,
    viewing: &'a Viewing,
    /// Weights of XYZ for each wavelength; `None` for RGB data.
    weights: Option<crate::domain::colour::Tristimulus>,
    lambdas: Vec<f64>,
    white: Xyz,
    /// Conversion of XYZ from the white point of the viewing conditions to the white of sRGB (chromatic adaptation);
    /// `None` for RGB data.
    adaptation: Option<Adaptation>,
}

impl<'a> Look<'a> {
    fn of(material: &'a Material, viewing: &'a Viewing) -> Result<Self, PreviewError> {
        match material.axes().last() {
            Some(Axis::Wavelength(grid)) => {
                let weights =
                    if emits(material.quantity()) { viewing.emission(grid)? } else { viewing.reflectance(grid)? };
                // Computed on the material's own grid, so that the perfect diffuser is exactly white.
                let white = if emits(material.quantity()) { viewing.white()? } else { weights.white() };
                let adaptation = Some(Viewing::adaptation(white)?);
                Ok(Self { material, viewing, weights: Some(weights), lambdas: grid.values(), white, adaptation })
            }
            Some(Axis::Rgb) if viewing.is_d65() => {
                let white = linear_to_xyz([1.0; 3]);
                Ok(Self { material, viewing, weights: None, lambdas: Vec::new(), white, adaptation: None })
            }
            Some(Axis::Rgb) => unfit(QuestionError::RgbIlluminant { illuminant: viewing.illuminant().to_owned() }),
            _ => Err(ColourError::NoWavelengths.into()),
        }
    }

    fn emits(&self) -> bool {
        emits(self.material.quantity())
    }

    /// Returns true if only ratios of the material's values are meaningful for colours.
    fn is_relative(&self) -> bool {
        match self.material.quantity() {
            Quantity::Spectrum | Quantity::Edf => true,
            Quantity::Reflectance => self.material.unit() != Unit::One,
            _ => self.material.unit() != Unit::PerSteradian,
        }
    }

    /// Returns true if the requested colour is that of an integral over outgoing directions. Also returns the factor by
    /// which values are multiplied so that white is 1.
    fn scale(&self, asked: &Question<'_>, has_outgoing: bool) -> (bool, f64) {
        let quantity = self.material.quantity();
        let integrated = has_outgoing && asked.wo.is_none();
        let factor = match quantity {
            _ if integrated => 1.0,
            Quantity::Brdf | Quantity::Btdf | Quantity::Bsdf => PI,
            Quantity::Phase => 4.0 * PI,
            _ => 1.0,
        };
        (integrated, factor)
    }

    fn name(&self, integrated: bool) -> &'static str {
        match (self.material.quantity(), integrated) {
            (Quantity::Spectrum, _) => "spectrum",
            (Quantity::Reflectance, _) => "reflectance",
            (Quantity::Edf, false) => "intensity",
            (Quantity::Edf, true) => "flux",
            (Quantity::Phase, _) => "phase function",
            (_, false) => "radiance factor",
            (_, true) => "directional albedo",
        }
    }

    fn xyz(&self, spectrum: &[f32]) -> Option<Xyz> {
        let Some(weights) = &self.weights else {
            let &[r, g, b] = spectrum else { return None };
            return spectrum.iter().all(|c| !c.is_nan()).then(|| linear_to_xyz([r, g, b].map(f64::from)));
        };
        let photons = self.emits() && self.material.unit().counts_photons();
        if !photons {
            return xyz_of(weights, &self.lambdas, spectrum);
        }
        let energy: Vec<f32> = spectrum
            .iter()
            .zip(&self.lambdas)
            .map(|(&s, l)| (f64::from(s) * JOULES_PER_MICROMOLE / l) as f32)
            .collect();
        xyz_of(weights, &self.lambdas, &energy)
    }

    /// Returns the linear sRGB of a colour; white has Y = 100.
    fn linear(&self, xyz: Xyz) -> [f64; 3] {
        xyz_to_linear(self.adaptation.map_or(xyz, |adaptation| adaptation.apply(xyz)))
    }

    fn colour(&self, index: Vec<usize>, label: Option<String>, absolute: Xyz, scale: f64, linear: [f64; 3]) -> Colour {
        let xyz = absolute.scaled(scale);
        let lab = Lab::of(xyz, self.white);
        let mapped = map_to_gamut(linear);
        let [r, g, b] = linear_to_bytes(mapped);
        let sum = xyz.x + xyz.y + xyz.z;
        let is_light = self.emits() && self.weights.is_some();
        let temperature = is_light.then(|| ColourTemperature::of(xyz, self.viewing.functions())).flatten();
        let watts = self.material.unit().watts().filter(|_| is_light && self.viewing.is_photometric());
        Colour {
            index,
            label,
            xyz: [xyz.x, xyz.y, xyz.z],
            xy: (sum > 0.0).then(|| [xyz.x / sum, xyz.y / sum]),
            lab: [lab.l, lab.a, lab.b],
            linear_srgb: linear,
            mapped_srgb: mapped,
            srgb: format!("#{r:02x}{g:02x}{b:02x}"),
            in_gamut: in_gamut(linear),
            cct: temperature.map(|t| t.kelvin),
            duv: temperature.map(|t| t.duv),
            luminous: watts.map(|watts| watts * absolute.y),
        }
    }
}

/// Returns the incoming direction at normal incidence, from below if the axis covers the lower hemisphere. A grid that
/// covers neither pole gives its first direction.
pub(super) fn normal(incoming: &Axis) -> Direction {
    let [up, down] = [0.0, 180.0].map(|theta| Direction::from_degrees(theta, 0.0));
    match incoming {
        Axis::Triangles(mesh) if mesh.domain() == crate::domain::Domain::Lower => down,
        Axis::Grid(grid) => {
            let covered = [up, down].into_iter().find(|&direction| grid.angles(direction).is_some());
            covered.unwrap_or_else(|| grid.direction(0))
        }
        _ => up,
    }
}

/// Returns, for every entry (spectrum or specimen) of a material in row-major order, its position on each index axis.
fn every(material: &Material, axes: &[Axis]) -> Result<Vec<Vec<usize>>, PreviewError> {
    let count: usize = axes.iter().map(Axis::len).product();
    if count > MOST_COLOURS {
        return unfit(QuestionError::TooMany { found: count, most: MOST_COLOURS });
    }
    Ok((0..count).map(|entry| material.index_of(entry)).collect())
}

/// Returns the labels of an entry on its index axes as one name; `None` if it has none.
pub(super) fn label(axes: &[Axis], index: &[usize]) -> Option<String> {
    let names: Vec<&str> = axes
        .iter()
        .zip(index)
        .filter_map(|(axis, &i)| match axis {
            Axis::Index { labels, .. } => labels.get(i).map(String::as_str),
            _ => None,
        })
        .collect();
    (!names.is_empty()).then(|| names.join(", "))
}
