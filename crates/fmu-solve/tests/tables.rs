//! Tables beside `SciPy`, whose values `tables/reference.py` prints, and their derivatives beside differences.

use fmu_solve::table::{Beyond, Curve, Surface, Table};
use fmu_solve::{Dual, Number, Tape};

const KNOTS: [f64; 6] = [-1.0, 0.0, 0.5, 2.0, 2.25, 7.0];
const VALUES: [f64; 6] = [3.0, 1.0, 1.0, -2.0, 4.0, 4.5];
const ROWS: [f64; 4] = [0.0, 1.0, 1.5, 4.0];
const COLUMNS: [f64; 5] = [-2.0, -1.0, 3.0, 5.0, 6.0];
const GRID: [[f64; 5]; 4] = [
    [1.0, 2.0, 0.0, 5.0, 5.0],
    [0.5, 2.5, 3.0, 2.0, 1.0],
    [4.0, -1.0, 2.0, 2.0, 7.0],
    [0.0, 0.0, 1.0, 3.0, -3.0],
];

fn curve(interpolation: &str) -> Curve<'static> {
    let linear = Curve::new(&KNOTS, &VALUES);
    if interpolation == "cubic" { linear.cubic() } else { linear }
}

fn surface(interpolation: &str) -> Surface<'static, [f64; 5]> {
    let linear = Surface::new(&ROWS, &COLUMNS, &GRID);
    if interpolation == "cubic" { linear.cubic() } else { linear }
}

/// Both sides round some twenty operations on numbers below 100.
const ROUND_OFF: f64 = 20.0 * 100.0 * f64::EPSILON;

#[test]
fn values_and_slopes_are_those_of_scipy() {
    let mut count = 0;
    for line in include_str!("tables/values.csv").lines().skip(1) {
        let cells: Vec<_> = line.split(',').collect();
        let [interpolation, row, column, value, slope] = cells[..] else { panic!("{line}") };
        let [column, value] = [column, value].map(|text| text.parse::<f64>().unwrap());
        let found = if row.is_empty() {
            let found = curve(interpolation).at(Dual::new(column, 1.0));
            let expected: f64 = slope.parse().unwrap();
            assert!((found.derivative - expected).abs() <= ROUND_OFF, "{interpolation} {column}: {found:?}");
            found.value
        } else {
            surface(interpolation).at(row.parse::<f64>().unwrap(), column)
        };
        assert!((found - value).abs() <= ROUND_OFF, "{interpolation} {row} {column}: {found}, not {value}");
        count += 1;
    }
    assert_eq!(count, 158);
}

/// Central differences of a polynomial of the third degree: the step's square times a sixth of the third derivative,
/// below 1e3, and rounding divided by the step.
const STEP: f64 = 1e-6;
const OF_DIFFERENCES: f64 = STEP * STEP * 1e3 + 100.0 * f64::EPSILON / STEP;

/// The sum of all kinds of interpolation, between numbers that are all in one list.
fn evaluate<T: Number>(numbers: &[T]) -> T {
    let (rows, rest) = numbers.split_at(4);
    let (columns, rest) = rest.split_at(5);
    let (grid, rest) = rest.split_at(20);
    let (place, rest) = rest.split_at(2);
    let (knots, rest) = rest.split_at(6);
    let (values, x) = rest.split_at(6);
    let grid: Vec<_> = grid.chunks(5).collect();
    let surface = Surface::new(rows, columns, &grid);
    let curve = Curve::new(knots, values);
    surface.at(place[0], place[1])
        + surface.cubic().at(place[0], place[1])
        + curve.at(x[0])
        + curve.cubic().at(x[0])
}

#[test]
fn derivatives_by_knots_values_and_places_agree_with_differences() {
    // What a surface and a curve depend on, all in one list, without the equal values at which slopes have a kink.
    let numbers = [ROWS.as_slice(), &COLUMNS, GRID.as_flattened(), &[1.2, 4.4], &KNOTS, &VALUES, &[1.1]];
    let numbers: Vec<f64> =
        (0..).zip(numbers.concat()).map(|(index, number)| number + 0.01 * f64::from(index).sin()).collect();
    let mut tape = Tape::new();
    tape.clear();
    let variables: Vec<_> = numbers.iter().map(|&number| tape.variable(number)).collect();
    let result = evaluate(&variables);
    tape.weigh(result, 1.0);
    tape.go_back();
    for index in 0..numbers.len() {
        let at = |step: f64| {
            let mut moved = numbers.clone();
            moved[index] += step;
            evaluate(&moved)
        };
        let expected = (at(STEP) - at(-STEP)) / (2.0 * STEP);
        let duals: Vec<_> =
            (0..).zip(&numbers).map(|(at, &number)| Dual::new(number, f64::from(at == index))).collect();
        let found = evaluate(&duals);
        assert_eq!(found.value.to_bits(), result.value().to_bits());
        for found in [found.derivative, tape.derivative(variables[index])] {
            assert!((found - expected).abs() <= OF_DIFFERENCES, "{index}: {found} instead of {expected}");
        }
    }
}

#[test]
fn a_curve_goes_on_beyond_its_edges_as_it_is_told() {
    let at = |beyond, x: f64| {
        let Dual { value, derivative } = curve("linear").beyond(beyond).at(Dual::new(x, 1.0));
        (value, derivative)
    };
    assert_eq!(at(Beyond::Hold, -9.0), (3.0, 0.0));
    assert_eq!(at(Beyond::Hold, 7.0), (4.5, 0.0));
    assert_eq!(at(Beyond::Extend, -2.0), (5.0, -2.0));
    assert_eq!(at(Beyond::Extend, 7.0 + 4.75), (5.0, 0.5 / 4.75));
    assert!(at(Beyond::Invalid, -1.1).0.is_nan() && at(Beyond::Invalid, 7.1).0.is_nan());
    assert_eq!(at(Beyond::Invalid, 7.0).0.to_bits(), 4.5_f64.to_bits());
    // A period of 8.
    assert_eq!(at(Beyond::Repeat, -9.0), (3.0, -2.0));
    assert_eq!(at(Beyond::Repeat, 10.0), (-2.0, 24.0));
    let cubic = curve("cubic").beyond(Beyond::Extend);
    let edge = cubic.at(Dual::new(7.0, 1.0));
    assert_eq!(cubic.at(9.0).to_bits(), (edge.value + 2.0 * edge.derivative).to_bits());
    assert!(curve("cubic").at(f64::NAN).is_nan());
}

#[test]
fn a_surface_is_linear_beyond_its_corner() {
    let flat = [[0.0, 1.0], [10.0, 11.0]];
    let surface = Surface::new(&[0.0, 1.0], &[0.0, 1.0], &flat).beyond(Beyond::Extend);
    for value in [surface.at(3.0, -2.0), surface.cubic().at(3.0, -2.0)] {
        assert_eq!(value.to_bits(), 28.0_f64.to_bits());
    }
}

#[test]
fn what_is_no_table_is_refused_by_name() {
    let refusal = |knots: &[f64], values: &[f64], beyond| {
        Curve::new(knots, values).beyond(beyond).check("torque").unwrap_err().to_string()
    };
    for (knots, values, beyond, message) in [
        (&[1.0][..], &[1.0][..], Beyond::Hold, "torque: 1 knots; it needs two"),
        (&[0.0, 2.0, 2.0], &[0.0; 3], Beyond::Hold, "torque: knot 3 is 2, not above the one before, 2"),
        (&[0.0, f64::NAN], &[0.0; 2], Beyond::Hold, "torque: knot 2 is NaN"),
        (&[0.0, 1.0], &[0.0, f64::INFINITY], Beyond::Hold, "torque: value 2 is inf"),
        (&[0.0, 1.0], &[0.0; 3], Beyond::Hold, "torque: 3 values for 2 knots"),
        (
            &[0.0, 1.0],
            &[0.0, 2.0],
            Beyond::Repeat,
            "torque: it repeats, but the first value is 0, and the last 2",
        ),
    ] {
        assert_eq!(refusal(knots, values, beyond), message);
    }
    assert!(Curve::new(&[1.0], &[1.0]).at(1.0).is_nan());
    assert!(Curve::new(&KNOTS, &VALUES).check("torque").is_ok());
    let surface = Surface::new(&ROWS, &COLUMNS, &GRID[..3]);
    assert_eq!(surface.check("map").unwrap_err().to_string(), "map: 3 rows of values for 4 knots");
    let repeated = Surface::new(&ROWS, &COLUMNS, &GRID).beyond(Beyond::Repeat);
    let reason = "map: row 1: it repeats, but the first value is 1, and the last 5";
    assert_eq!(repeated.check("map").unwrap_err().to_string(), reason);
}

#[test]
fn tables_are_read_from_csv() {
    let text = "\u{feff}speed, torque\n# rpm, N.m\n0, 50\n\n100, 6e1\n";
    let [speed, torque] = Table::parse("torque.csv", text).unwrap().columns().unwrap();
    assert_eq!((speed, torque), (vec![0.0, 100.0], vec![50.0, 60.0]));
    let grid = Table::parse("map.csv", "0,-1,3\n0,1,2\n1,3,4\n").unwrap().grid().unwrap();
    assert_eq!(grid.surface().at(0.5, 1.0).to_bits(), 2.5_f64.to_bits());
    // What stands at the corner of a grid is of no use to it, and no number elsewhere.
    for corner in ["Te\\Tc", "", "rpm"] {
        let table =
            Table::parse("map.csv", &format!("# by rows\n{corner},20,30\n4,5.8,4.6\n10,6.5,5.3\n")).unwrap();
        let message = table.clone().columns::<3>().unwrap_err().to_string();
        assert_eq!(message, format!("map.csv: line 2: '{corner}' is not a number"));
        assert!(table.clone().rows()[0][0].is_nan());
        let grid = table.grid().unwrap();
        assert_eq!(grid.surface().at(10.0, 20.0).to_bits(), 6.5_f64.to_bits());
    }
    let rows = Table::parse("rows.csv", "1,2\n3\n").unwrap();
    assert_eq!(rows.clone().rows(), [vec![1.0, 2.0], vec![3.0]]);
    let message = rows.columns::<2>().unwrap_err().to_string();
    assert_eq!(message, "rows.csv: row 2 has 1 cells, not 2");
    for (text, message) in [
        ("1,2\n3,x\n", "map.csv: line 2: 'x' is not a number"),
        ("1,2\nx,3\n", "map.csv: line 2: 'x' is not a number"),
        ("x,2,y\n1,2,3\n", "map.csv: line 1: 'y' is not a number"),
        ("0,-1,3\n0,1,2\n1,3\n", "map.csv: row 2: 1 values for 2 knots"),
        ("", "map.csv: rows: 0 knots; it needs two"),
        ("0,-1,3\n1,1,2\n0,3,4\n", "map.csv: rows: knot 2 is 0, not above the one before, 1"),
    ] {
        let refusal = Table::parse("map.csv", text).and_then(Table::grid).unwrap_err().to_string();
        assert_eq!(refusal, message);
    }
}

#[test]
fn the_next_point_is_the_first_knot_after_a_place() {
    let curve = curve("linear");
    for (place, expected) in [
        (-3.0, Some(-1.0)),
        (-1.0, Some(0.0)),
        (0.25, Some(0.5)),
        (2.0, Some(2.25)),
        (7.0, None),
        (8.0, None),
    ] {
        assert_eq!(curve.next_point(place), expected, "after {place}");
    }
    // A period of 0.3, which has no exact multiples: four knots in each round, of which two are the same.
    let knots = [0.1, 0.2, 0.25, 0.4];
    let repeated = Curve::new(&knots, &[1.0, 2.0, 0.0, 1.0]).beyond(Beyond::Repeat);
    let (mut place, mut count) = (-30.0, 0);
    while let Some(next) = repeated.next_point(place).filter(|&next| next < 60.0) {
        assert!(next > place, "{next} after {place}");
        (place, count) = (next, count + 1);
    }
    // Three in each of 300 rounds, if rounding makes none of them two.
    assert_eq!(count, 900);
}
