//! First runs of a new user: a file as people have it, `lnn check`, and the command that it prints; no second attempt is needed.

use crate::running::{Folder, Run, lnn};
use std::fmt::Write;

/// An angle of a pendulum of 0.62 m every 10 ms, from rest at `start` rad, with the rounding of its file as noise.
fn swing(start: f64, rows: usize) -> Vec<(f64, f64)> {
    let (mut angle, mut speed) = (start, 0.0);
    let step = |angle: &mut f64, speed: &mut f64| {
        for _ in 0..100 {
            *speed -= 1e-4 * 9.81 / 0.62 * angle.sin();
            *angle += 1e-4 * *speed;
        }
    };
    let mut row = |k: usize| {
        let now = (0.01 * k as f64, angle);
        step(&mut angle, &mut speed);
        now
    };
    (0..rows).map(&mut row).collect()
}

/// `lnn check` with these arguments, and then the first command that it prints, made small by `more`.
fn first_run(folder: &Folder, arguments: &[&str], more: &[&str]) -> (Run, Run) {
    let check = lnn(&[&["check"], arguments].concat());
    assert_eq!((check.code, check.stderr.as_str()), (Some(0), ""), "{}", check.stdout);
    let next = check.stdout.lines().skip_while(|line| *line != "next:").nth(1).unwrap_or_default().trim().to_string();
    let words = next.strip_prefix("lnn ").unwrap_or_else(|| panic!("no command: {}", check.stdout));
    assert!(!words.contains('\''), "quoted words need a shell: {words}");
    let out = folder.path("fitted").display().to_string();
    let mut words: Vec<&str> = words.split(' ').collect();
    if words[0] == "fit" {
        words.extend(["--epochs", "2", "--hidden", "8", "--out", &out]);
    }
    words.extend(more);
    let run = lnn(&words);
    assert_eq!(run.code, Some(0), "{next}: {}", run.stderr);
    (check, run)
}

#[test]
fn a_table_of_a_german_spreadsheet_becomes_a_formula() {
    let folder = Folder::new();
    // Latin-1, semicolons, decimal commas, units in brackets.
    let mut text = b"Zeit [ms];Winkel [deg];L\xe4nge [cm]\r\n".to_vec();
    for (t, angle) in swing(1.2, 800) {
        let line = format!("{:.0};{:.3};62,0\r\n", 1000.0 * t, angle.to_degrees());
        text.extend(line.replace('.', ",").bytes());
    }
    let file = folder.file("pendel.csv", text);
    let (check, formula) = first_run(&folder, &[&file], &["--bootstraps", "1", "--json"]);
    for part in ["decimal commas", "Windows-1252", "it has one value", "a formula explains this motion"] {
        assert!(check.stdout.contains(part), "{part}: {}", check.stdout);
    }
    let found: serde_json::Value = serde_json::from_str(&formula.stdout).unwrap();
    let gravity = found["terms"].as_array().unwrap().iter().find(|term| term["term"] == "cos(Winkel)").unwrap();
    // L = Winkel_dot^2/2 + g/l cos(Winkel).
    let (coefficient, error) = (gravity["coefficient"].as_f64().unwrap(), gravity["standard_error"].as_f64().unwrap());
    assert!((coefficient - 9.81 / 0.62).abs() < 5.0 * error.max(1e-3), "{coefficient} +- {error}");
}

#[test]
fn a_bob_in_a_tracker_s_table_is_learned_under_its_rod() {
    let folder = Folder::new();
    // A byte order mark, the name of the track, tabs, two runs that a text tells apart.
    let mut text = "\u{feff}bob A\ntrial\ttime\tx\ty\n".to_string();
    for (k, start) in [1.2, 0.7].into_iter().enumerate() {
        for (t, angle) in swing(start, 500) {
            writeln!(text, "swing{k}\t{t:.2}\t{:.4}\t{:.4}", 0.62 * angle.sin(), -0.62 * angle.cos()).unwrap();
        }
    }
    let file = folder.file("bob.tsv", text);
    let (check, fit) = first_run(&folder, &[&file], &["--json"]);
    assert!(
        check.stdout.contains("--trajectory trial") && check.stdout.contains("--constraints find"),
        "{}",
        check.stdout
    );
    assert!(serde_json::from_str::<serde_json::Value>(&fit.stdout).is_ok());
    let page = folder.path("rod.html").display().to_string();
    let found = lnn(&["constraints", &file, "--html", &page]);
    assert_eq!(found.code, Some(0), "{}", found.stderr);
    assert_eq!(std::fs::read_to_string(&page).unwrap().matches("<figure").count(), 1);
}

#[test]
fn runs_side_by_side_are_read() {
    let folder = Folder::new();
    let mut text = "t,x1,x2\n".to_string();
    for ((t, a), (_, b)) in swing(0.4, 600).into_iter().zip(swing(0.9, 600)) {
        writeln!(text, "{t:.2},{a:.5},{b:.5}").unwrap();
    }
    let file = folder.file("wide.csv", text);
    let (check, _) = first_run(&folder, &[&file, "--coords", "x", "--wide"], &[]);
    assert!(check.stdout.contains("2 trajectories") && check.stdout.contains("--wide"), "{}", check.stdout);
    lnn(&["check", &file, "--wide"]).refused(2, &["--coords"]);
}

#[test]
fn what_does_not_accelerate_gets_no_command() {
    let folder = Folder::new();
    let mut text = "frame,t,x\n".to_string();
    for k in 0..400 {
        // Rounding is the noise.
        writeln!(text, "{k},{:.2},{:.3}", 0.01 * f64::from(k), 0.3 + 0.0071 * f64::from(k)).unwrap();
    }
    let file = folder.file("line.csv", text);
    let check = lnn(&["check", &file]);
    assert_eq!(check.code, Some(0));
    assert!(!check.stdout.contains("lnn fit") && check.stdout.contains("accelerates"), "{}", check.stdout);
    let found: serde_json::Value = serde_json::from_str(&lnn(&["check", &file, "--json"]).stdout).unwrap();
    assert_eq!((&found["next"], &found["guessed"][0]["meaning"]), (&"record".into(), &"left out".into()));
}

#[test]
fn a_fit_without_columns_says_what_it_takes_and_what_explains() {
    let folder = Folder::new();
    let mut text = "t,theta\n".to_string();
    swing(1.1, 800).into_iter().for_each(|(t, angle)| writeln!(text, "{t:.2},{angle:.5}").unwrap());
    let (file, out) = (folder.file("angle.csv", text), folder.path("fit").display().to_string());
    let fit = lnn(&["fit", &file, "--epochs", "1", "--hidden", "4", "--out", &out]);
    assert_eq!(fit.code, Some(0), "{}", fit.stderr);
    for part in ["coordinates theta, angles theta", "a formula explains this motion", "lnn formula"] {
        assert!(fit.stderr.contains(part), "{part}: {}", fit.stderr);
    }
}
