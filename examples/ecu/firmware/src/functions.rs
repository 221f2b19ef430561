//! Firmware that runs every function of `Number` and `Float`: a frame with two numbers and their derivatives gets the results
//! as `f64`, as numbers with derivatives, and as `f32`.
#![no_std]
#![no_main]

#[allow(dead_code, reason = "it needs the serial line alone")]
mod board;
#[path = "../../functions.rs"]
mod functions;

use cortex_m_rt::entry;
use fmu_export::Dual;
use fmu_export::frames::{self, Kind, Receiver};
use functions::{float, number};

#[entry]
fn main() -> ! {
    let line = board::SerialLine::new();
    let mut receiver = Receiver::<256>::new();
    loop {
        if let Some(byte) = line.receive()
            && let Some((Kind::Sample, content)) = receiver.take(byte)
        {
            let mut numbers = frames::cells(content).map(f64::from_bits);
            let mut next = || numbers.next().unwrap_or(f64::NAN);
            let [x, y] = [Dual::new(next(), next()), Dual::new(next(), next())];
            let values = number::all(x.value, y.value).into_iter();
            let duals = number::all(x, y).into_iter().flat_map(|dual| [dual.value, dual.derivative]);
            let singles = float::all(x.value as f32, y.value as f32).into_iter().map(f64::from);
            let results = values.chain(duals).chain(singles).map(f64::to_bits);
            frames::send(Kind::Answer, frames::bytes(results), |byte| line.send(byte));
        }
        board::wait();
    }
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {
        cortex_m::asm::nop();
    }
}
