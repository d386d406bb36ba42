//! Programs that flash a NUCLEO-H743ZI2.

use std::ffi::OsString;
use std::fs;
use std::path::Path;
use std::process::Command;

use super::DeviceError;

/// The board's chip as probe-rs names it.
const CHIP: &str = "STM32H743ZITx";
/// The machine field of an ELF header, and Arm's number (System V ABI, e_machine).
const MACHINE: std::ops::Range<usize> = 18..20;
const ARM: [u8; 2] = 40u16.to_le_bytes();

/// A program that can.
#[derive(Debug, Clone, Copy)]
pub struct Programmer {
    /// Its name, which is also that of the file.
    pub name: &'static str,
    /// Where it comes from.
    pub install: &'static str,
    /// What it is called with: one line after the other.
    calls: fn(image: &str) -> Vec<Vec<String>>,
}

/// Those known, the preferred first.
pub const PROGRAMMERS: [Programmer; 3] = [
    Programmer {
        name: "probe-rs",
        install: "cargo install probe-rs-tools --locked",
        calls: |image| {
            let download = ["download", "--verify", "--chip", CHIP, image];
            let reset = ["reset", "--chip", CHIP];
            vec![owned(&download), owned(&reset)]
        },
    },
    Programmer {
        name: "STM32_Programmer_CLI",
        install: "STM32CubeProgrammer from st.com",
        calls: |image| {
            let write = ["-c", "port=SWD", "mode=UR", "-w", image, "-v", "-rst"];
            vec![owned(&write)]
        },
    },
    Programmer {
        name: "openocd",
        install: "apt-get install openocd",
        calls: |image| {
            let program = format!("program {{{image}}} verify reset exit");
            let files = ["interface/stlink.cfg", "target/stm32h7x.cfg"];
            vec![owned(&["-f", files[0], "-f", files[1], "-c", &program])]
        },
    },
];

fn owned(words: &[&str]) -> Vec<String> {
    words.iter().map(|word| (*word).to_owned()).collect()
}

/// All names.
pub fn names() -> String {
    PROGRAMMERS.map(|programmer| programmer.name).join(", ")
}

/// How to get each.
pub fn how_to_install() -> String {
    let ways = PROGRAMMERS.map(|p| format!("{}: {}", p.name, p.install));
    format!("install one of them: {}", ways.join("; "))
}

impl Programmer {
    /// Whether its file is in a folder of `path`, which is as `PATH` is.
    pub fn is_in(&self, path: Option<&OsString>) -> bool {
        path.is_some_and(|path| {
            std::env::split_paths(path).any(|folder| folder.join(self.name).is_file())
        })
    }

    /// What it is called with, as one would type it.
    pub fn words(&self, image: &Path) -> Vec<String> {
        let quoted = |word: &String| match word.contains([' ', '{']) {
            true => format!("'{word}'"),
            false => word.clone(),
        };
        let calls = (self.calls)(&image.to_string_lossy());
        let line = |call: &Vec<String>| {
            let words: Vec<String> = call.iter().map(quoted).collect();
            format!("{} {}", self.name, words.join(" "))
        };
        calls.iter().map(line).collect()
    }

    /// Flashes the image and starts it. The program's own words go to the terminal.
    ///
    /// # Errors
    /// [`DeviceError::Programmer`].
    pub fn flash(&self, image: &Path) -> Result<(), DeviceError> {
        let failed = |why: String| DeviceError::Programmer(self.name, why);
        for call in (self.calls)(&image.to_string_lossy()) {
            let status = Command::new(self.name).args(call).status();
            let status = status.map_err(|error| failed(error.to_string()))?;
            if !status.success() {
                return Err(failed(status.to_string()));
            }
        }
        Ok(())
    }
}

/// Whether a file is a program for an Arm core.
///
/// # Errors
/// [`DeviceError::Image`], [`DeviceError::NotAnImage`].
pub fn check(image: &Path) -> Result<(), DeviceError> {
    let bytes = fs::read(image).map_err(|source| DeviceError::Image {
        image: image.to_owned(),
        source,
    })?;
    match bytes.starts_with(b"\x7fELF") && bytes.get(MACHINE) == Some(&ARM[..]) {
        true => Ok(()),
        false => Err(DeviceError::NotAnImage(image.to_owned())),
    }
}
