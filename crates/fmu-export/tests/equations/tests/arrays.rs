//! Arrays in generated Rust: a field each, large ones on the heap, whose elements the runtime reaches by rule.

// Values are handed through, not computed: they are equal, not close.
#![allow(clippy::float_cmp)]

use std::collections::BTreeMap;

use fmu_export::description::{ScalarVariable, ValueReference};
use fmu_export::{
    Accessed as _, Described as _, Equations, Inputs as _, Integrated, Model as _, Number, Numbered as _,
    Persistent, Simulation, check_dependencies,
};
use fmu_export_equations::field::{Evaluation, Inputs, States, Variables};
use fmu_export_equations::{Field, decay, gears, van_der_pol};

fn reference(name: &str) -> ValueReference {
    Variables::described().find(|(_, variable)| variable.name() == name).expect("it is described").0
}

/// An importer's thread may have 1 MB of stack, where variables are several times, with derivatives.
#[test]
fn large_arrays_are_not_on_the_stack() {
    assert!(size_of::<Variables>() < 1024, "{} bytes", size_of::<Variables>());
    let variables = Variables::default();
    let parts: [&[f64]; 3] =
        [&variables.states.x[..], &variables.inputs.heat[..], variables.parameters.weight.as_flattened()];
    for (part, start) in parts.into_iter().zip([1.0, 0.5, 0.25]) {
        assert!(part.len() == 300 && part.iter().all(|&value| value == start));
    }
    assert!(variables.parameters.label.iter().all(|label| label == "none"));
    assert_eq!(variables.states.grid, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
    assert_eq!(States::COUNT, 307);
}

/// A value reference is found beside whichever was found before, and those that need no search have the type.
#[test]
fn variables_are_found_near_others_as_alone() {
    let described: BTreeMap<_, _> = Variables::described().collect();
    let end = described.keys().max().expect("there are variables") + 3;
    let positions = Variables::DESCRIPTION.variables.len();
    for reference in 0..end {
        let expected = described.get(&reference).map(|variable| variable.name().to_string());
        for position in 0..positions {
            let found = Variables::description_near(reference, &mut position.clone());
            assert_eq!(found.map(|found| found.name().to_string()), expected, "{reference} near {position}");
        }
    }
    let of_one_type = (0..positions).map(Variables::of_one_type);
    let mut searchless = 0;
    for (position, references) in of_one_type.enumerate() {
        let data_type = Variables::DESCRIPTION.variables[position].data_type;
        searchless += references.len();
        for reference in references {
            assert_eq!(described[&reference].data_type, data_type, "{reference} near {position}");
        }
    }
    // `heat`, `weight`, `label`, `row`, `warm`; `x` and `grid` with their derivatives; time, `gain`, `last` and its derivative.
    assert_eq!(searchless, 300 + 300 + 300 + 2 + 3 + 2 * 300 + 2 * 6 + 4);
}

/// The parts of a variable in order of declaration, states alternating with their derivatives.
#[test]
fn value_references_and_names_follow_by_rule() {
    let mut names = vec!["time".to_owned()];
    let list = |name: &str| (1..=300).map(|i| format!("{name}[{i}]")).collect::<Vec<_>>();
    let table = |name: &str, rows: usize, columns: usize| -> Vec<_> {
        (1..=rows)
            .flat_map(|i| (1..=columns).map(move |j| (i, j)))
            .map(|(i, j)| format!("{name}[{i},{j}]"))
            .collect()
    };
    let with_derivatives =
        |names: Vec<String>| names.into_iter().flat_map(|name| [name.clone(), format!("der({name})")]);
    names.extend(list("heat"));
    names.push("gain".to_owned());
    names.extend(table("weight", 20, 15));
    names.extend(list("label"));
    names.extend(with_derivatives(list("x")));
    names.extend(with_derivatives(table("grid", 2, 3)));
    names.extend(
        ["last", "der(last)", "row[1]", "row[2]", "warm[1]", "warm[2]", "warm[3]"].map(str::to_owned),
    );
    for (reference, name) in (0..).zip(&names) {
        let found = Variables::description(reference).expect("it is described").name();
        assert!(found == *name, "{reference} is {found}, not {name}");
        let text = format!(r#"<ScalarVariable name="{name}" valueReference="{reference}""#);
        assert!(Variables::MODEL_DESCRIPTION_XML.contains(&text), "{text}");
    }
    let count = ValueReference::try_from(names.len()).unwrap();
    assert!(Variables::description(count).is_none() && Variables::description(u32::MAX).is_none());
    let mut described: Vec<_> = Variables::described().map(|(reference, _)| reference).collect();
    described.sort_unstable();
    assert!(described.into_iter().eq(0..count));
    // In FMI 2.0 each element is a variable.
    assert!(
        Variables::elements(reference("x[7]"))
            .is_some_and(|mut elements| elements.next() == Some(reference("x[7]")))
    );
}

#[test]
fn accessors_reach_each_element() {
    let mut variables = Variables::default();
    for i in 0..300 {
        let number = f64::from(u16::try_from(i).unwrap());
        variables.set_real(reference(&format!("heat[{}]", i + 1)), 1000.0 + number);
        variables.set_real(reference(&format!("weight[{},{}]", i / 15 + 1, i % 15 + 1)), 2000.0 + number);
        variables.set_string(reference(&format!("label[{}]", i + 1)), &i.to_string());
        variables.set_real(reference(&format!("x[{}]", i + 1)), 3000.0 + number);
        variables.derivatives.x[i] = 4000.0 + number;
    }
    variables.set_real(reference("grid[2,3]"), 9.0);
    assert_eq!((variables.states.grid[1][2], variables.start.grid[1][2]), (6.0, 9.0));
    assert_eq!((variables.states.x[299], variables.start.x[299]), (1.0, 3299.0));
    variables.states_from_start();
    for i in 0..300 {
        let number = f64::from(u16::try_from(i).unwrap());
        assert_eq!(variables.inputs.heat[i], 1000.0 + number);
        assert_eq!(variables.parameters.weight[i / 15][i % 15], 2000.0 + number);
        assert_eq!(variables.parameters.label[i], i.to_string());
        assert_eq!(variables.string(reference(&format!("label[{}]", i + 1))), i.to_string());
        assert_eq!(variables.real(reference(&format!("x[{}]", i + 1))), 3000.0 + number);
        assert_eq!(variables.real(reference(&format!("der(x[{}])", i + 1))), 4000.0 + number);
    }
    // A state alone, not its start value.
    variables.set_state(reference("x[5]"), -1.0);
    assert_eq!((variables.states.x[4], variables.start.x[4]), (-1.0, 3004.0));
    assert_eq!(variables.first_beyond(), Some((4, -1.0)));
}

#[test]
fn states_and_inputs_are_numbered_by_rule() {
    let variables = Variables::default();
    let mut states = Vec::new();
    Variables::each_state(&variables, |state, value: f64| states.push((state, value)));
    assert!(states.iter().map(|(state, _)| *state).eq(0..307));
    assert_eq!(
        states[298..],
        [1.0, 1.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0].map({
            let mut state = 297;
            move |value| {
                state += 1;
                (state, value)
            }
        })
    );
    for (state, name) in [(0, "x[1]"), (299, "x[300]"), (300, "grid[1,1]"), (305, "grid[2,3]"), (306, "last")]
    {
        assert_eq!(Variables::state_name(state), name);
        assert_eq!(Variables::description(reference(name)).and_then(ScalarVariable::state), Some(state));
    }
    let mut moved = variables.clone();
    Variables::set_states(&mut moved, |state| state as f64);
    assert_eq!(
        (moved.states.x[299], moved.states.grid, moved.states.last),
        (299.0, [[300.0, 301.0, 302.0], [303.0, 304.0, 305.0]], 306.0)
    );
    assert_eq!(Variables::STATE_NOMINALS.len(), 307);
    assert_eq!([0, 299, 300, 306].map(|state| Variables::STATE_NOMINALS[state]), [10.0, 10.0, 1.0, 1.0]);

    assert_eq!(Inputs::REALS.len(), 301);
    assert_eq!([0, 299, 300].map(|input| Inputs::REALS[input].min), [0.0, 0.0, f64::NEG_INFINITY]);
    let mut inputs = variables.inputs.clone();
    inputs.set_reals(|input| input as f64);
    assert_eq!(
        (inputs.heat[299], inputs.gain, inputs.real(299), inputs.real(300)),
        (299.0, 300.0, 299.0, 300.0)
    );
}

#[test]
fn an_element_that_is_not_finite_is_found() {
    let mut variables = Variables::default();
    variables.outputs.row[1] = f64::NAN;
    assert_eq!(variables.first_non_finite(), Some(reference("row[2]")));
    variables.derivatives.x[298] = f64::INFINITY;
    assert_eq!(variables.first_non_finite(), Some(reference("der(x[299])")));
    variables.states.grid[1][0] = f64::NAN;
    assert_eq!(variables.first_non_finite(), Some(reference("grid[2,1]")));
    for i in 0..300 {
        let mut variables = Variables::default();
        assert_eq!(variables.first_non_finite(), None);
        variables.states.x[i] = f64::NAN;
        assert_eq!(variables.first_non_finite(), Some(reference(&format!("x[{}]", i + 1))));
    }
}

/// A saved state is restored without a new allocation.
#[test]
fn copies_reuse_their_memory() {
    let (mut variables, mut other) = (Variables::default(), Variables::default());
    other.states.x[3] = 5.0;
    let before = variables.states.x.as_ptr();
    variables.clone_from(&other);
    assert_eq!((variables.states.x.as_ptr(), variables), (before, other));
}

/// By hand from the JSON: the rows, and what each reads. Those of an array's inner elements are one entry.
#[test]
fn dependencies_are_those_of_each_element() {
    let name = |reference| Variables::description(reference).unwrap().name().to_string();
    let mut found = BTreeMap::new();
    for dependencies in Variables::DEPENDENCIES {
        for number in 0..dependencies.count {
            let knowns = dependencies.knowns.iter().flat_map(|knowns| {
                (0..knowns.count).map(|known| knowns.first + number * knowns.stride + known * knowns.step)
            });
            let mut knowns: Vec<_> = knowns.map(name).collect();
            knowns.sort_unstable();
            assert!(
                found.insert(name(dependencies.unknown + number * dependencies.stride), knowns).is_none()
            );
        }
    }
    let reads = |unknown: &str| found[unknown].join(" ");
    assert_eq!(reads("der(x[1])"), "gain heat[1] x[1] x[2]");
    assert_eq!(reads("der(x[150])"), "gain heat[150] x[149] x[150] x[151]");
    assert_eq!(reads("der(x[300])"), "gain heat[300] x[299] x[300]");
    assert_eq!(reads("der(grid[2,3])"), "grid[2,1] grid[2,2] grid[2,3] x[4]");
    assert_eq!(reads("der(last)"), "x[300]");
    // Parameters are none of FMI 2.0's knowns.
    assert_eq!((reads("row[2]"), reads("grid[1,2]")), ("grid[2,2]".to_owned(), "grid[1,2]".to_owned()));
    assert_eq!(found.len(), 300 + 6 + 6 + 1 + 2);
    assert!(Variables::DEPENDENCIES.len() < 15, "{}", Variables::DEPENDENCIES.len());
}

/// The equations' own dependencies, by dual numbers.
#[test]
fn equations_depend_on_what_is_declared() {
    check_dependencies::<Integrated<Field>>(&Variables::default()).expect("the declaration is right");
    let mut simulation = Simulation::<Integrated<Field>>::default();
    simulation.initialize().unwrap();
    let mut direction = Variables::zero();
    direction.start.x[9] = 1.0;
    let Simulation { model, variables, .. } = &simulation;
    let derivatives = model.differentiate(fmu_export::Dual::default(), variables, &direction).unwrap();
    let expected: [f64; 300] = std::array::from_fn(|i| match i {
        8 | 10 => 2.0,
        9 => -4.0,
        _ => 0.0,
    });
    assert_eq!(*derivatives.derivatives.x, expected);
    let mut evaluated = variables.clone();
    Field::default().evaluate(0.0, Variables::evaluation(&mut evaluated));
    assert_eq!(evaluated, *variables);
}

/// Reads one element more than it declares.
#[derive(Clone, Debug, Default, Persistent)]
struct Undeclared {}

impl Equations for Undeclared {
    type Variables = Variables;

    fn evaluate<T: Number>(&self, time: T, variables: Evaluation<'_, T>) {
        let Evaluation { parameters, inputs, states, derivatives, locals, outputs } = variables;
        Field::default()
            .evaluate(time, Evaluation { parameters, inputs, states, derivatives, locals, outputs });
        derivatives.x[9] += states.x[200] * 1e-3;
    }
}

#[test]
fn an_undeclared_element_is_found_among_many() {
    let error = check_dependencies::<Integrated<Undeclared>>(&Variables::default()).unwrap_err();
    assert_eq!(error.to_string(), "der(x[10]) depends on x[201], which its 'reads' omit");
}

/// Importers set them at each point; their positions are computed.
#[test]
fn consecutive_real_inputs_are_numbered_by_their_references() {
    fn check<V: fmu_export::Variables>(count: usize) {
        let found: Vec<_> =
            V::REAL_INPUTS.map(|input| V::attributes(input).unwrap().first_real_input).collect();
        assert_eq!(found, (0..count).map(Some).collect::<Vec<_>>());
    }
    check::<decay::Variables>(1);
    check::<van_der_pol::Variables>(0);
    check::<gears::Variables>(0);
    // The first is an array.
    check::<Variables>(0);
}
