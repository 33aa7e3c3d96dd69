//! Shares of the runs of an experiment, one for each of several machines or processes.

use crate::arguments::number::count;
use std::fmt;
use std::str::FromStr;

/// The `index`-th of `count` shares, from 1: the runs whose numbers, from 0, have the remainder `index - 1` when divided by `count`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    index: usize,
    count: usize,
}

impl Shard {
    /// `true` if the run with this number belongs to the share.
    pub fn holds(self, number: usize) -> bool {
        number % self.count == self.index - 1
    }

    /// `true` if there are other shares.
    pub fn is_part(self) -> bool {
        self.count > 1
    }

    /// Determines the share of a task in a Slurm array from the variables that Slurm sets; `None` outside an array. Arrays may begin at any
    /// number and have steps; a list such as `1,4,5` does not determine the shares.
    ///
    /// # Errors
    /// The problem with the variables.
    pub fn of_slurm(variable: impl Fn(&str) -> Option<String>) -> Result<Option<Self>, String> {
        let number = |part: &str| {
            let name = format!("SLURM_ARRAY_TASK_{part}");
            let Some(text) = variable(&name) else { return Ok(None) };
            let problem = || format!("{name}: expected a whole number, found {text:?}; --shard I/N chooses the share");
            text.trim().parse::<usize>().map(Some).map_err(|_| problem())
        };
        let Some(id) = number("ID")? else { return Ok(None) };
        let [count, least, most, step] = [number("COUNT")?, number("MIN")?, number("MAX")?, number("STEP")?];
        let unknown = |what: &str| format!("SLURM_ARRAY_TASK_ID={id}: {what}; --shard I/N chooses the share");
        let count = count.filter(|count| *count > 0).ok_or_else(|| unknown("no SLURM_ARRAY_TASK_COUNT beside it"))?;
        let (least, step) = (least.unwrap_or(0), step.unwrap_or(1).max(1));
        let position = |id: usize| {
            let steps = id.checked_sub(least)?;
            (steps % step == 0 && steps / step < count).then_some(steps / step)
        };
        // If the list has gaps, its last number exceeds what its count implies.
        let gaps = most.is_some_and(|most| most.saturating_sub(least) / step >= count);
        let index = position(id).filter(|_| !gaps);
        let index = index.ok_or_else(|| unknown(&format!("not one of {count} numbers in even steps from {least}")))?;
        Ok(Some(Self { index: index + 1, count }))
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split_once('/').and_then(|(index, of)| Some((count(index).ok()?, count(of).ok()?)));
        let shard = parts.filter(|(index, count)| index <= count).map(|(index, count)| Self { index, count });
        shard.ok_or_else(|| "expected I/N, two whole numbers, I from 1 to N".to_string())
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The share of variables given as `ID=3 COUNT=8`.
    fn slurm(given: &str) -> Result<Option<String>, String> {
        let value = |name: &str| {
            let part = name.strip_prefix("SLURM_ARRAY_TASK_")?;
            given.split(' ').find_map(|pair| pair.strip_prefix(part)?.strip_prefix('=')).map(str::to_string)
        };
        Shard::of_slurm(value).map(|shard| shard.map(|shard| shard.to_string()))
    }

    #[test]
    fn every_run_is_in_one_share() {
        for count in 1..6 {
            let shares: Vec<Shard> = (1..=count).map(|i| format!("{i}/{count}").parse().unwrap()).collect();
            for number in 0..20 {
                let holders: Vec<usize> = (0..count).filter(|&i| shares[i].holds(number)).collect();
                assert_eq!(holders, [number % count]);
            }
            assert_eq!(shares[0].is_part(), count > 1);
        }
        for bad in ["0/3", "4/3", "3", "1/0", "a/b", "1/2/3", "-1/2", ""] {
            assert!(bad.parse::<Shard>().unwrap_err().contains("I from 1 to N"), "{bad}");
        }
    }

    #[test]
    fn arrays_of_slurm_begin_anywhere_and_take_steps() {
        for (given, share) in [
            ("ID=0 COUNT=8 MIN=0 MAX=7 STEP=1", "1/8"),
            ("ID=7 COUNT=8 MIN=0 MAX=7", "8/8"),
            ("ID=1 COUNT=8 MIN=1 MAX=8", "1/8"),
            ("ID=8 COUNT=8 MIN=1 MAX=8", "8/8"),
            ("ID=14 COUNT=3 MIN=10 MAX=14 STEP=2", "3/3"),
            // --array=0-9:4, whose last is 8.
            ("ID=4 COUNT=3 MIN=0 MAX=9 STEP=4", "2/3"),
            ("ID=8 COUNT=3 MIN=0 MAX=8 STEP=4", "3/3"),
            ("ID=5 COUNT=1 MIN=5 MAX=5", "1/1"),
            ("ID=2 COUNT=4", "3/4"),
        ] {
            assert_eq!(slurm(given).unwrap().as_deref(), Some(share), "{given}");
        }
        assert_eq!(slurm("COUNT=8"), Ok(None));
        for bad in [
            "ID=3",
            "ID=3 COUNT=0",
            "ID=x COUNT=8",
            "ID=4 COUNT=4",
            "ID=1 COUNT=3 MIN=1 MAX=5 STEP=1",
            "ID=4 COUNT=3 MIN=1 MAX=5",
            "ID=3 COUNT=3 MIN=0 MAX=4 STEP=2",
            "ID=1 COUNT=3 MIN=2 MAX=4",
        ] {
            assert!(slurm(bad).unwrap_err().contains("--shard I/N"), "{bad}");
        }
    }
}
