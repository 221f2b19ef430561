//! Checks the dependencies in a model's JSON against its equations.

use core::fmt;
use std::collections::{BTreeMap, BTreeSet};

use fmu_solve::{Dual, Error};

use crate::kinds::{Fmu, Model};
use crate::model::context::{Context, Experiment};
use crate::model::description::{Causality, DataType, Dependencies, Name, ValueReference};
use crate::model::resources::Resources;
use crate::model::variables::{Accessed as _, Described as _, Numbered as _};
use crate::panics;

/// The number of points at which derivatives are evaluated.
const POINTS: usize = 20;
/// The most groups of knowns at a point: a prime above the number of points.
const MOST_GROUPS: usize = 61;

/// Tests that a model's Real outputs and derivatives depend only on the inputs and states that its JSON lists
/// (`reads`), and on the time only where it lists `time`. Importers use these dependencies to find algebraic loops; an
/// undeclared one hides a loop. The built-in integrator takes equations that list no `time` for independent of it.
///
/// Initializes the model with the resources of its package, and evaluates its directional derivatives around the values of
/// `variables`: inputs and states shifted by up to their nominal values or magnitudes, at the start time and, for the
/// dependence on it, at times of the default experiment. A dependency that is zero at all points goes unnoticed. If there are more than 61 inputs and states, several are moved at once.
///
/// # Errors
/// The first undeclared dependency, a failed initialization, or a model without derivatives.
pub fn check_dependencies<F: Fmu>(variables: &<F::Model as Model>::Variables) -> Result<(), Error> {
    check::<F::Model>(variables)
}

fn check<M: Model>(variables: &M::Variables) -> Result<(), Error> {
    let (mut model, mut variables) = (M::default(), variables.clone());
    let resources = Resources::of::<M::Variables>();
    let mut silence = |_: &'static str, _: fmt::Arguments<'_>| {};
    let mut context = Context::new(Experiment::default(), &mut silence).with_resources(&resources);
    model.initialize(&mut variables, &mut context)?;
    let reals = M::Variables::described().filter(|(_, variable)| {
        variable.data_type == DataType::Real
            && (variable.real_input().is_some() || variable.state().is_some())
    });
    let knowns: Vec<_> = reals.map(|(reference, _)| reference).collect();
    let declared = M::Variables::DEPENDENCIES.iter().flat_map(Dependencies::each);
    let is_state =
        |unknown| M::Variables::description(unknown).is_some_and(|unknown| unknown.state().is_some());
    let declared: BTreeMap<_, BTreeSet<_>> = declared
        .filter(|(unknown, _)| !is_state(*unknown))
        .map(|(unknown, knowns)| (unknown, knowns.collect()))
        .collect();
    let time = M::Variables::described().find(|(_, variable)| variable.causality == Causality::Independent);
    let time = time.map(|(reference, _)| reference);
    let [begin, end] = default_experiment(M::Variables::MODEL_DESCRIPTION_XML);
    for point in 0..POINTS {
        let mut variables = variables.clone();
        for (number, &known) in knowns.iter().enumerate() {
            let value = variables.real(known);
            let share = fraction(point * knowns.len() + number);
            variables.set_real(known, value + share * if value == 0.0 { 1.0 } else { 0.1 * value });
        }
        variables.states_from_start();
        let at = Dual::new(begin + fraction(point) * (end - begin), 1.0);
        // The equations need not be valid at all times with these values.
        let by_time = panics::attempt(|| model.differentiate(at, &variables, &M::Variables::zero()));
        if let Some(by_time) = by_time.transpose()? {
            let mut undeclared = declared.iter().filter(|(unknown, declared)| {
                let slope = by_time.real(**unknown);
                slope != 0.0 && slope.is_finite() && !time.is_some_and(|time| declared.contains(&time))
            });
            if let Some((unknown, _)) = undeclared.next() {
                let unknown = name::<M>(*unknown);
                return Err(Error::new(format!("{unknown} depends on time, which its 'reads' omit")));
            }
        }
        // The first unknown that changes with some knowns although it declares none of them.
        let first_undeclared = |group: &[ValueReference]| {
            let mut direction = M::Variables::zero();
            for (&known, number) in group.iter().zip(1..) {
                // Different rates, so that opposite effects do not cancel.
                direction.set_real(known, f64::from(number).sqrt());
            }
            let time = Dual::default();
            let derivatives = model.differentiate(time, &variables, &direction)?;
            let mut undeclared = declared.iter().filter(|(unknown, declared)| {
                derivatives.real(**unknown) != 0.0 && !group.iter().any(|known| declared.contains(known))
            });
            Ok::<_, Error>(undeclared.next().map(|(unknown, _)| *unknown))
        };
        for group in groups(&knowns, point) {
            if first_undeclared(&group)?.is_none() {
                continue;
            }
            for known in group {
                if let Some(unknown) = first_undeclared(&[known])? {
                    return Err(Error::new(format!(
                        "{} depends on {}, which its 'reads' omit",
                        name::<M>(unknown),
                        name::<M>(known)
                    )));
                }
            }
        }
    }
    Ok(())
}

/// A low-discrepancy sequence between 0 and 1: fractional parts of multiples of the golden ratio.
fn fraction(number: usize) -> f64 {
    (0.618_033_988_749_895 * number as f64).fract()
}

/// Start and end of the default experiment (s) in a model description; the standard's default is a second.
fn default_experiment(xml: &str) -> [f64; 2] {
    let experiment = xml.split_once("<DefaultExperiment ").and_then(|(_, rest)| rest.split_once('>'));
    let attribute = |name: &str| {
        let (_, rest) = experiment?.0.split_once(name)?.1.split_once('"')?;
        rest.split_once('"')?.0.parse::<f64>().ok()
    };
    let begin = attribute("startTime").unwrap_or(0.0);
    [begin, attribute("stopTime").unwrap_or(begin + 1.0)]
}

/// The knowns that are moved together at a point. Any two are together at few points only, so that a known that an
/// unknown declares hides an undeclared one at these points only.
fn groups(knowns: &[ValueReference], point: usize) -> Vec<Vec<ValueReference>> {
    let mut groups = vec![Vec::new(); knowns.len().min(MOST_GROUPS)];
    for (number, &known) in knowns.iter().enumerate() {
        // A polynomial of the point, whose coefficients are the number's digits: two are equal at two points at most.
        let [ones, tens, hundreds] =
            [1, MOST_GROUPS, MOST_GROUPS.pow(2)].map(|unit| number / unit % MOST_GROUPS);
        let group = (ones + point * (tens + point * hundreds)) % MOST_GROUPS;
        groups[group].push(known);
    }
    groups
}

fn name<M: Model>(reference: ValueReference) -> Name {
    M::Variables::description(reference).expect("it is declared").name()
}
