//! Kinematics from measured poses, by the command that a user types: what was hidden is found, other poses are predicted, bad files are refused.

use std::fs;
use std::path::{Path, PathBuf};

use proprio_tests::command::{
    done, folder, json, proprio, recorded_logs, refusal, schema_of, stdout,
};
use serde_json::Value;
use tempfile::TempDir;

/// Joints that yield, N m/rad.
const SOFT: [&str; 3] = [
    "elasticity:A2=2.5e6",
    "elasticity:A3=1.5e6",
    "elasticity:A5=3e5",
];

/// A folder with `arm.toml`, the arm of 2.5 m.
fn arm() -> TempDir {
    let folder = folder();
    let urdf = Path::new(env!("CARGO_MANIFEST_DIR")).join("robots/arm_2500.urdf");
    let model = format!(
        "format = 1\n[robot]\nurdf = {:?}\n",
        urdf.display().to_string()
    );
    fs::write(folder.path().join("arm.toml"), model).unwrap();
    folder
}

/// Poses of the arm whose errors a seed draws: `count` in `poses.csv`, 60 others in `others.csv`.
fn measured(folder: &Path, count: usize, seed: &str, more: &[&str]) {
    let all = (count + 60).to_string();
    let plain = [
        "simulate", "--poses", &all, "-m", "arm.toml", "--seed", seed, "-o", "all.csv", "--force",
    ];
    done(folder, &[&plain[..], more].concat());
    let text = fs::read_to_string(folder.join("all.csv")).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    let write = |name: &str, rows: &[&str]| {
        let text = format!("{}\n{}\n", lines[0], rows.join("\n"));
        fs::write(folder.join(name), text).unwrap();
    };
    write("poses.csv", &lines[1..=count]);
    write("others.csv", &lines[count + 1..]);
}

fn hidden(soft: &[&'static str]) -> Vec<&'static str> {
    soft.iter().flat_map(|what| ["--hide", what]).collect()
}

fn calibrated(folder: &Path, more: &[&str]) -> Value {
    let plain = ["calibrate", "poses.csv", "-m", "arm.toml", "--json"];
    json(&done(folder, &[&plain[..], more].concat()))
}

fn steps(found: &Value) -> Vec<&str> {
    let path = found["path"].as_array().unwrap();
    path.iter()
        .filter_map(|rung| rung["effect"].as_str())
        .collect()
}

/// Elasticity is the first effect beyond frames, values are within two standard deviations, and the written file predicts other poses.
#[test]
fn what_yields_is_named_and_other_poses_are_predicted() {
    let (mut within, mut all) = (0_u32, 0_u32);
    for seed in ["1", "2", "3"] {
        let folder = arm();
        let folder = folder.path();
        measured(folder, 40, seed, &hidden(&SOFT));
        let found = calibrated(folder, &["-o", "out.toml"]);
        let effects = steps(&found);
        let first = effects
            .iter()
            .find(|e| !["joint_offset", "link_geometry"].contains(e));
        assert_eq!(first, Some(&"elasticity"), "seed {seed}: {effects:?}");
        let before = found["error"]["before"].as_f64().unwrap();
        let after = found["error"]["after"].as_f64().unwrap();
        assert!(
            before > 1.0 && after < 0.09,
            "seed {seed}: {before} → {after} mm"
        );

        let truth = json(&fs::read_to_string(folder.join("all.truth.json")).unwrap());
        for truth in truth["parameters"].as_array().unwrap() {
            let same = |value: &&Value| value["name"] == truth["name"];
            let Some(value) = found["parameters"].as_array().unwrap().iter().find(same) else {
                continue;
            };
            let number = |of: &Value, key: &str| of[key].as_f64().unwrap();
            let z = (number(value, "value") - number(truth, "value")) / number(value, "std");
            all += 1;
            within += u32::from(z.abs() <= 2.0);
        }
        let other = json(&done(
            folder,
            &["compare", "others.csv", "-m", "out.toml", "--json"],
        ));
        let error = other["rms"].as_f64().unwrap();
        // 0.052 mm of noise beside what the calibration leaves.
        assert!(error < 0.08, "seed {seed}: {error} mm");
        assert_eq!(other["placed"], false);
    }
    let share = f64::from(within) / f64::from(all);
    assert!(all > 80 && share >= 0.93, "{within} of {all}");
}

/// A controller that takes zeros alone: of wrong zeros these are all that is found and written, a number a joint; of wrong frames they are the best zeros.
#[test]
fn zeros_alone_for_controllers_that_take_no_more() {
    let wrong_zeros = [
        "--geometry-error",
        "0,0",
        "--hide",
        "joint_offset:A3=0.003",
        "--hide",
        "joint_offset:A5=-0.004",
    ];
    for (more, at_most) in [(&wrong_zeros[..], 0.07), (&hidden(&SOFT)[..], 3.0)] {
        let folder = arm();
        let folder = folder.path();
        measured(folder, 40, "1", more);
        let found = calibrated(folder, &["--only", "offsets", "-o", "out.toml"]);
        assert_eq!(steps(&found), ["joint_offset"]);
        let written = fs::read_to_string(folder.join("out.toml")).unwrap();
        let (_, written) = written.split_once("[kinematics.").unwrap();
        let numbers = written.lines().filter(|line| line.contains("{ value = "));
        let joints = 1 + written.matches("[kinematics.").count();
        assert_eq!((numbers.count(), joints), (5, 5), "{written}");
        let compared = done(
            folder,
            &["compare", "others.csv", "-m", "out.toml", "--json"],
        );
        let error = json(&compared)["rms"].as_f64().unwrap();
        println!("{error} mm at other poses");
        assert!(error < at_most, "{error} mm");
        if more != wrong_zeros {
            continue;
        }
        let values = found["parameters"].as_array().unwrap();
        for (name, truth) in [
            ("ry:link_geometry:A3", 0.003),
            ("ry:link_geometry:A5", -0.004),
        ] {
            let own = values.iter().find(|value| value["name"] == name).unwrap();
            let wrong = own["value"].as_f64().unwrap() - truth;
            assert!(
                wrong.abs() < 2.5 * own["std"].as_f64().unwrap(),
                "{own}: {truth}"
            );
        }
    }
}

/// An arm as described has nothing added, whatever the noise.
#[test]
fn nothing_is_missing_from_a_complete_arm() {
    for seed in ["1", "2", "3", "4"] {
        let folder = arm();
        measured(folder.path(), 30, seed, &["--geometry-error", "0,0"]);
        let found = calibrated(folder.path(), &[]);
        assert_eq!(
            found["verdict"], "complete",
            "seed {seed}: {}",
            found["path"]
        );
    }
}

/// Corrected origins are in the exported URDF: as a description of its own it predicts what the calibration does.
#[test]
fn the_exported_urdf_has_the_corrected_origins() {
    let folder = arm();
    let folder = folder.path();
    measured(folder, 40, "5", &[]);
    done(
        folder,
        &["calibrate", "poses.csv", "-m", "arm.toml", "--apply"],
    );
    done(
        folder,
        &["export", "-m", "arm.toml", "--urdf", "-o", "better.urdf"],
    );
    fs::write(
        folder.join("better.toml"),
        "format = 1\n[robot]\nurdf = \"better.urdf\"\n",
    )
    .unwrap();
    let placed = |model: &str| {
        let compared = json(&done(
            folder,
            &["compare", "others.csv", "-m", model, "--json"],
        ));
        compared["placed_rms"].as_f64().unwrap()
    };
    let (before, after) = (placed("arm.toml"), placed("better.toml"));
    assert!(before > 1.0 && after < 0.09, "{before} → {after} mm");
    // What was written is what is read: the file's own error of its poses is that of the fit.
    let own = json(&done(
        folder,
        &["compare", "poses.csv", "-m", "arm.toml", "--json"],
    ));
    assert_eq!(own["fitted_to_these"], true);
    assert!(own["rms"].as_f64().unwrap() < 0.06);
}

/// Chosen poses leave less than random ones, and `simulate` measures them.
#[test]
fn chosen_poses_are_measured_and_leave_less() {
    let folder = arm();
    let folder = folder.path();
    let chosen = json(&done(
        folder,
        &[
            "excite",
            "--poses",
            "24",
            "-m",
            "arm.toml",
            "-o",
            "chosen.csv",
            "--json",
        ],
    ));
    let number = |key: &str| chosen[key].as_f64().unwrap();
    assert!(
        number("predicted_error") < 0.9 * number("random_error"),
        "{chosen}"
    );
    let words = [
        "simulate",
        "--poses",
        "24",
        "--follow",
        "chosen.csv",
        "-m",
        "arm.toml",
    ];
    done(
        folder,
        &[&words[..], &["-o", "poses.csv"], &hidden(&SOFT)].concat(),
    );
    let found = calibrated(folder, &[]);
    assert_eq!(found["poses"], 24);
    assert!(steps(&found).contains(&"elasticity"), "{}", found["path"]);
}

/// Each bad file is refused with the cause that was tested, and nothing is written.
#[test]
fn bad_poses_are_refused_in_words_of_their_own() {
    let folder = arm();
    let folder = folder.path();
    measured(folder, 40, "1", &hidden(&SOFT));
    let text = fs::read_to_string(folder.join("poses.csv")).unwrap();
    let header = text.lines().next().unwrap().to_owned();
    let rows: Vec<Vec<f64>> = (text.lines().skip(1))
        .map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect())
        .collect();
    type Change = fn(usize, &mut Vec<f64>);
    let cases: [(&str, Change, &[&str]); 12] = [
        (
            "mm",
            |_, row| row[6..].iter_mut().for_each(|x| *x *= 1e3),
            &["are in mm, not m"],
        ),
        (
            "degrees",
            |_, row| row[..6].iter_mut().for_each(|q| *q = q.to_degrees()),
            &["in degrees, not rad"],
        ),
        (
            "order",
            |_, row| row.swap(3, 5),
            &["A6 holds A4", "A4 holds A6"],
        ),
        (
            "exchanged coordinates of places",
            |_, row| row.swap(6, 7),
            &[
                "are in a left-handed frame",
                "two of x/, y/ and z/ are exchanged",
            ],
        ),
        (
            "moved",
            |n, row| row[7] += if n >= 20 { 2e-3 } else { 0.0 },
            &["moved by", "line 21 and line 22"],
        ),
        (
            // A target that turned about the flange's axis.
            "tool",
            |n, row| row[5] += if n >= 20 { 0.02 } else { 0.0 },
            &["target target moved by", "line 21 and line 22"],
        ),
        (
            "outliers",
            |n, row| row[8] += if n % 5 == 0 { 0.04 } else { 0.0 },
            &["poses do not fit the others", "line 2"],
        ),
        (
            "unrelated",
            |n, row| {
                for (k, x) in row[6..].iter_mut().enumerate() {
                    *x = ((n * 7919 + k * 104_729) % 1009) as f64 / 1009.0;
                }
            },
            &["do not belong together"],
        ),
        (
            "no number of a tracker",
            |n, row| row[6] = if n == 3 { 1e200 } else { row[6] },
            &["line 5: target target is 1.000e200 m from the middle"],
        ),
        (
            "beyond the robot's reach",
            |n, row| row[7] += if n == 3 { 20.0 } else { 0.0 },
            &["line 5: target target is", "the robot's links add up to"],
        ),
        (
            "a target that stands still",
            |_, row| row[6..].copy_from_slice(&[0.1, 0.2, 0.3]),
            &["target target is at the same place in all 40 poses"],
        ),
        (
            "a joint that was not recorded",
            |_, row| row[1] = 0.3,
            &["`q/A2` is 0.3000 in all poses"],
        ),
    ];
    let write = |header: &str, rows: &[Vec<f64>]| {
        let lines = rows.iter().map(|row| {
            let cells: Vec<String> = row.iter().map(|x| format!("{x:?}")).collect();
            cells.join(",") + "\n"
        });
        let text = format!("{header}\n{}", lines.collect::<String>());
        fs::write(folder.join("bad.csv"), text).unwrap();
    };
    let refused = |name: &str, wanted: &[&str]| {
        let words = refusal(
            folder,
            &["calibrate", "bad.csv", "-m", "arm.toml", "-o", "no.toml"],
        );
        assert!(
            wanted.iter().all(|part| words.contains(part)),
            "{name}: {words}"
        );
        assert!(words.contains("hint: "), "{name}: {words}");
        assert!(!folder.join("no.toml").exists(), "{name}");
    };
    for (name, change, wanted) in cases {
        let mut changed = rows.clone();
        for (n, row) in changed.iter_mut().enumerate() {
            change(n, row);
        }
        write(&header, &changed);
        refused(name, wanted);
    }
    for (column, value, wanted) in [
        ("payload", -5.0, "line 2: a payload of -5 kg"),
        ("payload", 5e3, "kg; the robot itself has"),
        ("std/target", 0.0, "deviation of target target is 0.000e0 m"),
        (
            "std/target",
            -1e-4,
            "deviation of target target is -1.000e-4 m",
        ),
        ("side/A1", 0.5, "line 2: `side/A1` is 5.000e-1"),
    ] {
        let more: Vec<Vec<f64>> = (rows.iter())
            .map(|row| [&row[..], &[value]].concat())
            .collect();
        write(&format!("{header},{column}"), &more);
        refused(column, &[wanted]);
    }
    write(&header, &vec![rows[0].clone(); 30]);
    refused(
        "same",
        &["30 poses are at 1 different joint positions; 5 are needed"],
    );
    write(&header, &rows[..6]);
    refused("few", &["parameters are to be found", "stay open"]);
    let twice: Vec<Vec<f64>> = rows
        .iter()
        .map(|row| [&row[..], &row[6..]].concat())
        .collect();
    write(&format!("{header},x/b,y/b,z/b"), &twice);
    refused("twice", &["targets target and b have the same numbers"]);
    write(&header.replace("q/A2", "q/A9"), &rows);
    refused("name", &["A9"]);
}

/// A file that holds each pose twice says as much as one that holds it once, with the same standard deviations.
#[test]
fn a_pose_that_stands_twice_is_counted_once() {
    let folder = arm();
    let folder = folder.path();
    measured(folder, 30, "1", &hidden(&SOFT));
    let once = calibrated(folder, &[]);
    let text = fs::read_to_string(folder.join("poses.csv")).unwrap();
    let (_, rows) = text.split_once('\n').unwrap();
    fs::write(folder.join("poses.csv"), format!("{text}{rows}")).unwrap();
    let twice = calibrated(folder, &[]);
    assert_eq!(twice["poses"], once["poses"]);
    assert_eq!(twice["parameters"], once["parameters"]);
    let warnings = twice["warnings"].to_string();
    assert!(
        warnings.contains("30 rows repeat all numbers of an earlier pose"),
        "{warnings}"
    );
}

/// One pose that is wrong by 4 mm is named and left out; all else is found as without it.
#[test]
fn an_outlier_is_named_and_left_out() {
    let folder = arm();
    let folder = folder.path();
    measured(folder, 40, "2", &hidden(&SOFT));
    let text = fs::read_to_string(folder.join("poses.csv")).unwrap();
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    let mut cells: Vec<f64> = lines[12].split(',').map(|x| x.parse().unwrap()).collect();
    cells[6] += 4e-3;
    let cells: Vec<String> = cells.iter().map(|x| format!("{x:?}")).collect();
    lines[12] = cells.join(",");
    fs::write(folder.join("poses.csv"), lines.join("\n") + "\n").unwrap();
    let found = calibrated(folder, &[]);
    let outliers = found["outliers"].as_array().unwrap();
    assert_eq!(outliers.len(), 1, "{outliers:?}");
    assert_eq!(outliers[0]["pose"], "line 13");
    assert!(found["error"]["after"].as_f64().unwrap() < 0.09);
    let screen = done(folder, &["calibrate", "poses.csv", "-m", "arm.toml"]);
    assert!(screen.contains("Left out: line 13"), "{screen}");
}

/// The first screen: fifteen lines of eighty columns, and a command that runs.
#[test]
fn the_first_screen_is_short_and_its_command_runs() {
    let folder = arm();
    let folder = folder.path();
    measured(folder, 30, "3", &hidden(&SOFT));
    done(
        folder,
        &[
            "calibrate",
            "poses.csv",
            "-m",
            "arm.toml",
            "--html",
            "page.html",
        ],
    );
    let page = fs::read_to_string(folder.join("page.html")).unwrap();
    assert!(page.contains("Error vectors") && page.contains("1/k:elasticity:A2"));
    for words in [
        ["calibrate", "poses.csv", "-m", "arm.toml"],
        ["compare", "poses.csv", "-m", "arm.toml"],
    ] {
        let screen = done(folder, &words);
        assert!(screen.lines().count() <= 15, "{screen}");
        assert!(
            screen.lines().all(|line| line.chars().count() <= 80),
            "{screen}"
        );
        let command = screen
            .lines()
            .find_map(|line| line.strip_prefix("Next: proprio "))
            .unwrap();
        let words: Vec<&str> = command.split(' ').collect();
        done(folder, &words);
    }
    assert!(schema_of("calibrate").exists());
}

/// The robots of PyPI's `example-robot-data`: `PROPRIO_URDFS` names the folder of its `robots`.
fn described(urdf: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("PROPRIO_URDFS").map(PathBuf::from);
    let found = folder
        .map(|folder| folder.join(urdf))
        .filter(|path| path.exists());
    if found.is_none() {
        println!(
            "skipped: PROPRIO_URDFS names no folder with {urdf} (pip install example-robot-data==6.0.0)"
        );
    }
    found
}

/// TALOS' left arm: the first 46 contacts predict the other 15. UR10: compliance gains nothing and is refused.
#[test]
fn real_arms() {
    let Some(logs) = recorded_logs() else { return };
    let folder = folder();
    let folder = folder.path();
    let split = |file: &str, count: usize| {
        let text = fs::read_to_string(logs.join("calibration").join(file)).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        let write = |name: &str, rows: &[&str]| {
            fs::write(
                folder.join(name),
                format!("{}\n{}\n", lines[0], rows.join("\n")),
            )
            .unwrap();
        };
        write("poses.csv", &lines[1..=count]);
        write("others.csv", &lines[count + 1..]);
    };
    let error = |urdf: &Path| {
        let model = format!(
            "format = 1\n[robot]\nurdf = {:?}\n",
            urdf.display().to_string()
        );
        fs::write(folder.join("arm.toml"), model).unwrap();
        let found = calibrated(folder, &["-o", "out.toml", "--force"]);
        let other = json(&done(
            folder,
            &["compare", "others.csv", "-m", "out.toml", "--json"],
        ));
        (found, other["rms"].as_f64().unwrap())
    };
    if let Some(urdf) = described("talos_data/robots/talos_full_v2.urdf") {
        split("talos_left_arm_contact.csv", 46);
        let (found, other) = error(&urdf);
        println!("TALOS {other} mm: {}", found["path"]);
        assert!(other <= 0.72, "{other} mm");
    }
    if let Some(urdf) = described("ur_description/urdf/ur10_robot.urdf") {
        split("ur10_camera.csv", 17);
        let (found, other) = error(&urdf);
        println!("UR10 {other} mm: {}", found["path"]);
        assert!(other <= 4.0, "{other} mm");
        assert_eq!(steps(&found), ["link_geometry"]);
        let screen = done(folder, &["calibrate", "poses.csv", "-m", "arm.toml"]);
        assert!(
            screen.contains("No effect beyond geometry gains"),
            "{screen}"
        );
    }
}

/// A spring that the file has from elsewhere: combined with the poses' number where the two agree, and never twice; both are named where they do not.
#[test]
fn a_spring_of_another_witness_is_combined_or_contradicted() {
    let folder = arm();
    let folder = folder.path();
    measured(folder, 40, "1", &hidden(&SOFT));
    let bare = fs::read_to_string(folder.join("arm.toml")).unwrap();
    let stated = |value: &str, std: &str| {
        let effect = format!(
            "{bare}[[effect]]\nname = \"elasticity\"\njoint = \"A2\"\nvalue = {value}\nstd = {std}\n"
        );
        fs::write(folder.join("arm.toml"), effect).unwrap();
    };
    let of_a2 = |found: &Value| {
        let all = found["witnesses"].as_array().unwrap();
        let own = all.iter().find(|w| w["name"] == "elasticity:A2");
        own.unwrap_or_else(|| panic!("{found}")).clone()
    };
    let number = |of: &Value| of.as_f64().unwrap();
    let alone = {
        let found = calibrated(folder, &[]);
        assert_eq!(found["witnesses"].as_array().unwrap().len(), 0);
        let values = found["parameters"].as_array().unwrap().iter();
        let mut own = values.filter(|v| v["name"] == "1/k:elasticity:A2");
        let own = own.next().unwrap().clone();
        [number(&own["value"]), number(&own["std"])]
    };

    stated("4.01e-7", "3e-9");
    let found = calibrated(folder, &["-o", "out.toml"]);
    let own = of_a2(&found);
    assert_eq!(own["agree"], true, "{own}");
    let measured = own["measured"].as_array().unwrap();
    assert_eq!(
        (&measured[0]["by"], &measured[1]["by"]),
        (&"motion".into(), &"poses".into())
    );
    // The poses' own number does not know of the other.
    assert!(
        (number(&measured[1]["value"]) - alone[0]).abs() < alone[1],
        "{own}"
    );
    assert!(
        number(&own["std"]) < number(&measured[1]["std"]).min(3e-9),
        "{own}"
    );
    assert!(
        (number(&own["value"]) - 4e-7).abs() < 2.5 * number(&own["std"]),
        "{own}"
    );
    // The same poses again: their number is replaced, not added.
    let again = json(&done(
        folder,
        &["calibrate", "poses.csv", "-m", "out.toml", "--json"],
    ));
    let again = of_a2(&again);
    assert_eq!(again["measured"].as_array().unwrap().len(), 2);
    assert_eq!(again["measured"][0], own["measured"][0]);
    let stds = [0, 1].map(|n: usize| number(&again["measured"][n]["std"]));
    let both = stds[0].powi(-2) + stds[1].powi(-2);
    assert!(
        (number(&again["std"]) * both.sqrt() - 1.0).abs() < 1e-6,
        "{again}"
    );

    stated("8e-7", "1e-8");
    let output = proprio(
        folder,
        &["calibrate", "poses.csv", "-m", "arm.toml", "--json"],
    );
    let own = of_a2(&json(&stdout(&output)));
    assert_eq!(own["agree"], false, "{own}");
    assert!((number(&own["value"]) - alone[0]).abs() < alone[1], "{own}");
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        told.contains("elasticity:A2: motion 8.000e-7") && told.contains("contradict each other"),
        "{told}"
    );
}

/// Options of logs are wrong usage with poses.
#[test]
fn options_of_logs_are_no_options_of_poses() {
    let folder = arm();
    let folder = folder.path();
    measured(folder, 30, "1", &[]);
    let output = proprio(folder, &["compare", "poses.csv", "-m", "arm.toml", "--fit"]);
    assert_eq!(output.status.code(), Some(2));
    let output = proprio(folder, &["simulate", "--poses", "5"]);
    assert_eq!(output.status.code(), Some(2));
}
