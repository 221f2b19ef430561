//! A linear system: arrays sized by structural parameters.

use fmu_export::{Equations, Number};

fmu_export::fmu!(equations struct {Type});

/// The sum of two matrix-vector products.
fn sum<T: Number, const R: usize, const N: usize, const M: usize>(
    (a, x): (&[[T; N]; R], &[T; N]),
    (b, u): (&[[T; M]; R], &[T; M]),
) -> [T; R] {
    std::array::from_fn(|row| {
        let mut sum = T::from(0.0);
        a[row].iter().zip(x).for_each(|(&a, &x)| sum += a * x);
        b[row].iter().zip(u).for_each(|(&b, &u)| sum += b * u);
        sum
    })
}

impl Equations for {Type} {
    type Variables = Variables;

    fn initialize<T: Number>(&self, variables: &mut Variables<T>) {
        variables.states.x = variables.parameters.x0;
    }

    fn evaluate<T: Number>(&self, _time: T, variables: Evaluation<'_, T>) {
        let (p, x, u) = (
            variables.parameters,
            &variables.states.x,
            &variables.inputs.u,
        );
        variables.derivatives.x = sum((&p.a, x), (&p.b, u));
        variables.outputs.y = sum((&p.c, x), (&p.d, u));
    }
}
