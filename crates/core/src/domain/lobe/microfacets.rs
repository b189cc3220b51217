//! Masking and projection by the microfacets of a surface: the factor G of a lobe that depends on the half vector. A
//! lobe about a direction has none.

/// Ratio of the roughness α of a GGX surface to the half-width of its lobe in slopes of half vectors: (1 + tan²/α²)² is
/// 2 at tan = 0.6436 α.
pub const ROUGHNESS_OF_WIDTH: f64 = 1.553_773_974_030_037_3;

/// Returns the microfacet factor G = m(cos θi) / (m(cos θo)·hz⁴) with m(c) = c + √(a² + (1 − a²)·c²), which is 1 at the
/// mirror direction. Arguments are the squared roughness a², the cosines of incoming and outgoing polar angle, and the
/// slopes (x, y) of the half vector, where hz⁻² = 1 + x² + y².
#[inline]
pub fn microfacets(squared_roughness: f64, [cos_i, cos_o]: [f64; 2], [x, y]: [f64; 2]) -> f64 {
    let m = |c: f64| c + (squared_roughness + (1.0 - squared_roughness) * c * c).max(0.0).sqrt();
    let squared = 1.0 + x * x + y * y;
    m(cos_i) / m(cos_o) * squared * squared
}
