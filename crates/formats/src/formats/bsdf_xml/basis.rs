//! Bases of patches: rings between two polar angles, each divided into patches of equal width in azimuth.

use super::super::error::{FormatError, FormatErrorKind};
use super::super::text::{Brief, Source, number, snippet};
use super::element::Element;

/// Upper bound on the number of rings of a basis; Klems' full basis has nine. Raising it accepts finer bases.
const MAX_RINGS: usize = 180;
/// Upper bound on the number of patches in a ring; Klems' full basis has up to 24. Raising it accepts finer bases, in
/// which the borders of patches of two rings may be too close for a grid that has both.
const MAX_PATCHES: usize = 360;
/// Least width of a ring in degrees. Lowering it accepts rings that a grid cannot keep apart.
const LEAST_WIDTH: f64 = 0.01;
/// Difference in degrees up to which the upper bound of a ring and the lower bound of the next count as equal.
const SAME: f64 = 1e-4;
/// Polar angle of the horizon in degrees, at which every basis ends.
const HORIZON: f64 = 90.0;

/// Ring of patches between two polar angles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ring {
    /// Polar angles in degrees between which the patches lie.
    pub(super) bounds: [f64; 2],
    /// Polar angle in degrees that stands for the patches: 0 for a cap about the normal.
    pub(super) theta: f64,
    /// Number of patches. Patch number k is centred at azimuth k · 360° / count.
    pub(super) count: usize,
}

/// Basis of patches that tile the hemisphere.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Basis {
    pub(super) name: String,
    pub(super) rings: Vec<Ring>,
}

/// Basis known by its name: polar angles at which rings start, with the numbers of their patches.
struct Known {
    name: &'static str,
    rings: &'static [(f64, usize)],
}

/// Bases known by name, as Radiance (`bsdf_m.c` of 2022) and WINDOW define them. Radiance of 2015 and before has
/// another half basis, of 73 patches, which the number of values tells apart, and other bounds of the quarter basis
/// (46°, 66°).
const KNOWN: [Known; 4] = [
    Known {
        name: "LBNL/Klems Full",
        rings: &[
            (0.0, 1),
            (5.0, 8),
            (15.0, 16),
            (25.0, 20),
            (35.0, 24),
            (45.0, 24),
            (55.0, 24),
            (65.0, 16),
            (75.0, 12),
        ],
    },
    Known {
        name: "LBNL/Klems Half",
        rings: &[(0.0, 1), (6.5, 8), (19.5, 12), (32.5, 16), (45.5, 20), (58.5, 12), (71.5, 8)],
    },
    Known {
        name: "LBNL/Klems Half",
        rings: &[(0.0, 1), (6.5, 8), (19.5, 12), (32.5, 16), (46.5, 20), (61.5, 12), (76.5, 4)],
    },
    Known { name: "LBNL/Klems Quarter", rings: &[(0.0, 1), (9.0, 8), (27.0, 12), (45.0, 12), (63.0, 8)] },
];

impl Basis {
    /// Returns the number of patches.
    pub(super) fn len(&self) -> usize {
        self.rings.iter().map(|ring| ring.count).sum()
    }

    /// Returns the number of the first patch of each ring.
    pub(super) fn starts(&self) -> Vec<usize> {
        let starts = self.rings.iter().scan(0, |start, ring| {
            let first = *start;
            *start += ring.count;
            Some(first)
        });
        starts.collect()
    }

    /// Returns the bases that have a name, as WINDOW and Radiance define them; several if versions differ.
    pub(super) fn known(name: &str) -> Vec<Self> {
        let known = KNOWN.iter().filter(|known| known.name.eq_ignore_ascii_case(name));
        let basis = |known: &Known| {
            let ends = known.rings.iter().skip(1).map(|&(start, _)| start).chain([HORIZON]);
            let ring = |(&(start, count), end): (&(f64, usize), f64)| Ring::of([start, end], count, None);
            Self { name: known.name.to_owned(), rings: known.rings.iter().zip(ends).map(ring).collect() }
        };
        known.map(basis).collect()
    }

    /// Returns the smallest and the largest width of a ring in degrees.
    pub(super) fn widths(&self) -> [f64; 2] {
        let widths = self.rings.iter().map(|ring| match ring {
            // The cap about the normal is as wide as its diameter.
            Ring { bounds: [low, high], count: 1, .. } if *low == 0.0 => 2.0 * high,
            Ring { bounds: [low, high], .. } => high - low,
        });
        widths.fold([f64::INFINITY, 0.0], |[least, most], width| [least.min(width), most.max(width)])
    }
}

impl Ring {
    /// Creates a ring of patches; `theta` is the polar angle that the file states for it, if any.
    fn of(bounds: [f64; 2], count: usize, theta: Option<f64>) -> Self {
        let [low, high] = bounds;
        let middle = if low == 0.0 && count == 1 { 0.0 } else { 0.5 * (low + high) };
        let stated = theta.filter(|&theta| theta > low && theta < high);
        Self { bounds, theta: if middle == 0.0 { 0.0 } else { stated.unwrap_or(middle) }, count }
    }

    /// Returns the patch of this ring that contains an azimuth in degrees.
    pub(super) fn patch_at(&self, azimuth: f64) -> usize {
        let turns = (azimuth / 360.0).rem_euclid(1.0);
        (libm::floor(turns * self.count as f64 + 0.5) as usize) % self.count
    }
}

/// Returns the bases that the element `DataDefinition` defines. Those that it only names are left out, as Radiance's
/// `wrapBSDF` writes them.
pub(super) fn stated_bases(definition: &Element, source: &Source) -> Result<Vec<Basis>, FormatError> {
    let is_defined = |basis: &&Element| {
        basis.child("AngleBasisBlock").is_some() || Basis::known(basis.text_of("AngleBasisName")).is_empty()
    };
    definition.children_of("AngleBasis").filter(is_defined).map(|basis| stated(basis, source)).collect()
}

fn stated(element: &Element, source: &Source) -> Result<Basis, FormatError> {
    let name: String = element.text_of("AngleBasisName").chars().take(80).collect();
    let mut rings: Vec<Ring> = Vec::new();
    for block in element.children_of("AngleBasisBlock") {
        if rings.len() >= MAX_RINGS {
            let message = format!("more than {MAX_RINGS} rings in an AngleBasis");
            return Err(source.error(FormatErrorKind::OverLimit, block.offset, message));
        }
        rings.push(ring(block, rings.last(), source)?);
    }
    match rings.last() {
        None => Err(source.malformed(element.offset, "no AngleBasisBlock, expected the rings of the basis")),
        Some(last) if (last.bounds[1] - HORIZON).abs() > SAME => {
            let message = format!("the last ring ends at {} degrees, expected {HORIZON}", Brief(last.bounds[1]));
            Err(source.malformed(element.offset, message))
        }
        Some(_) => Ok(Basis { name, rings }),
    }
}

fn ring(block: &Element, before: Option<&Ring>, source: &Source) -> Result<Ring, FormatError> {
    let bounds = block.child("ThetaBounds").unwrap_or(block);
    let angle = |parent: &Element, name: &str| {
        let text = parent.text_of(name);
        number(text).filter(|angle| (0.0..=HORIZON).contains(angle)).ok_or_else(|| {
            let message = format!("{name} {}, expected 0 to {HORIZON} degrees", snippet(text));
            source.malformed(parent.child(name).unwrap_or(parent).offset, message)
        })
    };
    let (low, high) = (angle(bounds, "LowerTheta")?, angle(bounds, "UpperTheta")?);
    let start = before.map_or(0.0, |ring| ring.bounds[1]);
    if (low - start).abs() > SAME || high < start + LEAST_WIDTH {
        let message = format!(
            "a ring from {} to {} degrees, expected one that starts at {} and is at least {LEAST_WIDTH} wide",
            Brief(low),
            Brief(high),
            Brief(start)
        );
        return Err(source.malformed(block.offset, message));
    }
    let text = block.text_of("nPhis");
    let count = text.parse::<usize>().ok().filter(|count| (1..=MAX_PATCHES).contains(count)).ok_or_else(|| {
        source.malformed(block.offset, format!("nPhis {}, expected 1 to {MAX_PATCHES}", snippet(text)))
    })?;
    let theta = number(block.text_of("Theta"));
    Ok(Ring::of([start, if (high - HORIZON).abs() <= SAME { HORIZON } else { high }], count, theta))
}
