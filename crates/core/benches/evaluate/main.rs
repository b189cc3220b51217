//! Accuracy of evaluation against analytic functions, and speed of evaluation.
//!
//! `cargo bench -p wavelume-core --bench evaluate [-- accuracy | speed [only=WORDS] | memory | count]`. All runs share
//! one process and the best of several counts, so that ratios compare runs under equal conditions. `only` selects calls
//! with these words in their names. `tests/benches/instructions.py` counts instructions and cache misses of the same
//! calls.
#![allow(clippy::print_stdout, reason = "a bench prints its figures")]

mod accuracy;
mod calls;
mod surfaces;

fn main() {
    let wanted: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let is_wanted = |name: &str| wanted.is_empty() || wanted.iter().any(|w| w == name);
    if wanted.iter().any(|w| w == "count") {
        return calls::count();
    }
    if is_wanted("accuracy") {
        accuracy::accuracy(&surfaces::grid(400.0, 50.0, 7));
    }
    if is_wanted("speed") {
        let only = wanted.iter().find_map(|word| word.strip_prefix("only="));
        calls::speed(only.unwrap_or_default());
    }
    if is_wanted("memory") {
        calls::from_memory();
    }
}
