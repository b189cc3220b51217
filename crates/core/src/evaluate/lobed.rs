//! The lobe beside the cells of a material: what it adds to values, to integrals, and to what directions are drawn from.

use super::geometry::Geometry;
use super::place::{Beyond, Place};
use super::spectrum::between;
use crate::compress::lobe_means;
use crate::domain::{Direction, Lobe, LobeUnder, WavelengthGrid};
use rayon::prelude::*;
use std::f64::consts::FRAC_PI_2;
use std::sync::OnceLock;

/// Wavelengths that are answered at a time.
const FEW: usize = 8;
/// Incidences at which the light of the lobe is known for drawing, evenly from the normal to the horizon.
const INCIDENCES: usize = 33;
/// The largest part of directions that is drawn from the lobe: cells may reflect where their trees know of no light.
const MOST: f64 = 0.98;

/// The lobe of a material.
#[derive(Debug)]
pub(super) struct Lobed {
    lobe: Lobe,
    /// Its directional albedo for a colour of 1, at incidences with azimuth 0.
    light: OnceLock<[f64; INCIDENCES]>,
}

/// The lobe under an incoming direction, beside what else directions are drawn from.
pub(super) struct LobePart {
    under: LobeUnder,
    /// The part of directions that is drawn from the lobe.
    pub(super) part: f64,
}

impl Lobed {
    pub(super) fn new(lobe: Lobe) -> Self {
        Self { lobe, light: OnceLock::new() }
    }

    /// Memory in bytes, without the size of the type.
    pub(super) fn memory(&self) -> usize {
        self.lobe.memory()
    }

    /// The value for a colour of 1 at a place.
    #[inline]
    fn shape(&self, place: Place<'_>) -> f32 {
        match (place.wi, place.wo) {
            (Some(wi), Some(wo)) => self.lobe.shape(wi, wo) as f32,
            _ => 0.0,
        }
    }

    /// Adds the spectrum of the lobe at a place.
    #[inline]
    pub(super) fn add(&self, place: Place<'_>, spectrum: &mut [f32]) {
        let shape = self.shape(place);
        for (value, colour) in spectrum.iter_mut().zip(self.lobe.colours()) {
            *value += shape * colour;
        }
    }

    /// Adds the values of the lobe at wavelengths in nm.
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

    /// The inner product of the spectrum of the lobe with weights.
    pub(super) fn weighted(&self, place: Place<'_>, weights: &[f32]) -> f32 {
        self.shape(place) * self.colour(weights)
    }

    /// The inner product of the colours with weights.
    pub(super) fn colour(&self, weights: &[f32]) -> f32 {
        self.lobe.colours().iter().zip(weights).map(|(colour, weight)| colour * weight).sum()
    }

    /// Adds the light of the lobe to the integrals `[incoming, lambda]` of cells.
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

    /// Adds the means of the lobe over the cells of an incidence to its samples `[outgoing, lambda]`.
    pub(super) fn add_means(&self, geometry: &Geometry, entry: usize, samples: &mut [f32]) {
        let Some(lookup) = geometry.mesh() else { return };
        let wi = Direction::from_unit(geometry.incoming_direction(entry));
        lobe_means(&self.lobe, wi, (lookup.mesh(), geometry.sampling()), samples);
    }

    /// The lobe under `wi`, beside cells with so much light; `None` where it has none. `colour` is that of what is drawn by.
    pub(super) fn part(&self, wi: Option<Direction>, colour: f32, cells: f64) -> Option<LobePart> {
        let wi = wi?;
        let under = self.lobe.under(wi)?;
        let light = self.light_at(wi.cos_theta()) * f64::from(colour.max(0.0));
        let part = light / (light + cells);
        (part > 0.0).then(|| LobePart { under, part: if cells > 0.0 { part.min(MOST) } else { 1.0 } })
    }

    /// The light at an incidence with azimuth 0, linear in the cosine; of a lobe that turns with the surface that stands for all
    /// azimuths, as it only decides how often the lobe is drawn from.
    fn light_at(&self, cos_theta: f64) -> f64 {
        let table = self.light.get_or_init(|| {
            let mut table = [0.0; INCIDENCES];
            for (i, light) in table.iter_mut().enumerate().skip(1) {
                let cos = i as f64 / (INCIDENCES - 1) as f64;
                let wi = Direction::from_radians(FRAC_PI_2 - libm::asin(cos), 0.0);
                *light = self.lobe.under(wi).map_or(0.0, |lobe| lobe.light());
            }
            // At the horizon nothing is known but that the lobe goes on.
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
    /// The density of the whole, by that of the cells.
    #[inline]
    pub(super) fn density(&self, wo: Direction, cells: f64) -> f64 {
        self.part * self.under.density(wo) + (1.0 - self.part) * cells
    }

    /// The direction at a point of the unit square, where that is of the lobe, or the point of the cells.
    #[inline]
    pub(super) fn drawn(&self, [u, v]: [f64; 2]) -> Result<Direction, [f64; 2]> {
        if u < self.part {
            Ok(self.under.draw([u / self.part, v]))
        } else {
            Err([((u - self.part) / (1.0 - self.part)).clamp(0.0, 1.0), v])
        }
    }

    /// A point that leads to a direction of the lobe; `None` in its last tail, where points are too close to each other.
    pub(super) fn point_of(&self, wo: Direction) -> Option<[f64; 2]> {
        let [share, turn] = self.under.point_of(wo);
        (share < CLOSE && self.under.density(wo) > 0.0).then_some([share * self.part, turn])
    }

    /// The point of the whole for a point of the cells.
    pub(super) fn of_cells(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        [self.part + (1.0 - self.part) * u, v]
    }
}

/// The part of a lobe beyond which points of it are not looked for.
const CLOSE: f64 = 0.9999;
