//! Text tables of a given size.

use super::values::{Values, angles};
use std::fmt::Write as _;

const HEADER: &str = "# radiometric-csv: 1\n# quantity: brdf\n# value_unit: 1/sr\n# cosine_included: false\n\
                      # angle_unit: deg\n# wavelength_unit: nm\n";
const LAMBDAS: usize = 81;

/// Returns the grid as `radiometric-csv`. `scattered`: all directions differ; `sigma`: each value has an uncertainty.
pub(crate) fn measurement(wide: bool, scattered: bool, sigma: bool, bytes: usize) -> Vec<u8> {
    let mut text = format!("{HEADER}theta_i,phi_i,theta_o,phi_o");
    for l in 0..if wide { LAMBDAS } else { 0 } {
        let _ = write!(text, ",v{}", 380 + 5 * l);
    }
    for l in 0..if wide && sigma { LAMBDAS } else { 0 } {
        let _ = write!(text, ",s{}", 380 + 5 * l);
    }
    text.push_str(if wide { "\n" } else { ",wavelength,value\n" });
    let mut values = Values(1);
    for place in 0.. {
        if text.len() >= bytes {
            break;
        }
        let [theta_i, phi_i, theta_o, phi_o] = angles(place);
        let theta_o = if scattered { (theta_o + values.next() / 32.0).min(90.0) } else { theta_o };
        let angles = format!("{theta_i},{phi_i},{theta_o:.4},{phi_o}");
        if !wide {
            for l in 0..LAMBDAS {
                let _ = writeln!(text, "{angles},{},{:.4}", 380 + 5 * l, values.next());
            }
            continue;
        }
        text.push_str(&angles);
        for _ in 0..if sigma { 2 * LAMBDAS } else { LAMBDAS } {
            let _ = write!(text, ",{:.4}", values.next());
        }
        text.push('\n');
    }
    text.into_bytes()
}

/// Returns a luminaire with enough planes for the size.
pub(crate) fn luminaire(ldt: bool, bytes: usize) -> Vec<u8> {
    const ANGLES: usize = 721;
    // An EULUMDAT file has at most as many planes.
    let planes = (bytes / (8 * ANGLES)).min(if ldt { ANGLES } else { usize::MAX });
    let mut values = Values(1);
    let step = 360.0 / planes as f64;
    let separator = if ldt { "\n" } else { " " };
    let mut text = if ldt {
        format!(
            "a\n1\n0\n{planes}\n0\n{ANGLES}\n0\nr\nn\n1\nf\nd\n1\n1\n1\n1\n1\n0\n0\n0\n0\n100\n100\n1\n0\n1\n-1\nl\n1000\nc\nr\n9\n{}",
            "0\n".repeat(10)
        )
    } else {
        format!("IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 {ANGLES} {} 1 2 0 0 0 1 1 1\n", planes + 1)
    };
    let gammas: Vec<String> = (0..ANGLES).map(|i| (0.25 * i as f64).to_string()).collect();
    let mut circle: Vec<String> = (0..planes).map(|i| format!("{:.4}", step * i as f64)).collect();
    if ldt {
        let _ = write!(text, "{}\n{}\n", circle.join(separator), gammas.join(separator));
    } else {
        circle.push("360".to_owned());
        let _ = write!(text, "{}\n{}\n", gammas.join(separator), circle.join(separator));
    }
    for _ in 0..if ldt { planes } else { planes + 1 } {
        for _ in 0..ANGLES {
            let _ = write!(text, "{:.4}{separator}", values.next());
        }
    }
    text.into_bytes()
}

/// A table of spectra.
pub(crate) fn spectra(columns: usize, rows: usize, separator: char) -> Vec<u8> {
    let mut values = Values(1);
    let mut text = String::from("nm");
    for i in 0..columns {
        let _ = write!(text, "{separator}patch_{i}");
    }
    for row in 0..rows {
        let _ = write!(text, "\n{:.3}", 380.0 + 0.01 * row as f64);
        for _ in 0..columns {
            let _ = write!(text, "{separator}{:.4}", values.next());
        }
    }
    text.into_bytes()
}

/// Returns a phase function at the largest allowed number of angles, in columns or as one line over the cosine.
pub(crate) fn phase(columns: usize, rows: usize) -> Vec<u8> {
    let mut values = Values(1);
    let mut text = String::new();
    for row in 0..rows {
        if columns > 0 {
            let _ = write!(text, "{:.4}", 180.0 * row as f64 / (rows - 1) as f64);
        }
        for _ in 0..columns.max(1) {
            let _ = write!(text, " {:.4}", values.next());
        }
        if columns > 0 {
            text.push('\n');
        }
    }
    text.into_bytes()
}

/// A spectrum as XML.
pub(crate) fn elements(rows: usize) -> Vec<u8> {
    let mut values = Values(1);
    let mut text = String::from(
        "<?xml version=\"1.0\"?>\n<IESTM2714 xmlns=\"iestm2714\" version=\"1.0\"><Header></Header><SpectralDistribution>\
         <SpectralQuantity>relative</SpectralQuantity>\n",
    );
    for row in 0..rows {
        let wavelength = 200.0 + 0.01 * row as f64;
        let _ = writeln!(text, "<SpectralData wavelength=\"{wavelength:.2}\">{:.4}</SpectralData>", values.next());
    }
    text.push_str("</SpectralDistribution></IESTM2714>\n");
    text.into_bytes()
}
