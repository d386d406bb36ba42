//! The firmware image, built by `firmware/build` of the clone that this program is from.
//!
//! A program that lies in its clone's target folder builds there, as cargo would. Any other builds in the user's cache, and leaves the clone as
//! it is: that may be read-only, or another user's. `CARGO_TARGET_DIR` goes before both.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use super::DeviceError;
use crate::progress::Underway;

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
    let workspace = workspace().ok_or(DeviceError::NoSources)?;
    let folder = Places::known().folder(&workspace);
    let script = workspace.join("firmware/build");
    let image = image_in(&folder, board, scalar);
    if !image.exists() {
        eprintln!(
            "Building the firmware in {}; the first time takes some minutes.",
            folder.display()
        );
    }
    let underway = Underway::new("Building the firmware");
    // cargo has one file for the images of both scalars: between its end and the copies' none else may build.
    let firmware = folder.join("firmware");
    let lock = std::fs::create_dir_all(&firmware)
        .and_then(|()| File::create(firmware.join("lock")))
        .and_then(|lock| lock.lock().map(|()| lock));
    let lock =
        lock.map_err(|error| DeviceError::Build(format!("{}: {error}", firmware.display())))?;
    let output = Command::new("sh")
        .arg(&script)
        .args([scalar.name(), board])
        .env("CARGO_TARGET_DIR", &folder)
        // Set by `cargo run` and `cargo test`; the firmware's cargo and rustc are not those of this program.
        .env_remove("CARGO")
        .env_remove("RUSTC")
        .env_remove("RUSTFLAGS")
        .stderr(Stdio::inherit())
        .output()
        .map_err(|error| DeviceError::Build(format!("{}: {error}", script.display())))?;
    drop((lock, underway));
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

/// Where the NUCLEO's image would lie, without building it.
///
/// # Errors
/// [`DeviceError::NoSources`].
pub fn nucleo(walking: bool) -> Result<PathBuf, DeviceError> {
    let folder = Places::known().folder(&workspace().ok_or(DeviceError::NoSources)?);
    let board = match walking {
        true => "nucleo_h743zi2_walking",
        false => "nucleo_h743zi2",
    };
    Ok(image_in(&folder, board, Scalar::F64))
}

/// What `firmware/build` calls an image.
fn image_in(folder: &Path, board: &str, scalar: Scalar) -> PathBuf {
    folder
        .join("firmware")
        .join(format!("{board}-{}", scalar.name()))
}

/// What says where to build.
#[derive(Debug, Default)]
struct Places {
    /// `CARGO_TARGET_DIR`.
    target: Option<PathBuf>,
    /// This program.
    program: Option<PathBuf>,
    /// `XDG_CACHE_HOME`, or `.cache` of the user's folder.
    cache: Option<PathBuf>,
}

impl Places {
    fn known() -> Self {
        let set = |name| {
            let path = std::env::var_os(name).filter(|value| !value.is_empty());
            path.map(PathBuf::from)
        };
        let home = || set("HOME").map(|home| home.join(".cache"));
        Self {
            target: set("CARGO_TARGET_DIR").and_then(|path| std::path::absolute(path).ok()),
            program: std::env::current_exe().ok(),
            cache: set("XDG_CACHE_HOME").or_else(home),
        }
    }

    /// The folder that the images of this clone are built in.
    fn folder(&self, workspace: &Path) -> PathBuf {
        let own = workspace.join("target");
        match (&self.target, &self.program, &self.cache) {
            (Some(target), ..) => target.clone(),
            (None, Some(program), _) if program.starts_with(&own) => own,
            (None, _, Some(cache)) => cache.join("proprio"),
            (None, _, None) => own,
        }
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_are_built_where_the_program_is_or_in_the_users_cache() {
        let clone = Path::new("/src/proprio");
        let places = |target: Option<&str>, program: &str, cache: Option<&str>| Places {
            target: target.map(PathBuf::from),
            program: Some(PathBuf::from(program)),
            cache: cache.map(PathBuf::from),
        };
        for (places, folder) in [
            (
                places(
                    None,
                    "/src/proprio/target/release/proprio",
                    Some("/home/a/.cache"),
                ),
                "/src/proprio/target",
            ),
            (
                places(None, "/usr/bin/proprio", Some("/home/a/.cache")),
                "/home/a/.cache/proprio",
            ),
            (
                places(
                    Some("/tmp/t"),
                    "/src/proprio/target/release/proprio",
                    Some("/home/a/.cache"),
                ),
                "/tmp/t",
            ),
            (
                places(None, "/usr/bin/proprio", None),
                "/src/proprio/target",
            ),
        ] {
            assert_eq!(places.folder(clone), Path::new(folder));
        }
    }
}
