//! The types of the functions of FMI, with a plain number as a status.

pub mod fmi2 {
    use std::ffi::c_int as Status;

    use fmu_abi::fmi2::c_types::{
        Boolean, Byte, Component, Enumeration, EventInfo, FmuState, Integer, String, ValueReference,
    };

    use super::super::logger::CallbackFunctions;

    fmu_abi::fmi2_calls!(fmu_abi::function_types);
}

pub mod fmi3 {
    use std::ffi::c_int as Status;

    use fmu_abi::fmi3::c_types::{
        Binary, Boolean, Byte, Clock, ClockUpdateCallback, Enumeration, FmuState, Instance,
        IntermediateUpdateCallback, PreemptionCallback, String, ValueReference,
    };

    use super::super::live::Environment as InstanceEnvironment;

    type LogMessageCallback = unsafe extern "C" fn(InstanceEnvironment, Status, String, String);

    fmu_abi::fmi3_calls!(fmu_abi::function_types);
}
