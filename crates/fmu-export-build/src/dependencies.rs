//! The dependencies of unknowns on knowns (FMI 2.0.5, section 2.2.8).
//!
//! The declaration lists what the equation of each variable reads. Importers need the closure: to find algebraic loops
//! between FMUs, they ask on which *inputs* an output depends, through all intermediate variables. If an equation does
//! not declare its reads, the closure is everything.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::rc::Rc;

use fmu_terms::Causality;
use fmu_terms::Version;

use crate::error::{Refusal, Refusals};
use crate::model::{Place, Reads, Scalar};

/// The lists of the XML's `ModelStructure`.
pub(crate) struct Structure {
    /// The outputs as functions of inputs, states and time.
    pub(crate) outputs: Vec<Unknown>,
    /// The derivatives of the states, as functions of inputs, states and time.
    pub(crate) derivatives: Vec<Unknown>,
    /// The clocked states, as functions of inputs, states and time.
    pub(crate) clocked_states: Vec<Unknown>,
    /// What initialization computes, as functions of inputs, exact variables and time.
    pub(crate) initial_unknowns: Vec<Unknown>,
}

/// A variable and the knowns on which it depends, as ascending positions; none if it may depend on all.
pub(crate) struct Unknown {
    pub(crate) scalar: usize,
    pub(crate) dependencies: Closure,
}

/// The most reads to follow, and the most dependencies to list: no model may take minutes to build. What the elements of an
/// array read alike is followed once.
pub(crate) const MOST: usize = 2_000_000;

/// The error for the variable at which there are more reads than [`MOST`].
pub(crate) fn too_many(scalar: &Scalar) -> String {
    format!("{}: following all reads up to here takes more than {MOST} steps; omit some", scalar.name)
}

impl Structure {
    pub(crate) fn new(scalars: &[Scalar], version: Version) -> Result<Self, Refusal> {
        let in_steps = closures(scalars, known_in_steps(version), |scalar| &scalar.reads.in_steps, "reads")?;
        let in_initialization = closures(
            scalars,
            Scalar::known_in_initialization,
            |scalar| &scalar.reads.in_initialization,
            "initial_reads",
        )?;
        let unknowns = |wanted: fn(&Scalar) -> bool, closures: &[Closure]| {
            let wanted = scalars.iter().zip(closures).enumerate().filter(|(_, (scalar, _))| wanted(scalar));
            wanted.map(|(scalar, (_, closure))| Unknown { scalar, dependencies: closure.clone() }).collect()
        };
        Ok(Self {
            outputs: unknowns(|scalar| scalar.causality == Causality::Output, &in_steps),
            derivatives: unknowns(|scalar| scalar.place == Place::Derivatives, &in_steps),
            clocked_states: unknowns(|scalar| scalar.clocked.previous.is_some(), &in_steps),
            initial_unknowns: unknowns(Scalar::unknown_in_initialization, &in_initialization),
        })
    }
}

/// Whether a variable is given between steps: in FMI 3.0 an unknown also depends on parameters and discrete-time states
/// (section 2.4.8).
pub(crate) fn known_in_steps(version: Version) -> fn(&Scalar) -> bool {
    match version {
        Version::Two => Scalar::known_in_steps,
        Version::Three => |scalar| {
            scalar.known_in_steps() || scalar.place == Place::Parameters || scalar.clocked.is_previous
        },
    }
}

/// The knowns reached from a variable through intermediate variables, as ascending positions; none if it may depend on
/// all.
pub(crate) type Closure = Option<Rc<[usize]>>;

/// The lists of several variables, such as the elements of an array, once where consecutive ones share theirs; none if one
/// may depend on all.
pub(crate) fn lists<'c>(closures: impl IntoIterator<Item = &'c Closure>) -> Option<Vec<&'c [usize]>> {
    let mut lists: Vec<_> = closures.into_iter().map(Option::as_deref).collect::<Option<_>>()?;
    lists.dedup_by_key(|list| list.as_ptr());
    Some(lists)
}

/// Each variable's closure. A state that is an output depends on itself.
fn closures(
    scalars: &[Scalar],
    known: fn(&Scalar) -> bool,
    reads: fn(&Scalar) -> &Reads,
    list: &str,
) -> Result<Vec<Closure>, Refusal> {
    let of = |position: usize| match &scalars[position] {
        scalar if known(scalar) => Some(&[][..]),
        scalar => reads(scalar).as_deref(),
    };
    let mut closures: Vec<Closure> = vec![None; scalars.len()];
    // Equal closures are shared, such as those of variables with the same reads.
    let mut distinct: BTreeSet<Rc<[usize]>> = BTreeSet::new();
    // The closures of lists that several variables share, by where these lists are.
    let mut of_lists: BTreeMap<*const usize, Closure> = BTreeMap::new();
    let (mut last, mut steps) = (vec![0; scalars.len()], 0);
    for (number, circle) in
        circles(scalars.len(), |position| of(position).unwrap_or_default()).iter().enumerate()
    {
        let shared = match circle[..] {
            [member] if !known(&scalars[member]) => of(member).map(<[usize]>::as_ptr),
            _ => None,
        };
        if let Some(closure) = shared.and_then(|list| of_lists.get(&list)) {
            closures[circle[0]].clone_from(closure);
            continue;
        }
        // Each known once: `last` holds the circle for which it was added, counted from 1.
        let mut add = |position: usize, reached: &mut Vec<usize>| {
            if std::mem::replace(&mut last[position], number + 1) != number + 1 {
                reached.push(position);
            }
        };
        let (mut reached, mut sources) = (Vec::new(), BTreeSet::new());
        let is_open = circle.iter().any(|&member| {
            let Some(reads) = of(member) else { return true };
            if known(&scalars[member]) {
                add(member, &mut reached);
            }
            let outside = reads.iter().filter(|read| circle.binary_search(read).is_err());
            outside.map(|&read| closures[read].as_ref()).any(|closure| match closure {
                Some(closure) if sources.insert(closure.as_ptr()) => {
                    steps += closure.len();
                    closure.iter().for_each(|&position| add(position, &mut reached));
                    false
                }
                closure => closure.is_none(),
            })
        });
        if steps > MOST {
            let scalar = &scalars[circle[0]];
            return Err(Refusal::new(format!("{}.{list}", scalar.key), too_many(scalar)));
        }
        if !is_open {
            reached.sort_unstable();
            let closure = distinct.get(reached.as_slice()).cloned().unwrap_or_else(|| reached.into());
            distinct.insert(Rc::clone(&closure));
            for &member in circle {
                closures[member] = Some(Rc::clone(&closure));
            }
        }
        if let Some(list) = shared {
            of_lists.insert(list, closures[circle[0]].clone());
        }
    }
    Ok(closures)
}

/// Tarjan's strongly connected components: sets of variables that read each other in circles, and every other variable
/// by itself. A component follows all that it reads; its variables are in ascending order.
fn circles<'r>(count: usize, reads: impl Fn(usize) -> &'r [usize]) -> Vec<Vec<usize>> {
    const NOT_SEEN: usize = usize::MAX;
    let (mut circles, mut open, mut seen) = (Vec::new(), Vec::new(), 0);
    // When each was first seen, and the earliest open one reachable from it.
    let (mut first, mut earliest, mut is_open) = (vec![NOT_SEEN; count], vec![0; count], vec![false; count]);
    // The lists of which nothing is open any more: another variable with one need not look at it.
    let mut closed = BTreeSet::new();
    for start in 0..count {
        let mut path = if first[start] == NOT_SEEN { vec![(start, 0)] } else { Vec::new() };
        while let Some((position, next)) = path.last_mut() {
            let position = *position;
            if *next == 0 {
                (first[position], earliest[position], is_open[position]) = (seen, seen, true);
                open.push(position);
                seen += 1;
            }
            let list = reads(position);
            if let Some(&read) = list.get(*next).filter(|_| *next > 0 || !closed.contains(&list.as_ptr())) {
                *next += 1;
                if first[read] == NOT_SEEN {
                    path.push((read, 0));
                } else if is_open[read] {
                    earliest[position] = earliest[position].min(first[read]);
                }
                continue;
            }
            path.pop();
            if let Some(&(reader, _)) = path.last() {
                earliest[reader] = earliest[reader].min(earliest[position]);
            }
            if earliest[position] == first[position] {
                let begin = open.iter().rposition(|&other| other == position).unwrap_or(0);
                let mut circle = open.split_off(begin);
                for &member in &circle {
                    is_open[member] = false;
                }
                circle.sort_unstable();
                if circle.len() == 1 {
                    closed.insert(list.as_ptr());
                }
                circles.push(circle);
            }
        }
    }
    circles
}

/// Rejects variables that read each other in a circle without a state in between, because no order of the equations
/// computes them. (Initialization may solve for states simultaneously, so a circle through `initial_reads` is a valid
/// system of equations.)
pub(crate) fn refuse_cycles(scalars: &[Scalar], refusals: &mut Refusals) {
    let reads = |position: usize| scalars[position].reads.in_steps.as_deref().unwrap_or_default();
    let circles = circles(scalars.len(), reads).into_iter();
    let first = circles.filter(|circle| circle.len() > 1 || reads(circle[0]).contains(&circle[0])).min();
    let Some(circle) = first else { return };
    // The shortest path from its first variable back to it, by readers.
    let (mut reader, mut pending) = (BTreeMap::new(), VecDeque::from([circle[0]]));
    while let Some(position) = pending.pop_front().filter(|_| !reader.contains_key(&circle[0])) {
        for read in reads(position).iter().filter(|read| circle.binary_search(read).is_ok()) {
            reader.entry(*read).or_insert_with(|| {
                pending.push_back(*read);
                position
            });
        }
    }
    let mut way = vec![circle[0]];
    while way.len() == 1 || way[way.len() - 1] != circle[0] {
        way.push(reader[&way[way.len() - 1]]);
    }
    let names: Vec<_> = way.iter().rev().map(|&position| scalars[position].name.as_str()).collect();
    let reason = format!("{} reads itself: {}", names[0], names.join(" -> "));
    refusals.add(format!("{}.reads", scalars[circle[0]].key), reason);
}
