//! Connected components: which of `n` things act on each other, directly or through others.

/// Groups of `0..n` that no coupling joins: each ascending, in the order of their first members. A coupling that holds in either order
/// joins both.
pub(crate) fn components(n: usize, coupled: impl Fn(usize, usize) -> bool) -> Vec<Vec<usize>> {
    let mut seen = vec![false; n];
    let mut groups = Vec::new();
    for first in 0..n {
        if std::mem::replace(&mut seen[first], true) {
            continue;
        }
        let (mut group, mut next) = (vec![first], 0);
        while let Some(&i) = group.get(next) {
            next += 1;
            for j in 0..n {
                if !seen[j] && (coupled(i, j) || coupled(j, i)) {
                    seen[j] = true;
                    group.push(j);
                }
            }
        }
        group.sort_unstable();
        groups.push(group);
    }
    groups
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chains_join_and_nothing_else_does() {
        let of = |n: usize, pairs: &[(usize, usize)]| components(n, |i, j| pairs.contains(&(i, j)));
        assert_eq!(of(0, &[]), Vec::<Vec<usize>>::new());
        assert_eq!(of(3, &[]), [[0], [1], [2]]);
        assert_eq!(of(5, &[(4, 2), (0, 4), (3, 3)]), [vec![0, 2, 4], vec![1], vec![3]]);
    }
}
