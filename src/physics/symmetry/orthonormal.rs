//! Columns made orthonormal one after the other; those that depend on the ones before are left out.

/// Orthonormal columns and how they are made of those that were kept.
#[derive(Clone, Debug)]
pub(crate) struct Orthonormal {
    /// The columns, each of length 1.
    pub columns: Vec<Vec<f64>>,
    /// Places of the columns that were kept among those given.
    pub kept: Vec<usize>,
    /// Orthonormal column `k` is the sum of `mix[k][j]` times the kept column `j`, `j <= k`.
    pub mix: Vec<Vec<f64>>,
}

/// Gram-Schmidt, twice for every column. A column counts as dependent if less than `least` of its length is left.
pub(crate) fn orthonormal(given: &[Vec<f64>], least: f64) -> Orthonormal {
    let mut result = Orthonormal { columns: Vec::new(), kept: Vec::new(), mix: Vec::new() };
    for (place, column) in given.iter().enumerate() {
        let length = norm(column);
        let (mut rest, mut shares) = (column.clone(), vec![0.0; result.columns.len()]);
        for _ in 0..2 {
            for (share, known) in shares.iter_mut().zip(&result.columns) {
                let along = dot(known, &rest);
                *share += along;
                add(&mut rest, known, -along);
            }
        }
        let left = norm(&rest);
        // A column of zeros has nothing to give.
        if left <= least * length {
            continue;
        }
        let mut mix = vec![0.0; result.columns.len() + 1];
        for (share, known) in shares.iter().zip(&result.mix) {
            mix.iter_mut().zip(known).for_each(|(sum, x)| *sum -= share * x);
        }
        mix[result.columns.len()] = 1.0;
        mix.iter_mut().for_each(|x| *x /= left);
        rest.iter_mut().for_each(|x| *x /= left);
        result.columns.push(rest);
        result.kept.push(place);
        result.mix.push(mix);
    }
    result
}

impl Orthonormal {
    /// The columns of the kept `given`, mixed as the orthonormal ones are.
    pub fn mixed(&self, given: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let one = |mix: &Vec<f64>| {
            let mut sum = vec![0.0; given.first().map_or(0, Vec::len)];
            mix.iter().zip(&self.kept).for_each(|(x, &place)| add(&mut sum, &given[place], *x));
            sum
        };
        self.mix.iter().map(one).collect()
    }

    /// Coefficients of the columns that were given, `(given)`, from those of the orthonormal ones.
    pub fn given(&self, coefficients: &[f64], given: usize) -> Vec<f64> {
        let mut result = vec![0.0; given];
        for (x, mix) in coefficients.iter().zip(&self.mix) {
            mix.iter().zip(&self.kept).for_each(|(m, &place)| result[place] += x * m);
        }
        result
    }

    /// Coefficients of the orthonormal columns that come closest to a column.
    pub fn along(&self, column: &[f64]) -> Vec<f64> {
        self.columns.iter().map(|known| dot(known, column)).collect()
    }

    /// Takes what lies along the orthonormal columns out of a column.
    pub fn remove(&self, column: &mut [f64]) {
        for _ in 0..2 {
            for known in &self.columns {
                let along = dot(known, column);
                add(column, known, -along);
            }
        }
    }
}

/// Sum of products.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    // Eight sums, which a compiler makes vectors of.
    let mut sums = [0.0; 8];
    let (a8, a1) = a.as_chunks::<8>();
    let (b8, b1) = b.as_chunks::<8>();
    for (a, b) in a8.iter().zip(b8) {
        for l in 0..8 {
            sums[l] += a[l] * b[l];
        }
    }
    sums.iter().sum::<f64>() + a1.iter().zip(b1).map(|(a, b)| a * b).sum::<f64>()
}

/// Euclidean length.
pub(crate) fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

/// `a += factor b`.
pub(crate) fn add(a: &mut [f64], b: &[f64], factor: f64) {
    a.iter_mut().zip(b).for_each(|(a, b)| *a += factor * b);
}
