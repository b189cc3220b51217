//! Differences between the values that a file states for one and the same direction.

use super::repeated::Repeated;
use crate::domain::{Axis, AzimuthExtent, DirectionGrid, Note, Tensor, cancelling_samples};
use crate::notes::ValueNote;
use serde::{Deserialize, Serialize};

/// Contradictions of a file: root mean square deviations, in percent of the mean, between values that it lists for
/// equal directions. `None` if no such direction is listed more than once.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Contradictions {
    /// Deviation in percent between the values at all azimuths of a pole, which are one direction.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub poles: Option<f64>,
    /// Deviation in percent between the values at the first azimuth and those at the last azimuth, which is 360° later
    /// and hence the same.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seam: Option<f64>,
    /// Deviation in percent between values at angles that the file lists twice.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub planes: Option<f64>,
    /// Deviation in percent between the values at all outgoing azimuths under normal incidence on an isotropic surface,
    /// where the value does not depend on the azimuth.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub normal_incidence: Option<f64>,
    /// Number of values at poles and seams where values of both signs cancel to less than half their mean
    /// magnitude. The promised error does not cover the mean of such values, which evaluation returns.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cancelling: Option<u64>,
}

impl Contradictions {
    /// Returns the deviations between values that a file lists for one and the same direction: in `tensor`, at the
    /// poles, at azimuths 360° apart and under normal incidence. `planes` are the deviations that the reader found at
    /// angles listed twice.
    pub fn of(tensor: &Tensor, planes: Repeated) -> Self {
        let (mut poles, mut seam, mut normal) = (Repeated::default(), Repeated::default(), Repeated::default());
        let axes = tensor.axes();
        for (i, axis) in axes.iter().enumerate() {
            let Axis::Grid(grid) = axis else { continue };
            let inner = axes[i + 1..].iter().map(Axis::len).product();
            let table = Table { samples: tensor.samples(), rows: grid.polar().len(), columns: grid.shape()[1], inner };
            table.scan(grid, &mut poles, &mut seam);
            if let Some(Axis::Elevation(elevations)) = i.checked_sub(1).map(|before| &axes[before])
                && elevations[0] == 0.0
            {
                table.scan_normal(elevations.len(), grid, &mut normal);
            }
        }
        let percent = |repeated: Repeated| repeated.rms().map(|rms| 100.0 * rms);
        let cancelling = Some(cancelling_samples(tensor)).filter(|&samples| samples > 0);
        Self {
            poles: percent(poles),
            seam: percent(seam),
            planes: percent(planes),
            normal_incidence: percent(normal),
            cancelling,
        }
    }

    /// Returns a note on contradictions between the values of a file; `None` if no direction is listed more than once.
    pub fn note(&self) -> Option<Note> {
        let Self { poles, seam, planes, normal_incidence, cancelling } = *self;
        (*self != Self::default()).then(|| {
            let note = ValueNote::DirectionsRestated {
                poles_percent: poles,
                seam_percent: seam,
                repeated_angles_percent: planes,
                normal_incidence_percent: normal_incidence,
                cancelling,
            };
            note.into()
        })
    }
}

/// Samples of a tensor as a table `[…, rows, columns, inner]`: polar angles are rows, azimuths columns.
struct Table<'a> {
    samples: &'a [f32],
    rows: usize,
    columns: usize,
    inner: usize,
}

impl Table<'_> {
    /// Adds the squared relative deviations of the values at one polar angle (a row) from their mean to the sum `to`.
    /// Takes the values at all azimuths, or only those at the first and the last one if `ends` is true.
    fn add(&self, block: &[f32], row: usize, ends: bool, to: &mut Repeated) {
        let row = &block[row * self.columns * self.inner..][..self.columns * self.inner];
        let step = if ends { (self.columns - 1) * self.inner } else { self.inner };
        for i in 0..self.inner {
            to.add(row[i..].iter().step_by(step).map(|&sample| f64::from(sample)));
        }
    }

    fn blocks(&self) -> impl Iterator<Item = &[f32]> {
        self.samples.chunks_exact(self.rows * self.columns * self.inner)
    }

    /// Adds the squared relative deviations of values from their mean to sums: at each pole, those of the values at all
    /// azimuths to `poles`; at every other polar angle, those of the values at the first and the last azimuth, 360°
    /// apart, to `seam`.
    fn scan(&self, grid: &DirectionGrid, poles: &mut Repeated, seam: &mut Repeated) {
        if self.columns < 2 {
            return;
        }
        let is_closed = grid.azimuths().is_some_and(|azimuths| azimuths.extent == AzimuthExtent::Closed);
        for block in self.blocks() {
            for row in 0..self.rows {
                if grid.is_pole(row) {
                    self.add(block, row, false, poles);
                } else if is_closed {
                    self.add(block, row, true, seam);
                }
            }
        }
    }

    /// Adds the squared relative deviations of values under normal incidence, at all azimuths of an outgoing polar
    /// angle, from their mean to `normal`; skips outgoing poles. The first of the `elevations` incoming polar angles is
    /// 0, normal incidence.
    fn scan_normal(&self, elevations: usize, grid: &DirectionGrid, normal: &mut Repeated) {
        if self.columns < 2 {
            return;
        }
        for block in self.blocks().step_by(elevations) {
            (0..self.rows).filter(|&row| !grid.is_pole(row)).for_each(|row| self.add(block, row, false, normal));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::{Azimuths, Frame};

    fn grid(frame: Frame, polar: &[f64], angles: &[f64], extent: AzimuthExtent) -> Axis {
        let azimuths = Azimuths { angles: angles.to_vec(), extent };
        Axis::Grid(DirectionGrid::new(frame, polar.to_vec(), Some(azimuths)).unwrap())
    }

    fn close(found: Option<f64>, wanted: f64) {
        assert!((found.unwrap() - wanted).abs() < 1e-4, "{found:?} {wanted}");
    }

    #[test]
    fn poles_and_seams_are_told_apart() {
        let lamp = grid(Frame::TypeC, &[0.0, 45.0, 90.0], &[0.0, 180.0, 360.0], AzimuthExtent::Closed);
        // The pole: 0.9, 1, 1.1; the seam: 1.9 and 2.1 at 45°, none at 90°.
        let samples = vec![0.9, 1.0, 1.1, 1.9, 7.0, 2.1, 3.0, 5.0, 3.0];
        let found = Contradictions::of(&Tensor::new(vec![lamp], samples).unwrap(), Repeated::default());
        close(found.poles, 100.0 * (0.02_f64 / 3.0).sqrt());
        close(found.seam, 100.0 * (2.0 * 0.05_f64.powi(2) / 4.0).sqrt());
        assert_eq!((found.planes, found.normal_incidence), (None, None));
        let sentence = found.note().unwrap().message;
        assert!(sentence.ends_with("8.16 % at the poles, 3.54 % between the first and the last azimuth"), "{sentence}");
    }

    #[test]
    fn latitudes_have_their_poles_at_90_degrees_and_channels_of_their_own() {
        let beam = grid(Frame::TypeA, &[-30.0, 0.0, 90.0], &[-20.0, 20.0], AzimuthExtent::Sector);
        let samples = vec![1.0, 9.0, 2.0, 8.0, 1.0, 9.0, 2.0, 8.0, 1.0, 4.0, 1.0, 6.0];
        let mut twice = Repeated::default();
        twice.add([1.0, 3.0].into_iter());
        let found = Contradictions::of(
            &Tensor::new(vec![beam, Axis::Index { count: 2, labels: Vec::new() }], samples).unwrap(),
            twice,
        );
        // One channel agrees at the pole, the other has 4 and 6.
        close(found.poles, 100.0 * (0.08_f64 / 4.0).sqrt());
        close(found.planes, 50.0);
        assert_eq!(found.seam, None);
    }

    #[test]
    fn an_isotropic_surface_has_no_azimuth_under_normal_light() {
        let paint = grid(Frame::Surface, &[0.0, 45.0], &[0.0, 180.0], AzimuthExtent::Mirrored);
        let axes = vec![Axis::Elevation(vec![0.0, 30.0]), paint];
        let samples = vec![1.0, 1.0, 0.8, 1.2, f32::NAN, 2.0, 3.0, 4.0];
        let found = Contradictions::of(&Tensor::new(axes.clone(), samples).unwrap(), Repeated::default());
        close(found.normal_incidence, 20.0);
        close(found.poles, 0.0);
        // Values of both signs cancel at a pole: 1 and -0.9, but not 3 and -0.9.
        let [first, second] = [1.0, 3.0].map(|pole| {
            let samples = vec![pole, -0.9, 1.0, 1.0, 2.0, 2.0, 3.0, 4.0];
            Contradictions::of(&Tensor::new(axes.clone(), samples).unwrap(), Repeated::default())
        });
        assert_eq!((first.cancelling, second.cancelling), (Some(2), None));
        let sentence = first.note().unwrap().message;
        assert!(
            sentence.ends_with("; 2 values of both signs cancel, so no error is promised of their mean"),
            "{sentence}"
        );
        // Nothing is stated twice off the poles and the normal.
        let tilted = vec![Axis::Elevation(vec![10.0, 30.0]), axes[1].clone()];
        let found = Contradictions::of(&Tensor::new(tilted, vec![f32::NAN; 8]).unwrap(), Repeated::default());
        assert_eq!((found, found.note()), (Contradictions::default(), None));
    }
}
