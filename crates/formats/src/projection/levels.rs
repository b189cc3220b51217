//! Choice of the triangle level that fits the density of the samples.

use super::angles::mean_spacing;
use super::averages::OCTANT_DEGREES;
use super::error::{LevelError, ProjectionError, Role};
use crate::domain::{Domain, Note, TriangleMesh};
use crate::formats::Angles;
use crate::notes::ProjectionNote;

/// Finest subdivision level of triangles that is chosen automatically. Raising it resolves denser samples with larger
/// tensors.
const MAX_CHOSEN_LEVEL: u8 = 6;

/// Largest number of samples of a tensor on automatically chosen triangle levels (128 MiB of float32). Finer levels
/// must be requested.
pub(super) const MAX_CHOSEN_SAMPLES: usize = 1 << 25;

/// A triangle mesh for directions, and the reason for choosing its subdivision level.
#[derive(Clone, Debug)]
pub(super) struct Choice {
    pub(super) mesh: TriangleMesh,
    /// True if the user requested the subdivision level of the mesh, false if the program chose it.
    pub(super) requested: bool,
    /// Subdivision level of the mesh that fits the sample spacing, or that was requested. The mesh may be coarser to
    /// limit the size of the tensor, or finer on request.
    wanted: u8,
    spacing: String,
}

/// Chooses the triangle mesh of `domain` for samples on `angles`: at the `requested` level, or at the level that fits
/// the sample spacing. That is the level whose mean cell size (square root of the solid angle) is nearest in ratio to
/// the smaller of two mean spacings, of polar angles and of azimuths.
pub(super) fn choose(
    role: Role,
    domain: Domain,
    angles: &Angles,
    requested: Option<u8>,
) -> Result<Choice, ProjectionError> {
    let (theta, phi) = mean_spacing(angles);
    let spacing = match phi {
        Some(phi) => format!("{}° × {}°", rounded(theta), rounded(phi)),
        None => format!("{}° of theta", rounded(theta)),
    };
    at_level(role, domain, natural_level(theta, phi), requested, spacing)
}

/// Chooses the triangle mesh of `domain`, like [`choose`], for samples that lie `spacing` degrees from their neighbours
/// in every direction.
pub(super) fn choose_by_distance(
    role: Role,
    domain: Domain,
    spacing: f64,
    requested: Option<u8>,
) -> Result<Choice, ProjectionError> {
    at_level(role, domain, natural_level(spacing, None), requested, format!("{}°", rounded(spacing)))
}

fn at_level(
    role: Role,
    domain: Domain,
    natural: u8,
    requested: Option<u8>,
    spacing: String,
) -> Result<Choice, ProjectionError> {
    let level = requested.unwrap_or(natural);
    let mesh = TriangleMesh::new(domain, level)
        .ok_or(ProjectionError::Level { role, level: LevelError::AboveLimit { found: level } })?;
    Ok(Choice { mesh, requested: requested.is_some(), wanted: level, spacing })
}

impl Choice {
    /// Lowers an automatically chosen triangle level by one. Returns false if the user requested the level or no
    /// coarser one exists.
    pub(super) fn lower(&mut self) -> bool {
        match self.mesh.coarser() {
            Some(coarser) if !self.requested => {
                self.mesh = coarser;
                true
            }
            _ => false,
        }
    }

    /// Raises an automatically chosen triangle level by one. Returns false if the user requested the level or no finer
    /// one exists.
    pub(super) fn raise(&mut self) -> bool {
        match TriangleMesh::new(self.mesh.domain(), self.mesh.level() + 1) {
            Some(finer) if !self.requested => {
                self.mesh = finer;
                true
            }
            _ => false,
        }
    }

    /// Returns a note for the user on the chosen triangle level and the reason for it.
    pub(super) fn note(&self, role: Role) -> Note {
        let level = self.mesh.level();
        let note = ProjectionNote::Level {
            role: role.name(),
            level,
            domain: self.mesh.domain(),
            cell_degrees: OCTANT_DEGREES / f64::from(1_u32 << level),
            spacing: self.spacing.clone(),
            natural_level: self.wanted,
            is_requested: self.requested,
        };
        note.into()
    }
}

/// Number of positions on one direction axis of a tensor. It is fixed, or that of triangles whose subdivision level may
/// be lowered to limit the size of the tensor.
pub(super) enum Entries<'a> {
    /// Number of positions on a direction axis without triangles, such as one of polar angles; it stays even if the
    /// tensor exceeds its size limit.
    Fixed(usize),
    /// Triangle mesh of a direction axis, whose subdivision level is lowered if the tensor exceeds its size limit,
    /// unless the user requested the level.
    Chosen(&'a mut Choice),
}

impl Entries<'_> {
    fn count(&self) -> usize {
        match self {
            Self::Fixed(count) => *count,
            Self::Chosen(choice) => choice.mesh.len(),
        }
    }

    fn lower(&mut self) -> bool {
        match self {
            Self::Fixed(_) => false,
            Self::Chosen(choice) => choice.lower(),
        }
    }
}

/// Lowers chosen triangle levels, that of the axis with more triangles first, until the tensor fits its size limit.
/// Levels requested by the user stay. `others` is the number of samples for each pair of directions.
pub(super) fn lower_to_fit<'a>(mut incoming: Entries<'a>, mut outgoing: Entries<'a>, others: usize) {
    while incoming.count().saturating_mul(outgoing.count()).saturating_mul(others) > MAX_CHOSEN_SAMPLES {
        let incoming_first = incoming.count() > outgoing.count();
        let (first, second) =
            if incoming_first { (&mut incoming, &mut outgoing) } else { (&mut outgoing, &mut incoming) };
        if !first.lower() && !second.lower() {
            return;
        }
    }
}

fn natural_level(theta: f64, phi: Option<f64>) -> u8 {
    let spacing = phi.map_or(theta, |phi| theta.min(phi));
    libm::round(libm::log2(OCTANT_DEGREES / spacing)).clamp(0.0, f64::from(MAX_CHOSEN_LEVEL)) as u8
}

/// Rounds an angle in degrees to two decimals.
pub(super) fn rounded(degrees: f64) -> f64 {
    libm::round(degrees * 100.0) / 100.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::{AzimuthExtent, Azimuths};

    #[test]
    fn levels_follow_the_spacings() {
        for (theta, phi, expected) in [
            (2.5, Some(11.25), 5),
            (2.0, Some(2.0), 5),
            (15.0, Some(30.0), 2),
            (2.5, Some(90.0), 5),
            (5.0, Some(15.0), 4),
            (5.0, None, 4),
            (0.1, Some(0.1), 6),
            (90.0, Some(180.0), 0),
        ] {
            assert_eq!(natural_level(theta, phi), expected, "{theta} {phi:?}");
        }
    }

    #[test]
    fn the_finer_level_is_lowered_first_and_requests_stay() {
        let choice = |level, requested| Choice {
            mesh: TriangleMesh::new(Domain::Hemisphere, level).unwrap(),
            requested,
            wanted: level,
            spacing: String::new(),
        };
        let fitted = |mut incoming: Choice, mut outgoing: Choice, others| {
            lower_to_fit(Entries::Chosen(&mut incoming), Entries::Chosen(&mut outgoing), others);
            [incoming.mesh.level(), outgoing.mesh.level()]
        };
        assert_eq!(fitted(choice(3, false), choice(6, false), 1), [3, 6]);
        assert_eq!(fitted(choice(4, false), choice(6, false), 1 << 7), [4, 3]);
        assert_eq!(fitted(choice(6, false), choice(4, false), 1 << 7), [4, 3]);
        assert_eq!(fitted(choice(5, false), choice(5, false), 1 << 7), [4, 3]);
        assert_eq!(fitted(choice(5, false), choice(6, true), 1 << 7), [1, 6]);
        assert_eq!(fitted(choice(5, true), choice(6, true), 1 << 7), [5, 6]);
        let mut outgoing = choice(6, false);
        lower_to_fit(Entries::Fixed(1 << 20), Entries::Chosen(&mut outgoing), 1);
        assert_eq!(outgoing.mesh.level(), 1);
    }

    #[test]
    fn notes_name_sizes_and_spacings() {
        let angles = Angles {
            theta: (0..=36).map(|i| 90.0 + 2.5 * f64::from(i)).collect(),
            covers: (90.0, 180.0),
            phi: Some(Azimuths { phi: (0..32).map(|i| 11.25 * f64::from(i)).collect(), extent: AzimuthExtent::Circle }),
        };
        let mut choice = choose(Role::Outgoing, Domain::Sphere, &angles, None).unwrap();
        let note = choice.note(Role::Outgoing).message;
        assert!(
            note.starts_with("outgoing level 5 on the sphere: cells of 2.2° for samples every 2.5° × 11.25° ("),
            "{note}"
        );
        assert!(choice.lower());
        assert!(choice.note(Role::Outgoing).message.contains("level 5 would fit"));
        let mut fixed = choose(Role::Outgoing, Domain::Sphere, &angles, Some(7)).unwrap();
        assert!(!fixed.lower() && fixed.note(Role::Outgoing).message.contains("as requested"));
        let error = choose(Role::Outgoing, Domain::Sphere, &angles, Some(9)).unwrap_err();
        assert_eq!(error.to_string(), "outgoing_level does not fit the data: level 9 is above the limit of 8");
    }
}
