//! `check`: whether an FMU can take the plant's or the controller's place, as a table.

use std::path::Path;

use anyhow::Result;
use fmi2_export::package::Kind;

use super::coupling::{Fit, Map, Match, Role, Verdict};
use super::{fmu, print};

/// Prints how an FMU fits, and writes a map to be edited where one is asked for. Whether it fits.
pub fn run(path: &Path, role: Role, map: Option<&Path>, write_map: Option<&Path>) -> Result<bool> {
    let description = fmu::describe(path)?;
    let map = map.map(Map::read).transpose()?;
    let fit = Fit::new(role, &description, map.as_ref())?;
    print(&report(&fit))?;
    if let Some(file) = write_map {
        fit.to_map(map.as_ref()).write(file)?;
        print(&format!("The map {} is written; edit it and give it with --map.\n", file.display()))?;
    }
    Ok(fit.fits())
}

/// What was found, line by line.
pub fn report(fit: &Fit<'_>) -> String {
    let mut lines = vec![format!(
        "{} in the {}'s place, by the names and units of {}:",
        fit.fmu.attribute("modelName"),
        fit.role.name(),
        fit.role.model_identifier()
    )];
    lines.extend(fit.problems.iter().map(|problem| format!("  WRONG  {problem}")));
    let width = fit.matches.iter().map(|(port, _)| port.name().len()).max().unwrap_or(0);
    for (port, found) in &fit.matches {
        let word = match found.verdict(port) {
            Verdict::Fits => "ok   ",
            Verdict::LeftOut => "-    ",
            Verdict::Wrong => "WRONG",
        };
        let kind = match port.kind {
            Kind::Input => "input ",
            Kind::Output => "output",
        };
        lines.push(
            format!("  {word}  {kind}  {:width$}  {}", port.name(), details(found)).trim_end().to_owned(),
        );
    }
    let others: Vec<_> = fit.other_inputs().map(|input| input.name.as_str()).collect();
    if !others.is_empty() {
        lines.push(format!("Inputs of its own, which keep their start values: {}", others.join(", ")));
    }
    lines.push(if fit.fits() {
        format!("It can take the {}'s place.", fit.role.name())
    } else {
        format!("It cannot take the {}'s place.", fit.role.name())
    });
    lines.join("\n") + "\n"
}

fn details(found: &Match<'_>) -> String {
    let like = |suggestions: &[&str]| match suggestions {
        [] => String::new(),
        names => format!("; like it: {}", names.join(", ")),
    };
    match found {
        Match::Missing { suggestions } => format!("missing{}", like(suggestions)),
        Match::Unconnected => "left unconnected by the map".to_owned(),
        Match::Unknown { name, suggestions } => {
            format!("the map's {name} is missing{}", like(suggestions))
        }
        Match::Found { variable, problems, notes, .. } => {
            let said: Vec<_> = problems.iter().chain(notes).map(String::as_str).collect();
            match said.join("; ") {
                said if said.is_empty() => variable.name.clone(),
                said => format!("{}: {said}", variable.name),
            }
        }
    }
}
