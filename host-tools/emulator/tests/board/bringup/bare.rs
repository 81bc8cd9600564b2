//! A bare board's evening, and what may be wrong with it.

use super::*;

/// A board as it is delivered, and an MCP3202 on a breadboard.
fn bare() -> Built {
    Built {
        product: Product::Bare,
        finger: FingerName::Analog,
        brown_out: 3,
        ..Built::default()
    }
}

#[test]
fn a_sound_board_with_a_potentiometer_passes() {
    if let Some(evening) = evening(&bare(), 0) {
        assert!(evening.passed, "{}", evening.text);
    }
}

#[test]
fn what_is_wrong_with_a_bare_board_is_named() {
    let case = |step, mistake, change: fn(&mut Built)| {
        let mut built = bare();
        change(&mut built);
        Case(step, mistake, built)
    };
    let faulty = |step, mistake, fault| {
        let faults = vec![fault];
        Case(step, mistake, Built { faults, ..bare() })
    };
    play([
        case("link", "clock", |built| built.pc_clock = 0.99),
        case("clocks", "clock", |built| built.clock = false),
        case("kernels", "kernel", |built| built.wrong_kernels = true),
        // MISO is pulled up where nobody drives it
        faulty(
            "converter",
            "sensor-silent",
            Fault::MisoStuck { high: true },
        ),
        faulty("converter", "miso-stuck", Fault::MisoStuck { high: false }),
        case("converter", "sensor-silent", |built| {
            built.mistakes = vec![Miswired::SelectOpen];
        }),
        case("converter", "sensor-silent", |built| {
            built.mistakes = vec![Miswired::DataExchanged];
        }),
        case("converter", "converter-input", |built| {
            built.inputs = |turned| [4095, (4095.0 * turned) as u16];
        }),
        case("turn", "potentiometer", |built| {
            built.inputs = |_| [0, 4095]
        }),
        case("turn", "potentiometer", |built| {
            built.inputs = |_| [4095; 2]
        }),
        case("turn", "potentiometer", |built| {
            built.inputs = |turned| [1000 + (2000.0 * turned) as u16, 4095];
        }),
    ]);
}
