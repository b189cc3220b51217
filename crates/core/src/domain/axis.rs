//! Axes of a tensor, and their roles for a quantity: directions, wavelength or plain indices.

use super::direction::Direction;
use super::direction_grid::DirectionGrid;
use super::limits::{MAX_AXES, MAX_ENTRIES, MAX_SAMPLES};
use super::quantity::Quantity;
use super::triangles::TriangleMesh;
use super::wavelengths::{WavelengthGrid, readable};

/// Axis of a tensor of samples, such as directions or wavelengths.
#[derive(Clone, Debug, PartialEq)]
pub enum Axis {
    /// Directions, one per triangle of a mesh on the sphere.
    Triangles(TriangleMesh),
    /// Directions on a grid of polar angles and azimuths, row-major in the order `[polar, azimuth]`.
    Grid(DirectionGrid),
    /// Incoming polar angles of isotropic data, in degrees, strictly increasing, 0..=90. The incoming azimuth is 0.
    Elevation(Vec<f64>),
    /// Wavelengths, in nm, of the samples of a spectrum.
    Wavelength(WavelengthGrid),
    /// Numbered entries without geometry, such as columns of a table or scan positions.
    Index {
        /// Number of entries of the axis.
        count: usize,
        /// Names of the entries of the axis: none, or one per entry.
        labels: Vec<String>,
    },
    /// Three colour channels, red, green and blue, of data without wavelengths.
    Rgb,
}

/// Reasons why a list of axes does not form a tensor of a radiometric quantity.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum AxisError {
    /// The tensor has too many axes.
    #[error("{found} axes are more than the limit of {MAX_AXES}")]
    TooManyAxes {
        /// Number of axes of the refused tensor.
        found: usize,
    },
    /// The number of samples, the product of the lengths of the axes, exceeds the limit.
    #[error("axes of lengths {shape:?} make more than the limit of {MAX_SAMPLES} samples")]
    TooManySamples {
        /// Number of entries on each axis of the refused tensor.
        shape: Vec<usize>,
    },
    /// An axis of elevations or of numbered entries is invalid.
    #[error("axis {axis}: {reason}")]
    Malformed {
        /// Position of the invalid axis among the axes of the tensor, from 0.
        axis: usize,
        /// Text that names the fault of the axis and what was expected.
        reason: String,
    },
    /// The axes of the tensor do not fit its radiometric quantity.
    #[error("the axes do not fit the quantity {quantity}: {reason}")]
    Unfit {
        /// Radiometric quantity of the tensor.
        quantity: Quantity,
        /// Text that names the axes found and those expected.
        reason: String,
    },
}

impl Axis {
    /// Returns the number of entries of the axis; never 0 once the axis is checked.
    #[allow(clippy::len_without_is_empty, reason = "a checked axis is never empty")]
    pub fn len(&self) -> usize {
        match self {
            Self::Triangles(mesh) => mesh.len(),
            Self::Grid(grid) => grid.len(),
            Self::Elevation(values) => values.len(),
            Self::Wavelength(grid) => grid.len(),
            Self::Index { count, .. } => *count,
            Self::Rgb => 3,
        }
    }

    /// Returns true if the entries of the axis are directions.
    pub fn is_directional(&self) -> bool {
        matches!(self, Self::Triangles(_) | Self::Grid(_) | Self::Elevation(_))
    }

    /// Returns true if the entries of the axis are wavelengths or colour channels.
    pub fn is_spectral(&self) -> bool {
        matches!(self, Self::Wavelength(_) | Self::Rgb)
    }

    /// Returns the direction that an entry of the axis represents: an elevation at azimuth 0, the centroid of a
    /// triangle, or the node of a grid. `None` for axes without directions.
    pub fn direction(&self, entry: usize) -> Option<Direction> {
        match self {
            Self::Elevation(degrees) => Some(Direction::from_degrees(degrees[entry], 0.0)),
            Self::Triangles(mesh) => Some(mesh.centroid(entry)),
            Self::Grid(grid) => Some(grid.direction(entry)),
            _ => None,
        }
    }

    /// Returns a short description of the axis for people: `hemisphere:4 (1024 triangles)`, `380..750 nm (75)`, `12
    /// elevations`.
    pub fn describe(&self) -> String {
        match self {
            Self::Triangles(mesh) => format!("{}:{} ({} triangles)", mesh.domain(), mesh.level(), mesh.len()),
            Self::Grid(grid) => grid.describe(),
            Self::Elevation(values) if values.len() == 1 => "1 elevation".to_owned(),
            Self::Elevation(values) => format!("{} elevations", values.len()),
            Self::Wavelength(grid) => {
                let (first, last) = grid.range();
                format!("{}..{} nm ({})", readable(first), readable(last), grid.len())
            }
            Self::Index { count, .. } => format!("index ({count})"),
            Self::Rgb => "rgb (3)".to_owned(),
        }
    }

    fn check(&self, axis: usize) -> Result<(), AxisError> {
        let malformed = |reason: String| Err(AxisError::Malformed { axis, reason });
        match self {
            Self::Elevation(values) => {
                if values.is_empty() || values.len() > MAX_ENTRIES {
                    return malformed(format!("{} elevations, expected 1 to {MAX_ENTRIES}", values.len()));
                }
                if let Some(bad) = values.iter().find(|v| !(0.0..=90.0).contains(*v)) {
                    return malformed(format!("elevation {bad}, expected 0 to 90 degrees"));
                }
                if let Some(&[a, b]) = values.array_windows().find(|[a, b]| b <= a) {
                    return malformed(format!("elevation {b} after {a}, expected strictly increasing"));
                }
                Ok(())
            }
            Self::Index { count, labels } => {
                if *count == 0 || *count > MAX_ENTRIES {
                    return malformed(format!("{count} entries, expected 1 to {MAX_ENTRIES}"));
                }
                if !labels.is_empty() && labels.len() != *count {
                    return malformed(format!("{} labels for {count} entries", labels.len()));
                }
                Ok(())
            }
            // Checked on construction.
            Self::Triangles(_) | Self::Grid(_) | Self::Wavelength(_) | Self::Rgb => Ok(()),
        }
    }
}

/// Checks the limits of each axis of a tensor and returns the number of samples, the product of the lengths.
pub fn check_axes(axes: &[Axis]) -> Result<usize, AxisError> {
    if axes.len() > MAX_AXES {
        return Err(AxisError::TooManyAxes { found: axes.len() });
    }
    for (i, axis) in axes.iter().enumerate() {
        axis.check(i)?;
    }
    axes.iter()
        .try_fold(1_usize, |product, axis| product.checked_mul(axis.len()))
        .filter(|&product| product <= MAX_SAMPLES)
        .ok_or_else(|| AxisError::TooManySamples { shape: axes.iter().map(Axis::len).collect() })
}

/// Positions of the axes of a tensor by meaning: leading index axes (numbered entries), then directions, then the
/// spectral axis.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Number of leading index axes (axes of numbered entries without geometry).
    pub indices: usize,
    /// Position of the axis of incoming directions among the axes of the tensor, from 0, if there is one.
    pub incoming: Option<usize>,
    /// Position of the axis of outgoing directions among the axes of the tensor, from 0, if there is one.
    pub outgoing: Option<usize>,
    /// Position of the spectral axis (wavelengths or colour channels) among the axes of the tensor, from 0, if there is
    /// one; it is the last axis.
    pub spectral: Option<usize>,
}

impl Layout {
    /// Finds the meaning of each axis for `quantity`, or the reason why the axes do not fit. The order is `[index…,
    /// incoming, outgoing, spectral]`, and each part may be missing. Directional quantities may have index axes only
    /// (scans without geometry); they then have no directions to query.
    pub fn of(quantity: Quantity, axes: &[Axis]) -> Result<Self, AxisError> {
        let unfit = |reason: String| AxisError::Unfit { quantity, reason };
        let indices = axes.iter().take_while(|axis| matches!(axis, Axis::Index { .. })).count();
        let directional = axes[indices..].iter().take_while(|axis| axis.is_directional()).count();
        let spectral_at = indices + directional;
        let spectral = (axes.get(spectral_at).is_some_and(Axis::is_spectral)).then_some(spectral_at);
        if spectral_at + usize::from(spectral.is_some()) != axes.len() {
            let found = axes.iter().map(Axis::describe).collect::<Vec<_>>().join(", ");
            return Err(unfit(format!(
                "axes [{found}], expected [index…, incoming, outgoing, wavelength] in this order"
            )));
        }
        let expected = quantity.directions();
        let (incoming, outgoing) = match (expected, directional) {
            (_, 0) => (None, None),
            (1, 1) if quantity == Quantity::Edf => (None, Some(indices)),
            (1, 1) => (Some(indices), None),
            (2, 2) => (Some(indices), Some(indices + 1)),
            _ => return Err(unfit(format!("{directional} axes of directions, expected {expected}"))),
        };
        if let Some(axis) = outgoing
            && matches!(axes[axis], Axis::Elevation(_))
        {
            return Err(unfit("elevations on the outgoing axis, expected triangles or a grid".to_owned()));
        }
        if let (Some(incoming), Some(outgoing)) = (incoming.map(|axis| &axes[axis]), outgoing.map(|axis| &axes[axis]))
            && matches!((incoming, outgoing), (Axis::Triangles(_), Axis::Grid(_)) | (Axis::Grid(_), Axis::Triangles(_)))
        {
            return Err(unfit(
                "one axis of directions has triangles and the other a grid, expected triangles or grids on both"
                    .to_owned(),
            ));
        }
        Ok(Self { indices, incoming, outgoing, spectral })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Domain;

    fn triangles(level: u8) -> Axis {
        Axis::Triangles(TriangleMesh::new(Domain::Hemisphere, level).unwrap())
    }

    fn grid() -> Axis {
        Axis::Grid(DirectionGrid::new(crate::domain::Frame::Surface, vec![0.0, 45.0], None).unwrap())
    }

    fn lambda() -> Axis {
        Axis::Wavelength(WavelengthGrid::even(380.0, 5.0, 75).unwrap())
    }

    fn index(count: usize) -> Axis {
        Axis::Index { count, labels: vec![] }
    }

    #[test]
    fn roles_follow_the_order_of_the_axes() {
        let brdf = Layout::of(Quantity::Brdf, &[triangles(1), triangles(4), lambda()]).unwrap();
        assert_eq!((brdf.incoming, brdf.outgoing, brdf.spectral), (Some(0), Some(1), Some(2)));
        let isotropic =
            Layout::of(Quantity::Brdf, &[Axis::Elevation(vec![0.0, 30.0]), triangles(4), Axis::Rgb]).unwrap();
        assert_eq!((isotropic.incoming, isotropic.spectral), (Some(0), Some(2)));
        let stated = Layout::of(Quantity::Brdf, &[Axis::Elevation(vec![0.0, 30.0]), grid(), lambda()]).unwrap();
        assert_eq!((stated.incoming, stated.outgoing, stated.spectral), (Some(0), Some(1), Some(2)));
        assert!(Layout::of(Quantity::Bsdf, &[grid(), grid()]).is_ok() && Layout::of(Quantity::Edf, &[grid()]).is_ok());
        let table = Layout::of(Quantity::Spectrum, &[index(24), lambda()]).unwrap();
        assert_eq!((table.indices, table.incoming, table.spectral), (1, None, Some(1)));
        let edf = Layout::of(Quantity::Edf, &[triangles(4)]).unwrap();
        assert_eq!((edf.outgoing, edf.spectral), (Some(0), None));
        let leaf = Layout::of(Quantity::Brdf, &[index(11), index(41), lambda()]).unwrap();
        assert_eq!((leaf.indices, leaf.outgoing), (2, None));
    }

    #[test]
    fn unfit_axes_are_named() {
        for (quantity, axes) in [
            (Quantity::Brdf, vec![triangles(1), lambda()]),
            (Quantity::Edf, vec![triangles(1), triangles(1)]),
            (Quantity::Brdf, vec![lambda(), triangles(1)]),
            (Quantity::Spectrum, vec![triangles(1), lambda()]),
            (Quantity::Brdf, vec![triangles(1), Axis::Elevation(vec![0.0])]),
            (Quantity::Brdf, vec![triangles(1), grid()]),
            (Quantity::Brdf, vec![grid(), triangles(1)]),
        ] {
            assert!(matches!(Layout::of(quantity, &axes), Err(AxisError::Unfit { .. })), "{axes:?}");
        }
    }

    #[test]
    fn sizes_are_checked_before_they_multiply() {
        assert!(matches!(check_axes(&[index(1 << 20), index(1 << 20)]), Err(AxisError::TooManySamples { .. })));
        assert!(matches!(check_axes(&[index(0)]), Err(AxisError::Malformed { axis: 0, .. })));
        assert!(matches!(check_axes(&[Axis::Elevation(vec![30.0, 10.0])]), Err(AxisError::Malformed { .. })));
        assert!(matches!(check_axes(&[Axis::Elevation(vec![f64::NAN])]), Err(AxisError::Malformed { .. })));
        assert_eq!(check_axes(&[triangles(1), triangles(4), lambda()]), Ok(1_228_800));
        assert_eq!(check_axes(&[]), Ok(1));
    }
}
