//! `reproduce`: the paper's figures, to report.html and report.json.

use std::path::Path;

use crate::reproduce::{FIGURES, Laboratory, count, html, json};
use anyhow::{Result, bail};
use fmu_io::terminal::print;

/// Reproduces the numbered figures, or all if none is given. Returns whether no claim fails.
pub fn run(fmus: &Path, out: &Path, numbers: &[u32]) -> Result<bool> {
    let figures: Vec<_> =
        FIGURES.iter().filter(|figure| numbers.is_empty() || numbers.contains(&figure.number)).collect();
    if let Some(unknown) =
        numbers.iter().find(|number| FIGURES.iter().all(|figure| figure.number != **number))
    {
        let known: Vec<_> = FIGURES.iter().map(|figure| figure.number.to_string()).collect();
        bail!("no experiment for Fig. {unknown}: choose from {}", known.join(", "));
    }
    super::make_folder(out)?;

    let mut laboratory = Laboratory::new(fmus);
    let mut reproduced = vec![];
    for figure in figures {
        let found = laboratory.reproduce(figure)?;
        print(&format!("Fig. {}: {}\n", figure.number, figure.title))?;
        for claim in &found.claims {
            let word = claim.verdict();
            let paper = claim.in_paper().map_or_else(String::new, |value| format!("; paper: {value}"));
            print(&format!(
                "  {word:7}  {:33} {} (accepted: {}{paper})\n",
                claim.name,
                claim.found(),
                claim.asked(),
            ))?;
        }
        reproduced.push(found);
    }
    let html = html(&reproduced, &laboratory.fmus());
    super::write(out, [(super::HTML, html), (super::JSON, json(&reproduced)?)])?;
    let (counted, none_fails) = count(&reproduced);
    print(&format!("{counted}\n"))?;
    Ok(none_fails)
}
