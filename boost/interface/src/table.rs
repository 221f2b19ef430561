//! How an FMU fits, as text.

use std::fmt::{self, Display, Formatter};

use fmu_io::terminal::in_line;

use crate::compatibility::{Compatibility, Match, Verdict};

/// A line for each variable.
impl Display for Compatibility<'_> {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        writeln!(
            formatter,
            "{} as the {}, by the names and units of {}:",
            in_line(self.fmu.attribute("modelName")),
            self.role.name(),
            self.interface.model_identifier(self.role)
        )?;
        for problem in &self.problems {
            writeln!(formatter, "  WRONG  {}", in_line(problem))?;
        }
        let width = self.matches.iter().map(|(port, _)| port.name().len()).max().unwrap_or(0);
        for (port, found) in &self.matches {
            let word = match found.verdict(port) {
                Verdict::Fits => "ok",
                Verdict::LeftOut => "-",
                Verdict::Open => "open",
                Verdict::Wrong => "WRONG",
            };
            let kind = port.kind.name();
            let line = format!("  {word:5}  {kind:6}  {:width$}  {}", port.name(), details(found));
            writeln!(formatter, "{}", in_line(line.trim_end()))?;
        }
        let others: Vec<_> = self.other_inputs().map(|input| input.name.as_str()).collect();
        if !others.is_empty() {
            let others = in_line(&others.join(", "));
            writeln!(formatter, "Unconnected inputs, which keep their start values: {others}")?;
        }
        let open = self.matches.iter().filter(|(port, found)| found.verdict(port) == Verdict::Open);
        let open: Vec<_> = open.map(|(port, _)| port.name()).collect();
        let role = self.role.name();
        match (self.fits(), open.as_slice()) {
            (false, _) => writeln!(formatter, "It cannot replace the {role}."),
            (true, []) => writeln!(formatter, "It can replace the {role}."),
            (true, open) => writeln!(
                formatter,
                "It replaces the {role} only in part; not connected: {}.",
                open.join(", ")
            ),
        }
    }
}

fn details(found: &Match<'_>) -> String {
    match (found, found.remarks()) {
        (Match::Found { variable, .. }, remarks) if remarks.is_empty() => variable.name.clone(),
        (Match::Found { variable, .. }, remarks) => format!("{}: {remarks}", variable.name),
        (_, remarks) => remarks,
    }
}
