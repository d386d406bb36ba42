//! `proprio flash` and `proprio ports`: a programmer that a test wrote, and machines without one.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Command, Output};

use proprio_tests::command::{binary, done, folder, json, proprio, stderr, stdout};

/// Runs `proprio flash` where only `path` has programs.
fn flash(folder: &Path, path: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(binary());
    command.arg("flash").args(arguments).current_dir(folder);
    command.env("PATH", path).output().unwrap()
}

/// A program that writes down what it was called with, and fails if it is told to.
fn programmer(folder: &Path, name: &str) {
    let calls = folder.join("calls");
    let script = format!(
        "#!/bin/sh\necho {name} \"$@\" >> {}\ntest ! -e {}\n",
        calls.display(),
        folder.join("broken").display()
    );
    let path = folder.join("bin").join(name);
    fs::create_dir_all(folder.join("bin")).unwrap();
    fs::write(&path, script).unwrap();
    fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
}

/// The header of an ELF file for a machine.
fn image(folder: &Path, name: &str, machine: u8) {
    let mut bytes = [0; 64];
    bytes[..4].copy_from_slice(b"\x7fELF");
    bytes[18] = machine;
    fs::write(folder.join(name), bytes).unwrap();
}

#[test]
fn the_first_programmer_that_is_installed_flashes_the_image() {
    let folder = folder();
    let bin = folder.path().join("bin");
    image(folder.path(), "arm.elf", 40);
    programmer(folder.path(), "openocd");
    let output = flash(folder.path(), &bin, &["--image", "arm.elf"]);
    assert!(output.status.success(), "{}", stderr(&output));
    programmer(folder.path(), "probe-rs");
    let output = flash(folder.path(), &bin, &["--image", "arm.elf"]);
    assert!(
        stdout(&output).starts_with("Flashed."),
        "{}",
        stdout(&output)
    );
    let calls = fs::read_to_string(folder.path().join("calls")).unwrap();
    assert_eq!(
        calls,
        "openocd -f interface/stlink.cfg -f target/stm32h7x.cfg -c program {arm.elf} verify reset exit\n\
         probe-rs download --verify --chip STM32H743ZITx arm.elf\n\
         probe-rs reset --chip STM32H743ZITx\n"
    );

    fs::write(folder.path().join("broken"), "").unwrap();
    let output = flash(folder.path(), &bin, &["--image", "arm.elf"]);
    assert_eq!(output.status.code(), Some(1));
    let said = stderr(&output);
    assert!(
        said.contains("probe-rs failed") && said.contains("hint: check that the board"),
        "{said}"
    );
}

#[test]
fn without_a_programmer_it_is_said_how_to_get_one() {
    let folder = folder();
    let bin = folder.path().join("bin");
    image(folder.path(), "arm.elf", 40);
    let output = flash(folder.path(), &bin, &["--image", "arm.elf"]);
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(1));
    assert!(said.contains("cargo install probe-rs-tools"), "{said}");
    assert!(said.contains("apt-get install openocd"), "{said}");
    let dry = [
        "--image",
        "arm.elf",
        "--with",
        "openocd",
        "--dry-run",
        "--json",
    ];
    let report = json(&stdout(&flash(folder.path(), &bin, &dry)));
    assert_eq!(report["flashed"], false);
    assert!(
        report["commands"][0]
            .as_str()
            .unwrap()
            .starts_with("openocd -f")
    );
}

#[test]
fn what_is_no_image_of_a_board_is_not_flashed() {
    let folder = folder();
    let bin = folder.path().join("bin");
    programmer(folder.path(), "probe-rs");
    image(folder.path(), "x86.elf", 62);
    for (image, part) in [
        ("x86.elf", "no program for an Arm core"),
        ("none.elf", "none.elf"),
    ] {
        let output = flash(folder.path(), &bin, &["--image", image]);
        assert_eq!(output.status.code(), Some(1));
        let said = stderr(&output);
        assert!(said.contains(part) && said.contains("hint: "), "{said}");
    }
    assert!(!folder.path().join("calls").exists());
    let output = proprio(folder.path(), &["flash", "--with", "magic"]);
    assert_eq!(output.status.code(), Some(2));
}

#[test]
fn ports_are_listed_or_it_is_said_that_there_are_none() {
    let folder = folder();
    let ports = json(&done(folder.path(), &["ports", "--json"]));
    let ports = ports["ports"].as_array().unwrap();
    let text = done(folder.path(), &["ports"]);
    match ports.is_empty() {
        true => assert!(text.contains("There is no serial port"), "{text}"),
        false => assert_eq!(text.lines().count(), ports.len(), "{text}"),
    }
}

/// Minutes of building are not what --dry-run asks for: a machine without cargo says the same.
#[test]
fn a_dry_run_builds_nothing() {
    let folder = folder();
    let cache = folder.path().join("cache");
    let mut command = Command::new(binary());
    let arguments = ["flash", "--dry-run", "--with", "openocd"];
    command.args(arguments).current_dir(folder.path());
    command.env("PATH", "").env("CARGO_TARGET_DIR", &cache);
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    let image = cache.join("firmware/nucleo_h743zi2-f64");
    assert!(stdout(&output).contains(&*image.to_string_lossy()));
    assert!(!cache.exists() && stderr(&output).is_empty());
}
