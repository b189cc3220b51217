//! Functions on a hemisphere, stored at the nodes of a flattened octahedron. The three nodes around a direction are
//! found without search or trigonometry.

/// Linear RGB colour: red, green and blue.
pub(super) type Rgb = [f32; 3];
pub(super) type Vector = [f64; 3];

/// Nodes of a flattened octahedron at which a function on the hemisphere is stored: the points of a square lattice with
/// |x| + |y| ≤ n. A direction with z ≥ 0 maps to (x, y) · n / (|x| + |y| + z).
#[derive(Clone, Copy, Debug)]
pub(super) struct Lattice {
    n: i32,
}

impl Lattice {
    pub(super) fn new(n: usize) -> Self {
        Self { n: n.clamp(1, 256) as i32 }
    }

    fn side(self) -> usize {
        (2 * self.n + 1) as usize
    }

    /// Returns the number of entries of a square table that stores a function on the hemisphere at the lattice points
    /// with |x| + |y| ≤ n. The other entries of the table are only read with weight 0.
    pub(super) fn len(self) -> usize {
        self.side() * self.side()
    }

    /// Returns the points of the flattened octahedron at which a function on the hemisphere is stored: the index of
    /// each in the table of the function, and its direction.
    pub(super) fn nodes(self) -> Vec<(usize, Vector)> {
        let mut nodes = Vec::new();
        for y in -self.n..=self.n {
            for x in -self.n..=self.n {
                let z = self.n - x.abs() - y.abs();
                if z >= 0 {
                    let flat = [x, y, z].map(f64::from);
                    let length = (flat[0] * flat[0] + flat[1] * flat[1] + flat[2] * flat[2]).sqrt();
                    nodes.push((self.place(x, y), flat.map(|c| c / length)));
                }
            }
        }
        nodes
    }

    /// Returns the three nodes around a direction with z ≥ 0, as indices in the table of a function on the hemisphere,
    /// with their weights for interpolating the function. The vector need not have length 1.
    pub(super) fn corners(self, [x, y, z]: Vector) -> [(usize, f32); 3] {
        let scale = f64::from(self.n) / (x.abs() + y.abs() + z.max(0.0)).max(f64::MIN_POSITIVE);
        // Positive, so that a cast rounds down.
        let (a, b) = (x.abs() * scale, y.abs() * scale);
        let (i, j) = ((a as i32).min(self.n - 1), (b as i32).min(self.n - 1));
        let (s, t) = ((a - f64::from(i)) as f32, (b - f64::from(j)) as f32);
        let right = if x < 0.0 { -1 } else { 1 };
        let down = if y < 0.0 { -(2 * self.n + 1) } else { 2 * self.n + 1 };
        let near = (self.n + j * down.signum()) * (2 * self.n + 1) + self.n + i * right;
        let (beside, below) = ((near + right) as usize, (near + down) as usize);
        if s + t <= 1.0 {
            [(near as usize, 1.0 - s - t), (beside, s), (below, t)]
        } else {
            [((near + right + down) as usize, s + t - 1.0), (below, 1.0 - s), (beside, 1.0 - t)]
        }
    }

    /// Fills entries without a value (NaN) in the table of a function on the hemisphere with the mean of the
    /// neighbouring nodes, repeatedly from the border of the gap inward. If no entry has a value, all become 0.
    pub(super) fn fill<const N: usize>(self, table: &mut [[Rgb; N]]) {
        let nodes: Vec<(i32, i32)> = (-self.n..=self.n)
            .flat_map(|y| (-self.n..=self.n).map(move |x| (x, y)))
            .filter(|(x, y)| x.abs() + y.abs() <= self.n)
            .collect();
        let empty = |value: &[Rgb; N]| value.as_flattened().iter().any(|c| c.is_nan());
        for _ in 0..2 * self.n {
            let mut found = Vec::new();
            for &(x, y) in nodes.iter().filter(|&&(x, y)| empty(&table[self.place(x, y)])) {
                let around = [(x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)];
                let (mut sum, mut count) = ([[0.0; 3]; N], 0.0);
                for (x, y) in around.into_iter().filter(|(x, y)| x.abs() + y.abs() <= self.n) {
                    let value = table[self.place(x, y)];
                    if !empty(&value) {
                        for (sum, c) in sum.as_flattened_mut().iter_mut().zip(value.as_flattened()) {
                            *sum += c;
                        }
                        count += 1.0;
                    }
                }
                if count > 0.0 {
                    found.push((self.place(x, y), sum.map(|rgb| rgb.map(|c: f32| c / count))));
                }
            }
            if found.is_empty() {
                break;
            }
            for (place, value) in found {
                table[place] = value;
            }
        }
        table.iter_mut().filter(|value| empty(value)).for_each(|value| *value = [[0.0; 3]; N]);
    }

    fn place(self, x: i32, y: i32) -> usize {
        (y + self.n) as usize * self.side() + (x + self.n) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(lattice: Lattice, table: &[Rgb], direction: Vector) -> Rgb {
        let corners = lattice.corners(direction);
        [0, 1, 2].map(|k| corners.iter().map(|&(place, weight)| weight * table[place][k]).sum())
    }

    #[test]
    fn nodes_have_their_own_value_and_between_them_it_is_continuous() {
        for n in [1, 2, 5, 16] {
            let lattice = Lattice::new(n);
            let nodes = lattice.nodes();
            assert_eq!(nodes.len(), 2 * n * n + 2 * n + 1);
            let mut table = vec![[0.0; 3]; lattice.len()];
            for &(place, [x, y, z]) in &nodes {
                table[place] = [x as f32, y as f32, z as f32];
            }
            for &(place, d) in &nodes {
                let found = at(lattice, &table, d);
                assert!(found.iter().zip(table[place]).all(|(a, b)| (a - b).abs() < 1e-5), "{d:?}: {found:?}");
                let corners = lattice.corners([d[0] + 0.013, d[1] - 0.011, d[2]]);
                let total: f32 = corners.iter().map(|c| c.1).sum();
                assert!((total - 1.0).abs() < 1e-5 && corners.iter().all(|c| c.1 >= -1e-6), "{corners:?}");
            }
            for i in 0..999 {
                let angle = f64::from(i) * 0.02;
                let d = [0.9 * angle.cos(), 0.9 * angle.sin(), 0.2];
                let e = [0.9 * (angle + 1e-6).cos(), 0.9 * (angle + 1e-6).sin(), 0.2];
                let (a, b) = (at(lattice, &table, d), at(lattice, &table, e));
                assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-4), "{d:?}: {a:?} {b:?}");
            }
        }
    }

    #[test]
    fn holes_are_filled_from_around() {
        let lattice = Lattice::new(4);
        let mut table = vec![[[2.0; 3]]; lattice.len()];
        for (place, _) in lattice.nodes().into_iter().skip(7) {
            table[place] = [[f32::NAN; 3]];
        }
        lattice.fill(&mut table);
        assert!(lattice.nodes().iter().all(|&(place, _)| table[place] == [[2.0; 3]]));
        let mut nothing = vec![[[f32::NAN; 3]]; lattice.len()];
        lattice.fill(&mut nothing);
        assert!(nothing.iter().all(|value| *value == [[0.0; 3]]));
    }
}
