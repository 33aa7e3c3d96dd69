//! Data from which nothing can be learned: coordinates that stand still, samples that are absurd.

use crate::running::{Folder, lnn};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

/// 400 samples at 50 Hz of two columns.
fn csv(mut row: impl FnMut(f64) -> [f64; 2]) -> String {
    let lines = (0..400).map(|k| {
        let t = 0.02 * f64::from(k);
        let [x, y] = row(t);
        format!("{t},{x},{y}\n")
    });
    format!("t,x,y\n{}", lines.collect::<String>())
}

#[test]
fn what_does_not_move_is_refused_in_plain_words() {
    let folder = Folder::new();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let constant = folder.file("constant.csv", csv(|t| [(3.0 * t).sin(), 0.25]));
    let noisy =
        folder.file("noisy.csv", csv(|t| [(3.0 * t).sin(), 0.25 + 1e-3 * rng.sample::<f64, _>(StandardNormal)]));
    for (data, words) in
        [(&constant, "y does not move: it is 0.25 in every sample"), (&noisy, "y does not move beyond its noise of")]
    {
        lnn(&["fit", data, "--coords", "x,y"]).refused(1, &[words, "leave it out of the coordinates"]);
        let run = lnn(&["check", data, "--coords", "x,y"]);
        assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""));
        assert!(
            run.stdout.contains(words) && !run.stdout.contains("NaN") && !run.stdout.contains("inf"),
            "{}",
            run.stdout
        );
        assert!(run.stdout.starts_with("A fit cannot learn from these data"), "{}", run.stdout);
        assert!(!run.stdout.contains("multiple shooting"), "{}", run.stdout);
    }
    assert_eq!(folder.names(), ["constant.csv", "noisy.csv"]);
}

#[test]
fn copies_are_named_and_refused() {
    let folder = Folder::new();
    let copy = folder.file("copy.csv", csv(|t| [(3.0 * t).sin(), 2.0 * (3.0 * t).sin() + 1.0]));
    lnn(&["fit", &copy, "--coords", "x,y"]).refused(1, &["y follows", "2.00 x"]);
    let found = lnn(&["check", &copy, "--coords", "x,y", "--json"]);
    let found: serde_json::Value = serde_json::from_str(&found.stdout).unwrap();
    assert_eq!((&found["copies"][0], found["motionless"].as_array().map(Vec::len)), (&"y".into(), Some(0)));
    assert!(found["obstacle"].as_str().is_some_and(|text| text.contains("2.00 x")), "{found}");
}

/// `check` and `fit` have one rule for what can be learned from.
#[test]
fn a_fit_begins_where_the_check_says_so() {
    let folder = Folder::new();
    let out = folder.path("out");
    let all = csv(|t| [(3.0 * t).sin(), 0.5 * (5.0 * t).cos()]);
    for (rows, good) in [(20, false), (36, false), (50, true), (80, true)] {
        let part: String = all.lines().take(rows + 1).map(|line| format!("{line}\n")).collect();
        let data = folder.file(&format!("{rows}.csv"), part);
        let found = lnn(&["check", &data, "--coords", "x,y", "--json"]);
        let found: serde_json::Value = serde_json::from_str(&found.stdout).unwrap();
        let fit = lnn(&[
            "fit",
            &data,
            "--coords",
            "x,y",
            "--hidden",
            "4",
            "--epochs",
            "1",
            "--out",
            out.to_str().unwrap(),
            "--overwrite",
        ]);
        assert_eq!((found["obstacle"].is_null(), fit.code == Some(0)), (good, good), "{rows}: {found} {}", fit.stderr);
    }
}

#[test]
fn an_absurd_sample_is_named_by_its_row() {
    let folder = Folder::new();
    // The header is row 1: the sample at 2 s stands in row 102.
    let spike =
        folder.file("spike.csv", csv(|t| [(3.0 * t).sin(), if (t - 2.0).abs() < 1e-9 { 1e155 } else { t.cos() }]));
    let run = lnn(&["check", &spike, "--coords", "x,y"]);
    assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""));
    let line = run.stdout.lines().find(|line| line.contains("outlier")).unwrap_or_else(|| panic!("{}", run.stdout));
    assert!(line.split_whitespace().any(|word| word == "102"), "{line}");
}
