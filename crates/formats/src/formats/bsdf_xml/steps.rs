//! Grid of angles on which functions that are constant over patches keep their values: steps at the patches' borders.

use super::super::acquisition::{AngleGrid, Angles, AzimuthExtent, Azimuths, Outside, ParseReport};
use super::super::error::{FormatError, FormatErrorKind};
use super::super::lit_side::{LitSide, within_turn};
use super::about::NAME;
use super::basis::Basis;
use crate::notes::{Brief, ScatteringNote};

/// Matrix over patches, row-major `[incoming, outgoing]`.
pub(super) struct Part {
    pub(super) incoming: Basis,
    pub(super) outgoing: Basis,
    pub(super) values: Vec<f32>,
    /// Side from which light comes.
    pub(super) side: LitSide,
    /// True for transmitted light, which leaves below the surface.
    pub(super) is_below: bool,
}

/// Half the width in degrees of a step at the border of two patches. Raising it moves light across borders; lowering it
/// makes steps that rounding of directions may miss.
const HALF_STEP: f64 = 1e-5;
/// Polar angle in degrees of the transmitted side's horizon where the reflected side has 90°.
const BELOW_HORIZON: f64 = 90.000_001;
/// Upper bound on the values of the grid. Klems' full basis needs 2 million for both sides. Raising it reads bases with
/// more patches and takes more memory.
const MAX_VALUES: usize = 1 << 25;
/// Azimuths of incidence of a basis whose patches are whole rings.
const QUARTERS: [f64; 4] = [0.0, 90.0, 180.0, 270.0];
/// Part of a patch's width within which an azimuth counts as that of its centre.
const ROUNDING: f64 = 1e-9;

/// Polar angle of outgoing directions: matrix, ring of its outgoing basis, and angle in degrees.
type Row = (usize, usize, f64);

/// Builds the grid of one matrix, or of reflection and transmission of one incident basis.
///
/// Incoming directions are the centres of patches, at the azimuths of the centres of all rings; a ring that has no
/// centre at an azimuth is interpolated between its two neighbouring centres. Outgoing directions are two polar angles
/// and two azimuths at each border, just inside either patch, so that values are those of the patches nearly
/// everywhere.
pub(super) fn grid(parts: &[Part], report: &mut ParseReport) -> Result<AngleGrid, FormatError> {
    let refuse = |kind, message: String| Err(FormatError::new(kind, NAME, message));
    let Some(first) = parts.first() else {
        return refuse(FormatErrorKind::Malformed, "no function, expected reflection or transmission".to_owned());
    };
    let incoming = &first.incoming;
    if parts.iter().any(|part| part.incoming.rings != incoming.rings) {
        let message = "reflection and transmission have different incident bases: ask for brdf or btdf (quantity)";
        return refuse(FormatErrorKind::NeedsOption, message.to_owned());
    }
    let side = first.side;
    let turns = incoming_azimuths(incoming, side);
    let rows = rows(parts);
    let azimuths = borders(parts);
    let columns = azimuths.len().max(1);
    let shape = [incoming.rings.len(), turns.len(), rows.len(), columns];
    let count = shape.into_iter().try_fold(1_usize, usize::checked_mul).filter(|&count| count <= MAX_VALUES);
    let Some(count) = count else {
        let message = format!(
            "patches whose borders make a grid of {} incoming × {} outgoing directions, expected at most {MAX_VALUES} values: \
             ask for one side alone (quantity brdf or btdf)",
            shape[0] * shape[1],
            shape[2] * shape[3]
        );
        return refuse(FormatErrorKind::OverLimit, message);
    };
    // The patch of each outgoing direction.
    let starts: Vec<Vec<usize>> = parts.iter().map(|part| part.outgoing.starts()).collect();
    let mut outgoing = Vec::with_capacity(rows.len() * columns);
    for &(part, ring, _) in &rows {
        let (start, of_ring) = (starts[part][ring], &parts[part].outgoing.rings[ring]);
        let azimuth = |column: usize| azimuths.get(column).copied().unwrap_or(0.0);
        outgoing.extend((0..columns).map(|column| (part, start + of_ring.patch_at(side.leaving(azimuth(column))))));
    }
    let mut values = Vec::with_capacity(count);
    for (ring, start) in incoming.rings.iter().zip(incoming.starts()) {
        for &turn in &turns {
            let place = side.incident(turn) / 360.0 * ring.count as f64;
            let [below, t] = [libm::floor(place), place - libm::floor(place)];
            let patch = |step: usize| start + (below as usize + step) % ring.count;
            let [one, two] = [patch(0), patch(1)];
            values.extend(outgoing.iter().map(|&(part, out)| {
                let part = &parts[part];
                let value = |patch: usize| part.values[patch * part.outgoing.len() + out];
                match t {
                    t if t < ROUNDING => value(one),
                    t if t > 1.0 - ROUNDING => value(two),
                    t => ((1.0 - t) * f64::from(value(one)) + t * f64::from(value(two))) as f32,
                }
            }));
        }
    }
    note(parts, shape, report);
    let covers = match (parts.iter().any(|part| !part.is_below), parts.iter().any(|part| part.is_below)) {
        (true, true) => (0.0, 180.0),
        (true, false) => (0.0, 90.0),
        _ => (90.0, 180.0),
    };
    let steps = azimuths.array_windows().map(|[from, to]| to - from);
    let is_wide = azimuths.is_empty() || steps.fold(0.0, f64::max) > 90.0;
    let phi = |phi: Vec<f64>| (!phi.is_empty()).then_some(Azimuths { phi, extent: AzimuthExtent::Circle });
    let theta = incoming.rings.iter().map(|ring| ring.theta).collect();
    Ok(AngleGrid {
        index: Vec::new(),
        incoming: Some(Angles { theta, covers: (0.0, 90.0), phi: phi(turns) }),
        outgoing: Some(Angles { theta: rows.iter().map(|row| row.2).collect(), covers, phi: phi(azimuths) }),
        spectral: None,
        // A patch has one value, however wide it is.
        outside: if is_wide { Outside::Zero } else { Outside::Masked },
        values: values.into(),
        stated: None,
        sigma: None,
    })
}

/// Returns the azimuths, in degrees, from which light comes at the centres of all patches.
fn incoming_azimuths(basis: &Basis, side: LitSide) -> Vec<f64> {
    let rings = basis.rings.iter().filter(|ring| ring.count > 1);
    let centres = rings.flat_map(|ring| (0..ring.count).map(|k| side.incident(360.0 * k as f64 / ring.count as f64)));
    let azimuths = sorted(centres.collect());
    if azimuths.is_empty() { QUARTERS.to_vec() } else { azimuths }
}

/// Returns the azimuths, in degrees, on either side of all borders between patches of one ring; empty if all patches
/// are whole rings.
fn borders(parts: &[Part]) -> Vec<f64> {
    let borders = parts.iter().flat_map(|part| {
        let rings = part.outgoing.rings.iter().filter(|ring| ring.count > 1);
        rings.flat_map(|ring| (0..ring.count).map(|k| part.side.leaving(360.0 * (k as f64 + 0.5) / ring.count as f64)))
    });
    let beside = |border: f64| [border - HALF_STEP, border + HALF_STEP].map(within_turn);
    let mut azimuths: Vec<f64> = sorted(borders.collect()).into_iter().flat_map(beside).collect();
    azimuths.sort_by(f64::total_cmp);
    azimuths
}

/// Sorts angles in degrees and removes equal ones.
fn sorted(mut angles: Vec<f64>) -> Vec<f64> {
    angles.sort_by(f64::total_cmp);
    angles.dedup_by(|a, b| (*a - *b).abs() < HALF_STEP);
    angles
}

/// Returns the polar angles of outgoing directions in increasing order: just inside either bound of each ring.
fn rows(parts: &[Part]) -> Vec<Row> {
    let has_above = parts.iter().any(|part| !part.is_below);
    let mut rows: Vec<Row> = Vec::new();
    for (number, part) in parts.iter().enumerate() {
        for (ring, of) in part.outgoing.rings.iter().enumerate() {
            let [low, high] = of.bounds;
            // Patches that meet at the pole have no common value there.
            let low = if low == 0.0 && of.count == 1 { 0.0 } else { low + HALF_STEP };
            let high = if high == 90.0 { 90.0 } else { high - HALF_STEP };
            rows.extend([low, high].map(|theta| {
                let below = if theta == 90.0 && has_above { BELOW_HORIZON } else { 180.0 - theta };
                (number, ring, if part.is_below { below } else { theta })
            }));
        }
    }
    rows.sort_by(|a, b| a.2.total_cmp(&b.2));
    rows
}

fn note(parts: &[Part], shape: [usize; 4], report: &mut ParseReport) {
    let widths = parts.iter().map(|part| part.outgoing.widths());
    let [least, most] = widths.fold([f64::INFINITY, 0.0], |[a, b], [least, most]| [a.min(least), b.max(most)]);
    report.note(ScatteringNote::PatchesAsSteps {
        narrowest_degrees: Brief(least),
        widest_degrees: Brief(most),
        polar_angles: shape[2],
        azimuths: shape[3],
    });
    let patches = parts.first().map_or(0, |part| part.incoming.len());
    report.note(ScatteringNote::IncidentPatches { patches, directions: shape[0] * shape[1] });
}
