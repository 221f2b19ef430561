//! Reports, piece by piece: headings, paragraphs, tables and figures of a page.

use crate::figure::{Figure, escaped};
use crate::page::page;

/// The body of a report. Texts are escaped; what is named `html` is markup.
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
    body: String,
}

/// A table of a report.
#[derive(Clone, Debug, Default)]
pub struct Table {
    class: &'static str,
    caption: Option<&'static str>,
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
        Self { title: title.to_owned(), body: format!("<h1>{}</h1>\n", escaped(title)) }
    }

    /// Begins a section, which the table of contents lists.
    pub fn section(&mut self, title: &str) {
        self.html(&format!("<h2>{}</h2>\n", escaped(title)));
    }

    /// Begins a section to which links may lead.
    pub fn section_of(&mut self, id: &str, title: &str) {
        self.html(&format!("<h2 id=\"{}\">{}</h2>\n", escaped(id), escaped(title)));
    }

    /// Appends a paragraph.
    pub fn paragraph(&mut self, text: &str) {
        self.html(&format!("<p>{}</p>\n", escaped(text)));
    }

    /// Appends paragraphs.
    pub fn paragraphs(&mut self, texts: &[String]) {
        for text in texts {
            self.paragraph(text);
        }
    }

    /// Appends whether something holds.
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
        let Table { class, caption, head, rows } = table;
        let caption =
            caption.map_or_else(String::new, |text| format!("<caption>{}</caption>\n", escaped(text)));
        let class = if class.is_empty() { String::new() } else { format!(" class=\"{class}\"") };
        self.html(&format!("<div class=\"wide\">\n<table{class}>\n{caption}{head}{rows}</table>\n</div>\n"));
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

    /// What it has so far, as markup.
    #[must_use]
    pub fn body(&self) -> &str {
        &self.body
    }

    /// The page, with rules in addition to the style sheet.
    #[must_use]
    pub fn page(&self, style: &str) -> String {
        page(&self.title, style, &self.body)
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

    /// Its class, for the page's additional rules.
    #[must_use]
    pub fn class(mut self, class: &'static str) -> Self {
        self.class = class;
        self
    }

    /// Its caption.
    #[must_use]
    pub fn caption(mut self, caption: &'static str) -> Self {
        self.caption = Some(caption);
        self
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

    /// A text, and after it whether something holds.
    #[must_use]
    pub fn verdict(text: &str, holds: bool) -> Self {
        Self::html(&format!("{} {}", escaped(text), verdict(if holds { "holds" } else { "fails" }, holds)))
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
