//! Notes on checks of a file against physics.

wavelume_core::declare_notes! {
    /// Remarks for the user on checks of a measurement against physics: energy conservation, reciprocity and negative
    /// values.
    CheckNote {
        Checked AlbedoAboveOne {
            albedo: f64, above: usize, summed: usize, all: usize, theta_i_degrees: f64, phi_i_degrees: Option<f64>,
            wavelength_nm: Option<f64>, channel: Option<usize>,
        } => "albedo above 1 under {above} of {summed} incoming directions: {albedo:.3} at most, under \
              theta_i {theta_i_degrees:.1}°{phi}{band}{part}; {advice}",
            phi = phi_i_degrees.map_or_else(String::new, |phi| format!(", phi_i {phi:.1}°")),
            band = match (wavelength_nm, channel) {
                (Some(nanometres), _) => format!(" at {nanometres} nm"),
                (None, Some(number)) => format!(" in channel {number}"),
                (None, None) => String::new(),
            },
            part = if summed < all { format!("; {summed} of {all} were summed") } else { String::new() },
            advice = if (2.5..=102.0).contains(&albedo) {
                format!("values in per cent would have an albedo of {:.3} after division by 100", albedo / 100.0)
            } else {
                "the scale, the cosine or the reference may be wrong".to_owned()
            };
        Checked Reciprocity { difference_percent: f64, values: u64, is_interpolated: bool } =>
            "f(wi, wo) and f(wo, wi), equal by reciprocity, differ by {difference_percent:.2} % (median of {values} \
             values{origin})",
            origin = if is_interpolated { ", interpolated between samples" } else { "" };
        Checked Negative { values: u64, of: u64, largest_percent: Option<f64> } =>
            "{values} of {of} values ({share:.2} %) are negative; {size}",
            share = 100.0 * values as f64 / of as f64,
            size = largest_percent.map_or_else(
                || "no value is positive".to_owned(),
                |largest| format!("the largest has {largest:.2} % of the magnitude of the largest value"),
            );
    }
}
