//! Gives the linker the board's memory and the scripts of cortex-m-rt and defmt.

use std::{env, path::PathBuf};

fn main() {
    let root = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets it"));
    let has = |feature: &str| env::var_os(format!("CARGO_FEATURE_{feature}")).is_some();
    let board = match (has("MPS2_AN500"), has("NUCLEO_H743ZI2")) {
        (true, false) => "mps2_an500",
        (false, true) => "nucleo_h743zi2",
        _ => panic!("name one board: --no-default-features --features BOARD, or the default"),
    };
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
