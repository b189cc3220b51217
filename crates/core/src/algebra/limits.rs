//! Limits on the length of lines for which bases and tables are made.

/// Largest number of samples of a signal for which a basis is tabulated. Memory grows with its square: up to n² numbers
/// each for the synthesis and the analysis functions.
pub const MAX_LINE: usize = 4096;
/// Largest number of samples of a signal whose Gram matrix, or whose matrix of a multiplication, is tabulated: n²
/// numbers, 8 MiB at this length.
pub const MAX_GRAM: usize = 1024;
/// Largest number of samples of a signal for which coupling coefficients of products are tabulated: n²/2 pairs of
/// functions, each with up to n numbers.
pub const MAX_COUPLED: usize = 512;
/// Largest number of coefficients (128 MiB) in a table that expands the products of all pairs of basis functions in the
/// basis itself. If all functions overlap, 322 samples reach it. Raising it allows longer signals.
pub const MAX_COUPLINGS: usize = 1 << 24;
