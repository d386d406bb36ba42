//! `proprio record -` and `proprio monitor -`: rows as they come. What comes over DDS is tested beside another DDS, by `tests/live/test`.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use proprio_host::live::HAS_DDS;
use proprio_tests::command::{
    binary, done, folder, json, parameter, piped, proprio, refusal, schema_of, simulated, start,
    stderr, stdout,
};
use proprio_tests::schema::Schema;
use serde_json::Value;
#[cfg(unix)]
use {
    portable_pty::{PtyPair, PtySize, native_pty_system},
    proprio_core::go2::Leg,
    proprio_host::device::power_up::PowerUp,
    proprio_host::device::{BusStep, Robot},
    proprio_simulator::hidden::typical,
};

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

    // Messages have the same numbers, at the same distances in time.
    let messages = report(&piped(
        at,
        log,
        &["record", "-", "-o", "all.mcap", "--json"],
    ));
    assert_eq!(messages["recorded"], rows);
    assert_eq!(messages["warnings"], serde_json::json!([]));
    assert_eq!(identified("all.mcap"), identified(log));

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

/// What a joint state cannot carry is left out, and named.
#[test]
fn rows_with_an_imu_become_messages_without_it() {
    let folder = simulated("--walk trot --duration 4");
    let at = folder.path();
    let said = report(&piped(
        at,
        "log.csv",
        &["record", "-", "-o", "walk.mcap", "--json"],
    ));
    let named = said["warnings"].to_string();
    assert!(
        named.contains("a JointState has no field for gyro, acc, foot: left out"),
        "{named}"
    );
    let import = json(&done(
        at,
        &["import", "walk.mcap", "-o", "out.csv", "--json"],
    ));
    assert_eq!(import["samples"], said["recorded"]);
    assert!(!lines(&at.join("out.csv"))[0].contains("gyro"));
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

/// A viewer of Foxglove's protocol receives what `--json` prints of the same process, to the byte, its residuals and its events.
#[test]
fn a_viewer_receives_what_monitor_prints() {
    use tungstenite::client::{ClientRequestBuilder, client};
    use tungstenite::{Message, WebSocket};

    let folder = simulated("--legs FR --typical --duration 12");
    let at = folder.path();
    let mut child = start(at, &["monitor", "-", "--json", "--foxglove=127.0.0.1:0"]);
    let mut errors = BufReader::new(child.stderr.take().unwrap());
    let mut said = String::new();
    while !said.contains("ws://") {
        assert!(errors.read_line(&mut said).unwrap() > 0, "{said}");
    }
    let address = said.trim().split("ws://").nth(1).unwrap();
    let request = ClientRequestBuilder::new(format!("ws://{address}/").parse().unwrap());
    let request = request.with_sub_protocol("foxglove.websocket.v1");
    let stream = TcpStream::connect(address).unwrap();
    let (mut viewer, _) = client(request, stream).unwrap();
    let text = |viewer: &mut WebSocket<TcpStream>| json(viewer.read().unwrap().to_text().unwrap());
    assert_eq!(text(&mut viewer)["op"], "serverInfo");
    let advertised = text(&mut viewer);
    let channels = advertised["channels"].as_array().unwrap();
    let subscriptions: Vec<Value> = (channels.iter().enumerate())
        .map(|(n, channel)| serde_json::json!({"id": 100 + n, "channelId": channel["id"]}))
        .collect();
    let asked = serde_json::json!({"op": "subscribe", "subscriptions": subscriptions});
    viewer.send(Message::text(asked.to_string())).unwrap();

    // It listens before the first row comes.
    thread::sleep(Duration::from_millis(300));
    let mut stdin = child.stdin.take().unwrap();
    let rows = fs::read(at.join("log.csv")).unwrap();
    let writer = thread::spawn(move || stdin.write_all(&rows).unwrap());
    let mut last: Vec<Option<Vec<u8>>> = vec![None; channels.len()];
    let mut count = vec![0; channels.len()];
    loop {
        match viewer.read().unwrap() {
            Message::Binary(bytes) => {
                assert_eq!(bytes[0], 1);
                let id = u32::from_le_bytes(bytes[1..5].try_into().unwrap());
                let n = id as usize - 100;
                last[n] = Some(bytes[13..].to_vec());
                count[n] += 1;
            }
            Message::Close(_) => break,
            other => panic!("{other}"),
        }
    }
    writer.join().unwrap();
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    let of = |topic: &str| channels.iter().position(|c| c["topic"] == topic).unwrap();
    let estimates = last[of("/estimates")].clone().unwrap();
    let printed = stdout(&output);
    assert_eq!(String::from_utf8(estimates).unwrap().trim(), printed.trim());
    let printed = json(&printed);
    parameter(&printed, "viscous:FR_calf");
    // Not every event may be kept to the end by the view, and each is sent once.
    let events = printed["events"].as_array().unwrap().len();
    assert_eq!(count[of("/events")], events);
    // A JointState ends with its efforts, after their number.
    let residual = last[of("/residual")].clone().unwrap();
    let known = printed["legs"][0]["residual"].as_array().unwrap();
    let efforts = &residual[residual.len() - 8 * known.len()..];
    for (effort, known) in efforts.chunks(8).zip(known) {
        let effort = f64::from_le_bytes(effort.try_into().unwrap());
        assert_eq!(Some(effort), known.as_f64());
    }
    let names = String::from_utf8_lossy(&residual).into_owned();
    assert!(names.contains("FR_hip") && names.contains("FR_calf"));
}

/// Legs whose buses reach `proprio` through serial lines of the operating system: the bytes that a simulated robot's motors make, whose counts
/// begin anywhere.
#[cfg(unix)]
struct Adapters {
    legs: [Leg; 2],
    /// What the buses carry.
    counted: Vec<BusStep>,
    /// The angles that it means.
    angles: Vec<BusStep>,
    power_up: PowerUp,
    lines: [PtyPair; 2],
}

#[cfg(unix)]
impl Adapters {
    /// The buses of so many milliseconds.
    fn of(milliseconds: usize) -> Self {
        let legs = [Leg::FR, Leg::RL];
        let power_up = PowerUp::random(5);
        let robot = |power_up| Robot::new(&legs, typical(&legs), 2).after(power_up);
        let [counted, angles] = [power_up, PowerUp::NONE].map(|power_up| {
            let robot = robot(power_up);
            let steps = robot.steps().take(milliseconds / 2).map(Result::unwrap);
            steps.collect::<Vec<_>>()
        });
        let lines = legs.map(|_| native_pty_system().openpty(PtySize::default()).unwrap());
        Self {
            legs,
            counted,
            angles,
            power_up,
            lines,
        }
    }

    /// The angles of a leg's joints that bytes of its bus mean, rad.
    fn positions(bytes: &[u8], leg: Leg) -> [f64; 3] {
        use proprio_core::bus::{Decoder, Frame};
        let (mut decoder, mut rest, mut found) = (Decoder::new(), bytes, [f64::NAN; 3]);
        while let Some(frame) = decoder.next(&mut rest, &mut { usize::MAX }) {
            if let Frame::Reply(reply) = frame {
                let joint = usize::from(reply.mode.id());
                found[joint] = reply.joint_position(proprio_core::go2::ACTUATORS[joint].gear);
            }
        }
        assert!(found.iter().all(|q| q.is_finite()), "{}", leg.name());
        found
    }

    /// The serial line of each leg, as a command takes it, and where the robot is when it begins.
    fn arguments(&self) -> Vec<String> {
        let mut arguments = Vec::new();
        for (leg, line) in self.legs.iter().zip(&self.lines) {
            let port = line.master.tty_name().unwrap();
            arguments.push(format!("{}={}", leg.name(), port.display()));
        }
        for leg in self.legs {
            let begin = Self::positions(&self.angles[0].buses[leg.index()], leg);
            for (joint, (name, q)) in leg.joint_names().iter().zip(begin).enumerate() {
                arguments.push(format!("--at={name}={q}"));
                if self.power_up.is_reversed(leg, joint) {
                    arguments.push(format!("--reversed={name}"));
                }
            }
        }
        arguments
    }

    /// Lets the robot rest for a moment where it begins, then move, and ends the command as Ctrl-C does.
    fn play(&self, child: Child) -> Output {
        let mut lines = (self.lines.each_ref()).map(|line| line.master.take_writer().unwrap());
        for _ in 0..25 {
            for (leg, line) in self.legs.iter().zip(&mut lines) {
                line.write_all(&self.counted[0].buses[leg.index()]).unwrap();
            }
            thread::sleep(Duration::from_millis(2));
        }
        let begin = Instant::now();
        for step in &self.counted {
            thread::sleep(Duration::from_micros(step.time_us).saturating_sub(begin.elapsed()));
            for (leg, line) in self.legs.iter().zip(&mut lines) {
                line.write_all(&step.buses[leg.index()]).unwrap();
            }
        }
        thread::sleep(Duration::from_millis(300));
        let killed = Command::new("kill")
            .args(["-INT", &child.id().to_string()])
            .status();
        assert!(killed.unwrap().success());
        child.wait_with_output().unwrap()
    }
}

#[cfg(unix)]
impl Adapters {
    /// Bytes that a command has sent to the motors by its end.
    fn sent(self) -> usize {
        let sent = self.lines.into_iter().map(|PtyPair { slave, master }| {
            let mut reader = master.try_clone_reader().unwrap();
            // Nobody has it open any more: what was sent comes, and then an error.
            drop(slave);
            let mut bytes = Vec::new();
            let _ = reader.read_to_end(&mut bytes);
            bytes.len()
        });
        sent.sum()
    }
}

/// Waits until something holds, for up to half a minute.
#[cfg(unix)]
fn wait_until(holds: impl Fn() -> bool) {
    let started = Instant::now();
    while !holds() {
        assert!(started.elapsed() < Duration::from_secs(30));
        thread::sleep(Duration::from_millis(20));
    }
}

#[cfg(unix)]
#[test]
fn adapters_on_two_motor_buses_become_a_log() {
    let adapters = Adapters::of(5_000);
    let folder = folder();
    let at = folder.path();
    let mut arguments = adapters.arguments();
    arguments.extend(["-o", "log.csv", "--json"].map(String::from));
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let child = start(at, &[&["record"], &words[..]].concat());
    // Its ports are open, and say bytes as they come, once its temporary file is there.
    let is_temporary = |entry: fs::DirEntry| entry.path().extension() == Some("tmp".as_ref());
    wait_until(|| (fs::read_dir(at).unwrap()).any(|entry| is_temporary(entry.unwrap())));
    let said = report(&adapters.play(child));
    let recorded = said["recorded"].as_u64().unwrap();
    println!("{said}");
    // What every adapter's user is told: of a machine that is so busy that a bus is silent for 0.1 s the zeros are void, and what follows is left out.
    let voided = said["warnings"]
        .to_string()
        .contains("zero is unknown since");
    assert!(recorded > if voided { 50 } else { 2_300 }, "{said}");

    // Each row of the first leg is one of its cycles, to the last count; the other leg's lies between two of its own.
    let rows = lines_of_numbers(&at.join("log.csv"));
    let names: Vec<&str> = rows.0.iter().map(String::as_str).collect();
    let place = |name: &str| names.iter().position(|known| *known == name).unwrap();
    let angles = &adapters.angles;
    let mut next = 0;
    for row in &rows.1 {
        let q = Leg::FR
            .joint_names()
            .map(|joint| row[place(&format!("q/{joint}"))]);
        let off = |n: &usize| {
            let known = Adapters::positions(&angles[*n].buses[0], Leg::FR);
            let off = known.iter().zip(q).map(|(known, q)| (known - q).abs());
            off.fold(0.0, f64::max)
        };
        // A cycle is searched for among those of the next 0.2 s.
        let candidates = next..(next + 100).min(angles.len());
        let found = candidates.min_by(|a, b| off(a).total_cmp(&off(b))).unwrap();
        assert!(off(&found) < 4e-3, "no cycle after {next} has {q:?}");
        let other = Leg::RL
            .joint_names()
            .map(|joint| row[place(&format!("q/{joint}"))]);
        let near = angles[found.saturating_sub(5)..(found + 5).min(angles.len())].iter();
        let near = near.map(|step| Adapters::positions(&step.buses[3], Leg::RL));
        for (joint, q) in other.into_iter().enumerate() {
            let range = near
                .clone()
                .fold([f64::MAX, f64::MIN], |[least, most], known| {
                    [least.min(known[joint]), most.max(known[joint])]
                });
            assert!(
                (range[0] - 4e-3..=range[1] + 4e-3).contains(&q),
                "{} s, as cycle {found}: {q} {range:?}",
                row[0]
            );
        }
        next = found;
    }
    let import = ["import", "log.csv", "-o", "imported.csv", "--json"];
    let imported = json(&done(at, &import));
    assert!(imported["samples"].as_u64().unwrap() > recorded * 9 / 10);
    assert_eq!(adapters.sent(), 0);
}

/// The device in this process receives the cycles of both buses, and nothing of the legs without an adapter.
#[cfg(target_os = "linux")]
#[test]
fn a_device_receives_adapters_on_two_motor_buses() {
    let adapters = Adapters::of(12_000);
    let folder = folder();
    let arguments = adapters.arguments();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let child = start(
        folder.path(),
        &[&["monitor", "--json"], &words[..]].concat(),
    );
    let files = format!("/proc/{}/fd", child.id());
    let has_open = |port: &Path| {
        let files = fs::read_dir(&files).into_iter().flatten();
        files
            .flatten()
            .any(|file| fs::read_link(file.path()).is_ok_and(|of| of == port))
    };
    for line in &adapters.lines {
        let port = line.master.tty_name().unwrap();
        wait_until(|| has_open(&port));
    }
    let output = adapters.play(child);
    assert!(output.status.success(), "{}", stderr(&output));
    let said = json(&stdout(&output));
    // As of a recording: a machine that is so busy that a bus is silent for 0.1 s voids the zeros.
    let voided = said["events"].to_string().contains("zero is unknown since");
    for (n, leg) in said["counters"]["legs"]
        .as_array()
        .unwrap()
        .iter()
        .enumerate()
    {
        let samples = leg["samples"].as_u64().unwrap();
        match Leg::ALL[n] {
            Leg::FR | Leg::RL => {
                assert!(samples > if voided { 50 } else { 5_000 }, "{n}: {leg}");
                // Angles by a wrong zero or count would lie beyond the joints' limits.
                for none in ["bad_crc", "skipped_bytes", "unplaced", "rejected"] {
                    assert_eq!(leg[none], 0, "{leg}");
                }
            }
            Leg::FL | Leg::RR => assert_eq!(samples, 0, "{leg}"),
        }
    }
}

/// Nothing that listens can speak, in its sources: a DDS domain is in one file's hands, which makes no writer, and a port is opened to be read.
#[test]
fn nothing_that_listens_names_a_writer() {
    fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in fs::read_dir(folder).unwrap() {
            match entry.unwrap().path() {
                path if path.is_dir() => sources(&path, found),
                path => found.push(path),
            }
        }
    }
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../host-tools/src/live");
    let mut found = Vec::new();
    sources(&folder, &mut found);
    assert!(found.len() > 10, "{found:?}");
    for path in found {
        let text = fs::read_to_string(&path).unwrap();
        let names = |word: &&&str| text.contains(**word);
        let mut banned = vec![
            "create_publisher",
            "DataWriter",
            "Publisher",
            "serial::open",
            "SerialPort",
        ];
        if !path.ends_with("dds/domain.rs") {
            banned.push("DomainParticipant");
        }
        let named: Vec<&&str> = banned.iter().filter(names).collect();
        assert!(named.is_empty(), "{}: {named:?}", path.display());
    }
}

/// A table's names and rows.
fn lines_of_numbers(path: &Path) -> (Vec<String>, Vec<Vec<f64>>) {
    let lines = lines(path);
    let cells = |line: &String| line.split(',').map(str::to_owned).collect::<Vec<_>>();
    let number = |cell: &String| cell.parse().unwrap_or(f64::NAN);
    let rows = lines[1..]
        .iter()
        .map(|line| cells(line).iter().map(number).collect());
    (cells(&lines[0]), rows.collect())
}

/// The simulated robot's rows are those that its own `.cap` file and the device in the process have.
#[test]
fn a_simulated_robot_is_recorded_as_it_moves() {
    let folder = folder();
    let at = folder.path();
    let recorded = ["sim.csv", "sim.mcap"].map(|name| {
        let words = ["record", "sim", "-o", name, "--seconds", "2", "--json"];
        let said = json(&done(at, &words));
        let faults = Schema::read(&schema_of("record")).faults(&said);
        assert!(faults.is_empty(), "{faults:#?}");
        let recorded = said["recorded"].as_u64().unwrap();
        assert!((990..=1_001).contains(&recorded), "{recorded}");
        let lost = "a JointState has no field for temp: left out; a .csv keeps them";
        let warnings = match name.ends_with("mcap") {
            true => serde_json::json!([lost]),
            false => serde_json::json!([]),
        };
        assert_eq!((&said["gaps"], &said["warnings"]), (&0.into(), &warnings));
        let imported = format!("{name}.csv");
        let import = json(&done(at, &["import", name, "-o", &imported, "--json"]));
        assert_eq!(import["samples"], recorded);
        assert_eq!(import["joints"].as_array().unwrap().len(), 12);
        lines_of_numbers(&at.join(imported))
    });
    // The simulated motion is the same each time, and so are the numbers in either kind of file, whatever else it has.
    let [csv, mcap] = recorded;
    assert_eq!(csv.1.len(), mcap.1.len());
    for (place, name) in mcap.0.iter().enumerate() {
        let other = csv.0.iter().position(|known| known == name).unwrap();
        for (a, b) in csv.1.iter().zip(&mcap.1) {
            let [a, b] = [a[other], b[place]];
            // Times of a message are on this machine's clock, as far apart as on the robot's; an import counts from the first.
            let apart = if name == "t" { 1e-9 } else { 0.0 };
            assert!((a - b).abs() <= apart, "{name}: {a} {b}");
        }
    }
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
        said.contains("`proprio monitor /dev/ttyACM0 --record log.messages`"),
        "{said}"
    );
    // Of a motor bus it is asked where the joints are before its port is.
    let said = refusal(at, &["record", "FL=/dev/no-such-port", "-o", "log.csv"]);
    assert!(said.contains("--at FL_hip=0.1 --at FL_thigh=0.8"), "{said}");
    let known = ["--at", "FL_hip=0.1", "--at", "FL_thigh=0.8"];
    let port = ["record", "FL=/dev/no-such-port", "-o", "log.csv"];
    let half = proprio(at, &[&port[..], &known].concat());
    assert_eq!(half.status.code(), Some(2));
    assert!(stderr(&half).contains("all three joints of one leg"));
    let known = [&known[..], &["--at", "FL_calf=lower"]].concat();
    let said = refusal(at, &[&port[..], &known].concat());
    assert!(said.contains("/dev/no-such-port"), "{said}");
    // A build without DDS says how one with it is made; one with it listens on no interface but the one that is named.
    let said = refusal(at, &["record", "dds:nowhere", "-o", "log.csv"]);
    let words = match HAS_DDS {
        false => "cargo install --path proprio --features dds",
        true => "no network interface is called nowhere",
    };
    assert!(said.contains(words), "{said}");
}
