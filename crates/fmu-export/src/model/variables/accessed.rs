//! The values of a model's variables by value reference, as an importer gets and sets them, and what tells which of them an
//! evaluation has computed.

use crate::model::clock::Clock;
use crate::model::description::ValueReference;
use crate::model::inputs::Inputs;

/// The values of a model's variables.
///
/// The runtime uses the accessors only after checking value reference and type in
/// [`Described::DESCRIPTION`](crate::Described::DESCRIPTION); for any other value reference a getter returns a default and a
/// setter does nothing.
pub trait Accessed {
    /// The input variables only.
    type Inputs: Inputs;

    /// The inputs as the importer set them, not clamped.
    fn inputs(&self) -> &Self::Inputs;

    /// The inputs, for temporary replacement.
    fn inputs_mut(&mut self) -> &mut Self::Inputs;

    /// Whether all parameters equal those of other variables.
    fn has_parameters_of(&self, other: &Self) -> bool;

    /// The value of a Real variable other than the independent one.
    fn real(&self, reference: ValueReference) -> f64;

    /// Copies the finite values of Real variables; that of the independent one is `time` in s. Returns whether all are
    /// finite, and of Real variables.
    fn copy_reals(&self, time: f64, references: &[ValueReference], values: &mut [f64]) -> bool;

    /// The number that a Real variable has which is set to this value: rounded in single precision.
    #[must_use]
    #[inline]
    fn rounded(value: f64) -> f64 {
        value
    }

    /// Sets a Real variable; for a state, its start value.
    fn set_real(&mut self, reference: ValueReference, value: f64);

    /// The value of an Integer or Enumeration variable.
    fn integer(&self, reference: ValueReference) -> i32;

    /// Sets an Integer variable, or an Enumeration variable to the item with a value.
    fn set_integer(&mut self, reference: ValueReference, value: i32);

    /// The value of a Boolean variable.
    fn boolean(&self, reference: ValueReference) -> bool;

    /// Sets a Boolean variable.
    fn set_boolean(&mut self, reference: ValueReference, value: bool);

    /// The value of a String variable.
    fn string(&self, reference: ValueReference) -> &str;

    /// Sets a String variable.
    fn set_string(&mut self, reference: ValueReference, value: &str);

    /// The value of a Float32 variable.
    fn float32(&self, reference: ValueReference) -> f32 {
        let _ = reference;
        0.0
    }

    /// Sets a Float32 variable.
    fn set_float32(&mut self, reference: ValueReference, value: f32) {
        let _ = (reference, value);
    }

    /// The value of a variable of an FMI 3.0 integer type other than Int32.
    fn whole(&self, reference: ValueReference) -> i128 {
        let _ = reference;
        0
    }

    /// Sets a variable of an FMI 3.0 integer type other than Int32, if the value fits.
    fn set_whole(&mut self, reference: ValueReference, value: i128) {
        let _ = (reference, value);
    }

    /// The value of a Binary variable.
    fn binary(&self, reference: ValueReference) -> &[u8] {
        let _ = reference;
        &[]
    }

    /// Sets a Binary variable.
    fn set_binary(&mut self, reference: ValueReference, value: &[u8]) {
        let _ = (reference, value);
    }

    /// The clock at a position in [`Described::CLOCKS`](crate::Described::CLOCKS).
    fn clock(&self, position: usize) -> Option<&Clock> {
        let _ = position;
        None
    }

    /// The clock at a position in [`Described::CLOCKS`](crate::Described::CLOCKS), mutable.
    fn clock_mut(&mut self, position: usize) -> Option<&mut Clock> {
        let _ = position;
        None
    }

    /// Sets the states to their start values.
    fn states_from_start(&mut self);

    /// Exchanges the states and their start values.
    fn swap_states_and_start(&mut self);

    /// Sets a state, not its start value.
    fn set_state(&mut self, reference: ValueReference, value: f64) {
        self.swap_states_and_start();
        self.set_real(reference, value);
        self.swap_states_and_start();
    }

    /// Sets everything calculated at each evaluation (derivatives, outputs, locals other than states) to one of two
    /// values, of any type: what still differs after an evaluation was not set. A no-op without such variables.
    fn mark_calculated(&mut self, mark: bool) {
        let _ = mark;
    }

    /// Marks everything calculated from parameters only, as [`Self::mark_calculated`] does.
    fn mark_calculated_parameters(&mut self, mark: bool) {
        let _ = mark;
    }

    /// Sets each continuous variable that an evaluation calculates to NaN, which it stays if the evaluation omits it.
    fn forget_continuous(&mut self) {}

    /// Whether the continuous variables that an evaluation calculates are finite. A cheap test may deny it of very large
    /// ones.
    fn has_finite_results(&self) -> bool {
        true
    }

    /// The first non-finite state, otherwise derivative, otherwise Real output.
    fn first_non_finite(&self) -> Option<ValueReference>;
}
