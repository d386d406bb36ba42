//! What crosses crates, in one program: linking it once takes a tenth of the time and of the disk that a program per file takes.
//! `cargo test -p proprio-tests battery::` runs one file's tests.

mod any_urdf;
mod bad_input;
mod bad_recordings;
mod battery;
mod battery_logged;
mod board_tables;
mod bus_load;
mod bus_noise;
mod calibrate;
mod changes;
mod cli;
mod cli_capture;
mod cli_files;
mod cli_flash;
mod cli_models;
mod cli_monitor;
mod cli_qemu;
mod cli_replay;
mod cli_web;
mod cli_zero;
mod compare;
mod contact_oracle;
mod device_delay;
mod diagnose;
mod elastic_arm;
mod excite;
mod export;
mod factors;
mod faults;
mod formulas;
mod free_base;
mod frf;
mod gallery;
mod hidden_effect;
mod identify_model;
mod ladder;
mod late_stamps;
mod live;
mod long_logs;
mod mismatch;
mod model;
mod mujoco_logs;
mod no_panic;
mod nucleo;
mod only;
mod other_robot;
mod pinocchio;
mod qemu;
mod qemu_crashes;
mod qemu_snapshots;
mod readings;
mod readme;
mod real_chirps;
mod real_contact;
mod real_emps;
mod real_fits;
mod real_gates;
mod real_kuka;
mod real_wiring;
mod recordings;
mod regimes;
mod report;
mod rollout;
mod round_trip;
mod same_numbers;
mod scale;
mod schemas;
mod screens;
mod second_encoder;
mod suspended;
mod walking;
mod where_it_fails;
mod words;
mod wrong_bodies;
mod wrong_geometry;

/// No file is forgotten: each one beside this is a module of it.
#[test]
fn every_file_is_tested() {
    let here = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests");
    for entry in std::fs::read_dir(here).expect("the folder of this file") {
        let path = entry.expect("an entry").path();
        let name = path
            .file_stem()
            .and_then(|name| name.to_str())
            .expect("UTF-8");
        if name != "all" && name != "snapshots" {
            let line = format!("mod {name};");
            assert!(
                include_str!("all.rs").contains(&line),
                "{} is not tested: add `{line}`",
                path.display()
            );
        }
    }
}
