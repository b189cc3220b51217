//! Tables turned from one order of their axes to another, by blocks that stay in the cache.

/// Entries along the side of a block: as many float32 as a line of the cache holds.
const SIDE: usize = 16;

/// The table `[rows, columns]` of a table `[columns, rows]`, both without gaps.
pub(super) fn turned(source: &[f32], rows: usize, columns: usize) -> Vec<f32> {
    let mut target = vec![0.0; rows * columns];
    turn((source, rows), (&mut target, columns), rows, columns);
    target
}

/// `target[row * to + column] = source[column * from + row]`.
pub(super) fn turn((source, from): (&[f32], usize), (target, to): (&mut [f32], usize), rows: usize, columns: usize) {
    for first_row in (0..rows).step_by(SIDE) {
        let together = SIDE.min(rows - first_row);
        for first in (0..columns).step_by(SIDE) {
            let mut block = [[0.0; SIDE]; SIDE];
            let wide = SIDE.min(columns - first);
            for (column, source) in source[first * from..].chunks(from).take(wide).enumerate() {
                for (row, &value) in block.iter_mut().zip(&source[first_row..first_row + together]) {
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
        for (rows, columns) in [(1, 1), (1, 40), (40, 1), (16, 16), (17, 33), (50, 3)] {
            let source: Vec<f32> = (0..rows * columns).map(|i| i as f32).collect();
            let turned = turned(&source, rows, columns);
            for row in 0..rows {
                for column in 0..columns {
                    assert_eq!(turned[row * columns + column], source[column * rows + row]);
                }
            }
        }
    }
}
