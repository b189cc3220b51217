//! Resolution of an export: default rules over the material's own axes, and the options that replace them.

use super::error::{ExportError, OptionError, setting};
use super::options::{ExportOptions, check_size};
use crate::domain::Axis;
use crate::evaluate::Material;

/// Upper bound on the count of numbers in an exported file of default resolution. Raising it keeps finer resolutions
/// and makes larger files.
const MOST_NUMBERS: usize = 1 << 26;
/// Default upper bound on the gap between the incident elevations of an exported BRDF, in degrees. Raising it makes
/// smaller files.
const ELEVATIONS: f64 = 3.75;
/// Default lower bound on the step between the incident azimuths of an exported BRDF, in degrees. Raising it makes
/// smaller files.
const AZIMUTHS: f64 = 5.0;
/// Limits on doubling the default steps between the incident elevations and between the incident azimuths of an
/// exported BRDF, in degrees: only smaller steps are doubled to meet the size limit. Nodes of outgoing directions are
/// reduced afterwards; raising the limits keeps more nodes.
const FEWEST: (f64, f64) = (7.5, 10.0);
/// Limit on doubling the step between the incident azimuths of an exported BRDF, in degrees, the last means of meeting
/// the size limit of the file: only a smaller step is doubled. Raising it lets more exports meet the size limit.
const WIDEST_AZIMUTHS: f64 = 22.5;
/// Lower and upper bound on the default number of nodes along a side (RGL) or of polar angles (MBSDF) of an exported
/// table.
const SIDES: (usize, usize) = (32, 128);
/// Allowed range of the requested number of nodes along a side (RGL) or of polar angles (MBSDF) of an exported table.
const ASKED_SIDES: std::ops::RangeInclusive<usize> = 2..=1024;
/// Upper bound on the number of scattering cosines of an exported phase function; at 1,048,576 the table has 16 MiB.
const MOST_COSINES: usize = 1 << 20;

/// Returns the axes of the triangles over which a material is averaged. For samples on a grid of angles these are
/// triangles of similar spacing.
pub(super) fn cell_axes(material: &Material) -> &[Axis] {
    material.over_triangles().map_or_else(|_| material.axes(), Material::axes)
}

/// Returns the subdivision level of the triangles of outgoing directions; each level halves the side of a triangle.
pub(super) fn outgoing_level(material: &Material) -> u8 {
    match material.layout().outgoing.map(|axis| &cell_axes(material)[axis]) {
        Some(Axis::Triangles(mesh)) => mesh.level(),
        _ => 0,
    }
}

/// Returns the width in degrees of a triangle of outgoing directions.
pub(super) fn cell(material: &Material) -> f64 {
    90.0 / f64::from(1_u32 << outgoing_level(material))
}

/// Returns the number of nodes along a side (RGL) or of polar angles (MBSDF) of an exported table.
pub(super) fn side(material: &Material, options: &ExportOptions) -> Result<usize, ExportError> {
    match options.side {
        Some(side) if ASKED_SIDES.contains(&side) => Ok(side),
        Some(side) => {
            let (low, high) = (*ASKED_SIDES.start(), *ASKED_SIDES.end());
            setting(OptionError::Side { found: side, low, high })
        }
        None => Ok((4_usize << outgoing_level(material)).clamp(SIDES.0, SIDES.1)),
    }
}

/// Directions and resolution of an exported RGL file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Incident {
    /// Polar angles of the incident directions in degrees.
    pub(super) theta: Vec<f64>,
    /// Azimuths of the incident directions in degrees; empty if the material is isotropic.
    pub(super) phi: Vec<f64>,
    /// Number of nodes along a side of the square table of outgoing directions.
    pub(super) side: usize,
}

/// Returns the incident directions of an exported RGL file with `channels` channels, and the number of nodes along a
/// side of its table of outgoing directions.
pub(super) fn incident(material: &Material, options: &ExportOptions, channels: usize) -> Result<Incident, ExportError> {
    let axis = material.layout().incoming.map(|axis| &cell_axes(material)[axis]);
    let own = match axis {
        Some(Axis::Elevation(values)) => values.clone(),
        _ => Vec::new(),
    };
    let azimuth_step = match axis {
        Some(Axis::Triangles(mesh)) => {
            Some(options.step.unwrap_or((22.5 / f64::from(1_u32 << mesh.level())).max(AZIMUTHS)))
        }
        _ => None,
    };
    let mut theta_step = options.step.unwrap_or(ELEVATIONS);
    let mut phi_step = azimuth_step;
    let mut side = side(material, options)?;
    let bytes = |found: &Incident| {
        // Each incident direction also has a density and a luminance.
        let slice = found.side.checked_mul(found.side)?.checked_mul(channels + 1)?.checked_add(64 * 64)?;
        found.phi.len().max(1).checked_mul(found.theta.len())?.checked_mul(slice)?.checked_mul(4)
    };
    let most = options.most_bytes.min(4 * MOST_NUMBERS);
    loop {
        let found = Incident { theta: elevations(&own, theta_step), phi: phi_step.map_or_else(Vec::new, turn), side };
        if bytes(&found).is_some_and(|bytes| bytes <= most) {
            return Ok(found);
        }
        // Requested values stay. Nodes are reduced late, because they resolve the lobes.
        if options.step.is_none() && theta_step < FEWEST.0 {
            theta_step *= 2.0;
        } else if options.step.is_none() && phi_step.is_some_and(|step| step < FEWEST.1) {
            phi_step = phi_step.map(|step| 2.0 * step);
        } else if options.side.is_none() && side > SIDES.0 {
            side = (side / 2).max(SIDES.0);
        } else if options.step.is_none() && phi_step.is_some_and(|step| step < WIDEST_AZIMUTHS) {
            phi_step = phi_step.map(|step| 2.0 * step);
        } else {
            check_size(bytes(&found), options, "ask for a smaller side or a larger step")?;
            return Ok(found);
        }
    }
}

/// Returns elevations (polar angles) from 0° to 90° that are at most `step` apart. Elevations in `own` are kept unless
/// they are closer than half a step; gaps are filled evenly.
fn elevations(own: &[f64], step: f64) -> Vec<f64> {
    let mut kept = vec![0.0];
    for &theta in own.iter().filter(|theta| **theta < 90.0 - 0.5 * step) {
        if theta - kept[kept.len() - 1] >= 0.5 * step {
            kept.push(theta);
        }
    }
    kept.push(90.0);
    let mut filled = vec![0.0];
    for [a, b] in kept.array_windows() {
        let parts = libm::ceil((b - a) / step - 1e-9).max(1.0) as usize;
        filled.extend((1..=parts).map(|i| if i == parts { *b } else { a + (b - a) * i as f64 / parts as f64 }));
    }
    filled
}

/// Returns evenly spaced azimuths from −180° to 180°, at most `step` degrees apart.
fn turn(step: f64) -> Vec<f64> {
    let parts = (libm::ceil(360.0 / step - 1e-9) as usize).max(2);
    (0..=parts).map(|i| if i == parts { 180.0 } else { 360.0 * i as f64 / parts as f64 - 180.0 }).collect()
}

/// Returns the step between the gamma angles, and the step between the C planes, of an exported luminaire, in degrees.
pub(super) fn planes(material: &Material, options: &ExportOptions) -> (f64, f64) {
    let first =
        |steps: &[f64], most: f64| steps.iter().copied().find(|&step| step <= most).unwrap_or(steps[steps.len() - 1]);
    let cell = cell(material);
    match options.step {
        Some(step) => (step, step),
        None => (first(&[5.0, 2.5, 1.0, 0.5], 0.25 * cell), first(&[15.0, 10.0, 5.0, 2.5, 1.0], 0.5 * cell)),
    }
}

/// Returns the number of scattering cosines at which a phase function is exported.
pub(super) fn cosines(material: &Material, options: &ExportOptions) -> Result<usize, ExportError> {
    match options.side {
        Some(count) if (2..=MOST_COSINES).contains(&count) => Ok(count),
        Some(count) => setting(OptionError::Cosines { found: count, most: MOST_COSINES }),
        None => Ok(match own_cosines(material) {
            Some(count) => count,
            None => ((8_usize << (2 * outgoing_level(material))) + 1).clamp(257, 16_385),
        }),
    }
}

/// Returns the number of measured scattering angles if their cosines are evenly spaced from -1 to 1, as in tabphase
/// files.
fn own_cosines(material: &Material) -> Option<usize> {
    let Axis::Grid(grid) = &material.axes()[material.layout().outgoing?] else { return None };
    let polar = grid.polar();
    let last = polar.len().checked_sub(1).filter(|&last| last > 0 && polar.len() <= MOST_COSINES)?;
    let cosine = |i: usize| 1.0 - 2.0 * i as f64 / last as f64;
    let is_even = (0..=last).all(|i| (libm::cos(polar[i].to_radians()) - cosine(i)).abs() < 1e-9);
    (is_even && grid.azimuths().is_none()).then_some(polar.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elevations_hold_their_own_and_leave_no_wide_gap() {
        let found = elevations(&[0.0, 10.0, 30.0, 87.0], 5.0);
        assert_eq!(found[..4], [0.0, 5.0, 10.0, 15.0]);
        assert!(found.contains(&30.0) && found.contains(&87.0) && found.last() == Some(&90.0));
        assert!(found.array_windows().all(|[a, b]| b > a && b - a <= 5.0 + 1e-9));
        let dense: Vec<f64> = (0..=90).map(f64::from).collect();
        assert_eq!(elevations(&dense, 1.0).len(), 91);
        assert!(elevations(&dense, 3.75).len() <= 46);
    }

    #[test]
    fn a_turn_has_both_ends() {
        assert_eq!(turn(90.0), [-180.0, -90.0, 0.0, 90.0, 180.0]);
        assert_eq!((turn(11.25).len(), turn(7.0).len()), (33, 53));
    }
}
