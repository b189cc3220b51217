//! Photometric figures of luminaires: the peak, beam and field angles in two planes, and the flux of zones.
//!
//! All figures are those of straight lines between the measured angles, as lighting programs read a luminaire, so that
//! they follow from the numbers of its file. Cells over triangles have no angles: their planes are those of the smooth
//! function.

use super::plane::Plane;
use crate::compress::weights_of_zone;
use crate::domain::{Azimuths, Direction, DirectionGrid, Frame, Outside, Quantity, Unit};
use crate::evaluate::material::Material;
use crate::evaluate::photometry::Photometry;
use crate::evaluate::place::{Interpolation, Place};
use crate::numeric::bracket::Bracket;
use serde::Serialize;

/// Borders of the zones in degrees of gamma, of which the zonal flux is reported (as in LM-63 and CIE reports).
const ZONES: [f64; 7] = [0.0, 30.0, 40.0, 60.0, 90.0, 120.0, 180.0];
/// Names of the planes in which beam and field angle are reported, and the C angle of their first half.
const PLANES: [(&str, f64); 2] = [("C0-C180", 0.0), ("C90-C270", 90.0)];
/// Steps in gamma of a half plane, where the data have no angles of gamma of their own. Raising it costs time.
const STEPS: usize = 1800;
/// Parts in gamma and in C into which zones are cut, where the data have no angles of gamma of their own. Raising them
/// costs time.
const PARTS: (usize, usize) = (360, 360);

/// Photometric figures of a luminaire for one combination of indices (positions on the axes before the directions).
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct LuminaireReport {
    /// Index on each index axis (leading axis other than directions and wavelength).
    pub index: Vec<usize>,
    /// Unit of the intensities: candela if the luminaire is measured in it or its spectra are visible, else that of
    /// the total over wavelengths.
    pub unit: Unit,
    /// Largest measured intensity, in the first of its directions by gamma and C.
    pub peak: Option<IntensityAt>,
    /// Beam and field angle in the planes C0–C180 and C90–C270.
    pub planes: Vec<PlaneReport>,
    /// Flux of zones of gamma. The zones add up to the flux.
    pub zones: Vec<ZoneReport>,
    /// Flux of the intensities over all directions.
    pub flux: Option<f64>,
    /// Unit of the flux and of its zones.
    pub flux_unit: &'static str,
}

/// Intensity of a luminaire in a direction.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct IntensityAt {
    /// Intensity in the unit of the report.
    pub value: f64,
    /// Azimuth C of the direction in degrees, 0 to less than 360, counter-clockwise seen from above.
    pub c: f64,
    /// Angle gamma of the direction from nadir in degrees, 0 to 180.
    pub gamma: f64,
}

/// Beam and field angle of a luminaire in a plane through its vertical axis.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct PlaneReport {
    /// Name of the plane, after the azimuths C of its halves: `C0-C180` or `C90-C270`.
    pub plane: &'static str,
    /// Largest intensity in the plane; `None` if the plane has no intensity above 0.
    pub peak: Option<IntensityAt>,
    /// Angle in degrees between the first directions on both sides of the peak of the plane with at most 50 % of that
    /// intensity (beam angle, IES LS-1, CIE S 017); `None` if a side has none, or a direction before it is masked.
    pub beam: Option<f64>,
    /// Angle in degrees between the first directions on both sides of the peak of the plane with at most 10 % of that
    /// intensity (field angle); `None` if a side has none, or a direction before it is masked.
    pub field: Option<f64>,
}

/// Flux of a luminaire between two angles of gamma.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct ZoneReport {
    /// Angle gamma in degrees at which the zone begins.
    pub from: f64,
    /// Angle gamma in degrees at which the zone ends.
    pub to: f64,
    /// Flux of the zone; `None` if the flux over all directions is unknown.
    pub flux: Option<f64>,
}

impl Material {
    /// Computes the photometric figures of a luminaire, for each combination of indices. Empty for other materials, and
    /// for spectra that make no intensity ([`Material::photometry`]).
    pub fn luminaire(&self) -> Vec<LuminaireReport> {
        match self.photometry() {
            Some(photometry) => {
                let weights = self.flux_weights();
                let figures = |entry| self.figures(entry, &photometry, weights.as_deref());
                (0..self.geometry().entries()).map(figures).collect()
            }
            None => Vec::new(),
        }
    }

    fn figures(&self, entry: usize, photometry: &Photometry, weights: Option<&[f64]>) -> LuminaireReport {
        let flux = photometry.intensity(&self.flux_row(entry, weights));
        let flux = Some(flux).filter(|flux| flux.is_finite() && self.needs_light().is_ok());
        let index = self.index_of(entry);
        let (peak, planes, zones) = if let Some(grid) = self.outgoing_grid() {
            let intensities = Intensities { grid, values: &photometry.intensities(&self.slice(entry)) };
            let planes = PLANES.map(|(name, c)| plane(name, c, |c| intensities.half(c)));
            (intensities.peak(), planes, intensities.zones(flux))
        } else {
            let weights: Vec<f32> = photometry.weights.iter().map(|&weight| weight as f32).collect();
            let at = |c: f64, gamma: f64, how: Interpolation| {
                let wo = Some(Direction::from_luminaire_degrees(c, gamma));
                self.weighted(Place { index: &index, wi: None, wo }, how, &weights).map_or(f64::NAN, f64::from)
            };
            let smooth = |c: f64, gamma: f64| at(c, gamma, Interpolation::Smooth);
            let planes = PLANES.map(|(name, c)| plane(name, c, |c| even(STEPS, |gamma| smooth(c, gamma))));
            let centroids = self.geometry().mesh().into_iter().flat_map(|lookup| {
                let mesh = lookup.mesh();
                (0..mesh.len()).map(move |cell| mesh.centroid(cell).luminaire_degrees())
            });
            let peak = largest(centroids.map(|[c, gamma]| IntensityAt { value: smooth(c, gamma), c, gamma }));
            (peak, planes, midpoints(flux, |c, gamma| at(c, gamma, Interpolation::Constant)))
        };
        let flux_unit = photometry.unit.over_directions();
        LuminaireReport { index, unit: photometry.unit, peak, planes: planes.to_vec(), zones, flux, flux_unit }
    }

    /// Grid of angles of the outgoing directions; `None` for triangles.
    pub(super) fn outgoing_grid(&self) -> Option<&DirectionGrid> {
        self.stated().and_then(|stated| stated.geometry().outgoing_grid())
    }
}

/// Intensities of a luminaire on a grid of angles.
struct Intensities<'a> {
    grid: &'a DirectionGrid,
    values: &'a [f64],
}

impl Intensities<'_> {
    /// Angle gamma of a polar angle of the grid, and the other way round; `None` if the axis of the grid is not
    /// vertical.
    fn gamma(&self, polar: f64) -> Option<f64> {
        match self.grid.frame() {
            Frame::TypeC => Some(polar),
            Frame::Surface => Some(180.0 - polar),
            _ => None,
        }
    }

    /// Largest intensity of the grid; of equal ones that of the smallest gamma, then the smallest C.
    fn peak(&self) -> Option<IntensityAt> {
        let [_, columns] = self.grid.shape();
        largest(self.values.iter().enumerate().map(|(entry, &value)| {
            let azimuth = self.grid.azimuths().map_or(0.0, |azimuths| azimuths.angles[entry % columns]);
            let polar = self.grid.polar()[entry / columns];
            let by_direction = || self.grid.frame().direction(polar, azimuth).luminaire_degrees();
            let [c, gamma] = self.gamma(polar).map_or_else(by_direction, |gamma| [azimuth, gamma]);
            IntensityAt { value, c: if self.grid.is_pole(entry / columns) { 0.0 } else { c.rem_euclid(360.0) }, gamma }
        }))
    }

    /// Intensities of the half plane at the azimuth C, from gamma 0 to 180.
    fn half(&self, c: f64) -> Vec<(f64, f64)> {
        let (low, high) = self.grid.covers();
        let (Some(low), Some(high)) = (self.gamma(low), self.gamma(high)) else {
            // Intensities drop between two steps where the grid ends.
            return even(10 * STEPS, |gamma| self.at(c, gamma));
        };
        let (first, last) = (low.min(high), low.max(high));
        let mut gammas: Vec<f64> = self.grid.polar().iter().filter_map(|&polar| self.gamma(polar)).collect();
        gammas.extend([first, last]);
        gammas.sort_by(f64::total_cmp);
        gammas.dedup();
        let mut half: Vec<(f64, f64)> = gammas.into_iter().map(|gamma| (gamma, self.at(c, gamma))).collect();
        // Intensities end at the border of the grid.
        if first > 0.0 {
            half.splice(..0, [0.0, first].map(|gamma| (gamma, self.outside())));
        }
        if last < 180.0 {
            half.extend([last, 180.0].map(|gamma| (gamma, self.outside())));
        }
        half
    }

    /// Intensity at the angles C and gamma, linear in both angles of the grid; NaN if a sample around is masked.
    fn at(&self, c: f64, gamma: f64) -> f64 {
        let by_direction = || self.grid.frame().angles(Direction::from_luminaire_degrees(c, gamma));
        let own = self.gamma(gamma).map_or_else(by_direction, |polar| [polar, c]);
        let Some([polar, azimuth]) = self.grid.held(own) else { return self.outside() };
        let columns = match self.grid.azimuths() {
            None => [(0, 1.0), (0, 0.0)],
            Some(Azimuths { angles, extent }) => {
                let (first, last) = (angles[0], angles.len() - 1);
                if extent.is_periodic() && azimuth > angles[last] {
                    let t = (azimuth - angles[last]) / (first + 360.0 - angles[last]);
                    [(last, 1.0 - t), (0, t)]
                } else {
                    Bracket::held(angles, azimuth).weights()
                }
            }
        };
        let [_, width] = self.grid.shape();
        let mut sum = 0.0;
        for (row, of_row) in Bracket::held(self.grid.polar(), polar).weights() {
            for (column, of_column) in columns {
                if of_row * of_column > 0.0 {
                    sum += of_row * of_column * self.values[row * width + column];
                }
            }
        }
        sum
    }

    /// Intensity of directions outside the angles of the grid.
    fn outside(&self) -> f64 {
        if self.grid.outside() == Outside::Dark { 0.0 } else { f64::NAN }
    }

    fn zones(&self, flux: Option<f64>) -> Vec<ZoneReport> {
        let zone = |&[from, to]: &[f64; 2]| {
            let (a, b) = (self.gamma(from)?, self.gamma(to)?);
            let weights = weights_of_zone(Quantity::Edf, self.grid, (a.min(b), a.max(b)));
            let measured = weights.iter().zip(self.values).filter(|(_, value)| !value.is_nan());
            let sum: f64 = measured.map(|(weight, value)| weight * value).sum();
            Some(ZoneReport { from, to, flux: flux.map(|_| sum) })
        };
        let zones: Option<Vec<ZoneReport>> = ZONES.array_windows().map(zone).collect();
        zones.unwrap_or_else(|| midpoints(flux, |c, gamma| self.at(c, gamma)))
    }
}

/// First of the largest intensities above 0; `None` if there is none.
fn largest(all: impl Iterator<Item = IntensityAt>) -> Option<IntensityAt> {
    let known = all.filter(|one| one.value > 0.0);
    known.fold(None, |best: Option<IntensityAt>, one| best.filter(|best| best.value >= one.value).or(Some(one)))
}

/// Intensities of a half plane at even steps of gamma, `steps` from 0 to 180 degrees.
fn even(steps: usize, at: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
    (0..=steps).map(|i| 180.0 * i as f64 / steps as f64).map(|gamma| (gamma, at(gamma))).collect()
}

/// Report on the plane of the half planes at the azimuths `c` and `c` + 180°.
fn plane(name: &'static str, c: f64, half: impl Fn(f64) -> Vec<(f64, f64)>) -> PlaneReport {
    let plane = Plane::of(&half(c), &half(c + 180.0));
    let peak = plane.peak().map(|(along, value)| {
        let c = if along < 0.0 { c + 180.0 } else { c };
        IntensityAt { value, c, gamma: along.abs() }
    });
    PlaneReport { plane: name, peak, beam: plane.width(0.5), field: plane.width(0.1) }
}

/// Flux of the zones from the intensities at the middles of small parts, scaled to add up to `flux`.
fn midpoints(flux: Option<f64>, at: impl Fn(f64, f64) -> f64) -> Vec<ZoneReport> {
    let (parts, around) = PARTS;
    let mut sums = [0.0; ZONES.len() - 1];
    for i in 0..parts {
        let gammas = [i, i + 1].map(|i| 180.0 * i as f64 / parts as f64);
        let middle = 0.5 * (gammas[0] + gammas[1]);
        let ring = (0..around).map(|k| at(360.0 * (k as f64 + 0.5) / around as f64, middle));
        let mean = ring.filter(|value| !value.is_nan()).sum::<f64>() / around as f64;
        let zone = ZONES[1..].partition_point(|border| *border <= middle).min(sums.len() - 1);
        let [near, far] = gammas.map(|gamma| libm::cos(gamma.to_radians()));
        sums[zone] += std::f64::consts::TAU * (near - far) * mean;
    }
    let total: f64 = sums.iter().sum();
    let factor = flux.filter(|_| total != 0.0).map_or(1.0, |flux| flux / total);
    let zones = ZONES.array_windows().zip(sums);
    zones.map(|(&[from, to], sum)| ZoneReport { from, to, flux: flux.map(|_| factor * sum) }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::{
        Axis, AzimuthExtent, Azimuths, Domain, Measurement, Sampling, Tensor, TriangleMesh, WavelengthGrid,
    };
    use std::f64::consts::PI;

    fn grid(frame: Frame, polar: (f64, f64, usize), azimuths: Option<(Vec<f64>, AzimuthExtent)>) -> DirectionGrid {
        let (from, step, count) = polar;
        let polar = (0..count).map(|i| from + step * i as f64).collect();
        let azimuths = azimuths.map(|(angles, extent)| Azimuths { angles, extent });
        DirectionGrid::new(frame, polar, azimuths).unwrap().with_outside(Outside::Dark)
    }

    fn report(axes: Vec<Axis>, unit: Unit, value: impl Fn(Direction) -> f64) -> LuminaireReport {
        let lambdas = axes[1..].iter().map(Axis::len).product();
        let samples = (0..axes[0].len()).flat_map(|entry| {
            let direction = axes[0].direction(entry).unwrap();
            std::iter::repeat_n(value(direction) as f32, lambdas)
        });
        let samples = samples.collect();
        let tensor = Tensor::new(axes, samples).unwrap();
        let measurement = Measurement::new(Quantity::Edf, unit, Sampling::Average, tensor).unwrap();
        Material::of(measurement).unwrap().luminaire().remove(0)
    }

    fn lambert(direction: Direction) -> f64 {
        100.0 * (-direction.cos_theta()).max(0.0)
    }

    #[test]
    fn a_lambertian_luminaire_has_the_figures_of_the_cosine() {
        let every = |step: f64, count: usize| (0..count).map(|i| step * i as f64).collect::<Vec<_>>();
        let around = |step: f64, count: usize, extent| Some((every(step, count), extent));
        let type_b = ((-90.0, 1.0, 181), Some(((-90..=90).map(f64::from).collect(), AzimuthExtent::Sector)));
        for (axis, off) in [
            (Axis::Grid(grid(Frame::TypeC, (0.0, 1.0, 91), None)), 1e-4),
            (Axis::Grid(grid(Frame::TypeC, (0.0, 1.0, 91), around(45.0, 3, AzimuthExtent::Quadrant))), 1e-4),
            (Axis::Grid(grid(Frame::TypeC, (0.0, 1.0, 91), around(30.0, 13, AzimuthExtent::Closed))), 1e-4),
            (Axis::Grid(grid(Frame::Surface, (90.0, 1.0, 91), around(30.0, 12, AzimuthExtent::Circle))), 1e-4),
            (Axis::Grid(grid(Frame::TypeB, type_b.0, type_b.1)), 1e-3),
            (Axis::Triangles(TriangleMesh::new(Domain::Lower, 5).unwrap()), 2e-2),
        ] {
            let report = report(vec![axis.clone()], Unit::Candela, lambert);
            let name = axis.describe();
            let near = |found: f64, wanted: f64| (found / wanted - 1.0).abs() < off;
            assert!(near(report.flux.unwrap(), 100.0 * PI) && report.flux_unit == "lm", "{name} {report:?}");
            let peak = report.peak.unwrap();
            assert!(near(peak.value, 100.0) && peak.gamma < 3.0, "{name} {peak:?}");
            assert_eq!(report.planes.iter().map(|plane| plane.plane).collect::<Vec<_>>(), ["C0-C180", "C90-C270"]);
            for plane in &report.planes {
                assert!(near(plane.beam.unwrap(), 120.0), "{name} {plane:?}");
                assert!(near(plane.field.unwrap(), 2.0 * 0.1_f64.acos().to_degrees()), "{name} {plane:?}");
            }
            for zone in &report.zones[..4] {
                let wanted = 100.0 * PI * (zone.to.to_radians().sin().powi(2) - zone.from.to_radians().sin().powi(2));
                assert!(near(zone.flux.unwrap(), wanted), "{name} {zone:?} {wanted}");
            }
            let sum: f64 = report.zones.iter().map(|zone| zone.flux.unwrap()).sum();
            assert!((sum / report.flux.unwrap() - 1.0).abs() < 1e-6, "{name} {sum}");
        }
    }

    #[test]
    fn planes_between_those_of_the_file_are_interpolated_and_the_peak_is_a_sample() {
        // Brighter towards C 90 than towards C 0.
        let lobe = |direction: Direction| {
            let [x, y, z] = direction.xyz();
            if z > 0.0 { 0.0 } else { 100.0 * libm::exp(-20.0 * x * x - 2.0 * y * y) }
        };
        let azimuths = Some((vec![22.5, 67.5, 112.5, 157.5, 202.5, 247.5, 292.5, 337.5], AzimuthExtent::Circle));
        let report = report(vec![Axis::Grid(grid(Frame::TypeC, (0.0, 2.5, 37), azimuths))], Unit::Candela, lobe);
        let beams: Vec<f64> = report.planes.iter().map(|plane| plane.beam.unwrap()).collect();
        assert!(beams[0] < beams[1] && beams[0] > 20.0, "{beams:?}");
        for peak in [report.peak, report.planes[0].peak] {
            let IntensityAt { value, c, gamma } = peak.unwrap();
            assert!((value - 100.0).abs() < 1e-4 && c == 0.0 && gamma == 0.0, "{peak:?}");
        }
    }

    #[test]
    fn visible_spectra_make_candela_and_others_totals() {
        let axis = |first: f64| {
            let lambda = WavelengthGrid::even(first, 10.0, 41).unwrap();
            vec![Axis::Grid(grid(Frame::TypeC, (0.0, 5.0, 19), None)), Axis::Wavelength(lambda)]
        };
        let seen = report(axis(380.0), Unit::MilliwattPerSteradianNanometre, lambert);
        // ∫ V dλ = 106.857 nm for the CIE 1931 observer.
        let candela = 683.0 * 100.0 * 106.857e-3;
        assert_eq!((seen.unit, seen.flux_unit), (Unit::Candela, "lm"));
        assert!((seen.peak.unwrap().value / candela - 1.0).abs() < 1e-3 && seen.zones[0].flux > Some(0.0), "{seen:?}");
        let unseen = report(axis(800.0), Unit::MilliwattPerSteradianNanometre, lambert);
        assert_eq!((unseen.unit, unseen.flux_unit), (Unit::MilliwattPerSteradian, "mW"));
        assert!((unseen.peak.unwrap().value / 40_000.0 - 1.0).abs() < 1e-6, "{unseen:?}");
        let dark = report(axis(380.0), Unit::MilliwattPerSteradianNanometre, |_| 0.0);
        assert_eq!((dark.peak, dark.flux, dark.planes[0].beam), (None, Some(0.0), None));
    }
}
