//! The reports: self-contained HTML pages in the style of the FMUs' pages.

use fmu_xml::page::Document;

use crate::figure;

/// The reports' additions to the FMUs' pages: plotly figures. Without a hovering pointer, plots always show their
/// toolbars, which would otherwise cover the legend; print hides them.
const STYLE: &str = "
.row { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 20rem), 1fr)); gap: 0 1rem; }
.panel { min-width: 0; } .plot { width: 100%; } .panel .title { margin: .8rem 0 0 64px; font-weight: 600; font-size: .9rem; }
.modebar:focus-within { opacity: 1 !important; }
.panel .legend { display: flex; flex-wrap: wrap; gap: 0 1.2rem; margin: 0 0 -.6rem 64px; font-size: .85rem; } .legend label { display: flex; align-items: center; gap: .4rem; } .legend span { width: 1.6rem; }
@media (hover: none) { .panel .legend { margin-bottom: 0; } } @media print { .modebar { display: none; } }
body, figure { max-width: none; } table { max-width: 90rem; }
td.number { font-variant-numeric: tabular-nums; } .caption { max-width: none; color: var(--faint); font-size: .9rem; }
.holds, .differs, .fails { font-weight: 600; } .fails { color: var(--paper); background: var(--ink); padding: 0 .3em; }
details pre { font-size: .8em; background: var(--shade); padding: .8em; overflow-x: auto; }
@media print { .row, .panel { break-inside: avoid; } .legend input { display: none; } }
";

/// A self-contained HTML page, with the scripts that draw its [figures](crate::Figure::html). `title` is plain text,
/// `style` adds rules to the style sheet, and `body` is HTML that begins with an `<h1>`; its `<h2>` become the table of
/// contents.
///
/// ```
/// use fmu_plot::{Figure, Line, Panel, page};
///
/// let line = Line::new(&[0.0, 1.0], [1.0, 0.5]).label("h");
/// let figure = Figure::new().row([Panel::new("time (s)", "h (m)").line(line)]);
/// let html = page("Ball", "", &format!("<h1>Ball</h1>\n<figure>\n{}</figure>", figure.html()));
/// assert!(html.contains("<title>Ball</title>"));
/// ```
#[must_use]
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
    let scripts = figure::script();
    Document { title, style: &style, header: &header, contents: &contents, main: &main, scripts: &scripts }
        .html()
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
}
