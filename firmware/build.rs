//! Gives the linker each board's memory and the scripts of cortex-m-rt and defmt.

use std::{env, fs, path::PathBuf};

fn main() {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    let memory = "src/board/mps2_an500.x";
    fs::copy(memory, out.join("memory.x")).expect("the board's memory file lies beside its code");
    println!("cargo:rerun-if-changed={memory}");
    println!("cargo:rustc-link-search={}", out.display());
    for argument in ["--nmagic", "-Tlink.x", "-Tdefmt.x"] {
        println!("cargo:rustc-link-arg-bins={argument}");
    }
}
