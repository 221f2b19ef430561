//! The floating-point environment assumed by compiled Rust: round to nearest, keep subnormal numbers, trap nowhere.
//!
//! The importer's environment may differ: hosts in Fortran and Delphi enable traps, others round differently or flush
//! subnormal numbers. Traps would kill a healthy process, because LLVM divides before it knows whether the quotient is
//! needed; the other differences would change results.
//!
//! An importer written in Rust has the same need after each call of an FMU: [`restored_after`].
//!
//! Functions that only copy and compare numbers skip the switch: the environment affects only their warning about an
//! input below zero by a subnormal number.

/// Runs code in that environment, and restores the importer's (FMI 2.0.5, section 2.1.1).
#[inline]
pub fn in_default_environment<T>(body: impl FnOnce() -> T) -> T {
    let importers = control::read();
    let is_default = control::settings(importers) == control::settings(control::DEFAULT);
    let _restored = (!is_default).then(|| Restored::after(control::DEFAULT, importers));
    body()
}

/// Runs foreign code, and restores the environment if the code changed it. Returns also whether it did.
#[inline]
pub fn restored_after<T>(foreign: impl FnOnce() -> T) -> (T, bool) {
    let own = control::read();
    let result = foreign();
    let is_changed = control::settings(own) != control::settings(control::read());
    if is_changed {
        control::write(own);
    }
    (result, is_changed)
}

/// Restores the importer's register.
struct Restored(control::Register);

impl Restored {
    fn after(replacement: control::Register, importers: control::Register) -> Self {
        control::write(replacement);
        Self(importers)
    }
}

impl Drop for Restored {
    fn drop(&mut self) {
        control::write(self.0);
    }
}

/// MXCSR.
#[cfg(target_arch = "x86_64")]
mod control {
    use core::arch::asm;

    pub(super) type Register = u32;

    /// The register's value with all exceptions masked.
    pub(super) const DEFAULT: Register = 0x1F80;

    /// The register without its flags.
    pub(super) fn settings(register: Register) -> Register {
        register & !0x3F
    }

    #[inline]
    pub(super) fn read() -> Register {
        let mut register = 0;
        // SAFETY: writes four bytes to where the pointer leads.
        unsafe { asm!("stmxcsr [{}]", in(reg) &raw mut register, options(nostack, preserves_flags)) };
        register
    }

    #[cold]
    #[inline(never)]
    pub(super) fn write(register: Register) {
        // SAFETY: the value is the default or a previous one of the register, so it sets no reserved bit. Rust
        // computes only under the default.
        unsafe { asm!("ldmxcsr [{}]", in(reg) &raw const register, options(nostack, preserves_flags)) };
    }
}

/// FPCR.
#[cfg(target_arch = "aarch64")]
mod control {
    use core::arch::asm;

    pub(super) type Register = u64;

    pub(super) const DEFAULT: Register = 0;

    /// The flags are in another register.
    pub(super) fn settings(register: Register) -> Register {
        register
    }

    #[inline]
    pub(super) fn read() -> Register {
        let register;
        // SAFETY: reads a register that every program may read.
        unsafe { asm!("mrs {}, fpcr", out(reg) register, options(nomem, nostack, preserves_flags)) };
        register
    }

    #[cold]
    #[inline(never)]
    pub(super) fn write(register: Register) {
        // SAFETY: the value is the default or a previous one of the register. Rust computes only under the default.
        unsafe { asm!("msr fpcr, {}", in(reg) register, options(nostack, preserves_flags)) };
    }
}

/// Other processors, and WebAssembly, whose arithmetic is fixed.
#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
mod control {
    pub(super) type Register = u32;

    pub(super) const DEFAULT: Register = 0;

    pub(super) fn settings(register: Register) -> Register {
        register
    }

    pub(super) fn read() -> Register {
        DEFAULT
    }

    pub(super) fn write(_: Register) {}
}
