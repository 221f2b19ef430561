//! Records what a scenario names, at communication points and events. The coupling does not know of it.

use std::cell::LazyCell;

use anyhow::Result;
use fmu_package::Function;
use fmu_record::{Column, Record};
use fmu_solve::time::rounding;
use fmu_terms::like;

use crate::coupling::{Coupling, converted};
use crate::importer::EventRow;
use crate::noise::NoiseSource;
use crate::scenario::{Scenario, Signal};

/// Records rows: at communication points, and before and after the events that instances watch. There, what is read of
/// another instance lies on the line between its own rows, or holds if it is discrete; inputs hold.
pub struct Recorder {
    /// The sources of the columns.
    sources: Vec<Source>,
    /// The events since the last communication point, by member.
    events: Vec<Vec<EventRow>>,
    row: Vec<f64>,
    /// The time of the last communication point (s), if there was one, and its row.
    last: Option<f64>,
    last_row: Vec<f64>,
    /// The row before the events of a communication point, if it has any.
    before: Option<Vec<f64>>,
    /// The noise on recorded values, by the index of the column.
    noise: Vec<(usize, NoiseSource)>,
    pub record: Record,
}

/// Where a column has its values from.
pub enum Source {
    /// A signal, converted.
    Signal(Signal, Function),
    /// What is read of a member.
    Reading { member: usize, position: usize },
    /// An input that gets its value from a connection.
    Input { member: usize, position: usize },
}

impl Recorder {
    /// A recorder of columns with their sources. Noise on names that are missing is left out.
    pub fn new(
        scenario: &Scenario,
        columns: Vec<Column>,
        sources: Vec<Source>,
        missing: &[String],
    ) -> Result<Self> {
        Ok(Self {
            events: scenario.fmus.iter().map(|_| vec![]).collect(),
            row: vec![0.0; sources.len()],
            last: None,
            last_row: vec![0.0; sources.len()],
            before: None,
            noise: measurement_noise(scenario, &columns, missing)?,
            record: Record::new(columns),
            sources,
        })
    }

    /// The time of the last row of a communication point (s), if there is one.
    pub fn last(&self) -> Option<f64> {
        self.last
    }

    /// Keeps the row before the events of a communication point (s): what is read there, and the inputs of the step that
    /// ended.
    pub fn take_before(&mut self, time: f64, coupling: &Coupling<'_>) {
        let late = coupling.coincidence(time);
        let value = |(source, last): (&Source, &f64)| match source {
            Source::Signal(signal, conversion) => converted(signal.before(time, late), conversion),
            Source::Reading { member, position } => coupling.reading(*member, *position),
            Source::Input { .. } => *last,
        };
        self.before = Some(self.sources.iter().zip(&self.last_row).map(value).collect());
    }

    /// Records a row at a communication point (s), after those at events.
    pub fn take(&mut self, time: f64, coupling: &mut Coupling<'_>) {
        for (rows, coupled) in self.events.iter_mut().zip(&mut coupling.members) {
            *rows = coupled.instance.take_events();
        }
        let late = coupling.coincidence(time);
        for (column, (value, source)) in self.row.iter_mut().zip(&self.sources).enumerate() {
            *value = match source {
                Source::Signal(signal, conversion) => converted(signal.at_within(time, late), conversion),
                Source::Reading { member, position } => {
                    if self.record.columns()[column].is_text {
                        let texts = coupling.members[*member].instance.watched_texts(*position);
                        self.record.add_texts(column, texts);
                    }
                    coupling.reading(*member, *position)
                }
                Source::Input { member, position } => coupling.members[*member].inputs.values[*position],
            };
        }
        for (column, source) in &mut self.noise {
            self.row[*column] += source.draw();
            if let Some(before) = &mut self.before {
                before[*column] = self.row[*column];
            }
        }
        // Events of a run-in and of the start precede the record.
        if let Some(last) = self.last {
            if self.events.iter().any(|rows| !rows.is_empty()) {
                for (time, row) in self.at_events((last, time)) {
                    self.record.push_event(time, &row);
                }
            }
            if let Some(before) = &self.before {
                self.record.push_event(time, before);
            }
        }
        self.before = None;
        self.record.push(time, &self.row);
        self.last = Some(time);
        std::mem::swap(&mut self.row, &mut self.last_row);
    }

    /// The rows at the members' events between two communication points (s).
    fn at_events(&mut self, (begin, end): (f64, f64)) -> Vec<(f64, Vec<f64>)> {
        for row in self.events.iter_mut().flatten() {
            // Rounding may put them beside.
            row.time = row.time.max(begin).min(end);
        }
        let this = &*self;
        let mut times: Vec<_> = this.events.iter().flatten().map(|row| row.time).collect();
        times.sort_by(f64::total_cmp);
        times.dedup();
        let course = |column| LazyCell::new(move || this.course(column, (begin, end)));
        let courses: Vec<_> = (0..this.sources.len()).map(course).collect();
        let mut rows = vec![];
        for time in times {
            let at_time = |rows: &Vec<EventRow>| {
                let first = rows.partition_point(|row| row.time < time);
                first..rows.partition_point(|row| row.time <= time)
            };
            let at_time: Vec<_> = this.events.iter().map(|rows| &rows[at_time(rows)]).collect();
            let mut count = at_time.iter().map(|rows| rows.len()).max().unwrap_or_default();
            // A row of the communication point is the one after an event there.
            if time >= end && at_time.iter().all(|rows| rows.last().is_none_or(|row| row.is_after)) {
                count -= 1;
            }
            for index in 0..count {
                let is_before = at_time.iter().any(|rows| rows.get(index).is_some_and(|row| !row.is_after));
                let value = |(column, course): (usize, &LazyCell<_, _>)| match &this.sources[column] {
                    Source::Signal(signal, conversion) => {
                        let own =
                            if is_before { signal.before(time, rounding(time)) } else { signal.at(time) };
                        converted(own, conversion)
                    }
                    Source::Input { .. } => this.last_row[column],
                    Source::Reading { member, position } => match at_time[*member].last() {
                        Some(last) if !this.is_noisy(column) => {
                            at_time[*member].get(index).unwrap_or(last).values[*position]
                        }
                        _ => Signal::at(course, time),
                    },
                };
                rows.push((time, courses.iter().enumerate().map(value).collect::<Vec<_>>()));
            }
        }
        rows
    }

    /// Whether a column is measured with noise, at communication points only.
    fn is_noisy(&self, column: usize) -> bool {
        self.noise.iter().any(|(noisy, _)| *noisy == column)
    }

    /// The course of what is read between two communication points (s), with its member's events in between.
    fn course(&self, column: usize, (begin, end): (f64, f64)) -> Signal {
        let mut points = vec![(begin, self.last_row[column])];
        if let Source::Reading { member, position } = self.sources[column]
            && !self.is_noisy(column)
        {
            points.extend(self.events[member].iter().map(|row| (row.time, row.values[position])));
        }
        points.extend(self.before.as_ref().map(|before| (end, before[column])));
        points.push((end, self.row[column]));
        if self.record.columns()[column].is_discrete { Signal::Steps(points) } else { Signal::Lines(points) }
    }
}

/// The noise on columns; that on names which are missing is left out.
fn measurement_noise(
    scenario: &Scenario,
    columns: &[Column],
    missing: &[String],
) -> Result<Vec<(usize, NoiseSource)>> {
    let mut noise = vec![];
    for measured in &scenario.measurement_noise {
        if missing.contains(&measured.name) {
            continue;
        }
        let Some(column) = columns.iter().position(|column| column.name == measured.name) else {
            let known = columns.iter().map(|column| column.name.as_str());
            let message = format!("{} is not recorded{}", measured.name, like(&measured.name, known));
            return Err(measured.location.error(message));
        };
        if columns[column].is_text {
            return Err(measured
                .location
                .error(format!("{} is a String, which has no noise", measured.name)));
        }
        noise.push((column, NoiseSource::new(measured)?));
    }
    Ok(noise)
}
