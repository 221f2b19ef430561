//! `reproduce`: the paper's figures, to report.html and report.json.

use std::path::Path;

use crate::reproduce::{FIGURES, Laboratory, html, json};
use anyhow::{Result, bail};
use fmu_io::terminal::print;

/// Reproduces the numbered figures, or all if none is given. Returns whether all claims hold.
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
    let (mut all, mut holding) = (0, 0);
    for figure in figures {
        let found = laboratory.reproduce(figure)?;
        print(&format!("Fig. {}: {}\n", figure.number, figure.title))?;
        for claim in &found.evidence.claims {
            let word = if claim.holds() { "holds" } else { "FAILS" };
            let paper = claim.in_paper().map_or_else(String::new, |value| format!("; paper: {value}"));
            print(&format!(
                "  {word}  {:28} {} (accepted: {}{paper})\n",
                claim.name,
                claim.found(),
                claim.asked(),
            ))?;
            all += 1;
            holding += usize::from(claim.holds());
        }
        reproduced.push(found);
    }
    let html = html(&reproduced, &laboratory.fmus());
    super::write(out, [("report.html", html), ("report.json", json(&reproduced)?)])?;
    print(&format!("{holding} of {all} claims hold\n"))?;
    Ok(holding == all)
}
