//! `sources/` of an FMU: the model as C, translated by wasm2c from its WebAssembly module, and the FMI functions on
//! top of it, from this package's folder `sources`.
//!
//! wasm2c writes one file of many megabytes with helpers that are not C99. Here it is split: declarations go into
//! `model.h`, functions into files of manageable length, and `wasm.h` replaces the helpers. All names are specific to
//! the model, so that several FMUs can be linked into one program.

use std::env;
use std::fs;
use std::mem;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, bail, ensure};
use fmu_io::reading;
use fmu_package::FmuDescription;
use fmu_terms::Version;
use fmu_xml::{document, element, empty};

/// The wasm2c version whose output this reads.
const VERSION: &str = "1.0.32";

/// The environment variable for the path of wasm2c.
const PROGRAM: &str = "WASM2C";

/// The folder of the sources.
const FOLDER: &str = "sources/";

/// The longest translated file, in bytes.
const LONGEST: usize = 800_000;

/// The bytes in one data file, at most five characters each.
const DATA: usize = 150_000;

/// The pages by which the memory of an instance may grow, 64 KiB each. They are allocated up front, but most systems
/// provide memory only on the first write.
const PAGES_TO_GROW: u32 = 240;

/// The files of every FMU.
const RUNTIME: [(&str, &str); 7] = [
    ("wasm.h", include_str!("../sources/wasm.h")),
    ("wasm.c", include_str!("../sources/wasm.c")),
    ("instance.h", include_str!("../sources/instance.h")),
    ("arguments.h", include_str!("../sources/arguments.h")),
    ("runtime.h", include_str!("../sources/runtime.h")),
    ("states.h", include_str!("../sources/states.h")),
    ("README.txt", include_str!("../sources/README.txt")),
];

/// The file with the functions of an FMI version.
fn functions(version: Version) -> (&'static str, &'static str) {
    match version {
        Version::Two => ("fmi2.c", include_str!("../sources/fmi2.c")),
        Version::Three => ("fmi3.c", include_str!("../sources/fmi3.c")),
    }
}

/// The start of each translated file.
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

/// The memory among an instance's fields.
const MEMORY: &str = "  wasm_rt_memory_t w2c_memory;\n";

/// Rejects the export without wasm2c, or with a version whose output differs.
pub fn check_tools() -> Result<()> {
    let output = program().arg("--version").output().with_context(|| {
        format!(
            "`--sources` needs wasm2c {VERSION}: on Debian 12, `apt-get install wabt` installs it; set {PROGRAM} \
             if it is not on the path"
        )
    })?;
    let version = String::from_utf8_lossy(&output.stdout);
    ensure!(
        version.trim() == VERSION,
        "`--sources` needs wasm2c {VERSION}, from https://github.com/WebAssembly/wabt/releases; this one is {}",
        version.trim()
    );
    Ok(())
}

fn program() -> Command {
    Command::new(env::var_os(PROGRAM).unwrap_or_else(|| "wasm2c".into()))
}

/// A model's module.
pub struct Module<'a> {
    /// The model identifier.
    pub model: &'a str,
    /// The version of FMI.
    pub version: Version,
    /// The model's description.
    pub description: &'a str,
    /// The module.
    pub bytes: &'a [u8],
}

/// The files of a model's `sources/`. The folder is for intermediate files.
pub fn files(module: &Module<'_>, folder: &Path) -> Result<Vec<(String, Vec<u8>)>> {
    fs::create_dir_all(folder).with_context(|| format!("cannot create the folder {}", folder.display()))?;
    let [wasm, c, h] = ["wasm", "c", "h"].map(|suffix| folder.join(module.model).with_extension(suffix));
    fs::write(&wasm, module.bytes).with_context(|| format!("cannot write {}", wasm.display()))?;
    let status = program().arg(&wasm).args(["--module-name", "model", "--output"]).arg(&c).status();
    ensure!(status.context("cannot run wasm2c")?.success(), "wasm2c cannot translate {}", wasm.display());
    let mut files = divide(module, &reading::text(&h)?, &reading::text(&c)?)
        .with_context(|| format!("{} is not the output of wasm2c {VERSION}", c.display()))?;
    let runtime = RUNTIME.into_iter().chain([functions(module.version)]);
    let named = |text: &str| {
        let prefix = format!("FMI{}_FUNCTION_PREFIX", module.version);
        text.replace("MODEL_IDENTIFIER", module.model).replace("FUNCTION_PREFIX_OF_VERSION", &prefix)
    };
    files.extend(runtime.map(|(name, text)| (name.to_owned(), named(text))));
    if module.version == Version::Three {
        files.push(("buildDescription.xml".to_owned(), build_description(module.model, &compiled(&files))));
    }
    Ok(files.into_iter().map(|(name, text)| (format!("{FOLDER}{name}"), text.into_bytes())).collect())
}

/// The files to compile, by name in the folder.
pub fn compiled<T>(files: &[(String, T)]) -> Vec<&str> {
    let names = files.iter().map(|(path, _)| path.strip_prefix(FOLDER).unwrap_or(path));
    names.filter(|name| Path::new(name).extension().is_some_and(|suffix| suffix == "c")).collect()
}

/// `buildDescription.xml` (FMI 3.0.2, section 2.5.1) with the files to compile.
fn build_description(model: &str, files: &[&str]) -> String {
    document(|writer| {
        element(writer, "fmiBuildDescription", vec![("fmiVersion", "3.0".to_owned())], |writer| {
            let identifier = vec![("modelIdentifier", model.to_owned())];
            element(writer, "BuildConfiguration", identifier, |writer| {
                element(writer, "SourceFileSet", vec![("language", "C99".to_owned())], |writer| {
                    files
                        .iter()
                        .try_for_each(|&name| empty(writer, "SourceFile", vec![("name", name.to_owned())]))
                })
            })
        })
    })
}

/// The translation as files: wasm2c's header and source.
fn divide(module: &Module<'_>, header: &str, translation: &str) -> Result<Vec<(String, String)>> {
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
            // A type's index identifies it.
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
    // wasm2c would pass imported functions the address of their own import.
    rest = rest.replace("offsetof(Z_model_instance_t, Z_fmu_instance)}", "1}");
    let pages = rest.split("wasm_rt_allocate_memory(&instance->w2c_memory, ").nth(1);
    let pages =
        pages.and_then(|rest| rest.split(',').next()).context("there is no memory")?.parse::<u32>()?;

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
        bail!("types are in a separate place: {}", rest[at..].lines().next().unwrap_or_default());
    }

    let files = files.into_iter().enumerate().map(|(index, text)| (format!("model_{}.c", index + 1), text));
    named.extend(files.chain([("model.c".to_owned(), rest)]).map(|(name, text)| {
        // The type table is omitted, so indices are compared.
        (name, format!("{TRANSLATED}\n{}", text.trim_start()))
    }));
    named.push(("model.h".to_owned(), model_h(module, pages, instance, &declarations)?));
    Ok(named)
}

/// A file's items: comments, declarations up to a semicolon, and definitions up to the line `}` or `};`.
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

/// Whether an item is a function of the module other than its initialization.
fn is_of_module(item: &str) -> bool {
    let name = item.split('(').next().and_then(|before| before.rsplit(' ').next());
    name.is_some_and(|name| name.starts_with("w2c_")) && item.contains("(Z_model_instance_t*")
}

/// An array's bytes.
fn numbers(text: &str) -> Result<Vec<u8>> {
    let digits = text.split("0x").skip(1).map(|number| number.get(..2).unwrap_or_default());
    digits.map(|digits| u8::from_str_radix(digits, 16).context("a byte is not a number")).collect()
}

/// A data file.
fn data_file(array: &str, bytes: &[u8]) -> String {
    let mut text =
        format!("/* Data of the model. */\n\n#include \"model.h\"\n\nconst u8 {array}[{}] = {{", bytes.len());
    for (index, byte) in bytes.iter().enumerate() {
        text += if index % 24 == 0 { "\n" } else { "" };
        text += &format!("{byte},");
    }
    text + "\n};\n"
}

/// `model.h`: the module's instance and functions, under model-specific names.
fn model_h(module: &Module<'_>, pages: u32, instance: &str, declarations: &[String]) -> Result<String> {
    let mut text = format!(
        "/* The translated model: an instance of its module, and its functions. */\n\n#ifndef MODEL_H\n#define MODEL_H\n\n\
         #define PREFIXED(name) {}_##name\n\n\
         /* The most memory of an instance, in pages of 64 KiB: it starts with {pages}. */\n\
         #ifndef MODEL_PAGES\n#define MODEL_PAGES {}\n#endif\n",
        module.model,
        pages + PAGES_TO_GROW
    );
    if module.version == Version::Two {
        // FMI 3.0's functions leave them to the module.
        let description = FmuDescription::parse(module.description)?;
        let (states, indicators) =
            (description.continuous_states()?.len(), description.number_of_event_indicators()?);
        text += &format!("\n#define MODEL_STATES {states}\n#define MODEL_EVENT_INDICATORS {indicators}\n");
    }
    text += "\n#include \"wasm.h\"\n\n#if defined(HIDES)\n#pragma GCC visibility push(hidden)\n#endif\n\n";
    for declaration in declarations {
        let before = declaration.split(['(', '[']).next().unwrap_or_default();
        let name = before.rsplit([' ', '*']).next().context("a declaration has no name")?;
        text += &format!("#define {name} PREFIXED({name})\n");
    }
    // The memory has its bytes at its end.
    let (before, after) = instance.split_once(MEMORY).context("the instance has no memory")?;
    text += &format!("\nstruct Z_fmu_instance_t;\n{before}{after}{MEMORY}}} Z_model_instance_t;\n\n");
    for declaration in declarations {
        text += declaration;
        text.push('\n');
    }
    text += "\n#if defined(HIDES)\n#pragma GCC visibility pop\n#endif\n\n#endif\n";
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sources_define_the_functions_of_the_table() {
        for version in [Version::Two, Version::Three] {
            let (file, text) = functions(version);
            // Each is the first argument of the macro that defines it; this one of FMI 3.0 defines two.
            let first_argument = |text: &str| text.split([',', ')']).next().unwrap_or_default().to_owned();
            let prefix = format!("fmi{version}");
            let named = text.split('(').map(first_argument).filter(|name| name.starts_with(&prefix));
            let one_by_one = named.filter(|name| !name.contains("##"));
            let types = text.split("\nGET_AND_SET(").skip(1).map(first_argument);
            let by_type =
                types.flat_map(|data_type| ["Get", "Set"].map(|of| format!("{prefix}{of}{data_type}")));
            let mut defined: Vec<_> = one_by_one.chain(by_type).collect();
            let mut expected: Vec<_> = fmu_package::functions(version).collect();
            defined.sort();
            expected.sort_unstable();
            assert_eq!(defined, expected, "{file}");
        }
    }
}
