//! Plots as files, by the endings of their names.

use std::ffi::OsStr;
use std::path::Path;

use anyhow::{Result, bail};

use fmu_plot::{Figure, Report};

/// What a plot is written as.
#[derive(Clone, Copy, Debug)]
pub enum PlotFormat {
    /// A drawing.
    Svg,
    /// A picture.
    Png,
    /// An interactive page.
    Html,
}

impl PlotFormat {
    /// The format by the ending of a file's name.
    ///
    /// # Errors
    /// When it is none of these.
    pub fn of(path: &Path) -> Result<Self> {
        match path.extension().map(OsStr::to_ascii_lowercase).unwrap_or_default().to_str() {
            Some("svg") => Ok(Self::Svg),
            Some("png") => Ok(Self::Png),
            Some("html") => Ok(Self::Html),
            _ => bail!("{}: a plot file must end with .svg, .png or .html", path.display()),
        }
    }

    /// The file's content; a page has a report below the figure.
    ///
    /// # Errors
    /// When the figure cannot be drawn.
    pub fn drawn(self, figure: &Figure, title: &str, below: &Report) -> Result<Vec<u8>> {
        match self {
            Self::Svg => Ok(figure.svg()?.into_bytes()),
            Self::Png => figure.png(),
            Self::Html => {
                let mut report = Report::new(title);
                report.figure(figure, "");
                report.append(below);
                Ok(report.page("").into_bytes())
            }
        }
    }
}
