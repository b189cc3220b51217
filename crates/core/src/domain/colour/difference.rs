//! CIEDE2000 colour difference, with kL = kC = kH = 1 (CIE 015:2018, section 8.3; G. Sharma, W. Wu, E. N. Dalal, *The
//! CIEDE2000 Color-Difference Formula*, Color Research and Application 30(1), 2005, equations 2 to 22).

use super::lab::Lab;

const FULL: f64 = 360.0;

/// Returns the CIEDE2000 difference of two colours.
///
/// The paper compares the hue difference with 180°; this function uses the sign of a cross product instead. The formula
/// is discontinuous at opposite hues, and its value there must not depend on the last bit of an arc tangent.
pub fn ciede2000(one: Lab, two: Lab) -> f64 {
    let mean_chroma = 0.5 * (chroma(one.a, one.b) + chroma(two.a, two.b));
    let g = 0.5 * (1.0 - saturation(mean_chroma));
    let (a1, a2) = ((1.0 + g) * one.a, (1.0 + g) * two.a);
    let (c1, c2) = (chroma(a1, one.b), chroma(a2, two.b));
    let (h1, h2) = (hue(a1, one.b), hue(a2, two.b));

    let (mut dh, mut h) = (h2 - h1, h1 + h2);
    if c1 * c2 == 0.0 {
        dh = 0.0;
    } else {
        let cross = a1 * two.b - a2 * one.b;
        let within_half = if h1 <= h2 { cross >= 0.0 } else { cross <= 0.0 };
        if !within_half {
            dh += if h2 <= h1 { FULL } else { -FULL };
            h += if h < FULL { FULL } else { -FULL };
        }
        h *= 0.5;
    }
    let dl = two.l - one.l;
    let dc = c2 - c1;
    let dh = 2.0 * (c1 * c2).sqrt() * sin(0.5 * dh);

    let l = 0.5 * (one.l + two.l) - 50.0;
    let c = 0.5 * (c1 + c2);
    let t = 1.0 - 0.17 * cos(h - 30.0) + 0.24 * cos(2.0 * h) + 0.32 * cos(3.0 * h + 6.0) - 0.20 * cos(4.0 * h - 63.0);
    let turn = (h - 275.0) / 25.0;
    let theta = 30.0 * libm::exp(-turn * turn);
    let sl = 1.0 + 0.015 * l * l / (20.0 + l * l).sqrt();
    let sc = 1.0 + 0.045 * c;
    let sh = 1.0 + 0.015 * c * t;
    let rt = -sin(2.0 * theta) * 2.0 * saturation(c);
    let (dl, dc, dh) = (dl / sl, dc / sc, dh / sh);
    // The quadratic form is positive, but rounding can make it negative.
    (dl * dl + dc * dc + dh * dh + rt * dc * dh).max(0.0).sqrt()
}

fn chroma(a: f64, b: f64) -> f64 {
    (a * a + b * b).sqrt()
}

/// Returns the chroma term `√(C⁷ / (C⁷ + 25⁷))` of CIEDE2000, without overflow at any chroma C.
fn saturation(c: f64) -> f64 {
    let r = c / 25.0;
    if r > 1.0 {
        let inverse = 1.0 / r;
        (1.0 / (1.0 + seventh(inverse))).sqrt()
    } else {
        let power = seventh(r);
        (power / (power + 1.0)).sqrt()
    }
}

fn seventh(x: f64) -> f64 {
    let cube = x * x * x;
    cube * cube * x
}

/// Returns the hue angle of a colour in degrees, 0 to 360; 0 for grey.
fn hue(a: f64, b: f64) -> f64 {
    if a == 0.0 && b == 0.0 {
        return 0.0;
    }
    let degrees = libm::atan2(b, a).to_degrees();
    if degrees < 0.0 { degrees + FULL } else { degrees }
}

fn sin(degrees: f64) -> f64 {
    libm::sin(degrees.to_radians())
}

fn cos(degrees: f64) -> f64 {
    libm::cos(degrees.to_radians())
}
