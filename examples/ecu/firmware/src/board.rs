//! The board mps2-an500: its serial line, its timer and its watchdog (Arm application note 500; Cortex-M System Design Kit,
//! technical reference manual, chapter 4).

use core::ptr;
use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::peripheral::{NVIC, SCB, SYST};
use cortex_m::{asm, interrupt};

/// The processor's clock in Hz.
const CLOCK: f64 = 25e6;

/// A register of the board.
#[derive(Clone, Copy)]
struct Register(usize);

impl Register {
    fn read(self) -> u32 {
        // SAFETY: the board has a register of 32 bits at each address below; reading one changes nothing in memory.
        unsafe { ptr::with_exposed_provenance::<u32>(self.0).read_volatile() }
    }

    fn write(self, value: u32) {
        // SAFETY: as in `read`; none of the registers makes the board write to memory.
        unsafe { ptr::with_exposed_provenance_mut::<u32>(self.0).write_volatile(value) }
    }
}

/// The interrupt of the first serial line when a byte was received.
#[derive(Clone, Copy)]
struct Received;

// SAFETY: the board's first interrupt is that of the serial line's receiver.
unsafe impl InterruptNumber for Received {
    fn number(self) -> u16 {
        0
    }
}

/// The first serial line.
#[derive(Clone, Copy)]
pub struct SerialLine(());

impl SerialLine {
    const DATA: Register = Register(0x4000_4000);
    const STATE: Register = Register(0x4000_4004);
    const CONTROL: Register = Register(0x4000_4008);
    const INTERRUPT: Register = Register(0x4000_400C);
    const DIVIDER: Register = Register(0x4000_4010);
    /// Bits of the state.
    const IS_SENDING: u32 = 1;
    const HAS_RECEIVED: u32 = 2;
    /// Sending, receiving, and an interrupt after a byte was received.
    const ENABLED: u32 = 0b1011;
    /// That interrupt.
    const OF_RECEIVED: u32 = 2;
    /// The least that the line takes, which makes it fastest.
    const FASTEST: u32 = 16;

    pub fn new() -> Self {
        Self::DIVIDER.write(Self::FASTEST);
        Self::CONTROL.write(Self::ENABLED);
        interrupt::disable();
        // SAFETY: while interrupts are disabled, it wakes the processor only.
        unsafe { NVIC::unmask(Received) }
        Self(())
    }

    /// The next byte, if one has arrived.
    pub fn receive(self) -> Option<u8> {
        // In this order: the line's signal rises again for a byte that arrives after it is cleared, and wakes the processor.
        NVIC::unpend(Received);
        Self::INTERRUPT.write(Self::OF_RECEIVED);
        (Self::STATE.read() & Self::HAS_RECEIVED != 0).then(|| Self::DATA.read() as u8)
    }

    /// Sends a byte, after those before it.
    pub fn send(self, byte: u8) {
        while Self::STATE.read() & Self::IS_SENDING != 0 {}
        Self::DATA.write(byte.into());
    }
}

/// The processor's timer, which releases samples.
pub struct Timer(SYST);

impl Timer {
    pub fn new(timer: SYST) -> Self {
        Self(timer)
    }

    /// Starts it, with a period in s.
    pub fn start(&mut self, period: f64) {
        self.0.set_clock_source(SystClkSource::Core);
        self.0.set_reload((period * CLOCK) as u32 - 1);
        self.0.clear_current();
        self.0.enable_counter();
        self.0.enable_interrupt();
    }

    /// Whether it has elapsed since this was called last.
    pub fn has_elapsed(&mut self) -> bool {
        SCB::clear_pendst();
        self.0.has_wrapped()
    }
}

/// Waits for the timer or the serial line. Their interrupts wake the processor, but interrupt nothing.
pub fn wait() {
    asm::wfi();
}

/// Counts the ticks of a clock of the board, at the processor's rate.
pub struct Stopwatch(u32);

impl Stopwatch {
    const CONTROL: Register = Register(0x4000_0000);
    const VALUE: Register = Register(0x4000_0004);
    const RELOAD: Register = Register(0x4000_0008);

    pub fn start() -> Self {
        Self::RELOAD.write(u32::MAX);
        Self::VALUE.write(u32::MAX);
        Self::CONTROL.write(1);
        Self(Self::VALUE.read())
    }

    /// Stops it. Returns the ticks since the start.
    pub fn stop(self) -> u32 {
        // It counts down.
        let ticks = self.0.wrapping_sub(Self::VALUE.read());
        Self::CONTROL.write(0);
        ticks
    }
}

/// Resets the board unless it is fed.
pub struct Watchdog {
    is_running: bool,
}

/// What the memory has after a start of the watchdog, even when the board has been reset: two words that no other cause
/// leaves there.
#[unsafe(link_section = ".uninit")]
static STARTED: [AtomicU32; 2] = [AtomicU32::new(0), AtomicU32::new(0)];
const MARKS: [u32; 2] = [0x5AFE_D006, 0x600D_F00D];

impl Watchdog {
    const LOAD: Register = Register(0x4000_8000);
    const CONTROL: Register = Register(0x4000_8008);
    const CLEAR: Register = Register(0x4000_800C);
    const LOCK: Register = Register(0x4000_8C00);
    /// What unlocks the registers.
    const KEY: u32 = 0x1ACC_E551;
    /// Counting, and the reset after it has elapsed a second time.
    const ENABLED: u32 = 3;

    pub fn new() -> Self {
        Self { is_running: false }
    }

    /// Whether the watchdog had been started when the board was reset.
    pub fn has_reset() -> bool {
        STARTED.each_ref().map(|word| word.load(Ordering::Relaxed)) == MARKS
    }

    /// Starts it, for a time in s. It resets the board when it has elapsed twice.
    pub fn start(&mut self, time: f64) {
        if !self.is_running {
            self.is_running = true;
            STARTED.iter().zip(MARKS).for_each(|(word, mark)| word.store(mark, Ordering::Relaxed));
            Self::LOCK.write(Self::KEY);
            Self::LOAD.write((0.5 * time * CLOCK) as u32);
            Self::CONTROL.write(Self::ENABLED);
        }
    }

    /// Begins its time anew.
    pub fn feed(&mut self) {
        if self.is_running {
            Self::CLEAR.write(1);
        }
    }
}
