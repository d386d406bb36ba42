//! The real `proprio` binary, and logs to feed it.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::OnceLock;

use proprio_host::live::HAS_DDS;
use serde_json::Value;
use tempfile::TempDir;

use crate::schema::Schema;

/// The `proprio` binary of the profile under test; built on first use, since cargo builds a package's binaries only for
/// that package's own tests.
pub fn binary() -> &'static Path {
    static BINARY: OnceLock<PathBuf> = OnceLock::new();
    BINARY.get_or_init(|| {
        // target/<profile>/deps/<this test>
        let test = std::env::current_exe().expect("a test has a path");
        let folder = test
            .ancestors()
            .nth(2)
            .expect("tests lie in target/<profile>/deps");
        let profile = match folder.file_name().and_then(|name| name.to_str()) {
            Some("debug") | None => "dev",
            Some(profile) => profile,
        };
        let built = Command::new(env!("CARGO"))
            .args([
                "build",
                "--quiet",
                "--package",
                "proprio",
                "--bin",
                "proprio",
            ])
            // As these tests were built: with other features cargo compiles the rooms again.
            .args(HAS_DDS.then_some("--features=dds"))
            .args(["--profile", profile, "--target-dir"])
            .arg(
                folder
                    .parent()
                    .expect("a profile's folder lies in the target folder"),
            )
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .status()
            .expect("cargo runs");
        assert!(built.success(), "the binary does not build");
        folder.join("proprio")
    })
}

/// Runs `proprio` with `arguments` in `folder`. What --json prints is held to the command's schema, whatever the test is about.
pub fn proprio(folder: &Path, arguments: &[&str]) -> Output {
    let output = Command::new(binary())
        .env_remove("COLUMNS")
        .args(arguments)
        .current_dir(folder)
        .output()
        .expect("proprio runs");
    // Wrong usage has no object.
    if arguments.contains(&"--json") && output.status.code() != Some(2) {
        let value = json(&stdout(&output));
        let faults = Schema::read(&schema_of(arguments[0])).faults(&value);
        assert!(faults.is_empty(), "{arguments:?}: {faults:#?}");
    }
    output
}

/// Starts `proprio` with a pipe into it.
pub fn start(folder: &Path, arguments: &[&str]) -> Child {
    Command::new(binary())
        .args(arguments)
        .current_dir(folder)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("proprio runs")
}

/// Pipes a file of `folder` into `proprio`.
pub fn piped(folder: &Path, from: &str, arguments: &[&str]) -> Output {
    let mut child = start(folder, arguments);
    let mut stdin = child.stdin.take().expect("a pipe");
    let text = std::fs::read(folder.join(from)).expect("a file of the test");
    let writer = std::thread::spawn(move || {
        // Whoever has seen enough closes the pipe.
        let _ = stdin.write_all(&text);
    });
    let output = child.wait_with_output().expect("proprio ends");
    writer.join().expect("a writer that ends");
    output
}

/// The schema of what a command prints with --json.
pub fn schema_of(command: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../docs/schema/{command}.json"))
}

/// What went to standard output.
pub fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// What went to standard error.
pub fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Standard output of a run that must succeed.
pub fn done(folder: &Path, arguments: &[&str]) -> String {
    let output = proprio(folder, arguments);
    assert_eq!(
        output.status.code(),
        Some(0),
        "{arguments:?}: {}",
        stderr(&output)
    );
    stdout(&output)
}

/// The message of a run that must be refused: status 1, words and a hint on standard error; the same as an object on standard output with --json, and
/// nothing there without.
pub fn refusal(folder: &Path, arguments: &[&str]) -> String {
    let output = proprio(folder, arguments);
    let message = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{arguments:?}: {message}");
    if arguments.contains(&"--json") {
        let refused = json(&stdout(&output));
        assert_eq!(refused["verdict"], "refused", "{arguments:?}");
        let reason = refused["reason"].as_str().unwrap();
        assert!(
            message.contains(reason.lines().next().unwrap()),
            "{message}"
        );
    } else {
        assert_eq!(stdout(&output), "", "{arguments:?}");
    }
    message
}

/// An empty folder that goes away with the value.
pub fn folder() -> TempDir {
    tempfile::tempdir().expect("a folder can be made")
}

/// Writes `arm.toml`, an arm of three joints that turn: the rod that slides is held.
pub fn frf_arm(folder: &Path) {
    let urdf = Path::new(env!("CARGO_MANIFEST_DIR")).join("robots/arm.urdf");
    let urdf = urdf.display().to_string();
    let model = format!("format = 1\n[robot]\nurdf = {urdf:?}\n[held]\nslide = 0.0\n");
    std::fs::write(folder.join("arm.toml"), model).expect("a folder of our own");
}

/// A folder with the `log.csv` that `simulate` makes of these arguments.
pub fn simulated(arguments: &str) -> TempDir {
    let folder = folder();
    let arguments: Vec<&str> = arguments.split_whitespace().collect();
    let fixed = ["simulate", "-o", "log.csv"];
    done(folder.path(), &[&fixed[..], &arguments].concat());
    folder
}

/// A JSON text.
pub fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap()
}

/// The entry of `parameters` in a result or truth file.
pub fn parameter<'a>(file: &'a Value, name: &str) -> &'a Value {
    let parameters = file["parameters"].as_array().unwrap();
    parameters
        .iter()
        .find(|p| p["name"] == name)
        .unwrap_or_else(|| panic!("no parameter {name}"))
}

/// What `diagnose` added and removed: its path without the rungs that it begins from.
pub fn steps(diagnosis: &Value) -> Vec<Value> {
    let path = diagnosis["path"].as_array().unwrap();
    let is_step = |rung: &&Value| rung["step"] == "add" || rung["step"] == "remove";
    path.iter().filter(is_step).cloned().collect()
}

/// The folder of recorded logs: `$PROPRIO_SHARED/data`, or `../shared/data` beside the workspace; none, and a line that
/// says so, where there is neither.
pub fn recorded_logs() -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared");
    let shared = std::env::var_os("PROPRIO_SHARED").map_or(beside, PathBuf::from);
    let folder = shared.join("data");
    if folder.is_dir() {
        Some(folder)
    } else {
        println!("skipped: no recorded logs in {}", folder.display());
        None
    }
}

/// The recorded chirps of a hung Go2, in the order of their names; none where there are no [`recorded_logs`].
///
/// # Panics
/// Where the folder has not all five.
pub fn recorded_chirps() -> Vec<PathBuf> {
    let Some(logs) = recorded_logs() else {
        return Vec::new();
    };
    let files = std::fs::read_dir(logs).expect("a folder").flatten();
    let is_chirp = |path: &PathBuf| path.display().to_string().contains("go2_air_chirp_");
    let mut chirps: Vec<PathBuf> = files.map(|file| file.path()).filter(is_chirp).collect();
    chirps.sort();
    assert_eq!(chirps.len(), 5, "{chirps:?}");
    chirps
}
