//! `proprio monitor` as its user meets it: a terminal that the test drives, lines, JSON, recordings, factors.

use std::fs;
use std::io::{Read, Write};
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use portable_pty::{Child, CommandBuilder, PtySize, native_pty_system};
use proprio_tests::command::{
    binary, done, folder, json, parameter, proprio, refusal, simulated, stderr,
};

const ROWS: u16 = 30;
const COLUMNS: u16 = 120;

/// A `proprio` in a terminal.
struct Driven {
    child: Box<dyn Child + Send + Sync>,
    keys: Box<dyn Write + Send>,
    screen: Arc<Mutex<vt100::Parser>>,
    _terminal: Box<dyn portable_pty::MasterPty + Send>,
}

impl Driven {
    fn new(folder: &Path, arguments: &[&str]) -> Self {
        let size = PtySize {
            rows: ROWS,
            cols: COLUMNS,
            pixel_width: 0,
            pixel_height: 0,
        };
        let pair = native_pty_system().openpty(size).unwrap();
        let mut command = CommandBuilder::new(binary());
        command.args(arguments);
        command.cwd(folder);
        command.env("TERM", "xterm-256color");
        let child = pair.slave.spawn_command(command).unwrap();
        let screen = Arc::new(Mutex::new(vt100::Parser::new(ROWS, COLUMNS, 0)));
        let mut output = pair.master.try_clone_reader().unwrap();
        let parser = screen.clone();
        std::thread::spawn(move || {
            let mut bytes = [0; 4096];
            while let Ok(length @ 1..) = output.read(&mut bytes) {
                parser.lock().unwrap().process(&bytes[..length]);
            }
        });
        Self {
            child,
            keys: pair.master.take_writer().unwrap(),
            screen,
            _terminal: pair.master,
        }
    }

    fn screen(&self) -> String {
        self.screen.lock().unwrap().screen().contents()
    }

    fn press(&mut self, keys: &str) {
        self.keys.write_all(keys.as_bytes()).unwrap();
        self.keys.flush().unwrap();
    }

    /// Waits until the screen is as it should be.
    fn until(&self, what: &str, holds: impl Fn(&str) -> bool) -> String {
        let start = Instant::now();
        loop {
            let screen = self.screen();
            if holds(&screen) {
                return screen;
            }
            assert!(
                start.elapsed() < Duration::from_secs(120),
                "no {what}:\n{screen}"
            );
            std::thread::sleep(Duration::from_millis(30));
        }
    }
}

impl Drop for Driven {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[test]
fn a_first_time_user_sees_what_is_missing_and_adds_it_with_keys() {
    let folder = folder();
    let mut driven = Driven::new(
        folder.path(),
        &["monitor", "sim", "--speed", "0", "--record", "run.messages"],
    );
    let screen = driven.until("missing effect", |s| {
        s.contains("▸MISSING quadratic_drag:FR_calf")
    });
    assert!(screen.contains("proprio sim desktop"), "{screen}");
    assert!(
        screen.contains("FR_calf lacks quadratic_drag"),
        "no event:\n{screen}"
    );
    driven.press("a");
    driven.until("answer", |s| s.contains("add quadratic_drag:FR_calf: done"));
    driven.press("2");
    driven.press("\x1b[6~\x1b[6~\x1b[6~\x1b[6~");
    driven.until("the leg's own parameter", |s| {
        s.contains("quadratic_drag:FR_calf") && s.contains('●')
    });
    driven.press("1");
    driven.press("s");
    driven.until("saved model", |s| {
        s.contains("the model is in monitor-1.toml")
    });
    driven.press("f");
    driven.until("saved factors", |s| {
        s.contains("factors are in monitor-1.bin")
    });
    // Once does nothing; another key takes it back.
    driven.press("r");
    driven.until("question", |s| s.contains("r again: forget all data"));
    driven.press("x");
    driven.until("keys", |s| s.contains("q quit"));
    driven.press("rr");
    driven.until("reset", |s| s.contains("reset: done"));
    driven.press("w");
    driven.until("snapshot", |s| s.contains("snapshot: done"));
    driven.press("p");
    driven.until("pause", |s| s.contains("PAUSED"));
    driven.press("p");
    driven.press("q");
    assert!(driven.child.wait().unwrap().success());

    // What was kept is what other commands take.
    let shown = done(folder.path(), &["show", "monitor-1.toml"]);
    assert!(shown.contains("quadratic_drag"), "{shown}");
    let merged = json(&done(
        folder.path(),
        &["identify", "--factor", "monitor-1.bin", "--json"],
    ));
    assert_eq!(merged["legs"].as_array().unwrap().len(), 4);
    let again = json(&done(
        folder.path(),
        &["monitor", "run.messages", "--speed", "0", "--json"],
    ));
    let told = again["events"].to_string();
    for event in [
        "desktop says hello",
        "FR_calf lacks quadratic_drag",
        "add quadratic_drag:FR_calf: done",
        "reset: done",
    ] {
        assert!(told.contains(event), "{event}: {told}");
    }
}

#[test]
fn without_a_terminal_lines_are_printed_and_a_recording_gives_them_again() {
    let folder = folder();
    let watch = ["monitor", "sim", "--speed", "0", "--seconds", "20"];
    let text = done(
        folder.path(),
        &[&watch[..], &["--record", "a.messages"]].concat(),
    );
    assert!(
        text.contains("FR 5") && text.contains(" windows, 5"),
        "{text}"
    );
    assert!(text.contains("lacks quadratic_drag:FR_calf"), "{text}");
    let again = ["monitor", "a.messages", "--speed", "0", "--seconds", "20"];
    let last = |text: &str| text.lines().last().map(str::to_owned);
    assert_eq!(last(&done(folder.path(), &again)), last(&text));

    let report = json(&done(folder.path(), &[&watch[..], &["--json"]].concat()));
    assert_eq!(report["board"], "desktop");
    assert_eq!(report["ranking"][0]["effect"], "quadratic_drag");
    assert_eq!(report["messages_missed"], 0);
    // What --hide asks for is what is hidden.
    let other = json(&done(
        folder.path(),
        &[&watch[..], &["--json", "--hide", "bias:FL_hip=0.4"]].concat(),
    ));
    assert_ne!(
        other["ranking"][0]["missing"], true,
        "{}",
        other["ranking"][0]
    );
    let bias = parameter(&other, "bias:FL_hip");
    let off = bias["value"].as_f64().unwrap() - 0.4;
    assert!(off.abs() < 0.1, "{bias}");
}

#[test]
fn a_device_is_told_priors_and_legs() {
    let folder = folder();
    let told = "monitor sim --speed 0 --seconds 12 --json --legs FR,RL --body FR_calf=0.001 \
                --prior viscous:FR_hip=0.3,0.00001 --imu-at -0.02,0,0.07 --bus-baud 2000000 --prior bias=0,NAN";
    let refused = proprio(folder.path(), &told.split_whitespace().collect::<Vec<_>>());
    assert_eq!(refused.status.code(), Some(2));
    assert!(stderr(&refused).contains("NAN is no number"));
    let told = told.replace("--prior bias=0,NAN", "--prior bias=0,-1");
    let report = json(&done(
        folder.path(),
        &told.split_whitespace().collect::<Vec<_>>(),
    ));
    let legs = report["legs"].as_array().unwrap().iter();
    let legs: Vec<&str> = legs.map(|leg| leg["leg"].as_str().unwrap()).collect();
    assert_eq!(legs, ["FR", "RL"]);
    let number = |name: &str, key: &str| parameter(&report, name)[key].as_f64().unwrap();
    assert!((number("viscous:FR_hip", "value") - 0.3).abs() < 1e-3);
    // A thousandth of the calf's mass.
    assert!(number("m:FR_calf", "std") < 2.1e-4);
    let events = report["events"].to_string();
    for event in [
        "listen to FR RL: done",
        "prior viscous:FR_hip = 0.3",
        "body FR_calf within 0.1 %: done",
        "set up: IMU at -0.02, 0, 0.07 m, turned by 0, 0, 0 rad; buses at 2 Mbit/s: done",
        "kept for its next start: IMU at -0.02, 0, 0.07 m",
        "-1: cannot be",
    ] {
        assert!(events.contains(event), "{event}: {events}");
    }
    let counters = &report["counters"]["legs"];
    // A request a step is obeyed, from the first on.
    assert!(counters[1]["samples"].as_u64().unwrap() < 5, "{counters}");
    assert!(counters[1]["unheard_bytes"].as_u64().unwrap() > 100_000);
}

#[test]
fn a_recording_of_other_messages_no_port_and_no_recording_are_refused() {
    let folder = folder();
    fs::write(folder.path().join("x"), "proprio messages 1 schema=00\n").unwrap();
    fs::write(folder.path().join("y"), "t,q\n").unwrap();
    for (source, part, hint) in [
        ("x", "recorded under schema 00", "watch it with the proprio"),
        ("y", "no joint is recorded", "a joint needs position"),
        ("/dev/no-such-port", "/dev/no-such-port", "group dialout"),
    ] {
        let output = proprio(folder.path(), &["monitor", source]);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.contains(part) && said.contains(hint), "{said}");
    }
    // A recording cannot be made again.
    let output = proprio(
        folder.path(),
        &["monitor", "sim", "--seconds", "1", "--record", "y"],
    );
    assert!(stderr(&output).contains("would be replaced"));
}

#[test]
fn factors_of_two_halves_merge_to_what_one_device_says_of_the_whole() {
    let folder = simulated("--typical --legs FR --duration 12");
    let log = fs::read_to_string(folder.path().join("log.csv")).unwrap();
    let (header, rows) = log.split_once('\n').unwrap();
    let rows: Vec<&str> = rows.lines().collect();
    // The cut is at a window's end: half a window less would be another window's data.
    for (name, part) in [("a.csv", &rows[..3001]), ("b.csv", &rows[3000..])] {
        let text = format!("{header}\n{}\n", part.join("\n"));
        fs::write(folder.path().join(name), text).unwrap();
    }
    for name in ["a", "b", "log"] {
        let (log, factors) = (format!("{name}.csv"), format!("{name}.bin"));
        done(
            folder.path(),
            &["replay", &log, "--to", "desktop", "--factors", &factors],
        );
    }
    let identified = |files: &[&str]| {
        let arguments = [&["identify", "--json", "--factor"], files].concat();
        json(&done(folder.path(), &arguments))
    };
    let (merged, whole) = (identified(&["a.bin", "b.bin"]), identified(&["log.bin"]));
    let windows = |report: &serde_json::Value| report["legs"][0]["windows"].as_f64().unwrap();
    assert!(windows(&whole) - windows(&merged) <= 2.0, "{merged}");
    for name in [
        "coulomb:FR_hip",
        "viscous:FR_thigh",
        "armature:FR_calf",
        "m:FR_calf",
    ] {
        let [a, b] = [&merged, &whole].map(|report| parameter(report, name).clone());
        let number = |p: &serde_json::Value, key: &str| p[key].as_f64().unwrap();
        let off = number(&a, "value") - number(&b, "value");
        assert!(off.abs() < 0.05 * number(&b, "std"), "{a} {b}");
    }
    // In any order; and one alone knows less.
    assert!((windows(&identified(&["b.bin", "a.bin"])) - windows(&merged)).abs() < 1e-9);
    let alone = identified(&["a.bin"]);
    let std = |report| parameter(report, "coulomb:FR_hip")["std"].as_f64().unwrap();
    assert!(std(&alone) > 1.2 * std(&merged));
    // The whole log's factors give what the device itself says.
    let told = json(&done(
        folder.path(),
        &["replay", "log.csv", "--to", "desktop", "--json"],
    ));
    for parameter in told["parameters"].as_array().unwrap() {
        let here = proprio_tests::command::parameter(&whole, parameter["name"].as_str().unwrap());
        let [a, b] = [parameter, here].map(|p| p["value"].as_f64().unwrap());
        let std = here["std"].as_f64().unwrap();
        assert!(
            (a - b).abs() <= 1e-6 * (b.abs() + std),
            "{parameter} {here}"
        );
    }

    // The same data twice, and those of two robots, are refused.
    let twice = refusal(
        folder.path(),
        &["identify", "--factor", "a.bin", "b.bin", "a.bin"],
    );
    let both = "a.bin: the data of leg FR are in a.bin already";
    assert!(
        twice.contains(both) && twice.contains("hint: leave one"),
        "{twice}"
    );
    for (log, robot) in [("a.csv", "one"), ("b.csv", "two")] {
        let words = [
            "replay",
            log,
            "--to",
            "desktop",
            "--robot",
            robot,
            "--factors",
            robot,
        ];
        done(folder.path(), &words);
    }
    let two = refusal(
        folder.path(),
        &["identify", "--factor", "one", "two", "--json"],
    );
    assert!(
        two.contains("two: factors of robot two; one is of one"),
        "{two}"
    );
    assert!(two.contains("hint: identify one robot at a time"), "{two}");

    let mut bytes = fs::read(folder.path().join("a.bin")).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(folder.path().join("a.bin"), bytes).unwrap();
    let output = proprio(folder.path(), &["identify", "--factor", "a.bin"]);
    let said = stderr(&output);
    assert!(
        said.contains("cut or damaged") && said.contains("hint: "),
        "{said}"
    );
}
