//! An importer with arguments at any address; debug assertions detect each unaligned access.

use std::ffi::c_int;
use std::ptr;

use boost_fmu::controller::BoostController;
use fmu_export::description::ValueReference;
use fmu_export::fmi2::c_api;
use fmu_export::fmi2::c_types::{FmuState, Status, status_kind};

use super::importer::{Functions, Importer, Interface};
use super::{opening, reference};

/// An importer's memory, aligned as a whole, in which every argument is unaligned.
#[repr(C, align(8))]
struct Memory(Arguments);

#[repr(C, packed)]
struct Arguments {
    offset: u8,
    references: [ValueReference; 2],
    values: [f64; 2],
    integer: c_int,
    size: usize,
    state: FmuState,
}

#[test]
fn arguments_may_lie_at_any_address() {
    type Model = BoostController;
    let interface = Interface::CoSimulation;
    let mut importer = Importer::<Model>::new(interface, Functions::co_simulation::<Model>());
    importer.run(&opening(interface, &[])).unwrap();
    let names = ["boost_reference", "boost_pressure"];
    let mut memory = Memory(Arguments {
        offset: 0,
        references: names.map(reference::<Model>),
        values: [130e3, 120e3],
        integer: 0,
        size: 0,
        state: ptr::null_mut(),
    });
    let references = (&raw const memory.0.references).cast::<ValueReference>();
    let values = (&raw mut memory.0.values).cast::<f64>();
    let (integer, size) = (&raw mut memory.0.integer, &raw mut memory.0.size);
    let state = &raw mut memory.0.state;
    assert!(!references.is_aligned() && !values.is_aligned() && !integer.is_aligned());
    assert!(!size.is_aligned() && !state.is_aligned());
    let expected = importer.snapshot().bytes.len();
    let component = importer.component;
    // SAFETY: the pointers are to the fields of `memory`, and the component is the importer's.
    unsafe {
        assert_eq!(c_api::set_real::<Model>(component, references, 2, values), Status::Ok);
        memory.0.values = [0.0; 2];
        assert_eq!(c_api::get_real::<Model>(component, references, 2, values), Status::Ok);
        assert_eq!({ memory.0.values }.map(f64::to_bits), [130e3, 120e3].map(f64::to_bits));
        let kind = status_kind::LAST_SUCCESSFUL_TIME;
        assert_eq!(c_api::get_real_status::<Model>(component, kind, values), Status::Ok);
        assert_eq!({ memory.0.values }[0].to_bits(), 0.0125_f64.to_bits());
        memory.0.references = [reference::<Model>("sample_count"); 2];
        assert_eq!(c_api::get_integer::<Model>(component, references, 1, integer), Status::Ok);
        assert_eq!({ memory.0.integer }, 1);

        assert_eq!(c_api::get_fmu_state::<Model>(component, state), Status::Ok);
        let handle = memory.0.state;
        assert_eq!(c_api::serialized_fmu_state_size::<Model>(component, handle, size), Status::Ok);
        assert_eq!({ memory.0.size }, expected);
        assert_eq!(c_api::free_fmu_state::<Model>(component, state), Status::Ok);
        assert!({ memory.0.state }.is_null());
    }
}
