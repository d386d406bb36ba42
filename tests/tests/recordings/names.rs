//! Motors by number, and the names of other programs' columns.

use std::fs;

use proprio_tests::command::{done, folder, proprio, stderr};

use super::{assert_same, imported, recordings, table, unpacked};

/// A humanoid's motors have numbers; which joints they move is the model's to say.
#[test]
fn motors_by_number_need_an_order() {
    let folder = folder();
    let joint = |n: usize| {
        format!(
            "<link name=\"l{n}\"><inertial><mass value=\"1\"/><inertia ixx=\"0.1\" ixy=\"0\" ixz=\"0\" iyy=\"0.1\" iyz=\"0\" \
             izz=\"0.1\"/></inertial></link><joint name=\"m{n}\" type=\"revolute\"><parent link=\"base\"/><child \
             link=\"l{n}\"/><axis xyz=\"0 0 1\"/><limit lower=\"-9\" upper=\"9\" effort=\"9\" velocity=\"9\"/></joint>"
        )
    };
    let joints: String = (0..29).map(joint).collect();
    let urdf = format!("<robot name=\"biped\"><link name=\"base\"/>{joints}</robot>");
    fs::write(folder.path().join("biped.urdf"), urdf).unwrap();
    done(
        folder.path(),
        &["add", "viscous", "-m", "biped.toml", "--urdf", "biped.urdf"],
    );
    let bag = recordings().join("hg_mcap");
    let bag = bag.to_str().unwrap();
    let arguments = ["import", bag, "-m", "biped.toml", "-o", "log.csv"];
    let output = proprio(folder.path(), &arguments);
    assert_eq!(output.status.code(), Some(1));
    let words = stderr(&output);
    assert!(
        words.contains("motor 0") && words.contains("motors = ["),
        "{words}"
    );

    let model = folder.path().join("biped.toml");
    let names: Vec<String> = (0..29).map(|n| format!("\"m{n}\"")).collect();
    let log = format!("\n[log]\nmotors = [{}]\n", names.join(", "));
    fs::write(&model, fs::read_to_string(&model).unwrap() + &log).unwrap();
    done(folder.path(), &arguments);
    let found = table(&fs::read_to_string(folder.path().join("log.csv")).unwrap());
    let numbers = table(&unpacked(&recordings().join("hg.csv.gz")));
    for (name, values) in numbers {
        let known = name
            .split_once('/')
            .map(|(channel, n)| format!("{channel}/m{n}"));
        assert_eq!(found[&known.unwrap_or(name)], values);
    }
    // The order survives the file being written again.
    done(folder.path(), &["add", "coulomb", "-m", "biped.toml"]);
    done(
        folder.path(),
        &["import", bag, "-m", "biped.toml", "-o", "again.csv"],
    );
}

/// The CSV of a recording under the names that other programs give.
#[test]
fn names_of_other_programs_are_understood() {
    let text = unpacked(&recordings().join("low_state.csv.gz"));
    let expected = table(&text);
    let joints = proprio_core::go2::JOINT_NAMES;
    let motor = |joint: &str| joints.iter().position(|j| *j == joint).unwrap();
    let leg = |leg: &str| {
        ["FR", "FL", "RR", "RL"]
            .iter()
            .position(|l| *l == leg)
            .unwrap()
    };
    let axis = |axis: &str, axes: &str| axes.find(axis).unwrap();
    let plotjuggler = |name: &str| match name.split_once('/') {
        None => "__time".to_owned(),
        Some(("tau", joint)) => format!("/lowstate/motor_state[{}]/tau_est", motor(joint)),
        Some(("temp", joint)) => format!("/lowstate/motor_state[{}]/temperature", motor(joint)),
        Some(("quat", a)) => format!("/lowstate/imu_state/quaternion[{}]", axis(a, "wxyz")),
        Some(("gyro", a)) => format!("/lowstate/imu_state/gyroscope[{}]", axis(a, "xyz")),
        Some(("acc", a)) => format!("/lowstate/imu_state/accelerometer[{}]", axis(a, "xyz")),
        Some(("foot", l)) => format!("/lowstate/foot_force[{}]", leg(l)),
        Some((channel, joint)) => format!("/lowstate/motor_state[{}]/{channel}", motor(joint)),
    };
    let header = text.lines().next().unwrap();
    let renamed = |rename: &dyn Fn(&str) -> String| {
        let names: Vec<String> = header.split(',').map(rename).collect();
        text.replacen(header, &names.join(","), 1)
    };
    let ros1 = |name: &str| {
        let name = plotjuggler(name).replace("/lowstate/", "field.");
        let name = name
            .replace("motor_state", "motorState")
            .replace("tau_est", "tauEst");
        name.replace(['[', ']'], "")
            .replace('/', ".")
            .replace("imu_state.", "imu.")
    };
    // PlotJuggler merges topics: rows of others have empty cells here.
    let mut sparse = renamed(&plotjuggler)
        .lines()
        .map(|line| format!("{line},\n"))
        .collect::<String>();
    let empty = ",".repeat(header.split(',').count() - 1);
    sparse = sparse.replacen(",\n", ",/battery/voltage\n", 1);
    sparse += &format!("99{empty},25.2\n");
    let german = text.replace(',', ";").replace('.', ",");
    let dresses = [
        ("plotjuggler", renamed(&plotjuggler)),
        ("plotjuggler, merged", sparse),
        ("rostopic echo -p", renamed(&ros1)),
        (
            "names of the URDF",
            renamed(&|name| {
                if ["q", "dq", "tau"]
                    .iter()
                    .any(|c| name.starts_with(&format!("{c}/")))
                {
                    format!("{name}_joint")
                } else {
                    name.to_owned()
                }
            }),
        ),
        ("semicolons and decimal commas", german),
        ("tabs", text.replace(',', "\t")),
    ];
    for (what, text) in dresses {
        let folder = folder();
        let log = folder.path().join("log.csv");
        fs::write(&log, text).unwrap();
        assert_same(&imported(&log, &[]), &expected, what);
    }
}

/// Joint states as `rostopic echo -p` prints them: nanoseconds, and the joints' names in the cells.
#[test]
fn names_may_stand_in_the_cells() {
    let text = unpacked(&recordings().join("joint_state.csv.gz"));
    let expected = table(&text);
    let columns: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    let place = |name: &str| columns.iter().position(|column| *column == name).unwrap();
    let joints: Vec<&str> = columns
        .iter()
        .filter_map(|c| c.strip_prefix("q/"))
        .collect();
    let mut ros1 = "%time,field.header.seq".to_owned();
    for quantity in ["name", "position", "velocity", "effort"] {
        ros1 += &(0..12)
            .map(|n| format!(",field.{quantity}{n}"))
            .collect::<String>();
    }
    for line in text.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let nanoseconds = (cells[0].parse::<f64>().unwrap() * 1e9).round();
        ros1 += &format!("\n{nanoseconds},7");
        ros1 += &joints
            .iter()
            .map(|joint| format!(",{joint}_joint"))
            .collect::<String>();
        for channel in ["q", "dq", "tau"] {
            ros1 += &joints
                .iter()
                .map(|j| format!(",{}", cells[place(&format!("{channel}/{j}"))]))
                .collect::<String>();
        }
    }
    let folder = folder();
    let log = folder.path().join("log.csv");
    fs::write(&log, ros1 + "\n").unwrap();
    let found = imported(&log, &[]);
    for (name, numbers) in expected.iter().filter(|(name, _)| *name != "t") {
        assert_eq!(found[name], *numbers, "{name}");
    }
    for (a, b) in found["t"].iter().zip(&expected["t"]) {
        assert!((f64::from_bits(*a) - f64::from_bits(*b)).abs() < 1e-12);
    }
}
