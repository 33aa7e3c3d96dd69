//! What is determined: values that are stated, from random starts.

#[path = "../../../tests/suite/common/forms.rs"]
mod forms;

use super::{Outcome, Rate};
use forms::{KINDS, Trial, stated, values};

/// Standard errors within which a stated value lies.
const WITHIN: f64 = 3.0;
/// Length of each of the two runs in s.
const SECONDS: f64 = 6.0;

/// Rates of `seeds` systems of each of ten kinds, each identified from two starts.
pub fn determined(seeds: u64) -> Outcome<Vec<Rate>> {
    let (mut right, mut by_start, mut all) = (0, 0, 0);
    for seed in 0..seeds {
        for kind in 0..KINDS {
            let trial = Trial::new(kind, seed, SECONDS)?;
            let found = [2 * seed, 2 * seed + 1].map(|start| trial.identified(start));
            let [one, other] = found;
            let (one, other) = (one?, other?);
            for (own, elsewhere) in [(&one, &other), (&other, &one)] {
                for value in stated(own) {
                    all += 1;
                    right += usize::from((value.value - value.by(&trial.truth)).abs() <= WITHIN * value.error);
                    let moved = (value.value - value.by(&values(elsewhere))).abs();
                    by_start += usize::from(moved > value.error);
                }
            }
        }
    }
    Ok(vec![
        Rate {
            verdict: "determined and within three errors of the truth",
            case: "constants and combinations of ten kinds of systems from random starts",
            said: right,
            of: all,
            limits: 0.97..=1.0,
        },
        Rate {
            verdict: "another value from another start",
            case: "constants and combinations of ten kinds of systems that are said to be determined",
            said: by_start,
            of: all,
            limits: 0.0..=0.02,
        },
    ])
}
