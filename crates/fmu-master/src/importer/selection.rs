//! Variables resolved by their names, to be read and written together.

use std::collections::BTreeMap;
use std::mem;
use std::ops::Range;
use std::sync::Arc;

use anyhow::{Context, Error, Result, bail};
use fmu_abi::fmi2::c_types::ValueReference;
use fmu_package::{Domain, Element, FmuVariable, Function, ValueType};
use fmu_terms::DataType;

use super::c_boundary::Loaded;
use super::fmu::{Fmu, reference};
use super::numbers::{NumberType, Numbers};

impl Fmu {
    /// Resolves numeric variables for [`Instance::read`](super::Instance::read) and
    /// [`Instance::write`](super::Instance::write): Reals, Integers, Booleans, Enumerations,
    /// and their types in FMI 3.0.
    ///
    /// # Errors
    /// When there is no variable of a name, it is not a number, or its value reference is not one.
    pub fn select<'a>(&self, names: impl IntoIterator<Item = &'a str>) -> Result<Selection> {
        self.select_of(names, false)
    }

    /// Selects variables as [`Fmu::select`] does, and texts, which are read only.
    pub(crate) fn select_with_texts<'a>(
        &self,
        names: impl IntoIterator<Item = &'a str>,
    ) -> Result<Selection> {
        self.select_of(names, true)
    }

    fn select_of<'a>(&self, names: impl IntoIterator<Item = &'a str>, has_texts: bool) -> Result<Selection> {
        let mut selection = Selection {
            names: vec![],
            groups: vec![],
            texts: vec![],
            limits: vec![],
            fitted: vec![],
            loaded: Arc::clone(&self.loaded),
        };
        for name in names {
            let variable = self.variable(name)?;
            let (reference, position) = (reference(variable)?, selection.names.len());
            if has_texts && variable.value_type() == ValueType::String {
                self.loaded.refuse_no_texts().with_context(|| format!("{name} cannot be read"))?;
                selection.texts.push(Texts::new(reference, variable.element, position));
                selection.names.push(name.to_owned());
                continue;
            }
            let number_type = variable.data_type.meaning().and_then(|known| self.loaded.number_type(known));
            let Some(number_type) = number_type else {
                bail!("{name} is of the type {}, which is not a number", variable.data_type);
            };
            let groups = &mut selection.groups;
            let known = groups.iter().position(|group| group.number_type == number_type);
            let group = known.unwrap_or_else(|| {
                groups.push(Group::new(number_type));
                groups.len() - 1
            });
            let conversion = self.conversions_of(variable);
            groups[group].push(reference, variable.element, position, conversion.clone());
            let domain = match self.thresholds.get(name) {
                Some(threshold) => Domain::with_threshold(variable, *threshold).map_err(Error::msg)?,
                None => Domain::of(variable, self.description()),
            };
            selection.limit(position, domain, conversion);
            selection.names.push(name.to_owned());
        }
        selection.fitted = vec![0.0; selection.names.len()];
        selection.groups.iter_mut().for_each(Group::finish);
        Ok(selection)
    }
}

/// Variables of an [`Fmu`], resolved by [`Fmu::select`]. Their values are doubles in the order of the names, in the units
/// that the FMU declares. Booleans are 0 and 1; Enumerations are the numbers of their items, recorded texts those of the
/// order in which they first occurred.
pub struct Selection {
    pub(super) names: Vec<String>,
    pub(super) groups: Vec<Group>,
    pub(super) texts: Vec<Texts>,
    /// The variables that do not take every number.
    limits: Vec<Limit>,
    /// Room for what the variables take.
    fitted: Vec<f64>,
    /// The loaded library of the selection's FMU.
    pub(super) loaded: Arc<Loaded>,
}

/// A variable that does not take every number.
struct Limit {
    /// The variable's index among the selection's.
    position: usize,
    domain: Domain,
    /// The conversions from the FMU's value and to it.
    conversion: Option<(Function, Function)>,
}

/// A value that its variable does not take.
pub struct Misfit {
    /// The variable's index among the selection's.
    pub position: usize,
    /// Why the variable does not take the value.
    pub reason: String,
}

/// The variables of a selection that have one type.
pub struct Group {
    pub number_type: NumberType,
    pub references: Vec<ValueReference>,
    /// The values of all references, arrays as a whole.
    pub values: Numbers,
    slots: Vec<Slot>,
    /// The arrays among the references, each with the places of its values.
    pub arrays: BTreeMap<ValueReference, Range<usize>>,
    /// Whether not all elements of the arrays are selected.
    has_other_elements: bool,
}

/// A variable whose values are texts.
pub struct Texts {
    pub reference: ValueReference,
    element: Option<Element>,
    /// The variable's index among the selection's.
    position: usize,
    /// The texts that have occurred, and their numbers.
    known: Vec<String>,
    numbers: BTreeMap<String, usize>,
}

impl Texts {
    fn new(reference: ValueReference, element: Option<Element>, position: usize) -> Self {
        Self { reference, element, position, known: vec![], numbers: BTreeMap::new() }
    }

    /// The number of texts under the variable's reference.
    pub fn count(&self) -> usize {
        self.element.map_or(1, |element| element.size)
    }

    /// Writes the number of the variable's text, one of `texts` under its reference, to `values`.
    pub fn scatter(&mut self, mut texts: Vec<String>, values: &mut [f64]) {
        let text = texts.swap_remove(self.element.map_or(0, |element| element.position));
        let number = self.numbers.get(&text).copied().unwrap_or_else(|| {
            self.known.push(text.clone());
            self.numbers.insert(text, self.known.len() - 1);
            self.known.len() - 1
        });
        values[self.position] = number as f64;
    }
}

/// One of a group's variables.
struct Slot {
    /// The variable's index among the group's values.
    value: usize,
    /// The variable's index among the selection's.
    position: usize,
    /// The conversions from the FMU's value and to it.
    conversion: Option<(Function, Function)>,
}

impl Group {
    fn new(number_type: NumberType) -> Self {
        Self {
            number_type,
            references: vec![],
            values: Numbers::new(number_type.memory),
            slots: vec![],
            arrays: BTreeMap::new(),
            has_other_elements: false,
        }
    }

    fn push(
        &mut self,
        reference: ValueReference,
        element: Option<Element>,
        position: usize,
        conversion: Option<(Function, Function)>,
    ) {
        let known = self.arrays.get(&reference).map(|places| places.start);
        let first = known.unwrap_or_else(|| {
            let first = self.values.len();
            self.references.push(reference);
            self.values.extend(element.map_or(1, |element| element.size));
            if element.is_some() {
                self.arrays.insert(reference, first..self.values.len());
            }
            first
        });
        let value = first + element.map_or(0, |element| element.position);
        self.slots.push(Slot { value, position, conversion });
    }

    /// Looks for elements that are not selected.
    fn finish(&mut self) {
        let mut is_selected = vec![false; self.values.len()];
        self.slots.iter().for_each(|slot| is_selected[slot.value] = true);
        self.has_other_elements = is_selected.contains(&false);
    }

    /// Converts the values to set, which the variables must take, to the FMU's values.
    pub fn gather(&mut self, values: &[f64]) {
        for Slot { value, position, conversion } in &self.slots {
            let given = values[*position];
            self.values.set(*value, conversion.as_ref().map_or(given, |(_, to_own)| to_own.apply(given)));
        }
    }

    /// Whether there are arrays of which not all elements are selected.
    pub fn has_other_elements(&self) -> bool {
        self.has_other_elements
    }

    /// Gives the selection's arrays the values that they were set to, or else those that the FMU starts with.
    pub fn begin_with(&mut self, arrays: &BTreeMap<ValueReference, Vec<f64>>, fmu: &Fmu) {
        for (reference, places) in &self.arrays {
            if let Some(values) = arrays.get(reference) {
                places.clone().zip(values).for_each(|(place, value)| self.values.set(place, *value));
                continue;
            }
            for variable in fmu.description().variables.with_reference(*reference) {
                if let Some(element) = variable.element {
                    let start = start(variable);
                    let conversions = fmu.conversions_of(variable);
                    let own = conversions.map_or(start, |(_, to_own)| to_own.apply(start));
                    self.values.set(places.start + element.position, own);
                }
            }
        }
    }

    /// The values of the selection's arrays.
    pub fn values_of_arrays(&self) -> impl Iterator<Item = (ValueReference, Vec<f64>)> {
        let values = |places: &Range<usize>| places.clone().map(|place| self.values.get(place)).collect();
        self.arrays.iter().map(move |(reference, places)| (*reference, values(places)))
    }

    pub fn scatter(&self, values: &mut [f64]) {
        for Slot { value, position, conversion } in &self.slots {
            let number = self.values.get(*value);
            // Any other value than 0 is true.
            let own = if self.number_type.data_type == DataType::Boolean {
                f64::from(number != 0.0)
            } else {
                number
            };
            values[*position] = conversion.as_ref().map_or(own, |(to_seen, _)| to_seen.apply(own));
        }
    }

    /// Distributes derivatives of the group's values, in the FMU's own units.
    pub fn scatter_derivatives(&self, derivatives: &[f64], values: &mut [f64]) {
        for Slot { value, position, .. } in &self.slots {
            values[*position] = derivatives[*value];
        }
    }
}

/// The number that a variable starts with; 0 if its FMU declares none.
fn start(variable: &FmuVariable) -> f64 {
    match variable.start.trim() {
        "true" => 1.0,
        text => text.parse().unwrap_or(0.0),
    }
}

impl Selection {
    /// The names of the selected variables, in their order.
    #[must_use]
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The texts of a variable that have occurred, by its index.
    pub(crate) fn texts_of(&self, position: usize) -> &[String] {
        let texts = self.texts.iter().find(|texts| texts.position == position);
        texts.map_or(&[], |texts| &texts.known)
    }

    /// Restricts what a variable takes, from now on.
    pub(crate) fn limit(
        &mut self,
        position: usize,
        domain: Domain,
        conversion: Option<(Function, Function)>,
    ) {
        self.limits.retain(|limit| limit.position != position);
        if domain != Domain::Real {
            self.limits.push(Limit { position, domain, conversion });
        }
    }

    /// Replaces each value by the one that its variable takes for it.
    ///
    /// # Errors
    /// The first that its variable does not take.
    pub(crate) fn fit(&self, values: &mut [f64]) -> Result<(), Misfit> {
        for Limit { position, domain, conversion } in &self.limits {
            let (position, value) = (*position, &mut values[*position]);
            let own = conversion.as_ref().map_or(*value, |(_, to_own)| to_own.apply(*value));
            let taken = domain.take(own).map_err(|reason| Misfit { position, reason })?;
            if taken.to_bits() != own.to_bits() {
                *value = conversion.as_ref().map_or(taken, |(to_seen, _)| to_seen.apply(taken));
            }
        }
        Ok(())
    }

    /// The values that the variables take for others, in the selection's own room.
    ///
    /// # Errors
    /// When a variable takes none; the message names it.
    pub(super) fn fitted(&mut self, values: &[f64]) -> Result<Vec<f64>> {
        let mut fitted = mem::take(&mut self.fitted);
        let count = fitted.len();
        fitted.copy_from_slice(&values[..count]);
        if let Err(Misfit { position, reason }) = self.fit(&mut fitted) {
            self.fitted = fitted;
            bail!("{}: {reason}", self.names[position]);
        }
        Ok(fitted)
    }

    /// Takes back the room of the values from `fitted`.
    pub(super) fn give_back(&mut self, fitted: Vec<f64>) {
        self.fitted = fitted;
    }
}
