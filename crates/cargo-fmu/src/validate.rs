//! `validate`: violations of the published rules in FMUs from any tool.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use clap::Args;
use clap::builder::PossibleValuesParser;
use fmu_io::terminal::{complain, in_line, print};
use fmu_validation::importers::{self, Importer};
use fmu_validation::rules::{self, Rule, Severity};
use fmu_validation::{Finding, Place, Report};
use serde::Serialize;

use super::info::Format;

/// Validate FMUs
///
/// Checks FMUs of FMI 2.0 or 3.0 from any tool against the standard and its schemas, and for known problems
/// of importers. The exit status is 0 without errors (warnings allowed), 1 with errors, and 2 if a file cannot be
/// read. Libraries are read, but never loaded.
#[derive(Args, Debug)]
pub struct Validate {
    /// FMUs from any tool
    #[arg(value_name = "FILE.fmu", required_unless_present = "rules")]
    files: Vec<PathBuf>,
    /// Output format
    #[arg(long, value_enum, default_value_t)]
    format: Format,
    /// Note what this importer rejects although the standard allows it; repeatable
    #[arg(long = "importer", value_name = "NAME", ignore_case = true)]
    #[arg(value_parser = PossibleValuesParser::new(importers::ALL.iter().map(|known| known.name)))]
    importers: Vec<String>,
    /// Print the tables of rules and importers instead
    #[arg(long, conflicts_with = "files")]
    rules: bool,
}

/// The findings as JSON; `docs/validation.md` describes the keys.
#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct Json<'a> {
    file: String,
    fmi_version: Option<&'a str>,
    errors: usize,
    warnings: usize,
    notes: usize,
    omitted: usize,
    findings: Vec<JsonFinding<'a>>,
}

#[derive(Serialize)]
struct JsonFinding<'a> {
    rule: &'a str,
    severity: &'a str,
    file: Option<&'a str>,
    line: Option<usize>,
    variable: Option<&'a str>,
    message: &'a str,
    remedy: &'a str,
    source: &'a str,
}

impl Validate {
    /// Prints the findings on FMUs. Returns whether there are no errors.
    ///
    /// # Errors
    /// When a file cannot be read.
    pub fn run(&self) -> Result<bool> {
        if self.rules {
            print(&format!("{}\n{}", table_of_rules(), table_of_importers()))?;
            return Ok(true);
        }
        let is_named =
            |known: &&Importer| self.importers.iter().any(|name| known.name.eq_ignore_ascii_case(name));
        let importers: Vec<_> = importers::ALL.iter().filter(is_named).collect();
        let reports =
            self.files.iter().map(|file| Ok((file.as_path(), fmu_validation::validate(file, &importers)?)));
        let reports = reports.collect::<Result<Vec<_>>>()?;
        print(&match self.format {
            Format::Text => reports.iter().map(|(file, report)| text(file, report)).collect(),
            Format::Json => json(&reports)?,
        })?;
        Ok(reports.iter().all(|(_, report)| report.count(Severity::Error) == 0))
    }
}

/// Rejects an FMU that was just written if it has errors, and prints the warnings.
pub fn check(file: &Path) -> Result<()> {
    let report = fmu_validation::validate(file, &[])?;
    if report.count(Severity::Error) > 0 {
        bail!("the FMU breaks the standard's rules\n{}", text(file, &report));
    }
    if !report.findings.is_empty() {
        complain(text(file, &report).trim_end());
    }
    Ok(())
}

/// The most messages of a rule, and the most places of a message.
const MOST_SHOWN: usize = 3;

fn text(file: &Path, report: &Report) -> String {
    let mut text = String::new();
    for OfRule { rule, messages } in by_rule(report) {
        let others = messages.len().saturating_sub(MOST_SHOWN);
        for (position, (message, places)) in messages.iter().take(MOST_SHOWN).enumerate() {
            let (at, variables) = (lines(places), variables(places));
            text += &format!("{at}{}: {variables}{} [{}]\n", rule.severity.name(), in_line(message), rule.id);
            if position == 0 {
                text += &format!("    {}\n", rule.remedy);
            }
        }
        if others > 0 {
            let further: usize = messages[MOST_SHOWN..].iter().map(|(_, places)| places.len()).sum();
            text += &format!("    and {further} more of this rule; --format json has all\n");
        }
    }
    if report.omitted > 0 {
        text += &format!("and {} more\n", report.omitted);
    }
    let count = |severity| match report.count(severity) {
        1 => format!("1 {}", severity.name()),
        count => format!("{count} {}s", severity.name()),
    };
    let version =
        report.fmi_version.as_ref().map_or(String::new(), |version| format!("FMI {}, ", in_line(version)));
    let (errors, warnings) = (count(Severity::Error), count(Severity::Warning));
    let notes = match report.count(Severity::Note) {
        0 => String::new(),
        _ => format!(", {}", count(Severity::Note)),
    };
    text + &format!("{}: {version}{errors}, {warnings}{notes}\n", file.display())
}

/// The findings of a rule, by their messages.
struct OfRule<'a> {
    rule: &'static Rule,
    messages: Vec<(&'a str, Vec<&'a Place>)>,
}

/// The findings by their rules and messages, in the order in which each is found first.
fn by_rule(report: &Report) -> Vec<OfRule<'_>> {
    let mut rules: Vec<OfRule<'_>> = vec![];
    let mut known = BTreeMap::new();
    for Finding { rule, place, message } in &report.findings {
        let index = *known.entry((rule.id, None)).or_insert_with(|| {
            rules.push(OfRule { rule, messages: vec![] });
            rules.len() - 1
        });
        let messages = &mut rules[index].messages;
        let index = *known.entry((rule.id, Some(message.as_str()))).or_insert_with(|| {
            messages.push((message, vec![]));
            messages.len() - 1
        });
        messages[index].1.push(place);
    }
    rules
}

/// The file and the first lines of places, if they have any.
fn lines(places: &[&Place]) -> String {
    let Some(file) = &places[0].file else { return String::new() };
    let lines = places.iter().filter(|place| place.file.as_ref() == Some(file));
    let lines = first(lines.filter_map(|place| place.line).map(|line| line.to_string()));
    let lines = if lines.is_empty() { lines } else { format!(":{lines}") };
    format!("{}{lines}: ", in_line(file))
}

/// The first variables of places, if they have any.
fn variables(places: &[&Place]) -> String {
    let names = first(places.iter().filter_map(|place| place.variable.as_deref().map(in_line)));
    if names.is_empty() { names } else { format!("{names}: ") }
}

/// The first of several texts, and how many follow.
fn first(texts: impl Iterator<Item = String>) -> String {
    let texts: Vec<_> = texts.collect();
    let shown = texts.iter().take(MOST_SHOWN).map(String::as_str).collect::<Vec<_>>().join(", ");
    match texts.len().saturating_sub(MOST_SHOWN) {
        0 => shown,
        others => format!("{shown} and {others} more"),
    }
}

/// The report on one FMU, or a list of several.
fn json(reports: &[(&Path, Report)]) -> Result<String> {
    let all: Vec<_> = reports.iter().map(|(file, report)| findings(file, report)).collect();
    let text = if let [one] = &all[..] {
        serde_json::to_string_pretty(one)
    } else {
        serde_json::to_string_pretty(&all)
    };
    Ok(text? + "\n")
}

fn findings<'a>(file: &Path, report: &'a Report) -> Json<'a> {
    let findings = report.findings.iter().map(|finding| JsonFinding {
        rule: finding.rule.id,
        severity: finding.rule.severity.name(),
        file: finding.place.file.as_deref(),
        line: finding.place.line,
        variable: finding.place.variable.as_deref(),
        message: &finding.message,
        remedy: finding.rule.remedy,
        source: finding.rule.source,
    });
    Json {
        file: file.display().to_string(),
        fmi_version: report.fmi_version.as_deref(),
        errors: report.count(Severity::Error),
        warnings: report.count(Severity::Warning),
        notes: report.count(Severity::Note),
        omitted: report.omitted,
        findings: findings.collect(),
    }
}

/// The rules as a Markdown table, included in `docs/validation.md`.
fn table_of_rules() -> String {
    let rows = rules::ALL.iter().map(|rule| {
        format!("| `{}` | {} | {} | {} |\n", rule.id, rule.severity.name(), rule.text, rule.source)
    });
    format!("| rule | severity | requirement | source |\n|---|---|---|---|\n{}", rows.collect::<String>())
}

/// The importers that reject FMUs as a Markdown table, also included in `docs/validation.md`.
fn table_of_importers() -> String {
    let rows = importers::ALL.iter().flat_map(|importer| {
        let Importer { name, versions, evidence, refuses } = importer;
        refuses.iter().map(move |(rule, otherwise)| {
            format!("| {name} | {versions} | `{}` | {otherwise} | {evidence} |\n", rule.id)
        })
    });
    format!(
        "| importer | version | rule | effect | evidence |\n|---|---|---|---|---|\n{}",
        rows.collect::<String>()
    )
}
