//! Every command line that README and docs/ show as one to be run (```sh) runs, in the order in which it stands there.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

use proprio_tests::command::{done, frf_arm, proprio, recorded_logs, stderr};

/// What is no proprio of ours: it starts another program, or all tests.
const NOT_RUN: [&str; 2] = ["cargo ", "tests/run"];

pub(crate) fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The command lines of a page, without their comments.
fn commands(page: &str) -> Vec<String> {
    let text = fs::read_to_string(root().join(page)).unwrap();
    let mut found = Vec::new();
    for block in text.split("\n```sh\n").skip(1) {
        let lines = block.split("\n```").next().unwrap().lines();
        let bare = lines.map(|line| line.split('#').next().unwrap().trim().to_owned());
        found.extend(bare.filter(|line| !line.is_empty()));
    }
    found
}

/// The words of a line as a shell has them: what stands between single quotes is one.
fn words(command: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    for (n, part) in command.split('\'').enumerate() {
        let mut parts = part.split(' ');
        if n % 2 == 1 {
            parts = part.split('\'');
        }
        for (k, word) in parts.enumerate() {
            if k > 0 {
                words.push(String::new());
            }
            if let Some(last) = words.last_mut() {
                last.push_str(word);
            }
        }
    }
    words.retain(|word| !word.is_empty());
    words
}

/// Runs them in one folder; `cargo run --release -- X` is `proprio X`.
fn all_run(page: &str, folder: &Path) {
    let commands = commands(page);
    assert!(!commands.is_empty(), "{page} shows no command");
    for command in commands {
        let command = command.replace("cargo run --release --", "proprio");
        if NOT_RUN.iter().any(|start| command.starts_with(start)) {
            continue;
        }
        let words = words(&command);
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        assert_eq!(words[0], "proprio", "{page}: {command}");
        let output = proprio(folder, &words[1..]);
        assert_eq!(
            output.status.code(),
            Some(0),
            "{page}: {command}\n{}",
            stderr(&output)
        );
        println!("{page}: {command}");
    }
}

/// Two logs of a Go2 with a spring, short ones.
fn logs(folder: &Path) {
    for (log, seed) in [("chirp.csv", "1"), ("other.csv", "2")] {
        let words = [
            "simulate",
            "--typical",
            "--duration",
            "9",
            "--hide",
            "spring:FL_thigh=4",
        ];
        done(folder, &[&words[..], &["--seed", seed, "-o", log]].concat());
    }
}

#[test]
fn the_readme_runs() {
    let folder = tempfile::tempdir().unwrap();
    logs(folder.path());
    all_run("README.md", folder.path());
}

#[test]
fn links_lead_somewhere() {
    let others = ["README.md", "CONTRIBUTING.md", "CHANGELOG.md"];
    let beside = ["examples/README.md", "python/README.md"];
    let own = others.into_iter().chain(beside).map(PathBuf::from);
    let mut dead = Vec::new();
    for page in own.chain(pages()).chain(markdown("studies")) {
        let text = fs::read_to_string(root().join(&page)).unwrap();
        for link in text
            .split("](")
            .skip(1)
            .filter_map(|rest| rest.split(')').next())
        {
            if link.contains("://") || link.contains(' ') {
                continue;
            }
            let (path, heading) = link.split_once('#').unwrap_or((link, ""));
            let here = root().join(&page);
            let there = match path {
                "" => here,
                _ => here.parent().unwrap().join(path),
            };
            let led = heading.is_empty() && there.exists()
                || fs::read_to_string(&there).is_ok_and(|text| has_heading(&text, heading));
            if !led {
                dead.push(format!("{}: {link}", page.display()));
            }
        }
    }
    assert!(dead.is_empty(), "{}", dead.join("\n"));
}

/// Whether a page has the heading that a link names as code hosts do.
pub(crate) fn has_heading(page: &str, name: &str) -> bool {
    let headings = page.lines().filter(|line| line.starts_with('#'));
    headings
        .map(|line| slug(line.trim_start_matches('#')))
        .any(|heading| heading == name)
}

/// A heading as links name it: lower case, hyphens for spaces, no punctuation.
pub(crate) fn slug(heading: &str) -> String {
    let kept = |c: &char| c.is_alphanumeric() || "-_ ".contains(*c);
    let text: String = heading.trim().chars().filter(kept).collect();
    text.to_lowercase().replace(' ', "-")
}

/// The pages of docs/.
pub(crate) fn pages() -> Vec<PathBuf> {
    markdown("docs")
}

/// The pages in a folder.
fn markdown(folder: &str) -> Vec<PathBuf> {
    let all = fs::read_dir(root().join(folder)).unwrap();
    let names = all.map(|entry| Path::new(folder).join(entry.unwrap().file_name()));
    names
        .filter(|path| path.extension().is_some_and(|e| e == "md"))
        .collect()
}

/// What pages show of a command (a block of text with lines that begin with `$ proprio`) is what the command prints, white space apart;
/// `…` stands for what is not shown. A command of several pages runs once.
fn outputs_are_as_shown(pages: &[&str], folder: &Path) {
    let mut outputs = HashMap::new();
    for page in pages {
        let text = fs::read_to_string(root().join(page)).unwrap();
        let blocks = text.split("\n```text\n").skip(1);
        let blocks = blocks.map(|rest| rest.split("\n```").next().unwrap());
        let mut shown = 0;
        for block in blocks.filter(|block| block.starts_with("$ ")) {
            let block = format!("\n{block}");
            for part in block.split("\n$ proprio ").skip(1) {
                let (command, output) = part.split_once('\n').unwrap_or((part, ""));
                let printed = outputs.entry(command.to_owned()).or_insert_with(|| {
                    let words = words(command);
                    let words: Vec<&str> = words.iter().map(String::as_str).collect();
                    squeezed(&done(folder, &words))
                });
                in_order(page, printed, &squeezed(output));
                shown += 1;
            }
        }
        assert!(shown > 0, "{page} shows no output");
    }
}

/// Each piece of what is shown, between one `…` and the next, is printed, one after the other.
fn in_order(page: &str, printed: &str, shown: &str) {
    let mut rest = printed;
    for piece in shown.split('…').map(str::trim) {
        let found = rest.find(piece);
        let at = found.unwrap_or_else(|| panic!("{page}: not printed: {piece}\n{printed}"));
        rest = &rest[at + piece.len()..];
    }
}

/// A text with one blank where it has white space.
fn squeezed(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn what_formulas_print_is_as_shown() {
    let folder = tempfile::tempdir().unwrap();
    outputs_are_as_shown(&["docs/effects.md"], folder.path());
}

/// The real chirp that README, guide and `identify`'s page are of.
#[test]
fn what_a_real_log_prints_is_as_shown() {
    let Some(logs) = recorded_logs() else { return };
    let folder = tempfile::tempdir().unwrap();
    let chirp = logs.join("go2_air_chirp_7.0hz_p25d5.0.csv");
    fs::copy(chirp, folder.path().join("chirp.csv")).unwrap();
    outputs_are_as_shown(&["README.md", "docs/guide.md"], folder.path());
    let applied = ["diagnose", "chirp.csv", "--apply", "-m", "go2.toml"];
    done(folder.path(), &applied);
    outputs_are_as_shown(&["docs/identify.md"], folder.path());
}

/// The guide makes its own logs.
#[test]
fn the_guide_runs() {
    let folder = tempfile::tempdir().unwrap();
    all_run("docs/guide.md", folder.path());
}

#[test]
fn the_formulas_commands_run() {
    let folder = tempfile::tempdir().unwrap();
    logs(folder.path());
    let plain = ["viscous", "coulomb", "armature", "bias"];
    done(
        folder.path(),
        &[&["add", "-m", "go2.toml"], &plain[..]].concat(),
    );
    all_run("docs/effects.md", folder.path());
}

#[test]
fn the_motions_commands_run() {
    let folder = tempfile::tempdir().unwrap();
    all_run("docs/excite.md", folder.path());
}

#[test]
fn the_boards_commands_run() {
    let folder = tempfile::tempdir().unwrap();
    all_run("docs/monitor.md", folder.path());
    all_run("docs/board.md", folder.path());
}

/// Slow motion of an arm, as `frf` asks for it, is its log.
#[test]
fn another_robots_commands_run() {
    let folder = tempfile::tempdir().unwrap();
    frf_arm(folder.path());
    let urdf = root().join("tests/robots/arm.urdf");
    fs::copy(urdf, folder.path().join("arm.urdf")).unwrap();
    let words = "simulate --frf -m arm.toml --points 1 --blocks 1 --hide coulomb=0.8 --slow arm.csv -o frf.csv";
    done(folder.path(), &words.split(' ').collect::<Vec<_>>());
    fs::remove_file(folder.path().join("arm.toml")).unwrap();
    all_run("docs/other-robots.md", folder.path());
}

#[test]
fn the_commands_run() {
    let folder = tempfile::tempdir().unwrap();
    logs(folder.path());
    all_run("docs/commands.md", folder.path());
}

#[test]
fn the_reports_commands_run() {
    let folder = tempfile::tempdir().unwrap();
    all_run("docs/report.md", folder.path());
}

#[test]
fn the_calibrations_commands_run() {
    let folder = tempfile::tempdir().unwrap();
    let urdf = root().join("tests/robots/arm_2500.urdf");
    fs::copy(urdf, folder.path().join("arm.urdf")).unwrap();
    let model = "format = 1\n[robot]\nurdf = \"arm.urdf\"\n";
    fs::write(folder.path().join("arm.toml"), model).unwrap();
    all_run("docs/calibrate.md", folder.path());
}

#[test]
fn the_frequency_responses_commands_run() {
    let folder = tempfile::tempdir().unwrap();
    frf_arm(folder.path());
    all_run("docs/frf.md", folder.path());
}

#[test]
fn the_fleets_commands_run() {
    let folder = tempfile::tempdir().unwrap();
    for (log, seed) in [("chirp.csv", "1"), ("other.csv", "2")] {
        let words = [
            "simulate",
            "--typical",
            "--duration",
            "24",
            "--seed",
            seed,
            "-o",
            log,
        ];
        done(folder.path(), &words);
    }
    all_run("docs/fleet.md", folder.path());
}

#[test]
fn the_walks_commands_run() {
    let folder = tempfile::tempdir().unwrap();
    for (log, name) in [("trot", "walk.csv"), ("load", "next.csv")] {
        let walk = root().join(format!("tests/oracle/walk/{log}.csv.gz"));
        fs::copy(walk, folder.path().join(name)).unwrap();
    }
    all_run("docs/walking.md", folder.path());
}
