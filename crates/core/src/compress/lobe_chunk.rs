//! Chunk A: the lobe beside the cells of a material.
//!
//! ```text
//! u8      centre + 4 · two widths
//!         centre: 0 the mirror direction, 1 half vectors, 2 the direction back to the source
//! 3 × f32 coefficients p₀, p₁, p₂ of the logarithm of the peak in sr⁻¹
//! 2 × f32 the least and the largest measured −ln cos θi
//! f32     half-width; with two widths f32 the second one, f32 the angle of the first
//! f32     tail
//! u24     for each sample of a spectrum, where there are several: the colour, the high 24 bits of an f32
//! ```

use crate::codec::{CodecError, Reader, Writer};
use crate::domain::{Axis, Domain, Layout, Lobe, LobeCentre, LobeParameters, Quantity};

/// Upper bound on the number of incoming directions of a file with an analytic lobe. Raising it slows opening, which
/// computes the lobe's light and means over triangles for each of them.
const MOST_INCIDENCES: usize = 4096;
const CENTRE: u8 = 3;
const TWO_WIDTHS: u8 = 4;

/// Returns true if a measurement on these axes can have this analytic lobe beside its samples. It must be a BRDF of few
/// incoming directions over the triangles of the upper hemisphere, with a colour for each sample of a spectrum. A lobe
/// that turns with the surface also needs incoming azimuths.
pub(crate) fn fits(lobe: &Lobe, quantity: Quantity, axes: &[Axis]) -> bool {
    // The incoming axis is the first of those that can have a lobe.
    spectrum_length(quantity, axes) == Some(lobe.colours().len())
        && !(lobe.is_anisotropic() && matches!(axes[0], Axis::Elevation(_)))
}

/// Number of samples of a spectrum; `None` if a measurement on these axes cannot have an analytic lobe.
fn spectrum_length(quantity: Quantity, axes: &[Axis]) -> Option<usize> {
    let layout = Layout::of(quantity, axes).ok()?;
    let is_incoming = |axis: &Axis| matches!(axis, Axis::Elevation(_) | Axis::Triangles(_));
    let has_incoming = layout.incoming == Some(0) && is_incoming(&axes[0]) && axes[0].len() <= MOST_INCIDENCES;
    let has_outgoing =
        layout.outgoing == Some(1) && matches!(axes[1], Axis::Triangles(mesh) if mesh.domain() == Domain::Hemisphere);
    let spectrum = layout.spectral.map_or(1, |axis| axes[axis].len());
    let is_whole = axes.len() == 2 + usize::from(layout.spectral.is_some());
    (quantity == Quantity::Brdf && has_incoming && has_outgoing && is_whole).then_some(spectrum)
}

/// Writes the payload of chunk A, the analytic lobe.
pub(crate) fn write(lobe: &Lobe) -> Vec<u8> {
    let LobeParameters { centre, peak, range, widths, angle, tail, colours } = lobe.parameters();
    let code = match centre {
        LobeCentre::Mirror => 0,
        LobeCentre::HalfVector => 1,
        LobeCentre::Source => 2,
    };
    let mut w = Writer::default();
    w.u8(code | if lobe.is_anisotropic() { TWO_WIDTHS } else { 0 });
    for number in peak.into_iter().chain(range) {
        w.f32(number as f32);
    }
    w.f32(widths[0] as f32);
    if lobe.is_anisotropic() {
        w.f32(widths[1] as f32);
        w.f32(angle as f32);
    }
    w.f32(tail as f32);
    if colours.len() > 1 {
        for colour in colours {
            w.low_bytes(colour.to_bits() >> 8, 3);
        }
    }
    w.into_bytes()
}

/// Reads the payload of chunk A, the analytic lobe, for a material of this quantity on these axes.
pub(crate) fn read(r: &mut Reader<'_>, quantity: Quantity, axes: &[Axis]) -> Result<Lobe, CodecError> {
    let Some(samples) = spectrum_length(quantity, axes) else {
        return Err(
            r.malformed("the file has an analytic lobe, but no BRDF of few incoming directions on the hemisphere")
        );
    };
    let first = r.u8("lobe")?;
    let centre = match first & CENTRE {
        0 => LobeCentre::Mirror,
        1 => LobeCentre::HalfVector,
        2 => LobeCentre::Source,
        _ => {
            return Err(
                r.malformed(format!("the code {} of the centre of the analytic lobe is unknown", first & CENTRE))
            );
        }
    };
    if first & !(CENTRE | TWO_WIDTHS) != 0 {
        return Err(r.malformed(format!("the code {first:#04x} of the analytic lobe is unknown")));
    }
    let has_two = first & TWO_WIDTHS != 0;
    let mut number = |what: &'static str| r.f32(what).map(f64::from);
    let peak = [number("peak of a lobe")?, number("peak of a lobe")?, number("peak of a lobe")?];
    let range = [number("measured range of a lobe")?, number("measured range of a lobe")?];
    let width = number("width of a lobe")?;
    let (second, angle) = if has_two { (number("width of a lobe")?, number("angle of a lobe")?) } else { (width, 0.0) };
    let tail = number("tail of a lobe")?;
    let mut colours = vec![1.0; samples];
    if samples > 1 {
        for colour in &mut colours {
            *colour = f32::from_bits(r.low_bytes(3, "colours of a lobe")? << 8);
        }
    }
    r.end("lobe")?;
    let parameters = LobeParameters { centre, peak, range, widths: [width, second], angle, tail, colours };
    let lobe = Lobe::new(parameters).map_err(|error| r.malformed(error.to_string()))?;
    if has_two != lobe.is_anisotropic() {
        return Err(r.malformed("the analytic lobe states two widths that are equal"));
    }
    if !fits(&lobe, quantity, axes) {
        return Err(r.malformed("the analytic lobe turns with the surface, but incoming directions have no azimuths"));
    }
    Ok(lobe)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::TriangleMesh;

    fn mesh() -> Axis {
        Axis::Triangles(TriangleMesh::new(Domain::Hemisphere, 2).unwrap())
    }

    fn axes(incoming: Axis, samples: usize) -> Vec<Axis> {
        let mut axes = vec![incoming, mesh()];
        if samples > 1 {
            axes.push(Axis::Rgb);
        }
        axes
    }

    fn lobes(samples: usize) -> Vec<Lobe> {
        let first = LobeParameters {
            centre: LobeCentre::Mirror,
            peak: [5.2, 0.3, -0.1],
            range: [0.0, 1.1],
            widths: [0.017, 0.017],
            angle: 0.0,
            tail: 0.31,
            colours: (0..samples).map(|i| 1.0 + 0.1 * i as f32).collect(),
        };
        let second =
            LobeParameters { centre: LobeCentre::HalfVector, widths: [0.01, 0.02], angle: -0.4, ..first.clone() };
        let third = LobeParameters { centre: LobeCentre::Source, tail: 0.0, ..first.clone() };
        [first, second, third].map(|parameters| Lobe::new(parameters).unwrap()).to_vec()
    }

    #[test]
    fn what_is_written_is_read() {
        for samples in [1, 3] {
            let axes = axes(mesh(), samples);
            for lobe in lobes(samples) {
                assert!(fits(&lobe, Quantity::Brdf, &axes));
                let bytes = write(&lobe);
                assert_eq!(read(&mut Reader::new(&bytes, 0), Quantity::Brdf, &axes), Ok(lobe.clone()));
                for end in 0..bytes.len() {
                    assert!(read(&mut Reader::new(&bytes[..end], 0), Quantity::Brdf, &axes).is_err());
                }
                let longer = [&bytes[..], &[0]].concat();
                assert!(read(&mut Reader::new(&longer, 0), Quantity::Brdf, &axes).is_err());
                assert!(read(&mut Reader::new(&bytes, 0), Quantity::Bsdf, &axes).is_err());
            }
        }
    }

    #[test]
    fn unknown_codes_and_lobes_that_do_not_fit_are_refused() {
        let (axes, lobe) = (axes(Axis::Elevation(vec![0.0, 40.0]), 1), lobes(1).remove(1));
        assert!(!fits(&lobe, Quantity::Brdf, &axes));
        let bytes = write(&lobe);
        assert!(read(&mut Reader::new(&bytes, 0), Quantity::Brdf, &axes).is_err());
        let mut good = write(&lobes(1)[0]);
        assert!(read(&mut Reader::new(&good, 0), Quantity::Brdf, &axes).is_ok());
        for first in [3, 4, 8, 255] {
            good[0] = first;
            assert!(read(&mut Reader::new(&good, 0), Quantity::Brdf, &axes).is_err(), "{first}");
        }
    }
}
