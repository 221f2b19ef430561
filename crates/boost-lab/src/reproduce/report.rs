//! The reports: a self-contained report.html for readers, and report.json for programs.

use anyhow::Result;
use serde::Serialize;

use super::{Claim, Drawing, Reproduced};
use fmu_plot::escaped;
use fmu_plot::page;

const STYLE: &str = "
.how { color: var(--faint); font-size: .93em; } svg :is(.third, .added) { color: var(--faint); }
.claims { max-width: 58rem; } .holds, .fails { font-weight: 600; } .fails { color: var(--paper); background: var(--ink); padding: 0 .3em; }
@media (max-width: 48rem) {
  .claims thead { display: none; } .claims tr { display: flex; flex-wrap: wrap; gap: 0 1rem; padding: .5rem 0; border-bottom: 1px solid var(--rule); }
  .claims td { padding: 0; border: 0; } .claims td:first-child { flex: 1 0 100%; } .claims .asked::before { content: \"accepted: \"; color: var(--faint); }
}
";

#[derive(Serialize)]
struct ReproductionReport<'a> {
    all_claims_hold: bool,
    figures: Vec<JsonFigure<'a>>,
}

#[derive(Serialize)]
struct JsonFigure<'a> {
    figure: u32,
    title: &'a str,
    claims: Vec<JsonClaim<'a>>,
    notes: &'a [String],
}

#[derive(Serialize)]
struct JsonClaim<'a> {
    holds: bool,
    #[serde(flatten)]
    claim: &'a Claim,
}

pub fn json(figures: &[Reproduced]) -> Result<String> {
    let claims = |claims: &'_ [Claim]| claims.iter().all(Claim::holds);
    let report = ReproductionReport {
        all_claims_hold: figures.iter().all(|figure| claims(&figure.evidence.claims)),
        figures: figures
            .iter()
            .map(|Reproduced { figure, evidence, .. }| JsonFigure {
                figure: figure.number,
                title: figure.title,
                claims: evidence
                    .claims
                    .iter()
                    .map(|claim| JsonClaim { holds: claim.holds(), claim })
                    .collect(),
                notes: &evidence.notes,
            })
            .collect(),
    };
    Ok(serde_json::to_string_pretty(&report)? + "\n")
}

pub fn html(figures: &[Reproduced], fmus: &[String]) -> String {
    let claims = || figures.iter().flat_map(|figure| &figure.evidence.claims);
    let (all, holding) = (claims().count(), claims().filter(|claim| claim.holds()).count());
    let mut body = format!(
        "<h1>Boost pressure control with system voltage disturbance rejection: the paper's figures from the FMUs</h1>\n\
         <p>The experiments of Criscuolo, Leufvén, Thomasson and Eriksson, \u{201c}Model-based boost pressure control \
         with system voltage disturbance rejection\u{201d} (IFAC 2011), run with {}. Below each figure: the paper's \
         claims, the FMUs' results, and whether they agree.</p>\n\
         <p>The parameters of the engine and turbochargers are not published. A <em>calibration</em> is a result that \
         parameters were chosen to match, a <em>prediction</em> follows from parameters chosen for other reasons, and a \
         <em>construction</em> follows from the controller's structure.</p>\n\
         <p><span class=\"{}\">{holding} of {all} claims hold.</span></p>\n",
        escaped(&fmus.join(" and ")),
        if holding == all { "holds" } else { "fails" },
    );
    for reproduced in figures {
        body += &section(reproduced);
    }
    page("The paper's figures from the FMUs", STYLE, &body)
}

fn section(Reproduced { figure, evidence, scenarios, .. }: &Reproduced) -> String {
    let mut text =
        format!("<h2 id=\"figure-{0}\">Fig. {0}: {1}</h2>\n", figure.number, escaped(figure.title));
    for (caption, drawing) in &evidence.drawings {
        let html = match drawing {
            Drawing::Plot(plot) => plot.html(),
            Drawing::Picture(svg) => svg.clone(),
        };
        text += &format!("<figure>\n{html}<figcaption>{}</figcaption>\n</figure>\n", escaped(caption));
    }
    text += "<table class=\"claims\">\n<thead><tr><th>Claim</th><th>Paper</th><th>FMUs</th><th>Accepted</th><th></th></tr></thead>\n<tbody>\n";
    for claim in &evidence.claims {
        let (class, word) = if claim.holds() { ("holds", "holds") } else { ("fails", "fails") };
        text += &format!(
            "<tr><td>{}<div class=\"how\">{}: {}</div></td><td class=\"number\">{}</td><td class=\"number\">{}</td>\
             <td class=\"number asked\">{}</td><td><span class=\"{class}\">{word}</span></td></tr>\n",
            escaped(claim.paper),
            capitalized(claim.basis.name()),
            escaped(claim.how),
            escaped(&claim.in_paper().unwrap_or_default()),
            escaped(&claim.found()),
            escaped(&claim.asked()),
        );
    }
    text += "</tbody>\n</table>\n";
    for note in &evidence.notes {
        text += &format!("<p>{}</p>\n", escaped(note));
    }
    for (name, scenario) in scenarios {
        text += &format!(
            "<details><summary>The scenario {}</summary><pre>{}</pre></details>\n",
            escaped(name),
            escaped(scenario)
        );
    }
    text
}

fn capitalized(word: &str) -> String {
    let mut letters = word.chars();
    letters
        .next()
        .map_or_else(String::new, |first| first.to_uppercase().collect::<String>() + letters.as_str())
}
