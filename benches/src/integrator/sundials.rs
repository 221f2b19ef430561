//! CVODE of the SUNDIALS that the Python package `scikit-sundae` brings along, through its C functions.

use std::ffi::{c_int, c_long, c_void};
use std::path::Path;
use std::{fs, ptr, slice};

use fmu_export::{Context, Described as _, Dual, Event, Experiment};
use fmu_export_problems::Problem;

use crate::jacobian::Elements;

/// The pointers of SUNDIALS: to its context, a vector, a matrix, a linear or nonlinear solver and CVODE's memory.
type Pointer = *mut c_void;
type Rates = unsafe extern "C" fn(time: f64, states: Pointer, rates: Pointer, data: Pointer) -> c_int;
type Jacobian = unsafe extern "C" fn(
    time: f64,
    states: Pointer,
    rates: Pointer,
    matrix: Pointer,
    data: Pointer,
    memory: Pointer,
    more_memory: Pointer,
    most_memory: Pointer,
) -> c_int;

/// Declares functions by their names in SUNDIALS.
macro_rules! functions {
    ($($name:ident($($type:ty),*) $(-> $result:ty)?;)*) => {
        /// The libraries of SUNDIALS.
        #[derive(Debug)]
        #[allow(non_snake_case, reason = "the names of SUNDIALS")]
        pub struct Sundials {
            $($name: unsafe extern "C" fn($($type),*) $(-> $result)?,)*
            /// The loaded libraries; last, so that they are dropped after all pointers into them.
            _loaded: Vec<libloading::Library>,
        }

        impl Sundials {
            /// Loads the libraries from their folder.
            ///
            /// # Panics
            /// When one cannot be loaded, or lacks a function.
            #[must_use]
            pub fn load(folder: &Path) -> Self {
                let files = fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
                let files = files.map(|file| file.expect("the folder can be read").path());
                let is_of_sundials = |file: &Path| {
                    file.file_name().is_some_and(|name| name.to_string_lossy().starts_with("libsundials_"))
                };
                let loaded: Vec<_> = files
                    .filter(|file| is_of_sundials(file))
                    // SAFETY: the libraries run nothing when they are loaded but the set-up of OpenBLAS and OpenMP.
                    .map(|file| unsafe { libloading::Library::new(&file) })
                    .map(|library| library.unwrap_or_else(|error| panic!("{error}")))
                    .collect();
                Self {
                    $($name: {
                        // SAFETY: these are the types of SUNDIALS 7.9 with 32-bit indices, as the package is built.
                        let found = loaded.iter().find_map(|library| unsafe { library.get(stringify!($name)) }.ok());
                        *found.unwrap_or_else(|| panic!("there is no {} in {}", stringify!($name), folder.display()))
                    },)*
                    _loaded: loaded,
                }
            }
        }
    };
}

functions! {
    SUNContext_Create(c_int, *mut Pointer) -> c_int;
    SUNContext_ClearErrHandlers(Pointer) -> c_int;
    SUNContext_Free(*mut Pointer) -> c_int;
    N_VNew_Serial(c_int, Pointer) -> Pointer;
    N_VGetArrayPointer(Pointer) -> *mut f64;
    N_VDestroy(Pointer);
    SUNDenseMatrix(c_int, c_int, Pointer) -> Pointer;
    SUNDenseMatrix_Data(Pointer) -> *mut f64;
    SUNBandMatrix(c_int, c_int, c_int, Pointer) -> Pointer;
    SUNBandMatrix_Data(Pointer) -> *mut f64;
    SUNSparseMatrix(c_int, c_int, c_int, c_int, Pointer) -> Pointer;
    SUNSparseMatrix_Data(Pointer) -> *mut f64;
    SUNSparseMatrix_IndexValues(Pointer) -> *mut c_int;
    SUNSparseMatrix_IndexPointers(Pointer) -> *mut c_int;
    SUNMatDestroy(Pointer);
    SUNLinSol_Dense(Pointer, Pointer, Pointer) -> Pointer;
    SUNLinSol_LapackDense(Pointer, Pointer, Pointer) -> Pointer;
    SUNLinSol_Band(Pointer, Pointer, Pointer) -> Pointer;
    SUNLinSol_LapackBand(Pointer, Pointer, Pointer) -> Pointer;
    SUNLinSol_SuperLUMT(Pointer, Pointer, c_int, Pointer) -> Pointer;
    SUNLinSol_SPGMR(Pointer, c_int, c_int, Pointer) -> Pointer;
    SUNLinSolFree(Pointer) -> c_int;
    SUNNonlinSol_FixedPoint(Pointer, c_int, Pointer) -> Pointer;
    SUNNonlinSolFree(Pointer) -> c_int;
    CVodeCreate(c_int, Pointer) -> Pointer;
    CVodeInit(Pointer, Rates, f64, Pointer) -> c_int;
    CVodeReInit(Pointer, f64, Pointer) -> c_int;
    CVodeSStolerances(Pointer, f64, f64) -> c_int;
    CVodeSetUserData(Pointer, Pointer) -> c_int;
    CVodeSetMaxNumSteps(Pointer, c_long) -> c_int;
    CVodeSetMaxHnilWarns(Pointer, c_int) -> c_int;
    CVodeSetLinearSolver(Pointer, Pointer, Pointer) -> c_int;
    CVodeSetJacFn(Pointer, Jacobian) -> c_int;
    CVodeSetNonlinearSolver(Pointer, Pointer) -> c_int;
    CVodeSetStopTime(Pointer, f64) -> c_int;
    CVode(Pointer, f64, Pointer, *mut f64, c_int) -> c_int;
    CVodeFree(*mut Pointer);
}

const ADAMS: c_int = 1;
const BDF: c_int = 2;
/// Steps past the point, then goes back to it by interpolation.
const NORMAL: c_int = 1;
const BY_COLUMNS: c_int = 0;
const WITHOUT_PRECONDITIONER: c_int = 0;
const DEFAULT_DIMENSION: c_int = 0;
/// A problem on which a method takes more steps between two points is none for it.
const MOST_STEPS: c_long = 100_000;
/// Communication points and events that differ by no more, relatively, are at one time.
const ROUNDING: f64 = 1e-12;

/// What solves the equations of an implicit step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Solver {
    /// Functional iteration, for the Adams methods; all others are for BDF.
    Adams,
    Dense,
    LapackDense,
    Band,
    LapackBand,
    SuperLuMt,
    /// Iterative, without preconditioner; products with the Jacobian are difference quotients.
    Gmres,
}

impl Solver {
    /// Whether the solver takes the Jacobian as a matrix.
    pub fn has_matrix(self) -> bool {
        !matches!(self, Self::Adams | Self::Gmres)
    }
}

/// What happens at a communication point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// The solver steps past the communication point, and the states there are interpolated.
    Free,
    /// A step ends at the communication point, and the solver continues with its history.
    Stop,
    /// The solver restarts at the communication point.
    Restart,
}

/// A problem that CVODE solves.
pub struct Cvode<'a, P> {
    sundials: &'a Sundials,
    solver: Solver,
    elements: &'a Elements,
    problem: P,
    states: Vec<Dual>,
    rates: Vec<Dual>,
}

/// The rates, as CVODE calls them.
///
/// # Safety
/// The vectors are those of the problem, and `data` is its [`Cvode`].
unsafe extern "C" fn rates<P: Problem>(_: f64, states: Pointer, rates: Pointer, data: Pointer) -> c_int {
    // SAFETY: as this function's; nothing else uses it meanwhile.
    let Cvode { sundials, problem, .. } = unsafe { &*data.cast::<Cvode<'_, P>>() };
    // SAFETY: the vectors have the problem's size.
    let (states, rates) = unsafe { (sundials.array::<P>(states), sundials.array::<P>(rates)) };
    problem.rates(states, rates);
    0
}

/// The Jacobian, as CVODE calls it.
///
/// # Safety
/// The vectors and the matrix are those of the problem, and `data` is its [`Cvode`].
unsafe extern "C" fn jacobian<P: Problem>(
    _: f64,
    states: Pointer,
    _: Pointer,
    matrix: Pointer,
    data: Pointer,
    _: Pointer,
    _: Pointer,
    _: Pointer,
) -> c_int {
    // SAFETY: as this function's; nothing else uses it meanwhile.
    let Cvode { sundials, solver, elements, problem, states: duals, rates } =
        unsafe { &mut *data.cast::<Cvode<'_, P>>() };
    // SAFETY: the vector has the problem's size.
    let states = unsafe { sundials.array::<P>(states) };
    let size = states.len();
    // SAFETY: the matrix was made for this solver.
    let data = unsafe {
        match solver {
            Solver::Dense | Solver::LapackDense => (sundials.SUNDenseMatrix_Data)(matrix),
            Solver::Band | Solver::LapackBand => (sundials.SUNBandMatrix_Data)(matrix),
            Solver::SuperLuMt => {
                // CVODE clears them, too.
                fill((sundials.SUNSparseMatrix_IndexPointers)(matrix), &elements.begins);
                fill((sundials.SUNSparseMatrix_IndexValues)(matrix), &elements.rows);
                (sundials.SUNSparseMatrix_Data)(matrix)
            }
            Solver::Adams | Solver::Gmres => unreachable!("it has no matrix"),
        }
    };
    let (lower, stored) = (elements.lower, elements.stored_upper());
    elements.evaluate(problem, states, duals, rates, |position, row, column, element| {
        let place = match solver {
            Solver::Dense | Solver::LapackDense => column * size + row,
            Solver::Band | Solver::LapackBand => column * (stored + lower + 1) + stored + row - column,
            _ => position,
        };
        // SAFETY: the place is in the matrix, which is by columns, and zero elsewhere.
        unsafe { *data.add(place) = element };
    });
    0
}

impl Sundials {
    /// The elements of a vector.
    ///
    /// # Safety
    /// `vector` is a serial vector of the problem's size, of which no elements are borrowed otherwise.
    #[allow(clippy::mut_from_ref, reason = "the elements are not those of the library")]
    unsafe fn array<P: Problem>(&self, vector: Pointer) -> &mut [f64] {
        // SAFETY: as this function's.
        unsafe {
            slice::from_raw_parts_mut((self.N_VGetArrayPointer)(vector), P::Variables::STATE_NOMINALS.len())
        }
    }
}

/// A number as SUNDIALS takes it.
fn count(number: usize) -> c_int {
    c_int::try_from(number).expect("problems are small")
}

/// Writes numbers to an array.
///
/// # Safety
/// `array` is as long as `numbers`.
unsafe fn fill(array: *mut c_int, numbers: &[usize]) {
    for (place, &number) in numbers.iter().enumerate() {
        // SAFETY: as this function's.
        unsafe { *array.add(place) = count(number) };
    }
}

/// Ends the program where SUNDIALS reports an error in its set-up.
fn check(status: c_int) {
    assert_eq!(status, 0, "SUNDIALS reports an error");
}

impl<'a, P: Problem> Cvode<'a, P> {
    pub fn new(sundials: &'a Sundials, solver: Solver, elements: &'a Elements) -> Self {
        Self { sundials, solver, elements, problem: P::default(), states: vec![], rates: vec![] }
    }

    /// The states at the end, and the processor time in s. None when the solver fails, or takes too many steps.
    pub fn run(&mut self, tolerance: f64, steps: u32, way: Way) -> Option<(Vec<f64>, f64)> {
        self.problem = P::default();
        let sundials = self.sundials;
        let size = count(P::Variables::STATE_NOMINALS.len());
        let mut context = ptr::null_mut();
        // SAFETY: all pointers are of this context, and live until they are freed below; the data live as long as this.
        unsafe {
            check((sundials.SUNContext_Create)(0, &raw mut context));
            // What a solver reports is its result here.
            check((sundials.SUNContext_ClearErrHandlers)(context));
            let vector = (sundials.N_VNew_Serial)(size, context);
            let states = sundials.array::<P>(vector);
            states.fill(0.0);
            P::start(states);
            let mut memory =
                (sundials.CVodeCreate)(if self.solver == Solver::Adams { ADAMS } else { BDF }, context);
            check((sundials.CVodeInit)(memory, rates::<P>, 0.0, vector));
            let nominal = P::Variables::STATE_NOMINALS[0];
            check((sundials.CVodeSStolerances)(memory, tolerance, tolerance * nominal));
            check((sundials.CVodeSetMaxNumSteps)(memory, MOST_STEPS));
            // Where the tolerance asks for steps within the rounding of the time, the errors show it.
            check((sundials.CVodeSetMaxHnilWarns)(memory, -1));
            check((sundials.CVodeSetUserData)(memory, ptr::from_mut(self).cast()));
            let elements = self.elements;
            let matrix = match self.solver {
                Solver::Adams | Solver::Gmres => ptr::null_mut(),
                Solver::Dense | Solver::LapackDense => (sundials.SUNDenseMatrix)(size, size, context),
                Solver::Band | Solver::LapackBand => {
                    let [upper, lower] = [elements.upper, elements.lower].map(count);
                    (sundials.SUNBandMatrix)(size, upper, lower, context)
                }
                Solver::SuperLuMt => {
                    let number = count(elements.rows.len());
                    (sundials.SUNSparseMatrix)(size, size, number, BY_COLUMNS, context)
                }
            };
            let solver = match self.solver {
                Solver::Adams => (sundials.SUNNonlinSol_FixedPoint)(vector, 0, context),
                Solver::Dense => (sundials.SUNLinSol_Dense)(vector, matrix, context),
                Solver::LapackDense => (sundials.SUNLinSol_LapackDense)(vector, matrix, context),
                Solver::Band => (sundials.SUNLinSol_Band)(vector, matrix, context),
                Solver::LapackBand => (sundials.SUNLinSol_LapackBand)(vector, matrix, context),
                Solver::SuperLuMt => (sundials.SUNLinSol_SuperLUMT)(vector, matrix, 1, context),
                Solver::Gmres => {
                    (sundials.SUNLinSol_SPGMR)(vector, WITHOUT_PRECONDITIONER, DEFAULT_DIMENSION, context)
                }
            };
            if self.solver == Solver::Adams {
                check((sundials.CVodeSetNonlinearSolver)(memory, solver));
            } else {
                check((sundials.CVodeSetLinearSolver)(memory, solver, matrix));
            }
            if self.solver.has_matrix() {
                check((sundials.CVodeSetJacFn)(memory, jacobian::<P>));
            }
            let begin = crate::processor_time();
            let is_solved = self.advance(memory, vector, steps, way);
            let seconds = crate::processor_time() - begin;
            let states = sundials.array::<P>(vector).to_vec();
            (sundials.CVodeFree)(&raw mut memory);
            if self.solver == Solver::Adams {
                check((sundials.SUNNonlinSolFree)(solver));
            } else {
                check((sundials.SUNLinSolFree)(solver));
            }
            if self.solver.has_matrix() {
                (sundials.SUNMatDestroy)(matrix);
            }
            (sundials.N_VDestroy)(vector);
            check((sundials.SUNContext_Free)(&raw mut context));
            is_solved.then_some((states, seconds))
        }
    }

    /// Steps from point to point until the end, by way of the problem's events. Returns whether that succeeded.
    ///
    /// # Safety
    /// The memory is CVODE's for this problem, with its vector of states.
    unsafe fn advance(&mut self, memory: Pointer, vector: Pointer, steps: u32, way: Way) -> bool {
        let sundials = self.sundials;
        let variables = P::Variables::default();
        let point_of = |step: f64| P::END * step / f64::from(steps);
        let mut time = 0.0;
        for step in 1..=steps {
            let point = point_of(f64::from(step));
            loop {
                let event = self.problem.next_event(time, &variables).map(|event| {
                    let nearest = point_of((event / P::END * f64::from(steps)).round());
                    if (event - nearest).abs() <= ROUNDING * nearest { nearest } else { event }
                });
                let next = event.map_or(point, |event| event.min(point));
                let stop = if way == Way::Free { event.unwrap_or(P::END).min(P::END) } else { next };
                // SAFETY: as this function's.
                unsafe {
                    check((sundials.CVodeSetStopTime)(memory, stop));
                    if (sundials.CVode)(memory, next, vector, &raw mut time, NORMAL) < 0 {
                        return false;
                    }
                }
                time = next;
                let is_event = event == Some(next);
                if is_event {
                    let event = Event { time: next, is_initial: false, is_due: true, indicators: &[] };
                    let mut log = |_: &str, _: std::fmt::Arguments<'_>| {};
                    let mut context = Context::new(Experiment::default(), &mut log);
                    self.problem
                        .event(&event, &mut P::Variables::default(), &mut context)
                        .expect("problems go on");
                }
                if is_event || (way == Way::Restart && next >= point) {
                    // SAFETY: as this function's.
                    check(unsafe { (sundials.CVodeReInit)(memory, time, vector) });
                }
                if next >= point {
                    break;
                }
            }
        }
        true
    }
}
