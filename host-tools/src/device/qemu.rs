//! The firmware on an emulated Cortex-M7.
//!
//! QEMU's five UARTs are sockets that this process listens on. QEMU takes a byte only when the firmware has read the one
//! before, so nothing is lost however fast it is sent. The firmware lives in the time of the steps: with each step's bytes
//! goes an [`Advance`] that says when it is and how many bytes belong to it. Several steps may be under way; what the
//! device does is the same. [`Qemu::boot_fast`] puts the buses' bytes into memory instead, which is many times as fast.

use std::fs::File;
use std::io::{Read, Write};
use std::os::unix::fs::FileExt;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use proprio_core::go2::LEGS;
use proprio_core::wire::{Advance, DeviceMessage, Hello, HostMessage, rings};

use super::link::{Link, PATIENCE};
use super::{BusStep, Device, DeviceError};

/// Steps that may be under way. Their bytes, and the answers, must fit the sockets' buffers.
const IN_FLIGHT: usize = 64;

/// Bytes of the board's PSRAM, the start of which stands for flash.
const PSRAM_LEN: u64 = 16 << 20;

/// Name of the emulator.
pub const EMULATOR: &str = "qemu-system-arm";

/// A running emulator; ended when dropped.
pub struct Qemu {
    child: Process,
    link: Link<UnixStream>,
    buses: Buses,
    hello: Hello,
    in_flight: usize,
}

/// How the buses' bytes reach the emulator.
enum Buses {
    /// Through its UARTs.
    Uarts([UnixStream; LEGS]),
    /// Into rings in the file behind its PSRAM; with the place in them of the next byte.
    Rings(File, [usize; LEGS]),
}

impl Buses {
    fn write(&mut self, buses: &[Vec<u8>; LEGS]) -> std::io::Result<()> {
        match self {
            Self::Uarts(uarts) => {
                for (uart, bytes) in uarts.iter_mut().zip(buses) {
                    uart.write_all(bytes)?;
                }
            }
            Self::Rings(file, at) => {
                for (leg, (at, bytes)) in at.iter_mut().zip(buses).enumerate() {
                    let ring = (rings::OFFSET + leg * rings::LENGTH) as u64;
                    let (first, wrapped) = bytes.split_at(bytes.len().min(rings::LENGTH - *at));
                    file.write_all_at(first, ring + *at as u64)?;
                    file.write_all_at(wrapped, ring)?;
                    *at = (*at + bytes.len()) % rings::LENGTH;
                }
            }
        }
        Ok(())
    }
}

/// Runs `image`, one that ends by itself, and gives what it wrote to semihosting's standard output.
///
/// # Errors
/// [`DeviceError::NoEmulator`], or [`DeviceError::Emulator`] if the image says that it failed.
pub fn run(image: &Path) -> Result<String, DeviceError> {
    let mut command = machine();
    command.args(["-semihosting-config", "enable=on,target=native"]);
    let output = command
        .args(["-serial", "none", "-kernel"])
        .arg(image)
        .output()
        .map_err(missing)?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    match output.status.success() {
        true => Ok(text),
        false => Err(DeviceError::Emulator(output.status.to_string(), text)),
    }
}

/// The emulator of the board, with a clock that counts instructions.
fn machine() -> Command {
    let mut command = Command::new(EMULATOR);
    command.args(["-machine", "mps2-an500", "-nographic", "-monitor", "none"]);
    command.args(["-icount", "shift=6"]);
    command
}

/// Not to have the emulator is an error of its own.
fn missing(error: std::io::Error) -> DeviceError {
    match error.kind() {
        std::io::ErrorKind::NotFound => DeviceError::NoEmulator,
        _ => error.into(),
    }
}

struct Process(Child);

impl Drop for Process {
    fn drop(&mut self) {
        // Both fail only if it has ended by itself.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Qemu {
    /// Boots `image` and waits for its hello. The device's log, defmt frames, goes to `image` with `.log` appended.
    ///
    /// # Errors
    /// [`DeviceError`].
    pub fn boot(image: &Path) -> Result<Self, DeviceError> {
        Self::start(image, None)
    }

    /// The same, where what stands for the board's flash is in the file `flash`: it outlives the emulator as flash outlives the power. Made
    /// of zeros if it is not there.
    ///
    /// # Errors
    /// [`DeviceError`].
    pub fn boot_with(image: &Path, flash: &Path) -> Result<Self, DeviceError> {
        Self::start(image, Some(flash))
    }

    /// As [`Self::boot`], but the buses' bytes come to the board's memory, as by DMA, not through UARTs: for hours of a robot's time.
    ///
    /// # Errors
    /// [`DeviceError`].
    pub fn boot_fast(image: &Path) -> Result<Self, DeviceError> {
        let memory = tempfile::NamedTempFile::new()?;
        let file = memory.reopen()?;
        file.set_len(PSRAM_LEN)?;
        let before = rings::OFFSET - rings::IN_USE.len();
        file.write_all_at(&rings::IN_USE, before as u64)?;
        let mut emulator = Self::start(image, Some(memory.path()))?;
        emulator.buses = Buses::Rings(file, [0; LEGS]);
        Ok(emulator)
    }

    fn start(image: &Path, flash: Option<&Path>) -> Result<Self, DeviceError> {
        let directory = tempfile::tempdir()?;
        let sockets: [_; LEGS + 1] =
            std::array::from_fn(|n| directory.path().join(format!("uart{n}")));
        let listeners = sockets.each_ref().map(UnixListener::bind);
        let mut command = machine();
        if let Some(flash) = flash {
            let file = flash.display();
            command.args(["-machine", "memory-backend=flash", "-object"]);
            command.arg(format!(
                "memory-backend-file,id=flash,size={PSRAM_LEN},share=on,mem-path={file}"
            ));
        }
        // A UART takes one byte at a time; behind a multiplexer, which holds 32, a replay takes a third of the time. Its
        // escape character is none that a byte can be.
        command.args(["-echr", "0x100"]);
        command.args(["-semihosting-config", "enable=on,target=native"]);
        for (n, socket) in sockets.iter().enumerate() {
            command.arg("-chardev").arg(format!(
                "socket,id=uart{n},mux=on,path={}",
                socket.display()
            ));
            command.arg("-serial").arg(format!("chardev:uart{n}"));
        }
        command.arg("-kernel").arg(image);
        command
            .stdin(Stdio::null())
            .stdout(File::create(image.with_added_extension("log"))?)
            .stderr(Stdio::piped());
        let child = command.spawn().map_err(missing)?;
        let mut child = Process(child);
        let mut streams = Vec::new();
        for listener in listeners {
            streams.push(accept(&listener?, &mut child)?);
        }
        let [host, buses @ ..] =
            <[UnixStream; LEGS + 1]>::try_from(streams).map_err(|_| DeviceError::Silent(0))?;
        host.set_read_timeout(Some(Duration::from_millis(500)))?;
        let mut link = Link::new(host);
        let hello = link.hello().map_err(|error| child.explain(error))?;
        Ok(Self {
            child,
            link,
            buses: Buses::Uarts(buses),
            hello,
            in_flight: 0,
        })
    }

    /// Sends bytes that need be no message, as a host that fails does.
    ///
    /// # Errors
    /// [`DeviceError::Link`].
    pub fn send_bytes(&mut self, bytes: &[u8]) -> Result<(), DeviceError> {
        self.link.send_bytes(bytes)
    }

    /// Receives until at most `allowed` steps are under way.
    fn wait(
        &mut self,
        allowed: usize,
        told: &mut dyn FnMut(DeviceMessage),
    ) -> Result<(), DeviceError> {
        let mut heard = Instant::now();
        while self.in_flight > allowed {
            let in_flight = &mut self.in_flight;
            let mut crash = None;
            let came = self.link.receive(&mut |message| match message {
                DeviceMessage::Advanced(_) => *in_flight = in_flight.saturating_sub(1),
                DeviceMessage::Hello(hello) if !hello.crash.is_empty() => {
                    crash = Some(hello.crash.to_string());
                }
                message => told(message),
            });
            if let Some(crash) = crash {
                return Err(DeviceError::Crashed(crash));
            }
            match came.map_err(|error| self.child.explain(error))? {
                true => heard = Instant::now(),
                false if heard.elapsed() > PATIENCE => {
                    return Err(self.child.explain(DeviceError::Silent(PATIENCE.as_secs())));
                }
                false => {}
            }
        }
        Ok(())
    }
}

impl Device for Qemu {
    fn hello(&self) -> &Hello {
        &self.hello
    }

    fn command(&mut self, message: &HostMessage) -> Result<(), DeviceError> {
        self.link.send(message)
    }

    fn play(
        &mut self,
        step: &BusStep,
        told: &mut dyn FnMut(DeviceMessage),
    ) -> Result<(), DeviceError> {
        self.wait(IN_FLIGHT - 1, told)?;
        let advance = HostMessage::Advance(Advance {
            time_us: step.time_us,
            bytes: step.buses.each_ref().map(|bytes| bytes.len() as u32),
        });
        match &self.buses {
            // First, so that the device takes bytes while they are written, should they be many.
            Buses::Uarts(_) => {
                self.link.send(&advance)?;
                self.buses.write(&step.buses)?;
            }
            // The bytes must be there before they are spoken of, and none be overwritten that has not been taken.
            Buses::Rings(..) => {
                let most = step.buses.iter().map(Vec::len).max().unwrap_or(0);
                if most > rings::LENGTH / IN_FLIGHT {
                    self.wait(0, told)?;
                }
                if most > rings::LENGTH {
                    return Err(
                        std::io::Error::other("more bytes in one step than a ring holds").into(),
                    );
                }
                self.buses.write(&step.buses)?;
                self.link.send(&advance)?;
            }
        }
        self.in_flight += 1;
        Ok(())
    }

    fn losses(&self) -> (u32, u32) {
        self.link.losses()
    }

    fn settle(&mut self, told: &mut dyn FnMut(DeviceMessage)) -> Result<(), DeviceError> {
        self.wait(0, told)
    }
}

impl Process {
    /// If the emulator has ended, that is the error.
    fn explain(&mut self, error: DeviceError) -> DeviceError {
        match self.0.try_wait() {
            Ok(Some(status)) => {
                let mut output = String::new();
                if let Some(stderr) = &mut self.0.stderr {
                    let _ = stderr.read_to_string(&mut output);
                }
                DeviceError::Emulator(status.to_string(), output.trim().to_owned())
            }
            _ => error,
        }
    }
}

/// The emulator's connection to one socket.
fn accept(listener: &UnixListener, child: &mut Process) -> Result<UnixStream, DeviceError> {
    listener.set_nonblocking(true)?;
    let started = Instant::now();
    loop {
        match listener.accept() {
            Ok((stream, _)) => {
                stream.set_nonblocking(false)?;
                return Ok(stream);
            }
            Err(error) if error.kind() == std::io::ErrorKind::WouldBlock => {}
            Err(error) => return Err(error.into()),
        }
        let silent = DeviceError::Silent(PATIENCE.as_secs());
        match child.explain(silent) {
            DeviceError::Silent(_) if started.elapsed() < PATIENCE => {}
            error => return Err(error),
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}
