//! Which unknown depends on which known (FMI 2.0.5, section 2.2.8).
//!
//! The declaration says of each variable what its own equation reads. Importers want the closure of that: to find
//! algebraic loops between FMUs they ask which *inputs* an output depends on, through all variables between. Where an
//! equation does not say what it reads, the closure is everything.

use crate::declaration::Causality;
use crate::error::Refusals;
use crate::interfaces::Version;
use crate::model::{Place, Reads, Scalar};

/// The lists of the XML's `ModelStructure`.
pub(crate) struct Structure {
    /// The outputs as functions of inputs, states and time.
    pub(crate) outputs: Vec<Unknown>,
    /// The derivatives of the states, likewise.
    pub(crate) derivatives: Vec<Unknown>,
    /// The clocked states, likewise.
    pub(crate) clocked_states: Vec<Unknown>,
    /// What initialization computes, as functions of inputs, exact variables and time.
    pub(crate) initial_unknowns: Vec<Unknown>,
}

/// A variable and the knowns it depends on, as ascending positions; none where it may depend on each.
pub(crate) struct Unknown {
    pub(crate) scalar: usize,
    pub(crate) dependencies: Option<Vec<usize>>,
}

impl Structure {
    /// In FMI 3.0 an unknown depends on parameters and discrete-time states as well (section 2.4.8).
    pub(crate) fn new(scalars: &[Scalar], version: Version) -> Self {
        let known_in_steps: fn(&Scalar) -> bool = match version {
            Version::Two => Scalar::known_in_steps,
            Version::Three => {
                |scalar| scalar.known_in_steps() || scalar.place == Place::Parameters || scalar.is_previous
            }
        };
        let unknowns = |wanted: fn(&Scalar) -> bool,
                        known: fn(&Scalar) -> bool,
                        reads: fn(&Scalar) -> &Reads| {
            let wanted = (0..scalars.len()).filter(|&position| wanted(&scalars[position]));
            let unknown = |scalar| Unknown { scalar, dependencies: closure(scalars, scalar, known, reads) };
            wanted.map(unknown).collect()
        };
        let in_steps = |wanted| unknowns(wanted, known_in_steps, |scalar| &scalar.reads);
        Self {
            outputs: in_steps(|scalar| scalar.causality == Some(Causality::Output)),
            derivatives: in_steps(|scalar| scalar.place == Place::Derivatives),
            clocked_states: in_steps(|scalar| scalar.previous.is_some()),
            initial_unknowns: unknowns(
                Scalar::unknown_in_initialization,
                Scalar::known_in_initialization,
                |scalar| &scalar.initial_reads,
            ),
        }
    }
}

/// The knowns that are reached from a variable through the variables in between. A state that is an output
/// depends on itself.
fn closure(
    scalars: &[Scalar],
    from: usize,
    known: fn(&Scalar) -> bool,
    reads: fn(&Scalar) -> &Reads,
) -> Option<Vec<usize>> {
    let mut reached = vec![false; scalars.len()];
    let mut pending = vec![from];
    while let Some(position) = pending.pop() {
        if known(&scalars[position]) {
            reached[position] = true;
            continue;
        }
        for &read in reads(&scalars[position]).as_ref()? {
            if !reached[read] {
                reached[read] = true;
                pending.push(read);
            }
        }
    }
    Some((0..scalars.len()).filter(|&position| reached[position] && known(&scalars[position])).collect())
}

/// Refuses variables that read each other in a circle without a state in between: no order of the
/// equations computes them. (In initialization states may be solved for together, so a circle through
/// `initial_reads` is a system of equations and allowed.)
pub(crate) fn refuse_cycles(scalars: &[Scalar], refusals: &mut Refusals) {
    let mut finished = vec![false; scalars.len()];
    for position in 0..scalars.len() {
        if let Some(cycle) = find_cycle(scalars, position, &mut Vec::new(), &mut finished) {
            let names: Vec<_> = cycle.iter().map(|&position| scalars[position].name.as_str()).collect();
            let reason = format!("{} reads itself: {} -> {}", names[0], names.join(" -> "), names[0]);
            return refusals.add(format!("{}.reads", scalars[cycle[0]].key), reason);
        }
    }
}

/// Searches in depth; `path` holds the variables between the first one and this one.
fn find_cycle(
    scalars: &[Scalar],
    position: usize,
    path: &mut Vec<usize>,
    finished: &mut [bool],
) -> Option<Vec<usize>> {
    if let Some(start) = path.iter().position(|&passed| passed == position) {
        return Some(path[start..].to_vec());
    }
    if !finished[position] {
        path.push(position);
        let reads = scalars[position].reads.iter().flatten();
        let found = reads.copied().find_map(|read| find_cycle(scalars, read, path, finished));
        if found.is_some() {
            return found;
        }
        path.pop();
        finished[position] = true;
    }
    None
}
