//! Connected components of what acts on each other.

use alloc::vec::Vec;

/// Indices below `n` in groups that no pair joins, `(first, second)` being joined; ascending, by their first member.
///
/// Coordinates of a Lagrangian that is a sum over such groups do not act on each other, and every group has a common factor of its own that
/// motion leaves free.
pub fn components(n: usize, pairs: impl IntoIterator<Item = (usize, usize)>) -> Vec<Vec<usize>> {
    let mut label: Vec<usize> = (0..n).collect();
    for (a, b) in pairs {
        let (low, high) = (label[a].min(label[b]), label[a].max(label[b]));
        // Most pairs of a full matrix join what is one group already.
        if low < high {
            label.iter_mut().filter(|label| **label == high).for_each(|label| *label = low);
        }
    }
    let group = |root: usize| (0..n).filter(|&i| label[i] == root).collect::<Vec<_>>();
    (0..n).map(group).filter(|group| !group.is_empty()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_joined_by_others_is_one_group() {
        assert_eq!(components(5, [(4, 1), (3, 1), (0, 0)]), [vec![0], vec![1, 3, 4], vec![2]]);
        assert!(components(0, []).is_empty());
    }
}
