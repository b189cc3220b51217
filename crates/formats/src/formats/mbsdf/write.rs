//! An isotropic BSDF as tables of reflection, of transmission, or of both.

use super::super::acquisition::{DirectionalFunction, Written, lifted};
use super::super::error::{FormatError, FormatErrorKind};
use super::about::NAME;
use super::angles::{azimuths, polar_angles};
use super::blocks::VERSION;
use crate::domain::Direction;
use crate::domain::limits::MAX_SAMPLES;
use rayon::prelude::*;

/// Contents and resolution of a measured BSDF file to write.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MbsdfGrid {
    /// Number of polar angles of the incoming and of the outgoing directions, `i · 90°/n`.
    pub theta: usize,
    /// Number of azimuths between incoming and outgoing directions, `j · 180°/(m − 1)`; 1 for a function that does not
    /// depend on the azimuth.
    pub phi: usize,
    /// True to write each BSDF value in three channels of linear sRGB, false to write it as a single number.
    pub rgb: bool,
    /// True to write the table of reflection.
    pub reflection: bool,
    /// True to write the table of transmission, for which the BSDF is evaluated at outgoing directions below the
    /// surface.
    pub transmission: bool,
    /// Lines of metadata, `key="value"`, that precede the tables of reflection and transmission in the written MBSDF
    /// file.
    pub metadata: Vec<String>,
}

/// Writes a measured BSDF file from `function` in sr⁻¹ without the factor cos θo. The function must be isotropic and
/// symmetric about the plane of incidence.
pub fn write_mbsdf(grid: &MbsdfGrid, function: &dyn DirectionalFunction) -> Result<Written, FormatError> {
    let sides: Vec<(bool, &str)> =
        [(grid.reflection, true, "MBSDF_DATA_REFLECTION="), (grid.transmission, false, "MBSDF_DATA_TRANSMISSION=")]
            .into_iter()
            .filter_map(|(wanted, above, line)| wanted.then_some((above, line)))
            .collect();
    let needs = |message: String| Err(FormatError::new(FormatErrorKind::NeedsOption, NAME, message));
    if sides.is_empty() || grid.theta == 0 || grid.phi == 0 {
        return needs(format!(
            "{} sides, {} polar and {} azimuth angles, expected at least 1 of each",
            sides.len(),
            grid.theta,
            grid.phi
        ));
    }
    if let Some(line) = grid.metadata.iter().find(|line| line.contains(['\n', '\0']) || line.starts_with("MBSDF_DATA"))
    {
        return needs(format!("metadata {line:?}, expected a line of text"));
    }
    let channels = if grid.rgb { 3 } else { 1 };
    let row = grid.phi.checked_mul(channels);
    let side = row.and_then(|row| row.checked_mul(grid.theta)?.checked_mul(grid.theta));
    let Some((row, side)) = row.zip(side.filter(|&n| n <= MAX_SAMPLES / 2)) else {
        let message = format!(
            "{} × {} × {} values of {channels} channels are more than the limit of {}",
            grid.theta,
            grid.theta,
            grid.phi,
            MAX_SAMPLES / 2
        );
        return Err(FormatError::new(FormatErrorKind::OverLimit, NAME, message));
    };
    let mut bytes = VERSION.to_vec();
    for line in &grid.metadata {
        bytes.extend(line.as_bytes());
        bytes.push(b'\n');
    }
    let theta: Vec<f64> = polar_angles(grid.theta).collect();
    let phi = azimuths(grid.phi);
    let (mut filled, mut clipped) = (0, 0);
    for (above, line) in sides {
        let mut values = vec![0.0_f32; side];
        let counts: Vec<(usize, usize)> = values
            .par_chunks_mut(row)
            .enumerate()
            .map(|(pair, row)| {
                let (theta_in, theta_out) = (theta[pair / grid.theta], theta[pair % grid.theta]);
                let wi = Direction::from_degrees(theta_in, 0.0);
                let mut found = vec![0.0; channels];
                let mut counts = (0, 0);
                for (values, &phi) in row.chunks_exact_mut(channels).zip(&phi) {
                    let wo = if above {
                        lifted(Direction::from_degrees(theta_out, phi).xyz())
                    } else {
                        Direction::from_degrees(180.0 - theta_out, phi)
                    };
                    function.evaluate(wi, wo, &mut found);
                    for (value, &found) in values.iter_mut().zip(&found) {
                        counts.0 += usize::from(found.is_nan());
                        counts.1 += usize::from(found < 0.0);
                        // NaN becomes 0 as well.
                        *value = found.max(0.0) as f32;
                    }
                }
                counts
            })
            .collect();
        if let Some(bad) = values.iter().find(|value| !value.is_finite()) {
            let message = format!("the BSDF is {bad:e}, expected a finite number");
            return Err(FormatError::new(FormatErrorKind::Malformed, NAME, message));
        }
        filled += counts.iter().map(|counts| counts.0).sum::<usize>();
        clipped += counts.iter().map(|counts| counts.1).sum::<usize>();
        bytes.extend(line.as_bytes());
        bytes.push(b'\n');
        for word in [u32::from(grid.rgb), grid.theta as u32, grid.phi as u32] {
            bytes.extend(word.to_le_bytes());
        }
        bytes.reserve(4 * values.len());
        bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    }
    Ok(Written { bytes, filled, clipped })
}

#[cfg(test)]
mod tests {
    use super::super::super::{Interpretation, Samples};
    use super::super::read;
    use super::*;
    use crate::domain::Quantity;

    /// BSDF for tests, whose values differ between outgoing directions above and below the surface, and by polar angle,
    /// azimuth and channel.
    #[derive(Debug)]
    struct Sheet;

    impl DirectionalFunction for Sheet {
        fn evaluate(&self, wi: Direction, wo: Direction, values: &mut [f64]) {
            let ([x, _, z], [a, _, c]) = (wi.xyz(), wo.xyz());
            let side = if c > 0.0 { 1.0 } else { 0.3 };
            values.iter_mut().enumerate().for_each(|(i, v)| *v = side * (1.0 + 0.5 * z + 0.2 * x * a + 0.1 * i as f64));
        }
    }

    #[derive(Debug)]
    struct Constant(f64);
    impl DirectionalFunction for Constant {
        fn evaluate(&self, _: Direction, _: Direction, values: &mut [f64]) {
            values.fill(self.0);
        }
    }

    fn grid() -> MbsdfGrid {
        MbsdfGrid {
            theta: 9,
            phi: 7,
            rgb: true,
            reflection: true,
            transmission: true,
            metadata: vec!["a=\"b\"".into()],
        }
    }

    #[test]
    fn what_is_written_reads_back_side_by_side() {
        let written = write_mbsdf(&grid(), &Sheet).unwrap();
        assert_eq!((written.filled, written.clipped), (0, 0));
        for (quantity, angle, row) in [(Quantity::Brdf, 30.0, 3), (Quantity::Btdf, 150.0, 5)] {
            let how = Interpretation { quantity: Some(quantity.into()), ..Interpretation::default() };
            let acquisition = read(&written.bytes, &how).unwrap();
            assert_eq!(acquisition.report.metadata[0], ("a".to_owned(), "\"b\"".to_owned()));
            let Samples::Grid(grid) = acquisition.samples else { panic!("a grid") };
            assert_eq!(grid.outgoing.unwrap().theta[row], angle);
            let mut wanted = [0.0; 3];
            Sheet.evaluate(Direction::from_degrees(20.0, 0.0), Direction::from_degrees(angle, 60.0), &mut wanted);
            let at = ((2 * 9 + row) * 7 + 2) * 3;
            assert_eq!(grid.values[at..at + 3], wanted.map(|v| v as f32), "{quantity}");
        }
    }

    #[test]
    fn what_the_format_cannot_hold_is_counted_or_refused() {
        let all = 2 * 9 * 9 * 7 * 3;
        let written = write_mbsdf(&grid(), &Constant(f64::NAN)).unwrap();
        assert_eq!((written.filled, written.clipped), (all, 0));
        let written = write_mbsdf(&grid(), &Constant(-1.0)).unwrap();
        assert_eq!((written.filled, written.clipped), (0, all));
        let kind = |grid: MbsdfGrid, value| write_mbsdf(&grid, &Constant(value)).unwrap_err().kind;
        assert_eq!(kind(grid(), f64::INFINITY), FormatErrorKind::Malformed);
        for wrong in [
            MbsdfGrid { reflection: false, transmission: false, ..grid() },
            MbsdfGrid { theta: 0, ..grid() },
            MbsdfGrid { phi: 0, ..grid() },
            MbsdfGrid { metadata: vec!["a\nb".into()], ..grid() },
        ] {
            assert_eq!(kind(wrong, 1.0), FormatErrorKind::NeedsOption);
        }
        for huge in [1 << 14, usize::MAX] {
            assert_eq!(kind(MbsdfGrid { theta: huge, ..grid() }, 1.0), FormatErrorKind::OverLimit);
        }
    }
}
