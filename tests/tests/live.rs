//! `proprio record -` and `proprio monitor -`: rows as they come. What comes over DDS is tested beside another DDS, by `tests/live/test`.

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use proprio_tests::command::{
    binary, done, folder, json, parameter, refusal, schema_of, simulated, stderr, stdout,
};
use proprio_tests::schema::Schema;
use serde_json::Value;

/// Starts `proprio` with a pipe into it.
fn start(folder: &Path, arguments: &[&str]) -> Child {
    Command::new(binary())
        .args(arguments)
        .current_dir(folder)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("proprio runs")
}

/// Pipes a file into `proprio`.
fn piped(folder: &Path, from: &str, arguments: &[&str]) -> Output {
    let mut child = start(folder, arguments);
    let mut stdin = child.stdin.take().unwrap();
    let text = fs::read(folder.join(from)).unwrap();
    let writer = thread::spawn(move || {
        // Whoever has seen enough closes the pipe.
        let _ = stdin.write_all(&text);
    });
    let output = child.wait_with_output().unwrap();
    writer.join().unwrap();
    output
}

fn report(output: &Output) -> Value {
    assert!(output.status.success(), "{}", stderr(output));
    let value = json(&stdout(output));
    let faults = Schema::read(&schema_of("record")).faults(&value);
    assert!(faults.is_empty(), "{faults:#?}");
    value
}

fn lines(path: &Path) -> Vec<String> {
    let file = fs::File::open(path).unwrap();
    BufReader::new(file).lines().map(Result::unwrap).collect()
}

#[test]
fn rows_of_a_pipe_become_a_log_that_gives_the_same_model() {
    let folder = simulated("--legs FR --typical --duration 8");
    let at = folder.path();
    let log = "log.csv";
    let all = report(&piped(at, log, &["record", "-", "-o", "all.csv", "--json"]));
    let rows = lines(&at.join(log)).len() - 1;
    assert_eq!(
        (&all["recorded"], &all["messages"], &all["gaps"]),
        (&rows.into(), &rows.into(), &0.into())
    );
    let identified = |name| json(&done(at, &["identify", name, "--json"]))["parameters"].clone();
    assert_eq!(identified("all.csv"), identified(log));

    // So is a compressed one; and --seconds is of the rows' own time.
    let some = [
        "record",
        "-",
        "-o",
        "some.csv.gz",
        "--seconds",
        "3",
        "--json",
    ];
    let some = report(&piped(at, log, &some));
    assert_eq!(some["seconds"], 3.0);
    let imported = done(at, &["import", "some.csv.gz", "-o", "some.csv", "--json"]);
    assert_eq!(json(&imported)["samples"], some["recorded"]);
    assert_eq!(fs::read(at.join("some.csv.gz")).unwrap()[..2], [0x1f, 0x8b]);
    assert_eq!(
        lines(&at.join("some.csv"))[..],
        lines(&at.join("all.csv"))[..lines(&at.join("some.csv")).len()]
    );
}

#[test]
fn ctrl_c_and_a_request_to_terminate_leave_a_whole_file() {
    let folder = simulated("--legs FR --typical --duration 8");
    let at = folder.path();
    let text = lines(&at.join("log.csv"));
    for (signal, name) in [("-INT", "int.csv"), ("-TERM", "term.csv.gz")] {
        let mut child = start(at, &["record", "-", "-o", name, "--json"]);
        let mut stdin = child.stdin.take().unwrap();
        // Half of a row is on its way when the user has seen enough.
        let half = text[..=1000].join("\n") + "\n" + &text[1001][..20];
        stdin.write_all(half.as_bytes()).unwrap();
        stdin.flush().unwrap();
        // It reads, on a machine that may be busy, once its temporary file is there.
        let is_temporary = |entry: fs::DirEntry| entry.path().extension() == Some("tmp".as_ref());
        let begun = || (fs::read_dir(at).unwrap()).any(|entry| is_temporary(entry.unwrap()));
        let started = Instant::now();
        while !begun() && started.elapsed() < Duration::from_secs(30) {
            thread::sleep(Duration::from_millis(50));
        }
        thread::sleep(Duration::from_secs(2));
        assert!(!at.join(name).exists());
        let killed = Command::new("kill")
            .args([signal, &child.id().to_string()])
            .status();
        assert!(killed.unwrap().success());
        let output = child.wait_with_output().unwrap();
        assert_eq!(report(&output)["recorded"], 1000, "{signal}");
        let import = ["import", name, "-o", "imported.csv", "--force", "--json"];
        let imported = json(&done(at, &import));
        assert_eq!(imported["samples"], 1000);
        drop(stdin);
    }
}

#[test]
fn a_row_that_cannot_be_read_ends_a_recording_which_is_kept() {
    let folder = simulated("--legs FR --typical --duration 8");
    let at = folder.path();
    let mut text = lines(&at.join("log.csv"));
    text.truncate(800);
    text.push("not a row".to_owned());
    fs::write(at.join("bad.csv"), text.join("\n")).unwrap();
    let output = piped(at, "bad.csv", &["record", "-", "-o", "kept.csv"]);
    assert_eq!(output.status.code(), Some(1));
    let said = stderr(&output);
    assert!(said.contains("Recorded 799 rows"), "{said}");
    assert!(said.contains("line 801"), "{said}");
    assert_eq!(lines(&at.join("kept.csv")).len(), 800);
}

/// The device in this process finds live what the same device finds in the file.
#[test]
fn a_device_hears_the_rows_of_a_pipe() {
    let folder = simulated("--legs FR --typical --duration 12 --hide quadratic_drag:FR_calf=0.05");
    let at = folder.path();
    let watched = piped(at, "log.csv", &["monitor", "-", "--json"]);
    assert!(watched.status.success(), "{}", stderr(&watched));
    let watched = json(&stdout(&watched));
    let replayed = json(&done(
        at,
        &["replay", "log.csv", "--to", "desktop", "--json"],
    ));
    assert_eq!(watched["counters"]["legs"], replayed["counters"]["legs"]);
    for name in ["viscous:FR_calf", "coulomb:FR_hip", "bias:FR_thigh"] {
        assert_eq!(parameter(&watched, name), parameter(&replayed, name));
    }
    let lacks = |ranked: &Value| {
        ranked["missing"] == true
            && ranked["effect"] == "quadratic_drag"
            && ranked["joint"] == "FR_calf"
    };
    assert!(watched["ranking"].as_array().unwrap().iter().any(lacks));
}

/// Of a source that says nothing the memory and the screen live on, and the command ends when it is asked to.
#[test]
fn a_silent_source_is_waited_for_and_left() {
    let folder = folder();
    let started = Instant::now();
    let mut child = start(folder.path(), &["record", "-", "-o", "log.csv"]);
    let stdin = child.stdin.take();
    thread::sleep(Duration::from_millis(500));
    assert!(child.try_wait().unwrap().is_none());
    let killed = Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status();
    assert!(killed.unwrap().success());
    let output = child.wait_with_output().unwrap();
    drop(stdin);
    assert_eq!(output.status.code(), Some(1));
    assert!(started.elapsed() < Duration::from_secs(10));
    assert!(!folder.path().join("log.csv").exists());
}

#[test]
fn what_is_no_source_is_refused_with_the_way() {
    let folder = folder();
    let at = folder.path();
    let refused = |source: &str, output: &str| {
        let arguments = ["record", source, "-o", output];
        let output = Command::new(binary())
            .args(arguments)
            .current_dir(at)
            .stdin(Stdio::null())
            .output()
            .unwrap();
        (output.status.code(), stderr(&output))
    };
    let (code, said) = refused("/dev/ttyACM0", "log.csv");
    assert_eq!(code, Some(2));
    assert!(
        said.contains("monitor /dev/ttyACM0 --record FILE"),
        "{said}"
    );
    let (code, said) = refused("-", "log.mcap");
    assert_eq!(code, Some(2));
    assert!(said.contains("name a .csv or .csv.gz"), "{said}");
    // This build has no DDS, and says how one with it is made.
    let said = refusal(at, &["record", "dds:eth0", "-o", "log.csv"]);
    assert!(
        said.contains("cargo install --path proprio --features dds"),
        "{said}"
    );
}
