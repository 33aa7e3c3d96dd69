//! Connected components of an interaction graph.

use alloc::vec::Vec;

/// Indices below `n` in connected groups, where `(first, second)` joins two; ascending, by their first member.
///
/// If a Lagrangian is a sum over such groups, coordinates of different groups do not act on each other, and motion leaves a factor for each
/// group open.
pub fn components(n: usize, pairs: impl IntoIterator<Item = (usize, usize)>) -> Vec<Vec<usize>> {
    let mut label: Vec<usize> = (0..n).collect();
    for (a, b) in pairs {
        let (low, high) = (label[a].min(label[b]), label[a].max(label[b]));
        // Most pairs of a full matrix join members of the same group.
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
