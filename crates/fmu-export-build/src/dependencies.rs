//! Which unknown depends on which known (FMI 2.0.5, section 2.2.8).
//!
//! The JSON says of each variable what its own equation reads. Importers want the closure of that: to
//! find algebraic loops between FMUs they ask which *inputs* an output depends on, through whatever
//! stands between. Each dependency named here is one that exists, and none is left out.

use super::error::Refusal;
use super::resolve::{Role, Variable};

/// The lists of the XML's `ModelStructure`.
pub(crate) struct Structure {
    /// The outputs as functions of inputs, states and time.
    pub(crate) outputs: Vec<Unknown>,
    /// The derivatives of the states, likewise.
    pub(crate) derivatives: Vec<Unknown>,
    /// What initialization computes, as functions of inputs, exact variables and time.
    pub(crate) initial_unknowns: Vec<Unknown>,
}

/// A variable and the knowns it depends on, as ascending positions.
pub(crate) struct Unknown {
    pub(crate) variable: usize,
    pub(crate) dependencies: Vec<usize>,
}

impl Structure {
    pub(crate) fn new(variables: &[Variable]) -> Self {
        let positions = |wanted: fn(&Variable) -> bool| {
            (0..variables.len()).filter(move |&position| wanted(&variables[position]))
        };
        let in_steps = |variable| Unknown {
            variable,
            dependencies: closure(variables, variable, Variable::known_in_steps, |variable| &variable.reads),
        };
        Self {
            outputs: positions(|variable| variable.role == Role::Output).map(in_steps).collect(),
            derivatives: positions(|variable| variable.role == Role::Derivative).map(in_steps).collect(),
            initial_unknowns: positions(Variable::unknown_in_initialization)
                .map(|variable| Unknown {
                    variable,
                    dependencies: closure(
                        variables,
                        variable,
                        Variable::known_in_initialization,
                        Variable::reads_in_initialization,
                    ),
                })
                .collect(),
        }
    }
}

/// The knowns that are reached from a variable through the variables in between.
fn closure(
    variables: &[Variable],
    from: usize,
    known: fn(&Variable) -> bool,
    reads: fn(&Variable) -> &[usize],
) -> Vec<usize> {
    let mut reached = vec![false; variables.len()];
    let mut pending = reads(&variables[from]).to_vec();
    while let Some(position) = pending.pop() {
        if !reached[position] {
            reached[position] = true;
            if !known(&variables[position]) {
                pending.extend_from_slice(reads(&variables[position]));
            }
        }
    }
    (0..variables.len()).filter(|&position| reached[position] && known(&variables[position])).collect()
}

/// Refuses variables that read each other in a circle without a state in between: no order of the
/// equations computes them. (In initialization states may be solved for together, so a circle through
/// `initial_reads` is a system of equations and allowed.)
pub(crate) fn refuse_cycles(variables: &[Variable]) -> Result<(), Refusal> {
    let mut finished = vec![false; variables.len()];
    for position in 0..variables.len() {
        if let Some(cycle) = find_cycle(variables, position, &mut Vec::new(), &mut finished) {
            let names: Vec<_> = cycle.iter().map(|&position| variables[position].name.as_str()).collect();
            let reason = format!("it reads itself: {} -> {}", names.join(" -> "), names[0]);
            return Err(Refusal::of(names[0], reason));
        }
    }
    Ok(())
}

/// Searches in depth; `path` holds the variables between the first one and this one.
fn find_cycle(
    variables: &[Variable],
    position: usize,
    path: &mut Vec<usize>,
    finished: &mut [bool],
) -> Option<Vec<usize>> {
    if let Some(start) = path.iter().position(|&passed| passed == position) {
        return Some(path[start..].to_vec());
    }
    if !finished[position] {
        path.push(position);
        let reads = &variables[position].reads;
        let found = reads.iter().find_map(|&read| find_cycle(variables, read, path, finished));
        if found.is_some() {
            return found;
        }
        path.pop();
        finished[position] = true;
    }
    None
}
