//! Notes on narrow lobes.

wavelume_core::declare_notes! {
    /// Remarks for the user (warnings, choices) on narrow lobes of a measurement.
    LobeNote {
        Chosen Carried { lobe: String, samples: u64, reduced_percent: Option<f64>, unseen_bands: usize } =>
            "a lobe narrower than the cells is carried beside them: {lobe}; {samples} {lie} within half its \
             maximum{reduced}{unseen}",
            lie = if samples == 1 { "sample lies" } else { "samples lie" },
            reduced = reduced_percent.map_or_else(String::new, |part| {
                format!("; its light was reduced by {part:.1} %, as more light than comes in would have been reflected")
            }),
            unseen = match unseen_bands {
                0 => String::new(),
                bands => format!("; {bands} bands without a sample of it have the colour of their neighbours"),
            };
        Warning NotResolved { least_albedo: f64, largest_albedo: f64, about: &'static str } =>
            "a lobe narrower than the scan resolves: fewer than three samples of all incidences lie within half its \
             maximum; its albedo, the mean over incidences and bands, lies between {least_albedo} and {largest_albedo}; \
             measure more densely about the {about}";
        Warning Suspected { values: u64, largest_albedo: Option<f64> } =>
            "{values} values far above their neighbours lie together, as those of a lobe do that is narrower than the scan \
             resolves: its light cannot be told from these samples{range}; measure more densely about them",
            range = range(largest_albedo);
        Warning SuspectedAbout { values: u64, about: &'static str, largest_albedo: Option<f64> } =>
            "{values} values far above their neighbours stand about {about}, nearer than all others, as those of a lobe do \
             that is narrower than the scan resolves: its light cannot be told from these samples{range}; measure more \
             densely about {about}",
            range = range(largest_albedo);
        Warning NoWiderThanInstrument {
            width_degrees: f64, detector_aperture_degrees: Option<f64>, source_divergence_degrees: Option<f64>,
        } => "the lobe of {width_degrees}° is no wider than {limits}: its true width is unknown",
            limits = limits(detector_aperture_degrees, source_divergence_degrees);
    }
}

/// Returns a list in words of the stated resolution angles of an instrument: detector aperture and source divergence in
/// degrees.
fn limits(detector_aperture: Option<f64>, source_divergence: Option<f64>) -> String {
    let named = [("the detector's aperture", detector_aperture), ("the source's divergence", source_divergence)];
    let stated = named.iter().filter_map(|(name, angle)| Some(format!("{name} of {}°", (*angle)?)));
    stated.collect::<Vec<_>>().join(" and ")
}

/// Returns the range of albedos that a suspected, unresolved lobe may have, in words; empty if `largest` is `None`.
fn range(largest: Option<f64>) -> String {
    largest.map_or_else(String::new, |largest| format!(": any albedo of it between 0 and {largest} fits them"))
}
