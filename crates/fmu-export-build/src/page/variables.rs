//! The tables of variables, and where each variable is on the page.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::slice;

use fmu_terms::Unit;
use fmu_terms::{Causality, DataType};
use fmu_xml::page::{breakable, unit as unit_markup};
use quick_xml::escape::escape;

use crate::declaration::{OneOrEach, VariableDeclaration};
use crate::dependencies::{self, Structure, Unknown};
use crate::model::{Field, Model, Part, Place};
use crate::start::Start;
use crate::value_type::ValueType;

/// A table of variables on the page.
#[derive(Clone, Copy)]
pub(super) struct Table {
    pub(super) id: &'static str,
    pub(super) title: &'static str,
    causality: Causality,
    /// For local variables, whether they are states; an output state belongs to the outputs.
    of_states: bool,
}

impl Table {
    const fn new(id: &'static str, title: &'static str, causality: Causality) -> Self {
        Self { id, title, causality, of_states: false }
    }

    pub(super) fn has(&self, field: &Field<'_>) -> bool {
        let is_state = field.place == Place::States;
        self.causality == field.declaration.causality
            && (self.causality != Causality::Local || self.of_states == is_state)
    }
}

/// A list with more start values is folded away.
const MOST_STARTS: usize = 12;

/// The tables, in order.
pub(super) const TABLES: [Table; 7] = [
    Table::new("page-inputs", "Inputs", Causality::Input),
    Table::new("page-outputs", "Outputs", Causality::Output),
    Table::new("page-parameters", "Parameters", Causality::Parameter),
    Table::new("page-structural-parameters", "Structural parameters", Causality::StructuralParameter),
    Table::new("page-calculated-parameters", "Calculated parameters", Causality::CalculatedParameter),
    Table { of_states: true, ..Table::new("page-states", "States", Causality::Local) },
    Table::new("page-locals", "Local variables", Causality::Local),
];

/// The id on the page of each name of a variable or enumeration: an array's elements are in its row.
pub(crate) fn anchors(model: &Model<'_>) -> BTreeMap<String, String> {
    let others = model.declaration.enumerations.iter().map(|enumeration| enumeration.name.as_str());
    let mut anchors: BTreeMap<String, String> =
        others.chain(["time"]).map(|name| (name.to_owned(), name.to_owned())).collect();
    for (part, field) in fields(model) {
        let name = name(part, field);
        for &position in &field.positions {
            anchors.insert(model.scalars[position].name.clone(), name.clone());
            if field.place == Place::States {
                anchors.insert(model.scalars[position + 1].name.clone(), derivative(&name));
            }
        }
        if field.place == Place::States {
            anchors.insert(derivative(&name), derivative(&name));
        }
        anchors.insert(name.clone(), name);
    }
    anchors
}

/// All declared variables, each with its part.
pub(super) fn fields<'m, 'a>(model: &'m Model<'a>) -> impl Iterator<Item = (&'m Part<'a>, &'m Field<'a>)> {
    model.parts.iter().flat_map(|part| part.fields.iter().map(move |field| (part, field)))
}

/// The name of a declared variable, without subscripts.
pub(super) fn name(part: &Part<'_>, field: &Field<'_>) -> String {
    part.name_of(&field.declaration.name)
}

fn derivative(name: &str) -> String {
    format!("der({name})")
}

pub(super) struct Page<'m, 'a> {
    pub(super) model: &'m Model<'a>,
    anchors: BTreeMap<String, String>,
    outputs: BTreeMap<usize, &'m Unknown>,
    units: BTreeMap<&'m str, &'m Unit>,
    /// The names of units and display units.
    unit_names: BTreeSet<&'m str>,
}

impl<'m, 'a> Page<'m, 'a> {
    pub(super) fn new(model: &'m Model<'a>, structure: &'m Structure) -> Self {
        let units = model.units.iter();
        Self {
            model,
            anchors: anchors(model),
            outputs: structure.outputs.iter().map(|unknown| (unknown.scalar, unknown)).collect(),
            units: units.clone().map(|unit| (unit.name.as_str(), unit)).collect(),
            unit_names: units
                .flat_map(|unit| unit.display_units.iter().map(|display| &display.name).chain([&unit.name]))
                .map(String::as_str)
                .collect(),
        }
    }

    /// The variables of a table, by component.
    pub(super) fn table(&self, table: &Table) -> String {
        let Table { id, title, .. } = table;
        let parts = self.model.parts.iter().map(|part| {
            let fields: Vec<_> = part.fields.iter().filter(|field| table.has(field)).collect();
            (part, fields)
        });
        let parts: Vec<_> = parts.filter(|(_, fields)| !fields.is_empty()).collect();
        let all = || parts.iter().flat_map(|(_, fields)| fields);
        if all().next().is_none() {
            return String::new();
        }
        let columns = Columns {
            start: all().any(|field| self.has_start(field)),
            initial: table.of_states,
            range: all().any(|field| field.declaration.min.is_some() || field.declaration.max.is_some()),
        };
        let mut text = format!("<section id=\"{id}\">\n<h3>{title}</h3>\n<table class=\"variables\">\n");
        let head = [
            (true, "name", "Variable"),
            (true, "reference", "Ref."),
            (true, "unit", "Unit or type"),
            (columns.start, "start", "Start"),
            (columns.range, "range", "Range"),
            (true, "kind", if columns.initial { "Initial" } else { "Variability" }),
            (true, "description", "Description"),
        ];
        let head: Vec<_> = head.into_iter().filter(|(shown, _, _)| *shown).collect();
        let titles =
            head.iter().map(|(_, class, title)| format!("<th scope=\"col\" class=\"{class}\">{title}</th>"));
        let titles = lines(titles);
        let _ = writeln!(text, "<thead><tr>{titles}</tr></thead>");
        for (part, fields) in &parts {
            text += "<tbody>\n";
            if part.component.is_some() {
                let _ = writeln!(
                    text,
                    "<tr class=\"component\"><th colspan=\"{}\" scope=\"rowgroup\"><code>{}</code> {}</th></tr>",
                    head.len(),
                    escape(&part.name),
                    escape(part.description.as_deref().unwrap_or_default())
                );
            }
            for field in fields {
                text += &self.row(part, field, &columns);
                if self.folds_starts(field) {
                    let starts = self.folded_starts(field);
                    let _ = writeln!(text, "<tr><td colspan=\"{}\">{starts}</td></tr>", head.len());
                }
            }
            text += "</tbody>\n";
        }
        text + "</table>\n</section>\n"
    }

    fn row(&self, part: &Part<'_>, field: &Field<'_>, columns: &Columns) -> String {
        let name = name(part, field);
        let first = &self.model.scalars[field.positions[0]];
        let dimensions: Vec<_> = field.declaration.sizes.iter().map(usize::to_string).collect();
        let dimensions =
            if dimensions.is_empty() { String::new() } else { format!("[{}]", dimensions.join(",")) };
        let mut text =
            format!("<tr id=\"{name}\"><th scope=\"row\">{}", code(&format!("{name}{dimensions}")));
        let mut reference = self.references(field, 0);
        let mut unit = self.unit_or_type(field);
        let description = field.declaration.description.as_deref().unwrap_or_default();
        let mut description = self.prose(description);
        if let Some(declared) = &field.declaration.derivative {
            let rate = &self.model.scalars[field.positions[0] + 1];
            let name = derivative(&name);
            let _ = write!(text, "<span id=\"{name}\">{}</span>", code(&format!("{name}{dimensions}")));
            let _ = write!(reference, "<span>{}</span>", self.references(field, 1));
            let _ = write!(
                unit,
                "<span>{}</span>",
                unit_markup(rate.quantity.unit.as_deref().unwrap_or_default())
            );
            let derived = declared.description.as_deref().unwrap_or("time derivative");
            let _ = write!(description, "<span>{}</span>", self.prose(derived));
        }
        let _ = write!(text, "</th><td class=\"reference\">{reference}</td><td class=\"unit\">{unit}</td>");
        if columns.start {
            let _ = write!(text, "<td class=\"start\">{}</td>", self.start(field));
        }
        if columns.range {
            let _ = write!(text, "<td class=\"range\">{}</td>", range(field.declaration));
        }
        let kind = match first.initial {
            Some(initial) if columns.initial => initial.to_string(),
            _ => first.variability.to_string(),
        };
        if field.place == Place::Outputs {
            description += &self.dependencies(field);
        }
        let _ = writeln!(text, "<td class=\"kind\">{kind}</td><td>{description}</td></tr>");
        text
    }

    /// A text as markup, with superscript exponents in units and breaks in names.
    fn prose(&self, text: &str) -> String {
        let words = text.split(' ').map(|word| {
            let bare = word.trim_matches(['(', ')', ',', ';', ':', '.']);
            if self.unit_names.contains(bare) {
                word.replace(bare, &unit_markup(bare))
            } else if bare.contains('_') {
                breakable(&escape(word))
            } else {
                escape(word).into_owned()
            }
        });
        words.collect::<Vec<_>>().join(" ")
    }

    /// The value reference of a variable, or (1) of its derivative; for an array that is not one variable, those of all
    /// elements.
    fn references(&self, field: &Field<'_>, offset: usize) -> String {
        if !self.model.exports(field.place) {
            return String::new();
        }
        let scalars = field.positions.iter().map(|position| &self.model.scalars[position + offset]);
        let references: Vec<_> = scalars.map(|scalar| scalar.value_reference).collect();
        match references[..] {
            [first, ..] if self.model.is_one_variable(field) => first.to_string(),
            [first, .., last] if (last - first) as usize + 1 == references.len() => {
                format!("{first} … {last}")
            }
            [first, second, _, .., last] => format!("{first}, {second} … {last}"),
            _ => references.iter().map(u32::to_string).collect::<Vec<_>>().join(", "),
        }
    }

    fn unit_or_type(&self, field: &Field<'_>) -> String {
        match field.data_type {
            ValueType::Standard(DataType::Real | DataType::Float32) => {
                let units = match &field.declaration.unit {
                    Some(OneOrEach::All(unit)) => slice::from_ref(unit),
                    Some(OneOrEach::Each(units)) => units,
                    None => &[],
                };
                units.iter().map(|unit| unit_markup(unit)).collect::<Vec<_>>().join(", ")
            }
            ValueType::Enumeration(enumeration) => {
                let name = &self.model.declaration.enumerations[enumeration].name;
                format!("<a href=\"#{}\">{}</a>", escape(name), breakable(name))
            }
            ValueType::Standard(_) => field.declaration.data_type.clone(),
        }
    }

    fn has_start(&self, field: &Field<'_>) -> bool {
        self.model.scalars[field.positions[0]].start.is_some()
    }

    /// Whether the start values are too many for a cell: those of a matrix, and long lists.
    fn has_many_starts(&self, field: &Field<'_>) -> bool {
        let is_matrix = field.declaration.sizes.len() == 2;
        self.has_start(field) && (is_matrix || field.positions.len() > MOST_STARTS)
    }

    /// Whether the start values are many, differ, and so have a separate row.
    fn folds_starts(&self, field: &Field<'_>) -> bool {
        let first = &self.model.scalars[field.positions[0]].start;
        let differs = |position: &usize| self.model.scalars[*position].start != *first;
        self.has_many_starts(field) && field.positions.iter().any(differs)
    }

    /// The start values of a scalar or a short list, also in the display unit.
    fn start(&self, field: &Field<'_>) -> String {
        if self.folds_starts(field) {
            return "below".to_owned();
        }
        if self.has_many_starts(field) {
            return self.starts(field).next().map(|start| format!("each {start}")).unwrap_or_default();
        }
        let starts: Vec<_> = self.starts(field).collect();
        let mut text = starts.join(", ");
        if let Some(display) = self.displayed(field) {
            let _ = write!(text, " <small>{display}</small>");
        }
        text
    }

    fn starts(&self, field: &Field<'_>) -> impl Iterator<Item = String> {
        let starts =
            field.positions.iter().filter_map(|&position| self.model.scalars[position].start.as_ref());
        starts.map(|start| match (start, field.data_type) {
            (Start::Real(value), _) => unbroken(*value),
            (Start::String(text), _) => format!("“{}”", escape(text)),
            (Start::Item { position, value }, ValueType::Enumeration(enumeration)) => {
                let item = &self.model.declaration.enumerations[enumeration].items[*position];
                format!("{} ({value})", item.name)
            }
            (value, _) => value.to_string(),
        })
    }

    /// A scalar's start value in its display unit.
    fn displayed(&self, field: &Field<'_>) -> Option<String> {
        let variable = &self.model.scalars[field.positions[0]];
        let [_] = field.positions[..] else { return None };
        let wanted = variable.quantity.display_unit.as_ref()?;
        let Some(Start::Real(start)) = variable.start else { return None };
        let unit = self.units.get(variable.quantity.unit.as_deref()?)?;
        let display = unit.display_units.iter().find(|display| display.name == *wanted)?;
        let offset = if variable.quantity.is_relative { 0.0 } else { display.offset };
        // Conversion leaves errors of some 1e-16, which are not shown.
        let value = format!("{:.11e}", start * display.factor + offset).parse().ok()?;
        Some(format!("{} {}", unbroken(value), unit_markup(wanted)))
    }

    /// Start values to unfold: a matrix's row by row.
    fn folded_starts(&self, field: &Field<'_>) -> String {
        let starts: Vec<_> = self.starts(field).collect();
        let starts = if let [_, columns] = field.declaration.sizes[..] {
            let head = lines((1..=columns).map(|column| format!("<th scope=\"col\">{column}</th>")));
            let rows = lines(starts.chunks(columns).zip(1..).map(|(values, row)| {
                let cells =
                    values.iter().map(|value| format!("<td>{value}</td>")).collect::<Vec<_>>().concat();
                format!("<tr><th scope=\"row\">{row}</th>{cells}</tr>")
            }));
            format!(
                "<div class=\"wide\"><table class=\"matrix\">\n<thead><tr><td></td>{head}</tr></thead>\n<tbody>\n{rows}\n\
                 </tbody></table></div>"
            )
        } else {
            format!("<p>{}</p>", starts.join(", "))
        };
        let name = escape(&field.declaration.name);
        format!("<details><summary>Start values of <code>{name}</code></summary>{starts}</details>")
    }

    /// The inputs and states on which an output depends instantaneously.
    fn dependencies(&self, field: &Field<'_>) -> String {
        let unknowns = field.positions.iter().filter_map(|position| self.outputs.get(position));
        let Some(lists) = dependencies::lists(unknowns.map(|unknown| &unknown.dependencies)) else {
            return "<span>may depend instantaneously on every input and state</span>".to_owned();
        };
        let mut knowns = lists.concat();
        knowns.sort_unstable();
        knowns.dedup();
        let mut links: Vec<_> = knowns
            .iter()
            .map(|&position| &self.anchors[&self.model.scalars[position].name])
            .map(|anchor| format!("<a href=\"#{}\">{}</a>", escape(anchor), code(anchor)))
            .collect();
        links.dedup();
        let links = if links.is_empty() { "no input or state".to_owned() } else { links.join(", ") };
        format!("<span>depends instantaneously on {links}</span>")
    }
}

/// The columns that only some tables have.
struct Columns {
    start: bool,
    range: bool,
    /// How the start value is determined, instead of the variability.
    initial: bool,
}

fn code(name: &str) -> String {
    format!("<code>{}</code>", breakable(name))
}

fn range(variable: &VariableDeclaration) -> String {
    match (variable.min, variable.max) {
        (Some(min), Some(max)) => format!("{} … {}", unbroken(min), unbroken(max)),
        (Some(min), None) => format!("≥ {}", unbroken(min)),
        (None, Some(max)) => format!("≤ {}", unbroken(max)),
        (None, None) => String::new(),
    }
}

/// The shortest decimal that reads back as the same double, with an exponent if it saves many zeros.
pub(super) fn number(value: f64) -> String {
    if value == 0.0 || (1e-4..1e6).contains(&value.abs()) { value.to_string() } else { format!("{value:e}") }
}

/// A number's markup; browsers break lines after the hyphen of an exponent.
fn unbroken(value: f64) -> String {
    let number = number(value);
    if number.contains("e-") { format!("<span class=\"number\">{number}</span>") } else { number }
}

pub(super) fn lines(lines: impl Iterator<Item = String>) -> String {
    lines.collect::<Vec<_>>().join("\n")
}
