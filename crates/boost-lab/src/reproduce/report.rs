//! The reports: report.html for readers, which needs no other file, and report.json for programs.

use anyhow::Result;
use serde::Serialize;

use super::{Claim, Drawing, Reproduced};
use crate::plot::escaped;

/// The number of significant digits that are shown.
const DIGITS: usize = 3;

const STYLE: &str = "
body { font: 16px/1.5 Georgia, 'Times New Roman', serif; color: #1a1a1a; max-width: 760px; margin: 2.5em auto; padding: 0 1em; }
h1 { font-size: 1.6em; line-height: 1.25; } h2 { font-size: 1.2em; margin: 2.4em 0 0.6em; border-top: 1px solid #c8c8c8; padding-top: 1em; }
figure { margin: 1em 0; } figure svg { width: 100%; height: auto; } figcaption { font-size: 0.9em; color: #444; }
table { border-collapse: collapse; width: 100%; font-size: 0.88em; } th { text-align: left; font-weight: 600; white-space: nowrap; }
th, td { padding: 0.35em 0.6em 0.35em 0; vertical-align: top; border-bottom: 1px solid #e0e0e0; }
td.number { white-space: nowrap; } .how { color: #555; font-size: 0.93em; }
svg .third { color: #666; } svg .added { opacity: 0.45; }
.holds { color: #00704f; font-weight: 600; } .fails { color: #b32d00; font-weight: 600; }
pre { font-size: 0.8em; background: #f6f6f6; padding: 0.8em; overflow-x: auto; } summary { cursor: pointer; color: #444; font-size: 0.9em; }
";

#[derive(Serialize)]
struct JsonReport<'a> {
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

/// The text of report.json.
///
/// # Errors
/// When a number is none.
pub fn json(figures: &[Reproduced]) -> Result<String> {
    let claims = |claims: &'_ [Claim]| claims.iter().all(Claim::holds);
    let report = JsonReport {
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

/// The text of report.html.
#[must_use]
pub fn html(figures: &[Reproduced], fmus: &[String]) -> String {
    let claims = || figures.iter().flat_map(|figure| &figure.evidence.claims);
    let (all, holding) = (claims().count(), claims().filter(|claim| claim.holds()).count());
    let mut body = format!(
        "<h1>Boost pressure control with system voltage disturbance rejection: the paper's figures from the FMUs</h1>\n\
         <p>The experiments of Criscuolo, Leufvén, Thomasson and Eriksson, \u{201c}Model-based boost pressure control \
         with system voltage disturbance rejection\u{201d} (IFAC 2011), run with {}. Under each drawing stand the \
         paper's statements, the number that the FMUs give, and whether it bears the statement out.</p>\n\
         <p>The engine's and turbochargers' parameters are not published. Where they were chosen so that a figure is \
         met, the number is called a <em>calibration</em>; a <em>prediction</em> follows from parameters that were \
         chosen by something else; a <em>construction</em> follows from how the controller is built.</p>\n\
         <p><span class=\"{}\">{holding} of {all} statements hold.</span></p>\n",
        escaped(&fmus.join(" and ")),
        if holding == all { "holds" } else { "fails" },
    );
    for reproduced in figures {
        body += &section(reproduced);
    }
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" \
         content=\"width=device-width\">\n<title>The paper's figures from the FMUs</title>\n<style>{STYLE}</style>\n\
         </head>\n<body>\n{body}</body>\n</html>\n"
    )
}

fn section(Reproduced { figure, evidence, scenarios }: &Reproduced) -> String {
    let mut text =
        format!("<h2 id=\"figure-{0}\">Fig. {0}: {1}</h2>\n", figure.number, escaped(figure.title));
    for (index, (caption, drawing)) in evidence.drawings.iter().enumerate() {
        let svg = match drawing {
            Drawing::Plot(plot) => plot.svg_named(&format!("figure-{}-{}", figure.number, index + 1)),
            Drawing::Picture(svg) => svg.clone(),
        };
        text += &format!("<figure>\n{svg}<figcaption>{}</figcaption>\n</figure>\n", escaped(caption));
    }
    text += "<table>\n<tr><th>The paper</th><th>The FMUs</th><th>Asked for</th><th></th></tr>\n";
    for claim in &evidence.claims {
        let (class, word) = if claim.holds() { ("holds", "holds") } else { ("fails", "fails") };
        text += &format!(
            "<tr><td>{}<div class=\"how\">{}: {}</div></td><td class=\"number\">{}</td><td class=\"number\">{}</td>\
             <td class=\"{class}\">{word}</td></tr>\n",
            escaped(claim.paper),
            capitalized(claim.basis.name()),
            escaped(claim.how),
            quantity(claim.value, claim.unit),
            asked(claim),
        );
    }
    text += "</table>\n";
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

/// The range of a claim in words.
fn asked(claim: &Claim) -> String {
    let unit = |value| quantity(value, claim.unit);
    match (claim.least, claim.most) {
        (Some(least), Some(most)) => format!("{} to {}", number(least), unit(most)),
        (Some(least), None) => format!("at least {}", unit(least)),
        (None, Some(most)) => format!("at most {}", unit(most)),
        (None, None) => String::new(),
    }
}

fn quantity(value: f64, unit: &str) -> String {
    let space = if unit.is_empty() { "" } else { "\u{202f}" };
    format!("{}{space}{}", number(value), escaped(unit))
}

/// A number with a few significant digits, but all before the point.
pub(super) fn number(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let magnitude = value.abs().log10().floor();
    let text = if magnitude < -3.0 {
        let mantissa = value / 10_f64.powf(magnitude);
        return format!("{mantissa:.1}\u{b7}10<sup>{magnitude:.0}</sup>").replace('-', "\u{2212}");
    } else if magnitude >= 2.0 {
        format!("{value:.0}")
    } else {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // from 0 to 5
        let decimals = DIGITS - 1 - (magnitude.max(0.0) as usize) + (-magnitude).max(0.0) as usize;
        let text = format!("{value:.decimals$}");
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    };
    text.replace('-', "\u{2212}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_a_few_digits() {
        let cases = [
            (2466.41, "2466"),
            (9.174_3, "9.17"),
            (71.875, "71.9"),
            (0.55, "0.55"),
            (0.012_34, "0.0123"),
            (-1.5, "\u{2212}1.5"),
            (0.0, "0"),
            (1e-9, "1.0\u{b7}10<sup>\u{2212}9</sup>"),
        ];
        for (value, text) in cases {
            assert_eq!(number(value), text);
        }
    }
}
