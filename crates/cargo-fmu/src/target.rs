//! The targets of an FMU's libraries: FMI platforms or Rust targets, and the tools to build for them here.

use std::env::{self, consts};
use std::ffi::{OsStr, OsString};
use std::fs;
use std::io::{self, ErrorKind};
use std::path::Path;
use std::process::{Command, Stdio};
use std::str::FromStr;

use anyhow::{Context, Result, anyhow, bail, ensure};
use fmu_package::Platform;

use super::metadata::cargo;
use super::new;

/// A cargo profile.
#[derive(Clone, Debug)]
pub struct Profile {
    name: String,
    /// Settings in addition to the manifest's.
    settings: &'static [&'static str],
}

impl Profile {
    /// The name of the default profile.
    const LIBRARY: &str = "fmu-library";

    /// The profile for a trial, which compiles fast. Debug information would triple the time.
    pub fn trial() -> Self {
        Self { name: "dev".to_owned(), settings: &["debug=false"] }
    }

    /// Adds the profile to a command of cargo.
    fn choose(&self, command: &mut Command) {
        command.args(["--profile", &self.name]);
        for setting in self.settings {
            self.set(command, setting);
        }
    }

    /// Overrides a setting of the profile.
    fn set(&self, command: &mut Command, setting: &str) {
        command.args(["--config", &format!("profile.{}.{setting}", self.name)]);
    }
}

impl Default for Profile {
    /// The profile of the libraries. If the workspace's manifest does not define it, it is the release profile.
    fn default() -> Self {
        Self { name: Self::LIBRARY.to_owned(), settings: &[r#"inherits="release""#] }
    }
}

impl From<String> for Profile {
    fn from(name: String) -> Self {
        if name == Self::LIBRARY { Self::default() } else { Self { name, settings: &[] } }
    }
}

/// A `--target` argument.
#[derive(Clone, Debug)]
pub enum Target {
    /// A platform, by folder name.
    Platform(Platform),
    /// A Rust target.
    Triple(Build),
}

/// A build of all libraries for a Rust target.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Build {
    /// The folder for the libraries.
    pub platform: Platform,
    /// Rust's target name, then after a dot the oldest glibc to support; none for the host with cargo's defaults.
    target: Option<String>,
}

impl FromStr for Target {
    type Err = anyhow::Error;

    fn from_str(text: &str) -> Result<Self> {
        let (triple, glibc) = split(text);
        let Some(platform) = platform(triple) else {
            let none = |error: io::Error| anyhow!("not a Rust target for FMUs, and {error}");
            return text.parse().map(Self::Platform).map_err(none);
        };
        if glibc.is_some() && !triple.ends_with("-linux-gnu") {
            bail!("only glibc targets take a glibc version, as in x86_64-unknown-linux-gnu.2.17");
        }
        Ok(Self::Triple(Build { platform, target: Some(text.to_owned()) }))
    }
}

impl Target {
    /// The builds of a target; for macOS, two targets make one platform.
    pub fn builds(&self) -> Vec<Build> {
        match self {
            Self::Triple(build) => vec![build.clone()],
            &Self::Platform(platform) => triples(platform)
                .iter()
                .map(|&triple| Build { platform, target: Some(triple.to_owned()) })
                .collect(),
        }
    }
}

/// Rust's target name, and the glibc version after a dot.
fn split(target: &str) -> (&str, Option<&str>) {
    target.split_once('.').map_or((target, None), |(triple, glibc)| (triple, Some(glibc)))
}

/// A Rust target's platform.
fn platform(triple: &str) -> Option<Platform> {
    let (architecture, system) = triple.split_once('-')?;
    Some(match (architecture, system) {
        // Both go where importers look on macOS; `aarch64-darwin` must be requested explicitly.
        ("x86_64" | "aarch64", "apple-darwin") => Platform::Darwin64,
        ("aarch64", "unknown-linux-gnu") => Platform::Aarch64Linux,
        ("i586" | "i686", "unknown-linux-gnu") => Platform::Linux32,
        ("x86_64", "unknown-linux-gnu") => Platform::Linux64,
        ("aarch64", "pc-windows-msvc" | "pc-windows-gnullvm") => Platform::Aarch64Windows,
        ("i686", "pc-windows-msvc" | "pc-windows-gnu" | "pc-windows-gnullvm") => Platform::Win32,
        ("x86_64", "pc-windows-msvc" | "pc-windows-gnu" | "pc-windows-gnullvm") => Platform::Win64,
        _ => return None,
    })
}

/// The targets that make a platform's library. For Windows, the kind that can be linked here.
fn triples(platform: Platform) -> &'static [&'static str] {
    match platform {
        Platform::Aarch64Darwin => &["aarch64-apple-darwin"],
        Platform::Aarch64Linux => &["aarch64-unknown-linux-gnu"],
        Platform::Aarch64Windows if cfg!(target_env = "msvc") => &["aarch64-pc-windows-msvc"],
        Platform::Aarch64Windows => &["aarch64-pc-windows-gnullvm"],
        Platform::Darwin64 => &["x86_64-apple-darwin", "aarch64-apple-darwin"],
        Platform::Linux32 => &["i686-unknown-linux-gnu"],
        Platform::Linux64 => &["x86_64-unknown-linux-gnu"],
        Platform::Win32 if cfg!(target_env = "msvc") => &["i686-pc-windows-msvc"],
        Platform::Win32 => &["i686-pc-windows-gnu"],
        Platform::Win64 if cfg!(target_env = "msvc") => &["x86_64-pc-windows-msvc"],
        Platform::Win64 => &["x86_64-pc-windows-gnu"],
    }
}

/// Rust's name of this platform.
pub fn host_triple() -> Result<&'static str> {
    let all = triples(Build::host()?.platform);
    let own = all.iter().find(|triple| triple.starts_with(consts::ARCH)).or(all.first());
    own.copied().context("this platform has no Rust target")
}

/// A kind of build result.
pub trait Made {
    /// The result's name in messages.
    fn name(&self) -> &str;

    /// Rust's name of what the result is for.
    fn rust_target(&self) -> Result<&str>;

    /// The suffix of the result's file name.
    fn suffix(&self) -> &'static str;

    /// The command that builds the result in a target folder, with a profile if a library; the caller adds packages.
    fn command(&self, target: &Path, profile: &Profile) -> Command;
}

/// WebAssembly modules.
#[derive(Debug)]
pub struct WebAssembly;

impl WebAssembly {
    const TRIPLE: &'static str = "wasm32-unknown-unknown";

    /// The environment variable for a compiler other than cargo's.
    const COMPILER: &'static str = "FMU_WASM_RUSTC";

    /// The compiler, if not cargo's.
    fn compiler() -> Option<OsString> {
        env::var_os(Self::COMPILER)
    }

    /// Rejects a build without the standard library (its source if a compiler is set) or a linker.
    pub fn check_tools() -> Result<()> {
        let named = Self::compiler();
        let compiler = named.clone().unwrap_or_else(rustc);
        if named.is_none() {
            refuse_missing_std(Self::TRIPLE, &format!("without rustup, {}", Self::on_debian()))?;
        }
        let output = Command::new(&compiler)
            .args(["--print", "sysroot"])
            .output()
            .with_context(|| format!("cannot run {}, the compiler for WebAssembly", compiler.display()))?;
        let sysroot = String::from_utf8(output.stdout).context("rustc's output is not text")?;
        let libraries = Path::new(sysroot.trim()).join("lib/rustlib");
        ensure!(
            named.is_none() || libraries.join("src/rust/library/std/Cargo.toml").is_file(),
            "{}, set by {}, has no source of the standard library: {}",
            compiler.display(),
            Self::COMPILER,
            Self::on_debian()
        );
        // Rustc's default: its own linker, or one on the path.
        let own = format!("bin/rust-lld{}", consts::EXE_SUFFIX);
        let is_there =
            |target: io::Result<fs::DirEntry>| target.is_ok_and(|it| it.path().join(&own).is_file());
        let linker = linker(Self::TRIPLE);
        let has_linker = match &linker {
            Some(linker) => is_installed(linker)?,
            None => {
                fs::read_dir(libraries).is_ok_and(|mut targets| targets.any(is_there))
                    || is_installed("rust-lld")?
            }
        };
        ensure!(
            has_linker,
            "no linker {} for {}; set {}: {}",
            linker.unwrap_or_else(|| "rust-lld".into()).display(),
            compiler.display(),
            linker_variable(Self::TRIPLE),
            Self::on_debian()
        );
        Ok(())
    }

    /// How to install compiler and linker without rustup: a checkout's script, or its commands.
    fn on_debian() -> String {
        let script = new::checkout().map(|crates| crates.with_file_name("release").join("wasm-tools"));
        let line = match script {
            Some(script) => format!("`eval \"$(bash '{}')\"`", script.display()),
            None => format!(
                "`apt-get install rustc-web rust-web-src lld` and `export {}=/usr/bin/rustc {}=wasm-ld`",
                Self::COMPILER,
                linker_variable(Self::TRIPLE)
            ),
        };
        format!("on Debian, {line} installs and configures it")
    }
}

impl Made for WebAssembly {
    fn name(&self) -> &'static str {
        "WebAssembly"
    }

    fn rust_target(&self) -> Result<&str> {
        Ok(Self::TRIPLE)
    }

    fn suffix(&self) -> &'static str {
        "wasm"
    }

    fn command(&self, target: &Path, _profile: &Profile) -> Command {
        let profile = Profile::default();
        let mut command = build_command(&profile);
        command.args(["--target", Self::TRIPLE]);
        // Nothing unwinds there. Optimizing for size would make the plant's module a quarter smaller, but its steps,
        // translated to C, 1.2 times as slow, and the controller's 1.9 times.
        let settings = [r#"panic="abort""#, "opt-level=3", r#"lto="fat""#, "codegen-units=1", "strip=true"];
        for setting in settings {
            profile.set(&mut command, setting);
        }
        if let Some(compiler) = Self::compiler() {
            // Cargo would confuse the modules of two compilers.
            command.arg("--target-dir").arg(target.join("fmu-wasm"));
            command.env("RUSTC", compiler).env("RUSTC_BOOTSTRAP", "1");
            command.env("CARGO_UNSTABLE_BUILD_STD", "std,panic_abort");
            command.env("CARGO_UNSTABLE_BUILD_STD_FEATURES", "optimize_for_size");
        }
        command
    }
}

/// The common start of build commands with cargo.
fn build_command(profile: &Profile) -> Command {
    let mut command = cargo();
    command.arg("build");
    profile.choose(&mut command);
    command
}

impl Made for Build {
    fn name(&self) -> &str {
        self.target.as_deref().unwrap_or(self.platform.folder())
    }

    fn rust_target(&self) -> Result<&str> {
        match self.triple() {
            Some(triple) => Ok(triple),
            None => host_triple(),
        }
    }

    fn suffix(&self) -> &'static str {
        self.platform.format().suffix()
    }

    fn command(&self, _target: &Path, profile: &Profile) -> Command {
        let mut command = if self.links_with_zig() {
            let mut command = Command::new("cargo-zigbuild");
            command.arg("zigbuild");
            profile.choose(&mut command);
            command
        } else {
            build_command(profile)
        };
        if let Some(target) = &self.target {
            command.args(["--target", target]);
        }
        match self.platform {
            // The library's own name is its file name, not its build path.
            Platform::Darwin64 | Platform::Aarch64Darwin => {
                profile.set(&mut command, "rpath=true");
            }
            // The run-time library goes into the FMU (FMI 2.0.5, section 2.3: "option MT").
            Platform::Win32 | Platform::Win64 | Platform::Aarch64Windows => {
                let flags = r#"target.'cfg(target_env="msvc")'.rustflags=["-Ctarget-feature=+crt-static"]"#;
                command.args(["--config", flags]);
            }
            _ => {}
        }
        command
    }
}

impl Build {
    /// The build for this platform.
    pub fn host() -> Result<Self> {
        let platform = Platform::host()
            .context("FMI 2.0 has no name for this platform; see binaries/ in its section 2.3")?;
        Ok(Self { platform, target: None })
    }

    /// Rust's target name; none for the host.
    pub fn triple(&self) -> Option<&str> {
        self.target.as_deref().map(|target| split(target).0)
    }

    /// Rejects a build if the target's standard library or linker is missing, with installation instructions.
    pub fn check_tools(&self) -> Result<()> {
        let Some((triple, _)) = self.target.as_deref().map(split) else { return Ok(()) };
        refuse_missing_std(triple, "without rustup, cargo can build it, as docs/platforms.md says")?;
        if self.links_with_zig() {
            if !is_installed("cargo-zigbuild")? {
                bail!(
                    "linking for {} needs cargo-zigbuild: `pip install cargo-zigbuild` installs it and zig",
                    self.name()
                );
            }
        } else if linker(triple).is_none() && !cfg!(windows) {
            if triple.ends_with("-windows-gnu") {
                // Rustc's default.
                let processor = triple.split('-').next().unwrap_or_default();
                let mingw = format!("{processor}-w64-mingw32-gcc");
                if !is_installed(&mingw)? {
                    bail!(
                        "linking for {triple} needs {mingw}: on Debian, `apt-get install gcc-mingw-w64-{}` \
                         installs it",
                        processor.replace('_', "-")
                    );
                }
            } else if triple.contains("-windows-") {
                bail!(
                    "no linker for {triple} is known; set {}, or build on Windows",
                    linker_variable(triple)
                );
            }
        }
        Ok(())
    }

    /// Whether zig links: if no linker here can.
    fn links_with_zig(&self) -> bool {
        let Some((triple, glibc)) = self.target.as_deref().map(split) else { return false };
        let is_native = match self.platform {
            Platform::Darwin64 | Platform::Aarch64Darwin => consts::OS == "macos",
            Platform::Linux32 | Platform::Linux64 | Platform::Aarch64Linux => {
                consts::OS == "linux" && triple.starts_with(consts::ARCH)
            }
            // Zig cannot link for Windows; mingw does.
            Platform::Win32 | Platform::Win64 | Platform::Aarch64Windows => true,
        };
        glibc.is_some() || !is_native && linker(triple).is_none()
    }
}

/// Cargo's environment variable for a target's linker.
fn linker_variable(triple: &str) -> String {
    format!("CARGO_TARGET_{}_LINKER", triple.to_uppercase().replace('-', "_"))
}

fn linker(triple: &str) -> Option<OsString> {
    env::var_os(linker_variable(triple))
}

/// Cargo's compiler.
fn rustc() -> OsString {
    env::var_os("RUSTC").unwrap_or_else(|| "rustc".into())
}

/// Rejects a build without a target's standard library; `otherwise` is the remedy without rustup.
fn refuse_missing_std(triple: &str, otherwise: &str) -> Result<()> {
    // Cargo builds it.
    if env::var_os("CARGO_UNSTABLE_BUILD_STD").is_some() {
        return Ok(());
    }
    let rustc = rustc();
    let output = Command::new(&rustc)
        .args(["--print", "target-libdir", "--target", triple])
        .output()
        .with_context(|| format!("cannot run {}", rustc.display()))?;
    if !output.status.success() {
        let message = String::from_utf8_lossy(&output.stderr);
        bail!("{} does not know the target {triple}: {}", rustc.display(), message.trim());
    }
    let folder = String::from_utf8(output.stdout).context("rustc's output is not text")?;
    let has_std = fs::read_dir(Path::new(folder.trim())).is_ok_and(|entries| {
        entries.flatten().any(|entry| entry.file_name().to_string_lossy().starts_with("libstd-"))
    });
    if !has_std {
        bail!(
            "{} has no standard library for {triple}: `rustup target add {triple}` installs it; {otherwise}",
            rustc.display()
        );
    }
    Ok(())
}

/// Whether a program can be run.
fn is_installed(program: impl AsRef<OsStr>) -> Result<bool> {
    let program = program.as_ref();
    let status = Command::new(program).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
    match status {
        Ok(_) => Ok(true),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(false),
        Err(error) => Err(error).with_context(|| format!("cannot run {}", program.display())),
    }
}

/// Reads an argument for a platform: its folder, `=`, and the value.
pub fn of_platform<Value: From<String>>(text: &str) -> Result<(Platform, Value)> {
    let (folder, value) = text.split_once('=').context("it contains no '='")?;
    Ok((folder.parse()?, value.to_owned().into()))
}
