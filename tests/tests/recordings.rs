//! Recordings of others, written by independent implementations (`tests/oracle/recordings.py`): every number arrives to the
//! last bit, in every command, through files, folders and standard input.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use flate2::read::GzDecoder;
use proprio_tests::command::{binary, done, folder, json, proprio, recorded_logs, stderr, stdout};
use proptest::prelude::*;

fn recordings() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("oracle/recordings")
}

/// Columns by name, their numbers as bits.
type Table = BTreeMap<String, Vec<u64>>;

fn table(text: &str) -> Table {
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let mut table: Table = names
        .iter()
        .map(|name| ((*name).to_owned(), Vec::new()))
        .collect();
    for line in lines {
        for (name, cell) in names.iter().zip(line.split(',')) {
            let bits = cell.parse::<f64>().unwrap().to_bits();
            table.get_mut(*name).unwrap().push(bits);
        }
    }
    table
}

/// The text of a gzip-compressed file.
fn unpacked(path: &Path) -> String {
    let mut text = String::new();
    GzDecoder::new(File::open(path).unwrap())
        .read_to_string(&mut text)
        .unwrap();
    text
}

/// What `proprio import` makes of a recording.
fn imported(recording: &Path, more: &[&str]) -> Table {
    let folder = folder();
    let recording = recording.to_str().unwrap();
    done(
        folder.path(),
        &[&["import", recording, "-o", "log.csv"], more].concat(),
    );
    table(&fs::read_to_string(folder.path().join("log.csv")).unwrap())
}

/// Every channel of `expected`, and no other.
fn assert_same(found: &Table, expected: &Table, what: &str) {
    let names = |table: &Table| table.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(found), names(expected), "{what}");
    for (name, numbers) in expected {
        assert_eq!(found[name].len(), numbers.len(), "{what}: {name}");
        let differs = numbers.iter().zip(&found[name]).position(|(a, b)| a != b);
        if let Some(row) = differs {
            let of = |table: &Table| f64::from_bits(table[name][row]);
            panic!(
                "{what}: {name}, row {row}: {} instead of {}",
                of(found),
                of(expected)
            );
        }
    }
}

const OF_A_GO2: [(&str, &str); 12] = [
    ("go_mcap/go_mcap.mcap", "low_state"),
    ("go_mcap", "low_state"),
    ("go_mcap_zstd/go_mcap_zstd.mcap", "low_state"),
    ("go_lz4.mcap", "low_state"),
    ("go_db3/go_db3.db3", "low_state"),
    ("joint_mcap", "joint_state"),
    ("joint_db3", "joint_state"),
    ("log.npz", "joint_state"),
    ("log_compressed.npz", "joint_state"),
    ("columns.npz", "joint_state"),
    ("log.parquet", "joint_state"),
    ("lerobot", "lerobot"),
];

#[test]
fn every_recording_arrives_to_the_last_bit() {
    for (recording, expected) in OF_A_GO2 {
        let expected = table(&unpacked(&recordings().join(format!("{expected}.csv.gz"))));
        let found = imported(&recordings().join(recording), &[]);
        assert_same(&found, &expected, recording);
    }
}

/// `proprio identify - < recording`, and `import … -o - | identify -`, as the file itself.
#[test]
fn standard_input_is_a_log_too() {
    let through = |recording: &str, arguments: &[&str]| {
        let child = Command::new(binary())
            .args(arguments)
            .stdin(Stdio::from(
                File::open(recordings().join(recording)).unwrap(),
            ))
            .stdout(Stdio::piped())
            .output()
            .unwrap();
        assert_eq!(child.status.code(), Some(0), "{recording}");
        String::from_utf8(child.stdout).unwrap()
    };
    for (recording, expected) in [
        ("go_lz4.mcap", "low_state"),
        ("go_db3/go_db3.db3", "low_state"),
        ("log.npz", "joint_state"),
        ("log.parquet", "joint_state"),
        ("low_state.csv.gz", "low_state"),
    ] {
        let found = table(&through(recording, &["import", "-", "-o", "-"]));
        let expected = table(&unpacked(&recordings().join(format!("{expected}.csv.gz"))));
        assert_same(&found, &expected, recording);
    }
}

/// Nothing but where the log lies differs between what is found in a bag and in its CSV.
#[test]
fn a_bag_gives_the_estimates_of_its_csv() {
    let of = |log: &str| {
        let path = recordings().join(log);
        let mut result = json(&done(
            Path::new("."),
            &["identify", path.to_str().unwrap(), "--json"],
        ));
        result.as_object_mut().unwrap().remove("logs");
        result["warnings"].take();
        result
    };
    let expected = of("low_state.csv.gz");
    assert!(expected["parameters"].as_array().unwrap().len() > 100);
    for bag in ["go_mcap", "go_mcap_zstd", "go_lz4.mcap", "go_db3"] {
        assert_eq!(of(bag), expected, "{bag}");
    }
}

/// The same with a real chirp, where one is at hand and Python has the writers.
#[test]
fn a_bag_of_a_real_chirp_gives_the_estimates_of_its_csv() {
    let Some(logs) = recorded_logs() else { return };
    let python = std::env::var("PROPRIO_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let folder = folder();
    let made = Command::new(&python)
        .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("oracle/recordings.py"))
        .arg(folder.path())
        .args(["--seconds", "5", "--log"])
        .arg(logs.join("go2_air_chirp_7.0hz_p25d5.0.csv"))
        .output();
    if !made.is_ok_and(|made| made.status.success()) {
        println!("skipped: {python} lacks what tests/oracle/requirements-recordings.txt names");
        return;
    }
    for (bag, csv) in [
        ("go_mcap_zstd", "low_state.csv.gz"),
        ("go_db3", "low_state.csv.gz"),
        ("joint_mcap", "joint_state.csv.gz"),
    ] {
        let of = |log: &str| {
            let mut result = json(&done(folder.path(), &["identify", log, "--json"]));
            result.as_object_mut().unwrap().remove("logs");
            result["warnings"].take();
            result
        };
        assert_eq!(of(bag), of(csv), "{bag}");
    }
}

/// A recording that was cut short gives its whole messages, and says so.
#[test]
fn a_cut_bag_gives_its_whole_messages() {
    let expected = table(&unpacked(&recordings().join("low_state.csv.gz")));
    let all = expected["t"].len();
    for (bag, name) in [
        ("go_mcap/go_mcap.mcap", "cut.mcap"),
        ("go_lz4.mcap", "cut.mcap"),
        ("go_mcap_zstd/go_mcap_zstd.mcap", "cut.mcap"),
        ("go_db3/go_db3.db3", "cut.db3"),
    ] {
        let whole = fs::read(recordings().join(bag)).unwrap();
        let mut before = 0;
        for percent in [70, 80, 90] {
            let folder = folder();
            let cut = &whole[..whole.len() * percent / 100];
            fs::write(folder.path().join(name), cut).unwrap();
            let output = proprio(folder.path(), &["import", name, "-o", "log.csv"]);
            let words = stderr(&output);
            if output.status.code() == Some(1) {
                // Compressed in one piece, or without the pages that say where the messages are.
                assert!(words.contains("error: cut."), "{bag}: {words}");
                continue;
            }
            assert!(
                words.contains("the file was cut short"),
                "{bag} {percent} %: {words}"
            );
            let found = table(&fs::read_to_string(folder.path().join("log.csv")).unwrap());
            let rows = found["t"].len();
            assert!(
                rows >= before && rows <= all,
                "{bag} {percent} %: {rows} of {all}"
            );
            before = rows;
            for (channel, numbers) in &found {
                assert_eq!(numbers[..], expected[channel][..rows], "{bag}: {channel}");
            }
        }
        assert!(before > all / 3, "{bag}: {before} of {all}");
    }
}

/// Of a bag with two topics of joint states the fuller one is read, and the other told.
#[test]
fn the_other_topics_are_told() {
    let bag = recordings().join("go_mcap");
    let folder = folder();
    let output = proprio(
        folder.path(),
        &["import", bag.to_str().unwrap(), "-o", "log.csv"],
    );
    insta::assert_snapshot!(stderr(&output));
    let report = stdout(&output);
    assert!(
        report.contains("120 samples of 12 joints") && report.contains("500 Hz"),
        "{report}"
    );
}

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

/// What is recorded before the gear becomes what the joints do: positions through the inverse of the transmission, torque
/// through its transpose, so that power is the same.
#[test]
fn motors_are_seen_through_their_transmission() {
    let text = unpacked(&recordings().join("joint_state.csv.gz"));
    let expected = table(&text);
    // The calf's motor sits at the hip's side of the thigh: it turns with both.
    let ratios = [[6.0, 0.0, 0.0], [0.0, 6.0, 0.0], [0.0, -3.0, 12.0]];
    let leg = ["FR_hip", "FR_thigh", "FR_calf"];
    let number = |channel: &str, joint: usize, row: usize| {
        f64::from_bits(expected[&format!("{channel}/{}", leg[joint])][row])
    };
    let mut log = "t".to_owned();
    for channel in ["q", "dq", "tau"] {
        log += &leg
            .iter()
            .map(|joint| format!(",{channel}_motor/{joint}"))
            .collect::<String>();
    }
    for row in 0..expected["t"].len() {
        log += &format!("\n{}", f64::from_bits(expected["t"][row]));
        for channel in ["q", "dq"] {
            for motor in ratios {
                let turns: f64 = (0..3).map(|j| motor[j] * number(channel, j, row)).sum();
                log += &format!(",{turns}");
            }
        }
        // τ = Gᵀ τ_m, from the last joint to the first.
        let tau = |joint| number("tau", joint, row);
        let calf = tau(2) / 12.0;
        log += &format!(",{},{},{calf}", tau(0) / 6.0, (tau(1) + 3.0 * calf) / 6.0);
    }
    let folder = folder();
    fs::write(folder.path().join("motors.csv"), log + "\n").unwrap();
    let model = "format = 1\n[robot]\nbuiltin = \"go2\"\n[log.transmission]\nFR_hip = { FR_hip = 6.0 }\nFR_thigh = { \
                 FR_thigh = 6.0 }\nFR_calf = { FR_thigh = -3.0, FR_calf = 12.0 }\n";
    fs::write(folder.path().join("go2.toml"), model).unwrap();
    done(
        folder.path(),
        &["import", "motors.csv", "-m", "go2.toml", "-o", "joints.csv"],
    );
    let found = table(&fs::read_to_string(folder.path().join("joints.csv")).unwrap());
    for (name, numbers) in &found {
        for (a, b) in numbers.iter().zip(&expected[name]) {
            let (a, b) = (f64::from_bits(*a), f64::from_bits(*b));
            assert!(
                (a - b).abs() < 1e-12 * (1.0 + b.abs()),
                "{name}: {a} instead of {b}"
            );
        }
    }
    assert_eq!(found.len(), 10);
    // One of two coupled motors alone says nothing of either joint; a singular transmission, nothing at all.
    let text = fs::read_to_string(folder.path().join("motors.csv")).unwrap();
    fs::write(
        folder.path().join("motors.csv"),
        text.replace("q_motor/FR_thigh", "q/FR_thigh"),
    )
    .unwrap();
    let import = [
        "import",
        "motors.csv",
        "-m",
        "go2.toml",
        "-o",
        "joints.csv",
        "--force",
    ];
    let half = proprio(folder.path(), &import);
    assert!(stderr(&half).contains("are coupled"), "{}", stderr(&half));
    fs::write(folder.path().join("motors.csv"), text).unwrap();
    fs::write(
        folder.path().join("go2.toml"),
        model.replace("FR_hip = 6.0", "FR_thigh = 6.0"),
    )
    .unwrap();
    let singular = proprio(folder.path(), &import);
    assert!(
        stderr(&singular).contains("cannot be inverted"),
        "{}",
        stderr(&singular)
    );
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, cases: 300, ..ProptestConfig::default() })]

    /// Bytes lost, doubled or changed anywhere: an error or a log, never a panic, never an hour.
    #[test]
    fn no_bytes_make_a_reader_panic(
        which in 0..9usize,
        place in 0.0..1.0f64,
        cut in proptest::bool::ANY,
        bytes in proptest::collection::vec(any::<u8>(), 0..12),
        lost in 0..12usize,
    ) {
        use proprio::log::{LogReader, Selection};
        let files = [
            "go_mcap/go_mcap.mcap", "go_mcap_zstd/go_mcap_zstd.mcap", "go_lz4.mcap", "go_db3/go_db3.db3",
            "joint_mcap/joint_mcap.mcap", "log.npz", "log_compressed.npz", "log.parquet", "low_state.csv.gz",
        ];
        let mut contents = fs::read(recordings().join(files[which])).unwrap();
        let at = (place * contents.len() as f64) as usize;
        if cut {
            contents.truncate(at);
        } else {
            let end = (at + lost).min(contents.len());
            contents.splice(at..end, bytes);
        }
        let file = tempfile::NamedTempFile::new().unwrap();
        fs::write(file.path(), &contents).unwrap();
        if let Ok(mut log) = LogReader::open(file.path(), Selection::Everything) {
            while let Ok(Some(row)) = log.next_row() {
                prop_assert!(row.t().is_finite());
            }
            let _ = log.finish();
        }
    }
}
