//! Reports, piece by piece: headings, paragraphs, tables and figures of a page.

use fmu_xml::page::Document;

use crate::figure::{self, Figure, escaped};

/// The reports' additions to the FMUs' pages: plotly figures. On a telephone a row's first cell is a line of its own, and
/// the class `pairs` has a line for every two cells. Without a hovering pointer, plots always show their
/// toolbars, which would otherwise cover the legend; print hides them.
const STYLE: &str = "
.row { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 20rem), 1fr)); gap: 0 1rem; }
.panel { min-width: 0; } .plot { width: 100%; } .panel .title { margin: .8rem 0 0 64px; font-weight: 600; font-size: .9rem; }
.modebar:focus-within { opacity: 1 !important; }
.panel .legend { display: flex; flex-wrap: wrap; gap: 0 1.2rem; margin: 0 0 -.6rem 64px; font-size: .85rem; } .legend label { display: flex; align-items: center; gap: .4rem; } .legend span { width: 1.6rem; } .legend .dot { width: .5rem; height: .5rem; border-radius: 50%; }
@media (hover: none) { .panel .legend { margin-bottom: 0; } } @media print { .modebar { display: none; } }
body, figure { max-width: none; } table { max-width: 90rem; }
td.number { font-variant-numeric: tabular-nums; } .caption { max-width: none; color: var(--faint); font-size: .9rem; }
.holds, .differs, .fails { font-weight: 600; } .fails { color: var(--paper); background: var(--ink); padding: 0 .3em; }
@media (max-width: 30rem) {
  .wide table:not(.matrix) {
    tr { display: flex; flex-wrap: wrap; border-bottom: 1px solid var(--rule); } :is(th, td) { flex: 1 1 0; min-width: 0; white-space: normal; overflow-wrap: anywhere; border: 0; }
    :is(th, td):first-child { flex: 0 0 100%; padding-bottom: 0; } th:empty { display: none; }
  }
  .wide .pairs tr td:nth-child(n) { flex: 0 0 50%; }
}
details pre { font-size: .8em; background: var(--shade); padding: .8em; overflow-x: auto; }
@media print { .row, .panel { break-inside: avoid; } .legend input { display: none; } }
";

/// A report: a self-contained HTML page in the style of the FMUs' pages. Texts are escaped; arguments named `html` are
/// markup.
///
/// ```
/// use fmu_plot::{Cell, Figure, Line, Panel, Report, Table};
///
/// let mut report = Report::new("Ball");
/// report.section("Fall");
/// let line = Line::new(&[0.0, 1.0], [1.0, 0.5]).label("h");
/// report.figure(&Figure::new().row([Panel::new("time (s)", "h (m)").line(line)]), "The ball falls.");
/// let mut table = Table::new(["Time", "Height"]);
/// table.row([Cell::number("1 s"), Cell::number("0.5 m")]);
/// report.table(&table);
/// assert!(report.page("").contains("<td class=\"number\">0.5 m</td>"));
/// ```
#[derive(Clone, Debug, Default)]
pub struct Report {
    title: String,
    /// The table of contents: a link to each section.
    contents: String,
    sections: usize,
    body: String,
    /// The page's own script, and what the page's policy allows scripts.
    script: Option<String>,
    script_sources: &'static [&'static str],
}

/// A table of a report.
#[derive(Clone, Debug, Default)]
pub struct Table {
    /// The attribute `class`, if it has one.
    class: String,
    /// The table's caption and its row of headings, if it has them.
    caption: String,
    head: String,
    rows: String,
}

/// A cell of a [`Table`]; a text becomes one by `into()`.
#[derive(Clone, Debug)]
pub struct Cell {
    html: String,
    is_number: bool,
}

impl Report {
    /// A report that begins with its title.
    #[must_use]
    pub fn new(title: &str) -> Self {
        Self { title: title.to_owned(), ..Self::default() }
    }

    /// Starts a section, which the table of contents lists.
    pub fn section(&mut self, title: &str) {
        self.section_of(&format!("section-{}", self.sections + 1), title);
    }

    /// Begins a section to which links may lead.
    pub fn section_of(&mut self, id: &str, title: &str) {
        let [id, title] = [id, title].map(escaped);
        self.sections += 1;
        self.contents += &format!("<li><a href=\"#{id}\">{title}</a></li>\n");
        self.body += &format!("<h2 id=\"{id}\">{title}</h2>\n");
    }

    /// Appends a paragraph.
    pub fn paragraph(&mut self, text: &str) {
        self.html(&format!("<p>{}</p>\n", escaped(text)));
    }

    /// Appends a verdict, highlighted if it is negative.
    pub fn verdict(&mut self, text: &str, holds: bool) {
        self.html(&format!("<p>{}</p>\n", verdict(text, holds)));
    }

    /// Appends a figure with its caption, if it has one.
    pub fn figure(&mut self, figure: &Figure, caption: &str) {
        self.picture(&figure.html(), caption);
    }

    /// Appends a picture, as markup, with its caption, if it has one.
    pub fn picture(&mut self, html: &str, caption: &str) {
        let caption = match caption {
            "" => String::new(),
            text => format!("<figcaption>{}</figcaption>\n", escaped(text)),
        };
        self.html(&format!("<figure>\n{html}{caption}</figure>\n"));
    }

    /// Appends a table.
    pub fn table(&mut self, table: &Table) {
        self.html(&table.html());
    }

    /// Appends a text that readers unfold, such as a file.
    pub fn details(&mut self, summary: &str, text: &str) {
        let [summary, text] = [summary, text].map(escaped);
        self.html(&format!("<details><summary>{summary}</summary><pre>{text}</pre></details>\n"));
    }

    /// Appends markup.
    pub fn html(&mut self, html: &str) {
        self.body += html;
    }

    /// Appends another report without its title; the ids of its sections should differ from those here.
    pub fn append(&mut self, other: &Self) {
        self.contents += &other.contents;
        self.body += &other.body;
    }

    /// Sets a script that runs after the figures' own, and what the page's content security policy allows it, such as
    /// `'wasm-unsafe-eval'`.
    pub fn script(&mut self, source: &str, sources: &'static [&'static str]) {
        self.script = Some(source.to_owned());
        self.script_sources = sources;
    }

    /// The page, with rules in addition to the style sheet.
    #[must_use]
    pub fn page(&self, style: &str) -> String {
        let scripts: Vec<_> = figure::SCRIPTS.into_iter().chain(self.script.as_deref()).collect();
        let main = "<noscript><p>The figures are drawn by the script in this page.</p></noscript>\n\n";
        Document {
            title: &self.title,
            style: &(STYLE.to_owned() + style),
            header: &format!("<h1>{}</h1>", escaped(&self.title)),
            contents: &self.contents,
            main: &(main.to_owned() + &self.body),
            scripts: &scripts,
            script_sources: self.script_sources,
            // plotly.js tries formats of pictures as it loads, and saves figures by way of blobs.
            picture_sources: &["data:", "blob:"],
        }
        .html()
    }
}

impl Table {
    /// A table with a row of headings; the default has none.
    #[must_use]
    pub fn new<T: Into<Cell>>(headings: impl IntoIterator<Item = T>) -> Self {
        let headings = headings.into_iter().map(|heading| format!("<th>{}</th>", heading.into().html));
        let head = format!("<thead><tr>{}</tr></thead>\n", headings.collect::<String>());
        Self { head, ..Self::default() }
    }

    /// Sets the table's class, for the page's additional rules.
    #[must_use]
    pub fn class(self, class: &str) -> Self {
        Self { class: format!(" class=\"{class}\""), ..self }
    }

    /// Sets the table's caption.
    #[must_use]
    pub fn caption(self, caption: &str) -> Self {
        Self { caption: format!("<caption>{}</caption>\n", escaped(caption)), ..self }
    }

    /// The table's markup.
    #[must_use]
    pub fn html(&self) -> String {
        let Self { class, caption, head, rows } = self;
        format!("<div class=\"wide\">\n<table{class}>\n{caption}{head}{rows}</table>\n</div>\n")
    }

    /// Appends a row.
    pub fn row(&mut self, cells: impl IntoIterator<Item = Cell>) {
        let cells = cells.into_iter().map(|cell| {
            let class = if cell.is_number { " class=\"number\"" } else { "" };
            format!("<td{class}>{}</td>", cell.html)
        });
        self.rows += &format!("<tr>{}</tr>\n", cells.collect::<String>());
    }
}

impl Cell {
    /// A number, which is not broken.
    #[must_use]
    pub fn number(text: &str) -> Self {
        Self { html: escaped(text), is_number: true }
    }

    /// A text, and whether it meets a requirement.
    #[must_use]
    pub fn verdict(text: &str, met: bool) -> Self {
        Self::html(&format!("{} {}", escaped(text), verdict(if met { "met" } else { "not met" }, met)))
    }

    /// Markup.
    #[must_use]
    pub fn html(html: &str) -> Self {
        Self { html: html.to_owned(), is_number: false }
    }
}

impl<T: AsRef<str>> From<T> for Cell {
    fn from(text: T) -> Self {
        Self::html(&escaped(text.as_ref()))
    }
}

fn verdict(text: &str, holds: bool) -> String {
    format!("<span class=\"{}\">{}</span>", if holds { "holds" } else { "fails" }, escaped(text))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_are_escaped_and_markup_is_not() {
        let mut report = Report::new("A < B");
        report.section_of("one", "1 & 2");
        report.paragraph("<b>");
        let mut table = Table::new([Cell::html("<i>T</i> (s)"), "\"".into()]).class("own").caption("1 < 2");
        table.row([Cell::number("<5"), Cell::verdict("a & b", false)]);
        report.table(&table);
        report.details("S <", "x < y");
        assert_eq!(
            report.body,
            "<h2 id=\"one\">1 &amp; 2</h2>\n<p>&lt;b&gt;</p>\n\
             <div class=\"wide\">\n<table class=\"own\">\n<caption>1 &lt; 2</caption>\n\
             <thead><tr><th><i>T</i> (s)</th><th>&quot;</th></tr></thead>\n\
             <tr><td class=\"number\">&lt;5</td><td>a &amp; b <span class=\"fails\">not met</span></td></tr>\n\
             </table>\n</div>\n<details><summary>S &lt;</summary><pre>x &lt; y</pre></details>\n"
        );
    }

    #[test]
    fn contents_are_the_headings() {
        let mut report = Report::new("A & B");
        report.paragraph("before");
        report.section("One");
        report.section_of("two", "Two");
        let mut more = Report::default();
        more.section_of("three", "< 3");
        report.append(&more);
        let html = report.page(".own { color: red; }");
        for part in [
            "<title>A &amp; B</title>",
            ".own { color: red; }",
            "<header>\n<h1>A &amp; B</h1>\n</header>",
            "<li><a href=\"#section-1\">One</a></li>\n<li><a href=\"#two\">Two</a></li>\n\
             <li><a href=\"#three\">&lt; 3</a></li>",
            "<p>before</p>\n<h2 id=\"section-1\">One</h2>\n<h2 id=\"two\">Two</h2>\n<h2 id=\"three\">&lt; 3</h2>",
        ] {
            assert!(html.contains(part), "{part}");
        }
        assert!(!Report::new("A").page("").contains("<nav"));
    }
}
