//! Limits on the length of lines for which bases and tables are made.

/// Longest line, in samples. Synthesis and analysis functions of all coefficients are in memory: up to n² numbers each.
pub const MAX_LINE: usize = 4096;
/// Longest line, in samples, whose Gram matrix or multiplier is tabulated: n² numbers, 8 MiB at this length.
pub const MAX_GRAM: usize = 1024;
/// Longest line, in samples, whose couplings are tabulated: n²/2 pairs, each with up to n numbers.
pub const MAX_COUPLED: usize = 512;
/// Largest number of coupling coefficients in a table (128 MiB). A basis whose functions all overlap reaches it at 322
/// samples.
pub const MAX_COUPLINGS: usize = 1 << 24;
