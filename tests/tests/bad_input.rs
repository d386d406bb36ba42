//! Every way in which a log can be bad: the message names file, line, column and the fix, the status is 1, and no file
//! is written.

use std::fs;
use std::io::Write;
use std::path::Path;

use flate2::{Compression, write::GzEncoder};
use proprio_core::go2::Leg;
use proprio_host::log::LogWriter;
use proprio_simulator::Simulation;
use proprio_tests::command::{proprio, refusal, stderr, stdout};

/// A log as cells, to be spoilt.
#[derive(Clone)]
struct Sheet(Vec<Vec<String>>);

impl Sheet {
    /// Two good seconds of one leg at 500 Hz.
    fn good() -> Self {
        let simulation = Simulation {
            duration: 2.0,
            ..Simulation::new(&[Leg::FR])
        };
        let mut log = LogWriter::new(Vec::new(), &simulation.legs).unwrap();
        for sample in simulation.samples() {
            let sample = sample.unwrap();
            log.row(sample.t, &sample.q, &sample.dq, &sample.tau)
                .unwrap();
        }
        let text = String::from_utf8(log.finish().unwrap()).unwrap();
        let cells = |line: &str| line.split(',').map(str::to_owned).collect();
        Self(text.lines().map(cells).collect())
    }

    fn text(&self) -> String {
        self.0.iter().map(|row| row.join(",") + "\n").collect()
    }

    fn column(&self, name: &str) -> usize {
        self.0[0]
            .iter()
            .position(|heading| heading == name)
            .unwrap()
    }

    /// The sheet with one cell replaced; lines count from 1, the header's.
    fn with(&self, line: usize, column: &str, cell: &str) -> Self {
        let mut sheet = self.clone();
        let column = self.column(column);
        sheet.0[line - 1][column] = cell.to_owned();
        sheet
    }

    /// The sheet with the numbers of some columns changed from line `first` on.
    fn map(&self, first: usize, columns: &[&str], change: impl Fn(f64) -> f64) -> Self {
        let mut sheet = self.clone();
        for name in columns {
            let column = self.column(name);
            for row in &mut sheet.0[first - 1..] {
                row[column] = change(row[column].parse().unwrap()).to_string();
            }
        }
        sheet
    }

    fn renamed(&self, from: &str, to: &str) -> Self {
        self.with(1, from, to)
    }

    fn without(&self, columns: &[&str]) -> Self {
        let dropped: Vec<usize> = columns.iter().map(|name| self.column(name)).collect();
        let keep = |row: &Vec<String>| {
            let kept = row
                .iter()
                .enumerate()
                .filter(|(index, _)| !dropped.contains(index));
            kept.map(|(_, cell)| cell.clone()).collect()
        };
        Self(self.0.iter().map(keep).collect())
    }

    fn lines(&self, count: usize) -> Self {
        Self(self.0[..count].to_vec())
    }
}

/// A row that lies a line too early or too late is left out, and named.
#[test]
fn rows_out_of_order_are_left_out() {
    let mut log = Sheet::good();
    log.0.swap(499, 500);
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("log.csv"), log.text()).unwrap();
    let output = proprio(folder.path(), &["identify", "log.csv"]);
    let message = stderr(&output);
    assert!(output.status.success(), "{message}");
    assert!(
        message.contains("1 of 1001 samples is left out") && message.contains("line 500"),
        "{message}"
    );
}

/// Identifies `contents` as `log.csv` and returns the message after all that must hold of any bad log.
fn refused(contents: &[u8]) -> String {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("log.csv"), contents).unwrap();
    refused_in(folder.path())
}

fn refused_in(folder: &Path) -> String {
    let before = fs::read_dir(folder).unwrap().count();
    let message = refusal(folder, &["identify", "log.csv", "--json", "-o", "out.json"]);
    assert_eq!(
        fs::read_dir(folder).unwrap().count(),
        before,
        "a file was left behind"
    );
    assert!(message.starts_with("error: log.csv"), "{message}");
    assert!(message.contains("\nhint: "), "{message}");
    message
}

/// One snapshot of all messages, so that a change of wording is one readable difference.
#[test]
fn each_bad_log_is_refused_with_its_place_and_the_fix() {
    let good = Sheet::good();
    let all_q = ["q/FR_hip", "q/FR_thigh", "q/FR_calf"];
    let mut joined = good.clone();
    joined.0.extend_from_slice(&good.0[1..]);
    let mut short_row = good.clone();
    short_row.0.last_mut().unwrap().truncate(5);
    let mut long_row = good.clone();
    long_row.0[7].push("0.1".to_owned());
    let mut twice = good.clone();
    twice.0.iter_mut().for_each(|row| row.push(row[1].clone()));
    let imu = |axes: &[&str]| {
        let mut sheet = good.clone();
        sheet.0[0].extend(axes.iter().map(|axis| (*axis).to_owned()));
        sheet.0[1..]
            .iter_mut()
            .for_each(|row| row.extend(axes.iter().map(|_| "0".to_owned())));
        sheet
    };
    let stretched = |factor: f64| good.map(2, &["t"], move |t| t * factor);

    // What is wrong, the log, and the place its message must name.
    let cases: Vec<(&str, String, &str)> = vec![
        ("empty", String::new(), "line 1"),
        ("blank lines only", "\n\n\n".to_owned(), "line 1"),
        ("header only", good.lines(1).text(), "line 1"),
        ("one row", good.lines(2).text(), "line 2"),
        ("no header", Sheet(good.0[1..].to_vec()).text(), "line 1"),
        (
            "ros2 topic echo --csv of joint states",
            "1700000000,4000000,,FR_hip,FR_thigh,0.1,0.8,0.0,0.0,1.5,-2.25\n".repeat(3),
            "line 1",
        ),
        (
            "ros2 topic echo --csv of a LowState",
            "254,239,255,0,0,0,0.5,-0.25\n".repeat(3),
            "line 1",
        ),
        ("bars", good.text().replace(',', "|"), "line 1"),
        ("no time", good.without(&["t"]).text(), "line 1"),
        (
            "no joints",
            good.renamed("t", "t")
                .without(
                    &good.0[0][1..]
                        .iter()
                        .map(String::as_str)
                        .collect::<Vec<_>>(),
                )
                .text(),
            "line 1",
        ),
        (
            "unknown joint",
            good.renamed("q/FR_calf", "q/FR_knee").text(),
            "line 1, column 4 (q/FR_knee)",
        ),
        (
            "wrong case",
            good.renamed("dq/FR_hip", "dq/fr_hip").text(),
            "line 1, column 5 (dq/fr_hip)",
        ),
        (
            "unknown leg",
            imu(&["foot/front"]).text(),
            "line 1, column 11 (foot/front)",
        ),
        (
            "missing channel",
            good.without(&["tau/FR_thigh"]).text(),
            "line 1",
        ),
        (
            "position only",
            good.without(&["dq/FR_hip", "tau/FR_hip"]).text(),
            "line 1",
        ),
        (
            "missing joint",
            good.without(&["q/FR_calf", "dq/FR_calf", "tau/FR_calf"])
                .text(),
            "line 1",
        ),
        ("missing axis", imu(&["gyro/x", "gyro/y"]).text(), "line 1"),
        (
            "column twice",
            twice.renamed("q/FR_hip", "q/FR_hip").text(),
            "line 1, column 11 (q/FR_hip)",
        ),
        (
            "text in a number",
            good.with(12, "dq/FR_calf", "fast").text(),
            "line 12, column 7 (dq/FR_calf)",
        ),
        (
            "empty cell",
            good.with(12, "tau/FR_hip", "").text(),
            "line 12, column 8 (tau/FR_hip)",
        ),
        (
            "NaN",
            good.with(100, "q/FR_thigh", "nan").text(),
            "line 100, column 3 (q/FR_thigh)",
        ),
        (
            "infinity",
            good.with(100, "tau/FR_calf", "-inf").text(),
            "line 100, column 10 (tau/FR_calf)",
        ),
        (
            "no time stamp",
            good.with(100, "t", "NaN").text(),
            "line 100, column 1 (t)",
        ),
        (
            "two recordings joined",
            joined.text(),
            "line 1003, column 1 (t)",
        ),
        (
            "gap of 4 hours",
            good.map(501, &["t"], |t| t + 4.0 * 3600.0).text(),
            "line 501, column 1 (t)",
        ),
        ("short row", short_row.text(), "line 1002"),
        ("long row", long_row.text(), "line 8"),
        (
            "degrees",
            good.map(2, &all_q, f64::to_degrees).text(),
            "line 2, column 2 (q/FR_hip)",
        ),
        (
            "wrong sign",
            good.map(2, &["q/FR_calf"], |q| -q).text(),
            "line 2, column 4 (q/FR_calf)",
        ),
        ("20 Hz", stretched(25.0).text(), "line 3, column 1 (t)"),
        (
            "milliseconds",
            stretched(1e3).text(),
            "line 3, column 1 (t)",
        ),
        (
            "microseconds",
            stretched(1e6).text(),
            "line 3, column 1 (t)",
        ),
    ];
    let mut messages = String::new();
    for (what, contents, place) in cases {
        let message = refused(contents.as_bytes());
        assert!(
            message.contains(place),
            "{what}: `{place}` is not in {message}"
        );
        messages += &format!("# {what}\n{message}\n");
    }
    insta::assert_snapshot!(messages);
}

/// More than any motor of the robot can do: not the reader's to judge, but no estimate either.
#[test]
fn torque_in_another_unit_is_refused() {
    let tau = ["tau/FR_hip", "tau/FR_thigh", "tau/FR_calf"];
    let message = refused(
        Sheet::good()
            .map(2, &tau, |t| t * 1e3 + 1e3)
            .text()
            .as_bytes(),
    );
    assert!(message.contains("N m"), "{message}");
}

#[test]
fn a_file_that_cannot_be_read_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("log.csv");
    assert!(refused_in(folder.path()).contains("cannot open"), "missing");

    fs::create_dir(&log).unwrap();
    assert!(
        refused_in(folder.path()).contains("cannot open"),
        "a directory"
    );
    fs::remove_dir(&log).unwrap();

    fs::write(&log, Sheet::good().text()).unwrap();
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        fs::set_permissions(&log, fs::Permissions::from_mode(0o000)).unwrap();
        if fs::File::open(&log).is_ok() {
            println!("skipped: this user reads files whatever their permissions");
        } else {
            assert!(refused_in(folder.path()).contains("chmod +r"), "unreadable");
        }
    }
}

#[test]
fn a_cut_off_gzip_is_refused_with_the_line_it_reaches() {
    let mut gzip = GzEncoder::new(Vec::new(), Compression::fast());
    gzip.write_all(Sheet::good().text().as_bytes()).unwrap();
    let whole = gzip.finish().unwrap();
    let message = refused(&whole[..whole.len() / 2]);
    assert!(
        message.contains("line 5") && message.contains("cannot read on"),
        "{message}"
    );
}

#[test]
fn a_column_that_identify_does_not_use_may_hold_anything() {
    let folder = tempfile::tempdir().unwrap();
    let mut sheet = Sheet::good();
    sheet.0[0].extend(["temp/FR_hip".to_owned(), "note".to_owned()]);
    sheet.0[1..]
        .iter_mut()
        .for_each(|row| row.extend(["".to_owned(), "hot".to_owned()]));
    fs::write(folder.path().join("log.csv"), sheet.text()).unwrap();
    let output = proprio(folder.path(), &["identify", "log.csv"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
}

#[test]
fn the_same_log_in_another_dress_gives_the_same_result() {
    let folder = tempfile::tempdir().unwrap();
    let good = Sheet::good();
    let reversed = Sheet(
        good.0
            .iter()
            .map(|row| row.iter().rev().cloned().collect())
            .collect(),
    );
    let mut gzip = GzEncoder::new(Vec::new(), Compression::fast());
    gzip.write_all(good.text().as_bytes()).unwrap();
    let german = good.text().replace(',', ";").replace('.', ",");
    let dresses: [(&str, Vec<u8>); 7] = [
        ("semicolons.csv", good.text().replace(',', ";").into_bytes()),
        ("german.csv", german.into_bytes()),
        ("plain.csv", good.text().into_bytes()),
        ("reversed.csv", reversed.text().into_bytes()),
        (
            "windows.csv",
            format!("\u{feff}{}", good.text().replace('\n', "\r\n")).into_bytes(),
        ),
        ("spaced.csv", good.text().replace(',', ", ").into_bytes()),
        // Compressed whatever its name.
        ("gzip.csv", gzip.finish().unwrap()),
    ];
    let mut results = Vec::new();
    for (name, contents) in dresses {
        fs::write(folder.path().join(name), contents).unwrap();
        let output = proprio(folder.path(), &["identify", name]);
        assert_eq!(output.status.code(), Some(0), "{name}: {}", stderr(&output));
        // The command that it ends with names the log.
        results.push((name, stdout(&output).replace(name, "log.csv")));
    }
    for (name, result) in &results[1..] {
        assert_eq!(*result, results[0].1, "{name}");
    }
}

#[test]
fn gaps_and_repeated_stamps_are_told_and_survived() {
    let folder = tempfile::tempdir().unwrap();
    let mut sheet = Sheet::good().map(501, &["t"], |t| t + 5.0);
    let repeated = sheet.0[700].clone();
    sheet.0.insert(701, repeated);
    fs::write(folder.path().join("log.csv"), sheet.text()).unwrap();
    let output = proprio(folder.path(), &["identify", "log.csv"]);
    assert_eq!(output.status.code(), Some(0));
    insta::assert_snapshot!(stderr(&output));
}
