//! Grids of directions as files state them: their own angles, symmetries and numbers, before anything is unfolded,
//! averaged or resampled.

mod contradictions;
mod numbers;
mod repeated;
mod stating;
#[cfg(test)]
mod tests;

pub use contradictions::Contradictions;
pub use numbers::StatedGrid;
pub use repeated::Repeated;
pub use stating::StatedGridError;
