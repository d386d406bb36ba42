//! Every command line that README and docs/ show as one to be run (```sh) runs, in the order in which it stands there.

use std::fs;
use std::path::{Path, PathBuf};

use proprio_tests::command::{done, frf_arm, proprio, stderr};

/// What is no proprio of ours: it starts another program, or all tests.
const NOT_RUN: [&str; 2] = ["cargo ", "tests/run"];

fn root() -> PathBuf {
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
fn the_readme_is_short_and_its_links_lead_somewhere() {
    let text = fs::read_to_string(root().join("README.md")).unwrap();
    let words = text.split_whitespace().count();
    assert!(words <= 900, "{words} words");
    for page in ["README.md", "CONTRIBUTING.md"]
        .into_iter()
        .map(PathBuf::from)
        .chain(pages())
    {
        let text = fs::read_to_string(root().join(&page)).unwrap();
        for link in text
            .split("](")
            .skip(1)
            .filter_map(|rest| rest.split(')').next())
        {
            let path = link.split('#').next().unwrap();
            if path.is_empty() || path.contains("://") || path.contains(' ') {
                continue;
            }
            let beside = root().join(&page);
            let there = beside.parent().unwrap().join(path);
            assert!(there.exists(), "{}: {link}", page.display());
        }
    }
}

fn pages() -> Vec<PathBuf> {
    let all = fs::read_dir(root().join("docs")).unwrap();
    let names = all.map(|entry| Path::new("docs").join(entry.unwrap().file_name()));
    names
        .filter(|path| path.extension().is_some_and(|e| e == "md"))
        .collect()
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
