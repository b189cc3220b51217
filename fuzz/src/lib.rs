//! Common parts of the fuzz targets: budgets, corrected checksums, and properties that hold for any input.

mod allocation;
mod compressing;
mod credentials;
mod material;
mod seal;
// The service's own package, of which this room is a part, would take minutes to build.
#[allow(dead_code, unused_imports, reason = "the targets use a part of it")]
#[path = "../../src/trust/mod.rs"]
mod trust;

pub use compressing::compress;
pub use credentials::read_credentials;
pub use material::use_material;
pub use seal::sealed;

use std::borrow::Cow;
use wavelume_core::compress::{self, Summary};
use wavelume_core::domain::{Axis, Direction};
use wavelume_formats::formats::{self, Acquisition, Interpretation, Samples};
use wavelume_formats::projection::{self, AxesRequest};

/// Largest number of announced samples that is decoded; a valid header may announce 2^28, which only costs time.
pub const MOST_DECODED: usize = 1 << 18;
/// Largest number of samples of a material that is opened; the tables of its meshes and trees are built for every
/// input.
pub const MOST_OPENED: usize = 1 << 16;
/// Largest number of samples of an acquisition that is projected, and of values of a virtual document that is
/// evaluated.
const MOST_PROJECTED: usize = 1 << 12;
/// Largest number of samples of a grid of angles that is projected; averages over triangles take seconds under
/// instrumentation.
const MOST_ANGULAR: usize = 1 << 6;

/// Limits rayon to the caller's thread, so that a failing input always fails at the same place.
pub fn one_thread() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread();
    pool.build_global().expect("no other pool was made before");
}

/// Number of samples that a header announces.
pub fn announced(summary: &Summary) -> usize {
    summary.axes.iter().map(Axis::len).product()
}

/// Inspects and decodes `bytes`. Checks that both agree, and that the samples have the announced axes.
pub fn decode(bytes: &[u8]) {
    let summary = match compress::inspect(bytes) {
        Ok(summary) if announced(&summary) <= MOST_DECODED => summary,
        Ok(_) => return,
        Err(_) => {
            assert!(compress::decode(bytes).is_err(), "decoded, but not inspected");
            return;
        }
    };
    compress::payload_digest(bytes).expect("what is inspected has a digest");
    let Ok(decoded) = compress::decode(bytes) else { return };
    let tensor = &decoded.measurement.tensor;
    assert_eq!(decoded.summary, summary);
    assert_eq!(tensor.axes(), summary.axes);
    assert_eq!(tensor.len(), announced(&summary));
}

/// Decodes every level of `bytes` from the whole file and from the bytes that the level needs, and checks that the
/// samples are equal. Then decodes from the file cut at `cut` / 65,536 of its length, which gives equal samples or an
/// error.
pub fn decode_prefixes(bytes: &[u8], cut: u16) {
    match compress::inspect(bytes) {
        Ok(summary) if announced(&summary) <= MOST_DECODED => {}
        _ => return,
    }
    let Ok(levels) = compress::levels(bytes) else { return };
    let cut = (bytes.len() * usize::from(cut)) >> 16;
    for info in levels {
        let samples = |bytes: &[u8]| {
            let decoded = compress::decode_level(bytes, info.level).ok()?;
            Some(decoded.measurement.tensor.samples().iter().map(|s| s.to_bits()).collect::<Vec<_>>())
        };
        let whole = samples(bytes);
        let needed = usize::try_from(info.bytes).expect("a length").min(bytes.len());
        assert_eq!(samples(&bytes[..needed]), whole, "level {} from {needed} bytes", info.level);
        let some = samples(&bytes[..cut]);
        assert!(some.is_none() || some == whole, "level {} from {cut} bytes", info.level);
    }
}

/// Decodes the first, the last and a middle slice of `bytes`, and compares them with the whole if that decodes.
pub fn decode_blocks(bytes: &[u8]) {
    let summary = match compress::inspect(bytes) {
        Ok(summary) if announced(&summary) <= MOST_OPENED => summary,
        _ => return,
    };
    let Some(at) = summary.axes.iter().rposition(|axis| matches!(axis, Axis::Triangles(_) | Axis::Grid(_))) else {
        assert!(compress::decode_block(bytes, 0).is_err(), "a slice without directions");
        return;
    };
    let blocks: usize = summary.axes[..at].iter().map(Axis::len).product();
    let length: usize = summary.axes[at..].iter().map(Axis::len).product();
    let whole = compress::decode(bytes);
    assert!(compress::decode_block(bytes, blocks).is_err(), "a slice after the last");
    for block in [0, blocks / 2, blocks - 1] {
        let slice = compress::decode_block(bytes, block);
        let Ok(whole) = &whole else { continue };
        let slice = slice.expect("a slice of what decodes");
        let expected = &whole.measurement.tensor.samples()[block * length..][..length];
        let same = slice.tensor.samples().iter().zip(expected).all(|(a, b)| a.to_bits() == b.to_bits());
        assert!(same && slice.tensor.len() == length, "other samples in slice {block}");
    }
}

/// Runs every decoder on a material on grids of angles: the whole, its levels, its slices, and its evaluation. Other
/// materials are skipped.
pub fn decode_grids(bytes: &[u8], cut: u16) {
    let is_grid = |summary: Summary| summary.axes.iter().any(|axis| matches!(axis, Axis::Grid(_)));
    if compress::inspect(bytes).is_ok_and(is_grid) {
        decode(bytes);
        decode_prefixes(bytes, cut);
        decode_blocks(bytes);
        use_material(bytes);
    }
}

/// Separator between a file and its description: the manifest of an array, or `{"how": {…}}` with any options.
pub const SEPARATOR: u8 = 0x1E;

/// Reads `bytes` as a file of any format, and projects a small acquisition onto coarse axes.
pub fn read_format(bytes: &[u8]) {
    let mut how = Interpretation::default();
    let mut file = bytes;
    if let Some(at) = bytes.iter().rposition(|&byte| byte == SEPARATOR)
        && let Ok(said) = serde_json::from_slice::<serde_json::Value>(&bytes[at + 1..])
    {
        match said.get("how").map(|how| serde_json::from_value(how.clone())) {
            Some(Ok(options)) => how = options,
            _ => how.axes = Some(said),
        }
        file = &bytes[..at];
    }
    if is_costly(how.axes.as_ref(), file) {
        return;
    }
    if let Ok(acquisition) = formats::read(&whole_table(file), &how) {
        project(&acquisition);
    }
}

/// Reads `bytes` between a beginning and an end that make the file be recognised.
pub fn read_within(before: &[u8], bytes: &[u8], after: &[u8]) {
    read_format(&[before, bytes, after].concat());
}

/// Reads `bytes` as a BSDF of WINDOW or Radiance with every choice of its functions, and projects what is small. Bytes
/// without the root element are the numbers of a matrix, or of a tree if they have a brace.
pub fn read_bsdf_xml(bytes: &[u8]) {
    const ROOT: &[u8] = b"<WindowElement";
    let file = if bytes.windows(ROOT.len()).any(|window| window == ROOT) {
        Cow::Borrowed(bytes)
    } else {
        let numbers = String::from_utf8_lossy(bytes).replace(['<', '&'], " ");
        let structure =
            if numbers.contains('{') { ["TensorTree3", "TensorTree4"][numbers.len() % 2] } else { "Columns" };
        Cow::Owned(window(structure, &numbers).into_bytes())
    };
    let quantities = [None, Some("brdf"), Some("btdf"), Some("bsdf")];
    for (quantity, side) in
        quantities.iter().flat_map(|quantity| [None, Some("front"), Some("back")].map(|side| (quantity, side)))
    {
        let how = serde_json::json!({ "quantity": quantity, "side": side, "band": side.and(Some("Visible")) });
        let how: Interpretation = serde_json::from_value(how).expect("options by their names");
        let Ok(acquisition) = formats::read(&file, &how) else { continue };
        if let Samples::Function(modelled) = &acquisition.samples {
            let mut value = [0.0];
            for (theta, phi) in [(0.0, 0.0), (20.0, 100.0), (45.0, 225.0), (90.0, 300.0), (120.0, 10.0), (180.0, 0.0)] {
                let [wi, wo] = [theta % 90.0, theta].map(|theta| Direction::from_degrees(theta, phi));
                modelled.function.evaluate(wi, wo, &mut value);
            }
        }
        project(&acquisition);
    }
}

/// File with one function of a small basis, or of a tree, whose values are `numbers`.
fn window(structure: &str, numbers: &str) -> String {
    let ring = |low: u8, high: u8, count: u8| {
        format!(
            "<AngleBasisBlock><nPhis>{count}</nPhis><ThetaBounds><LowerTheta>{low}</LowerTheta><UpperTheta>{high}</UpperTheta>\
             </ThetaBounds></AngleBasisBlock>"
        )
    };
    let rings = [ring(0, 30, 1), ring(30, 90, 2)].concat();
    format!(
        "<WindowElement><Optical><Layer><DataDefinition><IncidentDataStructure>{structure}</IncidentDataStructure><AngleBasis>\
         <AngleBasisName>own</AngleBasisName>{rings}</AngleBasis></DataDefinition><WavelengthData><Wavelength>Visible\
         </Wavelength><WavelengthDataBlock><WavelengthDataDirection>Reflection Front</WavelengthDataDirection><AngleBasis>\
         LBNL/Shirley-Chiu</AngleBasis><ColumnAngleBasis>own</ColumnAngleBasis><RowAngleBasis>own</RowAngleBasis>\
         <ScatteringData>{numbers}</ScatteringData></WavelengthDataBlock></WavelengthData></Layer></Optical></WindowElement>"
    )
}

/// Expands a MERL table, whose size is fixed, by repeating a few numbers; returns any other file unchanged.
fn whole_table(file: &[u8]) -> Cow<'_, [u8]> {
    const HEAD: usize = 12;
    let words = |azimuths: i32, swap: fn(i32) -> [u8; 4]| [90, 90, azimuths].map(swap).concat();
    for azimuths in [180, 360] {
        let size = HEAD + 24 * 90 * 90 * azimuths as usize;
        for swap in [i32::to_le_bytes, i32::to_be_bytes] {
            let Some(numbers) = file.strip_prefix(words(azimuths, swap).as_slice()) else { continue };
            let more = numbers.len() % 8 == 0 && !numbers.is_empty() && file.len() < size;
            if more {
                return file[..HEAD].iter().chain(numbers.iter().cycle()).copied().take(size).collect();
            }
        }
    }
    Cow::Borrowed(file)
}

fn project(acquisition: &Acquisition) {
    let request = match &acquisition.samples {
        Samples::OnAxes { tensor, .. } if tensor.len() <= MOST_PROJECTED => AxesRequest::default(),
        Samples::Grid(grid) if grid.values.len() <= MOST_ANGULAR => AxesRequest {
            incoming_level: grid.incoming.as_ref().and_then(|angles| angles.phi.as_ref()).map(|_| 1),
            outgoing_level: grid.outgoing.as_ref().map(|_| 1),
            ..AxesRequest::default()
        },
        _ => return,
    };
    if let Ok(projected) = projection::project(acquisition, &request) {
        let tensor = &projected.measurement.tensor;
        assert_eq!(tensor.len(), tensor.shape().iter().product::<usize>());
    }
}

/// Returns true if `file` is a virtual document with more values than are evaluated here; its own limit is 2^31
/// evaluations.
fn is_costly(axes: Option<&serde_json::Value>, file: &[u8]) -> bool {
    let Ok(document) = serde_json::from_slice::<serde_json::Value>(file) else { return false };
    let described = axes.map(|axes| axes.get("axes").unwrap_or(axes)).unwrap_or(&document["axes"]);
    let Some(axes) = described.as_array() else { return false };
    axes.iter().map(length).fold(1, usize::saturating_mul) > MOST_PROJECTED
}

/// Number of entries of a described axis.
fn length(axis: &serde_json::Value) -> usize {
    let triangles = |level: u64| 8 << (2 * level.min(8));
    if let Some(text) = axis.as_str() {
        // `hemi:LEVEL`, `lambda:START:STEP:COUNT`
        let parts: Vec<&str> = text.split(':').collect();
        return match parts.as_slice() {
            [_, level] => triangles(level.parse().unwrap_or(0)),
            [.., count] => count.parse().unwrap_or(1),
            [] => 1,
        };
    }
    let number = |key: &str| axis.get(key).and_then(serde_json::Value::as_u64);
    let listed = axis.as_object().into_iter().flatten().filter_map(|(_, value)| value.as_array()).map(Vec::len).max();
    let count = number("count").map_or(1, |count| usize::try_from(count).unwrap_or(usize::MAX));
    number("level").map_or(1, triangles).max(count).max(listed.unwrap_or(1))
}
