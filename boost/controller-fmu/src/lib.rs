//! The controller as an FMI 2.0 co-simulation FMU: the functions of the standard around
//! [`boost_fmu::BoostController`].
#![allow(non_snake_case)]

boost_fmu::controller::variables::export_functions!(boost_fmu::BoostController);
