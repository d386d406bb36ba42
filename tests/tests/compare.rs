//! `compare` as its user meets it: the contract's numbers, where and when, the report.

use std::fs;
use std::path::Path;

use proprio_core::effect::EffectKind;
use proprio_tests::command::{done, json, proprio, recorded_logs, simulated};
use serde_json::Value;

fn number(value: &Value, key: &str) -> f64 {
    value[key]
        .as_f64()
        .unwrap_or_else(|| panic!("{key}: {value}"))
}

fn simulate(folder: &Path, arguments: &[&str]) {
    done(
        folder,
        &[&["simulate", "--legs", "FR"][..], arguments].concat(),
    );
}

/// The numbers belong together: each joint's and all joints', model and baselines.
#[test]
fn the_numbers_are_those_of_the_contract() {
    let folder = simulated("--legs FR --typical");
    let folder = folder.path();
    let known = [
        "viscous",
        "armature",
        "bias",
        "coulomb:FR_hip",
        "coulomb:FR_thigh",
    ];
    done(folder, &[&["add", "-m", "model.toml"][..], &known].concat());
    done(folder, &["add", "coulomb:FR_calf", "-m", "model.toml"]);
    let report = json(&done(
        folder,
        &["compare", "log.csv", "-m", "model.toml", "--json"],
    ));
    let joints = report["joints"].as_array().unwrap();
    let names: Vec<&str> = joints
        .iter()
        .map(|j| j["joint"].as_str().unwrap())
        .collect();
    assert_eq!(names, ["FR_hip", "FR_thigh", "FR_calf"]);
    for key in ["rms", "zero_rms", "cad_rms", "before_rms"] {
        let square = |j: &Value| number(j, key).powi(2) * number(j, "n");
        let n: f64 = joints.iter().map(|j| number(j, "n")).sum();
        let all = (joints.iter().map(square).sum::<f64>() / n).sqrt();
        assert!((all / number(&report, key) - 1.0).abs() < 1e-12, "{key}");
    }
    for joint in joints {
        let (rms, bias, max) = (
            number(joint, "rms"),
            number(joint, "bias"),
            number(joint, "max"),
        );
        assert!(bias.abs() <= rms && rms <= max);
        // NRMSE fit is of the error about zero, VAF about its mean: 1 − VAF ≤ (1 − fit)².
        let (fit, vaf) = (number(joint, "fit_percent"), number(joint, "vaf_percent"));
        assert!(1.0 - vaf / 100.0 <= (1.0 - fit / 100.0).powi(2) + 1e-12);
        assert!(rms < number(joint, "cad_rms"), "{joint}");
    }
    // Of the effects without a value the last added alone is what the model is held against.
    assert_eq!(report["added"], serde_json::json!(["coulomb:FR_calf"]));
    assert!(number(&report, "rms") < number(&report, "before_rms"));
    assert!(number(&report, "before_rms") < number(&report, "cad_rms"));
    let value = |name: &str| {
        let all = report["effects"].as_array().unwrap();
        let found = all.iter().find(|e| e["name"] == name).unwrap();
        (number(found, "value"), number(found, "std"))
    };
    let truth = json(&fs::read_to_string(folder.join("log.truth.json")).unwrap());
    let truth = number(
        proprio_tests::command::parameter(&truth, "coulomb:FR_calf"),
        "value",
    );
    let (coulomb, _) = value("coulomb:FR_calf");
    assert!((coulomb / truth - 1.0).abs() < 0.1, "{coulomb}, {truth}");
}

/// What the model file gives is taken as given; an effect without a value does nothing then.
#[test]
fn given_values_are_taken_as_given() {
    let folder = simulated("--legs FR --typical");
    let folder = folder.path();
    done(
        folder,
        &["identify", "log.csv", "--physical", "-o", "model.toml"],
    );
    let given = json(&done(
        folder,
        &["compare", "log.csv", "-m", "model.toml", "--json"],
    ));
    assert_eq!(given["fitted"], false);
    assert!(number(&given, "rms") < 0.5 * number(&given, "cad_rms"));
    let cad = json(&done(folder, &["compare", "log.csv", "--given", "--json"]));
    // The model's is summed over its series, the CAD's over blocks: in another order.
    assert!((number(&cad, "rms") / number(&cad, "cad_rms") - 1.0).abs() < 1e-12);
}

/// Where a leg is wrong is told in words, the joint and the kind of it, most important first; all of it on request.
#[test]
fn where_and_when_are_told_in_the_order_of_their_weight() {
    let folder = simulated("--legs FR --hide coulomb:FR_calf=0.8");
    let folder = folder.path();
    let report = json(&done(folder, &["compare", "log.csv", "--json"]));
    let places = report["where"].as_array().unwrap();
    assert_eq!(places[0]["joint"], "FR_calf");
    let shares: Vec<f64> = places.iter().map(|p| number(p, "share_percent")).collect();
    assert!(
        shares.is_sorted_by(|a, b| a >= b) && shares.iter().sum::<f64>() < 120.0,
        "{shares:?}"
    );
    let sizes: Vec<f64> = report["when"]
        .as_array()
        .unwrap()
        .iter()
        .map(|e| number(e, "size"))
        .collect();
    assert!(sizes.is_sorted_by(|a, b| a >= b), "{sizes:?}");
    let short = done(folder, &["compare", "log.csv", "--verbose"]);
    let long = done(folder, &["compare", "log.csv", "--all"]);
    assert!(
        short.starts_with("Data: nothing wrong with the samples\n"),
        "{short}"
    );
    assert!(short.contains("more (--all)") && !long.contains("(--all)"));
    assert!(long.lines().count() > short.lines().count());
    // One screen: what is wrong with the data, one line, three points at most, one command.
    let screen = done(folder, &["compare", "log.csv"]);
    let points = screen
        .lines()
        .filter(|line| line.starts_with("  • "))
        .count();
    assert!(
        (1..=3).contains(&points) && screen.lines().count() <= 12,
        "{screen}"
    );
    assert!(
        screen.contains("\nNext: proprio diagnose log.csv\n"),
        "{screen}"
    );
}

/// Two logs: moments are told by log and by time since its start.
#[test]
fn a_moment_is_told_by_its_log() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    simulate(folder, &["--duration", "6", "-o", "a.csv"]);
    simulate(folder, &["--duration", "6", "--seed", "2", "-o", "b.csv"]);
    // A knock at 3 s of the second log.
    let log = fs::read_to_string(folder.join("b.csv")).unwrap();
    let header: Vec<&str> = log.lines().next().unwrap().split(',').collect();
    let column = header.iter().position(|h| *h == "tau/FR_thigh").unwrap();
    let knocked: String = log
        .lines()
        .enumerate()
        .map(|(n, line)| {
            let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
            if (1500..1530).contains(&n) {
                cells[column] = "9.0".to_owned();
            }
            cells.join(",") + "\n"
        })
        .collect();
    fs::write(folder.join("b.csv"), knocked).unwrap();
    let report = json(&done(
        folder,
        &["compare", "a.csv", "b.csv", "--given", "--json"],
    ));
    let worst = &report["when"][0];
    assert_eq!(worst["joint"], "FR_thigh");
    assert_eq!(worst["log"], "b.csv");
    let t = number(worst, "since_start");
    assert!((2.97..3.08).contains(&t), "{t}");
    assert_eq!(report["data"].as_array().unwrap().len(), 2);
}

/// Every command that writes a report writes one whole page with all sections.
#[test]
fn reports_have_their_sections() {
    let folder = simulated("--legs FR --typical");
    let folder = folder.path();
    done(folder, &["add", "viscous", "coulomb", "-m", "model.toml"]);
    let all = [
        "waterfall",
        "torque",
        "residual",
        "correlation",
        "parameters",
    ];
    for (command, more) in [
        (&["compare", "log.csv", "-m", "model.toml"][..], None),
        (
            &["diagnose", "log.csv", "-m", "model.toml"],
            Some("candidates"),
        ),
        (&["identify", "log.csv"], None),
        (&["identify", "log.csv", "-m", "model.toml"], None),
    ] {
        done(folder, &[command, &["--html", "report.html"]].concat());
        let page = fs::read_to_string(folder.join("report.html")).unwrap();
        for section in all.into_iter().chain(more) {
            assert!(
                page.contains(&format!("<section id=\"{section}\"")),
                "{command:?}: {section}"
            );
        }
        let line = format!("proprio {} --html report.html", command.join(" "));
        assert!(page.contains(&line), "{command:?}");
        assert!(page.contains("SHA-256 ") && page.ends_with("</html>\n"));
        fs::remove_file(folder.join("report.html")).unwrap();
    }
}

/// On a real chirp, faults of the data come first: two velocities too high, repeated samples.
#[test]
fn a_real_logs_faults_come_first() {
    let Some(logs) = recorded_logs() else { return };
    let log = logs.join("go2_air_chirp_7.0hz_p25d5.0.csv");
    for command in ["compare", "diagnose"] {
        let output = proprio(Path::new("."), &[command, log.to_str().unwrap()]);
        let text = proprio_tests::command::stdout(&output);
        assert!(
            text.starts_with("Data: ") && text.contains("(and 2 more)"),
            "{text}"
        );
        let all = proprio(
            Path::new("."),
            &[command, log.to_str().unwrap(), "--verbose"],
        );
        let text = proprio_tests::command::stdout(&all);
        let data: Vec<&str> = text
            .lines()
            .take_while(|line| line.starts_with("Data: "))
            .collect();
        assert_eq!(data.len(), 3, "{text}");
        let first = "of the samples repeat the one before";
        assert!(data[0].contains(first), "{text}");
        let said = ["FR_hip", "FR_thigh"].map(|j| format!("Data: {j}: reports its velocity"));
        assert!(
            data[1].starts_with(&said[0]) && data[2].starts_with(&said[1]),
            "{text}"
        );
    }
}

/// One foot carries a force now and then: the rest is judged as if it never did, fitted or given, and the model may know it.
#[test]
fn time_under_a_force_at_a_foot_is_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    simulate(folder, &["--typical", "-o", "air.csv"]);
    let hide = ["--typical", "--hide", "contact:FR_calf=30"];
    simulate(folder, &[&hide[..], &["-o", "log.csv"]].concat());
    let effects = ["viscous", "coulomb", "armature", "bias"];
    done(folder, &[&["add", "-m", "m.toml"][..], &effects].concat());
    let compare = |arguments: &[&str]| {
        let arguments = [&["compare", "-m", "m.toml", "--json"][..], arguments].concat();
        json(&done(folder, &arguments))
    };
    let air = compare(&["air.csv"]);
    assert!(air.get("contact").is_none(), "{air}");
    let given = compare(&["log.csv", "--given"]);
    let fitted = compare(&["log.csv"]);
    for report in [&given, &fitted] {
        let feet = report["contact"].as_array().unwrap();
        assert_eq!(feet.len(), 1);
        assert_eq!(feet[0]["joint"], "FR_calf");
        assert_eq!(feet[0]["known"], false);
        let force = number(&feet[0], "force");
        assert!((force / 30.0 - 1.0).abs() < 0.15, "{force}");
        for (with, without) in joints(report).iter().zip(joints(&air)) {
            assert!(number(with, "n") < 0.9 * number(without, "n"));
        }
    }
    // The swing is predicted as well as a leg in the air.
    let share = number(&fitted, "rms") / number(&air, "rms");
    assert!(share < 1.2, "{share}");
    assert!(number(&fitted, "rms") < number(&fitted, "before_rms"));

    done(folder, &["add", "contact:FR_calf", "-m", "m.toml"]);
    let known = compare(&["log.csv"]);
    let foot = &known["contact"][0];
    assert_eq!(foot["known"], true);
    let effects = known["effects"].as_array().unwrap();
    let value = effects.iter().find(|e| e["name"] == "contact:FR_calf");
    assert_eq!(number(value.unwrap(), "value"), number(foot, "force"));
    assert_eq!(number(&known, "rms"), number(&fitted, "rms"));
}

fn joints(report: &Value) -> &[Value] {
    report["joints"].as_array().unwrap()
}

/// `--with X` is `add X; compare` and `--without X` is `remove X; compare`, for the whole catalogue: at a joint that has the effect and at
/// one that has not.
#[test]
fn with_an_effect_is_the_model_that_add_makes() {
    let folder = simulated("--legs FR --typical --duration 5 --hide cogging:FR_calf=0.3");
    let folder = folder.path();
    let plain = ["viscous", "coulomb", "armature", "bias"];
    done(folder, &[&["add", "-m", "plain.toml"][..], &plain].concat());
    let compared = |model: &str, more: &[&str]| {
        let command = ["compare", "log.csv", "--json", "-m", model];
        number(&json(&done(folder, &[&command, more].concat())), "rms")
    };
    let changed = |change: &str, place: &str| {
        fs::copy(folder.join("plain.toml"), folder.join("changed.toml")).unwrap();
        done(folder, &[change, place, "-m", "changed.toml"]);
        compared("changed.toml", &[])
    };
    // A coupling is of a joint that another carries.
    let joints = ["FR_calf", "FR_thigh"];
    for effect in EffectKind::ALL.iter().map(|effect| effect.name()) {
        let places: Vec<String> = match effect {
            "base_tilt" | "base_recoil" => vec![effect.to_owned()],
            _ => joints
                .iter()
                .map(|joint| format!("{effect}:{joint}"))
                .collect(),
        };
        for place in places {
            let (with, added) = (
                compared("plain.toml", &["--with", &place]),
                changed("add", &place),
            );
            assert!((with - added).abs() <= 1e-9, "{place}: {with} {added}");
        }
    }
    let (without, removed) = (
        compared("plain.toml", &["--without", "bias:FR_hip"]),
        changed("remove", "bias:FR_hip"),
    );
    assert!((without - removed).abs() <= 1e-9, "{without} {removed}");
    // Several joints of one effect, and another effect after them.
    let two = "quadratic_drag:FR_hip,FR_calf";
    let (with, added) = (
        compared(
            "plain.toml",
            &["--with", &format!("{two},stribeck:FR_calf")],
        ),
        changed("add", two),
    );
    let beside = compared("changed.toml", &["--with", "stribeck:FR_calf"]);
    assert!((with - beside).abs() <= 1e-9, "{with} {beside}");
    let with = compared("plain.toml", &["--with", two]);
    assert!((with - added).abs() <= 1e-9, "{with} {added}");
    let (without, removed) = (
        compared("plain.toml", &["--without", "bias:FR_hip,FR_calf"]),
        changed("remove", "bias:FR_hip,FR_calf"),
    );
    assert!((without - removed).abs() <= 1e-9, "{without} {removed}");
}
