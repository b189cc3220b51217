//! Every format written of a material that it holds, read back, and refused of one that it does not.

use super::{ExportError, ExportFormat, ExportOptions, Exported, OptionError, UnfitError, array, export, fitting};
use crate::domain::{
    Axis, Direction, Domain, Measurement, Quantity, Sampling, Tensor, TriangleMesh, Unit, WavelengthGrid,
};
use crate::evaluate::Material;
use crate::formats::{self, Interpretation, Samples};

/// Returns a material and the tensor that it was made from. Samples are `value(wi, wo, λ)` at the centroids of
/// triangles; directions of absent axes are the surface normal.
fn material(
    quantity: Quantity,
    unit: Unit,
    axes: Vec<Axis>,
    value: impl Fn(Direction, Direction, f64) -> f64,
) -> (Material, Measurement) {
    let directions = |axis: Option<&Axis>| -> Vec<Direction> {
        match axis {
            Some(Axis::Triangles(mesh)) => (0..mesh.len()).map(|i| mesh.centroid(i)).collect(),
            Some(Axis::Elevation(theta)) => theta.iter().map(|&theta| Direction::from_degrees(theta, 0.0)).collect(),
            _ => vec![Direction::from_degrees(0.0, 0.0)],
        }
    };
    let layout = crate::domain::Layout::of(quantity, &axes).unwrap();
    let incoming = directions(layout.incoming.map(|axis| &axes[axis]));
    let outgoing = directions(layout.outgoing.map(|axis| &axes[axis]));
    let lambdas = match axes.last() {
        Some(Axis::Wavelength(grid)) => grid.values(),
        Some(Axis::Rgb) => vec![0.0, 1.0, 2.0],
        _ => vec![550.0],
    };
    let mut samples = Vec::new();
    for &wi in &incoming {
        for &wo in &outgoing {
            samples.extend(lambdas.iter().map(|&lambda| value(wi, wo, lambda) as f32));
        }
    }
    let tensor = Tensor::new(axes, samples).unwrap();
    let measurement = Measurement::new(quantity, unit, Sampling::Point, tensor).unwrap();
    (Material::of(measurement.clone()).unwrap(), measurement)
}

fn mesh(domain: Domain, level: u8) -> Axis {
    Axis::Triangles(TriangleMesh::new(domain, level).unwrap())
}

fn visible() -> Axis {
    Axis::Wavelength(WavelengthGrid::even(400.0, 20.0, 16).unwrap())
}

fn elevations() -> Axis {
    Axis::Elevation((0..=8).map(|i| 10.0 * f64::from(i)).collect())
}

/// BRDF of a rough lobe on a diffuse base, whose values rise linearly with the wavelength.
fn rough(wi: Direction, wo: Direction, lambda: f64) -> f64 {
    let [x, y, z] =
        [0, 1, 2].map(|k| wi.xyz()[k] + wo.xyz()[k].abs() * if k == 2 { 1.0 } else { wo.xyz()[k].signum() });
    let lobe = libm::exp(-3.0 * (x * x + y * y) / (z * z));
    let side = if wo.cos_theta() < 0.0 { 0.5 } else { 1.0 };
    side * (0.1 + 0.2 * lobe) * (0.5 + (lambda - 400.0) / 600.0)
}

fn isotropic(quantity: Quantity, domain: Domain) -> Material {
    material(quantity, Unit::PerSteradian, vec![elevations(), mesh(domain, 3), visible()], rough).0
}

fn anisotropic() -> Material {
    let axes = vec![mesh(Domain::Hemisphere, 1), mesh(Domain::Hemisphere, 2), visible()];
    material(Quantity::Brdf, Unit::PerSteradian, axes, rough).0
}

fn lamp(unit: Unit, spectral: Option<Axis>) -> Material {
    let axes = [Some(mesh(Domain::Sphere, 3)), spectral].into_iter().flatten().collect();
    let intensity = |_: Direction, wo: Direction, lambda: f64| {
        let [x, _, z] = wo.xyz();
        (1.2 - z + 0.3 * x) * (1.0 + (lambda - 550.0) / 1000.0)
    };
    material(Quantity::Edf, unit, axes, intensity).0
}

fn scattering(spectral: Option<Axis>) -> Material {
    let axes = [Some(mesh(Domain::Sphere, 1)), Some(mesh(Domain::Sphere, 3)), spectral].into_iter().flatten().collect();
    let rayleigh = |wi: Direction, wo: Direction, lambda: f64| {
        let mu = -wi.dot(wo);
        3.0 / (16.0 * std::f64::consts::PI) * (1.0 + mu * mu + 0.4 * mu * lambda / 550.0)
    };
    material(Quantity::Phase, Unit::PerSteradian, axes, rayleigh).0
}

fn table() -> Material {
    let names = vec!["dark".to_owned(), "light".to_owned()];
    let index = Axis::Index { count: 2, labels: names };
    let samples = (0..32).map(|i| if i == 3 { f32::NAN } else { 0.1 + i as f32 / 64.0 }).collect();
    let tensor = Tensor::new(vec![index, visible()], samples).unwrap();
    Material::of(Measurement::new(Quantity::Reflectance, Unit::One, Sampling::Average, tensor).unwrap()).unwrap()
}

fn defaults() -> ExportOptions {
    ExportOptions::default()
}

fn written(material: &Material, format: ExportFormat, options: &ExportOptions) -> Exported {
    let exported = export(material, format, options).unwrap();
    assert_eq!(exported.about.format, format.name());
    assert!(
        exported.about.error.scored_samples > 0 && exported.about.error.mask_mismatches == 0,
        "{:?}",
        exported.about
    );
    exported
}

fn kind(result: Result<Exported, ExportError>) -> ExportError {
    result.unwrap_err()
}

#[test]
fn rgl_files_hold_the_spectra_or_their_colours() {
    let surface = isotropic(Quantity::Brdf, Domain::Hemisphere);
    let spectral = written(&surface, ExportFormat::Rgl, &defaults());
    assert!(spectral.about.lost.is_empty() && spectral.about.error.compared == "the spectrum");
    assert!(spectral.about.error.er_l1 < 0.01, "{:?}", spectral.about);
    let Samples::Function(modelled) = formats::read(&spectral.bytes, &Interpretation::default()).unwrap().samples
    else {
        panic!("a function")
    };
    assert_eq!(modelled.spectral.as_ref().map(Axis::len), Some(16));
    let rgb = written(&surface, ExportFormat::Rgl, &ExportOptions { rgb: true, ..defaults() });
    assert!(rgb.about.lost[0].starts_with("the spectrum") && rgb.about.error.compared.contains("D65"));
    // Fewer nodes are a larger error, which is found.
    let coarse = written(&surface, ExportFormat::Rgl, &ExportOptions { side: Some(6), step: Some(30.0), ..defaults() });
    assert!(coarse.about.error.er_l1 > 2.0 * spectral.about.error.er_l1, "{:?}", coarse.about);
    assert_eq!(
        coarse.bytes,
        written(&surface, ExportFormat::Rgl, &ExportOptions { side: Some(6), step: Some(30.0), ..defaults() }).bytes
    );
    let options = ExportOptions { side: Some(16), step: Some(22.5), ..defaults() };
    let grooved = written(&anisotropic(), ExportFormat::Rgl, &options);
    assert!(grooved.about.resolution.starts_with("17 × 5 incident directions, 16 × 16"), "{:?}", grooved.about);
    assert!(grooved.about.error.er_l1 < 0.1, "{:?}", grooved.about);
}

#[test]
fn merl_and_mbsdf_hold_the_colours_of_isotropic_surfaces() {
    let surface = isotropic(Quantity::Brdf, Domain::Hemisphere);
    let merl = written(&surface, ExportFormat::Merl, &defaults());
    assert_eq!(merl.bytes.len(), 34_992_012);
    assert!(merl.about.error.er_l2 < 0.03 && merl.about.lost.len() == 1, "{:?}", merl.about);
    let bands = Axis::Wavelength(WavelengthGrid::even(450.0, 100.0, 3).unwrap());
    let axes = vec![elevations(), mesh(Domain::Hemisphere, 2), bands];
    let (banded, _) = material(Quantity::Brdf, Unit::PerSteradian, axes, rough);
    let lost = written(&banded, ExportFormat::Mbsdf, &ExportOptions { side: Some(24), ..defaults() }).about.lost;
    assert_eq!(
        lost[1],
        "colours are estimated from the 3 wavelengths from 450 to 650 nm; exact ones need 400 to 700 nm in steps of at most 20 nm"
    );
    let sides = [
        (Quantity::Brdf, Domain::Hemisphere, "reflection, "),
        (Quantity::Btdf, Domain::Lower, "transmission, "),
        (Quantity::Bsdf, Domain::Sphere, "reflection and transmission, "),
    ];
    for (quantity, domain, side) in sides {
        let made = written(&isotropic(quantity, domain), ExportFormat::Mbsdf, &defaults());
        assert!(made.about.resolution.starts_with(side), "{:?}", made.about);
        assert!(made.about.error.er_l2 < 0.02, "{quantity}: {:?}", made.about);
        let read = formats::read(&made.bytes, &Interpretation::default()).unwrap();
        assert_eq!((read.quantity, read.format), (quantity, "mbsdf"));
    }
    let axes = vec![elevations(), mesh(Domain::Hemisphere, 2)];
    let (grey, _) = material(Quantity::Brdf, Unit::PerSteradian, axes, rough);
    let scalar = written(&grey, ExportFormat::Mbsdf, &ExportOptions { side: Some(24), ..defaults() });
    assert!(scalar.about.lost.is_empty());
    assert!(formats::read(&scalar.bytes, &Interpretation::default()).unwrap().dialect.contains("scalar 24 × 24 × 49"));
}

#[test]
fn luminaires_keep_their_flux_and_say_their_unit() {
    let seen = lamp(Unit::WattPerSteradianNanometre, Some(visible()));
    for format in [ExportFormat::Lm63, ExportFormat::Eulumdat] {
        let made = written(&seen, format, &defaults());
        assert_eq!((made.about.unit.as_str(), made.about.lost.len()), ("cd", 1));
        assert!(made.about.flux_error.unwrap().abs() < 0.005 && made.about.error.er_l2 < 0.01, "{:?}", made.about);
        assert_eq!(formats::read(&made.bytes, &Interpretation::default()).unwrap().unit, Unit::Candela);
    }
    let ultraviolet = Axis::Wavelength(WavelengthGrid::even(200.0, 5.0, 17).unwrap());
    let hidden = lamp(Unit::MilliwattPerSteradianNanometre, Some(ultraviolet));
    let made = written(&hidden, ExportFormat::Lm63, &ExportOptions { step: Some(10.0), ..defaults() });
    assert_eq!((made.about.unit.as_str(), made.about.resolution.as_str()), ("mW/sr", "36 C planes of 19 gamma angles"));
    assert_eq!(formats::read(&made.bytes, &Interpretation::default()).unwrap().unit, Unit::MilliwattPerSteradian);
    assert!(matches!(kind(export(&hidden, ExportFormat::Eulumdat, &defaults())), ExportError::Unfit(_)));
    for unit in [Unit::Candela, Unit::CandelaPerKilolumen] {
        let made = written(&lamp(unit, None), ExportFormat::Eulumdat, &defaults());
        assert!(made.about.error.er_l2 < 0.01 || unit == Unit::CandelaPerKilolumen, "{:?}", made.about);
    }
}

#[test]
fn spectra_are_written_to_the_bit() {
    let colours = table();
    let csv = written(&colours, ExportFormat::Csv, &defaults());
    assert!(
        csv.bytes.starts_with(b"wavelength_nm,dark,light\n400,0.1,0.35\n"),
        "{}",
        String::from_utf8_lossy(&csv.bytes)
    );
    assert_eq!((csv.about.error.er_l2, csv.about.error.pairs), (0.0, 32));
    let one = ExportOptions { index: Some(vec![0]), ..defaults() };
    let spd = written(&colours, ExportFormat::Spd, &one);
    assert_eq!((spd.about.error.er_l2, spd.about.error.pairs, spd.about.lost.len()), (0.0, 15, 2));
    let missing = kind(export(&colours, ExportFormat::Spd, &defaults()));
    assert_eq!(missing, OptionError::MissingIndex { shape: vec![2], format: "spd" }.into());
    assert_eq!(
        missing.to_string(),
        "the material has 2 numbered entries (such as spectra or specimens), but spd holds one: choose it with the option \
         `index`"
    );
    let beyond = ExportOptions { index: Some(vec![2]), ..defaults() };
    assert!(matches!(kind(export(&colours, ExportFormat::Spd, &beyond)), ExportError::Evaluate(_)));
}

#[test]
fn phase_functions_are_tables_with_forward_last() {
    let made = written(&scattering(None), ExportFormat::Tabphase, &defaults());
    let values: Vec<f64> =
        String::from_utf8(made.bytes).unwrap().trim().split(", ").map(|value| value.parse().unwrap()).collect();
    // Rayleigh and 0.4 μ: forward 2.4, backward 1.6.
    assert_eq!(values.len(), 513);
    let [backward, forward] = [values[0], values[512]].map(|value| value / values[256]);
    assert!((forward - 2.4).abs() < 0.1 && (backward - 1.6).abs() < 0.1, "{forward} {backward}");
    assert!(made.about.error.relative_rmse < 0.05, "{:?}", made.about.error);
    let spectral = scattering(Some(visible()));
    let at = |wavelength| export(&spectral, ExportFormat::Tabphase, &ExportOptions { wavelength, ..defaults() });
    assert!(at(Some(600.0)).unwrap().about.lost[1].contains("600 nm of 16"));
    assert!(at(None).unwrap().about.lost[1].contains("the mean"));
    assert!(matches!(kind(at(Some(300.0))), ExportError::Setting(OptionError::Wavelength { found: 300.0, .. })));
}

#[test]
fn arrays_are_the_samples() {
    let axes = vec![elevations(), mesh(Domain::Hemisphere, 2)];
    let (opened, measurement) = material(Quantity::Brdf, Unit::PerSteradian, axes, rough);
    let made = array(&measurement, &defaults()).unwrap();
    assert_eq!((made.about.error.er_l2, made.about.resolution.as_str()), (0.0, "9 × 64 samples"));
    let small = ExportOptions { most_bytes: 100, ..defaults() };
    assert!(matches!(kind(array(&measurement, &small)), ExportError::OverLimit { most: 100, .. }));
    let entry = |index: &[usize]| ExportOptions { index: Some(index.to_vec()), ..defaults() };
    let error = kind(array(&measurement, &entry(&[99])));
    assert!(matches!(&error, ExportError::Evaluate(_)) && error.to_string().contains("expected 0"), "{error}");
    assert!(matches!(kind(array(&measurement, &entry(&[]))), ExportError::Setting(_)));
    let dense = ExportOptions { side: Some(8), ..defaults() };
    assert!(matches!(kind(array(&measurement, &dense)), ExportError::Setting(_)));
    assert!(matches!(kind(export(&opened, ExportFormat::Npy, &defaults())), ExportError::Setting(_)));
}

#[test]
fn a_format_that_does_not_fit_names_those_that_do() {
    use ExportFormat::{Csv, Eulumdat, Lm63, Mbsdf, Merl, Npy, Rgl, Spd, Tabphase};
    let cases = [
        (isotropic(Quantity::Brdf, Domain::Hemisphere), &[Rgl, Merl, Mbsdf, Npy][..]),
        (anisotropic(), &[Rgl, Npy]),
        (isotropic(Quantity::Btdf, Domain::Lower), &[Mbsdf, Npy]),
        (isotropic(Quantity::Bsdf, Domain::Sphere), &[Mbsdf, Npy]),
        (lamp(Unit::WattPerSteradianNanometre, Some(visible())), &[Lm63, Eulumdat, Npy]),
        (lamp(Unit::MilliwattPerSteradian, None), &[Lm63, Npy]),
        (table(), &[Spd, Csv, Npy]),
        (scattering(None), &[Tabphase, Npy]),
    ];
    for (material, formats) in &cases {
        let fits = fitting(material);
        let known = [Csv, Eulumdat, Lm63, Mbsdf, Merl, Npy, Rgl, Spd, Tabphase];
        assert!(known.iter().all(|format| fits.contains(format) == formats.contains(format)), "{fits:?}");
        for &format in ExportFormat::ALL.iter().filter(|format| !fits.contains(format)) {
            let error = kind(export(material, format, &defaults()));
            let ExportError::Unfit(UnfitError::Material { fitting, .. }) = error else { panic!("{format}: {error}") };
            assert!(fitting.into_iter().eq(fits.iter().map(|format| format.name())));
        }
    }
    let message = kind(export(&anisotropic(), Merl, &defaults())).to_string();
    assert_eq!(
        message,
        "merl holds an isotropic brdf with a colour (400 to 700 nm), but the material is an anisotropic brdf with \
         wavelengths in 1/sr: it can be written as rgl or npy"
    );
}

#[test]
fn options_that_do_nothing_or_do_not_fit_are_refused() {
    let (surface, light) = (isotropic(Quantity::Brdf, Domain::Hemisphere), lamp(Unit::Candela, None));
    for (material, format, options) in [
        (&surface, ExportFormat::Merl, ExportOptions { side: Some(32), ..defaults() }),
        (&surface, ExportFormat::Mbsdf, ExportOptions { step: Some(1.0), ..defaults() }),
        (&surface, ExportFormat::Merl, ExportOptions { rgb: true, ..defaults() }),
        (&surface, ExportFormat::Rgl, ExportOptions { wavelength: Some(550.0), ..defaults() }),
        (&surface, ExportFormat::Rgl, ExportOptions { side: Some(1), ..defaults() }),
        (&surface, ExportFormat::Mbsdf, ExportOptions { side: Some(5000), ..defaults() }),
        (&surface, ExportFormat::Rgl, ExportOptions { step: Some(f64::NAN), ..defaults() }),
        (&light, ExportFormat::Lm63, ExportOptions { step: Some(0.0), ..defaults() }),
    ] {
        assert!(matches!(kind(export(material, format, &options)), ExportError::Setting(_)), "{format} {options:?}");
    }
    for (material, format) in [
        (&surface, ExportFormat::Rgl),
        (&surface, ExportFormat::Merl),
        (&surface, ExportFormat::Mbsdf),
        (&light, ExportFormat::Lm63),
    ] {
        let small = ExportOptions { most_bytes: 1000, ..defaults() };
        let error = kind(export(material, format, &small));
        assert!(matches!(error, ExportError::OverLimit { most: 1000, .. }), "{format}: {error}");
    }
    // The rule gives way to the limit where it can.
    let tight = ExportOptions { most_bytes: 2 << 20, ..defaults() };
    assert!(export(&surface, ExportFormat::Rgl, &tight).unwrap().bytes.len() <= 2 << 20);
}

#[test]
fn names_of_formats_are_those_that_people_use() {
    for (name, format) in [("ies", ExportFormat::Lm63), ("lm-63", ExportFormat::Lm63), ("ldt", ExportFormat::Eulumdat)]
    {
        assert_eq!(ExportFormat::of_name(name), Ok(format));
    }
    assert!(ExportFormat::of_name("axf").unwrap_err().to_string().contains("rgl, merl, mbsdf"));
}
