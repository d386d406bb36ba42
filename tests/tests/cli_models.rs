//! The commands around models: the catalogue, what a file says, effects out of it; completions and manual; and that nothing is
//! overwritten unsaid.

use std::fs;

use proprio_core::effect::EffectKind;
use proprio_tests::command::{done, folder, json, proprio, simulated, stderr, stdout};

#[test]
fn the_catalogue_is_told_whole() {
    let folder = folder();
    let text = done(folder.path(), &["effects", "--verbose"]);
    // Long lines are wrapped.
    let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    let catalogue = json(&done(folder.path(), &["effects", "--json"]));
    let entries = catalogue["effects"].as_array().unwrap();
    assert_eq!(entries.len(), EffectKind::ALL.len());
    for (entry, effect) in entries.iter().zip(EffectKind::ALL) {
        let description = effect.description();
        assert_eq!(entry["name"], description.name);
        for told in [
            description.name,
            description.torque,
            description.words,
            description.separated_by,
        ] {
            assert!(text.contains(told), "{told}");
        }
        for alike in entry["looks_like"].as_array().unwrap() {
            assert!(
                EffectKind::from_name(alike.as_str().unwrap()).is_some(),
                "{alike}"
            );
        }
    }
    insta::assert_snapshot!(done(folder.path(), &["effects", "stribeck", "viscous"]));
    let unknown = proprio(folder.path(), &["effects", "stribek"]);
    assert_eq!(unknown.status.code(), Some(1));
    assert!(
        stderr(&unknown).contains("did you mean `stribeck`?"),
        "{}",
        stderr(&unknown)
    );
}

#[test]
fn a_model_is_shown_and_effects_are_taken_out_of_it() {
    let folder = folder();
    let folder = folder.path();
    done(
        folder,
        &[
            "add",
            "viscous",
            "coulomb:FR_hip",
            "base_tilt",
            "-m",
            "m.toml",
        ],
    );
    let shown = done(folder, &["show", "m.toml", "--verbose"]);
    insta::assert_snapshot!(shown);
    let report = json(&done(folder, &["show", "m.toml", "--json"]));
    assert_eq!(report["effects"].as_array().unwrap().len(), 14);

    let words = done(
        folder,
        &[
            "remove",
            "viscous:FL_calf",
            "coulomb",
            "stribeck",
            "-m",
            "m.toml",
        ],
    );
    assert_eq!(
        words,
        "Taken out of m.toml: viscous:FL_calf, coulomb:FR_hip\nNot in m.toml: stribeck\n"
    );
    let report = json(&done(
        folder,
        &["remove", "viscous", "base_tilt", "-m", "m.toml", "--json"],
    ));
    assert_eq!(report["removed"].as_array().unwrap().len(), 12);
    let shown = done(folder, &["show", "m.toml", "--verbose"]);
    assert!(
        shown.contains("No effects: the rigid body alone."),
        "{shown}"
    );

    for (arguments, expected) in [
        (
            &["remove", "viscos", "-m", "m.toml"][..],
            "did you mean `viscous`?",
        ),
        (
            &["remove", "viscous:FR_hp", "-m", "m.toml"],
            "did you mean `FR_hip`?",
        ),
        (
            &["remove", "viscous", "-m", "none.toml"],
            "cannot read the file",
        ),
        (&["show", "none.toml"], "cannot read the file"),
    ] {
        let output = proprio(folder, arguments);
        assert_eq!(output.status.code(), Some(1));
        assert!(stderr(&output).contains(expected), "{}", stderr(&output));
    }
}

#[test]
fn shells_and_man_are_served() {
    let folder = folder();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let text = done(folder.path(), &["completions", shell]);
        assert!(
            text.contains("identify") && text.contains("html"),
            "{shell}"
        );
    }
    let page = done(folder.path(), &["man"]);
    assert!(
        page.contains(".TH proprio 1") && page.contains("diagnose"),
        "{page}"
    );
    let page = done(folder.path(), &["man", "import"]);
    assert!(
        page.contains("rosbag2") && page.contains("Examples"),
        "{page}"
    );
    let unknown = proprio(folder.path(), &["man", "identfy"]);
    assert!(
        stderr(&unknown).contains("did you mean `identify`?"),
        "{}",
        stderr(&unknown)
    );
    assert_eq!(
        proprio(folder.path(), &["completions", "tcsh"])
            .status
            .code(),
        Some(2)
    );
}

/// A file that the command did not make stays, and one that it replaces is named.
#[test]
fn nothing_is_overwritten_unsaid() {
    let folder = simulated("--legs FR --duration 3");
    let folder = folder.path();
    let write = |name: &str, text: &str| fs::write(folder.join(name), text).unwrap();
    let read = |name: &str| fs::read_to_string(folder.join(name)).unwrap();
    let log = read("log.csv");

    // Somebody's notes, somebody's model, somebody's robot.
    write("notes.txt", "do not lose");
    done(folder, &["add", "stribeck:FR_hip", "-m", "diagnosed.toml"]);
    let diagnosed = read("diagnosed.toml");
    write("mine.xml", "<mujoco/>");
    let refused: [(&[&str], &str, &str); 5] = [
        (
            &["identify", "log.csv", "--physical", "-o", "notes.txt"],
            "notes.txt",
            "which proprio did not make",
        ),
        (
            &["identify", "log.csv", "--html", "notes.txt"],
            "notes.txt",
            "which proprio did not make",
        ),
        (
            &["identify", "log.csv", "--physical", "-o", "diagnosed.toml"],
            "diagnosed.toml",
            "a model of 1 effects",
        ),
        (
            &["import", "log.csv", "-o", "notes.txt"],
            "notes.txt",
            "which proprio did not make",
        ),
        (
            &["export", "-m", "diagnosed.toml", "--mjcf", "-o", "mine.xml"],
            "mine.xml",
            "which proprio did not make",
        ),
    ];
    for (arguments, file, what) in refused {
        let before = read(file);
        let output = proprio(folder, arguments);
        let words = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{words}");
        assert!(
            words.contains(file) && words.contains(what) && words.contains("--force"),
            "{words}"
        );
        assert_eq!(read(file), before);
    }
    // A log is not replaced by what is found in it, whatever is said.
    for arguments in [
        &[
            "identify",
            "log.csv",
            "--physical",
            "-o",
            "log.csv",
            "--force",
        ][..],
        &["import", "./log.csv", "-o", "log.csv", "--force"],
    ] {
        let output = proprio(folder, arguments);
        assert_eq!(output.status.code(), Some(1));
        assert!(
            stderr(&output).contains("the log would be replaced"),
            "{}",
            stderr(&output)
        );
    }
    assert_eq!(read("log.csv"), log);
    assert_eq!(read("diagnosed.toml"), diagnosed);

    // What is forced, or was proprio's own, is replaced and named.
    let said = |arguments: &[&str]| {
        let output = proprio(folder, arguments);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        let _ = stdout(&output);
        stderr(&output)
    };
    let forced = said(&[
        "export",
        "-m",
        "diagnosed.toml",
        "--mjcf",
        "-o",
        "mine.xml",
        "--force",
    ]);
    assert!(
        forced.contains("note: mine.xml, which proprio did not make, was replaced"),
        "{forced}"
    );
    let page = [
        "identify",
        "log.csv",
        "--physical",
        "--html",
        "page.html",
        "-o",
        "fit.json",
    ];
    assert_eq!(said(&page), "");
    let again = said(&page);
    assert!(
        again.contains("note: page.html, a report of proprio, was replaced"),
        "{again}"
    );
    assert!(
        again.contains("note: fit.json, a result of proprio, was replaced"),
        "{again}"
    );
    // The model that a command is told to update is no surprise.
    let update = [
        "identify",
        "log.csv",
        "-m",
        "diagnosed.toml",
        "-o",
        "diagnosed.toml",
    ];
    assert!(!said(&update).contains("replaced"));
    let simulate = [
        "simulate",
        "--legs",
        "FR",
        "--duration",
        "1",
        "-o",
        "log.csv",
    ];
    assert!(said(&simulate).contains("note: log.csv, a simulated log, was replaced"));
}
