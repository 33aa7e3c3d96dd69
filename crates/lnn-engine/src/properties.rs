//! Settings of the property tests, both next to the code and in `tests`.

use proptest::test_runner::{Config, FileFailurePersistence, RngSeed};

/// Cases of a property that every run tries at least, if it has as many.
const LEAST_CASES: u32 = 32;

/// Settings of a property over random cases: a quarter of `cases`, all of them with `LNN_THOROUGH=1` (and as many as `PROPTEST_CASES`
/// says). They are the same in every run unless `PROPTEST_RNG_SEED` sets a seed, which the continuous integration changes in every run;
/// failed seeds are kept in a file next to the test's source.
pub fn properties(cases: u32) -> Config {
    let mut config = Config::default();
    if std::env::var_os("PROPTEST_CASES").is_none() {
        let thorough = std::env::var_os("LNN_THOROUGH").is_some_and(|value| value == "1");
        config.cases = if thorough { cases } else { cases.div_ceil(4).max(cases.min(LEAST_CASES)) };
    }
    if config.rng_seed == RngSeed::Random {
        config.rng_seed = RngSeed::Fixed(1);
    }
    config.failure_persistence = Some(Box::new(FileFailurePersistence::WithSource("regressions")));
    config
}
