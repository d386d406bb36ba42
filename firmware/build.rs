//! Gives the linker the board's memory and the scripts of cortex-m-rt and defmt.

use std::path::{Path, PathBuf};
use std::{env, process::Command};

fn main() {
    let root = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets it"));
    let has = |feature: &str| env::var_os(format!("CARGO_FEATURE_{feature}")).is_some();
    let board = match (has("MPS2_AN500"), has("NUCLEO_H743ZI2")) {
        (true, false) => "mps2_an500",
        (false, true) => "nucleo_h743zi2",
        _ => panic!("name one board: --no-default-features --features BOARD, or the default"),
    };
    println!("cargo:rustc-env=PROPRIO_GIT={}", commit(&root));
    let script = root.join(format!("src/board/{board}.x"));
    let memory = root.join("../memory.x");
    for file in [&script, &memory] {
        println!("cargo:rerun-if-changed={}", file.display());
    }
    println!("cargo:rustc-link-search={}", root.join("..").display());
    for script in [&*script.to_string_lossy(), "link.x", "defmt.x"] {
        println!("cargo:rustc-link-arg-bins=-T{script}");
    }
    println!("cargo:rustc-link-arg-bins=--nmagic");
}

/// The commit of the sources, with a `+` if they are others; empty where there is no git. Told by the device, so that what a board runs is
/// known in the field.
fn commit(root: &Path) -> String {
    let git = |arguments: &[&str]| {
        let output = Command::new("git")
            .current_dir(root)
            .args(arguments)
            .output()
            .ok()?;
        let text = String::from_utf8(output.stdout).ok()?;
        output.status.success().then(|| text.trim().to_owned())
    };
    // A commit changes the branch's file or the packed ones; a worktree's are elsewhere, and git says where.
    for name in ["HEAD", "logs/HEAD"] {
        if let Some(path) = git(&["rev-parse", "--git-path", name]) {
            println!("cargo:rerun-if-changed={}", root.join(path).display());
        }
    }
    let Some(hash) = git(&["rev-parse", "--short=12", "HEAD"]) else {
        return String::new();
    };
    let changed = git(&["status", "--porcelain", "--untracked-files=no"]);
    match changed.is_none_or(|changed| changed.is_empty()) {
        true => hash,
        false => hash + "+",
    }
}
