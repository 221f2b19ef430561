//! Constants that neither literature nor a derivation gives: they were chosen by experiment.
//!
//! Where such a constant is used, it stands in `chosen!`. There, tests can multiply one at a time:
//!
//! ```sh
//! cargo test --release --package fmu-solve --lib chosen -- --ignored --nocapture --test-threads 1
//! ```
//!
//! prints what half and twice of each cost, and how the errors change. The tests fail if one of them is clearly better.

/// The value of a [chosen](self) constant.
#[cfg(not(test))]
macro_rules! chosen {
    ($constant:ident) => {
        $constant
    };
}

#[cfg(test)]
macro_rules! chosen {
    ($constant:ident) => {
        $crate::chosen::experiment::multiplied(stringify!($constant), $constant)
    };
}

#[cfg(test)]
pub(crate) mod experiment {
    use core::cell::{Cell, RefCell};
    use std::collections::BTreeSet;

    thread_local! {
        /// The constant that is multiplied, and by what.
        static MULTIPLIED: Cell<Option<(&'static str, f64)>> = const { Cell::new(None) };
        /// The constants that were used.
        static USED: RefCell<BTreeSet<&'static str>> = const { RefCell::new(BTreeSet::new()) };
    }

    /// What can be multiplied.
    pub(crate) trait Constant: Copy {
        fn times(self, factor: f64) -> Self;
    }

    impl Constant for f64 {
        fn times(self, factor: f64) -> Self {
            self * factor
        }
    }

    macro_rules! whole {
        ($($number:ty),*) => {$(
            impl Constant for $number {
                #[allow(
                    clippy::cast_lossless,
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "of small numbers of two types"
                )]
                fn times(self, factor: f64) -> Self {
                    (self as f64 * factor).round() as Self
                }
            }
        )*};
    }
    whole!(u32, usize);

    /// A constant of this name, multiplied if it is the one of the experiment.
    pub(crate) fn multiplied<C: Constant>(name: &'static str, value: C) -> C {
        USED.with_borrow_mut(|used| used.insert(name));
        match MULTIPLIED.get() {
            Some((multiplied, factor)) if multiplied == name => value.times(factor),
            _ => value,
        }
    }

    /// The least cost of half or twice a constant, relative to that of what was chosen. On other problems the best value is
    /// another, so one that is a little better is none.
    const LEAST: f64 = 0.9;

    /// What a problem costs, and how large its error is.
    #[derive(Clone, Copy, Debug)]
    pub(crate) struct Outcome {
        pub(crate) cost: f64,
        pub(crate) error: f64,
    }

    /// Runs the problems with half and twice each constant, and prints a row each: the geometric mean of costs and errors
    /// relative to those with the constants as they are, and the largest cost.
    ///
    /// # Panics
    /// If other constants are used, or the mean cost is below [`LEAST`] times that of what was chosen, at a mean error that
    /// is not larger.
    pub(crate) fn compare(names: &[&'static str], problems: impl Fn() -> Vec<Outcome>) {
        USED.with_borrow_mut(BTreeSet::clear);
        let chosen = problems();
        assert_eq!(USED.with_borrow(BTreeSet::clone), names.iter().copied().collect(), "the constants used");
        println!("| constant | times | cost | at most | error |\n|---|---|---|---|---|");
        let mut better = vec![];
        for &name in names {
            for factor in [0.5, 2.0] {
                MULTIPLIED.set(Some((name, factor)));
                let found = problems();
                MULTIPLIED.set(None);
                let pairs = || found.iter().zip(&chosen);
                let mean = |ratio: &dyn Fn(&Outcome, &Outcome) -> f64| {
                    (pairs().map(|(found, chosen)| ratio(found, chosen).ln()).sum::<f64>()
                        / found.len() as f64)
                        .exp()
                };
                let cost = mean(&|found, chosen| found.cost / chosen.cost);
                let error = mean(&|found, chosen| found.error / chosen.error);
                let most = pairs().map(|(found, chosen)| found.cost / chosen.cost).fold(0.0, f64::max);
                println!("| {name} | {factor} | {cost:.3} | {most:.2} | {error:.2} |");
                if cost < LEAST && error <= 1.0 {
                    better.push((name, factor));
                }
            }
        }
        assert!(better.is_empty(), "{better:?}");
    }
}
