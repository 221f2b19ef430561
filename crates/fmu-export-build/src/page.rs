//! The documentation page of the FMU, `documentation/index.html` (FMI 2.0.5, section 2.3).
//!
//! It shows the content of modelDescription.xml, from the same model, and includes the author's fragment. The page is
//! self-contained, readable without scripts, reproducible byte for byte, and both XML and HTML: every element is
//! closed, so that both parsers read the same.

pub(crate) mod variables;

use std::fmt::Write as _;

use fmu_terms::Version;
use fmu_xml::page::Document;
use quick_xml::escape::escape;

use crate::dependencies::Structure;
use crate::fragment::Fragment;
use crate::model::{Field, Model, Part, Place};
use crate::start::Start;
use crate::xml;
use variables::{Page, TABLES, fields, lines, number};

/// Writes the page.
pub(crate) fn write(
    model: &Model<'_>,
    structure: &Structure,
    guid: &str,
    fragment: Option<&Fragment>,
) -> String {
    let page = Page::new(model, structure);
    let description = model.description.iter().map(|description| format!(": {description}"));
    let title = model.identifier.clone() + &description.collect::<String>();
    let (opening, sections) = fragment.map(Fragment::parts).unwrap_or_default();
    let main = format!(
        include_str!("page/page.html"),
        opening = section("page-opening", "", opening),
        time = model.scalars[0].value_reference,
        facts = page.facts(guid),
        capabilities = page.capabilities(),
        commands = page.commands(),
        events = if model.fmi.interfaces.model_exchange() {
            " In Model Exchange, tunable parameters and discrete variables change only at events."
        } else {
            ""
        },
        model = section("page-model", "<h2>Model</h2>\n", sections),
        tables = TABLES.map(|table| page.table(&table)).concat(),
        enumerations = page.enumerations(),
        log_categories = lines(model.log_categories.iter().map(|category| {
            let (name, meaning) = (escape(&category.name), escape(&category.description));
            format!("<tr><th scope=\"row\"><code>{name}</code></th><td>{meaning}</td></tr>")
        })),
    );
    let header = format!(
        "<p>FMU for {}</p>\n<h1>{}</h1>\n<p class=\"lead\">{}</p>",
        model.fmi.interfaces.names(),
        escape(&model.identifier),
        escape(model.description.as_deref().unwrap_or_default()),
    );
    let contents = page.contents(fragment);
    Document {
        title: &title,
        header: &header,
        contents: &contents,
        main: &main,
        scripts: &[include_str!("page/filter.js")],
        picture_sources: &["data:"],
        ..Document::default()
    }
    .html()
}

/// A section with a part of the fragment, if any.
fn section(id: &str, heading: &str, markup: &str) -> String {
    if markup.is_empty() {
        return String::new();
    }
    format!("<section id=\"{id}\">\n{heading}{markup}\n</section>\n")
}

impl<'m, 'a> Page<'m, 'a> {
    /// The declared variables of a place.
    fn of(&self, place: Place) -> impl Iterator<Item = (&'m Part<'a>, &'m Field<'a>)> + use<'m, 'a> {
        fields(self.model).filter(move |(_, field)| field.place == place)
    }

    fn contents(&self, fragment: Option<&Fragment>) -> String {
        let entry =
            |id: &str, title: &str, below: &str| format!("<li><a href=\"#{id}\">{title}</a>{below}</li>");
        let below = |entries: Vec<String>| format!("<ul>\n{}\n</ul>", entries.join("\n"));
        let mut entries = vec![entry("page-overview", "Overview", ""), entry("page-use", "Use", "")];
        if let Some(fragment) = fragment.filter(|fragment| !fragment.headings.is_empty()) {
            let headings = fragment.headings.iter().map(|(id, title)| entry(id, title, "")).collect();
            entries.push(entry("page-model", "Model", &below(headings)));
        }
        let tables = TABLES.iter().filter(|table| fields(self.model).any(|(_, field)| table.has(field)));
        let tables = tables.map(|table| entry(table.id, table.title, "")).collect();
        entries.push(entry("page-variables", "Variables", &below(tables)));
        if !self.model.declaration.enumerations.is_empty() {
            entries.push(entry("page-enumerations", "Enumerations", ""));
        }
        entries.push(entry("page-log-categories", "Log categories", ""));
        entries.join("\n")
    }

    fn facts(&self, guid: &str) -> String {
        let model = self.model;
        let counts = TABLES.iter().filter_map(|table| {
            let fields = fields(model).filter(|(_, field)| table.has(field) && model.exports(field.place));
            let count: usize = fields.map(|(_, field)| field.positions.len()).sum();
            (count > 0).then(|| format!("{count} {}", table.title.to_lowercase()))
        });
        let counts = counts.collect::<Vec<_>>().join(", ");
        let experiment = self.experiment();
        let interface = format!("FMI {}.0 for {}", model.fmi.version, model.fmi.interfaces.names());
        let event_indicators = model.declaration.event_indicators.join(", ");
        let facts = [
            ("Interface", Some(interface.as_str())),
            ("Version", Some(model.version)),
            ("Author", model.author.as_deref()),
            ("Copyright", model.declaration.copyright.as_deref()),
            ("License", model.license.as_deref()),
            ("Generation tool", Some(xml::GENERATION_TOOL)),
            (if model.fmi.version == Version::Two { "GUID" } else { "Instantiation token" }, Some(guid)),
            ("Default experiment", experiment.as_deref()),
            ("Scalar variables", Some(&counts)),
            (
                "Event indicators",
                Some(event_indicators.as_str())
                    .filter(|names| model.fmi.interfaces.model_exchange() && !names.is_empty()),
            ),
        ];
        let clock = model.declaration.clock.as_ref().filter(|_| model.fmi.interfaces.scheduled_execution());
        let clock = clock.map(|clock| ("Clock", Some(clock.name.as_str())));
        let facts = facts.into_iter().chain(clock).filter_map(|(term, text)| Some((term, text?)));
        lines(facts.map(|(term, text)| format!("<div><dt>{term}</dt><dd>{}</dd></div>", escape(text))))
    }

    /// The declared default experiment: `0 s to 10 s in steps of 0.1 s`.
    fn experiment(&self) -> Option<String> {
        let experiment = self.model.declaration.default_experiment.as_ref()?;
        let from = experiment.start_time.or(experiment.stop_time.and(Some(0.0)));
        let parts = [("", from), ("to ", experiment.stop_time), ("in steps of ", experiment.step_size)];
        let parts = parts.into_iter().filter_map(|(word, time)| Some(format!("{word}{} s", number(time?))));
        Some(parts.collect::<Vec<_>>().join(" ")).filter(|text| !text.is_empty())
    }

    fn capabilities(&self) -> String {
        let has = &self.model.declaration.capabilities;
        let of_steps = self.model.fmi.interfaces.co_simulation();
        let version = self.model.fmi.version;
        let [get_and_set, serialize, directional] = match version {
            Version::Two => ["canGetAndSetFMUstate", "canSerializeFMUstate", "providesDirectionalDerivative"],
            Version::Three => {
                ["canGetAndSetFMUState", "canSerializeFMUState", "providesDirectionalDerivatives"]
            }
        };
        let over_time = if of_steps { ", and the outputs' derivatives over time" } else { "" };
        let rows = [
            (
                of_steps,
                "canHandleVariableCommunicationStepSize",
                has.variable_communication_step_size,
                "communication steps may vary in length",
            ),
            (
                of_steps && version == Version::Two,
                "canInterpolateInputs",
                has.interpolate_inputs,
                "inputs may have derivatives and then change within a step; discrete inputs hold their values",
            ),
            (
                of_steps && version == Version::Three,
                "hasEventMode",
                has.event_mode,
                "the importer may handle events, which then end communication steps",
            ),
            (
                true,
                get_and_set,
                has.get_and_set_state,
                "the state can be saved and restored, for example to repeat a step",
            ),
            (true, serialize, has.serializes_state(), "a saved state can be moved to another process"),
            (
                true,
                directional,
                has.directional_derivatives,
                &format!("exact partial derivatives{over_time}"),
            ),
            (
                version == Version::Three,
                "providesAdjointDerivatives",
                has.adjoint_derivatives,
                "exact derivatives with respect to all inputs and states in one call",
            ),
            (
                version == Version::Three,
                "providesPerElementDependencies",
                self.model.has_element_dependencies(),
                "the dependencies of single array elements can be queried",
            ),
        ];
        lines(rows.into_iter().filter(|(exists, ..)| *exists).map(|(_, name, has, meaning)| {
            let has = if has { "yes" } else { "no" };
            format!("<tr><th scope=\"row\"><code>{name}</code></th><td>{has}</td><td>{meaning}</td></tr>")
        }))
    }

    /// The commands for a run in FMPy, and the inputs as a file.
    fn commands(&self) -> String {
        let name = &self.model.identifier;
        let run = |options: &str| format!("fmpy simulate {name}.fmu{options} --output-file result.csv\n");
        let mut commands = format!("fmpy info {name}.fmu\nfmpy validate {name}.fmu\n") + &run("");
        let experiment = self.model.declaration.default_experiment.as_ref();
        let start_time = experiment.and_then(|experiment| experiment.start_time).unwrap_or(0.0);
        let (mut header, mut values) = ("\"time\"".to_owned(), number(start_time));
        for (part, field) in self.of(Place::Inputs) {
            if let Some(value) = self.typed_start(field) {
                let _ = write!(header, ",\"{}\"", variables::name(part, field));
                let _ = write!(values, ",{value}");
            }
        }
        let parameters = self.of(Place::Parameters);
        let mut settings = parameters
            .filter_map(|(part, field)| Some((variables::name(part, field), self.typed_start(field)?)));
        if let Some((parameter, value)) = settings.next() {
            commands += &run(&format!(" --start-values {parameter} {value}"));
        }
        if self.of(Place::Inputs).next().is_none() {
            return format!("<pre>{commands}</pre>");
        }
        commands += &run(" --input-file inputs.csv");
        format!(
            "<pre>{commands}</pre>\n\
            <p>An <code>inputs.csv</code> with all inputs at their start values; add a line for each later time:</p>\n\
            <pre>{header}\n{values}</pre>"
        )
    }

    /// The start value of a scalar for FMPy's command line and input files. Texts are omitted: they would need quotes.
    fn typed_start(&self, field: &Field<'_>) -> Option<String> {
        let start = self.model.scalars[field.positions[0]].start.as_ref();
        match start.filter(|_| field.declaration.sizes.is_empty())? {
            Start::Boolean(value) => Some(u8::from(*value).to_string()),
            Start::String(_) => None,
            Start::Real(value) => Some(number(*value)),
            value => Some(value.to_string()),
        }
    }

    fn enumerations(&self) -> String {
        let enumerations = &self.model.declaration.enumerations;
        if enumerations.is_empty() {
            return String::new();
        }
        let tables = lines(enumerations.iter().map(|enumeration| {
            let items = lines(enumeration.valued().map(|(item, value)| {
                let (name, meaning) = (&item.name, escape(item.description.as_deref().unwrap_or_default()));
                format!("<tr><td>{value}</td><th scope=\"row\"><code>{name}</code></th><td>{meaning}</td></tr>")
            }));
            let [name, meaning] =
                [&enumeration.name, enumeration.description.as_deref().unwrap_or_default()].map(escape);
            format!(
                "<table id=\"{name}\">\n<caption><code>{name}</code> {meaning}</caption>\n<tbody>\n{items}\n</tbody>\n</table>"
            )
        }));
        format!("<section id=\"page-enumerations\">\n<h2>Enumerations</h2>\n{tables}\n</section>\n")
    }
}
