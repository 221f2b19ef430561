//! The boost pressure controller as firmware of a Cortex-M7: the same Rust as in the FMU, around which there is a serial line
//! with [frames], a timer, a watchdog and a page of parameters for calibration tools.
//!
//! A frame with inputs releases a sample and gets an answer: the plant is in the loop, simulated step by step. Or a frame
//! brings measurements, and a timer releases the samples: then the watchdog resets a firmware that misses three of them, and
//! without measurements, or after that reset until there are some, the engine limps home.
#![no_std]
#![no_main]

mod board;
mod controller;
mod stack;

use cortex_m::singleton;
use cortex_m_rt::entry;
use fmu_export::calibration::Cells;
use fmu_export::frames::{self, Kind, Receiver};

use board::{SerialLine, Timer, Watchdog};
use boost_fmu::controller::variables::calibration::{A2L, MEASUREMENTS as MEASURED, PARAMETERS};
use controller::Controller;

/// The parameters as calibration tools write them; the A2L knows the name.
#[used]
#[unsafe(no_mangle)]
static CALIBRATION_PAGE: Cells<PARAMETERS> = Cells::new();

/// The other variables after each sample; the A2L knows the name.
#[used]
#[unsafe(no_mangle)]
static MEASUREMENTS: Cells<MEASURED> = Cells::new();

/// The A2L without addresses, beside the program.
#[used]
#[unsafe(link_section = ".a2l")]
static DESCRIPTION: [u8; A2L.len()] = *A2L;

/// The longest frame that is received; the inputs are among what is measured.
const LONGEST_FRAME: usize = frames::longest_frame(MEASURED);

#[entry]
fn main() -> ! {
    stack::paint();
    let Some(controller) = singleton!(: Option<Controller> = None) else { stop() };
    let Some(receiver) = singleton!(: Receiver<LONGEST_FRAME> = Receiver::new()) else { stop() };
    let line = SerialLine::new();
    let Some(peripherals) = cortex_m::Peripherals::take() else { stop() };
    let mut timer = Timer::new(peripherals.SYST);
    let controller = controller.insert(Controller::new(&CALIBRATION_PAGE, &MEASUREMENTS, line));
    let mut watchdog = Watchdog::new();
    if Watchdog::has_reset() {
        controller.limp_home();
        start(&mut timer, &mut watchdog, controller);
    }
    loop {
        if let Some(byte) = line.receive()
            && let Some((kind, content)) = receiver.take(byte)
        {
            match kind {
                Kind::Page => controller.write_page(frames::cells(content)),
                Kind::Initialize => controller.initialize(frames::cells(content)),
                Kind::Sample => controller.sample(frames::cells(content)),
                Kind::Statistics => controller.send_statistics(),
                Kind::Measurements if controller.take_measurements(frames::cells(content)) => {
                    start(&mut timer, &mut watchdog, controller);
                }
                _ => {}
            }
        }
        if timer.has_elapsed() {
            controller.release();
            watchdog.feed();
        }
        board::wait();
    }
}

/// Has the timer release samples, and the watchdog see to it.
fn start(timer: &mut Timer, watchdog: &mut Watchdog, controller: &Controller) {
    timer.start(controller.period());
    watchdog.start(3.0 * controller.period());
}

/// Ends where nothing can go on; the watchdog, if it runs, resets the board. Debuggers know the name.
#[inline(never)]
#[unsafe(no_mangle)]
extern "C" fn stop() -> ! {
    loop {
        cortex_m::asm::nop();
    }
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    stop()
}
