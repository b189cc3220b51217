//! Angular resolution of the instrument as the file states it; narrower features cannot be resolved.

use super::rounding::with_digits;
use super::text::number;
use crate::domain::Note;
use crate::notes::LobeNote;
use serde::{Deserialize, Serialize};

/// Angular resolution of the instrument that took the samples, as stated in the file: full angles in degrees, 0 to 180.
///
/// Both angles blur a measured lobe. The true width of a lobe that looks no wider than one of them is unknown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Instrument {
    /// Full angle of the detector's aperture, seen from the sample, in degrees; `None` if the file does not state it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub detector_aperture: Option<f64>,
    /// Full angle of the divergence of the light from the source, in degrees; `None` if the file does not state it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub source_divergence: Option<f64>,
}

/// Names of the header fields and manifest fields for the detector aperture and the source divergence, in the order of
/// [`Instrument::stated`].
pub(super) const KEYS: [&str; 2] = ["detector_aperture", "source_divergence"];
/// Description of the allowed values of an instrument's angle, for error messages.
pub(super) const EXPECTED: &str = "a full angle in degrees, from 0 to 180";

/// Parses the full angle of the detector's aperture or of the source's divergence, in degrees, from the text of a
/// header field; `None` if it is invalid.
pub(super) fn angle(text: &str) -> Option<f64> {
    number(text).and_then(checked)
}

/// Returns `angle` if it is within 0 to 180 degrees, else `None`.
pub(super) fn checked(angle: f64) -> Option<f64> {
    Some(angle).filter(|angle| (0.0..=180.0).contains(angle))
}

impl Instrument {
    /// Creates the angular resolution of an instrument from its detector aperture and its source divergence, in
    /// degrees.
    pub(super) fn of([detector_aperture, source_divergence]: [Option<f64>; 2]) -> Self {
        Self { detector_aperture, source_divergence }
    }

    /// Returns true if the measured file states neither the angle of the detector's aperture nor that of the source's
    /// divergence.
    pub fn is_unknown(&self) -> bool {
        *self == Self::default()
    }

    /// Returns the angles of the instrument that the file states, in degrees, each with its name for people: `the
    /// detector's aperture`.
    pub fn stated(&self) -> impl Iterator<Item = (&'static str, f64)> {
        let named =
            [("the detector's aperture", self.detector_aperture), ("the source's divergence", self.source_divergence)];
        named.into_iter().filter_map(|(name, angle)| Some((name, angle?)))
    }
}

/// Returns a note if a lobe looks no wider than the instrument's detector aperture or source divergence; otherwise
/// `None`. `full_width` is the full width of the lobe at half its height, in degrees.
pub fn not_wider(instrument: &Instrument, full_width: f64) -> Option<Note> {
    let at_least = |angle: Option<f64>| angle.filter(|angle| *angle > 0.0 && full_width <= *angle);
    let (detector, source) = (at_least(instrument.detector_aperture), at_least(instrument.source_divergence));
    (detector.is_some() || source.is_some()).then(|| {
        let note = LobeNote::NoWiderThanInstrument {
            width_degrees: with_digits(full_width, 3),
            detector_aperture_degrees: detector,
            source_divergence_degrees: source,
        };
        note.into()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lobe_no_wider_than_the_instrument_resolves_has_an_unknown_width() {
        let aperture = Instrument { detector_aperture: Some(1.0), ..Instrument::default() };
        let message = not_wider(&aperture, 0.8).unwrap().message;
        assert_eq!(
            message,
            "the lobe of 0.8° is no wider than the detector's aperture of 1°: its true width is unknown"
        );
        assert!(not_wider(&aperture, 1.0).is_some_and(|note| note.message.contains("lobe of 1°")));
        assert_eq!(not_wider(&aperture, 1.001), None);
        let both = Instrument { source_divergence: Some(1.5), ..aperture };
        let message = not_wider(&both, 0.123_456).unwrap().message;
        assert!(
            message
                .contains("0.123° is no wider than the detector's aperture of 1° and the source's divergence of 1.5°")
        );
        let message = not_wider(&both, 1.2).unwrap().message;
        assert!(
            message.contains("than the source's divergence of 1.5°:") && !message.contains("aperture"),
            "{message}"
        );
    }

    #[test]
    fn nothing_is_said_where_nothing_is_stated_or_measured() {
        assert_eq!(not_wider(&Instrument::default(), 0.1), None);
        assert!(Instrument::default().is_unknown());
        // Perfectly collimated, as stated.
        let ideal = Instrument::of([Some(0.0), None]);
        assert_eq!((not_wider(&ideal, 0.0), ideal.is_unknown()), (None, false));
        assert_eq!(not_wider(&Instrument::of([Some(1.0), None]), f64::NAN), None);
    }

    #[test]
    fn only_angles_in_degrees_are_taken() {
        for (text, found) in [("1.5", Some(1.5)), ("0", Some(0.0)), ("180", Some(180.0)), ("2e-1", Some(0.2))] {
            assert_eq!(angle(text), found, "{text}");
        }
        for text in ["", "-0.1", "180.1", "nan", "inf", "1e400", "1 deg", "wide", "1,5", "0x1"] {
            assert_eq!(angle(text), None, "{text}");
        }
    }
}
