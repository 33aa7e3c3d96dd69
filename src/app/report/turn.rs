//! Angles over one turn.

use std::f64::consts::{PI, TAU};

/// The turn of an angle that an axis shows: `pi` to both sides of its middle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turn {
    middle: f64,
}

impl Turn {
    /// The turn about 0 or `pi`, whichever the angles are closer to on average: they cross its ends as rarely as may be.
    /// `None` if all of them lie within it, where there is nothing to fold.
    pub fn of(angles: impl Iterator<Item = f64> + Clone) -> Option<Self> {
        let mean: f64 = angles.clone().filter(|x| x.is_finite()).map(f64::cos).sum();
        let turn = Self { middle: if mean < 0.0 { PI } else { 0.0 } };
        let outside = |x: f64| x.is_finite() && turn.number(x) != 0.0;
        angles.into_iter().any(outside).then_some(turn)
    }

    /// Its lower end.
    pub fn low(self) -> f64 {
        self.middle - PI
    }

    /// Its upper end.
    pub fn high(self) -> f64 {
        self.middle + PI
    }

    /// Whole turns between an angle and this turn.
    fn number(self, x: f64) -> f64 {
        ((x - self.low()) / TAU).floor()
    }

    /// A path `(angle, other)` with the angle brought into this turn: where it passes an end the path goes up to the end,
    /// leaves a gap and goes on from the other end.
    pub fn fold(self, path: &[(f64, f64)]) -> Vec<(f64, f64)> {
        let mut folded: Vec<(f64, f64)> = Vec::with_capacity(path.len());
        let mut before: Option<(f64, f64)> = None;
        for &(x, y) in path {
            let turn = self.number(x);
            if let Some((u, w)) = before
                && (turn - self.number(u)).abs() == 1.0
            {
                let up = x > u;
                let end = if up { self.high() } else { self.low() };
                let passed = end + TAU * self.number(u);
                let height = if x == u { y } else { w + (passed - u) / (x - u) * (y - w) };
                let other = if up { self.low() } else { self.high() };
                folded.extend([(end, height), (f64::NAN, f64::NAN), (other, height)]);
            } else if before.is_some_and(|(u, _)| self.number(u) != turn) {
                // More than a turn between two points, or no number: no line leads there.
                folded.push((f64::NAN, f64::NAN));
            }
            folded.push((x - TAU * turn, y));
            before = Some((x, y));
        }
        folded
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_break_at_the_ends_and_nowhere_else() {
        // A pendulum that goes over the top, twice forwards and once back.
        let angle = |k: f64| 4.0 * PI * (0.5 * PI * k / 400.0).sin();
        let path: Vec<(f64, f64)> = (0..=600).map(|k| (angle(f64::from(k)), f64::from(k))).collect();
        let turn = Turn::of(path.iter().map(|p| p.0)).unwrap();
        let folded = turn.fold(&path);
        assert_eq!((turn.low(), turn.high()), (-PI, PI));
        let stretches: Vec<_> = folded.split(|p| p.0.is_nan()).collect();
        assert_eq!(stretches.len(), 4);
        for stretch in &stretches {
            assert!(stretch.len() > 1 && stretch.iter().all(|p| (-PI..=PI).contains(&p.0)), "a stub");
            // No horizontal line across: neighbours are as close as on the path.
            assert!(stretch.windows(2).all(|p| (p[1].0 - p[0].0).abs() < 0.07 && p[1].1 >= p[0].1));
        }
        for pair in stretches.windows(2) {
            let (end, begin) = (pair[0].last().unwrap(), pair[1][0]);
            assert!((end.0.abs() - PI).abs() < 1e-12 && end.0 == -begin.0 && end.1 == begin.1);
        }
    }

    #[test]
    fn turns_lie_about_the_motion() {
        // About the top: from 0 to 2 pi.
        let up = Turn::of([3.0, 4.0, 2.5, 7.0].into_iter()).unwrap();
        assert_eq!((up.low(), up.high()), (0.0, TAU));
        assert_eq!(Turn::of([3.0, 4.0, 2.5].into_iter()), None);
        assert_eq!(Turn::of([0.1, -3.0, f64::NAN].into_iter()), None);
        // Jumps leave gaps, and what is no number stays so.
        let jump =
            Turn::of([0.0, 20.0].into_iter()).unwrap().fold(&[(0.0, 1.0), (20.0, 2.0), (f64::NAN, 3.0), (0.5, 4.0)]);
        assert_eq!(jump.iter().filter(|p| p.0.is_finite()).count(), 3);
        assert!(jump.windows(2).all(|pair| pair[0].0.is_nan() || pair[1].0.is_nan()));
    }
}
