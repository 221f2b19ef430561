//! Random types with `#[derive(Persistent)]`: rustc compiles them, and their values are written and read back.
//!
//! The expected bytes are put together here, field by field. Needs cargo, so it is ignored by default; the same types
//! are tried each time. For others and more:
//! `RANDOM_DECLARATIONS=2000 cargo test -p fmu-export --test declarations -- --ignored`.
#![cfg(feature = "derive")]

#[path = "../../fmu-export-build/tests/random/mod.rs"]
mod random;

use std::env;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use random::Random;

/// How many types are tried, unless `RANDOM_DECLARATIONS` gives another number.
const COUNT: usize = 100;

/// What the generated package begins with.
const HEAD: &str = "
#![allow(dead_code, non_camel_case_types, unpredictable_function_pointer_comparisons, unused_braces)]
use fmu_export::{Persistent, persistence::Archive};

pub struct Two<A, B>(core::marker::PhantomData<(A, B)>);
impl<A, B> Two<A, B> {
    const HUNDRED: i64 = 100;
}
pub trait Sized2<const N: usize> {}
impl<T> Sized2<2> for T {}

#[derive(Persistent)]
pub struct Mapped<F: Fn(u8) -> u8 = fn(u8) -> u8>(#[persistent(skip)] core::marker::PhantomData<F>);

fn check<T: core::fmt::Debug + PartialEq + Persistent>(mut written: T, bytes: &[u8], mut read: T, expected: &T) {
    let mut archive = Archive::writing();
    written.persist(&mut archive).unwrap();
    assert_eq!(archive.into_bytes(), bytes, \"{written:?}\");
    let mut archive = Archive::reading(bytes);
    read.persist(&mut archive).unwrap();
    assert!(archive.is_exhausted(), \"{written:?}\");
    assert_eq!(&read, expected);
}
";

#[rustfmt::skip]
const NAMES: [&str; 24] = [
    "r#type", "r#match", "r#gen", "r#where", "r#struct", "r#pub", "r#const", "x", "y_1", "archive", "before", "variant",
    "field_0", "field_1", "union", "auto", "self_", "skip", "serde", "persistent", "größe", "r#speed",
    "core", "fmu_export",
];

const PARAMETERS: [&str; 6] = ["T", "U", "Persistent2", "r#dyn", "Vec2", "Größe"];

#[rustfmt::skip]
const BOUNDS: [&str; 9] = [
    "", ":", ": Copy", ": Clone + ::core::fmt::Debug", ": ::core::ops::Add<Output = #>", ": Sized2<{ 2 }> + Copy",
    ": for<'z> ::core::iter::Sum<&'z #>", ": PartialEq<#> + PartialOrd", ": Into<Option<#>>",
];

#[rustfmt::skip]
const PREDICATES: [&str; 7] = [
    "#: Copy", "for<'z> &'z #: ::core::ops::Add<#, Output = #>", "#: Sized2<{ 1 + 1 }>", "fn(#, u8) -> Option<#>: Copy",
    "(#, u8): Clone", "[#; { 1 << 2 }]: Default", "Vec<Vec<#>>: ::core::fmt::Debug",
];

#[rustfmt::skip]
const ATTRIBUTES: [&str; 7] = [
    "", "", "/// A doc comment, of <b> and '\"'.\n", "#[doc(hidden)]", "#[cfg(all())]",
    "#[allow(unused, dead_code)]", "#[rustfmt::skip]",
];

const SKIPS: [&str; 4] = [
    "#[persistent(skip)]",
    "#[persistent(skip,)]",
    "#[cfg_attr(all(), persistent(skip))]",
    "#[persistent(serde, skip)]",
];

/// Types of skipped fields, and values that are not their default.
const SKIPPED: [(&str, &str); 4] = [
    ("Option<fn(u8, Vec<u8>) -> Option<(u8, u8)>>", "Some(|_, _| None)"),
    ("::core::marker::PhantomData<[u8; 1 << 3]>", "::core::marker::PhantomData"),
    ("(u16, &'static str)", "(7, \"skipped\")"),
    ("std::sync::Arc<Box<u8>>", "std::sync::Arc::new(Box::new(7))"),
];

/// Different ones for different numbers.
#[rustfmt::skip]
const DISCRIMINANTS: [&str; 5] =
    ["100 * #", "(100) * #", "Two::<u8, Vec<u16>>::HUNDRED * #", "(#00 << 3) >> 3", "{ 100 - 0 } * #"];

const NUMBERS: [&str; 4] = ["u8", "u16", "i32", "f64"];

const VISIBILITIES: [&str; 6] = ["", "", "pub", "pub(crate)", "pub(in crate)", "pub(self)"];

/// A value, and the same with defaults in place of what is skipped: expressions, and the bytes of the state.
#[derive(Clone, Default)]
struct Value {
    expression: String,
    restored: String,
    bytes: Vec<u8>,
}

impl Value {
    fn of(expression: String, bytes: &[u8]) -> Self {
        Self { restored: expression.clone(), expression, bytes: bytes.to_vec() }
    }

    /// Values in a row, after a count or variant's number.
    fn row(begin: &str, number: &[u8], values: &[(String, Value)], end: &str) -> Self {
        let list = |of: fn(&Self) -> &str| {
            values.iter().fold(begin.to_owned(), |text, (name, value)| text + name + of(value) + ",") + end
        };
        let bytes = values.iter().flat_map(|(_, value)| value.bytes.iter());
        Self {
            expression: list(|value| &value.expression),
            restored: list(|value| &value.restored),
            bytes: number.iter().chain(bytes).copied().collect(),
        }
    }
}

/// The type of a field.
#[derive(Clone)]
enum Type {
    /// Of numbers, or a parameter that stands for one.
    Number {
        name: String,
        number: &'static str,
    },
    Text,
    Truth,
    Option(Box<Type>),
    Boxed(Box<Type>),
    Vec(Box<Type>),
    Array(Box<Type>, String, usize),
    Tuple(Vec<Type>),
    /// An earlier one, by its place.
    Declared(usize),
    /// Never persisted: its name, and a value that is not the default.
    Skipped(String, &'static str),
}

/// A declared type.
struct Declared {
    /// With its arguments.
    name: String,
    variants: Vec<Variant>,
    is_enum: bool,
}

struct Variant {
    path: String,
    /// Names, or numbers in a tuple, and types.
    fields: Vec<(String, Type)>,
}

impl Random {
    /// Different ones.
    fn some<T: Copy + PartialEq>(&mut self, from: &[T], count: usize) -> Vec<T> {
        let mut some = vec![];
        while some.len() < count {
            let one = self.pick(from);
            if !some.contains(&one) {
                some.push(one);
            }
        }
        some
    }

    fn number(&mut self, number: &str) -> Value {
        let value = u8::try_from(self.below(200)).expect("it is less");
        let bytes = match number {
            "u8" => vec![value],
            "u16" => u16::from(value).to_le_bytes().to_vec(),
            "i32" => i32::from(value).to_le_bytes().to_vec(),
            _ => f64::from(value).to_le_bytes().to_vec(),
        };
        Value::of(format!("{value}_{number}"), &bytes)
    }

    fn value(&mut self, of: &Type, known: &[Declared]) -> Value {
        let row = |random: &mut Self, of: &Type, count: usize| -> Vec<(String, Value)> {
            (0..count).map(|_| (String::new(), random.value(of, known))).collect()
        };
        match of {
            Type::Number { number, .. } => self.number(number),
            Type::Truth => {
                let truth = self.one_in(2);
                Value::of(truth.to_string(), &[u8::from(truth)])
            }
            Type::Text => {
                let text = self.pick(&["", "a", "größer"]);
                let bytes = [&(text.len() as u64).to_le_bytes(), text.as_bytes()].concat();
                Value::of(format!("{text:?}.to_owned()"), &bytes)
            }
            Type::Option(_) if self.one_in(2) => Value::of("None".to_owned(), &[0]),
            Type::Option(inner) => Value::row("Some(", &[1], &row(self, inner, 1), ")"),
            Type::Boxed(inner) => Value::row("Box::new(", &[], &row(self, inner, 1), ")"),
            Type::Vec(inner) => {
                let count = self.below(4);
                Value::row("vec![", &(count as u64).to_le_bytes(), &row(self, inner, count), "]")
            }
            Type::Array(inner, _, count) => Value::row("[", &[], &row(self, inner, *count), "]"),
            Type::Tuple(types) => {
                let values = types.iter().map(|of| (String::new(), self.value(of, known)));
                Value::row("(", &[], &values.collect::<Vec<_>>(), ")")
            }
            Type::Skipped(_, value) => Value {
                expression: (*value).to_owned(),
                restored: "Default::default()".to_owned(),
                bytes: vec![],
            },
            Type::Declared(place) => {
                let declared = &known[*place];
                let number = self.below(declared.variants.len());
                let Variant { path, fields, .. } = &declared.variants[number];
                let values: Vec<_> =
                    fields.iter().map(|(name, of)| (format!("{name}: "), self.value(of, known))).collect();
                let number = u32::try_from(number).expect("there are few").to_le_bytes();
                let number: &[u8] = if declared.is_enum { &number } else { &[] };
                Value::row(&format!("{path} {{"), number, &values, "}")
            }
        }
    }

    /// Of parameters and what was declared before.
    fn field_type(
        &mut self,
        parameters: &[Type],
        length: Option<&(String, usize)>,
        known: &[Declared],
        depth: usize,
    ) -> Type {
        let inner = |random: &mut Self| {
            Box::new(random.field_type(parameters, length, if depth > 1 { &[] } else { known }, depth + 1))
        };
        match self.below(if depth > 2 { 5 } else { 12 }) {
            0 => Type::Text,
            1 => Type::Truth,
            2 | 3 if !parameters.is_empty() => parameters[self.below(parameters.len())].clone(),
            5 | 6 if !known.is_empty() => Type::Declared(self.below(known.len())),
            7 => Type::Option(inner(self)),
            8 => Type::Boxed(inner(self)),
            // Those of types without content are not read.
            9 => Type::Vec(Box::new(Type::Option(inner(self)))),
            10 => match length {
                Some((name, length)) if self.one_in(2) => Type::Array(inner(self), name.clone(), *length),
                _ => Type::Array(inner(self), "{ 1 << 1 }".to_owned(), 2),
            },
            11 => Type::Tuple((0..=self.below(3)).map(|_| *inner(self)).collect()),
            _ => {
                let number = self.pick(&NUMBERS);
                Type::Number { name: number.to_owned(), number }
            }
        }
    }
}

fn written(of: &Type, known: &[Declared]) -> String {
    match of {
        Type::Number { name, .. } | Type::Skipped(name, _) => name.clone(),
        Type::Text => "String".to_owned(),
        Type::Truth => "bool".to_owned(),
        Type::Option(inner) => format!("Option<{}>", written(inner, known)),
        Type::Boxed(inner) => format!("Box<{}>", written(inner, known)),
        Type::Vec(inner) => format!("Vec<{}>", written(inner, known)),
        Type::Array(inner, length, _) => format!("[{}; {length}]", written(inner, known)),
        Type::Tuple(types) => {
            format!("({})", types.iter().map(|of| written(of, known) + ",").collect::<String>())
        }
        Type::Declared(place) => known[*place].name.clone(),
    }
}

/// Writes a new type's fields.
struct Writer<'a> {
    random: &'a mut Random,
    known: &'a [Declared],
    parameters: Vec<Type>,
    length: Option<(String, usize)>,
    /// Whether the type stands in a `macro_rules`.
    by_macro: bool,
    /// The field's type that the `macro_rules` gets as an argument.
    field: Option<String>,
}

impl Writer<'_> {
    /// The fields of a struct or variant: these types and random ones.
    fn fields(&mut self, path: String, mut types: Vec<Type>, is_variant: bool) -> (String, Variant) {
        let random = &mut *self.random;
        for _ in 0..random.below(4) {
            let of = random.field_type(&self.parameters, self.length.as_ref(), self.known, 0);
            types.insert(random.below(types.len() + 1), of);
        }
        if random.one_in(2) {
            let (name, value) = random.pick(&SKIPPED);
            types.insert(random.below(types.len() + 1), Type::Skipped(name.to_owned(), value));
        }
        let is_tuple = random.one_in(2);
        let names = random.some(&NAMES, types.len());
        let (mut text, mut fields) = (String::new(), vec![]);
        for (position, (of, name)) in types.into_iter().zip(names).enumerate() {
            let mut written = written(&of, self.known);
            let mut attributes = random.pick(&ATTRIBUTES).to_owned();
            if let Type::Skipped(..) = of {
                let skip = if self.by_macro { "#[$skip]" } else { random.pick(&SKIPS) };
                attributes = format!("{skip} {attributes} ");
            } else if self.by_macro && self.field.is_none() {
                self.field = Some(std::mem::replace(&mut written, "$field".to_owned()));
            }
            let visibility = match random.pick(&VISIBILITIES) {
                _ if is_variant => "",
                "pub" if self.by_macro => "$visibility",
                other => other,
            };
            let label = if is_tuple { String::new() } else { format!("{name}: ") };
            if random.one_in(6) {
                text +=
                    &format!("#[cfg(any())] {}Missing<u8, u8>, ", if is_tuple { "" } else { "missing: " });
            }
            text += &format!("{attributes} {visibility} {label}{written}, ");
            fields.push((if is_tuple { position.to_string() } else { name.to_owned() }, of));
        }
        if random.one_in(2) {
            text = text.trim_end_matches([',', ' ']).to_owned();
        }
        let text = if is_tuple { format!("({text})") } else { format!("{{ {text} }}") };
        (text, Variant { path, fields })
    }
}

/// The text of a new type, and what is to be known of it.
fn declare(random: &mut Random, number: usize, known: &[Declared]) -> (String, Declared) {
    let type_name = format!("{}Type{number}", random.pick(&["", "r#"]));
    let count = random.below(3);
    let names = random.some(&PARAMETERS, count);
    let number_type = |random: &mut Random, name: &str| Type::Number {
        name: name.to_owned(),
        number: random.pick(&NUMBERS),
    };
    let parameters: Vec<_> = names.iter().map(|name| number_type(random, name)).collect();
    let length = random.one_in(2).then(|| ("N".to_owned(), 1 + random.below(3)));
    let (has_lifetime, has_defaults) = (random.one_in(3), random.one_in(2));
    let mut used = parameters.clone();
    // Declared, and as arguments.
    let (mut generics, mut arguments, mut predicates) = (vec![], vec![], vec![]);
    if has_lifetime {
        generics.extend(["'a".to_owned(), "'b: 'a".to_owned()]);
        arguments.extend(["'static".to_owned(), "'static".to_owned()]);
        used.push(Type::Skipped("(&'a str, &'b [u8])".to_owned(), "(\"skipped\", &[7])"));
    }
    for parameter in &parameters {
        let Type::Number { name, number } = parameter else { continue };
        let default = if has_defaults { format!(" = {number}") } else { String::new() };
        let attribute = random.pick(&["", "", "#[allow(unused)] "]);
        generics.push(format!("{attribute}{name}{}{default}", random.pick(&BOUNDS).replace('#', name)));
        arguments.push((*number).to_owned());
        if random.one_in(2) {
            predicates.push(random.pick(&PREDICATES).replace('#', name));
        }
    }
    if let Some((name, length)) = &length {
        generics.push(format!("const {name}: usize{}", if has_defaults { " = { 3 - 1 }" } else { "" }));
        arguments.push(format!("{{ {length} }}"));
    }

    let (is_enum, by_macro) = (random.one_in(2), random.one_in(3));
    let mut writer = Writer { random, known, parameters, length, by_macro, field: None };
    let (mut bodies, mut variants) = (vec![], vec![]);
    if is_enum {
        let count = writer.random.below(3) + 2;
        let with_used = writer.random.below(count);
        let default = (with_used + 1) % count;
        let has_numbers = writer.random.one_in(2);
        for position in 0..count {
            let name = format!("{}Variant{position}", writer.random.pick(&["", "r#"]));
            let path = format!("{type_name}::{name}");
            let (mut text, variant) = match position {
                _ if position == default => (String::new(), Variant { path, fields: vec![] }),
                _ if position == with_used => writer.fields(path, used.clone(), true),
                _ => writer.fields(path, vec![], true),
            };
            if has_numbers {
                let number = writer.random.pick(&DISCRIMINANTS).replace('#', &position.to_string());
                text += &format!(" = {number}");
            }
            let attribute = if position == default { "#[default] " } else { writer.random.pick(&ATTRIBUTES) };
            bodies.push(format!("{attribute} {name} {text}"));
            variants.push(variant);
        }
    } else {
        let (text, variant) = if used.is_empty() && writer.random.one_in(4) {
            (String::new(), Variant { path: type_name.clone(), fields: vec![] })
        } else {
            writer.fields(type_name.clone(), used, false)
        };
        bodies.push(text);
        variants.push(variant);
    }
    let Writer { random, field, .. } = writer;
    for variant in &variants {
        variant.fields.iter().for_each(|(_, of)| defaults(of, known, &mut predicates));
    }

    let angles = |inside: &[String]| {
        if inside.is_empty() { String::new() } else { format!("<{}>", inside.join(", ")) }
    };
    let declared = angles(&generics);
    let clause =
        if predicates.is_empty() { String::new() } else { format!("where {}", predicates.join(", ")) };
    let visibility = if by_macro { "$visibility" } else { random.pick(&["pub", "pub(crate)", ""]) };
    let attributes =
        format!("{}\n#[derive(Debug, Default, PartialEq, Persistent)]", random.pick(&ATTRIBUTES));
    let mut text = match bodies.first() {
        _ if is_enum => format!(
            "{attributes} #[repr(i64)] {visibility} enum {type_name}{declared} {clause} {{ {} }}",
            bodies.join(", ")
        ),
        Some(body) if body.starts_with('{') => {
            format!("{attributes} {visibility} struct {type_name}{declared} {clause} {body}")
        }
        body => format!(
            "{attributes} {visibility} struct {type_name}{declared} {} {clause};",
            body.map_or("", |body| body)
        ),
    };
    if by_macro {
        text = format!(
            "macro_rules! declare_{number} {{ ($visibility:vis, $field:ty, $skip:meta, $number:expr) => {{ {} }} }}\n\
             declare_{number}!(pub(crate), {}, persistent(skip), 2 * 50);",
            text.replace("(100)", "$number"),
            field.unwrap_or_else(|| "u8".to_owned())
        );
    }
    (text, Declared { name: format!("{type_name}{}", angles(&arguments)), variants, is_enum })
}

/// The defaults for which a derived `Persistent` does not ask: of what is in an option or vector, and of arrays of any
/// length.
fn defaults(of: &Type, known: &[Declared], predicates: &mut Vec<String>) {
    match of {
        Type::Boxed(inner) => defaults(inner, known, predicates),
        Type::Tuple(types) => types.iter().for_each(|of| defaults(of, known, predicates)),
        Type::Option(inner) | Type::Vec(inner) => {
            defaults(inner, known, predicates);
            predicates.push(format!("{}: Default", written(inner, known)));
        }
        Type::Array(inner, ..) => {
            defaults(inner, known, predicates);
            predicates.push(format!("{}: Default", written(of, known)));
        }
        Type::Number { .. } | Type::Text | Type::Truth | Type::Declared(_) | Type::Skipped(..) => {}
    }
}

#[test]
#[ignore = "it compiles random types, by cargo"]
fn values_of_random_types_are_written_and_read() {
    let (count, seed) = match env::var("RANDOM_DECLARATIONS") {
        Ok(count) => (count.parse().expect("it is a number"), u64::from(std::process::id())),
        Err(_) => (COUNT, 2011),
    };
    println!("seed {seed}");
    let mut random = Random(seed);
    let (mut known, mut text, mut calls) = (vec![], HEAD.to_owned(), String::new());
    for number in 0..count {
        let (declaration, declared) = declare(&mut random, number, &known);
        text += &format!("\n{declaration}\n");
        known.push(declared);
        for _ in 0..4 {
            let [value, other] = [(); 2].map(|()| random.value(&Type::Declared(number), &known));
            let (Value { expression, restored, bytes }, before) = (value, other.restored);
            let name = &known[number].name;
            calls += &format!("    check::<{name}>({expression}, &{bytes:?}, {before}, &{restored});\n");
        }
    }
    let run = cargo("run", "types", &format!("{text}\nfn main() {{\n{calls}}}\n"));
    let errors = String::from_utf8_lossy(&run.stderr);
    assert!(run.status.success(), "{}", errors.chars().take(8000).collect::<String>());
}

/// Runs a command of cargo on a program with the exporter.
fn cargo(command: &str, name: &str, program: &str) -> Output {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    fs::create_dir_all(folder.join("src")).expect("the folder for tests is writable");
    let write = |name: &str, text: &str| {
        fs::write(folder.join(name), text).expect("the folder for tests is writable");
    };
    let exporter = env!("CARGO_MANIFEST_DIR");
    let manifest = format!("[package]\nname = {name:?}\nedition = \"2024\"\n[workspace]\n[dependencies]\n");
    write("Cargo.toml", &format!("{manifest}fmu-export = {{ path = {exporter:?} }}\n"));
    write("src/main.rs", program);
    fs::copy(concat!(env!("CARGO_MANIFEST_DIR"), "/../../Cargo.lock"), folder.join("Cargo.lock"))
        .expect("the folder for tests is writable");
    // Exports of models have compiled the exporter there, without debug information.
    Command::new(env!("CARGO"))
        .args([command, "--quiet", "--offline", "--target-dir"])
        .arg(concat!(env!("CARGO_TARGET_TMPDIR"), "/.."))
        .env("CARGO_PROFILE_DEV_DEBUG", "0")
        .current_dir(&folder)
        .output()
        .expect("cargo runs")
}

/// Declarations, with what is wrong in them and how the message begins.
const WRONG: [(&str, &str, &str); 8] = [
    (
        "struct A { #[persistent(skip)] a: u8, #[persistent(skips)] b: u8 }",
        "skips)",
        "expected `skip` or `serde`, found `skips`",
    ),
    ("struct B(#[persistent(skip, a::b)] u8);", "a::b", "expected `skip` or `serde`, found `"),
    (
        "enum C { A, B { #[persistent] a: u8 } }",
        "persistent]",
        "expected attribute arguments in parentheses: #[persistent(...)]",
    ),
    (
        "enum D {}",
        "D",
        "only a struct, or an enum with variants, can derive Persistent; implement it by hand",
    ),
    (
        "union E { a: u8 }",
        "E",
        "only a struct, or an enum with variants, can derive Persistent; implement it by hand",
    ),
    ("struct F { a: u8, b: Option<Foreign> }", "b:", "`Foreign` cannot be saved with a model's state"),
    (
        "struct G<T>(T, #[doc(hidden)] pub Foreign);",
        "Foreign",
        "`Foreign` cannot be saved with a model's state",
    ),
    ("enum H { #[default] A, B(u8, Foreign) }", "Foreign", "`Foreign` cannot be saved with a model's state"),
];

#[test]
#[ignore = "it compiles wrong types, by cargo"]
fn errors_are_reported_where_they_are() {
    let declarations =
        WRONG.map(|(declaration, ..)| format!("#[derive(fmu_export::Persistent)] {declaration}\n"));
    let program = format!("{}#[derive(Default)] struct Foreign;\nfn main() {{}}\n", declarations.concat());
    let errors = String::from_utf8_lossy(&cargo("check", "wrong", &program).stderr).into_owned();
    let errors: Vec<_> = errors.split("\n\n").collect();
    for (line, (_, wrong, message)) in WRONG.iter().enumerate() {
        let column = declarations[line].find(wrong).expect("the declaration has it") + 1;
        let place = format!("--> src/main.rs:{}:{column}\n", line + 1);
        assert!(
            errors.iter().any(|error| error.contains(&format!(": {message}")) && error.contains(&place)),
            "{message} {place} {}",
            errors.join("\n\n")
        );
    }
}
