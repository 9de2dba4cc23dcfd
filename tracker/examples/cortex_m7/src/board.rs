//! Start, output and end on the board.

use core::panic::PanicInfo;
use core::ptr::addr_of_mut;

use cortex_m_rt::entry;
use cortex_m_semihosting::debug::{EXIT_FAILURE, EXIT_SUCCESS, exit};
use cortex_m_semihosting::hprintln;

use crate::sequence::{MEMORY, track};

static mut WORKSPACE: [u8; MEMORY] = [0; MEMORY];

/// Written over the free stack at the start; what is left of it at the end was never used.
const PAINT: u32 = 0xa5a5_5a5a;
/// Bytes of stack that are painted.
const PAINTED: usize = 512 * 1024;
/// Bytes below the stack pointer that the painting itself may use.
const MARGIN: usize = 512;

#[entry]
fn main() -> ! {
    let top = cortex_m::register::msp::read() as usize;
    let bottom = top - PAINTED;
    for address in (bottom..top - MARGIN).step_by(4) {
        // SAFETY: RAM between the static data and the stack in use; memory.x leaves more than PAINTED bytes there.
        unsafe { (address as *mut u32).write_volatile(PAINT) };
    }
    // SAFETY: the only reference, made once.
    let memory = unsafe { &mut *addr_of_mut!(WORKSPACE) };
    let tracked = track(memory, |line| hprintln!("{}", line));
    // SAFETY: the words that were painted above.
    let untouched = |address: &usize| unsafe { (*address as *const u32).read_volatile() } == PAINT;
    let free = (bottom..top).step_by(4).take_while(untouched).count() * 4;
    hprintln!("stack high-water {} bytes, workspace {} bytes", PAINTED - free, MEMORY);
    exit(if tracked { EXIT_SUCCESS } else { EXIT_FAILURE });
    loop {}
}

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    hprintln!("{}", info);
    exit(EXIT_FAILURE);
    loop {}
}
