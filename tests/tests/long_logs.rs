//! Logs of minutes and hours: fits are of a part that is drawn, errors of every window.

use std::fs;

use proprio_tests::command::{done, json, simulated};

/// The values under which every window is judged are those of a file: a rotor of nothing is not one of less.
#[test]
fn a_long_log_of_joints_without_rotors_is_judged() {
    let folder = simulated("--legs all --duration 160");
    let folder = folder.path();
    let add = ["add", "armature", "coulomb", "-m", "model.toml"];
    done(folder, &add);
    let diagnose = [
        "diagnose",
        "log.csv",
        "-m",
        "model.toml",
        "--json",
        "--catalogue-only",
    ];
    let found = json(&done(folder, &diagnose));
    assert!(found["every_window"]["windows"].as_f64().unwrap() > 1e4);
}

/// A hundred and sixty seconds at 500 Hz are more than is held in memory. A spring all the time, and friction at the calf in the second minute alone.
#[test]
fn a_long_log_is_judged_whole() {
    let folder = simulated(
        "--legs FR --typical --duration 160 --with-time --hide spring:FR_thigh=4 --hide FR_calf:0.5*sign(dq)*step(t-60)*step(120-t)",
    );
    let folder = folder.path();
    let diagnose = ["diagnose", "log.csv", "--catalogue-only"];
    let apply = ["--apply", "-m", "model.toml", "--json", "--html", "d.html"];
    let found = json(&done(folder, &[&diagnose[..], &apply].concat()));
    let every = &found["every_window"];
    let rms = |of: &str| every[of].as_f64().unwrap();
    assert!(rms("after_rms") < 0.5 * rms("before_rms"), "{every}");
    // Three joints' windows of 20 ms, and some in which friction holds one: more of them in the second minute.
    let minutes = every["minutes"].as_array().unwrap();
    assert_eq!(minutes.len(), 3);
    let lengths = [60.0, 60.0, 40.0];
    let rates: Vec<f64> = (minutes.iter().zip(lengths))
        .map(|(minute, seconds)| minute["windows"].as_f64().unwrap() / seconds)
        .collect();
    assert!(rates[0] > 0.9 * 3.0 / 0.02, "{rates:?}");
    assert!(rates.iter().all(|rate| *rate > 0.9 * rates[0]), "{rates:?}");
    let windows: f64 = rates.iter().zip(lengths).map(|(rate, s)| rate * s).sum();
    assert!((every["windows"].as_f64().unwrap() - windows).abs() < 0.5);
    let page = fs::read_to_string(folder.join("d.html")).unwrap();
    assert!(page.contains("Every window, by the minute"));

    // The file that was written, as it is given: the same errors, and a command that judges the bad minute alone.
    let compared = json(&done(
        folder,
        &[
            "compare",
            "log.csv",
            "-m",
            "model.toml",
            "--given",
            "--json",
        ],
    ));
    let given = compared["every_window"]["after_rms"].as_f64().unwrap();
    assert!(
        (given - rms("after_rms")).abs() < 1e-3 * given,
        "{given} {every}"
    );

    // What is right in the first minute is wrong in the second.
    let first = [
        "identify",
        "log.csv",
        "-m",
        "model.toml",
        "--only",
        "t < 60",
        "-o",
        "first.toml",
    ];
    done(folder, &first);
    let screen = done(
        folder,
        &["compare", "log.csv", "-m", "first.toml", "--given"],
    );
    assert!(screen.starts_with("Every window of 160 s: "), "{screen}");
    let next = "Next: proprio diagnose log.csv -m first.toml --only 't > 60' --only 't < 120'";
    assert!(screen.contains(next), "{screen}");
    let screen = screen.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(
        screen.contains("in the minute from 60 s of log.csv on, mostly at FR_calf"),
        "{screen}"
    );
    let words = next.trim_start_matches("Next: proprio ").replace('\'', "");
    let words: Vec<&str> = words.split(" --only ").collect();
    let mut arguments: Vec<&str> = words[0].split(' ').chain(["--catalogue-only"]).collect();
    words[1..]
        .iter()
        .for_each(|only| arguments.extend(["--only", only]));
    arguments.push("--json");
    let bad = json(&done(folder, &arguments));
    let moved = &bad["moved"][0];
    assert!(moved["name"] == "coulomb:FR_calf", "{bad}");
    let [was, now] = ["was", "now"].map(|of| moved[of].as_f64().unwrap());
    assert!((now - was - 0.5).abs() < 0.01, "{moved}");
    let plain = json(&done(folder, &["identify", "log.csv", "--json"]));
    assert!(
        plain["every_window"]["minutes"][1]["worst_joint"] == "FR_thigh",
        "{plain}"
    );
}
