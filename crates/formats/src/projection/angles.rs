//! Grids of angles as functions on the sphere: bilinear in (theta, phi), constant from the outermost angles to the
//! ends of the covered range.

use super::error::{Angle, AnglesError, ProjectionError, Role};
use crate::domain::{Direction, TriangleMesh};
use crate::formats::{Angles, AzimuthExtent, Azimuths};
use crate::numeric::bracket::Bracket;

/// Degrees by which a sample direction on the boundary of the covered range of angles is moved inside. It then falls
/// into a triangle that the range covers.
const INSIDE: f64 = 1e-6;
/// Number of azimuths, on the ring that a sample without azimuth represents, at which the sample is compared with
/// averages over triangles. Raising it makes comparisons finer and slower.
const RING: usize = 16;
/// Polar angle in degrees of the horizon of a surface.
pub(super) const HORIZON: f64 = 90.0;

/// Checks that the polar angles and azimuths of a file form a valid grid.
pub(super) fn check(role: Role, angles: &Angles) -> Result<(), ProjectionError> {
    let unfit = |angles| Err(ProjectionError::Angles { role, angles });
    let theta = &angles.theta;
    let (Some(&first), Some(&last)) = (theta.first(), theta.last()) else {
        return unfit(AnglesError::Empty { angle: Angle::Theta });
    };
    if let Some(&found) = theta.iter().find(|t| !(0.0..=180.0).contains(*t)) {
        return unfit(AnglesError::Range { angle: Angle::Theta, found });
    }
    if let Some([a, b]) = theta.array_windows().find(|[a, b]| b <= a) {
        return unfit(AnglesError::Order { angle: Angle::Theta, found: *b, before: *a });
    }
    let (low, high) = angles.covers;
    if !(low >= 0.0 && low <= first && last <= high && high <= 180.0) {
        return unfit(AnglesError::Covers { low, high, first, last });
    }
    let Some(azimuths) = &angles.phi else { return Ok(()) };
    let phi = &azimuths.phi;
    let (Some(&first), Some(&last)) = (phi.first(), phi.last()) else {
        return unfit(AnglesError::Empty { angle: Angle::Phi });
    };
    if let Some(&found) = phi.iter().find(|p| !(-360.0..=720.0).contains(*p)) {
        return unfit(AnglesError::Range { angle: Angle::Phi, found });
    }
    if let Some([a, b]) = phi.array_windows().find(|[a, b]| b <= a) {
        return unfit(AnglesError::Order { angle: Angle::Phi, found: *b, before: *a });
    }
    let extent = azimuths.extent;
    let fits = match extent {
        AzimuthExtent::Circle => last - first < 360.0,
        AzimuthExtent::Mirrored => first >= 0.0 && last <= 180.0,
        AzimuthExtent::Sector => last - first <= 360.0,
    };
    if fits { Ok(()) } else { unfit(AnglesError::Extent { extent, first, last }) }
}

/// Refuses a checked grid of angles that covers no area on the sphere: averages over a triangle would be undefined.
pub(super) fn check_area(role: Role, angles: &Angles) -> Result<(), ProjectionError> {
    let unfit = |angles| Err(ProjectionError::Angles { role, angles });
    let (low, high) = angles.covers;
    let sector = angles.phi.as_ref().filter(|azimuths| azimuths.extent == AzimuthExtent::Sector);
    if low == high {
        return unfit(AnglesError::OneTheta { theta: low });
    }
    match sector.map(|azimuths| azimuths.phi.as_slice()) {
        Some(&[phi]) => unfit(AnglesError::OneAzimuth { phi }),
        _ => Ok(()),
    }
}

/// Returns the number of samples of a grid of angles: polar angles times azimuths.
pub(super) fn count(angles: &Angles) -> usize {
    angles.theta.len() * columns(angles)
}

fn columns(angles: &Angles) -> usize {
    angles.phi.as_ref().map_or(1, |azimuths| azimuths.phi.len())
}

/// Returns the mean spacing of a grid of angles in degrees: that of the polar angles, and that of the azimuths if there
/// is more than one.
pub(super) fn mean_spacing(angles: &Angles) -> (f64, Option<f64>) {
    let even = |values: &[f64]| match values {
        [first, .., last] => Some((last - first) / (values.len() - 1) as f64),
        _ => None,
    };
    let theta = even(&angles.theta).unwrap_or(angles.covers.1 - angles.covers.0);
    let phi = angles.phi.as_ref().filter(|azimuths| azimuths.phi.len() > 1).and_then(|azimuths| {
        if azimuths.extent == AzimuthExtent::Circle {
            Some(360.0 / azimuths.phi.len() as f64)
        } else {
            even(&azimuths.phi)
        }
    });
    (theta, phi)
}

/// Returns the smallest difference in degrees between neighbouring polar angles or neighbouring azimuths of a grid.
pub(super) fn finest_spacing(angles: &Angles) -> f64 {
    let (theta, phi) = mean_spacing(angles);
    let azimuths = angles.phi.as_ref().map_or(&[][..], |azimuths| &azimuths.phi);
    let gaps = angles.theta.array_windows().chain(azimuths.array_windows()).map(|[a, b]| b - a);
    gaps.fold(theta.min(phi.unwrap_or(theta)), f64::min)
}

/// Samples of a grid of angles that determine the value in one direction: two rows of theta and two columns of phi,
/// with their linear weights.
pub(super) struct Stencil {
    pub(super) rows: [(usize, f64); 2],
    pub(super) columns: [(usize, f64); 2],
}

/// Bilinear interpolant on a checked grid of polar angles and azimuths; returns the samples and weights for a
/// direction.
pub(super) struct Interpolant<'a> {
    angles: &'a Angles,
    /// Weight of each azimuth of the grid in the mean of the linear interpolant over azimuth; the weights sum to 1.
    azimuth_mean: Vec<f64>,
    /// True for a surface, whose two sides are functions of their own: each is constant from its outermost angle to the
    /// horizon.
    is_parted: bool,
}

impl<'a> Interpolant<'a> {
    pub(super) fn new(angles: &'a Angles, is_parted: bool) -> Self {
        let azimuth_mean = angles.phi.as_ref().map_or_else(|| vec![1.0], azimuth_mean);
        Self { angles, azimuth_mean, is_parted }
    }

    /// Returns the number of azimuths of the grid. The sample at (theta row, phi column) has index `row · columns +
    /// column`.
    pub(super) fn columns(&self) -> usize {
        self.azimuth_mean.len()
    }

    /// Returns true if a row of the grid lies at a pole of the sphere. All azimuths are one direction there, so the
    /// value of the row is its mean over azimuth.
    pub(super) fn is_pole(&self, row: usize) -> bool {
        let theta = self.angles.theta[row];
        theta == 0.0 || theta == 180.0
    }

    /// Returns the weight of each azimuth in the mean over azimuth of a row of constant theta.
    pub(super) fn azimuth_mean(&self) -> &[f64] {
        &self.azimuth_mean
    }

    /// Returns true if the grid of angles has a value at `direction`.
    pub(super) fn covers(&self, direction: Direction) -> bool {
        self.at(direction).is_some()
    }

    /// Returns the samples that determine the interpolated value at `direction`; `None` outside the covered range of
    /// angles.
    pub(super) fn at(&self, direction: Direction) -> Option<Stencil> {
        let theta = direction.theta_degrees();
        let (low, high) = self.angles.covers;
        if theta < low || theta > high {
            return None;
        }
        let columns = match &self.angles.phi {
            None => [(0, 1.0), (0, 0.0)],
            Some(azimuths) => azimuth_columns(azimuths, direction.phi_degrees())?,
        };
        Some(Stencil { rows: self.rows(theta).weights(), columns })
    }

    /// Returns the rows around a polar angle.
    fn rows(&self, theta: f64) -> Bracket {
        let angles = &self.angles.theta;
        let rows = Bracket::held(angles, theta);
        let is_across = self.is_parted && angles[rows.below] <= HORIZON && angles[rows.above] > HORIZON;
        if is_across { Bracket { t: f64::from(u8::from(theta > HORIZON)), ..rows } } else { rows }
    }
}

fn azimuth_columns(azimuths: &Azimuths, phi: f64) -> Option<[(usize, f64); 2]> {
    let values = azimuths.phi.as_slice();
    let (first, last) = (values[0], values[values.len() - 1]);
    let around = |phi: f64| Bracket::held(values, phi).weights();
    match azimuths.extent {
        // Beyond the ends, a sample and its mirror image are neighbours with equal values: constant is linear there.
        AzimuthExtent::Mirrored => Some(around(if phi > 180.0 { 360.0 - phi } else { phi })),
        AzimuthExtent::Circle => {
            let phi = first + (phi - first).rem_euclid(360.0);
            if phi < last {
                return Some(around(phi));
            }
            let t = (phi - last) / (first + 360.0 - last);
            Some([(values.len() - 1, 1.0 - t), (0, t)])
        }
        AzimuthExtent::Sector => {
            let phi = first + (phi - first).rem_euclid(360.0);
            (phi <= last).then(|| around(phi))
        }
    }
}

/// Returns trapezoidal weights, one for each azimuth, of the mean over the covered azimuths. They include the seam of a
/// full circle and mirrored halves.
fn azimuth_mean(azimuths: &Azimuths) -> Vec<f64> {
    let values = azimuths.phi.as_slice();
    let n = values.len();
    if n == 1 {
        return vec![1.0];
    }
    let (first, last) = (values[0], values[n - 1]);
    let (before, after) = match azimuths.extent {
        AzimuthExtent::Circle => {
            let seam = 0.5 * (first + 360.0 - last);
            (seam, seam)
        }
        AzimuthExtent::Mirrored => (first, 180.0 - last),
        AzimuthExtent::Sector => (0.0, 0.0),
    };
    let total = last - first + before + after;
    (0..n)
        .map(|i| {
            let left = if i == 0 { before } else { 0.5 * (values[i] - values[i - 1]) };
            let right = if i + 1 == n { after } else { 0.5 * (values[i + 1] - values[i]) };
            (left + right) / total
        })
        .collect()
}

/// Returns the directions of the samples of a grid of angles as (sample, direction), in sample order. A sample without
/// azimuth yields several directions on its ring. Samples on the boundary of the covered range are moved inside by a
/// millionth of a degree.
pub(super) fn sample_directions(angles: &Angles) -> Vec<(usize, Direction)> {
    let (low, high) = angles.covers;
    let theta = |t: f64| if high - low > 2.0 * INSIDE { t.clamp(low + INSIDE, high - INSIDE) } else { t };
    match &angles.phi {
        None => (0..angles.theta.len() * RING)
            .map(|i| {
                let phi = ((i % RING) as f64 + 0.5) * (360.0 / RING as f64);
                (i / RING, Direction::from_degrees(theta(angles.theta[i / RING]), phi))
            })
            .collect(),
        Some(azimuths) => {
            let (first, last) = (azimuths.phi[0], azimuths.phi[azimuths.phi.len() - 1]);
            let sector = azimuths.extent == AzimuthExtent::Sector && last - first > 2.0 * INSIDE;
            let phi = |p: f64| if sector { p.clamp(first + INSIDE, last - INSIDE) } else { p };
            let n = azimuths.phi.len();
            (0..angles.theta.len() * n)
                .map(|i| (i, Direction::from_degrees(theta(angles.theta[i / n]), phi(azimuths.phi[i % n]))))
                .collect()
        }
    }
}

/// Returns the triangles of `mesh` that contain samples of a grid of angles, as (sample, triangle). Mirrored samples
/// also count in the triangles of their mirror images. A ring without azimuth counts in every triangle whose vertices
/// enclose its theta.
pub(super) fn sampled_cells(angles: &Angles, mesh: TriangleMesh) -> Vec<(usize, usize)> {
    match &angles.phi {
        None => {
            let mut cells = Vec::new();
            for (cell, vertices) in mesh.all_vertices().into_iter().enumerate() {
                let theta = vertices.map(|v| Direction::from_unit(v).theta_degrees());
                let (low, high) = theta.iter().fold((180.0_f64, 0.0_f64), |(l, h), &t| (l.min(t), h.max(t)));
                let from = angles.theta.partition_point(|&t| t < low);
                let to = angles.theta.partition_point(|&t| t <= high);
                cells.extend((from..to).map(|sample| (sample, cell)));
            }
            cells
        }
        Some(azimuths) => {
            let mirrored = azimuths.extent == AzimuthExtent::Mirrored;
            let mut cells = Vec::new();
            for (sample, direction) in sample_directions(angles) {
                cells.extend(mesh.locate(direction).map(|cell| (sample, cell)));
                if mirrored {
                    let [x, y, z] = direction.xyz();
                    let image = Direction::from_unit([x, -y, z]);
                    cells.extend(mesh.locate(image).map(|cell| (sample, cell)));
                }
            }
            cells
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn angles(theta: &[f64], covers: (f64, f64), phi: Option<(&[f64], AzimuthExtent)>) -> Angles {
        let phi = phi.map(|(phi, extent)| Azimuths { phi: phi.to_vec(), extent });
        Angles { theta: theta.to_vec(), covers, phi }
    }

    fn value(angles: &Angles, at: (f64, f64), f: impl Fn(usize, usize) -> f64) -> Option<f64> {
        let interpolant = Interpolant::new(angles, false);
        let stencil = interpolant.at(Direction::from_degrees(at.0, at.1))?;
        let mut sum = 0.0;
        for (r, wr) in stencil.rows {
            for (c, wc) in stencil.columns {
                sum += wr * wc * f(r, c);
            }
        }
        Some(sum)
    }

    #[test]
    fn azimuths_wrap_fold_and_end() {
        let f = |_: usize, c: usize| c as f64;
        let circle = angles(&[45.0], (0.0, 90.0), Some((&[0.0, 90.0, 180.0, 270.0], AzimuthExtent::Circle)));
        assert!((value(&circle, (50.0, 45.0), f).unwrap() - 0.5).abs() < 1e-9);
        assert!((value(&circle, (50.0, 315.0), f).unwrap() - 1.5).abs() < 1e-9);
        let mirrored = angles(&[45.0], (0.0, 90.0), Some((&[10.0, 90.0, 170.0], AzimuthExtent::Mirrored)));
        assert_eq!(value(&mirrored, (50.0, 0.0), f), Some(0.0));
        assert!((value(&mirrored, (50.0, 310.0), f).unwrap() - 0.5).abs() < 1e-9);
        let sector = angles(&[45.0], (0.0, 90.0), Some((&[-10.0, 10.0], AzimuthExtent::Sector)));
        assert!((value(&sector, (50.0, 355.0), f).unwrap() - 0.25).abs() < 1e-9);
        assert_eq!(value(&sector, (50.0, 11.0), f), None);
        assert_eq!(value(&sector, (91.0, 0.0), f), None);
    }

    #[test]
    fn theta_is_held_to_what_is_covered() {
        let grid = angles(&[10.0, 20.0], (0.0, 25.0), None);
        let f = |r: usize, _: usize| r as f64;
        assert_eq!(value(&grid, (3.0, 7.0), f), Some(0.0));
        assert!((value(&grid, (15.0, 7.0), f).unwrap() - 0.5).abs() < 1e-9);
        assert_eq!(value(&grid, (24.0, 7.0), f), Some(1.0));
        assert_eq!(value(&grid, (26.0, 7.0), f), None);
    }

    #[test]
    fn the_mean_over_azimuth_is_that_of_the_full_circle() {
        let mirrored = Azimuths { phi: vec![0.0, 60.0, 120.0, 180.0], extent: AzimuthExtent::Mirrored };
        let mean = azimuth_mean(&mirrored);
        for (found, expected) in mean.iter().zip([1.0, 2.0, 2.0, 1.0]) {
            assert!((found - expected / 6.0).abs() < 1e-15);
        }
        let circle = Azimuths { phi: vec![5.0, 95.0, 185.0, 275.0], extent: AzimuthExtent::Circle };
        assert_eq!(azimuth_mean(&circle), [0.25; 4]);
    }

    #[test]
    fn samples_on_the_rim_lie_in_cells_of_their_own_side() {
        let sphere = TriangleMesh::new(crate::domain::Domain::Sphere, 3).unwrap();
        let lower = angles(&[90.0, 180.0], (90.0, 180.0), Some((&[0.0, 120.0, 240.0], AzimuthExtent::Circle)));
        for (_, direction) in sample_directions(&lower) {
            assert!(sphere.locate(direction).unwrap() >= sphere.len() / 2);
        }
    }

    #[test]
    fn spacings_count_the_seam_of_a_circle() {
        let grid = angles(&[0.0, 2.5, 5.0], (0.0, 5.0), Some((&[0.0, 120.0, 240.0], AzimuthExtent::Circle)));
        assert_eq!(mean_spacing(&grid), (2.5, Some(120.0)));
        assert_eq!(finest_spacing(&grid), 2.5);
        assert_eq!(count(&grid), 9);
    }

    #[test]
    fn malformed_angles_are_refused() {
        let good = angles(&[0.0, 90.0], (0.0, 90.0), Some((&[0.0, 180.0], AzimuthExtent::Mirrored)));
        assert_eq!(check(Role::Incoming, &good), Ok(()));
        let sector = AzimuthExtent::Sector;
        for (bad, expected) in [
            (angles(&[], (0.0, 90.0), None), "no theta"),
            (angles(&[0.0, 190.0], (0.0, 180.0), None), "theta 190"),
            (angles(&[f64::NAN], (0.0, 180.0), None), "theta NaN"),
            (angles(&[5.0, 5.0], (0.0, 180.0), None), "strictly increasing"),
            (angles(&[5.0, 8.0], (6.0, 180.0), None), "covers theta"),
            (angles(&[5.0], (0.0, 180.0), Some((&[], sector))), "no phi"),
            (angles(&[5.0], (0.0, 180.0), Some((&[3.0, 2.0], sector))), "strictly increasing"),
            (angles(&[5.0], (0.0, 180.0), Some((&[f64::INFINITY], sector))), "phi inf"),
            (angles(&[5.0], (0.0, 180.0), Some((&[-1.0, 2.0], AzimuthExtent::Mirrored))), "mirrored"),
            (angles(&[5.0], (0.0, 180.0), Some((&[0.0, 360.0], AzimuthExtent::Circle))), "less than 360 degrees"),
            (angles(&[5.0], (0.0, 180.0), Some((&[0.0, 361.0], sector))), "at most 360 degrees"),
        ] {
            let error = check(Role::Outgoing, &bad).unwrap_err();
            assert!(matches!(error, ProjectionError::Angles { .. }) && error.to_string().contains(expected), "{error}");
        }
        let flat = angles(&[5.0], (5.0, 5.0), None);
        assert!(check_area(Role::Outgoing, &flat).is_err());
        let plane = angles(&[5.0], (0.0, 90.0), Some((&[0.0], sector)));
        assert!(check_area(Role::Outgoing, &plane).is_err());
    }
}
