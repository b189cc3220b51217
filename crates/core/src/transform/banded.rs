//! Sparse square matrices whose inner rows repeat with period two: one level of a filter bank on n samples.

/// Sparse n × n matrix. Rows `head..tail` repeat with period two, shifted along the diagonal; all other rows are stored
/// explicitly.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Banded {
    n: usize,
    head: usize,
    tail: usize,
    /// Nonzero entries of an even and of an odd row of the matrix away from its top and bottom, where every second row
    /// has the same entries, shifted along the diagonal. Each entry is a pair (column − row, weight).
    stencils: [Vec<(i64, f64)>; 2],
    /// Nonzero entries of the first and of the last rows of the matrix, which do not repeat with a period: first rows,
    /// then last rows. Each entry is a pair (column, weight).
    edges: Vec<Vec<(usize, f64)>>,
}

/// One row of a sparse matrix.
#[derive(Clone, Copy, Debug)]
pub(super) enum Row<'a> {
    /// Row near the top or bottom of a sparse matrix, which is not the shifted copy of another row: pairs (column,
    /// value).
    Edge(&'a [(usize, f64)]),
    /// Row far from the top and bottom of a sparse matrix (one level of a wavelet filter bank): index of the row, and
    /// pairs (column − row, weight). Every second such row has the same weights, shifted along the diagonal.
    Inner(usize, &'a [(i64, f64)]),
}

impl Row<'_> {
    /// Returns the entries of one row of a sparse matrix as pairs (column, value).
    pub(super) fn iter(&self) -> impl Iterator<Item = (usize, f64)> + Clone + '_ {
        let edge = if let Row::Edge(edge) = *self { edge } else { &[] };
        let (row, inner) = if let Row::Inner(row, inner) = *self { (row as i64, inner) } else { (0, [].as_slice()) };
        edge.iter().copied().chain(inner.iter().map(move |&(offset, w)| ((row + offset) as usize, w)))
    }
}

impl Banded {
    /// Creates a sparse matrix with the given repeating rows between `head` and `tail` and the row `edge(row)`
    /// elsewhere. Rows whose repeated pattern would leave the matrix become explicit rows.
    pub(super) fn new(
        n: usize,
        (head, tail): (usize, usize),
        stencils: [Vec<(i64, f64)>; 2],
        edge: impl Fn(usize) -> Vec<(usize, f64)>,
    ) -> Self {
        let (first, last) = reach(&stencils);
        let head = head.max(usize::try_from(-first).unwrap_or(0));
        let tail = tail.min(n.saturating_sub(usize::try_from(last).unwrap_or(0)));
        let (head, tail) = if head < tail { (head, tail) } else { (n, n) };
        let edges = (0..head).chain(tail..n).map(edge).collect();
        Self { n, head, tail, stencils, edges }
    }

    /// Returns the number of rows of the matrix, which equals that of its columns.
    pub(super) fn len(&self) -> usize {
        self.n
    }

    pub(super) fn row(&self, row: usize) -> Row<'_> {
        if row < self.head {
            Row::Edge(&self.edges[row])
        } else if row < self.tail {
            Row::Inner(row, &self.stencils[row % 2])
        } else {
            Row::Edge(&self.edges[self.head + row - self.tail])
        }
    }

    pub(super) fn transposed(&self) -> Self {
        let mut stencils = [Vec::new(), Vec::new()];
        for (parity, stencil) in self.stencils.iter().enumerate() {
            for &(offset, w) in stencil {
                stencils[(parity as i64 + offset).rem_euclid(2) as usize].push((-offset, w));
            }
        }
        for stencil in &mut stencils {
            stencil.sort_by_key(|&(offset, _)| offset);
        }
        let (first, last) = reach(&self.stencils);
        // Inner columns have nonzeros in inner rows only.
        let columns = |rows: &[Vec<(usize, f64)>]| -> Vec<usize> { rows.iter().flatten().map(|&(c, _)| c).collect() };
        let above = columns(&self.edges[..self.head]).into_iter().max().map_or(0, |c| c + 1);
        let below = columns(&self.edges[self.head..]).into_iter().min().unwrap_or(self.n);
        let head = above.max(usize::try_from(self.head as i64 + last).unwrap_or(0)).min(self.n);
        let tail = below.min(usize::try_from(self.tail as i64 + first).unwrap_or(0));
        let (head, tail) = if head < tail { (head, tail) } else { (self.n, self.n) };
        let mut edges = vec![Vec::new(); head + self.n - tail];
        for row in 0..self.n {
            let untouched = |c: usize| (head..tail).contains(&c);
            if let Row::Inner(..) = self.row(row)
                && untouched((row as i64 + first) as usize)
                && untouched((row as i64 + last) as usize)
            {
                continue;
            }
            for (column, w) in self.row(row).iter() {
                if column < head {
                    edges[column].push((row, w));
                } else if column >= tail {
                    edges[column - tail + head].push((row, w));
                }
            }
        }
        Self { n: self.n, head, tail, stencils, edges }
    }
}

fn reach(stencils: &[Vec<(i64, f64)>; 2]) -> (i64, i64) {
    let offsets = || stencils.iter().flatten().map(|&(offset, _)| offset);
    (offsets().min().unwrap_or(0), offsets().max().unwrap_or(0))
}

/// Vector that is stored only within a range of indices and is zero outside of it.
#[derive(Clone, Debug, Default)]
pub(super) struct Window {
    pub(super) first: usize,
    pub(super) values: Vec<f64>,
}

impl Window {
    pub(super) fn unit(at: usize) -> Self {
        Self { first: at, values: vec![1.0] }
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        (self.first..).zip(self.values.iter().copied())
    }

    /// Returns the nonzero entries of the vector as (index, value).
    pub(super) fn entries(&self) -> Vec<(u32, f64)> {
        self.iter().filter(|(_, w)| *w != 0.0).map(|(i, w)| (i as u32, w)).collect()
    }

    /// Returns the sum of the matrix rows with the indices `place(j)`, each times entry j of this vector. The flag is
    /// true if all rows with a nonzero factor are inner ones, whose entries repeat in every second row.
    pub(super) fn through(&self, matrix: &Banded, place: impl Fn(usize) -> usize) -> (Self, bool) {
        let mut inner = true;
        let (mut first, mut last) = (usize::MAX, 0);
        for (j, x) in self.iter() {
            if x != 0.0 {
                let row = matrix.row(place(j));
                inner &= matches!(row, Row::Inner(..));
                for (column, _) in row.iter() {
                    first = first.min(column);
                    last = last.max(column);
                }
            }
        }
        if first > last {
            return (Self::default(), inner);
        }
        let mut values = vec![0.0; last + 1 - first];
        for (j, x) in self.iter() {
            if x != 0.0 {
                for (column, w) in matrix.row(place(j)).iter() {
                    values[column - first] += x * w;
                }
            }
        }
        (Self { first, values }, inner)
    }

    /// Returns the vector `self + factor · other`.
    pub(super) fn plus(&self, factor: f64, other: &Self) -> Self {
        if self.values.is_empty() {
            return Self { first: other.first, values: other.values.iter().map(|x| factor * x).collect() };
        }
        if other.values.is_empty() {
            return self.clone();
        }
        let first = self.first.min(other.first);
        let end = (self.first + self.values.len()).max(other.first + other.values.len());
        let mut values = vec![0.0; end - first];
        for (i, x) in self.iter() {
            values[i - first] += x;
        }
        for (i, x) in other.iter() {
            values[i - first] += factor * x;
        }
        Self { first, values }
    }

    /// Drops leading and trailing entries of magnitude up to `least` from the vector.
    pub(super) fn trimmed(mut self, least: f64) -> Self {
        let keep = |x: &f64| x.abs() > least;
        let end = self.values.iter().rposition(keep).map_or(0, |i| i + 1);
        self.values.truncate(end);
        let start = self.values.iter().position(keep).unwrap_or(0);
        self.values.drain(..start);
        self.first += start;
        self
    }

    pub(super) fn largest(&self) -> f64 {
        self.values.iter().fold(0.0, |m, x| m.max(x.abs()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dense(matrix: &Banded) -> Vec<Vec<f64>> {
        (0..matrix.len())
            .map(|r| {
                let mut row = vec![0.0; matrix.len()];
                for (c, w) in matrix.row(r).iter() {
                    row[c] += w;
                }
                row
            })
            .collect()
    }

    #[test]
    fn transposes_are_transposes() {
        for n in 1..40 {
            let stencils = [vec![(-2, 1.0), (0, 2.0), (3, 3.0)], vec![(-1, 4.0), (2, 5.0)]];
            let matrix = Banded::new(n, (2, n), stencils, |r| vec![(r, r as f64 + 0.5), ((r * 7) % n, -1.0)]);
            let (rows, columns) = (dense(&matrix), dense(&matrix.transposed()));
            for (r, row) in rows.iter().enumerate() {
                for (c, &w) in row.iter().enumerate() {
                    assert_eq!(columns[c][r], w, "{n} {r} {c}");
                }
            }
            let again = dense(&matrix.transposed().transposed());
            assert_eq!(rows, again);
        }
    }

    #[test]
    fn windows_add_up() {
        let a = Window { first: 3, values: vec![1.0, 2.0] };
        let b = Window { first: 1, values: vec![4.0] };
        let sum = a.plus(2.0, &b);
        assert_eq!((sum.first, sum.values), (1, vec![8.0, 0.0, 1.0, 2.0]));
        let trimmed = Window { first: 5, values: vec![0.0, 1e-20, 3.0, 0.0] }.trimmed(1e-15);
        assert_eq!((trimmed.first, trimmed.values), (7, vec![3.0]));
    }
}
