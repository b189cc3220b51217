//! Conversion of the document's model to lobes: ranges checked, weights tabulated by wavelength.

use super::document::{Alpha, Fresnel, Model};
use super::lobes::{Axes, Interface, Lobe, Shape};
use super::spectra;
use crate::domain::{Direction, Quantity};

/// Upper bound on the number of lobes in a file that describes a material by analytic functions. Raising it accepts
/// larger files.
const MAX_LOBES: usize = 256;
/// Lower bound on the GGX roughness: narrower lobes fall between the sample points of any triangle mesh. Lowering it
/// allows narrower lobes.
const MIN_ALPHA: f64 = 0.001;

/// Returns the lobes of `model` at the wavelengths `lambdas` (nm) for `quantity`, or a message that names the faulty
/// field.
pub(super) fn lobes(model: &Model, quantity: Quantity, lambdas: &[f64]) -> Result<Vec<Lobe>, String> {
    let mut maker = Maker { quantity, lambdas, lobes: Vec::new() };
    maker.add("model", model, &vec![1.0; lambdas.len()])?;
    if maker.lobes.is_empty() {
        return Err("model.sum has no lobes, expected at least one".to_owned());
    }
    if quantity == Quantity::Phase {
        maker.whole()?;
    }
    Ok(maker.lobes)
}

struct Maker<'a> {
    quantity: Quantity,
    lambdas: &'a [f64],
    lobes: Vec<Lobe>,
}

impl Maker<'_> {
    fn add(&mut self, path: &str, model: &Model, weight: &[f64]) -> Result<(), String> {
        if let Model::Sum(terms) = model {
            for (i, term) in terms.iter().enumerate() {
                let path = format!("{path}.sum[{i}]");
                let mut product: Vec<f64> = weight.iter().map(|w| w * term.scale).collect();
                if let Some(shape) = &term.weight {
                    let values = spectrum(&format!("{path}.weight"), shape, self.lambdas, (0.0, f64::MAX))?;
                    product.iter_mut().zip(values).for_each(|(p, v)| *p *= v);
                }
                if term.scale < 0.0 {
                    return Err(format!("{path}.scale is {}, expected 0 or more", term.scale));
                }
                self.add(&path, &term.lobe, &product)?;
            }
            return Ok(());
        }
        if self.lobes.len() == MAX_LOBES {
            return Err(format!("{path}: more than {MAX_LOBES} lobes"));
        }
        let path = format!("{path}.{}", name(model));
        let fits = fits(model);
        if !fits.contains(&self.quantity) {
            let names: Vec<&str> = fits.iter().map(|quantity| quantity.name()).collect();
            return Err(format!(
                "{path} is of quantity {}, expected {} as the document states",
                names.join(" or "),
                self.quantity
            ));
        }
        let mut weight = weight.to_vec();
        if let Some((field, shape, range)) = own_weight(model, self.quantity) {
            let values = spectrum(&format!("{path}{field}"), shape, self.lambdas, range)?;
            weight.iter_mut().zip(values).for_each(|(w, v)| *w *= v);
        }
        let interface = match model {
            Model::Ggx { fresnel, .. } => interface(&format!("{path}.fresnel"), fresnel, self.lambdas)?,
            Model::Fresnel(fresnel) => interface(&path, fresnel, self.lambdas)?,
            _ => None,
        };
        self.lobes.push(Lobe { shape: shape(&path, model)?, weight, interface });
        Ok(())
    }

    /// Refuses a phase function whose lobe weights do not sum to 1 at every wavelength.
    fn whole(&self) -> Result<(), String> {
        for (i, lambda) in self.lambdas.iter().enumerate() {
            let total: f64 = self.lobes.iter().map(|lobe| lobe.weight[i]).sum();
            if (total - 1.0).abs() > 1e-6 {
                return Err(format!(
                    "model: the weights add to {total} at {lambda} nm, expected 1 for a phase function"
                ));
            }
        }
        Ok(())
    }
}

fn name(model: &Model) -> &'static str {
    match model {
        Model::Lambert { .. } => "lambert",
        Model::LambertTransmission { .. } => "lambert_transmission",
        Model::OrenNayar { .. } => "oren_nayar",
        Model::Ggx { .. } => "ggx",
        Model::Asperity { .. } => "asperity",
        Model::Rayleigh => "rayleigh",
        Model::HenyeyGreenstein { .. } => "henyey_greenstein",
        Model::DoubleHenyeyGreenstein { .. } => "double_henyey_greenstein",
        Model::Schlick { .. } => "schlick",
        Model::Hazy => "hazy",
        Model::Murky => "murky",
        Model::CosinePower { .. } => "cosine_power",
        Model::Isotropic => "isotropic",
        Model::Fresnel(_) => "fresnel",
        Model::Spectrum(_) => "spectrum",
        Model::Sum(_) => "sum",
    }
}

/// Returns the radiometric quantities to which a kind of lobe can contribute.
fn fits(model: &Model) -> &'static [Quantity] {
    match model {
        Model::Lambert { .. } | Model::OrenNayar { .. } | Model::Ggx { .. } | Model::Asperity { .. } => {
            &[Quantity::Brdf, Quantity::Bsdf]
        }
        Model::LambertTransmission { .. } => &[Quantity::Btdf, Quantity::Bsdf],
        Model::Rayleigh
        | Model::HenyeyGreenstein { .. }
        | Model::DoubleHenyeyGreenstein { .. }
        | Model::Schlick { .. }
        | Model::Hazy
        | Model::Murky => &[Quantity::Phase],
        Model::CosinePower { .. } | Model::Isotropic => &[Quantity::Edf],
        Model::Fresnel(_) => &[Quantity::Reflectance],
        Model::Spectrum(_) => &[Quantity::Spectrum, Quantity::Reflectance],
        Model::Sum(_) => Quantity::ALL,
    }
}

type Range = (f64, f64);

/// Returns the spectrum that is a parameter of the lobe itself, such as its reflectance, with the name and the allowed
/// range of the parameter.
fn own_weight(model: &Model, quantity: Quantity) -> Option<(&'static str, &spectra::Shape, Range)> {
    match model {
        Model::Lambert { reflectance } | Model::OrenNayar { reflectance, .. } => {
            Some((".reflectance", reflectance, (0.0, 1.0)))
        }
        Model::LambertTransmission { transmittance } => Some((".transmittance", transmittance, (0.0, 1.0))),
        Model::Asperity { albedo, .. } => Some((".albedo", albedo, (0.0, 1.0))),
        Model::Spectrum(shape) if quantity == Quantity::Reflectance => Some(("", shape, (0.0, 1.0))),
        Model::Spectrum(shape) => Some(("", shape, (0.0, f64::MAX))),
        _ => None,
    }
}

fn shape(path: &str, model: &Model) -> Result<Shape, String> {
    let number = |field: &str, value: f64, low: f64, high: f64| within(&format!("{path}.{field}"), value, low, high);
    let g = |field: &str, value: f64| {
        if value.abs() < 1.0 { Ok(value) } else { Err(format!("{path}.{field} is {value}, expected between -1 and 1")) }
    };
    Ok(match model {
        Model::Lambert { .. } => Shape::Lambert,
        Model::LambertTransmission { .. } => Shape::LambertTransmission,
        Model::OrenNayar { sigma, .. } => {
            let s2 = number("sigma", *sigma, 0.0, 1.0)? * sigma;
            Shape::OrenNayar { a: 1.0 - 0.5 * s2 / (s2 + 0.33), b: 0.45 * s2 / (s2 + 0.09) }
        }
        Model::Ggx { alpha, frame, .. } => {
            let (along, across) = match *alpha {
                Alpha::Isotropic(alpha) => (alpha, alpha),
                Alpha::Anisotropic(along, across) => (along, across),
            };
            let turn = number("frame.turn", frame.turn, -360.0, 360.0)?;
            let tilt = number("frame.tilt", frame.tilt, 0.0, 45.0)?;
            let toward = number("frame.toward", frame.toward, -360.0, 360.0)?;
            Shape::Ggx {
                along: number("alpha", along, MIN_ALPHA, 1.0)?,
                across: number("alpha", across, MIN_ALPHA, 1.0)?,
                frame: Axes::new(turn, tilt, toward),
            }
        }
        &Model::Asperity { depth, back, g_back, g_forward, .. } => Shape::Asperity {
            depth: number("depth", depth, 0.0, 100.0)?,
            back: number("back", back, 0.0, 1.0)?,
            g_back: g("g_back", g_back)?,
            g_forward: g("g_forward", g_forward)?,
        },
        Model::Rayleigh => Shape::Rayleigh,
        &Model::HenyeyGreenstein { g: g1 } => Shape::HenyeyGreenstein { weight: 1.0, g1: g("g", g1)?, g2: 0.0 },
        &Model::DoubleHenyeyGreenstein { weight, g1, g2 } => {
            Shape::HenyeyGreenstein { weight: number("weight", weight, 0.0, 1.0)?, g1: g("g1", g1)?, g2: g("g2", g2)? }
        }
        &Model::Schlick { r, k1, k2 } => {
            Shape::Schlick { r: number("r", r, 0.0, 1.0)?, k1: g("k1", k1)?, k2: g("k2", k2)? }
        }
        Model::Hazy => Shape::Schlick { r: 0.12, k1: -0.50, k2: 0.70 },
        Model::Murky => Shape::Schlick { r: 0.19, k1: -0.65, k2: 0.91 },
        &Model::CosinePower { theta, phi, exponent } => {
            let theta = number("theta", theta, 0.0, 180.0)?;
            let phi = number("phi", phi, -360.0, 720.0)?;
            Shape::CosinePower {
                axis: Direction::from_degrees(theta, phi).xyz(),
                exponent: number("exponent", exponent, 0.0, 10_000.0)?,
            }
        }
        Model::Isotropic | Model::Fresnel(_) | Model::Spectrum(_) | Model::Sum(_) => Shape::Constant,
    })
}

fn interface(path: &str, fresnel: &Fresnel, lambdas: &[f64]) -> Result<Option<Interface>, String> {
    let micrometres = || lambdas.iter().map(|lambda| lambda / 1000.0);
    let index = |n: Vec<f64>| match n.iter().zip(lambdas).find(|(n, _)| !(**n > 1.0 && **n <= 10.0)) {
        None => Ok(Some(Interface::Dielectric(n))),
        Some((n, lambda)) => {
            Err(format!("{path}: the index is {n} at {lambda} nm, expected more than 1 and at most 10"))
        }
    };
    match fresnel {
        &Fresnel::Cauchy { a, b, c } => index(micrometres().map(|l| a + (b + c / (l * l)) / (l * l)).collect()),
        Fresnel::Sellmeier { b, c } => {
            if b.len() != c.len() || b.len() > 8 {
                return Err(format!(
                    "{path}.sellmeier: {} numbers in b and {} in c, expected as many in both, at most 8",
                    b.len(),
                    c.len()
                ));
            }
            let square = |l: f64| b.iter().zip(c).fold(1.0, |sum, (b, c)| sum + b * l * l / (l * l - c));
            index(micrometres().map(|l| square(l).sqrt()).collect())
        }
        Fresnel::Conductor { n, k } => {
            let n = spectrum(&format!("{path}.conductor.n"), n, lambdas, (1e-3, 20.0))?;
            let k = spectrum(&format!("{path}.conductor.k"), k, lambdas, (0.0, 20.0))?;
            Ok(Some(Interface::Conductor(n.into_iter().zip(k).collect())))
        }
        Fresnel::Schlick { normal } => {
            let normal = spectrum(&format!("{path}.schlick.normal"), normal, lambdas, (0.0, 1.0))?;
            Ok(Some(Interface::Schlick(normal)))
        }
        Fresnel::Mirror => Ok(None),
    }
}

fn spectrum(path: &str, shape: &spectra::Shape, lambdas: &[f64], (low, high): Range) -> Result<Vec<f64>, String> {
    let values = shape.at(lambdas).map_err(|e| format!("{path}: {e}"))?;
    match values.iter().zip(lambdas).find(|(value, _)| !(low..=high).contains(*value)) {
        None => Ok(values),
        Some((value, lambda)) if high == f64::MAX => {
            Err(format!("{path} is {value} at {lambda} nm, expected {low} or more"))
        }
        Some((value, lambda)) => Err(format!("{path} is {value} at {lambda} nm, expected {low} to {high}")),
    }
}

fn within(path: &str, value: f64, low: f64, high: f64) -> Result<f64, String> {
    if (low..=high).contains(&value) { Ok(value) } else { Err(format!("{path} is {value}, expected {low} to {high}")) }
}
