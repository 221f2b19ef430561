//! `a2l`: the calibration description of a firmware.

use std::fs;
use std::io::Write as _;
use std::path::PathBuf;

use anyhow::{Context as _, Result};
use clap::Args;
use fmu_io::terminal::print;
use fmu_io::writing;
use fmu_package::a2l_of_firmware;

/// Write the A2L of a firmware, for calibration tools: its parameters and measurements with their addresses
#[derive(Args, Debug)]
pub struct A2l {
    /// The firmware's image, an ELF file with the A2L of its model
    #[arg(value_name = "IMAGE")]
    image: PathBuf,
    /// The file to write [default: the image's name with .a2l]
    #[arg(long, value_name = "FILE.a2l")]
    out: Option<PathBuf>,
}

impl A2l {
    /// Writes the A2L.
    ///
    /// # Errors
    /// When the image cannot be read, or has none, or when the file cannot be written.
    pub fn run(&self) -> Result<()> {
        let shown = self.image.display();
        let image = fs::read(&self.image).with_context(|| format!("cannot read {shown}"))?;
        let text = a2l_of_firmware(&image).with_context(|| format!("{shown} has no A2L"))?;
        let out = self.out.clone().unwrap_or_else(|| self.image.with_extension("a2l"));
        writing::write(&out, |writer| writer.write_all(text.as_bytes()))?;
        let count = |kind: &str| text.matches(&format!("/begin {kind} ")).count();
        let parameters = count("CHARACTERISTIC") + count("AXIS_PTS");
        let measurements = count("MEASUREMENT");
        Ok(print(&format!("{}  {parameters} parameters, {measurements} measurements\n", out.display()))?)
    }
}
