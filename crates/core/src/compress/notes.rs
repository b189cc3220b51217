//! Notes on targets that a file misses, or that lie below the noise.

use super::figures::shown;

crate::declare_notes! {
    /// Notes on a compression whose file misses the wanted ratio, or whose target lies below the noise.
    CompressionNote {
        Warning RatioAboveSamples { wanted: f64, samples: u64, kept_coefficients: u64 } =>
            "ratio {ratio} is more than the {samples} samples there are: {kept}; ask for ratio {most} or less to keep one",
            ratio = shown(wanted),
            kept = match kept_coefficients {
                0 => "no coefficient is kept".to_owned(),
                kept => format!("{kept} coefficients are kept"),
            },
            most = samples.max(1);
        Warning RatioNotInBytes { wanted: f64, bytes: usize, found: f64 } =>
            "ratio {ratio} is kept in samples per coefficient, not in bytes: the file of {bytes} bytes is {in_bytes} : 1 of \
             the float32 tensor; use the option bytes to bound the size",
            ratio = shown(wanted),
            in_bytes = shown((found * 1000.0).round() / 1000.0);
        Warning BelowNoise { bound: &'static str, wanted: f64, noise_percent: f64, enough: f64 } =>
            "{bound} {wanted} lies below the noise of the samples, whose standard deviation is about {noise_percent:.2} %: the \
             file spends its bytes on noise, about one bit a sample more for every halving of the error; ask for {bound} \
             {enough} or more";
        Warning BelowNoiseOfSpectra { bound: &'static str, wanted: f64, noise_percent: f64, enough: f64 } =>
            "{bound} {wanted} lies below the noise that whole spectra have in common, whose standard deviation is about \
             {noise_percent:.2} %: every direction's own error costs bytes; ask for {bound} {enough} or more";
    }
}
