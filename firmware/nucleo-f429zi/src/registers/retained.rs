//! Memory that survives a reset, but not a power loss: boot number and the cause of a self-stop.

use core::{cell::UnsafeCell, mem::MaybeUninit, slice, str};

use farnear_rig::identity::LastWords;

/// Marks valid contents ("fnRT").
const MAGIC: u32 = 0x666e_5254;
const WORDS: usize = 8;
/// Range of constants, and longest plausible file name.
const FLASH: core::ops::Range<usize> = 0x0800_0000..0x0820_0000;
const NAME_MAX: usize = 200;

/// [magic, boot number, reason, three words about it, 0, check]; see [`Last`].
struct Retained(UnsafeCell<MaybeUninit<[u32; WORDS]>>);

// SAFETY: all access is through `read` and `write`, inside critical sections or with interrupts off for good.
unsafe impl Sync for Retained {}

// SAFETY: `.uninit` is a section of cortex-m-rt's linker script that start-up code leaves alone; it has no
// initial value, which `MaybeUninit` says.
#[unsafe(link_section = ".uninit.retained")]
static RETAINED: Retained = Retained(UnsafeCell::new(MaybeUninit::uninit()));

/// The DAC's code in the lower half, its complement in the upper.
struct PiezoCode(UnsafeCell<MaybeUninit<u32>>);

// SAFETY: all access is by single, aligned, volatile words, from thread mode and an interrupt that never returns.
unsafe impl Sync for PiezoCode {}

// SAFETY: as of `RETAINED`.
#[unsafe(link_section = ".uninit.piezo_code")]
static PIEZO_CODE: PiezoCode = PiezoCode(UnsafeCell::new(MaybeUninit::uninit()));

pub fn keep_piezo_code(code: u16) {
    set_piezo_code(Some(code));
}

/// `None`: unknown.
pub fn set_piezo_code(code: Option<u16>) {
    let word = code.map_or(0, |code| u32::from(code) | u32::from(!code) << 16);
    // SAFETY: the place is valid, aligned static memory; see `PiezoCode`.
    unsafe { PIEZO_CODE.0.get().cast::<u32>().write_volatile(word) };
}

pub fn piezo_code() -> Option<u16> {
    // SAFETY: as above; any bits are a valid u32.
    let word = unsafe { PIEZO_CODE.0.get().cast::<u32>().read_volatile() };
    let [code, complement] = [word as u16, (word >> 16) as u16];
    (code == !complement).then_some(code)
}

#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Last {
    Panic {
        file: Option<&'static str>,
        line: u32,
    },
    /// Refused instruction or access.
    Fault {
        program_counter: u32,
        /// Configurable fault status register (ARMv7-M, B3.2.15).
        status: u32,
    },
    StackOverflow,
    ClockLost,
}

impl Last {
    /// Report for the rig; a lost clock is reported by the clock in use.
    pub fn words(self) -> Option<LastWords> {
        match self {
            Self::Panic { .. } | Self::Fault { .. } => Some(LastWords::Panic),
            Self::StackOverflow => Some(LastWords::StackOverflow),
            Self::ClockLost => None,
        }
    }

    fn to_words(self) -> [u32; 4] {
        match self {
            Self::Panic { file, line } => {
                let file = file.unwrap_or("");
                [1, file.as_ptr() as u32, file.len() as u32, line]
            }
            Self::Fault { program_counter, status } => [2, program_counter, status, 0],
            Self::StackOverflow => [3, 0, 0, 0],
            Self::ClockLost => [4, 0, 0, 0],
        }
    }

    fn from_words(words: [u32; 4]) -> Option<Self> {
        match words {
            [1, pointer, length, line] => Some(Self::Panic { file: name(pointer, length), line }),
            [2, program_counter, status, _] => Some(Self::Fault { program_counter, status }),
            [3, ..] => Some(Self::StackOverflow),
            [4, ..] => Some(Self::ClockLost),
            _ => None,
        }
    }
}

/// A constant text of an earlier run of this program.
fn name(pointer: u32, length: u32) -> Option<&'static str> {
    let (from, length) = (pointer as usize, length as usize);
    let within = FLASH.contains(&from) && length <= NAME_MAX && FLASH.contains(&(from + length));
    // SAFETY: the bytes lie in the flash, which is always there and is not written while the program runs.
    let bytes = within.then(|| unsafe { slice::from_raw_parts(pointer as *const u8, length) })?;
    // Another program may have been flashed.
    str::from_utf8(bytes).ok()
}

fn check(words: &[u32; WORDS]) -> u32 {
    words[..WORDS - 1].iter().fold(!0, |sum: u32, word| sum.rotate_left(5) ^ word)
}

fn read() -> Option<[u32; WORDS]> {
    // SAFETY: the place is valid, aligned static memory; see `Retained`. Any bits are a valid [u32; WORDS];
    // volatile, so that the compiler cannot reason from "uninitialised".
    let words = unsafe { RETAINED.0.get().cast::<[u32; WORDS]>().read_volatile() };
    (words[0] == MAGIC && words[WORDS - 1] == check(&words)).then_some(words)
}

fn write(boot: u32, last: [u32; 4]) {
    let [a, b, c, d] = last;
    let mut words = [MAGIC, boot, a, b, c, d, 0, 0];
    words[WORDS - 1] = check(&words);
    // SAFETY: as in `read`.
    unsafe { RETAINED.0.get().cast::<[u32; WORDS]>().write_volatile(words) };
}

/// Boot number (one more than the last, 1 after a power loss, never 0) and cause of the last stop, given once.
pub fn take() -> (u32, Option<Last>) {
    critical_section::with(|_| {
        let Some([_, boot, a, b, c, d, ..]) = read() else {
            write(1, [0; 4]);
            return (1, None);
        };
        let next = boot.wrapping_add(1).max(1);
        write(next, [0; 4]);
        (next, Last::from_words([a, b, c, d]))
    })
}

/// Corrects the boot number from the board's memory.
pub fn set_boot(boot: u32) {
    critical_section::with(|_| write(boot, [0; 4]));
}

/// Stores the cause for the next boot. Call with interrupts off, just before a reset.
pub fn leave(last: Last) {
    let boot = read().map_or(0, |words| words[1]);
    write(boot, last.to_words());
}
