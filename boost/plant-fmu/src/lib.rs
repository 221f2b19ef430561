//! The plant as an FMI 2.0 co-simulation FMU: the functions of the standard around
//! [`boost_fmu::plant::BoostPlant`].
#![allow(non_snake_case)]

boost_fmu::plant::variables::export_functions!(boost_fmu::plant::BoostPlant);
