//! The steps with a bare board: the chip by itself, the line, and a converter on a breadboard.

use tactus_core::wire::bringup::{KERNELS, Measure, READINGS, Saw};

use super::judge::{Finding, bare as judge, watchdog};
use super::mistakes as m;
use super::seams::Trouble;
use super::steps::{Bench, Run, Step, ask};

/// Conversions that are fetched over the line, 0.1 s each, and the parts of their series.
const ROUNDS: u16 = 40;
/// Looks at the potentiometer, as long.
const TURNS: usize = 150;
/// The limit of checks that the board judges.
const BY_THE_BOARD: &str = "as the board judges: its limit stands beside each measurement";

/// All of them, in their order.
pub(super) static BARE: &[Step] = &[
    Step {
        key: "link",
        checks: "the line, and the board's seconds by the PC's",
        how: "some 100 answers and 40 KB in 5 s",
        limit: || format!("each answer at once, none damaged; {}", judge::seconds()),
        run: Run::SelfTest(link),
    },
    Step {
        key: "clocks",
        checks: "the core's clock by its timers, the 8 MHz, PA12, the last reset",
        how: "the board looks",
        limit: || {
            "168000 +- 16 kHz, by the 8 MHz of the ST-LINK; PA12 low; no last words".to_owned()
        },
        run: Run::SelfTest(|bench| {
            let (reset, last_words) = bench.hello()?;
            let seen = ask!(bench, Measure::Chip, Chip);
            Ok(judge::clocks(&seen, reset, last_words.as_deref()))
        }),
    },
    Step {
        key: "kernels",
        checks: "the kernels in assembly, bit for bit",
        how: "the board computes a slide by them and by their plain twins",
        limit: || BY_THE_BOARD.to_owned(),
        run: Run::SelfTest(|bench| {
            let mut all = Vec::new();
            for number in 0..KERNELS {
                all.extend(ask!(bench, Measure::Kernel(number), Checks));
            }
            Ok(judge::checks(&all, &m::KERNEL))
        }),
    },
    Step {
        key: "timers",
        checks: "the timer of the slots, the converter and its DMA",
        how: "the board counts their cycles",
        limit: || BY_THE_BOARD.to_owned(),
        run: Run::SelfTest(|bench| {
            Ok(judge::checks(
                &ask!(bench, Measure::Timers, Checks),
                &m::TIMER,
            ))
        }),
    },
    Step {
        key: "flash",
        checks: "the flash's writes and erases",
        how: "the board writes to its last sector, reads it, and erases it",
        limit: || BY_THE_BOARD.to_owned(),
        run: Run::SelfTest(|bench| {
            Ok(judge::checks(
                &ask!(bench, Measure::Flash, Checks),
                &m::FLASH,
            ))
        }),
    },
    Step {
        key: "reset",
        checks: "the watchdog",
        how: "the board hangs on purpose",
        limit: || "it starts again, by the watchdog".to_owned(),
        run: Run::SelfTest(|bench| Ok(watchdog(bench.board.restart(Measure::Watchdog)?))),
    },
    Step {
        key: "converter",
        checks: "an MCP3202 on a breadboard, read as the finger `analog` is",
        how: "the person wires it and a potentiometer of 10 kohm",
        limit: || format!("all readings driven, CH1 at {} counts or more", judge::HIGH),
        run: Run::SelfTest(|bench| {
            let wires = ask!(bench, Measure::Wires, Wires);
            bench.person.done(&wiring(wires))?;
            Ok(judge::converter(&ask!(
                bench,
                Measure::Converter,
                Converter
            )))
        }),
    },
    Step {
        key: "turn",
        checks: "the potentiometer from end to end",
        how: "the person turns it",
        limit: || format!("CH0 from {} or less to {} or more", judge::LOW, judge::HIGH),
        run: Run::SelfTest(|bench| {
            bench
                .person
                .watch("Turn the potentiometer slowly from one end to the other, within 20 s.")?;
            let mut all = Vec::new();
            for _ in 0..TURNS {
                let seen = ask!(bench, Measure::Converter, Converter);
                let [[low, high], _] = seen.counts;
                bench
                    .person
                    .show(&format!("CH0: {low:4} to {high:4} counts"))?;
                all.push(seen);
                if judge::turned(&all).passed() {
                    break;
                }
            }
            Ok(judge::turned(&all))
        }),
    },
];

/// Those of a handheld beside its finger.
pub(super) static HAND: &[Step] = &[
    Step {
        key: "display",
        checks: "the handheld's display",
        how: "the board lights all of its points, the person looks",
        limit: || "it answers, and is lit".to_owned(),
        run: Run::SelfTest(|bench| {
            let seen = ask!(bench, Measure::Hand, Hand);
            let lit = bench
                .person
                .choose("Is the whole display lit?", &["yes", "no"])?
                == 0;
            Ok(judge::display(&seen, lit))
        }),
    },
    Step {
        key: "button",
        checks: "the handheld's button",
        how: "the person presses it",
        limit: || "PC13 is high while it is pressed".to_owned(),
        run: Run::SelfTest(|bench| {
            bench.person.done("Leave the button alone")?;
            let let_go = ask!(bench, Measure::Hand, Hand);
            bench.person.done("Press the button and keep it pressed")?;
            let pressed = ask!(bench, Measure::Hand, Hand);
            bench.person.done("Let the button go")?;
            Ok(judge::button(&let_go, &pressed))
        }),
    },
    Step {
        key: "buzzer",
        checks: "the handheld's buzzer",
        how: "the person listens",
        limit: || "a tone of 2 kHz".to_owned(),
        run: Run::SelfTest(|bench| {
            ask!(bench, Measure::Hand, Hand);
            let heard = bench
                .person
                .choose("Did the buzzer sound?", &["yes", "no"])?
                == 0;
            Ok(judge::buzzer(heard))
        }),
    },
];

/// Fetches series as long as a frame can be, and compares times.
fn link(bench: &mut Bench<'_>) -> Result<Finding, Trouble> {
    bench.hello()?;
    let (before, [board_ms, host_ms]) = (bench.board.traffic(), bench.board.times_ms());
    let mut bytes = 0;
    for _ in 0..ROUNDS {
        ask!(bench, Measure::Converter, Converter);
        for from in [0, READINGS / 2] {
            bytes += 4 * ask!(bench, Measure::Series(from), Series).len();
        }
    }
    let (after, [board, host]) = (bench.board.traffic(), bench.board.times_ms());
    Ok(judge::link(
        std::array::from_fn(|at| after[at] - before[at]),
        bytes,
        [board - board_ms, host - host_ms],
    ))
}

/// The wires of the breadboard, by the pins that the board names.
fn wiring(pins: [u8; 4]) -> String {
    let [clock, miso, mosi, select] = pins.map(|pin| {
        let name = format!("P{}{}", char::from(b'A' + (pin >> 4)), pin & 15);
        match CONNECTORS.iter().find(|(port, _)| *port == name) {
            Some((_, place)) => format!("{name} ({place})"),
            None => name,
        }
    });
    format!(
        "With the USB plug out (q ends this; the same command goes on), put an MCP3202 on a breadboard and wire its \
         pins: 1 CS to {select}, 2 CH0 to the \
         potentiometer's middle, 3 CH1 to 3V3, 4 VSS to GND, 5 DIN to {mosi}, 6 DOUT to {miso}, 7 CLK to {clock}, 8 \
         VDD to 3V3; the potentiometer's ends to 3V3 and GND; nothing to 5V"
    )
}

/// Names of pins at the connectors (UM1974, and the rig's page).
const CONNECTORS: [(&str, &str); 4] = [
    ("PA5", "D13"),
    ("PA6", "D12"),
    ("PB5", "D22"),
    ("PD14", "D10"),
];
