//! Notes on a compressed material: its light and its errors at the samples.

wavelume_core::declare_notes! {
    /// Warnings for the user about a compressed material: its directional albedo or flux, and its errors at the
    /// samples.
    MaterialNote {
        Warning LightOff { largest_percent: f64, bound: f64 } =>
            "the light of some direction (directional albedo, flux) is {largest_percent:.1} % off, though the samples keep \
             their error: give albedo_error {bound}, or a smaller error";
        Warning LargerThanLossless { bytes: usize, lossless_bytes: usize } =>
            "the file has {bytes} bytes, and a lossless one of these samples {lossless_bytes}: use lossless, or ask for a \
             larger error";
        Warning LevelCoarse {
            level: u8, is_named: bool, added_percent: f64, noise_percent: Option<f64>, allowed_percent: f64,
        } => "outgoing level {level}{tried} adds er(L2) {added_percent:.2} % to the noise of the samples ({noise}), more than \
              {allowed_percent:.2} % (twice the promised error, or half the noise): {advice}",
            tried = if is_named { "" } else { ", the best tried," },
            noise = noise_percent.map_or_else(|| "unknown".to_owned(), |noise| format!("{noise:.2} %")),
            advice = if is_named {
                "give a finer outgoing_level, or none"
            } else {
                "give a finer outgoing_level, or a larger error"
            };
        Warning AboveNoise { added_percent: f64, noise_percent: Option<f64>, promised_percent: f64 } =>
            "the material adds er(L2) {added_percent:.2} % to the noise of the samples ({noise}), more than the promised \
             {promised_percent:.2} %: give a smaller error or a finer outgoing level, or measure more densely",
            noise = noise_percent.map_or_else(|| "unknown".to_owned(), |noise| format!("{noise:.2} %"));
        Warning LightDiffers {
            difference_percent: f64, is_more: bool, theta_i_degrees: Option<f64>, phi_i_degrees: Option<f64>,
            first_nm: Option<f64>, last_nm: Option<f64>, first_channel: Option<usize>, last_channel: Option<usize>,
            noise_percent: Option<f64>, others: usize, lobe_reduced_percent: Option<f64>,
        } => "the material has {difference_percent:.1} % {more} light than its samples{incidence}{bands}, where their \
              {noise}{others}: {advice}",
            more = if is_more { "more" } else { "less" },
            incidence = match (theta_i_degrees, phi_i_degrees) {
                (Some(theta), Some(phi)) => format!(" under the incidence of {theta:.1}° (azimuth {phi:.1}°)"),
                (Some(theta), None) => format!(" under the incidence of {theta:.1}°"),
                _ => String::new(),
            },
            bands = bands(first_nm.zip(last_nm), first_channel.zip(last_channel)),
            noise = noise_percent.map_or_else(
                || "noise is unknown".to_owned(),
                |noise| format!("noise explains {noise:.2} %"),
            ),
            others = match others {
                0 => String::new(),
                1 => "; so does that of one other incidence or group of bands, by less".to_owned(),
                others => format!("; so do those of {others} other incidences or groups of bands, by less"),
            },
            advice = if is_more {
                "the cells or the incoming directions may be too coarse for it".to_owned()
            } else {
                advice_for_less(lobe_reduced_percent)
            };
        Warning PartlyMeasured { measured: String, share_percent: f64, light: &'static str } =>
            "{measured} (at least 80 % is needed): there is no {light}, sample or density (pdf), no picture of a ball and no rgl \
             file; directions that were not measured are masked";
        Warning StatedFitUnread { reason: String } =>
            "the metadata of the material state the error at scattered samples in a way that this program does not \
             understand: {reason}";
        Warning AlbedoAboveOne { albedo: f64, places: usize, theta_i_degrees: Option<f64> } =>
            "the samples have an albedo above 1 under {under}: {albedo:.3}{incidence}; the scale, the cosine or the reference \
             may be wrong",
            under = match places {
                1 => "one incidence or group of bands".to_owned(),
                places => format!("{places} incidences or groups of bands"),
            },
            incidence = theta_i_degrees
                .map_or_else(String::new, |theta| format!(", most under the incidence of {theta:.1}°"));
    }
}

/// Returns a range in words, from its first to its last wavelength in nm or, without wavelengths, from its first to its
/// last channel.
fn bands(wavelengths: Option<(f64, f64)>, channels: Option<(usize, usize)>) -> String {
    let wavelengths = wavelengths.map(|(first, last)| (format!("{first:.0}"), format!("{last:.0}")));
    match (wavelengths, channels) {
        (Some((first, last)), _) if first == last => format!(" at {first} nm"),
        (Some((first, last)), _) => format!(" at {first} to {last} nm"),
        (None, Some((first, last))) if first == last => format!(" in channel {first}"),
        (None, Some((first, last))) => format!(" in the channels {first} to {last}"),
        (None, None) => String::new(),
    }
}

/// Returns the likely reason, in words, why a material has less light than its samples. `reduced` is the percentage by
/// which the light of its narrow lobe was reduced.
fn advice_for_less(reduced: Option<f64>) -> String {
    match reduced {
        Some(part) => format!(
            "the light of its narrow lobe was reduced by {part:.1} %, as more light than comes in would have been reflected; \
             the scale, the cosine or the reference may be wrong"
        ),
        None => {
            "a lobe may be narrower than the distance between samples, or than the cells; measure more densely where \
                 samples lie far above their neighbours"
                .to_owned()
        }
    }
}
