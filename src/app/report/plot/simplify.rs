//! Paths with no more points than an eye can see.

/// Points beyond which a path is simplified in pieces: the work grows with the square of a piece in the worst case.
const PIECE: usize = 400;

/// Points of a pixel that are worth keeping each.
const FEW: usize = 8;

/// A path that runs from left to right without most of the points in a pixel that has many: what stays is where it enters and
/// leaves, its lowest and its highest. Any other path as it is.
fn columns(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    if points.windows(2).any(|pair| pair[1].0 < pair[0].0) {
        return points.to_vec();
    }
    let mut kept = Vec::new();
    for column in points.chunk_by(|a, b| a.0.floor() == b.0.floor()) {
        if column.len() <= FEW {
            kept.extend(column);
            continue;
        }
        let last = column.len() - 1;
        let by = |better: fn(f64, f64) -> bool| {
            (0..=last).fold(0, |best, k| if better(column[k].1, column[best].1) { k } else { best })
        };
        let mut places = [0, by(|a, b| a < b), by(|a, b| a > b), last];
        places.sort_unstable();
        kept.extend(places.chunk_by(|a, b| a == b).map(|same| column[same[0]]));
    }
    kept
}

/// The points of a path without those that lie within `tolerance` of what is left (Douglas and Peucker 1973); its ends
/// stay. What swings within a pixel keeps its extremes there.
pub(super) fn simplify(points: &[(f64, f64)], tolerance: f64) -> Vec<(f64, f64)> {
    let mut kept = Vec::new();
    let mut start = 0;
    while start + 1 < points.len() {
        // Pieces share their ends.
        let end = (start + PIECE).min(points.len() - 1);
        kept.push(points[start]);
        piece(&points[start..=end], tolerance, &mut kept);
        start = end;
    }
    kept.extend(points.last());
    columns(&kept)
}

/// The points to keep between the ends of a piece.
fn piece(points: &[(f64, f64)], tolerance: f64, kept: &mut Vec<(f64, f64)>) {
    let mut stay = vec![false; points.len()];
    let mut open = vec![(0, points.len() - 1)];
    while let Some((from, to)) = open.pop() {
        let distances = (from + 1..to).map(|k| (k, distance(points[k], points[from], points[to])));
        let Some((far, distance)) = distances.max_by(|a, b| a.1.total_cmp(&b.1)) else { continue };
        if distance > tolerance {
            stay[far] = true;
            open.extend([(from, far), (far, to)]);
        }
    }
    kept.extend(points.iter().zip(stay).filter(|(_, stay)| *stay).map(|(point, _)| *point));
}

/// Distance of a point from the segment between two others.
fn distance(p: (f64, f64), a: (f64, f64), b: (f64, f64)) -> f64 {
    let (u, w) = ((b.0 - a.0, b.1 - a.1), (p.0 - a.0, p.1 - a.1));
    let square = u.0 * u.0 + u.1 * u.1;
    let along = if square > 0.0 { ((u.0 * w.0 + u.1 * w.1) / square).clamp(0.0, 1.0) } else { 0.0 };
    (w.0 - along * u.0).hypot(w.1 - along * u.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn simplified_paths_stay_close_and_keep_their_ends() {
        let wave: Vec<(f64, f64)> =
            (0..=5000).map(|k| (0.1 * f64::from(k), 80.0 * (0.02 * f64::from(k)).sin())).collect();
        let few = simplify(&wave, 0.1);
        assert!(few.len() < 800, "{}", few.len());
        assert_eq!((few.first(), few.last()), (wave.first(), wave.last()));
        for &point in &wave {
            let near = few.windows(2).map(|pair| distance(point, pair[0], pair[1])).fold(f64::INFINITY, f64::min);
            assert!(near <= 0.1 + 1e-12, "{near}");
        }
        // What swings within a pixel keeps its extremes.
        let noise: Vec<(f64, f64)> = (0..9000).map(|k| (0.01 * f64::from(k), f64::from(k % 7))).collect();
        let few = simplify(&noise, 0.1);
        assert!(
            few.len() < 8 * 91 && few.iter().any(|p| p.1 == 6.0) && few.iter().any(|p| p.1 == 0.0),
            "{}",
            few.len()
        );
        assert_eq!(simplify(&wave[..1], 0.1), &wave[..1]);
        assert!(simplify(&[], 0.1).is_empty());
        // A path that goes there and back is no segment.
        assert_eq!(simplify(&[(0.0, 0.0), (9.0, 0.0), (0.0, 0.0)], 0.1).len(), 3);
    }
}
