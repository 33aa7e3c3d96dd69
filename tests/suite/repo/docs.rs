//! README and pages of `docs`: length, links, commands, options, keys. `LNN_WRITE_DOCS=1` writes the generated part anew.

use crate::running::{Folder, lnn};
use lnn_cli::check_arguments;
use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

/// Lines around what is generated from the table of configuration keys.
const GENERATED: [&str; 2] =
    ["<!-- generated from src/learning/configuration/config.rs -->\n\n", "<!-- end of the generated part -->\n"];

/// The same around the keys of a fit.
const OF_A_FIT: [&str; 2] =
    ["<!-- generated from src/app/pipeline/fit_config.rs -->\n\n", "<!-- end of the generated part of fits -->\n"];

fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
}

fn read(path: &str) -> String {
    fs::read_to_string(root().join(path)).unwrap_or_else(|e| panic!("{path}: {e}"))
}

/// Every page by its path from the root.
fn pages() -> BTreeMap<String, String> {
    let mut pages: BTreeMap<String, String> = ["README.md", "CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md"]
        .map(|path| (path.to_string(), read(path)))
        .into();
    for entry in fs::read_dir(root().join("docs")).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        if name.ends_with(".md") {
            pages.insert(format!("docs/{name}"), read(&format!("docs/{name}")));
        }
    }
    assert!(pages.len() > 12, "{:?}", pages.keys());
    pages
}

/// Lines outside of code blocks, and lines of code blocks with the language of the block.
fn lines(page: &str) -> (Vec<&str>, Vec<(&str, &str)>) {
    let (mut prose, mut code, mut language) = (Vec::new(), Vec::new(), None);
    for line in page.lines() {
        match (line.strip_prefix("```"), language) {
            (Some(_), Some(_)) => language = None,
            (Some(name), None) => language = Some(name),
            (None, Some(name)) => code.push((name, line)),
            (None, None) => prose.push(line),
        }
    }
    (prose, code)
}

/// A line without its code spans, and the code spans.
fn spans(line: &str) -> (String, Vec<&str>) {
    let pieces: Vec<&str> = line.split('`').collect();
    let text = pieces.iter().step_by(2).copied().collect::<Vec<_>>().join("`");
    (text, pieces.into_iter().skip(1).step_by(2).collect())
}

/// The anchor of a heading, as the hosts of repositories and rustdoc make it.
fn anchor(heading: &str) -> String {
    let kept = heading.trim().to_lowercase();
    let kept = kept.chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
    kept.map(|c| if c == ' ' { '-' } else { c }).collect()
}

fn anchors(page: &str) -> BTreeSet<String> {
    let headings = lines(page).0.into_iter().filter(|line| line.starts_with('#'));
    headings.map(|line| anchor(line.trim_start_matches('#'))).collect()
}

/// What stands between `open` and the next `close`, at every place.
fn between<'a>(text: &'a str, open: &str, close: char) -> Vec<&'a str> {
    text.split(open).skip(1).filter_map(|rest| rest.split(close).next()).collect()
}

/// Targets of links in the text and in definitions, and labels that are used without a definition.
fn links(page: &str) -> (Vec<String>, Vec<String>) {
    let (mut targets, mut labels, mut defined) = (Vec::new(), Vec::new(), BTreeSet::new());
    for line in lines(page).0 {
        let text = spans(line).0;
        if let Some((label, target)) = text.strip_prefix('[').and_then(|rest| rest.split_once("]: ")) {
            defined.insert(label.to_string());
            targets.push(target.trim().to_string());
            continue;
        }
        targets.extend(between(&text, "](", ')').into_iter().map(String::from));
        labels.extend(between(&text, "][", ']').into_iter().map(String::from));
    }
    labels.retain(|label| !defined.contains(label));
    (targets, labels)
}

/// What is wrong with a link of a page.
fn dead(pages: &BTreeMap<String, String>, page: &str, target: &str) -> Option<String> {
    if target.starts_with("https://") {
        return None;
    }
    let (path, fragment) = target.split_once('#').map_or((target, None), |(path, part)| (path, Some(part)));
    let mut place = PathBuf::from(page);
    if !path.is_empty() {
        place.pop();
        for part in path.split('/') {
            match part {
                ".." => _ = place.pop(),
                part => place.push(part),
            }
        }
    }
    let place = place.to_str().unwrap().replace('\\', "/");
    if !root().join(&place).exists() {
        return Some(format!("{page}: {target}: no such file"));
    }
    let found = |fragment: &str| pages.get(&place).is_some_and(|text| anchors(text).contains(fragment));
    fragment.filter(|part| !found(part)).map(|_| format!("{page}: {target}: no such heading"))
}

/// Shell lines of a page: in blocks without their comments, and in code spans.
fn commands(page: &str) -> Vec<String> {
    let (prose, code) = lines(page);
    let blocks = code.into_iter().filter(|(language, _)| *language == "sh").map(|(_, line)| line);
    let blocks = blocks.map(|line| line.split(" #").next().unwrap_or_default().trim().to_string());
    let spans = prose.into_iter().flat_map(|line| spans(line).1).map(|span| span.replace("\\|", "|"));
    let all: Vec<String> = blocks.chain(spans).collect();
    let ours = |line: &&String| ["lnn ", "cargo "].iter().any(|program| line.starts_with(program));
    all.iter().filter(ours).cloned().collect()
}

/// Arguments of `lnn`, if the line calls it.
fn arguments(line: &str) -> Option<Vec<String>> {
    let rest = line.strip_prefix("lnn ").or_else(|| line.strip_prefix("cargo run --release -- "))?;
    Some(rest.split_whitespace().map(String::from).collect())
}

/// Words that stand for something, replaced by what they may stand for.
fn example(word: &str) -> String {
    let word = word.split('|').next().unwrap_or_default();
    let known = [("SYSTEM", "double-pendulum"), ("MODEL", "model.safetensors"), ("N", "1"), ("NAME", "quick")];
    known.iter().find(|(name, _)| *name == word).map_or(word, |(_, value)| *value).to_string()
}

/// What is wrong with arguments of the program. A name of a command alone speaks of the command; it is asked for help.
fn misused(given: &[String]) -> Option<String> {
    if given[0] == "COMMAND" {
        return None;
    }
    let mut words: Vec<String> = given.iter().map(|word| example(word)).collect();
    if words.len() == 1 {
        words.push("--help".to_string());
    }
    let line = ["lnn".to_string()].into_iter().chain(words).map(OsString::from);
    check_arguments(line).err().map(|error| format!("lnn {}: {error}", given.join(" ")))
}

/// Targets that Cargo knows, by kind, and modules of the test program.
fn cargo_targets() -> BTreeMap<&'static str, BTreeSet<String>> {
    let manifest = |path: &str| -> toml::Table { read(path).parse().unwrap() };
    let (library, program) = (manifest("Cargo.toml"), manifest("crates/lnn-cli/Cargo.toml"));
    let named = |manifest: &toml::Table, kind: &str| -> BTreeSet<String> {
        let entries = manifest[kind].as_array().unwrap().iter();
        entries.map(|entry| entry["name"].as_str().unwrap().to_string()).collect()
    };
    let files = fs::read_dir(root().join("examples")).unwrap().map(|entry| entry.unwrap().path());
    let examples = files.filter(|path| path.extension().is_some_and(|e| e == "rs"));
    let examples = examples.map(|path| path.file_stem().unwrap().to_str().unwrap().to_string()).collect();
    let features = library["features"].as_table().unwrap().keys().cloned().collect();
    BTreeMap::from([
        ("--bench", named(&library, "bench")),
        ("--test", named(&program, "test")),
        ("--example", examples),
        ("--features", features),
    ])
}

/// Names that a filter of tests may hold: files, folders and functions of the test programs.
fn test_sources(folder: &Path, found: &mut String) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        *found += &format!(" {} ", path.file_stem().unwrap().to_str().unwrap());
        if path.is_dir() {
            test_sources(&path, found);
        } else {
            *found += &fs::read_to_string(&path).unwrap_or_default();
        }
    }
}

#[test]
fn no_link_is_dead() {
    let pages = pages();
    let (mut faults, mut count) = (Vec::new(), 0);
    for (name, text) in &pages {
        let (targets, labels) = links(text);
        count += targets.len();
        faults.extend(targets.iter().filter_map(|target| dead(&pages, name, target)));
        faults.extend(labels.iter().map(|label| format!("{name}: [{label}] is not defined")));
    }
    assert!(count > 40, "only {count} links found");
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// What rustdoc makes of the labels of pages, in `src/docs.rs`, is what they are in the files.
#[test]
fn rustdoc_has_the_links_of_the_files() {
    let source = read("src/docs.rs");
    let mut faults = Vec::new();
    for (name, text) in pages().iter().filter(|(name, _)| name.starts_with("docs/")) {
        if !source.contains(&format!("\"{}\";", &name["docs/".len()..])) {
            faults.push(format!("src/docs.rs leaves {name} out"));
        }
        for line in lines(text).0 {
            let Some((label, target)) = line.strip_prefix('[').and_then(|rest| rest.split_once("]: ")) else {
                continue;
            };
            let module = target.replacen(".md", "", 1).replace('#', "\n").replace('-', "_");
            let (module, fragment) = module.split_once('\n').unwrap_or((&module, ""));
            let fragment = if fragment.is_empty() { String::new() } else { format!("#{}", fragment.replace('_', "-")) };
            if !source.contains(&format!("\"[{label}]: crate::docs::{module}{fragment}\\n\"")) {
                faults.push(format!("src/docs.rs does not lead [{label}] to {target}"));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn every_command_of_the_pages_is_understood() {
    let (targets, mut sources) = (cargo_targets(), String::new());
    test_sources(&root().join("tests"), &mut sources);
    let (mut faults, mut programs, mut cargo) = (Vec::new(), 0, 0);
    for (name, text) in pages() {
        for line in commands(&text) {
            if let Some(given) = arguments(&line) {
                programs += 1;
                faults.extend(misused(&given).map(|fault| format!("{name}: {fault}")));
                continue;
            }
            cargo += 1;
            let words: Vec<&str> = line.split_whitespace().take_while(|word| *word != "--").collect();
            for pair in words.windows(2) {
                let known = targets.get(pair[0]).is_none_or(|known| pair[1] == "NAME" || known.contains(pair[1]));
                if !known {
                    faults.push(format!("{name}: {line}: no {} {}", &pair[0][2..], pair[1]));
                }
            }
            if let Some(at) = words.iter().position(|word| *word == "--test")
                && let Some(filter) = words.get(at + 2)
                && !filter.trim_end_matches("::").split("::").all(|part| sources.contains(part))
            {
                faults.push(format!("{name}: {line}: no test is called {filter}"));
            }
        }
    }
    assert!(programs > 40 && cargo > 20, "only {programs} and {cargo} commands found");
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// The commands of the README run, on the model and the recording that ship with the crate; what trains does so for a moment.
#[test]
fn the_commands_of_the_readme_run() {
    let folder = Folder::new();
    let model = folder.path("model.safetensors");
    fs::copy(root().join("examples/data/double_pendulum.safetensors"), &model).unwrap();
    let place = |name: &str| folder.path(name).to_str().unwrap().to_string();
    let readme = read("README.md");
    let shell = lines(&readme).1.into_iter().filter(|(language, _)| *language == "sh").map(|(_, line)| line);
    let mut run = Vec::new();
    for line in shell {
        let Some(mut words) = arguments(line.split(" #").next().unwrap()) else { continue };
        for word in &mut words {
            if word.ends_with("model.safetensors") {
                *word = place("model.safetensors");
            } else if [".csv", ".html"].iter().any(|end| word.ends_with(end)) && !word.starts_with("examples/") {
                *word = place(word);
            }
        }
        let small: &[&str] = match words[0].as_str() {
            "train" => &["--config", "examples/data/double_pendulum.toml", "--epochs", "1", "--out", "trained"],
            "fit" => &["--epochs", "2", "--shooting-epochs", "1", "--out", "fitted"],
            _ => &[],
        };
        words.extend(small.iter().map(|word| if word.ends_with("ed") { place(word) } else { word.to_string() }));
        let result = lnn(&words.iter().map(String::as_str).collect::<Vec<_>>());
        assert_eq!(result.code, Some(0), "{line}: {}", result.stderr);
        run.push(words[0].clone());
    }
    assert_eq!(run, ["train", "rollout", "evaluate", "page", "check", "formula", "fit"]);
    for file in ["trained/report.html", "motion.csv", "evaluation/report.html", "fitted/report.html"] {
        assert!(folder.path(file).exists(), "no {file}: {:?}", folder.names());
    }
    // The pictures of the README are files that its command writes: of the same size, with the same words.
    for (shown, drawn) in [("docs/motion.svg", "trace_start1.svg"), ("docs/metric.svg", "det_mass_matrix.svg")] {
        assert!(readme.contains(&format!("]({shown})")) && readme.contains(drawn), "{shown}, {drawn}");
        let (shown, drawn) = (read(shown), fs::read_to_string(folder.path("evaluation").join(drawn)).unwrap());
        let frame = |svg: &str| {
            let titles =
                svg.split("font-weight=\"600\">").skip(1).map(|rest| rest.split('<').next().unwrap().to_string());
            (svg.lines().next().unwrap().to_string(), titles.collect::<Vec<String>>())
        };
        assert_eq!(frame(&shown), frame(&drawn));
        assert!(shown.len() < 100_000 && !frame(&shown).1.is_empty());
    }
}

/// Every command has a section in the guide, and every option of it stands there.
#[test]
fn every_option_is_in_the_guide() {
    let guide = read("docs/commands.md");
    let overview = lnn(&["--help"]).stdout;
    let listed = overview.split("Commands:").nth(1).unwrap().split("\n\n").next().unwrap();
    let names: Vec<&str> =
        listed.lines().filter_map(|line| line.split_whitespace().next()).filter(|name| *name != "help").collect();
    assert!(names.len() >= 8, "{names:?}");
    let mut faults = Vec::new();
    for name in names {
        let Some((_, rest)) = guide.split_once(&format!("\n## lnn {name}\n")) else {
            faults.push(format!("no section `## lnn {name}`"));
            continue;
        };
        let section = rest.split("\n## ").next().unwrap();
        let help = lnn(&[name, "--help"]).stdout;
        for line in help.lines().map(str::trim_start).filter(|line| line.starts_with('-')) {
            let option = line.split_whitespace().find(|word| word.starts_with("--")).unwrap_or_default();
            let option: String = option.chars().take_while(|c| c.is_alphanumeric() || *c == '-').collect();
            let shared = name == "fit" && guide.contains(&format!("| `{option} ")) && section.contains("lnn-check");
            let stands = [" ", "`", "="].iter().any(|end| section.contains(&format!("`{option}{end}")));
            if option.len() > 2 && option != "--help" && !stands && !shared {
                faults.push(format!("lnn {name}: {option} is not in the guide"));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// The reference of configurations is the table of the types; its example is read.
#[test]
fn the_configuration_reference_is_that_of_the_types() {
    let path = "docs/configuration.md";
    let page = read(path);
    let of_training = lnn(&["train", "kepler", "--print-config=markdown"]).stdout;
    // A fit's reference goes on with that of a training.
    let whole = lnn(&["fit", "data.csv", "--coords", "q", "--print-config=markdown"]).stdout;
    let of_fit = whole.strip_suffix(&of_training).expect("the keys of a training follow those of a fit");
    assert!(of_fit.contains("| `horizon` |") && of_fit.contains("| `periodic` |"), "{of_fit}");
    let mut written = page.clone();
    for ([begin, end], made) in [(GENERATED, of_training.as_str()), (OF_A_FIT, of_fit)] {
        let (before, rest) = written.split_once(begin).expect("the generated part begins");
        let (_, after) = rest.split_once(end).expect("the generated part ends");
        written = [before, begin, made, end, after].concat();
    }
    if std::env::var_os("LNN_WRITE_DOCS").is_some() {
        fs::write(root().join(path), &written).unwrap();
    } else {
        assert!(page == written, "{path} is old: LNN_WRITE_DOCS=1 cargo test --test suite repo::docs writes it anew");
    }
    let toml: Vec<&str> =
        lines(&page).1.into_iter().filter(|(language, _)| *language == "toml").map(|(_, line)| line).collect();
    let config: lnn::configuration::Config =
        lnn_cli::parse_config(&toml.join("\n")).expect("the example is a configuration");
    config.validate(2).unwrap();
}

/// Continuous integration runs what `.ci/run` runs, and the oldest compiler that the crate promises. What it takes from others is named by a
/// commit, which nobody can change afterwards.
#[test]
fn continuous_integration_runs_every_check() {
    let workflow = read(".github/workflows/ci.yml");
    assert!(workflow.contains("run: .ci/run") && workflow.contains("rust-version"), "{workflow}");
    let mut actions = Vec::new();
    for entry in fs::read_dir(root().join(".github/workflows")).unwrap() {
        let text = fs::read_to_string(entry.unwrap().path()).unwrap();
        actions.extend(text.lines().filter_map(|line| line.split_once("uses: ")).map(|(_, action)| action.to_string()));
    }
    let pinned = |action: &&String| {
        let (commit, version) =
            action.split_once('@').and_then(|(_, rest)| rest.split_once(" # v")).unwrap_or_default();
        commit.len() == 40 && commit.chars().all(|c| c.is_ascii_hexdigit()) && !version.is_empty()
    };
    let loose: Vec<&String> = actions.iter().filter(|action| !pinned(action)).collect();
    assert!(actions.len() > 5 && loose.is_empty(), "{loose:?}");
}

/// One version in all files that state it.
#[test]
fn the_version_is_the_same_everywhere() {
    let version = env!("CARGO_PKG_VERSION");
    for path in ["python/Cargo.toml", "python/pyproject.toml", "Cargo.toml"] {
        assert!(read(path).contains(&format!("\nversion = \"{version}\"\n")), "{path}");
    }
    assert!(read("CITATION.cff").contains(&format!("\nversion: {version}\n")));
    assert!(read("CHANGELOG.md").contains(&format!("\n## {version}")));
}

#[test]
fn the_search_finds_what_it_looks_for() {
    let page = "# A b-C: `d`\n[x](docs/none.md) `[y](z)` [w][v] [u][t]\n```sh\nlnn train --sed 3 # [q](r)\n```\n[t]: #a-b-c-d\n";
    assert_eq!(links(page), (vec!["docs/none.md".to_string(), "#a-b-c-d".to_string()], vec!["v".to_string()]));
    assert_eq!(anchors(page), BTreeSet::from(["a-b-c-d".to_string()]));
    let pages = BTreeMap::from([("README.md".to_string(), page.to_string())]);
    assert!(dead(&pages, "README.md", "docs/none.md").is_some() && dead(&pages, "README.md", "#a-b").is_some());
    assert!(
        dead(&pages, "README.md", "#a-b-c-d").is_none() && dead(&pages, "docs/method.md", "../Cargo.toml").is_none()
    );
    assert_eq!(commands(page), ["lnn train --sed 3"]);
    assert!(misused(&arguments("lnn train --sed 3").unwrap()).is_some());
    assert!(misused(&arguments("lnn nothing").unwrap()).is_some());
    assert!(misused(&arguments("lnn train SYSTEM --preset quick|best --seed N").unwrap()).is_none());
}
