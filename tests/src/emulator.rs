//! The emulated board, which a machine without the emulator may do without.

use std::process::Command;

use proprio_host::device::DeviceError;
use proprio_host::device::qemu::EMULATOR;

/// Names a machine as one without the emulator, and without the tests that need it.
const SKIP: &str = "PROPRIO_SKIP_QEMU";

/// What the emulator gave; `None`, and a line that says so, where it is missing and `PROPRIO_SKIP_QEMU` says that it may be.
///
/// # Panics
/// On any other error.
pub fn unless_missing<T>(given: Result<T, DeviceError>) -> Option<T> {
    match given {
        Err(missing @ DeviceError::NoEmulator) if std::env::var_os(SKIP).is_some() => {
            eprintln!("SKIPPED: {missing} ({SKIP} is set)");
            None
        }
        given => Some(given.unwrap()),
    }
}

/// Whether the emulator is there; `false`, and a line that says so, where it may be missing.
///
/// # Panics
/// Where it is missing and may not be.
pub fn is_there() -> bool {
    let version = Command::new(EMULATOR).arg("--version").output();
    unless_missing(version.map_err(|_| DeviceError::NoEmulator)).is_some()
}
