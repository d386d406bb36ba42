//! Frequency responses, by the command that a user types: springs of a bench and of simulated arms, what is predicted of encoders that no fit has
//! seen, and logs that are refused.

use std::f64::consts::PI;
use std::fmt::Write;
use std::fs;
use std::path::Path;

use proprio_tests::command::{
    done, folder, frf_arm, json, parameter, proprio, recorded_logs, refusal, stdout,
};
use serde_json::Value;

fn number(of: &Value) -> f64 {
    of.as_f64().unwrap_or_else(|| panic!("{of} is no number"))
}

/// The published antiresonance and resonance of a real bench, from its motor's side alone; the load's encoder is predicted.
#[test]
fn a_benchs_spring_is_found_and_its_loads_encoder_predicted() {
    let Some(data) = recorded_logs() else { return };
    let log = data.join("bench/two_mass_multisine_a.csv.gz");
    let folder = folder();
    let log = log.to_str().unwrap();
    let words = ["frf", log, "--json", "-o", "frf.csv", "--html", "frf.html"];
    let found = json(&done(folder.path(), &words));
    let mode = &found["modes"][0];
    let antiresonance = number(&mode["antiresonance"]["value"]);
    assert!((antiresonance - 53.9).abs() < 0.5, "{mode}");
    assert!(number(&mode["antiresonance"]["std"]) < 0.5, "{mode}");
    assert!(
        (number(&mode["resonance"]["value"]) - 76.1).abs() < 0.5,
        "{mode}"
    );
    assert!(
        (number(&mode["inertia_ratio"]["value"]) - 1.01).abs() < 0.03,
        "{mode}"
    );
    let link = &found["links"][0];
    assert!((number(&link["gain"]) - 1.0).abs() < 0.01, "{link}");
    assert!(
        number(&link["rms"]) < 0.1 && number(&link["lines"]) > 100.0,
        "{link}"
    );
    let error = &found["error"];
    assert!(
        number(&error["after"]) < 0.15 * number(&error["before"]),
        "{error}"
    );
    assert!(number(&error["floor"]) < number(&error["after"]), "{error}");

    let text = fs::read_to_string(folder.path().join("frf.csv")).unwrap();
    let header = text.lines().next().unwrap();
    assert_eq!(header, "point,f,out,in,re,im,var,var_noise,dof,q/motor");
    assert_eq!(text.lines().count(), 241);
    let page = fs::read_to_string(folder.path().join("frf.html")).unwrap();
    assert!(page.contains("motor by torque of motor: magnitude"));
}

/// Springs of the simulated arm, of which no joint is stiff.
const ARM: [&str; 14] = [
    "--hide",
    "elasticity:yaw=3000,damping=3",
    "--hide",
    "elasticity:shoulder=4000,damping=4",
    "--hide",
    "elasticity:elbow=900,damping=0.8",
    "--hide",
    "coulomb=1.5",
    "--hide",
    "coulomb:elbow=0.8",
    "--hide",
    "viscous=0.6",
    "--second-encoder",
    "--json",
];

/// Friction and masses come from a slow log of the same robot; the springs then from the responses, and they are the true ones.
#[test]
fn an_arms_springs_are_found_behind_friction_that_a_slow_log_gave() {
    let (mut within, mut all) = (0_u32, 0_u32);
    for seed in ["1", "2"] {
        let folder = folder();
        let folder = folder.path();
        frf_arm(folder);
        let plain = [
            "simulate", "--frf", "-m", "arm.toml", "--slow", "slow.csv", "-o", "frf.csv", "--seed",
            seed,
        ];
        done(folder, &[&plain[..], &ARM].concat());
        identified_slowly(folder);
        let found = json(&done(
            folder,
            &["frf", "frf.csv", "-m", "fitted.toml", "--json", "--apply"],
        ));
        let truth = json(&fs::read_to_string(folder.join("frf.truth.json")).unwrap());
        for joint in ["yaw", "shoulder", "elbow"] {
            for (what, share) in [("1/k:elasticity", 0.006), ("d:elasticity", 0.05)] {
                let name = format!("{what}:{joint}");
                let (own, truth) = (
                    parameter(&found, &name),
                    number(&parameter(&truth, &name)["value"]),
                );
                let wrong = number(&own["value"]) / truth - 1.0;
                println!("seed {seed} {name}: {:+.2} %", 100.0 * wrong);
                assert!(
                    wrong.abs() < share,
                    "seed {seed}: {name} {:+.2} %",
                    100.0 * wrong
                );
                all += 1;
                within += u32::from(wrong.abs() * truth <= 2.0 * number(&own["std"]));
            }
            // The encoder at the link is no part of the fit.
            let links = found["links"].as_array().unwrap();
            let link = links.iter().find(|link| link["joint"] == joint).unwrap();
            assert!(
                (number(&link["gain"]) - 1.0).abs() < 0.02,
                "seed {seed}: {link}"
            );
        }
        let error = &found["error"];
        assert!(
            number(&error["after"]) < 0.3 * number(&error["before"]),
            "{error}"
        );
        // No link bends.
        assert_eq!(found["candidates"], Value::Array(Vec::new()), "seed {seed}");
        let file = fs::read_to_string(folder.join("fitted.toml")).unwrap();
        assert!(file.contains("\"elasticity\""), "{file}");
        // A slow log measures the springs too: the responses' numbers stay beside its own, combined or contradicted by name.
        let words = "identify slow.csv -m fitted.toml -o again.toml";
        let output = proprio(folder, &words.split(' ').collect::<Vec<_>>());
        assert!(output.status.success(), "{output:?}");
        let warned = String::from_utf8_lossy(&output.stderr).into_owned();
        let shown = json(&done(folder, &["show", "again.toml", "--json"]));
        for witnessed in shown["witnesses"].as_array().unwrap() {
            let by = |n: usize| &witnessed["measured"][n]["by"];
            assert_eq!((by(0), by(1)), (&"motion".into(), &"responses".into()));
            let name = witnessed["name"].as_str().unwrap();
            let responses = &witnessed["measured"][1];
            let true_k = number(&parameter(&truth, &format!("1/k:{name}"))["value"]);
            let wrong = number(&responses["value"]) / true_k - 1.0;
            assert!(wrong.abs() < 0.006, "{witnessed}");
            let std = |of: &Value| number(&of["std"]);
            let combined = std(witnessed) < std(responses);
            let named = warned.contains(&format!("{name}: motion"))
                && warned.contains("contradict each other");
            assert_eq!(witnessed["agree"], combined, "{witnessed}");
            assert!(combined || named, "{witnessed}: {warned}");
        }
        assert_eq!(shown["witnesses"].as_array().unwrap().len(), 3, "{shown}");
    }
    println!("{within} of {all} values within 2 standard deviations");
    assert!(
        within * 10 >= all * 7,
        "{within} of {all} values within 2 standard deviations"
    );
}

/// Springs that sag under gravity, swing and lag are the same three numbers: what poses, responses and a slow log each measure stands in the file under one
/// name, and what agrees is combined. Nothing sags about a vertical axis.
#[test]
fn one_spring_has_three_witnesses() {
    let folder = folder();
    let folder = folder.path();
    frf_arm(folder);
    let simulate = "simulate --frf -m arm.toml --slow slow.csv -o frf.csv --seed 1";
    done(
        folder,
        &[&simulate.split(' ').collect::<Vec<_>>()[..], &ARM].concat(),
    );
    let truth = [("yaw", 3000.0), ("shoulder", 4000.0), ("elbow", 900.0)];
    let mut words = "simulate --poses 40 -m arm.toml --seed 1 -o poses.csv"
        .split(' ')
        .map(str::to_owned)
        .collect::<Vec<_>>();
    for (joint, k) in truth {
        words.extend(["--hide".to_owned(), format!("elasticity:{joint}={k}")]);
    }
    done(
        folder,
        &words.iter().map(String::as_str).collect::<Vec<_>>(),
    );
    identified_slowly(folder);
    for words in [
        "calibrate poses.csv -m fitted.toml -o sagged.toml",
        "frf frf.csv -m sagged.toml --apply",
        "identify slow.csv -m sagged.toml -o again.toml",
    ] {
        done(folder, &words.split(' ').collect::<Vec<_>>());
    }
    let shown = json(&done(folder, &["show", "again.toml", "--json"]));
    let all = shown["witnesses"].as_array().unwrap();
    for (joint, k) in truth {
        let name = format!("elasticity:{joint}");
        let own = all.iter().find(|own| own["name"] == *name).unwrap();
        let measured = own["measured"].as_array().unwrap();
        let by: Vec<&Value> = measured.iter().map(|own| &own["by"]).collect();
        let sags = joint != "yaw";
        let witnesses: &[&str] = if sags {
            &["motion", "poses", "responses"]
        } else {
            &["motion", "responses"]
        };
        assert_eq!(by, witnesses, "{own}");
        assert_eq!(own["agree"], true, "{own}");
        for one in &measured[1..] {
            let wrong = number(&one["value"]) - 1.0 / k;
            assert!(wrong.abs() < 2.5 * number(&one["std"]), "{own}");
            assert!(number(&own["std"]) < number(&one["std"]), "{own}");
        }
        let combined = number(&own["value"]) * k - 1.0;
        println!("{name}: {:+.2} %", 100.0 * combined);
        assert!(combined.abs() < 0.006, "{own}");
    }
}

/// A log of multisines beyond the antiresonances is of no other robot: `diagnose` and `compare` name `frf`. Of stiff joints they do not.
#[test]
fn an_elastic_robot_is_sent_to_frf() {
    let folder = folder();
    let folder = folder.path();
    frf_arm(folder);
    let short = ["simulate", "--frf", "-m", "arm.toml", "--points", "3", "-o"];
    done(folder, &[&short[..], &["soft.csv"], &ARM].concat());
    done(
        folder,
        &[&short[..], &["stiff.csv", "--hide", "viscous=0.6"]].concat(),
    );
    let message = refusal(folder, &["diagnose", "soft.csv", "-m", "arm.toml"]);
    for part in [
        "an elastic robot",
        "elbow",
        "hint: proprio frf soft.csv -m arm.toml",
    ] {
        assert!(message.contains(part), "{part}: {message}");
    }
    let screen = done(folder, &["compare", "soft.csv", "-m", "arm.toml"]);
    assert!(
        screen.contains("an elastic robot")
            && screen.contains("Next: proprio frf soft.csv -m arm.toml"),
        "{screen}"
    );
    let output = proprio(folder, &["compare", "stiff.csv", "-m", "arm.toml"]);
    let told = stdout(&output) + &String::from_utf8_lossy(&output.stderr);
    assert!(
        output.status.success() && !told.contains("an elastic robot"),
        "{told}"
    );
}

/// Friction, armature and masses of a slow log, written as `fitted.toml`.
fn identified_slowly(folder: &Path) {
    for words in [
        "add viscous coulomb armature -m arm.toml",
        "identify slow.csv -m arm.toml -o fitted.toml",
    ] {
        done(folder, &words.split(' ').collect::<Vec<_>>());
    }
}

/// Links that bend about axes without a motor are found among six candidates, named before all others and held apart from the joints' springs, which are
/// wrong without them; of an arm without any none is named (the arms of the other tests). They go into the file, and the next `frf` begins with them.
#[test]
fn links_that_bend_are_found_by_points_that_the_fit_has_not_used() {
    let folder = folder();
    let folder = folder.path();
    frf_arm(folder);
    let simulate = "simulate --frf -m arm.toml --slow slow.csv -o frf.csv --hide link_elasticity:yaw=10000,damping=10,axis=2 --hide link_elasticity:shoulder=6000,damping=6,axis=1";
    done(
        folder,
        &[&simulate.split(' ').collect::<Vec<_>>()[..], &ARM].concat(),
    );
    identified_slowly(folder);
    let words = "frf frf.csv -m fitted.toml --json --apply";
    let words: Vec<&str> = words.split(' ').collect();
    let found = json(&done(folder, &words));
    let truth = json(&fs::read_to_string(folder.join("frf.truth.json")).unwrap());
    let taken: Vec<String> = (found["candidates"].as_array().unwrap().iter())
        .filter(|one| one["taken"] == true)
        .map(|one| format!("{} {}", one["axis"], one["joint"]).replace('"', ""))
        .collect();
    let mut sorted = taken.clone();
    sorted.sort();
    assert_eq!(sorted, ["bend_1 shoulder", "bend_2 yaw"], "{taken:?}");
    for (what, share) in [
        ("1/k:elasticity:yaw", 0.02),
        ("1/k:elasticity:shoulder", 0.02),
        ("1/k:elasticity:elbow", 0.02),
        ("bend_2:link_elasticity:yaw", 0.05),
        ("bend_1:link_elasticity:shoulder", 0.05),
        ("bend_2_d:link_elasticity:yaw", 0.2),
        ("bend_1_d:link_elasticity:shoulder", 0.2),
    ] {
        let own = parameter(&found, what);
        let wrong = number(&own["value"]) / number(&parameter(&truth, what)["value"]) - 1.0;
        println!("{what}: {:+.2} %", 100.0 * wrong);
        assert!(wrong.abs() < share, "{what} {:+.2} %", 100.0 * wrong);
    }
    let error = &found["error"];
    let [springs, after] = [&found["springs_alone"], &error["after"]].map(number);
    assert!(after < 0.5 * springs, "{springs} {error}");
    let file = fs::read_to_string(folder.join("fitted.toml")).unwrap();
    assert!(
        file.contains("[kinematics.shoulder]\nbend_1 = ") && file.contains("\nbend_1_d = "),
        "{file}"
    );
    assert!(file.contains("measured_by = { responses = "), "{file}");
    let again = json(&done(folder, &words));
    assert!(number(&again["springs_alone"]) > 1.5 * number(&again["error"]["after"]));
    assert_eq!(
        parameter(&again, "bend_2:link_elasticity:yaw")["status"],
        "identified"
    );
}

/// A log of multisines past the antiresonances is compared once the file has springs and dampers: the rigid file is refused by name, and the error falls.
#[test]
fn an_elastic_robot_is_compared_once_its_file_has_springs_and_dampers() {
    let folder = folder();
    let folder = folder.path();
    frf_arm(folder);
    let simulate = "simulate --frf -m arm.toml --points 3 --slow slow.csv -o frf.csv";
    let without_encoders = ARM.iter().filter(|word| **word != "--second-encoder");
    let words: Vec<&str> = simulate
        .split(' ')
        .chain(without_encoders.copied())
        .collect();
    done(folder, &words);
    identified_slowly(folder);
    // All of a part, and pieces of the whole log, at whose beginning nothing is known of how the links swing.
    let compares = ["--only t<30 --only t>2", ""].map(|only| {
        let words = format!("compare frf.csv -m fitted.toml --json {only}");
        words
            .split_whitespace()
            .map(str::to_owned)
            .collect::<Vec<String>>()
    });
    let errors = || {
        compares.each_ref().map(|words| {
            let words: Vec<&str> = words.iter().map(String::as_str).collect();
            let output = proprio(folder, &words);
            let warned = String::from_utf8_lossy(&output.stderr).into_owned();
            let error = number(&json(&stdout(&output))["error"]["after"]);
            (error, warned.contains("an elastic robot"))
        })
    };
    let rigid = errors();
    done(
        folder,
        &["frf", "frf.csv", "-m", "fitted.toml", "--apply", "--json"],
    );
    let elastic = errors();
    println!("{rigid:?} -> {elastic:?} N m");
    assert!(rigid[1].1 && elastic.iter().all(|(_, refused)| !refused));
    for ((rigid, _), (elastic, _)) in rigid.iter().zip(&elastic) {
        assert!(*elastic < 0.3 * rigid, "{rigid} {elastic}");
    }
    // What each screen proposes runs, and is not what was typed.
    let next = |words: &str| {
        let screen = done(folder, &words.split(' ').collect::<Vec<_>>());
        let found = screen
            .lines()
            .find_map(|line| line.strip_prefix("Next: proprio "));
        found.map(str::to_owned)
    };
    let page = "frf frf.csv --html frf.html -o frf_frf.csv";
    assert_eq!(next("frf frf.csv").as_deref(), Some(page));
    assert_eq!(next(page), None);
    let apply = "frf frf.csv -m fitted.toml --apply";
    assert_eq!(next("frf frf.csv -m fitted.toml").as_deref(), Some(apply));
    let show = "show fitted.toml";
    assert_eq!(next(apply).as_deref(), Some(show));
    assert!(next(show).is_some());
}

/// A plan is a file that a robot plays, here the simulated one, and its log gives the springs; its errors are foreseen within a factor.
#[test]
fn a_plan_is_written_played_and_judged() {
    let folder = folder();
    let folder = folder.path();
    frf_arm(folder);
    let words = "excite --frf -m arm.toml --points 3 -o plan.csv --json";
    let plan = json(&done(folder, &words.split(' ').collect::<Vec<_>>()));
    assert_eq!(plan["violations"], 0);
    assert_eq!(
        (&plan["points"], &plan["blocks"], &plan["experiments"]),
        (&3.into(), &2.into(), &3.into())
    );
    let band = plan["band"].as_array().unwrap();
    assert!(number(&plan["carrier"]) < number(&band[0]), "{plan}");
    let text = fs::read_to_string(folder.join("plan.csv")).unwrap();
    let header = text.lines().next().unwrap();
    assert!(
        header.starts_with("t,q/yaw,") && header.ends_with(",ref/yaw,ref/shoulder,ref/elbow"),
        "{header}"
    );
    let rows = text.lines().count() - 1;
    assert_eq!(rows as f64, number(&plan["duration"]) * 500.0);

    let words = "simulate --frf --follow plan.csv -m arm.toml --slow slow.csv -o frf.csv";
    let words: Vec<&str> = words.split(' ').collect();
    done(folder, &[&words[..], &ARM].concat());
    identified_slowly(folder);
    let found = json(&done(
        folder,
        &["frf", "frf.csv", "-m", "fitted.toml", "--json"],
    ));
    assert_eq!(found["lines"], plan["lines"]);
    assert_eq!(found["points"].as_array().unwrap().len(), 3);
    let truth = json(&fs::read_to_string(folder.join("frf.truth.json")).unwrap());
    for joint in ["yaw", "shoulder", "elbow"] {
        for (what, share) in [("1/k:elasticity", 0.01), ("d:elasticity", 0.08)] {
            let name = format!("{what}:{joint}");
            let own = number(&parameter(&found, &name)["value"]);
            let wrong = own / number(&parameter(&truth, &name)["value"]) - 1.0;
            println!("{name}: {:+.2} %", 100.0 * wrong);
            assert!(wrong.abs() < share, "{name} {:+.2} %", 100.0 * wrong);
        }
    }
    // In degrees both agree with each other, and not with the masses.
    let text = fs::read_to_string(folder.join("frf.csv")).unwrap();
    let header = text.lines().next().unwrap();
    let turns: Vec<bool> = (header.split(','))
        .map(|name| name.starts_with("q/") || name.starts_with("dq/"))
        .collect();
    let mut in_degrees = format!("{header}\n");
    for line in text.lines().skip(1) {
        let cells = line.split(',').zip(&turns);
        let cells = cells.map(|(cell, turns)| match turns {
            true => cell.parse::<f64>().unwrap().to_degrees().to_string(),
            false => cell.to_owned(),
        });
        in_degrees += &(cells.collect::<Vec<_>>().join(",") + "\n");
    }
    fs::write(folder.join("degrees.csv"), in_degrees).unwrap();
    let message = refusal(folder, &["frf", "degrees.csv", "-m", "fitted.toml"]);
    assert!(
        message.contains("positions are in degrees, not rad: in rad the held-out error falls"),
        "{message}"
    );
    // A plan is played as it is.
    let both = "simulate --frf --follow plan.csv --points 2 -m arm.toml -o other.csv";
    let output = proprio(folder, &both.split(' ').collect::<Vec<_>>());
    assert_eq!(output.status.code(), Some(2));
    let none = "simulate --frf --follow slow.csv -m arm.toml -o other.csv";
    let message = refusal(folder, &none.split(' ').collect::<Vec<_>>());
    assert!(
        message.contains("not a plan of `excite --frf`"),
        "{message}"
    );
}

/// Two experiments a block of three joints: no responses, and the springs all the same.
#[test]
fn fewer_experiments_than_joints_give_the_springs() {
    let folder = folder();
    let folder = folder.path();
    frf_arm(folder);
    let words = "excite --frf -m arm.toml --points 6 --experiments 2 -o plan.csv --json";
    let plan = json(&done(folder, &words.split(' ').collect::<Vec<_>>()));
    assert_eq!(plan["experiments"], 2);
    let words = "simulate --frf --follow plan.csv -m arm.toml --slow slow.csv -o frf.csv";
    let words: Vec<&str> = words.split(' ').collect();
    done(folder, &[&words[..], &ARM].concat());
    identified_slowly(folder);
    // Four experiments at a point are no block of three.
    let message = refusal(folder, &["frf", "frf.csv", "-m", "fitted.toml", "--apply"]);
    assert!(
        message.contains("4 experiments of 3 joints") && message.contains("--experiments N"),
        "{message}"
    );
    let words = "frf frf.csv -m fitted.toml --experiments 2 --json";
    let found = json(&done(folder, &words.split(' ').collect::<Vec<_>>()));
    let truth = json(&fs::read_to_string(folder.join("frf.truth.json")).unwrap());
    let joints = ["yaw", "shoulder", "elbow"].map(|joint| (joint, [0.01, 0.12]));
    let within = springs_within(&found, &truth, &joints);
    assert!(within >= 5, "{within} of 6 within 2 standard deviations");
    // No link bends.
    let candidates = found["candidates"].as_array().unwrap();
    assert!(
        candidates.iter().all(|one| one["taken"] == false),
        "{candidates:?}"
    );
    let error = &found["error"];
    assert!(
        number(&error["after"]) < 0.4 * number(&error["before"]),
        "{error}"
    );
    // Responses that there are none of are not written.
    let output = proprio(
        folder,
        &[
            "frf",
            "frf.csv",
            "-m",
            "fitted.toml",
            "--experiments",
            "2",
            "-o",
            "no.csv",
        ],
    );
    assert_eq!(output.status.code(), Some(2));
    assert!(!folder.join("no.csv").exists());
    let words = "excite --frf -m arm.toml --experiments 4 -o no.csv";
    let message = refusal(folder, &words.split(' ').collect::<Vec<_>>());
    assert!(
        message.contains("no more than joints are driven"),
        "{message}"
    );
}

/// The arm of 2.5 m with drives that move it faster than its description's: `arm.toml`, which states the armature.
fn six_axes(folder: &Path) {
    let urdf = Path::new(env!("CARGO_MANIFEST_DIR")).join("robots/arm_2500.urdf");
    let mut urdf = fs::read_to_string(urdf).unwrap();
    for (before, after) in [
        ("effort=\"8000\"", "effort=\"16000\""),
        ("effort=\"5000\"", "effort=\"8000\""),
        ("effort=\"1000\"", "effort=\"1500\""),
        ("effort=\"600\"", "effort=\"1200\""),
        ("velocity=\"1.8\"", "velocity=\"4\""),
        ("velocity=\"1.6\"", "velocity=\"4\""),
        ("velocity=\"3\"", "velocity=\"4\""),
    ] {
        assert!(urdf.contains(before), "{before}");
        urdf = urdf.replace(before, after);
    }
    fs::write(folder.join("arm.urdf"), urdf).unwrap();
    let mut model = "format = 1\n[robot]\nurdf = \"arm.urdf\"\n".to_owned();
    for (joint, [_, _, _, armature, ..]) in SIX {
        let _ = write!(
            model,
            "\n[[effect]]\nname = \"armature\"\njoint = \"{joint}\"\nvalue = {armature}\nstd = 0.5\n"
        );
    }
    fs::write(folder.join("arm.toml"), model).unwrap();
}

/// Of each joint: k, d, Coulomb friction, armature, viscous friction. Antiresonances are from 9 to 16 Hz.
const SIX: [(&str, [f64; 5]); 6] = [
    ("A1", [3e6, 5000.0, 200.0, 300.0, 100.0]),
    ("A2", [3e6, 5000.0, 200.0, 300.0, 100.0]),
    ("A3", [8e5, 1200.0, 120.0, 90.0, 60.0]),
    ("A4", [3e4, 30.0, 25.0, 8.0, 6.0]),
    ("A5", [5e4, 60.0, 25.0, 8.0, 6.0]),
    ("A6", [1e4, 10.0, 15.0, 5.0, 3.0]),
];

/// Six axes with friction and masses of a slow log, which took springs for masses: `frf` says that. The carrier changes the inertia that A1 turns by a
/// quarter: by the mean plant its damper is 10 % off.
#[test]
fn an_arm_of_six_axes() {
    let folder = folder();
    let folder = folder.path();
    six_axes(folder);
    let mut words =
        "simulate --frf -m arm.toml --seed 1 --excitation 0.6 --slow slow.csv -o frf.csv --json"
            .split(' ')
            .map(str::to_owned)
            .collect::<Vec<_>>();
    for (joint, [k, d, coulomb, armature, viscous]) in SIX {
        for hidden in [
            format!("elasticity:{joint}={k},damping={d}"),
            format!("coulomb:{joint}={coulomb}"),
            format!("armature:{joint}={armature}"),
            format!("viscous:{joint}={viscous}"),
        ] {
            words.extend(["--hide".to_owned(), hidden]);
        }
    }
    done(
        folder,
        &words.iter().map(String::as_str).collect::<Vec<_>>(),
    );
    identified_slowly(folder);
    let output = proprio(folder, &["frf", "frf.csv", "-m", "fitted.toml", "--json"]);
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{told}");
    assert!(told.contains("masses are doubtful: "), "{told}");
    let found = json(&stdout(&output));
    let truth = json(&fs::read_to_string(folder.join("frf.truth.json")).unwrap());
    let joints = SIX.map(|(joint, _)| (joint, [0.005, 0.05]));
    let within = springs_within(&found, &truth, &joints);
    assert!(within >= 11, "{within} of 12 within 2 standard deviations");
    // No link bends.
    let candidates = found["candidates"].as_array().unwrap();
    assert!(
        candidates.iter().all(|one| one["taken"] == false),
        "{candidates:?}"
    );
}

/// How many of these joints' 1/k and d are within two standard deviations; each must be within its share of the truth.
fn springs_within(found: &Value, truth: &Value, joints: &[(&str, [f64; 2])]) -> usize {
    let mut within = 0;
    for (joint, shares) in joints {
        for (what, share) in ["1/k", "d"].into_iter().zip(shares) {
            let name = format!("{what}:elasticity:{joint}");
            let (wrong, z) = error_of(found, truth, &name);
            assert!(wrong.abs() < *share, "{name} {:+.2} %", 100.0 * wrong);
            within += usize::from(z <= 2.0);
        }
    }
    within
}

/// An estimate's error as a share of the truth, and in its standard deviations.
fn error_of(found: &Value, truth: &Value, name: &str) -> (f64, f64) {
    let own = parameter(found, name);
    let truth = number(&parameter(truth, name)["value"]);
    let wrong = number(&own["value"]) / truth - 1.0;
    let z = wrong.abs() * truth / number(&own["std"]);
    println!(
        "{name}: {:+.2} %, {z:.1} standard deviations",
        100.0 * wrong
    );
    (wrong, z)
}

/// What cannot be planned has its own words and a hint, and nothing is written.
#[test]
fn plans_that_cannot_be_are_refused_each_in_its_own_words() {
    let folder = folder();
    let folder = folder.path();
    frf_arm(folder);
    for (more, what) in [
        ("--excitation 0.05", "too small to break its friction"),
        ("--band 1,220", "beyond 0.8 of the Nyquist frequency"),
        ("--band 10,20 --period 1", "12 are needed"),
        ("--torque-share 0.05", "the limits are too narrow"),
    ] {
        let words = format!("excite --frf -m arm.toml -o plan.csv --json {more}");
        let message = refusal(folder, &words.split(' ').collect::<Vec<_>>());
        assert!(
            message.contains(what) && message.contains("\nhint: "),
            "{what}: {message}"
        );
        assert!(!folder.join("plan.csv").exists());
    }
}

/// One joint, or joints that all move alike, at 500 Hz, periods of a second, with sines at `lines` Hz, as a rigid mass moves.
fn periodic(
    folder: &Path,
    lines: &[usize],
    columns: &str,
    change: impl Fn(usize, [f64; 3]) -> [f64; 3],
) {
    let mut text = format!("t,{columns}\n");
    for k in 0..3000_usize {
        let t = k as f64 / 500.0;
        let sum = |power: f64| {
            let sine = |line: &usize| {
                let omega = std::f64::consts::TAU * *line as f64;
                (omega * t + (line * line) as f64).sin() / omega.powf(power)
            };
            lines.iter().map(sine).sum::<f64>()
        };
        let [q, tau, reference] = change(k, [-sum(2.0), sum(0.0), sum(0.0)]);
        let velocity = |t: f64| {
            let cosine = |line: &usize| {
                let omega = std::f64::consts::TAU * *line as f64;
                -(omega * t + (line * line) as f64).cos() / omega
            };
            lines.iter().map(cosine).sum::<f64>()
        };
        let _ = write!(text, "{t:.6}");
        for name in columns.split(',') {
            let value = match name.split('/').next() {
                Some("q") => q,
                Some("dq") => velocity(t),
                Some("tau" | "current") => tau,
                _ => reference,
            };
            let _ = write!(text, ",{value:.10}");
        }
        text.push('\n');
    }
    fs::write(folder.join("log.csv"), text).unwrap();
}

/// Odd lines from 3 to 51 Hz.
fn odd() -> Vec<usize> {
    (3..52).step_by(2).collect()
}

/// Each bad log has its own words and a hint.
#[test]
fn bad_logs_are_refused_each_in_its_own_words() {
    const ALL: &str = "q/j,tau/j,ref/j";
    let folder = folder();
    let refused = |what: &str| {
        let words = "frf log.csv --json -o responses.csv --html page.html";
        let words: Vec<&str> = words.split(' ').collect();
        let message = refusal(folder.path(), &words);
        assert!(
            message.contains(what) && message.contains("\nhint: "),
            "{what}: {message}"
        );
        for written in ["responses.csv", "page.html"] {
            assert!(!folder.path().join(written).exists(), "{what}: {written}");
        }
    };
    let noise = |k: usize| {
        let mixed = (k as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        ((mixed ^ (mixed >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9) >> 40) as f64
            / (1 << 24) as f64
            - 0.5
    };
    periodic(folder.path(), &odd(), ALL, |k, _| {
        [noise(k), noise(k + 7000), noise(k + 14_000)]
    });
    refused("no period");
    periodic(folder.path(), &odd(), "q/j,ref/j", |_, x| x);
    refused("torque is missing");
    periodic(
        folder.path(),
        &(150..230).step_by(2).collect::<Vec<_>>(),
        ALL,
        |_, x| x,
    );
    refused("beyond 0.8 of the Nyquist frequency");
    // A drive faster than the log, which the velocity tells; one below half the rate is no alias.
    let beyond: Vec<usize> = (311..370).step_by(2).collect();
    periodic(folder.path(), &beyond, &format!("dq/j,{ALL}"), |_, x| x);
    refused("lines are aliases: at 161.0 Hz the position of j has the velocity of 339 Hz");
    periodic(folder.path(), &[3, 5, 7], &format!("dq/j,{ALL}"), |_, x| x);
    refused("3 excited lines");
    // The velocity is in rad/s, so that one of the two is in degrees.
    for (column, factor) in [("q/j", 180.0 / PI), ("dq/j", PI / 180.0)] {
        periodic(
            folder.path(),
            &odd(),
            &format!("dq/j,{ALL}"),
            |_, [q, tau, r]| [q * factor, tau, r],
        );
        refused(&format!(
            "`{column}` is in degrees, not rad: it is 57.3 times"
        ));
    }
    periodic(folder.path(), &odd(), ALL, |k, [q, tau, r]| {
        [q + 0.02 * k as f64 / 500.0, tau, r]
    });
    refused("the point moves: j");
    periodic(folder.path(), &odd(), ALL, |k, [_, tau, r]| {
        [if k == 100 { 1e-3 } else { 0.0 }, tau, r]
    });
    refused("joint j sticks");
    periodic(folder.path(), &odd(), ALL, |k, [_, tau, r]| {
        [1e-3 * noise(k), tau, r]
    });
    refused("does not answer its excitation");
    periodic(folder.path(), &odd(), ALL, |k, [q, tau, r]| {
        [q, tau, if k < 1100 { r } else { 0.0 }]
    });
    refused("2 periods of 1 s");
    periodic(folder.path(), &odd(), ALL, |_, [q, _, r]| [q, 0.0, r]);
    refused("`tau/j` is 0.0000 in all rows");
    periodic(folder.path(), &odd(), ALL, |k, [q, tau, r]| {
        [q, if k == 1600 { 1e200 } else { tau }, r]
    });
    refused("line 1602: `tau/j` is 1.000e200");
    // Four times the swing in one sample, and a position that is another from there on.
    periodic(folder.path(), &odd(), ALL, |k, [q, tau, r]| {
        [if k == 1600 { q + 0.02 } else { q }, tau, r]
    });
    refused("`q/j` leaps by");
    periodic(folder.path(), &odd(), ALL, |k, [q, tau, r]| {
        [if k >= 1600 { q + 0.02 } else { q }, tau, r]
    });
    refused("line 1602: `q/j` leaps by");
    periodic(folder.path(), &odd(), ALL, |_, x| x);
    let in_seconds = fs::read_to_string(folder.path().join("log.csv")).unwrap();
    for (unit, factor) in [("ms", 1e3), ("µs", 1e6), ("ns", 1e9)] {
        let mut text = String::new();
        for line in in_seconds.lines() {
            let (t, rest) = line.split_once(',').unwrap();
            let t = t.parse::<f64>().map(|t| (factor * t).to_string());
            let _ = writeln!(text, "{},{rest}", t.unwrap_or_else(|_| "t".to_owned()));
        }
        fs::write(folder.path().join("log.csv"), text).unwrap();
        refused(&format!("in {unit} `t` gives 500.0"));
    }
}

/// Two equal masses with a spring between them, antiresonance at 20 Hz: the first one's position under [`periodic`]'s torque after `k` samples.
fn two_masses(k: usize) -> f64 {
    let stiffness = (std::f64::consts::TAU * 20.0).powi(2);
    let damping = 0.02 * stiffness.sqrt();
    let sine = |line: usize| {
        let omega = std::f64::consts::TAU * line as f64;
        let square = omega * omega;
        let above = [stiffness - square, damping * omega];
        let below = [
            square * (square - 2.0 * stiffness),
            -2.0 * square * damping * omega,
        ];
        let size = below[0] * below[0] + below[1] * below[1];
        let real = (above[0] * below[0] + above[1] * below[1]) / size;
        let imaginary = (above[1] * below[0] - above[0] * below[1]) / size;
        let angle = omega * k as f64 / 500.0 + (line * line) as f64;
        real * angle.sin() + imaginary * angle.cos()
    };
    odd().into_iter().map(sine).sum()
}

/// Of a bench whose spring is found each wrong column is refused: torque of the other sign and a delay, by their cause; exchanged columns, by the error that
/// is left.
#[test]
fn responses_that_no_spring_explains_are_refused() {
    const ALL: &str = "q/j,tau/j,ref/j";
    let folder = folder();
    let folder = folder.path();
    let words = ["frf", "log.csv", "--json", "-o", "responses.csv"];
    periodic(folder, &odd(), ALL, |k, [_, tau, r]| {
        [two_masses(k), tau, r]
    });
    let found = json(&done(folder, &words));
    let antiresonance = number(&found["modes"][0]["antiresonance"]["value"]);
    assert!((antiresonance - 20.0).abs() < 0.1, "{antiresonance} Hz");
    fs::remove_file(folder.join("responses.csv")).unwrap();
    type Change = fn(usize, [f64; 3]) -> [f64; 3];
    let cases: [(Change, &str); 3] = [
        (
            |k, [_, tau, r]| [two_masses(k), -tau, r],
            "torque and position have opposite signs",
        ),
        (
            |k, [_, tau, r]| [tau, two_masses(k), r],
            "no elastic model fits the responses",
        ),
        (
            // A whole period later, so that no sample lies before the first.
            |k, [_, tau, r]| [two_masses(k + 490), tau, r],
            "the position is 20.0 ms later than the torque",
        ),
    ];
    for (change, what) in cases {
        periodic(folder, &odd(), ALL, change);
        let message = refusal(folder, &words);
        assert!(
            message.contains(what) && message.contains("\nhint: "),
            "{what}: {message}"
        );
        assert!(!folder.join("responses.csv").exists(), "{what}");
    }
}

/// Without a reference the torque's own period serves, and current for torque: both are said.
#[test]
fn current_and_no_reference_are_said() {
    let folder = folder();
    periodic(folder.path(), &odd(), "q/j,current/j", |_, x| x);
    let output = proprio(folder.path(), &["frf", "log.csv", "--json"]);
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    if output.status.success() {
        let found = json(&stdout(&output));
        assert_eq!(found["torque_unit"], "A");
        assert_eq!(found["reference"], false);
        assert!(told.contains("current stands for torque"), "{told}");
        assert!(
            told.contains("the period and its lines are the torque's own"),
            "{told}"
        );
    } else {
        // A mass alone has no spring to find.
        assert!(told.contains("no elastic model fits"), "{told}");
    }
}

/// Experiments that all drive the joints alike do not tell them apart, and one experiment is no block.
#[test]
fn experiments_that_tell_joints_not_apart_are_refused() {
    const TWO: &str = "q/a,q/b,tau/a,tau/b,ref/a,ref/b";
    let folder = folder();
    for (then, what) in [
        (2.0, "the 2 experiments are not independent"),
        (1.0, "1 experiments of 2 joints"),
    ] {
        // Three periods, and three that are so many times as strong.
        periodic(folder.path(), &odd(), TWO, |k, x| {
            x.map(|x| if k < 1500 { x } else { then * x })
        });
        let message = refusal(folder.path(), &["frf", "log.csv", "-o", "responses.csv"]);
        assert!(
            message.contains(what) && message.contains("\nhint: "),
            "{message}"
        );
        assert!(!folder.path().join("responses.csv").exists());
    }
}
