//! `sources/` of an FMU: the model as C, translated from its WebAssembly module by wasm2c, and the functions of FMI on
//! top of it, which are in this package's folder `sources`.
//!
//! wasm2c writes one file of many megabytes with helpers that are not C99. Here it is divided: declarations go into
//! `model.h`, functions into files of bearable length, and of the helpers those in `wasm.h` take the place. All names
//! are the model's own, so that several FMUs may be linked to one program.

use std::env;
use std::fs;
use std::mem;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, bail, ensure};
use fmu_package::reading;

/// The version of wasm2c whose output this reads.
const VERSION: &str = "1.0.32";

/// The variable that names the program, where it is not on the path.
const PROGRAM: &str = "WASM2C";

/// The longest file that the translation is divided into, in bytes.
const LONGEST: usize = 800_000;

/// The bytes of one file of data, at most five characters each.
const DATA: usize = 150_000;

/// The files that every FMU has.
const RUNTIME: [(&str, &str); 5] = [
    ("wasm.h", include_str!("../sources/wasm.h")),
    ("runtime.h", include_str!("../sources/runtime.h")),
    ("states.h", include_str!("../sources/states.h")),
    ("fmi2.c", include_str!("../sources/fmi2.c")),
    ("README.txt", include_str!("../sources/README.txt")),
];

/// The beginning of each translated file.
const TRANSLATED: &str = "\
/* Translated from WebAssembly. */

#include \"model.h\"

#if defined(__GNUC__)
/* As the translation goes statement by statement, some labels and values have no use; and functions without a result return what
   others do not. */
#pragma GCC diagnostic ignored \"-Wpedantic\"
#pragma GCC diagnostic ignored \"-Wunused-label\"
#pragma GCC diagnostic ignored \"-Wunused-but-set-variable\"
#pragma GCC diagnostic ignored \"-Wunused-variable\"
#pragma GCC diagnostic ignored \"-Wunused-value\"
#pragma GCC diagnostic ignored \"-Wunused-parameter\"
#endif
";

/// What the functions of Model Exchange count.
#[derive(Clone, Copy, Debug)]
pub struct Counts {
    /// The continuous states.
    pub states: usize,
    /// The event indicators.
    pub event_indicators: usize,
}

impl Counts {
    /// Those of a description of either version of FMI.
    pub fn of(description: &str) -> Self {
        let attribute = |name: &str| {
            let value = description.split(&format!(" {name}=\"")).nth(1)?.split('"').next()?;
            value.parse().ok()
        };
        let derivatives = description.split_once("<Derivatives>").map_or("", |(_, rest)| rest);
        let derivatives = derivatives.split("</Derivatives>").next().unwrap_or_default();
        Self {
            states: derivatives.matches("<Unknown ").count(),
            event_indicators: attribute("numberOfEventIndicators").unwrap_or(0),
        }
    }
}

/// Refuses to export without wasm2c, or with one whose output differs.
pub fn check_tools() -> Result<()> {
    let output = program().arg("--version").output().with_context(|| {
        format!(
            "`--sources` takes wasm2c {VERSION}: on Debian 12, `apt-get install wabt` brings it; {PROGRAM} names it \
             where it is not on the path"
        )
    })?;
    let version = String::from_utf8_lossy(&output.stdout);
    ensure!(
        version.trim() == VERSION,
        "`--sources` takes wasm2c {VERSION}, of https://github.com/WebAssembly/wabt/releases; this one is {}",
        version.trim()
    );
    Ok(())
}

fn program() -> Command {
    Command::new(env::var_os(PROGRAM).unwrap_or_else(|| "wasm2c".into()))
}

/// The files of `sources/`, and those of them to compile: of a model by its identifier. The folder is for
/// what lies between.
pub fn files(model: &str, module: &[u8], counts: Counts, folder: &Path) -> Result<Vec<(String, Vec<u8>)>> {
    fs::create_dir_all(folder).with_context(|| format!("cannot create the folder {}", folder.display()))?;
    let [wasm, c, h] = ["wasm", "c", "h"].map(|suffix| folder.join(model).with_extension(suffix));
    fs::write(&wasm, module).with_context(|| format!("cannot write {}", wasm.display()))?;
    let status = program().arg(&wasm).args(["--module-name", "model", "--output"]).arg(&c).status();
    ensure!(status.context("cannot run wasm2c")?.success(), "wasm2c cannot translate {}", wasm.display());
    let files = divide(model, counts, &reading::text(&h)?, &reading::text(&c)?)
        .with_context(|| format!("the output of wasm2c, {}, is not as that of {VERSION}", c.display()))?;
    let runtime =
        RUNTIME.iter().map(|&(name, text)| (name.to_owned(), text.replace("MODEL_IDENTIFIER", model)));
    Ok(runtime.chain(files).map(|(name, text)| (format!("sources/{name}"), text.into_bytes())).collect())
}

/// The files to compile among those of `sources/`, by their names in it.
pub fn compiled(files: &[(String, Vec<u8>)]) -> impl Iterator<Item = &str> {
    files.iter().filter_map(|(path, _)| {
        path.strip_prefix("sources/").filter(|_| path.rsplit('.').next() == Some("c"))
    })
}

/// The translation as files: what wasm2c wrote as a header and a file.
fn divide(model: &str, counts: Counts, header: &str, translation: &str) -> Result<Vec<(String, String)>> {
    let (_, after) = header.split_once("struct Z_fmu_instance_t;\n").context("there is no import")?;
    let (instance, exports) = after.split_once("} Z_model_instance_t;\n").context("there is no instance")?;
    let (_, translation) =
        translation.split_once("static bool s_module_initialized = false;\n").context("no helpers")?;

    let mut declarations: Vec<String> =
        exports.lines().filter(|line| line.ends_with(");")).map(str::to_owned).collect();
    let (mut files, mut functions, mut rest, mut data) = (vec![], String::new(), String::new(), vec![]);
    for item in items(translation) {
        if item.starts_with("static u32 func_types[")
            || item.starts_with("static void init_func_types(")
            || item.starts_with("void Z_model_init_module(")
        {
            // The index of a type is what distinguishes it.
        } else if let Some(array) = item.strip_prefix("static const u8 data_segment_data_") {
            let (name, bytes) = array.split_once("[]").context("an array has a size")?;
            data.push((name.to_owned(), numbers(bytes)?));
        } else if let Some(item) = item.strip_prefix("static ").filter(|item| is_of_module(item)) {
            if item.ends_with(");\n") {
                declarations.push(item.trim_end().to_owned());
            } else {
                if functions.len() + item.len() > LONGEST {
                    files.push(mem::take(&mut functions));
                }
                functions += item;
                functions.push('\n');
            }
        } else {
            rest += item;
            rest.push('\n');
        }
    }
    files.push(functions);
    rest = rest.replace("  assert(wasm_rt_is_initialized());\n  assert(s_module_initialized);\n", "");
    rest = rest.replace(", func_types);", ");");

    let mut named = vec![];
    for (name, bytes) in data {
        let load = format!("data_segment_data_{name}, {});", bytes.len());
        let line =
            rest.lines().find(|line| line.ends_with(&load)).context("an array is not loaded")?.to_owned();
        let start = line.trim_end_matches(load.as_str());
        let (before, address) =
            start.trim_end_matches("u, ").rsplit_once(' ').context("an array has no address")?;
        let address: usize = address.parse()?;
        let mut loads = String::new();
        for (index, part) in bytes.chunks(DATA).enumerate() {
            let array = format!("data_{name}_{index}");
            declarations.push(format!("extern const u8 {array}[{}];", part.len()));
            loads += &format!("{before} {}u, {array}, {}u);\n", address + index * DATA, part.len());
            named.push((format!("model_{array}.c"), data_file(&array, part)));
        }
        rest = rest.replace(&format!("{line}\n"), &loads);
    }
    if let Some(at) = rest.find(", func_types") {
        bail!("types are in a place of their own: {}", rest[at..].lines().next().unwrap_or_default());
    }

    let files = files.into_iter().enumerate().map(|(index, text)| (format!("model_{}.c", index + 1), text));
    named.extend(files.chain([("model.c".to_owned(), rest)]).map(|(name, text)| {
        // The table of types is left out, so their indices are compared.
        (name, format!("{TRANSLATED}\n{}", text.trim_start()))
    }));
    named.push(("model.h".to_owned(), model_h(model, counts, instance, &declarations)?));
    Ok(named)
}

/// The items of a file: comments, declarations up to a semicolon, and definitions up to the line `}` or `};`.
fn items(text: &str) -> impl Iterator<Item = &str> {
    let mut rest = text;
    std::iter::from_fn(move || {
        rest = rest.trim_start_matches('\n');
        let first = |ends: [&str; 2]| ends.iter().filter_map(|end| Some(rest.find(end)? + end.len())).min();
        let end = if rest.starts_with("/*") { first(["*/\n", "*/\n"]) } else { first([";\n", "{\n"]) };
        let end = if end.is_some_and(|end| rest[..end].ends_with("{\n")) {
            first(["\n}\n", "\n};\n"])
        } else {
            end
        };
        let end = end.unwrap_or(rest.len());
        let (item, after) = rest.split_at(end);
        rest = after;
        (!item.is_empty()).then_some(item)
    })
}

/// Whether an item is a function of the module, and not one of its initialization.
fn is_of_module(item: &str) -> bool {
    let name = item.split('(').next().and_then(|before| before.rsplit(' ').next());
    name.is_some_and(|name| name.starts_with("w2c_")) && item.contains("(Z_model_instance_t*")
}

/// The bytes of an array.
fn numbers(text: &str) -> Result<Vec<u8>> {
    let digits = text.split("0x").skip(1).map(|number| number.get(..2).unwrap_or_default());
    digits.map(|digits| u8::from_str_radix(digits, 16).context("a byte is not a number")).collect()
}

/// A file of data.
fn data_file(array: &str, bytes: &[u8]) -> String {
    let mut text =
        format!("/* Data of the model. */\n\n#include \"model.h\"\n\nconst u8 {array}[{}] = {{", bytes.len());
    for (index, byte) in bytes.iter().enumerate() {
        text += if index % 24 == 0 { "\n" } else { "" };
        text += &format!("{byte},");
    }
    text + "\n};\n"
}

/// `model.h`: the module's instance and its functions, under names that are the model's.
fn model_h(model: &str, counts: Counts, instance: &str, declarations: &[String]) -> Result<String> {
    let mut text = format!(
        "/* The translated model: an instance of its module, and its functions. */\n\n#ifndef MODEL_H\n#define MODEL_H\n\n\
         #define PREFIXED(name) {model}_##name\n#define MODEL_STATES {}\n#define MODEL_EVENT_INDICATORS {}\n\n\
         #include \"wasm.h\"\n\n#if defined(HIDES)\n#pragma GCC visibility push(hidden)\n#endif\n\n",
        counts.states, counts.event_indicators
    );
    for declaration in declarations {
        let before = declaration.split(['(', '[']).next().unwrap_or_default();
        let name = before.rsplit([' ', '*']).next().context("a declaration has no name")?;
        text += &format!("#define {name} PREFIXED({name})\n");
    }
    text += &format!("\nstruct Z_fmu_instance_t;\n{instance}}} Z_model_instance_t;\n\n");
    for declaration in declarations {
        text += declaration;
        text.push('\n');
    }
    text += "\n#if defined(HIDES)\n#pragma GCC visibility pop\n#endif\n\n#endif\n";
    Ok(text)
}
