//! The firmware image, built by `firmware/build` of the clone that this program is from.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use super::DeviceError;

/// What the firmware computes with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scalar {
    /// Single precision.
    F32,
    /// Double precision.
    F64,
}

impl Scalar {
    /// "f32" or "f64".
    pub fn name(self) -> &'static str {
        match self {
            Self::F32 => "f32",
            Self::F64 => "f64",
        }
    }
}

/// Builds the emulated board's image if it is not up to date, and says where it is. The compiler's messages go to standard
/// error; a first build takes about a minute.
///
/// # Errors
/// [`DeviceError::NoSources`], [`DeviceError::Build`].
pub fn build(scalar: Scalar) -> Result<PathBuf, DeviceError> {
    build_for("mps2_an500", scalar)
}

/// The same for the NUCLEO-H743ZI2, which computes in double precision: of a robot that walks, or of one that hangs.
///
/// # Errors
/// As [`build`].
pub fn build_nucleo(walking: bool) -> Result<PathBuf, DeviceError> {
    let hanging = build_for("nucleo_h743zi2", Scalar::F64)?;
    Ok(match walking {
        true => hanging.with_file_name("nucleo_h743zi2_walking-f64"),
        false => hanging,
    })
}

fn build_for(board: &str, scalar: Scalar) -> Result<PathBuf, DeviceError> {
    let script = workspace()
        .ok_or(DeviceError::NoSources)?
        .join("firmware/build");
    let output = Command::new("sh")
        .arg(&script)
        .args([scalar.name(), board])
        // Set by `cargo run` and `cargo test`; the firmware's cargo and rustc are not those of this program.
        .env_remove("CARGO")
        .env_remove("RUSTC")
        .env_remove("RUSTFLAGS")
        .stderr(Stdio::inherit())
        .output()
        .map_err(|error| DeviceError::Build(format!("{}: {error}", script.display())))?;
    if !output.status.success() {
        return Err(DeviceError::Build(format!(
            "{}: {}",
            script.display(),
            output.status
        )));
    }
    Ok(PathBuf::from(
        String::from_utf8_lossy(&output.stdout).trim(),
    ))
}

/// Builds the images and says where the emulated board's is for a robot that walks.
///
/// # Errors
/// As [`build`].
pub fn walking(scalar: Scalar) -> Result<PathBuf, DeviceError> {
    Ok(build(scalar)?.with_file_name(format!("mps2_an500_walking-{}", scalar.name())))
}

/// Builds the images and says where the one is that counts the operations of a robot that walks; [`super::qemu::run`] runs it.
///
/// # Errors
/// As [`build`].
pub fn walk_counts(scalar: Scalar) -> Result<PathBuf, DeviceError> {
    Ok(build(scalar)?.with_file_name(format!("walk_counts-{}", scalar.name())))
}

/// Builds the images and says where the one is that counts the core's operations; [`super::qemu::run`] runs it.
///
/// # Errors
/// As [`build`].
pub fn operation_counts(scalar: Scalar) -> Result<PathBuf, DeviceError> {
    Ok(build(scalar)?.with_file_name(format!("operation_counts-{}", scalar.name())))
}

/// Builds the images and says where the one is that crashes on purpose; [`super::qemu::run`] runs it.
///
/// # Errors
/// As [`build`].
pub fn crashes(scalar: Scalar) -> Result<PathBuf, DeviceError> {
    Ok(build(scalar)?.with_file_name(format!("crashes-{}", scalar.name())))
}

/// The clone this program was built in, or else the one around the current directory.
fn workspace() -> Option<PathBuf> {
    let built_in = Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .map(Path::to_path_buf);
    let current = std::env::current_dir().unwrap_or_default();
    built_in
        .into_iter()
        .chain(current.ancestors().map(Path::to_path_buf))
        .find(|directory| directory.join("firmware/build").is_file())
}
