//! What --json prints, as `docs/schema` describes it. [`proprio`] holds every object of every test to its schema; here each command is run once,
//! but for those that other tests run at length.

use std::fs;

use proprio_tests::command::{done, folder, json, proprio, schema_of, stderr, stdout};
use serde_json::Value;

/// One of each that takes a second at most, in an order in which the one makes what the next needs.
const QUICK: &str = "\
simulate --legs FR --typical --duration 8 -o log.csv
import log.csv -o imported.csv
add viscous coulomb armature bias -m model.toml
remove bias:FR_hip -m model.toml
show model.toml
effects spring
compare log.csv -m model.toml
diagnose log.csv -m model.toml
diagnose log.csv -m new.toml --apply
identify log.csv -m model.toml -o fitted.toml
compare log.csv -m fitted.toml
compare log.csv -m model.toml -m fitted.toml
compare log.csv -m fitted.toml --rollout
diagnose log.csv -m fitted.toml
export -m fitted.toml --mjcf -o go2.xml
export -m fitted.toml --urdf
advise log.csv
validate log.csv -m fitted.toml
replay log.csv --to desktop --factors factors.bin
identify --factor factors.bin
factors log.csv --robot one -o blocks.parquet
identify --blocks blocks.parquet
monitor sim --speed 0 --seconds 2 --lines
zero sim --legs FR --pose calves-folded
ports";

/// Commands that other tests run; `fleet` is of the fleet's workspace (fleet/tests/user.rs).
const ELSEWHERE: [&str; 8] = [
    "calibrate",
    "capture",
    "demo",
    "excite",
    "flash",
    "fleet",
    "frf",
    "record",
];

#[test]
fn each_command_holds_to_its_schema() {
    let folder = folder();
    let mut seen: Vec<&str> = ELSEWHERE.to_vec();
    for line in QUICK.lines() {
        let words: Vec<&str> = line.split(' ').chain(["--json"]).collect();
        let printed = json(&done(folder.path(), &words));
        let schema = schema_name(words[0]);
        assert_eq!(printed["schema"], *schema);
        if ["compare", "diagnose", "identify"].contains(&words[0]) && !words[1].starts_with("--") {
            assert!(
                printed["error"]["after"].is_number(),
                "{line}: {}",
                printed["error"]
            );
        }
        seen.push(words[0]);
    }
    // No command is forgotten, and no schema stays without one.
    let help = done(folder.path(), &["help"]);
    let listed = help.lines().skip_while(|line| *line != "Commands:").skip(1);
    let names = listed.map_while(|line| line.split_whitespace().next());
    let prints =
        |name: &&str| *name != "help" && done(folder.path(), &[name, "--help"]).contains("--json");
    for name in names.filter(prints) {
        assert!(schema_of(name).exists(), "docs/schema has no {name}.json");
        assert!(seen.contains(&name), "{name} is not held to its schema");
    }
    let files = fs::read_dir(schema_of("").parent().unwrap()).unwrap();
    for file in files.map(|file| file.unwrap().path()) {
        let name = file.file_stem().unwrap().to_str().unwrap().to_owned();
        assert!(name == "common" || seen.contains(&name.as_str()), "{name}");
    }
}

/// A command's object, by name and number.
fn schema_name(command: &str) -> String {
    let number = if command == "compare" { 2 } else { 1 };
    format!("proprio.{command}/{number}")
}

/// What a program reads of each joint, place and moment is a tenth of the object; the tests of the residual come by request.
#[test]
fn compare_prints_the_tests_of_the_residual_by_request() {
    let folder = folder();
    done(
        folder.path(),
        &[
            "simulate",
            "--legs",
            "FR",
            "--duration",
            "8",
            "-o",
            "log.csv",
        ],
    );
    let said = |more: &[&str]| {
        let words = [&["compare", "log.csv", "--json"], more].concat();
        done(folder.path(), &words)
    };
    let (short, long) = (said(&[]), said(&["--verbose"]));
    assert!(
        3 * short.len() < long.len(),
        "{} {}",
        short.len(),
        long.len()
    );
    let (short, mut long) = (json(&short), json(&long));
    let tests = long.as_object_mut().unwrap().remove("criticism").unwrap();
    assert_eq!(tests.as_array().unwrap().len(), 3);
    assert_eq!(short, long);
}

/// Standard output has an object and standard error the words, whatever the command; without --json there are the words alone.
#[test]
fn a_refusal_is_json_too() {
    let folder = folder();
    fs::write(folder.path().join("bad.csv"), "t,q/FR_hip\n0,x\n").unwrap();
    for command in ["compare", "diagnose", "identify", "advise", "show"] {
        let refused = proprio(folder.path(), &[command, "bad.csv", "--json"]);
        assert_eq!(refused.status.code(), Some(1), "{command}");
        let told: Value = json(&stdout(&refused));
        assert_eq!(told["schema"], *schema_name(command));
        assert_eq!(told["verdict"], "refused");
        let words = stderr(&refused);
        assert!(words.contains(told["reason"].as_str().unwrap()), "{words}");
        if let Some(hint) = told["hint"].as_str() {
            assert!(words.contains(&format!("hint: {hint}")), "{words}");
        }
        let bare = proprio(folder.path(), &[command, "bad.csv"]);
        assert_eq!(
            (bare.status.code(), stdout(&bare)),
            (Some(1), String::new())
        );
    }
}
