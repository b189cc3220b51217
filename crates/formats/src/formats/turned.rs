//! Transposition of tables in panels that fit the cache.

/// Number of rows and of columns of a block that is transposed at once: one cache line of float32.
const SIDE: usize = 16;
/// Number of float32 numbers in the part of a table that is transposed at once, so that it fits the cache: 32,768,
/// which take 128 KiB. Raising it beyond the cache makes transposition slower.
const PANEL: usize = 1 << 15;

/// Returns the transpose `[rows, columns]` of a table `[columns, rows]`, both contiguous.
pub(super) fn turned(source: &[f32], rows: usize, columns: usize) -> Vec<f32> {
    let mut target = vec![0.0; rows * columns];
    turn((&mut target, columns), rows, columns, |column, row, piece| {
        piece.copy_from_slice(&source[column * rows + row..][..piece.len()]);
    });
    target
}

/// Fills the table `target[row * stride + column]` from a source that is stored by columns. `read(column, row, piece)`
/// writes into `piece` the values of a column from `row` on.
pub(super) fn turn(
    (target, stride): (&mut [f32], usize),
    rows: usize,
    columns: usize,
    mut read: impl FnMut(usize, usize, &mut [f32]),
) {
    let wide = columns.clamp(1, PANEL / SIDE);
    let tall = (PANEL / wide).min(rows.next_multiple_of(SIDE)).max(SIDE) / SIDE * SIDE;
    // Pads columns by a cache line: with a stride of a power of two they would share few cache sets.
    let apart = tall + SIDE;
    let mut panel = vec![0.0; wide * apart];
    for first_row in (0..rows).step_by(tall) {
        let together = tall.min(rows - first_row);
        for first in (0..columns).step_by(wide) {
            let side_by_side = wide.min(columns - first);
            for (column, piece) in panel.chunks_exact_mut(apart).take(side_by_side).enumerate() {
                read(first + column, first_row, &mut piece[..together]);
            }
            let target = &mut target[first_row * stride + first..];
            turn_panel((&panel, apart), (target, stride), together, side_by_side);
        }
    }
}

/// Transposes a part of a table that fits the cache: `target[row * to + column] = panel[column * from + row]`.
fn turn_panel((panel, from): (&[f32], usize), (target, to): (&mut [f32], usize), rows: usize, columns: usize) {
    for first_row in (0..rows).step_by(SIDE) {
        let together = SIDE.min(rows - first_row);
        for first in (0..columns).step_by(SIDE) {
            let mut block = [[0.0; SIDE]; SIDE];
            let wide = SIDE.min(columns - first);
            for (column, piece) in panel[first * from..].chunks_exact(from).take(wide).enumerate() {
                for (row, &value) in block.iter_mut().zip(&piece[first_row..first_row + SIDE]) {
                    row[column] = value;
                }
            }
            for (row, target) in block.iter().zip(target[first_row * to..].chunks_mut(to)).take(together) {
                target[first..first + wide].copy_from_slice(&row[..wide]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_become_columns_whatever_their_number() {
        for (rows, columns) in
            [(1, 1), (1, 40), (40, 1), (16, 16), (17, 33), (50, 3), (3, 5000), (5000, 3), (600, 70), (0, 4), (4, 0)]
        {
            let source: Vec<f32> = (0..rows * columns).map(|i| i as f32).collect();
            let turned = turned(&source, rows, columns);
            for row in 0..rows {
                for column in 0..columns {
                    assert_eq!(turned[row * columns + column], source[column * rows + row], "{rows} × {columns}");
                }
            }
        }
    }
}
