//! Small dense least squares under linear constraints.

use super::dense::{dot, solve};

/// Solves a linear least-squares problem with constraints. Returns the `c` that minimises |Σ cₖ·columnₖ − target|²
/// subject to Σ cₖ·constraint[j][k] = value[j]. Columns may have any scale. `None` if the columns or the constraints
/// are linearly dependent.
pub(crate) fn constrained(columns: &[Vec<f64>], target: &[f64], constraints: &[(Vec<f64>, f64)]) -> Option<Vec<f64>> {
    let (k, m) = (columns.len(), constraints.len());
    if m > k {
        return None;
    }
    // Normalise the columns: the normal equations square the condition number, and different scales would increase it.
    let scales: Vec<f64> = columns.iter().map(|c| 1.0 / dot(c, c).sqrt()).collect();
    if scales.iter().any(|s| !s.is_finite()) {
        return None;
    }
    let mut rows = vec![vec![0.0; k + m + 1]; k + m];
    for i in 0..k {
        for j in 0..k {
            rows[i][j] = dot(&columns[i], &columns[j]) * scales[i] * scales[j];
        }
        rows[i][k + m] = dot(&columns[i], target) * scales[i];
    }
    for (j, (weights, value)) in constraints.iter().enumerate() {
        let length = weights.iter().zip(&scales).map(|(w, s)| (w * s) * (w * s)).sum::<f64>().sqrt();
        if length == 0.0 {
            return None;
        }
        for i in 0..k {
            let weight = weights[i] * scales[i] / length;
            rows[k + j][i] = weight;
            rows[i][k + j] = weight;
        }
        rows[k + j][k + m] = value / length;
    }
    let mut c = solve(&mut rows)?;
    c.truncate(k);
    c.iter_mut().zip(scales).for_each(|(c, s)| *c *= s);
    c.iter().all(|c| c.is_finite()).then_some(c)
}

#[cfg(test)]
mod tests {
    use super::super::dense::subtract;
    use super::*;

    #[test]
    fn minima_are_orthogonal_to_what_is_free() {
        let columns = vec![vec![1.0, 2.0, 0.5, 4.0], vec![0.0, 1.0, -1.0, 200.0], vec![3.0, 0.1, 1.0, 1.0]];
        let target = [1.0, 1.0, 2.0, 1.0];
        let residual = |c: &[f64]| {
            let mut r = target.to_vec();
            columns.iter().zip(c).for_each(|(column, &c)| subtract(&mut r, c, column));
            r
        };
        let free = constrained(&columns, &target, &[]).unwrap();
        assert!(columns.iter().all(|column| dot(column, &residual(&free)).abs() < 1e-9));
        let constraint = (vec![1.0, 1.0, 1.0], 5.0);
        let bound = constrained(&columns, &target, std::slice::from_ref(&constraint)).unwrap();
        assert!((bound.iter().sum::<f64>() - 5.0).abs() < 1e-12);
        // The residual is a multiple of the gradient of the constraint.
        let gradient: Vec<f64> = columns.iter().map(|column| dot(column, &residual(&bound))).collect();
        assert!((gradient[0] - gradient[1]).abs() < 1e-9 && (gradient[1] - gradient[2]).abs() < 1e-9);
    }

    #[test]
    fn dependent_systems_are_refused() {
        let columns = vec![vec![1.0, 2.0], vec![2.0, 4.0]];
        assert_eq!(constrained(&columns, &[1.0, 1.0], &[]), None);
        assert_eq!(constrained(&columns[..1], &[1.0, 1.0], &[(vec![1.0], 1.0), (vec![1.0], 2.0)]), None);
        assert_eq!(constrained(&[vec![0.0, 0.0]], &[1.0, 1.0], &[]), None);
    }
}
