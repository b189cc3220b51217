//! Virtual measurements: analytic models on any axes, with seeded noise, described by a small JSON document.
//!
//! ```json
//! {"wavelume": "virtual", "quantity": "brdf",
//!  "model": {"sum": [{"lobe": {"lambert": {"reflectance": "red"}}},
//!                    {"lobe": {"ggx": {"alpha": {"isotropic": 0.15},
//!                                      "fresnel": {"cauchy": {"a": 1.46, "b": 0.0085}}}}}]},
//!  "axes": ["hemi:1", "hemi:4", "lambda:380:5:75"], "sampling": "average",
//!  "noise": {"relative": 0.003, "seed": 1}}
//! ```
//!
//! Axes of angles (`theta_i`, `phi_i`, `theta_o`, `phi_o`) make a virtual goniometer, whose samples are projected like
//! those of a real one.

mod document;
mod lobes;
mod model;
mod noise;
mod sampling;
mod spectra;
#[cfg(test)]
mod tests;

use super::acquisition::{Acquisition, ParseReport, Samples};
use super::error::{FormatError, FormatErrorKind, Position};
use super::interpretation::Interpretation;
use super::manifest;
use super::reader::{Format, Reader, Sample};
use crate::domain::limits::{MAX_SAMPLES, MAX_WAVELENGTHS};
use crate::domain::{Axis, Domain, Layout, Quantity, Sampling, Tensor};
use crate::notes::ScatteringNote;
use document::{Document, Noise};
use lobes::Lobe;
use sampling::Entries;
use serde_json::{Value, json};

const NAME: &str = "virtual";

pub(super) const READER: Reader = Reader {
    about: Format {
        name: NAME,
        description: "virtual measurement: a JSON document that names a model, axes and noise",
        extensions: &["json"],
        reads: true,
        writes: false,
    },
    options: &["axes"],
    probe: |sample: &Sample<'_>| {
        let text = sample.head.trim_start();
        if text.starts_with('{') && text.contains("\"wavelume\"") && text.contains("\"virtual\"") { 95 } else { 0 }
    },
    read,
};

/// Upper bound on the size, in bytes, of the JSON document that describes a measurement to be computed from a model.
/// Raising it accepts larger tables of spectra.
const MAX_BYTES: usize = 1 << 24;
/// Upper bound on the evaluations of a model: direction pairs times wavelengths, where a lobe without a Fresnel term
/// counts one wavelength. Raising it allows finer axes and longer computations.
const MAX_EVALUATIONS: usize = 1 << 31;
/// Default wavelength in nm at which a model without a wavelength axis is evaluated.
const WAVELENGTH: f64 = 550.0;

fn read(bytes: &[u8], how: &Interpretation) -> Result<Acquisition, FormatError> {
    if bytes.len() > MAX_BYTES {
        return Err(refuse(
            FormatErrorKind::OverLimit,
            format!("a document of {} bytes, expected at most {MAX_BYTES}", bytes.len()),
        ));
    }
    let document: Document = serde_json::from_slice(bytes).map_err(|e| FormatError {
        position: Some(Position::Text { line: e.line(), column: e.column() }),
        ..malformed(format!("{}, expected the JSON of a virtual measurement", plain(&e)))
    })?;
    if document.wavelume != "virtual" {
        return Err(malformed("`wavelume` must be \"virtual\" in a virtual measurement"));
    }
    if let Some(noise) = document.noise {
        check(noise)?;
    }
    let mut acquisition = empty(&document, how)?;
    fill(&mut acquisition, &document)?;
    Ok(acquisition)
}

fn refuse(kind: FormatErrorKind, message: impl Into<String>) -> FormatError {
    FormatError::new(kind, NAME, message)
}

fn malformed(message: impl Into<String>) -> FormatError {
    refuse(FormatErrorKind::Malformed, message)
}

/// Returns the JSON parser's message without the position at its end.
fn plain(error: &serde_json::Error) -> String {
    let text = error.to_string();
    text.rsplit_once(" at line ").map_or(text.clone(), |(message, _)| message.to_owned())
}

fn check(noise: Noise) -> Result<(), FormatError> {
    if !(0.0..=1.0).contains(&noise.relative) {
        return Err(malformed(format!("noise.relative is {}, expected 0 to 1", noise.relative)));
    }
    if !(noise.absolute >= 0.0 && noise.absolute.is_finite()) {
        return Err(malformed(format!("noise.absolute is {}, expected 0 or more", noise.absolute)));
    }
    Ok(())
}

/// Creates a measurement whose samples will be computed from a model: all its axes, with 0 for every sample so far.
fn empty(document: &Document, how: &Interpretation) -> Result<Acquisition, FormatError> {
    let ours = |e: FormatError| FormatError { format: NAME, ..e };
    let mut described = json!({"axes": document.axes});
    if let Some(axes) = &how.axes {
        described = match axes {
            Value::Array(_) => json!({"axes": axes}),
            other => other.clone(),
        };
    }
    if let Value::Object(fields) = &mut described {
        let mut say = |key: &str, value: Value| {
            fields.entry(key).or_insert(value);
        };
        if let Some(quantity) = document.quantity {
            say("quantity", json!(quantity));
        }
        if let Some(unit) = document.unit {
            say("value_unit", json!(unit));
        }
        say("sampling", json!(document.sampling.unwrap_or_default()));
        say("cosine_included", json!(false));
        if fields["cosine_included"] != json!(false) {
            let message = "axes: cosine_included, expected false: the values of a model do not hold |cos theta_o|";
            return Err(refuse(FormatErrorKind::NeedsOption, message));
        }
    }
    let shape = manifest::shape(&described, how).map_err(ours)?;
    let samples = shape.iter().try_fold(1_usize, |product, &n| product.checked_mul(n));
    let Some(samples) = samples.filter(|&n| n <= MAX_SAMPLES) else {
        let message = format!("axes of lengths {shape:?} make more than the limit of {MAX_SAMPLES} samples");
        return Err(refuse(FormatErrorKind::OverLimit, message));
    };
    let mut report = ParseReport::default();
    for (key, text) in [("name", &document.name), ("description", &document.description)] {
        if let Some(text) = text {
            report.metadata.push((key.to_owned(), text.clone()));
        }
    }
    let mut acquisition = manifest::interpret(&described, &shape, vec![0.0; samples], how, report).map_err(ours)?;
    acquisition.format = NAME;
    "virtual measurement".clone_into(&mut acquisition.dialect);
    Ok(acquisition)
}

/// Directions and wavelengths at which an analytic scattering or emission model is evaluated to make the samples of a
/// virtual measurement.
struct Axes {
    incoming: Option<Entries>,
    outgoing: Option<Entries>,
    spectral: Option<Axis>,
}

fn fill(acquisition: &mut Acquisition, document: &Document) -> Result<(), FormatError> {
    let axes = axes_of(acquisition)?;
    let lambdas = match &axes.spectral {
        Some(Axis::Wavelength(grid)) => grid.values(),
        Some(other) => {
            return Err(malformed(format!("axes: {}, expected wavelengths (a model is spectral)", other.describe())));
        }
        None => {
            let lambda = document.wavelength.unwrap_or(WAVELENGTH);
            if !(lambda > 0.0 && lambda.is_finite()) {
                return Err(malformed(format!("wavelength is {lambda}, expected a positive number of nm")));
            }
            if document.wavelength.is_none() {
                acquisition.report.note(ScatteringNote::WavelengthNotStated { wavelength_nm: lambda });
            }
            vec![lambda]
        }
    };
    debug_assert!(lambdas.len() <= MAX_WAVELENGTHS, "the grid keeps its own limit");
    if axes.spectral.is_some() && document.wavelength.is_some() {
        return Err(malformed("`wavelength` beside an axis of wavelengths, expected one of them"));
    }
    let lobes = model::lobes(&document.model, acquisition.quantity, &lambdas).map_err(malformed)?;
    let (incoming, outgoing) =
        (axes.incoming.unwrap_or_else(Entries::none), axes.outgoing.unwrap_or_else(Entries::none));
    bound(&lobes, &incoming, &outgoing, lambdas.len())?;
    let mut values = sampling::evaluate(&lobes, &incoming, &outgoing, lambdas.len());
    if acquisition.quantity == Quantity::Brdf && matches!(acquisition.samples, Samples::OnAxes { .. }) {
        note_energy(&lobes, &lambdas, &mut acquisition.report);
    }
    if let Some(noise) = document.noise {
        noise::disturb(&mut values, noise);
    }
    if let Some(at) = values.iter().position(|value| !value.is_finite()) {
        return Err(malformed(format!("model: sample {at} is {}, expected a finite number", values[at])));
    }
    if incoming.points() * outgoing.points() > 1 {
        acquisition.report.note(ScatteringNote::CellsAveraged {
            incoming_points: incoming.points(),
            outgoing_points: outgoing.points(),
        });
    }
    match &mut acquisition.samples {
        Samples::OnAxes { tensor, .. } => {
            *tensor = Tensor::new(tensor.axes().to_vec(), values).map_err(|e| malformed(e.to_string()))?;
        }
        Samples::Grid(grid) => {
            grid.values = values.into();
            grid.stated = None;
        }
        Samples::Scattered(scattered) => scattered.values = values,
        Samples::Function(_) => {}
    }
    Ok(())
}

fn axes_of(acquisition: &Acquisition) -> Result<Axes, FormatError> {
    let no_index = || malformed("axes: an index has no meaning for a model, expected directions and wavelengths");
    match &acquisition.samples {
        Samples::OnAxes { tensor, sampling } => {
            let axes = tensor.axes();
            let layout = Layout::of(acquisition.quantity, axes).map_err(|e| malformed(e.to_string()))?;
            if layout.indices > 0 {
                return Err(no_index());
            }
            let average = *sampling == Sampling::Average;
            let side = |i: Option<usize>| i.and_then(|i| sampling::entries(&axes[i], average));
            check_domains(acquisition.quantity, layout.outgoing.map(|i| &axes[i]))?;
            Ok(Axes {
                incoming: side(layout.incoming),
                outgoing: side(layout.outgoing),
                spectral: layout.spectral.map(|i| axes[i].clone()),
            })
        }
        Samples::Grid(grid) => {
            if !grid.index.is_empty() {
                return Err(no_index());
            }
            if grid.outgoing.as_ref().is_some_and(|angles| angles.phi.is_none()) {
                return Err(malformed("axes: theta_o without phi_o, expected both"));
            }
            Ok(Axes {
                incoming: grid.incoming.as_ref().map(Entries::angles),
                outgoing: grid.outgoing.as_ref().map(Entries::angles),
                spectral: grid.spectral.clone(),
            })
        }
        Samples::Scattered(_) => {
            Err(malformed("axes: a list of scattered directions, expected axes of directions or of angles"))
        }
        Samples::Function(_) => Err(malformed("axes: a function has none, expected directions and wavelengths")),
    }
}

/// Refuses axes with outgoing directions below the surface for a BRDF, or above it for a BTDF. There the formulas of an
/// analytic material yield zeros, which would look like data.
fn check_domains(quantity: Quantity, outgoing: Option<&Axis>) -> Result<(), FormatError> {
    let expected = match quantity {
        Quantity::Brdf => Domain::Hemisphere,
        Quantity::Btdf => Domain::Lower,
        _ => return Ok(()),
    };
    match outgoing {
        Some(Axis::Triangles(mesh)) if mesh.domain() != expected => Err(malformed(format!(
            "axes: the outgoing directions of a {quantity} on the {}, expected the {expected}",
            mesh.domain()
        ))),
        _ => Ok(()),
    }
}

fn bound(lobes: &[Lobe], incoming: &Entries, outgoing: &Entries, lambdas: usize) -> Result<(), FormatError> {
    let each: usize = lobes.iter().map(|lobe| if lobe.interface.is_some() { lambdas } else { 1 }).sum();
    let pairs = incoming.len() * outgoing.len();
    let evaluations = (pairs * incoming.points()).checked_mul(outgoing.points()).and_then(|n| n.checked_mul(each));
    if evaluations.is_none_or(|n| n > MAX_EVALUATIONS) {
        let message =
            "the axes ask for too many evaluations of the model, expected fewer entries, or \"sampling\": \"point\"";
        return Err(refuse(FormatErrorKind::OverLimit, message));
    }
    Ok(())
}

/// Adds a note if the model has a directional albedo above 1. An unphysical model is allowed, but its author should
/// know.
fn note_energy(lobes: &[Lobe], lambdas: &[f64], report: &mut ParseReport) {
    const THETAS: [f64; 4] = [0.0, 30.0, 60.0, 80.0];
    let worst = THETAS.map(|theta| {
        let albedo = albedo(lobes, theta, lambdas.len());
        albedo.into_iter().zip(lambdas).fold((0.0, 0.0), |worst, (a, &l)| if a > worst.0 { (a, l) } else { worst })
    });
    for ((albedo, lambda), theta) in worst.into_iter().zip(THETAS) {
        if albedo > 1.02 {
            report.note(ScatteringNote::MoreLightThanArrives { albedo, theta_degrees: theta, wavelength_nm: lambda });
            return;
        }
    }
}

/// Returns the directional albedo of the lobes for light from polar angle `theta` in degrees, one number per
/// wavelength, by quadrature over a fine hemisphere.
fn albedo(lobes: &[Lobe], theta: f64, lambdas: usize) -> Vec<f64> {
    let mut total = vec![0.0; lambdas];
    let Some(mesh) = crate::domain::TriangleMesh::new(Domain::Hemisphere, 5) else { return total };
    let values = sampling::evaluate(lobes, &Entries::elevations(&[theta]), &Entries::centroids(mesh), lambdas);
    for (i, row) in values.chunks(lambdas).enumerate() {
        let weight = mesh.projected_solid_angle(i);
        total.iter_mut().zip(row).for_each(|(sum, &value)| *sum += weight * f64::from(value));
    }
    total
}
