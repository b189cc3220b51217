//! Conversion of record batches to rows. Every buffer is checked to lie within its message, every number is validated,
//! and lists of float32 are copied whole.

use super::super::columns::{ANGLE, Angle, Cell, Columns, NOT_NEGATIVE, WAVELENGTH};
use super::super::problems::Problems;
use super::super::rows::Rows;
use super::flat::{Broken, Table};
use super::schema::{Column, Element, Kind};
use crate::domain::limits::MAX_SAMPLES;
use crate::formats::text::{Brief, snippet};

/// Step in degrees to which angles stored as float32 are rounded, because 30.1 is stored as 30.100000381. Raising it
/// loses digits of exact angles.
const FLOAT32_DEGREES: f64 = 1e-4;
/// Step in radians to which angles stored as float32 are rounded. Raising it loses digits of exact angles.
const FLOAT32_RADIANS: f64 = 1e-6;
/// Upper bound on the infinite numbers of a record batch that are examined: more than a report lists.
const MOST_INFINITE: usize = 100;

/// Reason why a record batch of an Arrow stream is rejected.
pub(super) enum Refusal {
    Broken(String),
    Unsupported(String),
    OverLimit(String),
}

impl From<Broken> for Refusal {
    fn from(_: Broken) -> Self {
        Self::Broken("a reference in the record batch leads outside it, expected one within it".to_owned())
    }
}

/// Reader of the record batches of an Arrow stream, one after the other.
pub(super) struct Batches<'a> {
    columns: &'a [Column],
    /// Number of the first cell that each column provides in a row; a column of lists provides several cells.
    cells: &'a [usize],
    read: &'a Columns,
    cosine: bool,
    /// Number of table rows read so far from the record batches of an Arrow stream.
    count: usize,
    pub(super) rows: Rows,
    pub(super) problems: Problems,
    /// True if the reader changed angles stored as float32 by rounding them, to 1e-4° or 1e-6 rad.
    pub(super) rounded: bool,
}

/// Numbers of one column in one record batch.
#[derive(Clone, Copy)]
struct Numbers<'a> {
    element: Element,
    bytes: &'a [u8],
    /// Validity bits of the numbers, one bit each, lowest bit first; `None` if no number is missing.
    valid: Option<&'a [u8]>,
}

impl Numbers<'_> {
    #[inline]
    fn is_valid(&self, i: usize) -> bool {
        self.valid.is_none_or(|bits| bits.get(i / 8).is_some_and(|byte| byte >> (i % 8) & 1 == 1))
    }

    /// Returns number `i`, counted from 0, of one column of an Arrow record batch; `None` if it is missing or NaN.
    #[inline]
    fn get(&self, i: usize) -> Option<f64> {
        let size = self.element.size();
        let bytes = self.bytes.get(i * size..(i + 1) * size)?;
        self.is_valid(i).then(|| self.element.value(bytes)).filter(|value| !value.is_nan())
    }
}

/// Nodes and buffers (in Arrow's sense) of a record batch, with the position of the next unread ones.
struct Parts<'a> {
    nodes: Vec<[usize; 2]>,
    buffers: Vec<&'a [u8]>,
    node: usize,
    buffer: usize,
}

impl<'a> Parts<'a> {
    /// Takes the numbers of the next column of a record batch. They are plain, or in `rows` lists of `each` numbers.
    fn numbers(&mut self, element: Element, rows: usize, each: Option<usize>) -> Result<Numbers<'a>, Refusal> {
        let outer = match each {
            None => None,
            Some(_) => self.validity(rows)?,
        };
        let count = rows.checked_mul(each.unwrap_or(1)).ok_or(Broken)?;
        let inner = self.validity(count)?;
        let bytes = self.buffers.get(self.buffer).copied().ok_or(Broken)?;
        self.buffer += 1;
        if bytes.len() / element.size() < count {
            return Err(Refusal::Broken(format!(
                "a column of {} bytes, expected {count} numbers of {} bytes",
                bytes.len(),
                element.size()
            )));
        }
        if outer.is_some() {
            return Err(Refusal::Unsupported(
                "lists that are missing as a whole, expected lists of missing numbers (NaN)".to_owned(),
            ));
        }
        Ok(Numbers { element, bytes, valid: inner })
    }

    /// Takes the validity bits of the next Arrow node, which must have `count` entries; `None` if no entry is missing.
    fn validity(&mut self, count: usize) -> Result<Option<&'a [u8]>, Refusal> {
        let [length, nulls] = self.nodes.get(self.node).copied().ok_or(Broken)?;
        let bits = self.buffers.get(self.buffer).copied().ok_or(Broken)?;
        self.node += 1;
        self.buffer += 1;
        if length != count {
            return Err(Refusal::Broken(format!("a column of {length} entries in the batch, expected {count}")));
        }
        if nulls == 0 || bits.is_empty() {
            return Ok(None);
        }
        if bits.len() < count.div_ceil(8) {
            return Err(Refusal::Broken(format!(
                "{} bytes of validity bits for the {count} entries of a column, expected one byte for every eight",
                bits.len()
            )));
        }
        Ok(Some(bits))
    }

    fn skip(&mut self, kind: Kind) {
        let (nodes, buffers) = kind.parts();
        self.node += nodes;
        self.buffer += buffers;
    }
}

impl<'a> Batches<'a> {
    pub(super) fn new(columns: &'a [Column], cells: &'a [usize], read: &'a Columns, cosine: bool) -> Self {
        Self {
            columns,
            cells,
            read,
            cosine,
            count: 0,
            rows: Rows::default(),
            problems: Problems::default(),
            rounded: false,
        }
    }

    /// Reads a record batch (the table `RecordBatch` in Arrow's `Message.fbs`) and its body.
    pub(super) fn batch(&mut self, batch: Table<'_>, body: &[u8]) -> Result<(), Refusal> {
        if batch.table(3)?.is_some() {
            return Err(Refusal::Unsupported(
                "compressed buffers, expected plain ones (pyarrow: IpcWriteOptions(compression=None))".to_owned(),
            ));
        }
        let count = usize::try_from(batch.long(0)?).map_err(|_| Broken)?;
        let mut parts = self.parts(batch, body)?;
        let width = self.read.width();
        let base = self.rows.values.len();
        let whole = count.checked_mul(width).and_then(|n| n.checked_add(base));
        let Some(whole) = whole.filter(|&n| n <= MAX_SAMPLES) else {
            return Err(Refusal::OverLimit(format!("more than {MAX_SAMPLES} values")));
        };
        let first_row = self.rows.directions.len();
        let mut lambdas = Vec::new();
        let (columns, firsts, read) = (self.columns, self.cells, self.read);
        for (column, &first) in columns.iter().zip(firsts) {
            let (element, each) = match column.kind {
                Kind::Numbers(element) => (element, None),
                Kind::Lists(element, each) => (element, Some(each)),
                Kind::Other { .. } => {
                    parts.skip(column.kind);
                    continue;
                }
            };
            let numbers = parts.numbers(element, count, each)?;
            // Allocation is safe from here on: the body has at least as many bytes as the rows need.
            self.rows.directions.resize(first_row + count, [0.0; 4]);
            let cells = &read.cells[first..first + each.unwrap_or(1)];
            match cells {
                [Cell::Angle(k)] => self.angles(*k, &column.name, numbers, first_row),
                [Cell::Wavelength] => lambdas = self.wavelengths(&column.name, numbers, count),
                _ if is_whole_row(cells, numbers, width) => {
                    self.rows.values.truncate(base);
                    self.whole_rows(&column.name, numbers, whole - base);
                }
                _ => {
                    self.resize(whole);
                    self.values(&column.name, cells, numbers, base);
                }
            }
        }
        self.resize(whole);
        self.file(base, first_row, &lambdas);
        self.count += count;
        Ok(())
    }

    fn resize(&mut self, whole: usize) {
        self.rows.values.resize(whole, f32::NAN);
        if self.read.has_sigma {
            self.rows.sigma.resize(whole, f32::NAN);
        }
    }

    /// Returns the nodes and buffers of a record batch. Refuses a batch whose numbers of them do not match the columns,
    /// or with overlapping buffers.
    fn parts<'b>(&self, batch: Table<'_>, body: &'b [u8]) -> Result<Parts<'b>, Refusal> {
        let (nodes, buffers) = (batch.list(1, 16)?, batch.list(2, 16)?);
        let expected = self.columns.iter().fold((0, 0), |(nodes, buffers), column| {
            let parts = column.kind.parts();
            (nodes + parts.0, buffers + parts.1)
        });
        if (nodes.len(), buffers.len()) != expected {
            return Err(Refusal::Broken(format!(
                "the record batch has {} nodes and {} buffers, expected {} and {} for the columns of the schema",
                nodes.len(),
                buffers.len(),
                expected.0,
                expected.1
            )));
        }
        let number = |value: i64| usize::try_from(value).map_err(|_| Broken);
        let nodes = (0..nodes.len()).map(|i| {
            let [length, nulls] = nodes.pair(i)?;
            Ok([number(length)?, number(nulls)?])
        });
        let nodes = nodes.collect::<Result<Vec<_>, Broken>>()?;
        let mut taken = 0;
        let mut slices = Vec::with_capacity(buffers.len());
        for i in 0..buffers.len() {
            let [offset, length] = buffers.pair(i)?;
            let (offset, length) = (number(offset)?, number(length)?);
            let end = offset.checked_add(length).ok_or(Broken)?;
            if end > body.len() || (length > 0 && offset < taken) {
                return Err(Refusal::Broken(format!(
                    "buffer {i} of the record batch goes from byte {offset} to {end} of a body of {} bytes, expected \
                     buffers within the body that do not overlap",
                    body.len()
                )));
            }
            taken = taken.max(end);
            slices.push(body.get(offset..end).ok_or(Broken)?);
        }
        Ok(Parts { nodes, buffers: slices, node: 0, buffer: 0 })
    }

    fn problem(&mut self, row: usize, name: &str, found: Option<f64>, expected: &'static str) {
        let column = self.read.names.iter().position(|known| known == name).unwrap_or(0);
        let found = found.map_or_else(|| "nothing".to_owned(), |found| Brief(found).to_string());
        let row = self.count + row + 1;
        let angle = match self.read.cells.get(column) {
            Some(Cell::Angle(k)) if expected == ANGLE => self.read.angles[*k],
            _ => None,
        };
        self.problems.add_alike(0, 0, (column, expected), || {
            let expected = angle.map_or_else(
                || expected.to_owned(),
                |Angle { range: (low, high), .. }| format!("an angle from {low} to {high} degrees"),
            );
            format!("row {row}, column {}: found {found}, expected {expected}", snippet(name))
        });
    }

    /// Reads the column of angle `k` (0 `theta_i`, 1 `phi_i`, 2 `theta_o`, 3 `phi_o`) of a record batch into the
    /// directions from index `first_row` on.
    fn angles(&mut self, k: usize, name: &str, numbers: Numbers<'_>, first_row: usize) {
        let Some(angle) = self.read.angles[k] else { return };
        let unit = if angle.radians { FLOAT32_RADIANS } else { FLOAT32_DEGREES };
        for row in 0..self.rows.directions.len() - first_row {
            let mut found = numbers.get(row);
            if numbers.element == Element::F32
                && let Some(stored) = found
            {
                let rounded = (stored / unit).round() * unit;
                // The product has rounding errors; a quotient of whole numbers has none.
                let rounded = (rounded * 1e9).round() / 1e9;
                self.rounded |= rounded != stored;
                found = Some(rounded);
            }
            if let Some(degrees) = found.and_then(|found| angle.degrees(found)) {
                self.rows.directions[first_row + row][k] = degrees;
            } else {
                self.problem(row, name, found, ANGLE);
            }
        }
    }

    fn wavelengths(&mut self, name: &str, numbers: Numbers<'_>, count: usize) -> Vec<u32> {
        let mut lambdas = Vec::with_capacity(count);
        for row in 0..count {
            match numbers.get(row).filter(|&found| found > 0.0 && found.is_finite()) {
                Some(lambda) => lambdas.push(self.rows.wavelengths.number(lambda)),
                None => self.problem(row, name, numbers.get(row), WAVELENGTH),
            }
        }
        lambdas
    }

    /// Appends the first `count` numbers of a column of float32 lists, whose order is already that of the values in the
    /// rows.
    fn whole_rows(&mut self, name: &str, numbers: Numbers<'_>, count: usize) {
        let (stored, _) = numbers.bytes.as_chunks::<4>();
        let mut infinite = false;
        self.rows.values.extend(stored.iter().take(count).map(|&bytes| {
            let value = f32::from_le_bytes(bytes);
            infinite |= value.is_infinite();
            if value.is_nan() { f32::NAN } else { value }
        }));
        if infinite {
            let base = self.rows.values.len() - count;
            let found = self.rows.values[base..].iter().enumerate().filter(|(_, value)| value.is_infinite());
            let found: Vec<(usize, f64)> = found.map(|(i, &value)| (i, value.into())).take(MOST_INFINITE).collect();
            for (i, value) in found {
                self.problem(i / self.read.width(), name, Some(value), FINITE);
            }
        }
    }

    /// Copies the numbers of a column of a record batch into their cells of every row. The values of the batch's first
    /// row start at index `base` of all values read so far.
    fn values(&mut self, name: &str, cells: &[Cell], numbers: Numbers<'_>, base: usize) {
        let width = self.read.width();
        for row in 0..(self.rows.values.len() - base) / width {
            for (lane, cell) in cells.iter().enumerate() {
                let (Cell::Value(rank) | Cell::Sigma(rank)) = *cell else { continue };
                let Some(found) = numbers.get(row * cells.len() + lane) else { continue };
                let (value, at) = (found as f32, base + row * width + rank);
                if value.is_infinite() {
                    self.problem(row, name, Some(found), FINITE);
                } else if matches!(cell, Cell::Value(_)) {
                    self.rows.values[at] = value;
                } else if value < 0.0 {
                    self.problem(row, name, Some(found), NOT_NEGATIVE);
                } else {
                    self.rows.sigma[at] = value;
                }
            }
        }
    }

    /// Assigns wavelengths and directions to the values of a record batch, and divides these by |cos θo| if the file
    /// has multiplied them by it. The values start at index `base` of all values read so far, their directions at index
    /// `first_row` of all directions.
    fn file(&mut self, base: usize, first_row: usize, lambdas: &[u32]) {
        let width = self.read.width();
        let rows = &mut self.rows;
        if self.cosine {
            let cosine = |direction: &[f64; 4]| libm::cos(direction[2].to_radians()).abs();
            let written = &rows.directions[first_row..];
            for (direction, values) in written.iter().zip(rows.values[base..].chunks_exact_mut(width)) {
                let cosine = cosine(direction);
                for value in values.iter_mut().filter(|value| !value.is_nan()) {
                    let quotient = (f64::from(*value) / cosine) as f32;
                    if cosine > 1e-9 && quotient.is_finite() {
                        *value = quotient;
                    } else {
                        rows.grazing += 1;
                        *value = f32::NAN;
                    }
                }
            }
            let uncertain = rows.sigma.get_mut(base..).unwrap_or_default();
            for (direction, sigmas) in written.iter().zip(uncertain.chunks_exact_mut(width)) {
                let cosine = cosine(direction);
                for sigma in sigmas {
                    let quotient = (f64::from(*sigma) / cosine) as f32;
                    *sigma = if quotient.is_finite() { quotient } else { f32::NAN };
                }
            }
        }
        rows.lambdas.extend_from_slice(lambdas);
        if self.read.is_wide() {
            return;
        }
        // One direction per run of rows.
        let mut kept = first_row;
        for row in first_row..rows.directions.len() {
            let direction = rows.directions[row];
            match rows.lengths.last_mut() {
                Some(length) if rows.directions[kept - 1] == direction => *length += 1,
                _ => {
                    rows.directions[kept] = direction;
                    kept += 1;
                    rows.lengths.push(1);
                }
            }
        }
        rows.directions.truncate(kept);
    }
}

/// Returns true if a column of lists holds all values of every row in stored order and as float32.
fn is_whole_row(cells: &[Cell], numbers: Numbers<'_>, width: usize) -> bool {
    let in_order = cells.len() == width && cells.iter().enumerate().all(|(i, cell)| *cell == Cell::Value(i));
    in_order && numbers.element == Element::F32 && numbers.valid.is_none()
}

const FINITE: &str = "a number within the range of float32, or NaN where it is missing";
