//! One ladder: `compare`, `diagnose`, `identify`, their JSON and the page tell the same errors of the same log and file, and the noise floor is the log's.

use std::fs;
use std::path::Path;

use proprio_host::model::Limb;
use proprio_tests::command::{done, folder, json, recorded_logs, simulated};
use proprio_tests::recorder::Recorder;
use serde_json::Value;

use crate::other_robot::{ARM, TYPICAL, robot, with_model};

/// What three commands say of a log and a model file, if there is one.
struct Said {
    has_file: bool,
    compare: Value,
    fitted: Value,
    diagnose: Value,
    identify: Value,
}

impl Said {
    fn of(folder: &Path, log: &str, model: Option<&str>) -> Self {
        let say = |command: &str, more: &[&str]| {
            let file: Vec<&str> = model.iter().flat_map(|file| ["-m", *file]).collect();
            json(&done(
                folder,
                &[&[command, log, "--json"][..], &file, more].concat(),
            ))
        };
        Self {
            has_file: model.is_some(),
            compare: say("compare", &["--given"]),
            fitted: say("compare", &["--fit", "--verbose"]),
            diagnose: say("diagnose", &[]),
            identify: say("identify", &[]),
        }
    }

    /// Numbers that mean the same are the same.
    fn agrees(&self, what: &str) {
        let same = |key: &str, a: &Value, b: &Value| {
            let [x, y] = [a, b].map(|x| x.as_f64().unwrap_or_else(|| panic!("{what}: {key}: {x}")));
            assert!((x - y).abs() <= 1e-9, "{what}: {key}: {x}, {y}");
        };
        let others = [&self.fitted, &self.diagnose, &self.identify];
        for other in others {
            for key in ["before", "floor"] {
                same(key, &self.compare["error"][key], &other["error"][key]);
            }
            for key in ["zero_rms", "cad_rms", "given_rms", "noise_floor_rms"] {
                same(key, &self.compare[key], &other[key]);
            }
            let joints = |of: &Value| of["joints"].as_array().unwrap().clone();
            let (own, other) = (joints(&self.compare), joints(other));
            assert_eq!(own.len(), other.len(), "{what}");
            for (own, other) in own.iter().zip(&other) {
                assert_eq!(own["joint"], other["joint"], "{what}");
                same("a joint's before", &own["before"], &other["before"]);
                same("a joint's floor", &own["floor"], &other["floor"]);
            }
        }
        let after = |of: &Value| of["error"]["after"].clone();
        same(
            "as given",
            &after(&self.compare),
            &self.compare["error"]["before"],
        );
        // Without a file `identify` fits the four effects of every drive.
        if self.has_file {
            same("refitted", &after(&self.fitted), &after(&self.identify));
        }
        let path = &self.diagnose["path"];
        same("as given", &path[0]["error"], &after(&self.compare));
        assert_eq!(path[1]["step"], "refitted");
    }

    fn floor(&self) -> f64 {
        self.compare["error"]["floor"].as_f64().unwrap()
    }

    /// No joint's held-out error is less than its floor by more than two standard deviations of that.
    fn is_above_its_floor(&self, what: &str) {
        let noises = self.fitted["criticism"].as_array().unwrap().iter();
        for (joint, noise) in self.identify["joints"]
            .as_array()
            .unwrap()
            .iter()
            .zip(noises)
        {
            let [after, floor] = ["after", "floor"].map(|key| joint[key].as_f64().unwrap());
            let std = noise["noise"]["rms_std"].as_f64().unwrap();
            assert!(after > floor - 2.0 * std, "{what}: {joint}, {std}");
        }
    }
}

/// The CAD, four plain effects fitted, all that a diagnosis finds: the log has one floor. What each model is said to leave.
fn of_three_models(folder: &Path, log: &str, bare: Option<&str>) -> [Said; 3] {
    if let Some(bare) = bare {
        fs::copy(folder.join(bare), folder.join("complete.toml")).unwrap();
        fs::copy(folder.join(bare), folder.join("plain.toml")).unwrap();
    }
    done(
        folder,
        &[&["add", "-m", "plain.toml"][..], &TYPICAL].concat(),
    );
    let fit = ["identify", log, "-m", "plain.toml", "-o", "fitted.toml"];
    done(folder, &fit);
    done(folder, &["diagnose", log, "-m", "complete.toml", "--apply"]);
    let models = [bare, Some("fitted.toml"), Some("complete.toml")];
    let said = models.map(|model| Said::of(folder, log, model));
    for (own, model) in said.iter().zip(models) {
        own.agrees(&format!("{log} {model:?}"));
        assert!((own.floor() / said[0].floor() - 1.0).abs() < 0.1);
    }
    said[2].is_above_its_floor(log);
    said
}

/// `compare` and `diagnose` have the same rows of a walk: what models without any value fitted leave of them is the same.
#[test]
fn commands_agree_on_a_walk() {
    let folder = folder();
    let folder = folder.path();
    let simulate = ["simulate", "--walk", "trot", "--typical", "--seed", "3"];
    let made = [
        "--inertia-error",
        "0.03",
        "--duration",
        "8",
        "-o",
        "walk.csv",
    ];
    done(folder, &[&simulate[..], &made].concat());
    let walk = ["--free-base", "walk.csv"];
    let found = [&["identify"], &walk[..], &["-o", "found.toml"]].concat();
    done(folder, &found);
    for model in [None, Some("found.toml")] {
        let file: Vec<&str> = model.iter().flat_map(|file| ["-m", *file]).collect();
        let say = |command: &[&str]| {
            let arguments = [command, &walk, &["--json"], &file].concat();
            json(&done(folder, &arguments))
        };
        let said = [say(&["compare", "--given"]), say(&["diagnose"])];
        let same = |of: &dyn Fn(&Value) -> Value| {
            let [x, y] = said.each_ref().map(|said| of(said).as_f64().unwrap());
            assert!((x - y).abs() <= 1e-9, "{model:?}: {x}, {y}");
        };
        for key in ["zero_rms", "cad_rms", "given_rms"] {
            same(&|said| said[key].clone());
        }
        same(&|said| said["error"]["before"].clone());
    }
}

#[test]
fn commands_agree_on_a_leg_that_hides_a_spring() {
    let folder = simulated("--legs FR --typical --hide spring:FR_thigh=4");
    let folder = folder.path();
    let said = of_three_models(folder, "log.csv", None);

    // Ten samples of +20 N m: the floor is of what the others are.
    let log = fs::read_to_string(folder.join("log.csv")).unwrap();
    let mut lines: Vec<String> = log.lines().map(str::to_owned).collect();
    let torque = lines[0].split(',').position(|name| name == "tau/FR_thigh");
    for k in 0..10 {
        let line = &mut lines[500 + 911 * k];
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        let cell = &mut cells[torque.unwrap()];
        *cell = (cell.parse::<f64>().unwrap() + 20.0).to_string();
        *line = cells.join(",");
    }
    fs::write(folder.join("spikes.csv"), lines.join("\n")).unwrap();
    let compared = json(&done(folder, &["compare", "spikes.csv", "--json"]));
    let floor = compared["error"]["floor"].as_f64().unwrap();
    let was = said[0].floor();
    assert!((floor / was - 1.0).abs() < 0.02, "{was} → {floor}");
    let [before, was] =
        [&compared, &said[0].compare].map(|of| of["error"]["before"].as_f64().unwrap());
    assert!((before / was - 1.0).abs() < 0.02, "{was} → {before}");

    // The page tells the error and the floor that the screen does.
    let page = [
        "compare",
        "log.csv",
        "-m",
        "complete.toml",
        "--fit",
        "--html",
        "page.html",
    ];
    done(folder, &page);
    let page = fs::read_to_string(folder.join("page.html")).unwrap();
    let told = page.split_once("id=\"choices\">").unwrap().1;
    let told = json(told.split_once("</script>").unwrap().0);
    let error = &said[2].fitted["error"];
    for (key, number) in [("rms", &error["after"]), ("floor", &error["floor"])] {
        let [page, json] = [&told[key], number].map(|x| x.as_f64().unwrap());
        assert!((page - json).abs() < 1e-9, "{key}: {page} {json}");
    }
}

#[test]
fn commands_agree_on_an_arm() {
    let folder = with_model(ARM, &TYPICAL);
    let folder = folder.path();
    fs::write(
        folder.join("bare.toml"),
        "format = 1\n\n[robot]\nurdf = \"robot.urdf\"\n",
    )
    .unwrap();
    let recorder = Recorder::new(robot(folder));
    let limbs = recorder.model.robot().limbs();
    let limbs: Vec<&Limb> = limbs.iter().collect();
    fs::write(folder.join("log.csv"), recorder.log::<4>(&limbs)).unwrap();
    of_three_models(folder, "log.csv", Some("bare.toml"));
}

/// The floor is the noise, whatever changes fast: each at a joint of a leg whose noise is the same. Of a leg without it, so many times at most.
#[test]
fn the_floor_is_the_noise_whatever_is_hidden() {
    let folder = folder();
    let folder = folder.path();
    let floors = |hide: &[&str]| -> Vec<f64> {
        let leg = ["--legs", "FR", "--typical", "--inertia-error", "0.04"];
        let seed = ["--seed", "3", "-o", "log.csv"];
        done(folder, &[&["simulate"], &leg[..], &seed, hide].concat());
        let compared = json(&done(folder, &["compare", "log.csv", "--json"]));
        let joints = compared["joints"].as_array().unwrap().iter();
        joints
            .map(|joint| joint["floor"].as_f64().unwrap())
            .collect()
    };
    let clean = floors(&[]);
    for (joint, hide, most) in [
        // Thirty and more times, where they are taken for noise.
        (1, "FR_thigh: 0.3*sin(40*q)", 1.3),
        (1, "FR_thigh: 0.3*sin(9*q)*sign(dq)", 1.7),
        (1, "cogging:FR_thigh=0.3,k=30", 1.6),
        (2, "FR_calf: 0.3*sign(dq)*(1 + sin(5*q))", 1.3),
        // Two to five times.
        (1, "quadratic_drag:FR_thigh=0.02", 1.3),
        (1, "stribeck:FR_thigh=0.4", 1.6),
        (1, "presliding:FR_thigh=0.02", 1.3),
        (1, "spring:FR_thigh=3", 1.3),
    ] {
        let hidden = floors(&["--hide", hide]);
        for (own, (floor, clean)) in hidden.iter().zip(&clean).enumerate() {
            let (times, most) = (floor / clean, if own == joint { most } else { 1.3 });
            println!("{hide}: joint {own}: {times:.2}");
            assert!((0.7..most).contains(&times), "{hide}: joint {own}: {times}");
        }
    }
}

/// A body that is not the CAD's is released where the model leaves noise alone.
#[test]
fn commands_agree_on_a_leg_with_a_load() {
    let folder = simulated("--legs FR --typical --hide payload:FR_thigh=0.5");
    let said = of_a_plain_model(folder.path(), "log.csv", None);
    let [after, floor] =
        ["after", "floor"].map(|key| said.identify["error"][key].as_f64().unwrap());
    assert!(after < 1.1 * floor, "{after} {floor}");
    for said in [&said.identify["warnings"], &said.diagnose["bodies"]] {
        assert!(said.to_string().contains("FR_thigh: mass"), "{said}");
    }
}

/// Four plain effects without values.
fn of_a_plain_model(folder: &Path, log: &str, urdf: Option<&Path>) -> Said {
    let urdf = urdf.map(|urdf| ["--urdf", urdf.to_str().unwrap()]);
    let urdf = urdf.iter().flatten().copied();
    let add: Vec<&str> = ["add", "-m", "plain.toml"]
        .into_iter()
        .chain(urdf)
        .collect();
    done(folder, &[&add[..], &TYPICAL].concat());
    let said = Said::of(folder, log, Some("plain.toml"));
    said.agrees(log);
    said
}

/// Real robots, whose logs are read where they lie: what their models lack would carry bodies far from the CAD in some.
#[test]
fn commands_agree_on_real_logs() {
    let Some(logs) = recorded_logs() else { return };
    let chirp = |name: &str| logs.join(format!("go2_air_chirp_{name}.csv"));
    of_three_models(
        folder().path(),
        chirp("7.0hz_p25d5.0").to_str().unwrap(),
        None,
    );
    for name in ["2.0hz_p25d3.0", "9.0hz_p25d1.2"] {
        of_a_plain_model(folder().path(), chirp(name).to_str().unwrap(), None);
    }
    let kuka = logs.join("kuka_kr300");
    let [log, urdf] = ["kuka_A.csv", "kr300.urdf"].map(|name| kuka.join(name));
    of_a_plain_model(folder().path(), log.to_str().unwrap(), Some(&urdf));
}
