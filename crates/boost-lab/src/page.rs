//! The reports: HTML pages in the look of the FMUs' own, which need no other file, and their numbers.

use fmu_export_build::document::{self, Document};

use crate::plot;

/// Significant digits.
const DIGITS: usize = 3;

/// What the reports have in addition to the FMUs' pages: figures by plotly.
const STYLE: &str = "
.row { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 20rem), 1fr)); gap: 0 1rem; }
.panel { min-width: 0; } .plot { width: 100%; } .panel .title { margin: .8rem 0 0 64px; font-weight: 600; font-size: .9rem; }
.modebar:focus-within { opacity: 1 !important; }
.panel .legend { display: flex; flex-wrap: wrap; gap: 0 1.2rem; margin: 0 0 -.6rem 64px; font-size: .85rem; } .legend label { display: flex; align-items: center; gap: .4rem; } .legend span { width: 1.6rem; }
td.number { white-space: nowrap; } .caption { color: var(--faint); font-size: .9rem; }
";

/// A page with a title, additional style sheet rules and a body of HTML, which begins with an `<h1>`; the page's contents
/// are its `<h2>`.
pub fn page(title: &str, style: &str, body: &str) -> String {
    let (heading, sections) = body.split_once("</h1>").unwrap_or(("", body));
    let mut contents = String::new();
    let mut parts = sections.split("<h2");
    let mut main =
        String::from("<noscript><p>The figures are drawn by the script in this page.</p></noscript>\n")
            + parts.next().unwrap_or_default();
    for (part, number) in parts.zip(1..) {
        let (attributes, rest) = part.split_once('>').unwrap_or_default();
        let (text, _) = rest.split_once("</h2>").unwrap_or_default();
        let id = attributes.split('"').nth(1).map_or_else(|| format!("section-{number}"), str::to_owned);
        contents += &format!("<li><a href=\"#{id}\">{text}</a></li>\n");
        main += &format!("<h2 id=\"{id}\">{rest}");
    }
    let style = STYLE.to_owned() + style;
    let header = format!("{heading}</h1>");
    let scripts = plot::script();
    Document { title, style: &style, header: &header, contents: &contents, main: &main, scripts: &scripts }
        .html()
}

/// A number with its unit.
pub fn quantity(value: f64, unit: &str) -> String {
    let space = if unit.is_empty() { "" } else { "\u{202f}" };
    format!("{}{space}{}", number(value), document::unit(unit))
}

/// A number with a few significant digits; up to a million with all digits before the point.
pub fn number(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let magnitude = value.abs().log10().floor();
    let text = if !(-3.0..6.0).contains(&magnitude) {
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

/// A value and its standard error, which has two digits and limits those of the value.
pub fn estimate(value: f64, error: f64) -> String {
    if !(value.is_finite() && error.is_finite() && error > 0.0) {
        return format!("{} ± {}", number(value), number(error));
    }
    let magnitude = value.abs().max(error).log10().floor();
    // A power of ten instead of many zeros.
    let exponent = if (-3.0..5.0).contains(&magnitude) { 0.0 } else { magnitude };
    let factor = 10_f64.powf(-exponent);
    let decimals = 1.0 - (error * factor).log10().floor();
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // from 0 to 15
    let decimals = decimals.clamp(0.0, 15.0) as usize;
    let (value, error) = (value * factor, error * factor);
    let text = if exponent == 0.0 {
        format!("{value:.decimals$} ± {error:.decimals$}")
    } else {
        format!("({value:.decimals$} ± {error:.decimals$})\u{b7}10<sup>{exponent:.0}</sup>")
    };
    text.replace('-', "\u{2212}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contents_are_the_headings() {
        let body =
            "<h1>A &amp; B</h1><p>before</p><h2>One</h2><p>first</p><h2 id=\"two\">Two</h2><p>second</p>";
        let html = page("A & B", ".own { color: red; }", body);
        for part in [
            "<title>A &amp; B</title>",
            ".own { color: red; }",
            "<header>\n<h1>A &amp; B</h1>\n</header>",
            "<li><a href=\"#section-1\">One</a></li>\n<li><a href=\"#two\">Two</a></li>",
            "<p>before</p><h2 id=\"section-1\">One</h2><p>first</p><h2 id=\"two\">Two</h2><p>second</p>",
        ] {
            assert!(html.contains(part), "{part}");
        }
        assert!(!page("A", "", "<h1>A</h1><p>alone</p>").contains("<nav"));
    }

    #[test]
    fn numbers_have_few_digits() {
        let cases = [
            (2466.41, "2466"),
            (9.174_3, "9.17"),
            (71.875, "71.9"),
            (0.55, "0.55"),
            (0.012_34, "0.0123"),
            (-1.5, "\u{2212}1.5"),
            (0.0, "0"),
            (106_120.0, "106120"),
            (2e15, "2.0\u{b7}10<sup>15</sup>"),
            (1e-9, "1.0\u{b7}10<sup>\u{2212}9</sup>"),
        ];
        for (value, text) in cases {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn estimates_end_with_their_errors() {
        let cases = [
            (19.002_34, 0.004_13, "19.0023 ± 0.0041"),
            (-440.4, 3.21, "\u{2212}440.4 ± 3.2"),
            (106_120.0, 13.0, "(1.06120 ± 0.00013)\u{b7}10<sup>5</sup>"),
            (8.01e-7, 2.5e-9, "(8.010 ± 0.025)\u{b7}10<sup>\u{2212}7</sup>"),
            (-4.7e-5, 9.0e-5, "(\u{2212}4.7 ± 9.0)\u{b7}10<sup>\u{2212}5</sup>"),
            (3530.0, 120.0, "3530 ± 120"),
        ];
        for (value, error, text) in cases {
            assert_eq!(estimate(value, error), text);
        }
    }
}
