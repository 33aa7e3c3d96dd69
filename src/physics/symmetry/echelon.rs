//! Reduced echelon form of the rows of a matrix: the simplest combinations of vectors that span the same space.

/// Brings `rows` into reduced echelon form, in place: every row has a pivot 1, which the others have 0.
///
/// Columns are weighed by `sizes`, those of the functions whose coefficients they are; early columns are preferred as pivots,
/// as long as their entry is not much smaller than the largest that is left. What is below `noise` of the largest weighed entry of
/// its row becomes 0. Rows are ordered by their pivots. The first `fixed` rows take part before the others. Entries beyond the
/// weighed columns are carried along.
///
/// Returns the pivot of every row.
pub(crate) fn reduce(rows: &mut [Vec<f64>], sizes: &[f64], noise: f64, fixed: usize) -> Vec<usize> {
    let mut pivots: Vec<usize> = Vec::new();
    for done in 0..rows.len() {
        let candidates = done..if done < fixed { fixed } else { rows.len() };
        for row in &mut rows[candidates.clone()] {
            let largest = row.iter().zip(sizes).fold(0.0, |m: f64, (x, s)| m.max((x * s).abs()));
            if largest > 0.0 {
                row.iter_mut().for_each(|x| *x /= largest);
            }
        }
        let best = |column: usize| {
            let entries = candidates.clone().map(|k| (k, (rows[k][column] * sizes[column]).abs()));
            entries.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((done, 0.0))
        };
        let Some(column) = (0..sizes.len()).find(|&column| best(column).1 > 0.3) else { break };
        let row = best(column).0;
        rows.swap(done, row);
        let pivot = rows[done].clone();
        for (k, row) in rows.iter_mut().enumerate() {
            if k == done {
                let unit = pivot[column];
                row.iter_mut().for_each(|x| *x /= unit);
            } else {
                let share = row[column] / pivot[column];
                row.iter_mut().zip(&pivot).for_each(|(x, p)| *x -= share * p);
                row[column] = 0.0;
            }
        }
        pivots.push(column);
    }
    for (row, &pivot) in rows.iter_mut().zip(&pivots) {
        let largest = row.iter().zip(sizes).fold(0.0, |m: f64, (x, s)| m.max((x * s).abs()));
        for (x, size) in row.iter_mut().zip(sizes) {
            if (*x * size).abs() < noise * largest {
                *x = 0.0;
            }
        }
        let unit = row[pivot];
        if unit != 0.0 {
            row.iter_mut().for_each(|x| *x /= unit);
        }
    }
    let fixed = fixed.min(rows.len());
    let order = |row: &Vec<f64>| row.iter().position(|x| *x != 0.0);
    rows[..fixed].sort_by_key(order);
    rows[fixed..].sort_by_key(order);
    let pivot = |k: usize| {
        let lone = |column: &usize| rows.iter().enumerate().all(|(l, row)| row[*column] == f64::from(u8::from(k == l)));
        (0..sizes.len()).find(lone)
    };
    (0..rows.len()).filter_map(pivot).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_become_simple() {
        // Combinations of (1, 0, 2, 0) and (0, 1, 0, -1), with rounding.
        let mut rows = vec![vec![0.6, 0.8, 1.2, -0.8], vec![0.8, -0.6, 1.6, 0.6 + 1e-15]];
        assert_eq!(reduce(&mut rows, &[1.0; 4], 1e-12, 0), [0, 1]);
        let near = |row: &[f64], other: &[f64]| row.iter().zip(other).all(|(a, b)| (a - b).abs() < 1e-14);
        assert!(near(&rows[0], &[1.0, 0.0, 2.0, 0.0]) && near(&rows[1], &[0.0, 1.0, 0.0, -1.0]), "{rows:?}");
        assert_eq!((rows[0][1], rows[1][0], rows[1][2]), (0.0, 0.0, 0.0));
    }
}
