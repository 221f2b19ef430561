//! The reports: a self-contained report.html for readers, and report.json for programs.

use anyhow::Result;
use serde::Serialize;

use super::{Claim, Drawing, Reproduced, count};
use fmu_plot::{Cell, Report, Table, escaped};

const TITLE: &str =
    "Boost pressure control with system voltage disturbance rejection: the paper's figures from the FMUs";
const STYLE: &str = "\nsvg :is(.third, .added) { color: var(--faint); }\n";
/// The style of the [claims' table](claims_table).
pub const CLAIMS_STYLE: &str = "
.how { color: var(--faint); font-size: .93em; }
.claims { max-width: 58rem; }
@media (max-width: 48rem) {
  .claims thead { display: none; } .claims tr { display: flex; flex-wrap: wrap; gap: 0 1rem; padding: .5rem 0; border-bottom: 1px solid var(--rule); }
  .claims td { padding: 0; border: 0; } .claims td:first-child { flex: 1 0 100%; } .claims td:nth-child(4)::before { content: \"accepted: \"; color: var(--faint); }
}
";

#[derive(Serialize)]
struct ReproductionReport<'a> {
    all_claims_hold: bool,
    no_claim_fails: bool,
    figures: &'a [Reproduced],
}

pub fn json(figures: &[Reproduced]) -> Result<String> {
    let report = ReproductionReport {
        all_claims_hold: figures.iter().flat_map(|figure| &figure.claims).all(|claim| claim.holds),
        no_claim_fails: count(figures).1,
        figures,
    };
    Ok(serde_json::to_string_pretty(&report)? + "\n")
}

pub fn html(figures: &[Reproduced], fmus: &[String]) -> String {
    let (counted, none_fails) = count(figures);
    let mut report = Report::new(TITLE);
    report.paragraph(&format!(
        "The experiments of Criscuolo, Leufvén, Thomasson and Eriksson, \u{201c}Model-based boost pressure control with \
         system voltage disturbance rejection\u{201d} (IFAC 2011), run with {}. Below each figure: the paper's claims, \
         the FMUs' results, and whether they agree.",
        fmus.join(" and ")
    ));
    report.html(
        "<p>The parameters of the engine and turbochargers are not published. A <em>calibration</em> is a result that \
         parameters were chosen to match, a <em>prediction</em> follows from parameters chosen for other reasons, and \
         a <em>construction</em> follows from the controller's structure.</p>\n",
    );
    report.verdict(&format!("{counted}."), none_fails);
    for figure in figures {
        section(&mut report, figure);
    }
    report.page(&format!("{STYLE}{CLAIMS_STYLE}"))
}

fn section(report: &mut Report, Reproduced { figure, evidence, claims, scenarios, .. }: &Reproduced) {
    report.section_of(
        &format!("figure-{}", figure.number),
        &format!("Fig. {}: {}", figure.number, figure.title),
    );
    for (caption, drawing) in &evidence.drawings {
        match drawing {
            Drawing::Plot(plot) => report.figure(plot, caption),
            Drawing::Picture(svg) => report.picture(svg, caption),
        }
    }
    report.table(&claims_table(claims));
    for note in &evidence.notes {
        report.paragraph(note);
    }
    for (name, scenario) in scenarios {
        report.details(&format!("The scenario {name}"), scenario);
    }
}

/// The paper's claims beside the FMUs' results.
pub fn claims_table(claims: &[Claim]) -> Table {
    let mut table = Table::new(["Claim", "Paper", "FMUs", "Accepted", ""]).class("claims");
    for claim in claims {
        table.row([
            Cell::html(&format!(
                "{}<div class=\"how\">{:?}: {}{}</div>",
                escaped(&claim.paper),
                claim.basis,
                escaped(&claim.how),
                claim
                    .known_difference
                    .as_deref()
                    .map_or_else(String::new, |reason| format!(" Known difference: {}.", escaped(reason)))
            )),
            Cell::number(&claim.in_paper().unwrap_or_default()),
            Cell::number(&claim.found()),
            Cell::number(&claim.asked()),
            Cell::html(&format!("<span class=\"{0}\">{0}</span>", claim.verdict())),
        ]);
    }
    table
}
