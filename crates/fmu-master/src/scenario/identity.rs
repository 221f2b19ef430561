//! What the results of a scenario depend on.
//!
//! Each struct is taken apart without `..`, so that a new field does not compile until it is decided.

use std::collections::BTreeMap;

use anyhow::Result;
use fmu_io::reading::digest;
use fmu_package::connection;
use fmu_terms::Interface;

use super::{Assignment, Input, Member, Noise, Recorded, RunIn, Scenario};

/// Everything that results depend on, by name: a value that differs names what has changed.
pub type Identity = BTreeMap<String, String>;

impl Scenario {
    /// Everything that the results of a run depend on. An FMU's file counts by its content.
    ///
    /// # Errors
    /// When an FMU's file cannot be read.
    pub fn identity(&self) -> Result<Identity> {
        let Self {
            step,
            start_time,
            stop_time,
            tolerance,
            stepping,
            fmus,
            inputs,
            connections,
            noise,
            measurement_noise,
            record,
            // Of documents and plots.
            title: _,
            description: _,
            panels: _,
            // They follow from the times.
            steps: _,
            rest: _,
            // It makes notes of what would be errors.
            has_replaced_fmus: _,
            // Their contents are in the other fields.
            files: _,
        } = self;
        let mut identity = Identity::new();
        let mut set = |name: String, value: String| identity.insert(name, value);
        set("scenario's step".into(), format!("{step:?}"));
        set("scenario's start_time".into(), format!("{start_time:?}"));
        set("scenario's stop_time".into(), format!("{stop_time:?}"));
        set("scenario's tolerance".into(), format!("{tolerance:?}"));
        set("scenario's stepping".into(), format!("{stepping:?}"));
        let order: Vec<_> = fmus.iter().map(|member| member.name.as_str()).collect();
        set("scenario's FMUs".into(), order.join(", "));
        if let Some(connections) = connections {
            set("scenario's connections".into(), connection::in_line(connections));
        }
        if let Some(record) = record {
            let names = record.iter().map(|Recorded { name, location: _ }| name.as_str());
            set("scenario's record".into(), names.collect::<Vec<_>>().join(", "));
        }
        for (key, noises) in [("noise", noise), ("measurement_noise", measurement_noise)] {
            for Noise { name, standard_deviation, seed, location: _ } in noises {
                set(format!("scenario's {key}.{name}"), format!("{standard_deviation:?}, seed {seed}"));
            }
        }
        identity.extend(of_inputs("scenario", inputs));
        for member in fmus {
            identity.extend(member.identity()?);
        }
        Ok(identity)
    }
}

impl Member {
    fn identity(&self) -> Result<Identity> {
        let Self { name, file, interface, returns_early, parameters, values, run_in, inputs, location: _ } =
            self;
        let mut identity = of_inputs(name, inputs);
        identity.insert(format!("SHA-256 of {name}'s file"), digest(file)?);
        identity.insert(
            format!("{name}'s interface"),
            interface.map_or("the default", Interface::name).to_owned(),
        );
        identity.insert(format!("{name}'s early return"), returns_early.to_string());
        for (index, (set, _)) in parameters.iter().enumerate() {
            identity.insert(format!("{name}'s parameter set {}", index + 1), format!("{set:?}"));
        }
        identity.extend(of_values(&format!("{name}'s "), values));
        if let Some(RunIn { duration, during, after, steps: _ }) = run_in {
            identity.insert(format!("{name}'s run_in.duration"), format!("{duration:?}"));
            identity.extend(of_values(&format!("{name}'s run_in.during."), during));
            identity.extend(of_values(&format!("{name}'s run_in.after."), after));
        }
        Ok(identity)
    }
}

fn of_values(prefix: &str, values: &[Assignment]) -> Identity {
    let of = |Assignment { name, value, location: _ }: &Assignment| {
        (format!("{prefix}{name}"), format!("{value:?}"))
    };
    values.iter().map(of).collect()
}

fn of_inputs(owner: &str, inputs: &[Input]) -> Identity {
    let of = |Input { name, course, location: _ }: &Input| {
        (format!("{owner}'s inputs.{name}"), format!("{course:?}"))
    };
    inputs.iter().map(of).collect()
}
