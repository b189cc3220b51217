//! Directions on a grid of polar angles and azimuths, as scanned by the instrument.
//!
//! The sphere is treated as the product of two lines (\[CPB06\] section 4 allows any sequence of directions as an
//! axis). Entries are `[polar, azimuth]`, row-major, and every angle is the number in the file. A [`Frame`] defines the
//! direction of a pair of angles.

use super::direction::Direction;
use super::limits::{MAX_ENTRIES, MAX_SAMPLES};
use super::quantity::named;
use super::vector::Vector;
use crate::numeric::arctangent::atan2_degrees;

/// Coordinate frame of a goniometer, which maps a polar angle and an azimuth, in degrees, to a direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Frame {
    /// Surfaces: the polar angle is theta from `+z`, 0..=180; the azimuth phi turns from `+x` towards `+y`. For
    /// isotropic data, phi is relative to the azimuth of the incoming direction.
    Surface,
    /// Photometric type C of luminaires (LM-63, EULUMDAT): the polar angle is gamma from nadir (`-z`), 0..=180; the
    /// azimuth C turns from `+x` towards `+y`.
    TypeC,
    /// Photometric type B of luminaires: the polar angle is the latitude H about the horizontal axis `-y`, -90..=90.
    /// The azimuth V turns from nadir (`-z`) towards `+x`: `(cos H sin V, -sin H, -cos H cos V)`.
    TypeB,
    /// Photometric type A of luminaires: the polar angle is the latitude V about the vertical axis `+z`, -90..=90. The
    /// azimuth H turns from `+x` towards `-y`: `(cos V cos H, -cos V sin H, sin V)`.
    TypeA,
}
named!(Frame, "frame", { Surface = "surface", TypeC = "type-c", TypeB = "type-b", TypeA = "type-a" });

impl Frame {
    /// Returns the range of polar angles of the frame in degrees, from pole to pole.
    pub fn polar_range(self) -> (f64, f64) {
        match self {
            Self::Surface | Self::TypeC => (0.0, 180.0),
            Self::TypeA | Self::TypeB => (-90.0, 90.0),
        }
    }

    /// Returns the direction with this polar angle and azimuth, in degrees, as the frame (surface, or goniometer type
    /// A, B or C) defines them. Multiples of 90° are exact.
    pub fn direction(self, polar: f64, azimuth: f64) -> Direction {
        match self {
            Self::Surface => Direction::from_degrees(polar, azimuth),
            Self::TypeC => Direction::from_luminaire_degrees(azimuth, polar),
            Self::TypeB => {
                let [x, y, z] = Direction::from_degrees(90.0 - polar, azimuth).xyz();
                Direction::from_unit([y, -z, -x])
            }
            Self::TypeA => {
                let [x, y, z] = Direction::from_degrees(90.0 - polar, azimuth).xyz();
                Direction::from_unit([x, -y, z])
            }
        }
    }

    /// Returns the polar angle and the azimuth of a direction in degrees; the azimuth is in -180..=180, and 0 at the
    /// poles.
    pub fn angles(self, direction: Direction) -> [f64; 2] {
        let [x, y, z] = self.upright(direction.xyz());
        let across = libm::hypot(x, y);
        let azimuth = if across < AT_POLE { 0.0 } else { libm::atan2(y, x).to_degrees() };
        let polar = match self {
            Self::Surface | Self::TypeC => libm::atan2(across, z),
            Self::TypeA | Self::TypeB => libm::atan2(z, across),
        };
        [polar.to_degrees(), azimuth]
    }

    /// Computes the polar angle and the azimuth, in degrees, of a vector of any length that [`Frame::upright`] has
    /// rotated. The result equals that of [`Frame::angles`] up to the last bits. It needs few operations, and loops
    /// over it become vector code.
    #[inline(always)]
    #[allow(clippy::inline_always, reason = "compiled for the processor's instructions where it is called")]
    pub(crate) fn angles_of_upright(self, [x, y, z]: Vector) -> [f64; 2] {
        let across = (x * x + y * y).sqrt();
        let azimuth = if across < AT_POLE { 0.0 } else { atan2_degrees(y, x) };
        let is_latitude = matches!(self, Self::TypeA | Self::TypeB);
        let (up, along) = if is_latitude { (z, across) } else { (across, z) };
        [atan2_degrees(up, along), azimuth]
    }

    /// Rotates a vector so that the pole of the frame is at `+z` and the azimuth counts from `+x`, which makes all
    /// frames alike.
    #[inline(always)]
    #[allow(clippy::inline_always, reason = "compiled for the processor's instructions where it is called")]
    pub(crate) fn upright(self, [x, y, z]: Vector) -> Vector {
        match self {
            Self::Surface => [x, y, z],
            Self::TypeC => [x, y, -z],
            Self::TypeB => [-z, x, -y],
            Self::TypeA => [x, -y, z],
        }
    }
}

/// Sine of the angular distance from a pole below which the azimuth of a direction is taken as 0.
const AT_POLE: f64 = 1e-12;
/// Tolerance in degrees at the ends of an angular range, for the rounding of inverse trigonometric functions.
const ROUNDING: f64 = 1e-9;
/// Distance in degrees within which a direction beyond the border of a grid counts as on it. It is larger than the
/// error of directions in float32 or with six digits, which would otherwise miss the values measured on the border. In
/// the direction of the azimuth it is the distance on the sphere.
const BORDER: f64 = 1e-3;
/// Largest angle in degrees between neighbouring azimuths of a surface between which values are interpolated. Wider
/// gaps separate planes of a scan, between which nothing is known. Raising it interpolates across wider gaps.
pub const WIDEST_GAP: f64 = 90.0;
/// Largest azimuth accepted in a file, in degrees.
const LARGEST_AZIMUTH: f64 = 720.0;

/// Part of the full circle that the azimuths of a file cover, and the symmetry that gives the rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum AzimuthExtent {
    /// Full circle: after the last azimuth comes the first + 360°.
    Circle,
    /// Full circle in which the last azimuth repeats the first one, 360° later.
    Closed,
    /// Sector from the first to the last azimuth; values outside the sector are unknown.
    Sector,
    /// Azimuths in 0..=180°; the other half circle is the mirror image across the plane of azimuth 0 and 180°.
    Mirrored,
    /// Azimuths in 90..=270°; the other half circle is the mirror image across the plane of azimuth 90° and 270°.
    MirroredAt90,
    /// Azimuths in 0..=90°; the other quadrants are mirror images across the planes of azimuth 0° and 90°.
    Quadrant,
}
named!(AzimuthExtent, "extent of azimuths", {
    Circle = "circle",
    Closed = "closed",
    Sector = "sector",
    Mirrored = "mirrored",
    MirroredAt90 = "mirrored-at-90",
    Quadrant = "quadrant",
});

impl AzimuthExtent {
    /// Returns the range of azimuths, in degrees, that a grid of directions may have if its azimuths cover the given
    /// part of the circle, for example 0° to 90° for a quadrant.
    fn range(self) -> (f64, f64) {
        match self {
            Self::Circle | Self::Closed | Self::Sector => (-LARGEST_AZIMUTH, LARGEST_AZIMUTH),
            Self::Mirrored => (0.0, 180.0),
            Self::MirroredAt90 => (90.0, 270.0),
            Self::Quadrant => (0.0, 90.0),
        }
    }

    /// Returns true if the azimuths cover the full circle, so that the last one is followed by the first.
    pub fn is_periodic(self) -> bool {
        matches!(self, Self::Circle | Self::Closed)
    }
}

/// Azimuths of a grid of directions, with the symmetry that completes the circle.
#[derive(Clone, Debug, PartialEq)]
pub struct Azimuths {
    /// Azimuths of the grid in degrees, strictly increasing.
    pub angles: Vec<f64>,
    /// Part of the circle that the azimuths cover, and the mirror planes that complete it.
    pub extent: AzimuthExtent,
}

impl Azimuths {
    /// Maps `azimuth` (degrees) by the mirror symmetries to the equivalent azimuth in the part of the circle that the
    /// grid covers.
    pub fn folded(&self, azimuth: f64) -> f64 {
        let around = |azimuth: f64| azimuth - 360.0 * libm::round(azimuth / 360.0);
        match self.extent {
            AzimuthExtent::Circle | AzimuthExtent::Closed | AzimuthExtent::Sector => {
                let first = self.angles[0];
                let turns = libm::floor((azimuth - first + ROUNDING) / 360.0);
                (azimuth - 360.0 * turns).max(first)
            }
            AzimuthExtent::Mirrored => around(azimuth).abs(),
            AzimuthExtent::MirroredAt90 => 90.0 + around(azimuth - 90.0).abs(),
            AzimuthExtent::Quadrant => {
                let half = around(azimuth).abs();
                half.min(180.0 - half)
            }
        }
    }

    /// Returns the range of azimuths, in degrees, that the grid covers before mirroring: from the first to the last
    /// azimuth, and on to a mirror plane that is no farther away than the widest step between azimuths.
    fn covers(&self) -> (f64, f64) {
        let (first, last) = (self.angles[0], self.angles[self.angles.len() - 1]);
        if self.extent.is_periodic() {
            return (f64::NEG_INFINITY, f64::INFINITY);
        }
        if self.extent == AzimuthExtent::Sector {
            return (first, last);
        }
        let widest = self.angles.array_windows().map(|[a, b]| b - a).fold(0.0, f64::max);
        let (low, high) = self.extent.range();
        (if first - low <= widest { low } else { first }, if high - last <= widest { high } else { last })
    }
}

/// Value of directions outside the angles that a grid covers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Outside {
    /// Masked: directions outside the grid were not measured.
    Masked,
    /// Zero, as the standards LM-63 and EULUMDAT define for directions outside the grid.
    Dark,
}
named!(Outside, "value outside", { Masked = "masked", Dark = "dark" });

/// Directions on a grid of polar angles and azimuths. The grid is one axis of a tensor, with its entries row-major in
/// the order `[polar, azimuth]`.
///
/// ```
/// use wavelume_core::domain::{AzimuthExtent, Azimuths, Direction, DirectionGrid, Frame};
/// let quarter = Azimuths { angles: vec![0.0, 45.0, 90.0], extent: AzimuthExtent::Quadrant };
/// let grid = DirectionGrid::new(Frame::TypeC, vec![0.0, 30.0, 90.0], Some(quarter))?;
/// assert_eq!(grid.len(), 9);
/// // Gamma 0 is nadir.
/// assert_eq!(grid.direction(0), Direction::new(0.0, 0.0, -1.0).unwrap());
/// // C 315° is C 45° in a quadrant: polar angle 1, azimuth 1.
/// assert_eq!(grid.nearest(Direction::from_luminaire_degrees(315.0, 30.0)), Some(4));
/// # Ok::<(), wavelume_core::domain::DirectionGridError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct DirectionGrid {
    frame: Frame,
    polar: Vec<f64>,
    azimuths: Option<Azimuths>,
    covers: (f64, f64),
    covers_azimuths: (f64, f64),
    outside: Outside,
    is_polar_mirrored: bool,
}

/// Reasons why angles do not form a grid of directions.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DirectionGridError {
    /// The number of polar angles or azimuths is 0 or too large.
    #[error("{found} {what} angles, expected 1 to {MAX_ENTRIES}")]
    Count {
        /// Name of the angles of which there are too few or too many: `polar` or `azimuth`.
        what: &'static str,
        /// Invalid number of polar angles or azimuths: 0 or too large.
        found: usize,
    },
    /// The number of directions, the product of the numbers of polar angles and azimuths, exceeds the limit.
    #[error("{polar} polar angles × {azimuths} azimuths are more than the limit of {MAX_SAMPLES} directions")]
    TooMany {
        /// Number of polar angles of the grid.
        polar: usize,
        /// Number of azimuths of the grid.
        azimuths: usize,
    },
    /// A polar angle or azimuth is outside its range or NaN.
    #[error("{what} angle {found}, expected {low} to {high} degrees")]
    Range {
        /// Name of the angle that is out of range: `polar` or `azimuth`.
        what: &'static str,
        /// Polar angle or azimuth that is out of range, in degrees.
        found: f64,
        /// Smallest polar angle or azimuth accepted, in degrees.
        low: f64,
        /// Largest polar angle or azimuth accepted, in degrees.
        high: f64,
    },
    /// Polar angles or azimuths are not strictly increasing.
    #[error("{what} angle {found} after {before} degrees, expected strictly increasing angles")]
    Order {
        /// Name of the angles that do not increase: `polar` or `azimuth`.
        what: &'static str,
        /// Polar angle or azimuth just before the one that breaks the increasing order of the list, in degrees.
        before: f64,
        /// Polar angle or azimuth that breaks the increasing order of the list, since it is not larger than the one
        /// before it; in degrees.
        found: f64,
    },
    /// The azimuths span a range that contradicts their stated extent: a circle needs less than 360°, a closed circle
    /// exactly 360°, others at most 360°.
    #[error("azimuths go from {first} to {last} degrees, expected azimuths that fit their stated extent `{extent}`")]
    Span {
        /// First azimuth of the grid, in degrees.
        first: f64,
        /// Last azimuth of the grid, in degrees.
        last: f64,
        /// Part of the circle that the azimuths are stated to cover; their range contradicts it.
        extent: AzimuthExtent,
    },
    /// The range of polar angles stated as covered does not contain all polar angles of the grid.
    #[error(
        "the grid covers {low} to {high} degrees, expected a range that contains its polar angles, {first} to {last}"
    )]
    Covers {
        /// First polar angle of the grid, in degrees.
        first: f64,
        /// Last polar angle of the grid, in degrees.
        last: f64,
        /// Lower end of the range of polar angles that the grid is stated to cover, in degrees.
        low: f64,
        /// Upper end of the range of polar angles that the grid is stated to cover, in degrees.
        high: f64,
    },
    /// A grid of directions cannot be mirrored across the equator: its first polar angle lies below the equator, or its
    /// polar angles are measured from a pole and not from the equator.
    #[error("the grid to be mirrored across the equator starts at {found} degrees, expected latitudes of 0 or more")]
    Mirrored {
        /// First polar angle of the grid that was to be mirrored, in degrees: measured from the equator, or from a pole
        /// in a frame without latitudes.
        found: f64,
    },
}

impl DirectionGrid {
    /// Creates a grid of polar angles (degrees, strictly increasing, within the range of the frame) and azimuths.
    /// Without azimuths the function is rotationally symmetric about the pole. Directions beyond the first and last
    /// angles are masked.
    pub fn new(frame: Frame, polar: Vec<f64>, azimuths: Option<Azimuths>) -> Result<Self, DirectionGridError> {
        let (low, high) = frame.polar_range();
        check_increasing("polar", &polar, low, high)?;
        if let Some(Azimuths { angles, extent }) = &azimuths {
            let (low, high) = extent.range();
            check_increasing("azimuth", angles, low, high)?;
            let (first, last) = (angles[0], angles[angles.len() - 1]);
            let is_fit = match extent {
                AzimuthExtent::Circle => last - first < 360.0,
                AzimuthExtent::Closed => last - first == 360.0,
                _ => last - first <= 360.0,
            };
            if !is_fit {
                return Err(DirectionGridError::Span { first, last, extent: *extent });
            }
            if polar.len().saturating_mul(angles.len()) > MAX_SAMPLES {
                return Err(DirectionGridError::TooMany { polar: polar.len(), azimuths: angles.len() });
            }
        }
        let covers = (polar[0], polar[polar.len() - 1]);
        let covers_azimuths = azimuths.as_ref().map_or((0.0, 0.0), Azimuths::covers);
        Ok(Self { frame, polar, azimuths, covers, covers_azimuths, outside: Outside::Masked, is_polar_mirrored: false })
    }

    /// Extends the range of polar angles that the grid covers to `low`..=`high` degrees. Between the outermost polar
    /// angle of the grid and the end of the range the values are constant.
    pub fn covering(self, low: f64, high: f64) -> Result<Self, DirectionGridError> {
        let (least, largest) = self.frame.polar_range();
        let (first, last) = (self.polar[0], self.polar[self.polar.len() - 1]);
        if low >= least && low <= first && high >= last && high <= largest {
            return Ok(Self { covers: (low, high), ..self });
        }
        Err(DirectionGridError::Covers { first, last, low, high })
    }

    /// Sets the value of directions outside the angles that the grid covers.
    #[must_use]
    pub fn with_outside(self, outside: Outside) -> Self {
        Self { outside, ..self }
    }

    /// Mirrors a grid of latitudes H, all 0 or more, across the equator: −H has the value of H.
    pub fn mirrored(self) -> Result<Self, DirectionGridError> {
        if self.frame.polar_range().0 < 0.0 && self.polar[0] >= 0.0 {
            return Ok(Self { is_polar_mirrored: true, ..self });
        }
        Err(DirectionGridError::Mirrored { found: self.polar[0] })
    }

    /// Returns the coordinate frame of the grid's angles.
    pub fn frame(&self) -> Frame {
        self.frame
    }

    /// Returns the polar angles of the grid in degrees.
    pub fn polar(&self) -> &[f64] {
        &self.polar
    }

    /// Returns the azimuths of the grid; `None` if the function is rotationally symmetric about the pole.
    pub fn azimuths(&self) -> Option<&Azimuths> {
        self.azimuths.as_ref()
    }

    /// Returns the range of polar angles that the grid covers, in degrees.
    pub fn covers(&self) -> (f64, f64) {
        self.covers
    }

    /// Returns the value of directions outside the angles that the grid covers.
    pub fn outside(&self) -> Outside {
        self.outside
    }

    /// Returns true if the grid is mirrored across the equator: latitude −H has the value of H.
    pub fn is_polar_mirrored(&self) -> bool {
        self.is_polar_mirrored
    }

    /// Returns the number of polar angles and the number of azimuths, which is 1 for a grid without azimuths.
    pub fn shape(&self) -> [usize; 2] {
        [self.polar.len(), self.azimuths.as_ref().map_or(1, |azimuths| azimuths.angles.len())]
    }

    /// Returns the number of directions of the grid.
    #[allow(clippy::len_without_is_empty, reason = "a checked grid is never empty")]
    pub fn len(&self) -> usize {
        let [polar, azimuths] = self.shape();
        polar * azimuths
    }

    /// Returns the direction of entry number `entry` of the grid. A grid without azimuths gives the direction at
    /// azimuth zero.
    ///
    /// # Panics
    /// If `entry` is out of range.
    pub fn direction(&self, entry: usize) -> Direction {
        let [_, width] = self.shape();
        let azimuth = self.azimuths.as_ref().map_or(0.0, |azimuths| azimuths.angles[entry % width]);
        self.frame.direction(self.polar[entry / width], azimuth)
    }

    /// Returns true if all azimuths at polar angle number `row` are one direction.
    pub fn is_pole(&self, row: usize) -> bool {
        let (low, high) = self.frame.polar_range();
        let polar = self.polar[row];
        polar == low || polar == high
    }

    /// Returns the groups of entries that are one direction: all azimuths at a pole, and the first and last azimuth of
    /// a closed circle.
    pub(crate) fn coinciding(&self) -> Vec<Vec<u32>> {
        let [rows, columns] = self.shape();
        if columns == 1 {
            return Vec::new();
        }
        let is_closed = self.azimuths.as_ref().is_some_and(|azimuths| azimuths.extent == AzimuthExtent::Closed);
        let of_row = |row: usize| {
            let entries = (row * columns) as u32..((row + 1) * columns) as u32;
            if self.is_pole(row) {
                Some(entries.collect())
            } else {
                is_closed.then(|| vec![entries.start, entries.end - 1])
            }
        };
        (0..rows).filter_map(of_row).collect()
    }

    /// Returns the polar angle and the azimuth, in degrees and after mirroring, at which the grid gives the value of
    /// `direction`; `None` outside the covered angles.
    ///
    /// A pole gets the first azimuth if its own is not covered. Beyond the first and last polar angle the result is the
    /// nearer of the two. Below the first of mirrored latitudes it lies between that latitude and its mirror image. A
    /// direction within 10⁻³ degrees of the border counts as on it.
    pub fn angles(&self, direction: Direction) -> Option<[f64; 2]> {
        self.held(self.frame.angles(direction))
    }

    /// Returns the polar angle and the azimuth, in degrees and after mirroring, at which the grid gives the value of
    /// the given angles in its frame. `None` outside the covered angles.
    pub(crate) fn held(&self, [polar, azimuth]: [f64; 2]) -> Option<[f64; 2]> {
        let polar = if self.is_polar_mirrored { polar.abs() } else { polar };
        if !self.covers_polar(polar) {
            return None;
        }
        let is_pole = self.is_at_pole(polar);
        let azimuth = self.azimuths.as_ref().map_or(0.0, |azimuths| azimuths.folded(azimuth));
        let (low, high) = self.covers_azimuths;
        let azimuth = if (low..=high).contains(&azimuth) {
            azimuth
        } else if is_pole {
            low
        } else {
            let border = self.border(polar);
            // An azimuth just below the first one is counted from it around the circle.
            let beyond = |azimuth: f64| (azimuth - azimuth.clamp(low, high)).abs();
            let near = if beyond(azimuth - 360.0) < beyond(azimuth) { azimuth - 360.0 } else { azimuth };
            if beyond(near) > border {
                return None;
            }
            near.clamp(low, high)
        };
        let first = if self.is_polar_mirrored { -self.polar[0] } else { self.polar[0] };
        Some([polar.clamp(first, self.polar[self.polar.len() - 1]), azimuth])
    }

    /// Returns true if all azimuths at a polar angle in degrees are one direction.
    pub(crate) fn is_at_pole(&self, polar: f64) -> bool {
        let (least, largest) = self.frame.polar_range();
        polar <= least + ROUNDING || polar >= largest - ROUNDING
    }

    /// Returns the difference of azimuths in degrees, at a polar angle in degrees, within which a direction counts as
    /// on the border of the grid.
    pub(crate) fn border(&self, polar: f64) -> f64 {
        // The circle of latitude is shorter than the equator.
        let latitude = if self.frame.polar_range().0 < 0.0 { 90.0 - polar.abs() } else { polar };
        BORDER / libm::sin(latitude.to_radians()).abs()
    }

    /// Returns true if the grid covers the polar angle `polar` (degrees), which must not be negative if latitudes are
    /// mirrored.
    #[inline]
    pub(crate) fn covers_polar(&self, polar: f64) -> bool {
        let (low, high) = self.covers;
        !(polar < low - BORDER || polar > high + BORDER)
    }

    /// Returns true if the grid and its mirror images cover the full circle. An azimuth then needs no mirroring before
    /// it is searched among the grid's azimuths and their mirror images.
    pub(crate) fn covers_all_azimuths(&self) -> bool {
        let Some(azimuths) = &self.azimuths else { return true };
        let (low, high) = azimuths.extent.range();
        let is_whole = azimuths.extent != AzimuthExtent::Sector;
        is_whole && self.covers_azimuths.0 <= low && self.covers_azimuths.1 >= high
    }

    /// Returns true for a scan in planes: all neighbouring azimuths, mirror images included, are more than 90° apart,
    /// so that nothing is known between them. False for a grid without azimuths.
    pub(crate) fn is_scan(&self) -> bool {
        let Some(Azimuths { angles, extent }) = &self.azimuths else { return false };
        let (first, last) = (angles[0], angles[angles.len() - 1]);
        let (low, high) = extent.range();
        // From an outermost azimuth to its mirror image, or around the circle.
        let around = match extent {
            AzimuthExtent::Closed | AzimuthExtent::Sector => [0.0, 0.0],
            AzimuthExtent::Circle => [first + 360.0 - last, 0.0],
            _ => [2.0 * (first - low), 2.0 * (high - last)],
        };
        let steps = angles.array_windows().map(|[a, b]| b - a).chain(around.into_iter().filter(|step| *step > 0.0));
        steps.into_iter().all(|step| step > WIDEST_GAP)
    }

    /// Returns the grid entry nearest to a direction in polar angle and azimuth; `None` outside the angles that the
    /// grid covers.
    pub fn nearest(&self, direction: Direction) -> Option<usize> {
        let [polar, azimuth] = self.angles(direction)?;
        let row = nearest(&self.polar, polar);
        let Some(azimuths) = &self.azimuths else { return Some(row) };
        let (angles, last) = (&azimuths.angles, azimuths.angles.len() - 1);
        // Beyond the last azimuth of a circle the first one may be nearer.
        let wraps = azimuths.extent == AzimuthExtent::Circle
            && azimuth > angles[last]
            && angles[0] + 360.0 - azimuth < azimuth - angles[last];
        let column = if wraps { 0 } else { nearest(angles, azimuth) };
        Some(row * angles.len() + column)
    }

    /// Returns a short description of the grid for people: `grid of 17 × 37 (polar 0..90, azimuth 0..360)`.
    pub fn describe(&self) -> String {
        let ends = |angles: &[f64]| format!("{}..{}", angles[0], angles[angles.len() - 1]);
        let polar = ends(&self.polar);
        match &self.azimuths {
            None => format!("{} polar angles ({polar})", self.polar.len()),
            Some(azimuths) => {
                let [rows, columns] = self.shape();
                format!("grid of {rows} × {columns} (polar {polar}, azimuth {})", ends(&azimuths.angles))
            }
        }
    }
}

/// Returns the index of the list entry nearest to `angle`; of two equally near entries the earlier one.
fn nearest(angles: &[f64], angle: f64) -> usize {
    let after = angles.partition_point(|&a| a < angle).min(angles.len() - 1);
    let before = after.saturating_sub(1);
    if (angle - angles[before]).abs() <= (angles[after] - angle).abs() { before } else { after }
}

fn check_increasing(what: &'static str, angles: &[f64], low: f64, high: f64) -> Result<(), DirectionGridError> {
    if angles.is_empty() || angles.len() > MAX_ENTRIES {
        return Err(DirectionGridError::Count { what, found: angles.len() });
    }
    if let Some(&found) = angles.iter().find(|angle| !(low..=high).contains(*angle)) {
        return Err(DirectionGridError::Range { what, found, low, high });
    }
    match angles.array_windows().find(|[a, b]| b <= a) {
        Some(&[before, found]) => Err(DirectionGridError::Order { what, before, found }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::vector::dot;

    const FRAMES: [Frame; 4] = [Frame::Surface, Frame::TypeC, Frame::TypeB, Frame::TypeA];

    fn azimuths(angles: &[f64], extent: AzimuthExtent) -> Azimuths {
        Azimuths { angles: angles.to_vec(), extent }
    }

    #[test]
    fn angles_invert_directions_in_every_frame() {
        for frame in FRAMES {
            let (low, high) = frame.polar_range();
            for step in 0..=12 {
                let polar = low + (high - low) * f64::from(step) / 12.0;
                for azimuth in [-170.0, -90.0, 0.0, 33.0, 90.0, 179.0] {
                    let direction = frame.direction(polar, azimuth);
                    let [found, turn] = frame.angles(direction);
                    assert!((found - polar).abs() < 1e-9, "{frame} {polar} {found}");
                    if step % 12 != 0 {
                        assert!((turn - azimuth).abs() < 1e-9, "{frame} {azimuth} {turn}");
                    }
                    assert!(dot(frame.direction(found, turn).xyz(), direction.xyz()) > 1.0 - 1e-14);
                }
            }
        }
    }

    #[test]
    fn frames_are_those_of_the_standards() {
        let is_at = |frame: Frame, polar, azimuth, expected: [f64; 3]| {
            let found = frame.direction(polar, azimuth).xyz();
            assert!(dot(found, expected) > 1.0 - 1e-14, "{frame} {polar} {azimuth}: {found:?}");
        };
        is_at(Frame::Surface, 0.0, 0.0, [0.0, 0.0, 1.0]);
        is_at(Frame::Surface, 90.0, 90.0, [0.0, 1.0, 0.0]);
        is_at(Frame::TypeC, 0.0, 0.0, [0.0, 0.0, -1.0]);
        is_at(Frame::TypeC, 90.0, 90.0, [0.0, 1.0, 0.0]);
        is_at(Frame::TypeB, 0.0, 0.0, [0.0, 0.0, -1.0]);
        is_at(Frame::TypeB, 0.0, 90.0, [1.0, 0.0, 0.0]);
        is_at(Frame::TypeB, 90.0, 0.0, [0.0, -1.0, 0.0]);
        is_at(Frame::TypeA, 90.0, 0.0, [0.0, 0.0, 1.0]);
        is_at(Frame::TypeA, 0.0, 90.0, [0.0, -1.0, 0.0]);
    }

    #[test]
    fn every_entry_is_nearest_to_its_own_direction() {
        for (frame, polar) in [
            (Frame::Surface, vec![10.0, 20.0, 50.0]),
            (Frame::TypeC, vec![10.0, 20.0, 50.0]),
            (Frame::TypeB, vec![-60.0, 0.0, 10.0]),
            (Frame::TypeA, vec![-60.0, 0.0, 10.0]),
        ] {
            for azimuths in [
                Some(azimuths(&[0.0, 90.0, 200.0, 355.0], AzimuthExtent::Circle)),
                Some(azimuths(&[-180.0, 0.0, 170.0], AzimuthExtent::Circle)),
                Some(azimuths(&[-20.0, 0.0, 170.0], AzimuthExtent::Sector)),
                Some(azimuths(&[0.0, 45.0, 180.0], AzimuthExtent::Mirrored)),
                Some(azimuths(&[90.0, 100.0, 270.0], AzimuthExtent::MirroredAt90)),
                Some(azimuths(&[0.0, 15.0, 90.0], AzimuthExtent::Quadrant)),
                None,
            ] {
                let grid = DirectionGrid::new(frame, polar.clone(), azimuths).unwrap();
                for entry in 0..grid.len() {
                    assert_eq!(grid.nearest(grid.direction(entry)), Some(entry), "{}", grid.describe());
                }
            }
        }
        // The last azimuth of a closed circle repeats the first.
        let closed = Some(azimuths(&[0.0, 120.0, 240.0, 360.0], AzimuthExtent::Closed));
        let grid = DirectionGrid::new(Frame::TypeC, vec![0.0, 45.0], closed).unwrap();
        assert_eq!(grid.nearest(grid.direction(7)), Some(4));
    }

    #[test]
    fn symmetries_fold_azimuths_onto_those_listed() {
        let folded = |angles: &[f64], extent, azimuth| azimuths(angles, extent).folded(azimuth);
        assert_eq!(folded(&[0.0, 350.0], AzimuthExtent::Circle, -5.0), 355.0);
        assert_eq!(folded(&[-180.0, 170.0], AzimuthExtent::Circle, 190.0), -170.0);
        assert_eq!(folded(&[0.0, 180.0], AzimuthExtent::Mirrored, -30.0), 30.0);
        assert_eq!(folded(&[0.0, 180.0], AzimuthExtent::Mirrored, 330.0), 30.0);
        assert_eq!(folded(&[90.0, 270.0], AzimuthExtent::MirroredAt90, 30.0), 150.0);
        assert_eq!(folded(&[90.0, 270.0], AzimuthExtent::MirroredAt90, 200.0), 200.0);
        for azimuth in [20.0, 160.0, 200.0, 340.0, -20.0] {
            assert_eq!(folded(&[0.0, 90.0], AzimuthExtent::Quadrant, azimuth), 20.0);
        }
    }

    #[test]
    fn a_grid_stands_for_what_it_covers_and_no_more() {
        let at = |theta: f64, phi: f64| Direction::from_degrees(theta, phi);
        let plain = DirectionGrid::new(Frame::Surface, vec![10.0, 60.0], None).unwrap();
        assert_eq!((plain.nearest(at(5.0, 0.0)), plain.nearest(at(30.0, 77.0))), (None, Some(0)));
        let wide = plain.clone().covering(0.0, 90.0).unwrap().with_outside(Outside::Dark);
        assert_eq!(wide.angles(at(5.0, 9.0)), Some([10.0, 0.0]));
        assert_eq!((wide.nearest(at(90.0, 0.0)), wide.nearest(at(91.0, 0.0))), (Some(1), None));
        let sector = Some(azimuths(&[0.0, 40.0], AzimuthExtent::Sector));
        let sector = DirectionGrid::new(Frame::Surface, vec![0.0, 60.0], sector).unwrap();
        assert_eq!((sector.nearest(at(50.0, 20.0)), sector.nearest(at(50.0, 41.0))), (Some(2), None));
        // A border is hit by angles of six digits and by directions in float32, around the grid's pole, too.
        for (theta, phi, found) in [(60.000_5, 40.0, 3), (50.0, 40.000_5, 3), (50.0, -0.000_5, 2), (1.0, -1e-2, 0)] {
            assert_eq!(sector.nearest(at(theta, phi)), Some(found), "{theta} {phi}");
            let [polar, azimuth] = sector.angles(at(theta, phi)).unwrap();
            assert!((0.0..=60.0).contains(&polar) && (0.0..=40.0).contains(&azimuth), "{polar} {azimuth}");
        }
        for (theta, phi) in [(60.005, 20.0), (50.0, 40.005), (50.0, -0.005), (1.0, -1.0)] {
            assert_eq!(sector.nearest(at(theta, phi)), None, "{theta} {phi}");
        }
        for entry in 0..sector.len() {
            let short = sector.direction(entry).xyz().map(|x| f64::from(x as f32));
            assert!(sector.angles(Direction::from_unit(short)).is_some(), "{entry}");
        }
        // A pole is inside whatever azimuths are covered.
        for angles in [&[10.0, 40.0][..], &[300.0]] {
            let aside = Some(azimuths(angles, AzimuthExtent::Sector));
            let aside = DirectionGrid::new(Frame::Surface, vec![0.0, 60.0], aside).unwrap();
            assert_eq!((aside.nearest(at(0.0, 77.0)), aside.nearest(at(50.0, 0.0))), (Some(0), None));
        }
        let lateral =
            DirectionGrid::new(Frame::TypeB, vec![0.0, 40.0], Some(azimuths(&[0.0, 30.0], AzimuthExtent::Sector)));
        let lateral = lateral.unwrap().mirrored().unwrap();
        assert_eq!(lateral.nearest(Frame::TypeB.direction(-39.0, 29.0)), Some(3));
    }

    #[test]
    fn angles_that_are_no_grid_are_refused() {
        use DirectionGridError as E;
        let grid = |polar: &[f64], azimuths| DirectionGrid::new(Frame::TypeC, polar.to_vec(), azimuths);
        let circle = |angles: &[f64]| Some(azimuths(angles, AzimuthExtent::Circle));
        assert!(matches!(grid(&[], None), Err(E::Count { .. })));
        assert!(matches!(grid(&[0.0, f64::NAN], None), Err(E::Range { .. })));
        assert!(matches!(grid(&[0.0, 181.0], None), Err(E::Range { .. })));
        assert!(matches!(grid(&[0.0, 0.0], None), Err(E::Order { .. })));
        assert!(matches!(grid(&[0.0], circle(&[0.0, 360.0])), Err(E::Span { .. })));
        assert!(matches!(grid(&[0.0], Some(azimuths(&[0.0, 359.0], AzimuthExtent::Closed))), Err(E::Span { .. })));
        assert!(matches!(grid(&[0.0], Some(azimuths(&[-10.0], AzimuthExtent::Mirrored))), Err(E::Range { .. })));
        let long: Vec<f64> = (0..40_000).map(|i| f64::from(i) * 0.004).collect();
        assert!(matches!(grid(&long, circle(&long)), Err(E::TooMany { .. })));
        assert!(matches!(grid(&[10.0], None).unwrap().covering(20.0, 90.0), Err(E::Covers { .. })));
        assert!(matches!(grid(&[10.0], None).unwrap().mirrored(), Err(E::Mirrored { .. })));
    }

    #[test]
    fn planes_far_apart_are_a_scan() {
        use AzimuthExtent as E;
        for (angles, extent, expected) in [
            (vec![180.0], E::Sector, true),
            (vec![0.0, 180.0], E::Mirrored, true),
            (vec![0.0, 180.0], E::Circle, true),
            (vec![0.0, 120.0, 240.0], E::Circle, true),
            (vec![0.0, 90.0, 180.0], E::Mirrored, false),
            (vec![0.0, 90.0], E::Sector, false),
            (vec![0.0, 10.0, 120.0, 130.0], E::Sector, false),
            (vec![20.0, 150.0], E::Mirrored, false),
            (vec![0.0, 45.0, 90.0], E::Quadrant, false),
        ] {
            let grid = DirectionGrid::new(Frame::Surface, vec![0.0, 40.0], Some(azimuths(&angles, extent))).unwrap();
            assert_eq!(grid.is_scan(), expected, "{extent} {angles:?}");
        }
        assert!(!DirectionGrid::new(Frame::Surface, vec![0.0, 40.0], None).unwrap().is_scan());
    }
}
