//! Values of enumerations whose items have gaps, and equations without Reals, in both versions.

use fmu_export::{Equations, Integrated, Model, Number, Persistent};
use fmu_export_equations::{gears, gears_3};
use fmu_terms::InstanceType;

use crate::importer::{Importer, heard};

/// Defines a model without Reals. Equations may name the number type or not, and take the variables apart.
macro_rules! model {
    ($name:ident of $module:ident: Evaluation<'_ $(, $number:ident)?>) => {
        #[derive(Clone, Debug, Default, Persistent)]
        struct $name {}

        impl Equations for $name {
            type Variables = $module::Variables;

            fn evaluate<T: Number>(&self, _time: T, variables: $module::Evaluation<'_ $(, $number)?>) {
                let $module::Evaluation { inputs, outputs, .. } = variables;
                outputs.shown = if inputs.reverse { $module::Gear::Reverse } else { inputs.gear };
                outputs.next = inputs.count + 1;
            }
        }
    };
}

model!(Gears of gears: Evaluation<'_, T>);
model!(Gears3 of gears_3: Evaluation<'_, T>);
model!(WithoutNumberType of gears: Evaluation<'_>);

/// An instance in Initialization Mode, or after it.
fn importer<M: Model>(instance_type: InstanceType, is_initialized: bool) -> Importer<M> {
    let mut importer = Importer::new(instance_type);
    importer.enter_initialization();
    if is_initialized {
        importer.exit_initialization();
    }
    importer
}

fn check_items<M: Model>(instance_type: InstanceType) {
    for is_initialized in [false, true] {
        let mut accepting = importer::<M>(instance_type, is_initialized);
        for (name, start) in [("gear", 5), ("preset", 12)] {
            for item in [-2, 0, 5, 10, 11, 12] {
                assert!(accepting.choose([name], [item]));
                assert_eq!(accepting.chosen(name), i64::from(item));
            }
            for value in [i32::MIN, -3, -1, 1, 3, 4, 6, 9, 13, i32::MAX] {
                let mut refusing = importer::<M>(instance_type, is_initialized);
                assert!(!refusing.choose(["reverse gear", name], [0, value]), "{value} for {name}");
                if Importer::<M>::IS_FMI2 {
                    // None of them is set.
                    assert_eq!(["reverse gear", name].map(|name| refusing.chosen(name)), [-2, start]);
                } else {
                    // Only a reset instance can go on.
                    let message = format!(
                        "fmi3SetInt64: {value} for the variable {name} is not one of its items -2 (reverse), 0 \
                         (neutral), 5 (drive), 10 (type), 11 (self), 12 (fn)"
                    );
                    assert_eq!(heard(), [message]);
                }
            }
        }
        assert_eq!(accepting.chosen("shown"), 12);
    }
}

#[test]
fn values_between_items_are_refused() {
    for instance_type in [InstanceType::CoSimulation, InstanceType::ModelExchange] {
        check_items::<Integrated<Gears>>(instance_type);
        check_items::<Integrated<Gears3>>(instance_type);
    }
    check_items::<Integrated<WithoutNumberType>>(InstanceType::CoSimulation);
}

#[test]
fn an_element_of_an_array_takes_items_alone() {
    let mut importer = importer::<Integrated<Gears>>(InstanceType::CoSimulation, true);
    assert!(importer.choose(["gears[1]", "gears[2]"], [10, -2]));
    assert!(!importer.choose(["gears[1]", "gears[2]"], [0, 2]));
    assert_eq!(["gears[1]", "gears[2]"].map(|name| importer.chosen(name)), [10, -2]);
}
