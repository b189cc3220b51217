//! Binary tables of a given size.

use super::values::{Values, angles};
use wavelume_formats::formats::write_npy;

const LAMBDAS: usize = 64;

/// Returns an array of spectra: float32 as this crate writes it, float64, big-endian float32, or float32 in Fortran
/// order.
pub(crate) fn array(kind: &str, fortran: bool, bytes: usize) -> Vec<u8> {
    let mut values = Values(1);
    let size = if kind.ends_with('8') { 8 } else { 4 };
    let rows = bytes / (size * LAMBDAS);
    if kind == "<f4" && !fortran {
        let samples: Vec<f32> = (0..rows * LAMBDAS).map(|_| values.next() as f32).collect();
        return write_npy(&[rows, LAMBDAS], &samples);
    }
    let order = if fortran { "True" } else { "False" };
    let mut header = format!("{{'descr': '{kind}', 'fortran_order': {order}, 'shape': ({rows}, {LAMBDAS}), }}");
    header.push_str(&" ".repeat(117 - header.len()));
    header.push('\n');
    let body = match kind {
        "<f8" => values.doubles(rows * LAMBDAS),
        ">f4" => (0..rows * LAMBDAS).flat_map(|_| (values.next() as f32).to_be_bytes()).collect(),
        _ => values.floats(rows * LAMBDAS),
    };
    [b"\x93NUMPY\x01\0\x76\0", header.as_bytes(), &body].concat()
}

/// Returns a MERL table, which always has 35 MB.
pub(crate) fn merl() -> Vec<u8> {
    let head: Vec<u8> = [90_i32, 90, 180].iter().flat_map(|n| n.to_le_bytes()).collect();
    [head, Values(1).doubles(3 * 90 * 90 * 180)].concat()
}

/// Returns a reflection table in RGB with enough polar angles for the size, and 181 azimuths.
pub(crate) fn mbsdf(bytes: usize) -> Vec<u8> {
    let theta = ((bytes / (12 * 181)) as f64).sqrt() as usize;
    let mut file = b"NVIDIA ARC MBSDF V1\nMBSDF_DATA_REFLECTION=\n".to_vec();
    file.extend([1, theta as u32, 181].iter().flat_map(|word| word.to_le_bytes()));
    file.extend(Values(1).floats(theta * theta * 181 * 3));
    file
}

/// Returns a tensor file of an isotropic material: 30 elevations, 64 × 64 values, and enough wavelengths for the size.
pub(crate) fn rgl(bytes: usize) -> Vec<u8> {
    const THETA: u64 = 30;
    const SIDE: u64 = 64;
    let lambdas = bytes as u64 / (4 * THETA * SIDE * SIDE);
    let even = |count: u64, first: f32, step: f32| -> Vec<u8> {
        (0..count).flat_map(|i| (first + step * i as f32).to_le_bytes()).collect()
    };
    let flat = |count: u64| even(count, 1.0, 0.0);
    let fields: [(&str, u8, Vec<u64>, Vec<u8>); 10] = [
        ("description", 1, vec![5], b"bench".to_vec()),
        ("phi_i", 10, vec![1], even(1, 0.0, 0.0)),
        ("theta_i", 10, vec![THETA], even(THETA, 0.0, 0.05)),
        ("wavelengths", 10, vec![lambdas], even(lambdas, 360.0, 2.0)),
        ("ndf", 10, vec![2, 2], flat(4)),
        ("sigma", 10, vec![2, 2], flat(4)),
        ("vndf", 10, vec![1, THETA, 32, 32], flat(THETA * 1024)),
        ("luminance", 10, vec![1, THETA, SIDE, SIDE], flat(THETA * SIDE * SIDE)),
        ("jacobian", 1, vec![1], vec![1]),
        (
            "spectra",
            10,
            vec![1, THETA, lambdas, SIDE, SIDE],
            Values(1).floats((THETA * lambdas * SIDE * SIDE) as usize),
        ),
    ];
    let size = 18 + fields.iter().map(|(name, _, shape, _)| 13 + name.len() + 8 * shape.len()).sum::<usize>();
    let mut table = b"tensor_file\0\x01\0".to_vec();
    table.extend((fields.len() as u32).to_le_bytes());
    let mut body = Vec::new();
    for (name, code, shape, data) in &fields {
        table.extend((name.len() as u16).to_le_bytes());
        table.extend(name.as_bytes());
        table.extend((shape.len() as u16).to_le_bytes());
        table.push(*code);
        table.extend(((size + body.len()) as u64).to_le_bytes());
        table.extend(shape.iter().flat_map(|n| n.to_le_bytes()));
        body.extend(data);
    }
    [table, body].concat()
}

/// Returns an Arrow stream: four columns of angles in float64, a list of float32 for each spectrum, batches of 65,536
/// rows.
pub(crate) fn arrow(scattered: bool, bytes: usize) -> Vec<u8> {
    const BATCH: usize = 1 << 16;
    let rows = bytes / (4 * LAMBDAS + 32);
    let mut stream = message(1, 0, schema);
    let mut values = Values(1);
    let places: Vec<usize> = (0..rows).collect();
    for batch in places.chunks(BATCH) {
        let n = batch.len();
        let mut body = Vec::with_capacity(n * (4 * LAMBDAS + 32));
        let mut buffers = Vec::new();
        for k in 0..4 {
            buffers.extend([[body.len() as i64, 0], [body.len() as i64, 8 * n as i64]]);
            for &place in batch {
                let angle = angles(place)[k];
                let angle = if scattered && k == 2 { (angle + values.next() / 32.0).min(90.0) } else { angle };
                body.extend(angle.to_le_bytes());
            }
        }
        let at = body.len() as i64;
        buffers.extend([[at, 0], [at, 0], [at, (4 * n * LAMBDAS) as i64]]);
        body.extend(values.floats(n * LAMBDAS));
        let nodes: Vec<[i64; 2]> = [n, n, n, n, n, n * LAMBDAS].map(|length| [length as i64, 0]).to_vec();
        stream.extend(message(3, body.len(), |flat| {
            let at = flat.table(&[(0, &(n as i64).to_le_bytes()), (1, &[0; 4]), (2, &[0; 4])]);
            flat.point(at[1]);
            flat.structs(&nodes);
            flat.point(at[2]);
            flat.structs(&buffers);
        }));
        stream.extend(body);
    }
    stream.extend(b"\xff\xff\xff\xff\0\0\0\0");
    stream
}

fn schema(flat: &mut Flat) {
    let wavelengths: Vec<String> = (0..LAMBDAS).map(|l| (380 + 5 * l).to_string()).collect();
    let wavelengths = wavelengths.join(" ");
    let keys = [
        ("quantity", "brdf"),
        ("value_unit", "1/sr"),
        ("cosine_included", "false"),
        ("angle_unit", "deg"),
        ("wavelength_unit", "nm"),
        ("wavelengths", &wavelengths),
    ];
    let schema = flat.table(&[(1, &[0; 4]), (2, &[0; 4])]);
    flat.point(schema[0]);
    let columns = flat.references(5);
    for (i, name) in ["theta_i", "phi_i", "theta_o", "phi_o", "values"].into_iter().enumerate() {
        flat.point(columns[i]);
        flat.field(name, if i < 4 { 2 } else { 0 });
    }
    flat.point(schema[1]);
    let pairs = flat.references(keys.len());
    for (i, (key, value)) in keys.into_iter().enumerate() {
        flat.point(pairs[i]);
        let pair = flat.table(&[(0, &[0; 4]), (1, &[0; 4])]);
        flat.point(pair[0]);
        flat.text(key);
        flat.point(pair[1]);
        flat.text(value);
    }
}

/// Returns a message without its body; `header` writes its header of the given kind.
fn message(kind: u8, body: usize, header: impl Fn(&mut Flat)) -> Vec<u8> {
    let mut flat = Flat(vec![0; 4]);
    flat.point(0);
    let fields =
        flat.table(&[(0, &4_i16.to_le_bytes()), (1, &[kind]), (2, &[0; 4]), (3, &(body as i64).to_le_bytes())]);
    flat.point(fields[2]);
    header(&mut flat);
    flat.0.resize(flat.0.len().next_multiple_of(8), 0);
    [b"\xff\xff\xff\xff", (flat.0.len() as u32).to_le_bytes().as_slice(), &flat.0].concat()
}

/// Flatbuffer written from its beginning; a reference is filled in when its target is appended.
struct Flat(Vec<u8>);

impl Flat {
    /// Makes the reference at `at` point to the table that is appended next.
    fn point(&mut self, at: usize) {
        let distance = (self.0.len() - at) as u32;
        self.0[at..at + 4].copy_from_slice(&distance.to_le_bytes());
    }

    /// Appends a table of fields with their slots, followed by its vtable. Returns the position of each field.
    fn table(&mut self, fields: &[(usize, &[u8])]) -> Vec<usize> {
        let start = self.0.len();
        let size = 4 + 8 * fields.len();
        self.0.extend((-(size as i32)).to_le_bytes());
        let places: Vec<usize> = (0..fields.len()).map(|i| start + 4 + 8 * i).collect();
        for (_, bytes) in fields {
            self.0.extend_from_slice(bytes);
            self.0.resize(self.0.len() + 8 - bytes.len(), 0);
        }
        let slots = 1 + fields.last().map_or(0, |(slot, _)| *slot);
        let mut vtable = vec![0_u16; 2 + slots];
        (vtable[0], vtable[1]) = (2 * (2 + slots) as u16, size as u16);
        for ((slot, _), place) in fields.iter().zip(&places) {
            vtable[2 + slot] = (place - start) as u16;
        }
        self.0.extend(vtable.iter().flat_map(|word| word.to_le_bytes()));
        places
    }

    /// Appends a list of references to be filled in later. Returns the position of each.
    fn references(&mut self, count: usize) -> Vec<usize> {
        self.0.extend((count as u32).to_le_bytes());
        let start = self.0.len();
        self.0.resize(start + 4 * count, 0);
        (0..count).map(|i| start + 4 * i).collect()
    }

    fn structs(&mut self, pairs: &[[i64; 2]]) {
        self.0.extend((pairs.len() as u32).to_le_bytes());
        self.0.extend(pairs.iter().flatten().flat_map(|n| n.to_le_bytes()));
    }

    fn text(&mut self, text: &str) {
        self.0.extend((text.len() as u32).to_le_bytes());
        self.0.extend(text.as_bytes());
        self.0.push(0);
    }

    /// Appends a column: numbers of a precision (1 float32, 2 float64), or (0) lists of float32.
    fn field(&mut self, name: &str, precision: i16) {
        const FLOAT: u8 = 3;
        const LISTS: u8 = 16;
        let kind = if precision > 0 { FLOAT } else { LISTS };
        let at = self.table(&[(0, &[0; 4]), (2, &[kind]), (3, &[0; 4]), (5, &[0; 4])]);
        self.point(at[0]);
        self.text(name);
        self.point(at[2]);
        if precision > 0 {
            self.table(&[(0, &precision.to_le_bytes())]);
        } else {
            self.table(&[(0, &(LAMBDAS as i32).to_le_bytes())]);
        }
        self.point(at[3]);
        let children = self.references(usize::from(precision == 0));
        for child in children {
            self.point(child);
            self.field("item", 1);
        }
    }
}
