//! Analytic lobe added to the cells of a material: its contribution to values, integrals and sampling.

use super::geometry::Geometry;
use super::place::{Beyond, Place};
use super::spectrum::between;
use crate::compress::lobe_means;
use crate::domain::{Direction, Lobe, LobeUnder, WavelengthGrid};
use rayon::prelude::*;
use std::sync::OnceLock;

/// Number of wavelengths interpolated at a time.
const FEW: usize = 8;
/// Number of polar angles of incidence at which the lobe's albedo is tabulated for sampling, uniform in the cosine from
/// the horizon to the normal. More give a more accurate share of samples.
const INCIDENCES: usize = 33;
/// Upper bound on the fraction of directions drawn from the analytic lobe. The rest is drawn from the sampled data,
/// which may reflect light in directions for which their sampling trees record none.
const MOST: f64 = 0.98;

/// Analytic lobe that is added to the sampled data of a material.
#[derive(Debug)]
pub(super) struct Lobed {
    lobe: Lobe,
    /// Mean of the lobe's spectrum over wavelengths, which scales the lobe in sampling unless a wavelength is chosen.
    mean_colour: f32,
    /// Directional albedo of the lobe for a colour of 1, at tabulated incidences of azimuth 0.
    light: OnceLock<[f64; INCIDENCES]>,
}

/// Lobe under one incoming direction, as a component of the sampling mixture.
pub(super) struct LobePart {
    under: LobeUnder,
    /// Fraction of directions drawn from the analytic lobe rather than from the sampled data.
    pub(super) part: f64,
}

impl Lobed {
    pub(super) fn new(lobe: Lobe) -> Self {
        let weight = 1.0 / lobe.colours().len() as f32;
        let mean_colour = lobe.colours().iter().map(|colour| colour * weight).sum();
        Self { lobe, mean_colour, light: OnceLock::new() }
    }

    pub(super) fn mean_colour(&self) -> f32 {
        self.mean_colour
    }

    /// Heap memory of the lobe in bytes.
    pub(super) fn memory(&self) -> usize {
        self.lobe.memory()
    }

    /// Value of the lobe for a pair of directions and a colour of 1.
    #[inline]
    fn shape(&self, place: Place<'_>) -> f32 {
        match (place.wi, place.wo) {
            (Some(wi), Some(wo)) => self.lobe.shape(wi, wo) as f32,
            _ => 0.0,
        }
    }

    /// Adds the lobe's spectrum for a pair of directions to `spectrum`.
    #[inline]
    pub(super) fn add(&self, place: Place<'_>, spectrum: &mut [f32]) {
        let shape = self.shape(place);
        for (value, colour) in spectrum.iter_mut().zip(self.lobe.colours()) {
            *value += shape * colour;
        }
    }

    /// Adds the analytic lobe's BRDF values for a pair of directions, at `wavelengths` in nm, to `out`.
    pub(super) fn add_at(
        &self,
        place: Place<'_>,
        (grid, beyond): (&WavelengthGrid, Beyond),
        wavelengths: &[f64],
        out: &mut [f32],
    ) {
        let shape = self.shape(place);
        for (wavelengths, out) in wavelengths.chunks(FEW).zip(out.chunks_mut(FEW)) {
            let mut few = [0.0; FEW];
            between(grid, beyond, wavelengths, &mut few[..wavelengths.len()], |i| shape * self.lobe.colours()[i]);
            out.iter_mut().zip(few).for_each(|(value, lobe)| *value += lobe);
        }
    }

    /// Returns a function that takes the number of a spectral sample and gives the lobe's value for a pair of
    /// directions.
    pub(super) fn at(&self, place: Place<'_>) -> impl Fn(usize) -> f32 {
        let shape = self.shape(place);
        move |lambda| shape * self.lobe.colours()[lambda]
    }

    /// Returns the inner product of `weights`, one for each sample of a spectrum, with the lobe's spectrum at `place`.
    pub(super) fn weighted(&self, place: Place<'_>, weights: &[f32]) -> f32 {
        self.shape(place) * self.colour(weights)
    }

    /// Returns the inner product of `weights`, one for each wavelength, with the lobe's colours (factors on its shape).
    pub(super) fn colour(&self, weights: &[f32]) -> f32 {
        self.lobe.colours().iter().zip(weights).map(|(colour, weight)| colour * weight).sum()
    }

    /// Adds the lobe's albedo to the integrals `[incoming direction, wavelength]` of the sampled data.
    pub(super) fn add_light(&self, geometry: &Geometry, integrals: &mut [f32]) {
        let colours = self.lobe.colours();
        integrals.par_chunks_mut(colours.len()).enumerate().for_each(|(entry, integrals)| {
            let wi = Direction::from_unit(geometry.incoming_direction(entry));
            let light = self.lobe.under(wi).map_or(0.0, |lobe| lobe.light());
            for (integral, &colour) in integrals.iter_mut().zip(colours) {
                *integral += (light * f64::from(colour)) as f32;
            }
        });
    }

    /// Adds the lobe's means over the outgoing triangles, under one sampled incoming direction, to the samples
    /// `[outgoing, wavelength]`.
    pub(super) fn add_means(&self, geometry: &Geometry, entry: usize, samples: &mut [f32]) {
        let Some(lookup) = geometry.mesh() else { return };
        let wi = Direction::from_unit(geometry.incoming_direction(entry));
        lobe_means(&self.lobe, wi, (lookup.mesh(), geometry.sampling()), samples);
    }

    /// Component of the sampling mixture that draws from the analytic lobe under `wi`; `None` if the lobe has no light.
    /// `cells` is the integral of the sampled data over outgoing directions; `colour` is the lobe's factor for the
    /// spectral weights by which sampling sums over wavelengths.
    pub(super) fn part(&self, wi: Option<Direction>, colour: f32, cells: f64) -> Option<LobePart> {
        let wi = wi?;
        let under = self.lobe.under(wi)?;
        let light = self.light_at(wi.cos_theta()) * f64::from(colour.max(0.0));
        let part = light / (light + cells);
        (part > 0.0).then(|| LobePart { under, part: if cells > 0.0 { part.min(MOST) } else { 1.0 } })
    }

    /// Albedo of the lobe at azimuth 0, interpolated linearly in the cosine of the polar angle of incidence. For an
    /// anisotropic lobe this value serves all azimuths, as it only decides how often the lobe is drawn.
    fn light_at(&self, cos_theta: f64) -> f64 {
        let table = self.light.get_or_init(|| {
            let mut table = [0.0; INCIDENCES];
            for (i, light) in table.iter_mut().enumerate().skip(1) {
                let cos = i as f64 / (INCIDENCES - 1) as f64;
                let wi = Direction::from_radians(libm::acos(cos), 0.0);
                *light = self.lobe.under(wi).map_or(0.0, |lobe| lobe.light());
            }
            // At the horizon the neighbouring value is used: the lobe is not evaluated there.
            table[0] = table[1];
            table
        });
        let at = cos_theta.clamp(0.0, 1.0) * (INCIDENCES - 1) as f64;
        let below = (at as usize).min(INCIDENCES - 2);
        let t = at - below as f64;
        (1.0 - t) * table[below] + t * table[below + 1]
    }
}

impl LobePart {
    /// Probability density in sr⁻¹ with which the mixture of analytic lobe and sampled data draws `wo`. `cells` is the
    /// density with which the sampled data alone draw it.
    #[inline]
    pub(super) fn density(&self, wo: Direction, cells: f64) -> f64 {
        self.part * self.under.density(wo) + (1.0 - self.part) * cells
    }

    /// Draws a direction from the analytic lobe for a point of the unit square. If the point selects the sampled data
    /// instead of the lobe, returns `Err` with the point, stretched to the whole square.
    #[inline]
    pub(super) fn drawn(&self, [u, v]: [f64; 2]) -> Result<Direction, [f64; 2]> {
        if u < self.part {
            Ok(self.under.draw([u / self.part, v]))
        } else {
            Err([((u - self.part) / (1.0 - self.part)).clamp(0.0, 1.0), v])
        }
    }

    /// Point of the unit square that draws `wo` from the lobe; `None` in the outermost part of the lobe, where the
    /// points of different directions are too close together.
    pub(super) fn point_of(&self, wo: Direction) -> Option<[f64; 2]> {
        let [share, turn] = self.under.point_of(wo);
        (share < CLOSE && self.under.density(wo) > 0.0).then_some([share * self.part, turn])
    }

    /// Point of the unit square at which the mixture of lobe and sampled data draws the direction that the sampled data
    /// alone draw at `[u, v]`.
    pub(super) fn of_cells(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        [self.part + (1.0 - self.part) * u, v]
    }
}

/// Fraction of the lobe's light, counted from its centre outwards, beyond which the point of the unit square that draws
/// a direction is not computed. Farther out, points of different directions are too close together.
const CLOSE: f64 = 0.9999;
