//! Files and streams of the command line: whole or not there, the same for the same seed.

use std::fs;
use std::process::Stdio;
use std::time::{Duration, Instant};

use proprio_tests::command::{binary, done, folder, json, proprio, simulated, stderr};

#[test]
fn output_files_hold_what_json_prints() {
    let folder = simulated("--legs FR --duration 3");
    let printed = done(
        folder.path(),
        &["identify", "log.csv", "--json", "-o", "robot.json"],
    );
    assert_eq!(
        fs::read_to_string(folder.path().join("robot.json")).unwrap(),
        printed
    );

    let output = proprio(
        folder.path(),
        &["identify", "log.csv", "-o", "no/such/folder.json"],
    );
    assert_eq!(output.status.code(), Some(1));
    assert!(
        stderr(&output).contains("hint: create the directory first"),
        "{}",
        stderr(&output)
    );
}

#[test]
fn a_seed_makes_the_same_files_twice() {
    let folder = folder();
    let file = |name: &str| fs::read(folder.path().join(name)).unwrap();
    for log in ["a.csv", "b.csv"] {
        let faults = ["--jitter", "0.3", "--repeats", "0.1", "--motion", "chirp"];
        done(
            folder.path(),
            &[&["simulate", "--duration", "2", "-o", log], &faults[..]].concat(),
        );
    }
    assert_eq!(file("a.csv"), file("b.csv"));
    assert_eq!(file("a.truth.json"), file("b.truth.json"));
}

#[test]
fn a_reader_that_stops_early_is_no_error() {
    let folder = simulated("--legs FR --duration 3");
    let mut child = std::process::Command::new(binary())
        .args(["identify", "log.csv", "--json"])
        .current_dir(folder.path())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!(
        (output.status.code(), stderr(&output).as_str()),
        (Some(0), "")
    );
}

#[cfg(unix)]
#[test]
fn ctrl_c_leaves_no_half_file() {
    let folder = folder();
    let mut child = std::process::Command::new(binary())
        .args(["simulate", "--duration", "80000", "-o", "log.csv"])
        .current_dir(folder.path())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let deadline = Instant::now() + Duration::from_secs(20);
    while fs::read_dir(folder.path()).unwrap().next().is_none() {
        assert!(
            Instant::now() < deadline,
            "the simulation does not begin its file"
        );
        std::thread::sleep(Duration::from_millis(10));
    }
    let interrupt = std::process::Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status();
    assert!(interrupt.unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

/// A rigid robot has no friction, so that half of the free estimates are negative: no model holds those.
#[test]
fn a_physical_fit_becomes_a_model_that_exports() {
    let folder = simulated("--duration 4");
    let free = ["identify", "log.csv", "--free", "-o", "go2.toml"];
    let free = proprio(folder.path(), &free);
    assert_eq!(free.status.code(), Some(1));
    assert!(
        stderr(&free).contains("leave out --free"),
        "{}",
        stderr(&free)
    );
    assert!(!folder.path().join("go2.toml").exists());

    done(
        folder.path(),
        &["identify", "log.csv", "--physical", "-o", "go2.toml"],
    );
    let model = fs::read_to_string(folder.path().join("go2.toml")).unwrap();
    assert!(
        model.contains("log.csv") && model.contains("--physical"),
        "{model}"
    );
    let xml = done(
        folder.path(),
        &["export", "-m", "go2.toml", "--mjcf", "-o", "go2.xml"],
    );
    let written = fs::read_to_string(folder.path().join("go2.xml")).unwrap();
    assert!(
        written.contains("frictionloss") && written.contains("armature"),
        "{xml}"
    );
}

/// Each kind of output through a link to a file in another folder: the link stays one, and the file keeps who may read it.
#[cfg(unix)]
#[test]
fn outputs_go_through_links() {
    use std::os::unix::fs::{PermissionsExt, symlink};
    let folder = simulated("--legs FR --duration 5");
    let at = |name: &str| folder.path().join(name);
    fs::create_dir(at("far")).unwrap();
    done(folder.path(), &["add", "viscous", "-m", "model.toml"]);
    for (kind, command) in WRITES {
        let [far, link] = [format!("far/{kind}"), kind.to_owned()];
        fs::write(at(&far), "").unwrap();
        fs::set_permissions(at(&far), fs::Permissions::from_mode(0o604)).unwrap();
        symlink(&far, at(&link)).unwrap();
        done(folder.path(), &words(command, &link));
        assert!(at(&link).is_symlink(), "{kind}");
        let written = fs::metadata(at(&far)).unwrap();
        assert!(written.len() > 0, "{kind}");
        assert_eq!(written.permissions().mode() & 0o777, 0o604, "{kind}");
        // A link to nothing yet, and one that a failing command leaves alone.
        fs::remove_file(at(&far)).unwrap();
        done(folder.path(), &words(command, &link));
        assert!(at(&link).is_symlink() && at(&far).is_file(), "{kind}");
    }
    // What lies beside an output lies beside its link.
    assert_eq!(fs::read_dir(at("far")).unwrap().count(), WRITES.len());
}

/// A model file behind a link: `-m` reads and writes it where it lies.
#[cfg(unix)]
#[test]
fn a_model_behind_a_link_is_changed_where_it_lies() {
    let folder = simulated("--legs FR --typical --duration 5");
    let at = |name: &str| folder.path().join(name);
    fs::create_dir(at("far")).unwrap();
    std::os::unix::fs::symlink("far/model.toml", at("model.toml")).unwrap();
    for command in [
        "add viscous -m model.toml",
        "diagnose log.csv --apply -m model.toml",
        "remove viscous:FR_hip -m model.toml",
    ] {
        let before = fs::read(at("far/model.toml")).ok();
        done(folder.path(), &command.split(' ').collect::<Vec<_>>());
        assert!(at("model.toml").is_symlink(), "{command}");
        assert_ne!(fs::read(at("far/model.toml")).ok(), before, "{command}");
    }
}

/// Each kind of output to a device, a FIFO and standard output: none is replaced by a file, and what comes out is what a file gets.
#[cfg(target_os = "linux")]
#[test]
fn outputs_go_to_devices_and_fifos() {
    use std::os::unix::fs::FileTypeExt;
    let folder = simulated("--legs FR --duration 5");
    let at = |name: &str| folder.path().join(name);
    done(folder.path(), &["add", "viscous", "-m", "model.toml"]);
    let null = fs::metadata("/dev/null").unwrap();
    std::os::unix::fs::symlink("/dev/null", at("null")).unwrap();
    let made = std::process::Command::new("mkfifo")
        .arg(at("fifo"))
        .status();
    assert!(made.unwrap().success());
    let files = fs::read_dir(folder.path()).unwrap().count();
    for (kind, command) in WRITES {
        done(folder.path(), &words(command, "/dev/null"));
        done(folder.path(), &words(command, "null"));
        assert!(
            fs::metadata(at("null"))
                .unwrap()
                .file_type()
                .is_char_device()
        );

        let path = at("fifo");
        let reader = std::thread::spawn(move || fs::read(path).unwrap());
        done(folder.path(), &words(command, "fifo"));
        let through = reader.join().unwrap();
        assert!(fs::metadata(at("fifo")).unwrap().file_type().is_fifo());
        assert_eq!(
            fs::read_dir(folder.path()).unwrap().count(),
            files,
            "{kind}"
        );

        done(folder.path(), &words(command, "file"));
        let file = fs::read(at("file")).unwrap();
        // Megabytes, of which nobody wants to read both.
        assert!(without_path(&through) == without_path(&file), "{kind}");
        for made in ["file", "file.truth.json"] {
            let _ = fs::remove_file(at(made));
        }
        // Into a pipe, and into a file that the shell has opened: first the output, then what the command prints.
        let piped = done(folder.path(), &words(command, "/dev/stdout"));
        assert!(piped.len() >= file.len(), "{kind}");
        let shell = words(command, "/dev/stdout").join(" ");
        let shell = format!("'{}' {shell} > opened", binary().display());
        let run = std::process::Command::new("sh");
        let status = { run }
            .args(["-c", &shell])
            .current_dir(folder.path())
            .status();
        assert!(status.unwrap().success());
        let opened = fs::read(at("opened")).unwrap();
        assert_eq!(opened.len(), piped.len(), "{kind}");
        fs::remove_file(at("opened")).unwrap();
    }
    // A search of seconds: once.
    let excite = "excite --legs FR --duration 2 --starts 1 --json -o /dev/null";
    let designed = json(&done(folder.path(), &words(excite, "")));
    assert!(designed["coefficients"].is_null(), "{designed}");
    assert_eq!(
        fs::metadata("/dev/null").unwrap().file_type(),
        null.file_type()
    );
}

/// A file that may not be written stays, and so does one whose new content does not come to its end.
#[cfg(unix)]
#[test]
fn a_file_is_replaced_whole_or_not_at_all() {
    let folder = simulated("--legs FR --duration 5");
    let at = |name: &str| folder.path().join(name);
    fs::create_dir(at("far")).unwrap();
    fs::write(at("far/old.csv"), "old").unwrap();
    std::os::unix::fs::symlink("far/old.csv", at("new.csv")).unwrap();
    let log = fs::read_to_string(at("log.csv")).unwrap();
    fs::write(at("cut.csv"), log + "not,a,row\n").unwrap();
    let failed = proprio(
        folder.path(),
        &["import", "cut.csv", "-o", "new.csv", "--force"],
    );
    assert_eq!(failed.status.code(), Some(1));
    assert_eq!(fs::read_to_string(at("far/old.csv")).unwrap(), "old");
    assert_eq!(fs::read_dir(at("far")).unwrap().count(), 1);
    assert!(at("new.csv").is_symlink());
}

/// Commands that write a file, one of each kind, with OUT where its name goes.
#[cfg(unix)]
const WRITES: [(&str, &str); 6] = [
    ("log", "simulate --legs FR --duration 1 -o OUT"),
    ("import", "import log.csv -o OUT"),
    ("model", "identify log.csv -m model.toml -o OUT"),
    ("page", "compare log.csv --html OUT"),
    ("series", "compare log.csv -o OUT"),
    ("urdf", "export -m model.toml --urdf -o OUT"),
];

#[cfg(unix)]
fn words<'a>(command: &'a str, output: &'a str) -> Vec<&'a str> {
    let word = |word| if word == "OUT" { output } else { word };
    command.split(' ').map(word).collect()
}

/// With another name where the file's own stands, and without the command that it is of.
#[cfg(target_os = "linux")]
fn without_path(bytes: &[u8]) -> Vec<String> {
    let text = String::from_utf8_lossy(bytes).replace(" fifo", " file");
    let lines = text.lines().filter(|line| !line.starts_with("command = "));
    lines.map(str::to_owned).collect()
}

/// What stands where a log is to go is looked at in little memory, however long it is.
#[cfg(unix)]
#[test]
fn a_large_file_is_refused_in_little_memory() {
    let folder = folder();
    let row = "0.5,0.1,0.2,0.3\n".repeat(4_000_000);
    fs::write(
        folder.path().join("large.csv"),
        "t,q/a,dq/a,tau/a\n".to_owned() + &row,
    )
    .unwrap();
    // KiB of addresses: four times the file, and threads' stacks.
    let line = format!(
        "ulimit -v 400000; exec {} simulate --legs FR --duration 1 -o large.csv",
        binary().display()
    );
    let output = std::process::Command::new("sh")
        .args(["-c", &line])
        .current_dir(folder.path())
        .output()
        .unwrap();
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("which proprio did not make"), "{said}");
}
