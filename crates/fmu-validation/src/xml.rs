//! An FMU's XML files: parsed within limits, with the lines of elements.

use std::cell::OnceCell;

use fmu_package::xml::{Problem, declared_encoding, parse};
use roxmltree::{Document, Node};

use crate::report::{Place, Report};
use crate::rules::{LIMIT, XML_DOCTYPE, XML_ENCODING, XML_SYNTAX};

/// The longest attribute value in bytes, unless a list or prose: findings quote them.
const LONGEST_VALUE: usize = 10_000;

/// A file and its content.
pub(crate) struct Xml<'d> {
    /// The file's path in the archive.
    pub file: &'d str,
    text: &'d str,
    document: Document<'d>,
    /// The offsets at which lines begin, without the first line.
    lines: OnceCell<Vec<usize>>,
}

impl<'d> Xml<'d> {
    /// Parses a file, or reports why it cannot be parsed.
    pub fn parse(file: &'d str, text: &'d str, report: &mut Report) -> Option<Self> {
        let in_line = |line| Place { line: Some(line), ..Place::file(file) };
        // A byte order mark is allowed.
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        if let Some(encoding) = declared_encoding(text).filter(|name| !name.eq_ignore_ascii_case("utf-8")) {
            report.add(&XML_ENCODING, in_line(1), format!("it declares the encoding {encoding}"));
        }
        match parse(text, LONGEST_VALUE) {
            Ok(document) => Some(Self { file, text, document, lines: OnceCell::new() }),
            Err((problem, line, message)) => {
                let rule = match problem {
                    Problem::DocumentType => &XML_DOCTYPE,
                    Problem::Limit => &LIMIT,
                    Problem::Syntax => &XML_SYNTAX,
                };
                report.add(rule, in_line(line), message);
                None
            }
        }
    }

    pub fn root(&self) -> Node<'_, 'd> {
        self.document.root_element()
    }

    pub fn at(&self, node: Node<'_, '_>) -> Place {
        let lines =
            self.lines.get_or_init(|| self.text.match_indices('\n').map(|(place, _)| place + 1).collect());
        let line = 1 + lines.partition_point(|&start| start <= node.range().start);
        Place { line: Some(line), ..Place::file(self.file) }
    }
}
