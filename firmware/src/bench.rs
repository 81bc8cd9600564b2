//! The bench inside the image `tactus-silicon`: does the host's workloads and counts their instructions by the core's
//! cycle counter, which on the emulated board counts one for each. No task, no interrupt: what is counted is the core's
//! code as the rig's image has it.
use core::cell::UnsafeCell;
use core::ptr::{addr_of, addr_of_mut, read_volatile, write_volatile};
use core::sync::atomic::AtomicU32;
use core::sync::atomic::Ordering::Relaxed;

use static_cell::StaticCell;
use tactus_core::dsp::Plan;

use crate::board;
use crate::checks::Cycles;
use crate::chip::{KERNELS, rescue};
use crate::workload::{Workload, run};

mod silicon;

pub use silicon::silicon;

const WORDS: usize = 8192;
const RESULTS: usize = 9000;

/// Where the host leaves work and finds results. The emulator's bench knows this layout.
#[repr(C)]
struct Desk {
    /// 0: the host's turn; 1: the chip's; 2: done; 3: makes no sense.
    state: u32,
    workload: u32,
    /// The table lies at [`TABLE_AT`].
    table_bytes: u32,
    words: u32,
    instructions: u32,
    results: u32,
    input: [i16; WORDS],
    output: [u8; RESULTS],
}

struct Shared(UnsafeCell<Desk>);
// SAFETY: one core, no interrupts; the host looks at it only while the chip waits.
unsafe impl Sync for Shared {}

/// The emulator's bench looks for this name.
#[unsafe(no_mangle)]
static BENCH_DESK: Shared = Shared(UnsafeCell::new(Desk {
    state: 0,
    workload: 0,
    table_bytes: 0,
    words: 0,
    instructions: 0,
    results: 0,
    input: [0; WORDS],
    output: [0; RESULTS],
}));

/// The sectors of bank 2 behind the store, which the rig leaves alone: a table of any size.
const TABLE_AT: usize = 0x0812_0000;
const TABLE_ROOM: usize = 0x000E_0000;

const WANTED: u32 = 0x7ac7_be7c;

/// True if the host wants the bench: it writes so before the chip starts, and the start-up code leaves it alone. After
/// power-up any other word is as likely as this one.
#[unsafe(no_mangle)]
#[unsafe(link_section = ".uninit.BENCH_WANTED")]
static BENCH_WANTED: AtomicU32 = AtomicU32::new(0);

fn is_wanted() -> bool {
    BENCH_WANTED.swap(0, Relaxed) == WANTED
}

/// Does what the host asks for, for ever. To be called once, from thread mode.
fn bench() -> ! {
    static PLAN: StaticCell<Plan> = StaticCell::new();
    let _ = rescue::reset_cause();
    // the clocks as they are on the rig
    let _ = board::start();
    cortex_m::interrupt::disable();
    if let Some(mut core) = cortex_m::Peripherals::take() {
        core.DCB.enable_trace();
        core.DWT.enable_cycle_counter();
    }
    let plan = PLAN.init_with(|| Plan::with(KERNELS));
    let desk = BENCH_DESK.0.get();
    loop {
        // SAFETY: the desk is the chip's while its state is 1, and nobody else on the chip knows it.
        unsafe {
            while read_volatile(addr_of!((*desk).state)) != 1 {}
            let state = if serve(&mut *desk, plan).is_some() {
                2
            } else {
                3
            };
            write_volatile(addr_of_mut!((*desk).state), state);
        }
    }
}

fn serve(desk: &mut Desk, plan: &Plan) -> Option<()> {
    let workload = *Workload::ALL.get(desk.workload as usize)?;
    let table_bytes = (desk.table_bytes as usize).min(TABLE_ROOM);
    // SAFETY: it is flash, which nobody writes while the chip has its turn.
    let table = unsafe { core::slice::from_raw_parts(TABLE_AT as *const u8, table_bytes) };
    let words = desk.input.get(..desk.words as usize)?;
    let mut cycles = Cycles(0);
    let (output, mut at) = (&mut desk.output, 0);
    let mut put = |bytes: &[u8]| {
        let buffer = output.get_mut(at..at + bytes.len());
        if let Some(buffer) = buffer {
            buffer.copy_from_slice(bytes);
        }
        at += bytes.len();
    };
    run(workload, plan, table, words, &mut cycles, &mut put)?;
    desk.instructions = cycles.0;
    desk.results = at as u32;
    (at <= RESULTS).then_some(())
}
