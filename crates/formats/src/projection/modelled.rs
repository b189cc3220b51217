//! Projection of a function defined by the file's own model: averages over triangles.

use super::angles::{check, mean_spacing};
use super::averages::OCTANT_DEGREES;
use super::error::{LevelError, ProjectionError, Role};
use super::levels::{self, Choice, Entries, lower_to_fit};
use super::projected::{Coverage, Projected};
use super::request::AxesRequest;
use super::spectral;
use crate::domain::{
    Axis, Direction, Domain, Layout, Measurement, Note, Quantity, Sampling, Tensor, TriangleMesh, Vertices, centroid,
    check_axes, child, solid_angle,
};
use crate::formats::{Acquisition, Modelled};
use crate::notes::ProjectionNote;
use rayon::prelude::*;

/// Least number of times that an incoming triangle is split into four to average a function over it. One suffices, as
/// the function is piecewise linear in the incoming angles.
const INCOMING_DIVISIONS: u32 = 1;
/// Least number of times that an outgoing triangle is split into four to average a function over it. Raising it is more
/// accurate and slower.
const OUTGOING_DIVISIONS: u32 = 2;
/// Finest subdivision level of the parts of a triangle that narrow features of a function can demand. Raising it
/// resolves narrower features and takes longer.
const FINEST_LEVEL: u32 = 9;
/// Fixed cost of one evaluation of a function, in units of the cost of one spectral channel.
const OVERHEAD: usize = 64;
/// Upper bound on the work of averaging a function over triangles: evaluations of the function times spectral channels.
/// Work at the bound takes about ten seconds. Triangles are split less often to stay below it. Raising it is slower and
/// more accurate.
const MAX_WORK: u64 = 1 << 33;
/// Number of spectra of the function that one task computes at a time.
const BLOCK: usize = 16;

/// Incoming axis onto which a function of two directions is projected.
enum Incoming<'a> {
    /// Incoming polar angles of the file, in degrees, kept unchanged.
    Elevations(&'a [f64]),
    Triangles(Choice),
}

/// Direction that represents a part of a triangle of directions, and the weight of this part in the average of a
/// function over the triangle.
type Part = (Direction, f64);

/// Projects a function that the model of a file defines, `modelled`, onto the requested axes.
pub(super) fn project(
    acquisition: &Acquisition,
    modelled: &Modelled,
    request: &AxesRequest,
) -> Result<Projected, ProjectionError> {
    check(Role::Incoming, &modelled.incoming)?;
    // A phase function covers the whole sphere, without a cosine weight.
    let is_phase = acquisition.quantity == Quantity::Phase;
    let [domain_in, domain_out] = match acquisition.quantity {
        Quantity::Phase => [Domain::Sphere; 2],
        Quantity::Btdf => [Domain::Hemisphere, Domain::Lower],
        Quantity::Bsdf => [Domain::Hemisphere, Domain::Sphere],
        _ => [Domain::Hemisphere; 2],
    };
    let mut incoming = incoming(modelled, domain_in, request.incoming_level)?;
    let spacing = modelled.outgoing_spacing;
    let mut outgoing = levels::choose_by_distance(Role::Outgoing, domain_out, spacing, request.outgoing_level)?;
    let spectral =
        spectral::plan(modelled.spectral.as_ref(), acquisition.spectral_factor.as_ref(), request.wavelengths.as_ref())?;
    let channels = spectral.channels;
    lower_to_fit(incoming.entries(), Entries::Chosen(&mut outgoing), channels.to());
    let mut axes = vec![incoming.axis(), Axis::Triangles(outgoing.mesh)];
    axes.extend(spectral.axis);
    Layout::of(acquisition.quantity, &axes)?;
    let count = check_axes(&axes)?;

    let mut notes = Vec::new();
    let pairs = incoming.len() * outgoing.mesh.len();
    let wanted = [incoming.divisions(modelled), divisions(outgoing.mesh, spacing, OUTGOING_DIVISIONS)];
    let [divisions_in, divisions_out] = affordable(wanted, pairs, channels.from());
    let parts_in = incoming.parts(divisions_in, &mut notes);
    let vertices = outgoing.mesh.all_vertices();
    notes.push(outgoing.note(Role::Outgoing));
    let (parts, is_by_cosine) = (1_u64 << (2 * divisions_out), !is_phase);
    notes.push(ProjectionNote::CellsOfInterpolant { role: Role::Outgoing.name(), parts, is_by_cosine }.into());
    notes.extend(spectral.notes);

    let weight: fn(Direction) -> f64 = if is_phase { |_| 1.0 } else { |wo| wo.cos_theta().abs() };
    let n_out = outgoing.mesh.len();
    let (width, out_width) = (channels.from(), channels.to());
    let mut samples = vec![0.0_f32; count];
    samples.par_chunks_mut(BLOCK * out_width).enumerate().for_each_init(
        || Mean::new(width),
        |mean, (block, rows)| {
            for (i, row) in rows.chunks_mut(out_width).enumerate() {
                let pair = block * BLOCK + i;
                mean.parts.clear();
                split(vertices[pair % n_out], divisions_out, &mut mean.parts, weight);
                mean.over(modelled, &parts_in[pair / n_out]);
                channels.write(&mean.sums, row);
            }
        },
    );
    let cells = (parts_in.len() * n_out) as u64;
    let empty = samples.chunks(out_width).filter(|spectrum| spectrum.iter().all(|s| s.is_nan())).count() as u64;
    let coverage = Coverage { cells, measured: 0, interpolated: cells - empty, empty, notes, ..Coverage::default() };
    let tensor = Tensor::new(axes, samples)?;
    let measurement = Measurement::new(acquisition.quantity, acquisition.unit, Sampling::Average, tensor)?;
    Ok(Projected { measurement, coverage, filled: Vec::new(), numbers: None, scattered: None, lobe: None })
}

fn incoming(modelled: &Modelled, domain: Domain, level: Option<u8>) -> Result<Incoming<'_>, ProjectionError> {
    let angles = &modelled.incoming;
    match (&angles.phi, level) {
        (None, None) => Ok(Incoming::Elevations(&angles.theta)),
        (None, Some(_)) => {
            let level = LevelError::Isotropic { elevations: angles.theta.len() };
            Err(ProjectionError::Level { role: Role::Incoming, level })
        }
        (Some(_), level) => Ok(Incoming::Triangles(levels::choose(Role::Incoming, domain, angles, level)?)),
    }
}

impl Incoming<'_> {
    fn entries(&mut self) -> Entries<'_> {
        match self {
            Self::Elevations(theta) => Entries::Fixed(theta.len()),
            Self::Triangles(choice) => Entries::Chosen(choice),
        }
    }

    fn len(&self) -> usize {
        match self {
            Self::Elevations(theta) => theta.len(),
            Self::Triangles(choice) => choice.mesh.len(),
        }
    }

    fn axis(&self) -> Axis {
        match self {
            Self::Elevations(theta) => Axis::Elevation(theta.to_vec()),
            Self::Triangles(choice) => Axis::Triangles(choice.mesh),
        }
    }

    /// Returns how many times each triangle of incoming directions is split into four, to average the function over it.
    fn divisions(&self, modelled: &Modelled) -> u32 {
        match self {
            Self::Elevations(_) => 0,
            Self::Triangles(choice) => {
                let (theta, phi) = mean_spacing(&modelled.incoming);
                divisions(choice.mesh, phi.map_or(theta, |phi| theta.min(phi)), INCOMING_DIVISIONS)
            }
        }
    }

    /// Returns, for each position on the incoming axis, weighted incoming directions over which the function is
    /// averaged. Adds notes that tell the user which incoming axis was chosen.
    fn parts(&self, divisions: u32, notes: &mut Vec<Note>) -> Vec<Vec<Part>> {
        let role = Role::Incoming.name();
        match self {
            Self::Elevations(theta) => {
                notes.push(ProjectionNote::Elevations { role, elevations: theta.len() }.into());
                theta.iter().map(|&theta| vec![(Direction::from_degrees(theta, 0.0), 1.0)]).collect()
            }
            Self::Triangles(choice) => {
                notes.push(choice.note(Role::Incoming));
                let (parts, is_by_cosine) = (1_u64 << (2 * divisions), false);
                notes.push(ProjectionNote::CellsOfInterpolant { role, parts, is_by_cosine }.into());
                let cell = |vertices| {
                    let mut parts = Vec::new();
                    split(vertices, divisions, &mut parts, |_| 1.0);
                    parts
                };
                choice.mesh.all_vertices().into_iter().map(cell).collect()
            }
        }
    }
}

/// Returns how many times each triangle is split into four, so that its parts are at most half of `spacing` (degrees)
/// wide.
fn divisions(mesh: TriangleMesh, spacing: f64, least: u32) -> u32 {
    let wanted = libm::ceil(libm::log2(2.0 * OCTANT_DEGREES / spacing)).clamp(0.0, f64::from(FINEST_LEVEL));
    (wanted as u32).saturating_sub(u32::from(mesh.level())).max(least)
}

/// Reduces the numbers of splits of incoming and outgoing triangles, the larger number first, until the number of
/// function evaluations is within its limit.
fn affordable([mut incoming, mut outgoing]: [u32; 2], pairs: usize, channels: usize) -> [u32; 2] {
    let work = |divisions: u32| {
        (pairs as u64).saturating_mul((channels + OVERHEAD) as u64).saturating_mul(1_u64 << (2 * divisions).min(63))
    };
    while incoming + outgoing > 0 && work(incoming + outgoing) > MAX_WORK {
        let finer = if incoming > outgoing { &mut incoming } else { &mut outgoing };
        *finer -= 1;
    }
    [incoming, outgoing]
}

/// Splits a triangle into parts, represented by their centroids. The weight of each part is its solid angle times
/// `factor`.
fn split(vertices: Vertices, divisions: u32, parts: &mut Vec<Part>, factor: impl Fn(Direction) -> f64 + Copy) {
    if divisions > 0 {
        for c in 0..4 {
            split(child(vertices, c), divisions - 1, parts, factor);
        }
    } else {
        let direction = centroid(vertices);
        parts.push((direction, solid_angle(vertices) * factor(direction)));
    }
}

/// Mean of a function over pairs of directions, without missing values (normalised averaging, Knutsson & Westin 1993).
struct Mean {
    /// Outgoing directions over which the function is averaged, with their weights.
    parts: Vec<Part>,
    sums: Vec<f64>,
    weights: Vec<f64>,
    values: Vec<f64>,
}

impl Mean {
    fn new(width: usize) -> Self {
        Self { parts: Vec::new(), sums: vec![0.0; width], weights: vec![0.0; width], values: vec![0.0; width] }
    }

    fn over(&mut self, modelled: &Modelled, incoming: &[Part]) {
        let Self { parts, sums, weights, values } = self;
        sums.fill(0.0);
        weights.fill(0.0);
        for &(wi, weight_in) in incoming {
            for &(wo, weight_out) in &*parts {
                modelled.function.evaluate(wi, wo, values);
                let weight = weight_in * weight_out;
                for ((sum, total), &value) in sums.iter_mut().zip(&mut *weights).zip(&*values) {
                    if !value.is_nan() {
                        *sum += weight * value;
                        *total += weight;
                    }
                }
            }
        }
        // 0 / 0 without any weight: masked.
        sums.iter_mut().zip(&*weights).for_each(|(sum, total)| *sum /= total);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Unit;
    use crate::formats::{Angles, AzimuthExtent, Azimuths, DirectionalFunction, Instrument, ParseReport, Samples};
    use std::sync::Arc;

    #[derive(Debug)]
    struct Surface(fn(Direction, Direction) -> f64);

    impl DirectionalFunction for Surface {
        fn evaluate(&self, wi: Direction, wo: Direction, values: &mut [f64]) {
            values.iter_mut().enumerate().for_each(|(i, value)| *value = (i + 1) as f64 * self.0(wi, wo));
        }
    }

    fn acquisition(azimuths: Option<Vec<f64>>, spacing: f64, f: fn(Direction, Direction) -> f64) -> Acquisition {
        let phi = azimuths.map(|phi| Azimuths { phi, extent: AzimuthExtent::Sector });
        Acquisition {
            format: "test",
            dialect: String::new(),
            quantity: Quantity::Brdf,
            unit: Unit::PerSteradian,
            samples: Samples::Function(Modelled {
                stated: None,
                incoming: Angles { theta: vec![0.0, 30.0, 60.0], covers: (0.0, 90.0), phi },
                outgoing_spacing: spacing,
                spectral: Some(Axis::Rgb),
                numbers: 0,
                missing: 0,
                function: Arc::new(Surface(f)),
            }),
            spectral_factor: None,
            instrument: Instrument::default(),
            report: ParseReport::default(),
        }
    }

    fn projected(acquisition: &Acquisition, incoming: Option<u8>, outgoing: Option<u8>) -> Projected {
        let request = AxesRequest { incoming_level: incoming, outgoing_level: outgoing, ..AxesRequest::default() };
        super::super::project(acquisition, &request).unwrap()
    }

    fn mesh(axis: &Axis) -> TriangleMesh {
        match axis {
            Axis::Triangles(mesh) => *mesh,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn constants_stay_on_the_elevations_of_the_file() {
        let projected = projected(&acquisition(None, 10.0, |_, _| 0.25), None, None);
        let tensor = &projected.measurement.tensor;
        assert_eq!(tensor.axes()[0], Axis::Elevation(vec![0.0, 30.0, 60.0]));
        // Cells of 9° are nearest to 10°.
        assert_eq!((mesh(&tensor.axes()[1]).level(), tensor.shape()), (3, vec![3, 256, 3]));
        assert!(tensor.samples().chunks(3).all(|s| s == [0.25, 0.5, 0.75]));
        assert_eq!((projected.coverage.cells, projected.coverage.interpolated), (768, 768));
        assert_eq!(projected.measurement.sampling, Sampling::Average);
    }

    #[test]
    fn cells_keep_the_light_that_they_reflect() {
        // f · cos is 1 everywhere: f grows without bounds at the horizon, the reflected light does not.
        let projected = projected(&acquisition(None, 10.0, |_, wo| 1.0 / wo.cos_theta()), None, Some(3));
        let mesh = mesh(&projected.measurement.tensor.axes()[1]);
        let samples = projected.measurement.tensor.samples();
        for cell in 0..mesh.len() {
            let light = f64::from(samples[3 * cell]) * mesh.projected_solid_angle(cell);
            assert!((light / mesh.solid_angle(cell) - 1.0).abs() < 2e-3, "{cell}: {light}");
        }
    }

    #[test]
    fn both_directions_of_anisotropic_data_are_averaged() {
        let turn = (0..=12).map(|i| f64::from(30 * i - 180)).collect();
        let acquired = acquisition(Some(turn), 10.0, |wi, wo| wi.xyz()[0] + 2.0 * wo.xyz()[1]);
        let projected = projected(&acquired, Some(1), Some(2));
        let tensor = &projected.measurement.tensor;
        let (coarse, fine) = (mesh(&tensor.axes()[0]), mesh(&tensor.axes()[1]));
        assert_eq!(tensor.shape(), [16, 64, 3]);
        for (i, row) in tensor.samples().chunks(3).enumerate() {
            let expected = coarse.centroid(i / 64).xyz()[0] + 2.0 * fine.centroid(i % 64).xyz()[1];
            assert!((f64::from(row[0]) - expected).abs() < 0.12, "{i}: {} {expected}", row[0]);
        }
    }

    #[test]
    fn what_is_missing_drops_out() {
        let hole = |_: Direction, wo: Direction| if wo.xyz()[0] < 0.1 { f64::NAN } else { 2.0 };
        let projected = projected(&acquisition(None, 5.0, hole), None, Some(2));
        let samples = projected.measurement.tensor.samples();
        assert!(samples.iter().all(|s| s.is_nan() || (s % 2.0).abs() < 1e-6));
        assert!(projected.coverage.empty > 0 && projected.coverage.interpolated > 0);
        assert_eq!(projected.coverage.empty as usize * 3, projected.measurement.tensor.masked());
    }

    #[test]
    fn levels_that_mean_nothing_are_refused_and_chosen_ones_fit() {
        let request = AxesRequest { incoming_level: Some(1), ..AxesRequest::default() };
        let error = super::super::project(&acquisition(None, 5.0, |_, _| 1.0), &request).unwrap_err();
        assert!(matches!(error, ProjectionError::Level { level: LevelError::Isotropic { elevations: 3 }, .. }));
        let request = AxesRequest { outgoing_level: Some(9), ..AxesRequest::default() };
        let error = super::super::project(&acquisition(None, 5.0, |_, _| 1.0), &request).unwrap_err();
        assert!(matches!(error, ProjectionError::Level { level: LevelError::AboveLimit { found: 9 }, .. }));

        let choice = |level| levels::choose_by_distance(Role::Outgoing, Domain::Hemisphere, 1.0, level).unwrap();
        let (mut incoming, mut outgoing) = (Incoming::Triangles(choice(None)), choice(None));
        lower_to_fit(incoming.entries(), Entries::Chosen(&mut outgoing), 8);
        assert_eq!((incoming.len(), outgoing.mesh.len()), (4096, 1024));
        let (mut incoming, mut outgoing) = (Incoming::Elevations(&[0.0; 64]), choice(Some(8)));
        lower_to_fit(incoming.entries(), Entries::Chosen(&mut outgoing), 1 << 20);
        assert_eq!(outgoing.mesh.level(), 8);
    }

    #[test]
    fn cells_are_split_less_where_there_are_too_many() {
        assert_eq!(affordable([1, 3], 1 << 12, 64), [1, 3]);
        assert_eq!(affordable([1, 3], 1 << 25, 1), [0, 0]);
        assert_eq!(affordable([1, 9], 1 << 16, 64), [1, 4]);
        assert_eq!(affordable([0, 0], usize::MAX, 64), [0, 0]);
        let level_5 = TriangleMesh::new(Domain::Hemisphere, 5).unwrap();
        assert_eq!((divisions(level_5, 2.2, 2), divisions(level_5, 0.2, 2), divisions(level_5, 45.0, 1)), (2, 4, 1));
    }
}
