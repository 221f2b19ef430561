//! A Cortex-M7 in QEMU that runs the firmware, and the serial line to it.

use std::env;
use std::fs;
use std::io::{Read as _, Write as _};
use std::path::PathBuf;
use std::process::{self, Child, ChildStdin, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{self, Receiver};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use fmu_export::frames::{self, Kind, MOST_PAGE_CELLS};
use fmu_export::{Context, Error};

/// The firmware's image.
pub static IMAGE: &[u8] = include_bytes!(env!("ECU_IMAGE"));

/// How long an answer may take. A sample takes milliseconds.
const PATIENCE: Duration = Duration::from_secs(60);

/// The processor with the firmware.
#[derive(Debug)]
pub struct Ecu {
    process: Child,
    line: ChildStdin,
    frames: Mutex<Receiver<(Kind, Vec<u8>)>>,
    image: PathBuf,
}

impl Ecu {
    /// Starts the processor with the firmware; an instruction takes a nanosecond. The environment variable
    /// `ECU_QEMU_ARGUMENTS` may have further arguments of QEMU, between spaces, such as `-gdb tcp::1234`.
    ///
    /// # Errors
    /// When QEMU cannot be started.
    pub fn start() -> Result<Self, Error> {
        let arguments = env::var("ECU_QEMU_ARGUMENTS").unwrap_or_default();
        Self::start_with(IMAGE, 0, &arguments.split_whitespace().collect::<Vec<_>>())
    }

    /// Starts the processor with an image; an instruction takes 2^`shift` ns. Further arguments are QEMU's.
    ///
    /// # Errors
    /// When QEMU cannot be started.
    pub fn start_with(content: &[u8], shift: u32, arguments: &[&str]) -> Result<Self, Error> {
        static STARTED: AtomicU32 = AtomicU32::new(0);
        let number = STARTED.fetch_add(1, Ordering::Relaxed);
        let image = env::temp_dir().join(format!("ecu-{}-{number}.elf", process::id()));
        let failed = |what: &str, error| Error::new(format_args!("{what}: {error}"));
        fs::write(&image, content).map_err(|error| failed(&image.display().to_string(), error))?;
        let started = Command::new("qemu-system-arm")
            .args(["-M", "mps2-an500", "-display", "none", "-monitor", "none", "-serial", "stdio"])
            .args(["-icount", &format!("shift={shift}"), "-kernel"])
            .arg(&image)
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn();
        let mut process = started.map_err(|error| {
            // Nothing else removes it.
            let _ = fs::remove_file(&image);
            failed("qemu-system-arm cannot be started", error)
        })?;
        let (line, output) = (process.stdin.take(), process.stdout.take());
        let (Some(line), Some(mut output)) = (line, output) else {
            return Err(Error::new("QEMU has no pipes"));
        };
        let (sender, frames) = mpsc::channel();
        thread::spawn(move || {
            let mut receiver = frames::Receiver::<4096>::new();
            let mut bytes = [0; 4096];
            while let Ok(count @ 1..) = output.read(&mut bytes) {
                for &byte in &bytes[..count] {
                    if let Some((kind, content)) = receiver.take(byte)
                        && sender.send((kind, content.to_owned())).is_err()
                    {
                        return;
                    }
                }
            }
        });
        Ok(Self { process, line, frames: Mutex::new(frames), image })
    }

    /// Sends a frame.
    ///
    /// # Errors
    /// When QEMU has ended.
    pub fn send(&mut self, kind: Kind, cells: &[u64]) -> Result<(), Error> {
        let mut bytes = vec![];
        frames::send(kind, frames::bytes(cells.iter().copied()), |byte| bytes.push(byte));
        let sent = self.line.write_all(&bytes).and_then(|()| self.line.flush());
        sent.map_err(|error| Error::new(format_args!("the ECU does not listen: {error}")))
    }

    /// Waits for a frame.
    ///
    /// # Errors
    /// When there is none for a minute, or QEMU has ended.
    pub fn receive(&mut self) -> Result<(Kind, Vec<u8>), Error> {
        let frames = self.frames.get_mut().unwrap_or_else(PoisonError::into_inner);
        frames.recv_timeout(PATIENCE).map_err(|error| {
            let status = self.process.try_wait().ok().flatten();
            let status = status.map(|status| format!(" ({status})")).unwrap_or_default();
            Error::new(format_args!("the ECU does not answer: {error}{status}"))
        })
    }

    /// Writes the calibration page.
    ///
    /// # Errors
    /// When QEMU has ended.
    pub fn write_page(&mut self, page: &[u64]) -> Result<(), Error> {
        for (number, part) in page.chunks(MOST_PAGE_CELLS).enumerate() {
            let first = [(MOST_PAGE_CELLS * number) as u64];
            self.send(Kind::Page, &[&first, part].concat())?;
        }
        Ok(())
    }

    /// Has the firmware start anew with inputs.
    ///
    /// # Errors
    /// When QEMU has ended.
    pub fn initialize(&mut self, inputs: &mut dyn Iterator<Item = u64>) -> Result<(), Error> {
        self.send(Kind::Initialize, &inputs.collect::<Vec<_>>())
    }

    /// Has the firmware execute a sample with inputs.
    ///
    /// # Errors
    /// When QEMU has ended.
    pub fn sample(&mut self, inputs: &mut dyn Iterator<Item = u64>) -> Result<(), Error> {
        self.send(Kind::Sample, &inputs.collect::<Vec<_>>())
    }

    /// Waits for the answer, and passes messages on.
    ///
    /// # Errors
    /// The firmware's error, or that there is no answer.
    pub fn answer(&mut self, context: &mut Context<'_>) -> Result<Vec<u8>, Error> {
        loop {
            let (kind, content) = self.receive()?;
            let text = String::from_utf8_lossy(&content);
            match kind {
                Kind::Answer => return Ok(content),
                Kind::Warning => context.warn(format_args!("{text}")),
                Kind::Event => context.event(format_args!("{text}")),
                Kind::Error => return Err(Error::new(text)),
                _ => {}
            }
        }
    }
}

impl Drop for Ecu {
    fn drop(&mut self) {
        // It may have ended.
        let _ = self.process.kill();
        let _ = self.process.wait();
        let _ = fs::remove_file(&self.image);
    }
}
