//! Mistakes of a builder, each named.

use super::*;

/// A mistake of whoever built a rig, the step that finds it, and its name.
pub(super) struct Case(
    pub(super) &'static str,
    pub(super) &'static str,
    pub(super) Built,
);

/// Plays cases, and asserts that each is named where it should be, with what to do about it.
pub(super) fn play(cases: impl IntoIterator<Item = Case>) {
    for Case(step, mistake, built) in cases {
        let mut steps = built.product.steps().into_iter();
        let from = steps.position(|one| one.key == step).unwrap();
        let Some(evening) = evening(&built, from) else {
            return;
        };
        let text = &evening.text;
        assert!(!evening.passed, "{mistake}: {text}");
        assert_eq!(
            (evening.failed.as_str(), &evening.named[..]),
            (step, &[mistake.to_owned()][..]),
            "{text}"
        );
        let mut all = MISTAKES.iter().chain(OTHER_MISTAKES);
        let known = all.find(|one| one.key == mistake).unwrap();
        assert!(
            text.contains(known.what) && text.contains(known.remedy),
            "{text}"
        );
    }
}

fn miswired(step: &'static str, mistake: &'static str, miswired: Miswired) -> Case {
    let mut built = Built::default();
    built.mistakes.push(miswired);
    Case(step, mistake, built)
}

fn broken(step: &'static str, mistake: &'static str, fault: Fault) -> Case {
    let mut built = Built::default();
    built.faults.push(fault);
    Case(step, mistake, built)
}

#[test]
fn a_mistake_of_a_kind_is_named() {
    play([
        miswired("pins", "data-exchanged", Miswired::DataExchanged),
        broken("lever-sense", "lever-dir", Fault::LeverDirInverted),
    ]);
}

#[test]
#[ignore = "long"]
fn mistakes_of_the_board_are_named() {
    let built = Built::default;
    let open = |pin| {
        let open = vec![pin];
        Case("pins", "pull-missing", Built { open, ..built() })
    };
    let logic_v = 2.9;
    let clock = false;
    let delivered = Built {
        brown_out: 3,
        ..built()
    };
    play([
        Case("supply", "supply", Built { logic_v, ..built() }),
        Case("chip", "clock", Built { clock, ..built() }),
        Case("chip", "brown-out", delivered),
        open(pins::LEVER_ENABLE),
        open(pins::STAGE_ENABLE),
        open(pins::SENSOR_CS),
        broken("pins", "encoder-line", Fault::EncoderCut(Cut::A)),
        broken("pins", "encoder-line", Fault::EncoderCut(Cut::B)),
        broken("pins", "encoder-silent", Fault::EncoderCut(Cut::Both)),
    ]);
}

#[test]
#[ignore = "long"]
fn mistakes_of_switches_and_encoder_are_named() {
    let left = |mistake, closed| {
        let upper = false;
        let stuck = Fault::StageLimitStuck { upper, closed };
        broken("switches", mistake, stuck)
    };
    let upper = Miswired::LimitNormallyOpen { upper: true };
    play([
        miswired("switches", "switches-exchanged", Miswired::LimitsExchanged),
        miswired("switches", "switch-kind", upper),
        miswired("switches", "switch-kind", Miswired::TopNormallyOpen),
        left("switch-open", true),
        left("switch-closed", false),
        miswired("switches", "switch-closed", Miswired::EStopBridged),
        miswired("stop", "stop-supply", Miswired::EStopKeepsSupply),
        broken("hand", "encoder-exchanged", Fault::EncoderSwapped),
        miswired("hand", "encoder-lines", Miswired::EncoderLines(0.25)),
    ]);
}

#[test]
#[ignore = "long"]
fn mistakes_of_sensor_lever_motor_and_finger_are_named() {
    let steps = Fault::LeverLosesSteps { share: 0.1 };
    let offset = Fault::CurrentOffset { amperes: 0.2 };
    let reversed = Miswired::CurrentGain(-1.0);
    play([
        miswired("sensor", "sensor-silent", Miswired::SelectOpen),
        broken("sensor", "sensor-silent", Fault::SensorUnplugged),
        broken("sensor", "miso-stuck", Fault::MisoStuck { high: false }),
        broken("sensor", "words", Fault::BitFlips { share: 0.01 }),
        broken("noise", "sensor-still", Fault::SensorFrozen),
        broken("finger", "finger-dead", Fault::PdcStuck),
        miswired("lever-sense", "lever-still", Miswired::LeverCoilOpen),
        miswired("lever-scale", "lever-scale", Miswired::LeverMicrosteps(2)),
        // as many are lost on the way down as on the way up: only the caliper sees it
        broken("lever-scale", "lever-steps", steps),
        miswired("current", "current-open", Miswired::CurrentOpen),
        broken("current", "current-open", Fault::CurrentSaturated),
        broken("current", "current-offset", offset),
        miswired("stage-sense", "stage-still", Miswired::BridgeEnableOpen),
        miswired("stage-sense", "stage-reversed", Miswired::MotorReversed),
        miswired("stage-sense", "bridge-exchanged", Miswired::PwmDirExchanged),
        broken("stage-sense", "stage-stuck", Fault::StageJammed),
        miswired("stage-sense", "current-reversed", reversed),
        broken("bridge", "bridge-decay", Fault::FastDecay),
        miswired("resistor", "current-gain", Miswired::CurrentGain(2.5)),
        broken("scale", "scale-far", Fault::PdcWeak { gain: 0.3 }),
        broken("scale", "finger-dead", Fault::PdcStuck),
        broken("scale", "finger-leaks", Fault::SkinLeaks { seconds: 20.0 }),
        broken("zero", "zero-drifts", Fault::PdcDrift { counts_per_s: 0.4 }),
        broken("zero", "fault", Fault::StageJammed),
        broken("speed", "fault", Fault::BridgeOff),
        broken("slide", "fault", Fault::StageJammed),
        broken("slide", "fault", Fault::BitFlips { share: 2e-4 }),
    ]);
}
