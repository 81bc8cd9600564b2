//! Each product with each finger: it passes as it should be built, and ten mistakes of each are named.

use super::*;

const PRODUCTS: [Product; 3] = [Product::Rig, Product::Handheld, Product::Arm];

fn built(product: Product, finger: FingerName) -> Built {
    Built {
        product,
        finger,
        ..Built::default()
    }
}

/// Mistakes of the finger and its wires, which every product has.
fn mistakes(product: Product, finger: FingerName) -> Vec<Case> {
    let case = |step, mistake, change: &dyn Fn(&mut Built)| {
        let mut built = built(product, finger);
        change(&mut built);
        Case(step, mistake, built)
    };
    let wired = |step, mistake, wrong| case(step, mistake, &|b| b.mistakes.push(wrong));
    let broken = |step, mistake, fault| case(step, mistake, &|b| b.faults.push(fault));
    let part = |step, mistake, fault| case(step, mistake, &|b| b.parts.push(fault));
    let mut all = vec![
        wired("pins", "data-exchanged", Miswired::DataExchanged),
        case("pins", "pull-missing", &|b| b.open.push(pins::SENSOR_CS)),
        wired("sensor", "sensor-silent", Miswired::SelectOpen),
        broken("sensor", "sensor-silent", Fault::SensorUnplugged),
        broken("sensor", "sensor-silent", Fault::MisoStuck { high: true }),
        broken("sensor", "miso-stuck", Fault::MisoStuck { high: false }),
    ];
    // bits that flip in an accelerometer's words are seen as noise: they have neither parity nor null bit
    let flips = Fault::BitFlips { share: 0.002 };
    all.push(match finger {
        FingerName::Mems => broken("noise", "sensor-noisy", flips),
        _ => broken("sensor", "words", flips),
    });
    all.extend(match finger {
        FingerName::Biotac => vec![
            broken("noise", "sensor-still", Fault::SensorFrozen),
            broken("finger", "finger-dead", Fault::PdcStuck),
            broken("scale", "scale-far", Fault::PdcWeak { gain: 0.3 }),
            broken("scale", "finger-leaks", Fault::SkinLeaks { seconds: 20.0 }),
        ],
        _ => vec![
            part("sensor", "cell", PartFault::CellWire),
            part("finger", "finger-dead", PartFault::CellReversed),
            part("scale", "finger-dead", PartFault::CellBlocked),
        ],
    });
    if finger == FingerName::Mems {
        all.push(part("sensor", "part", PartFault::AccelerometerUnplugged));
    }
    all
}

fn of_a_hand(finger: FingerName) -> Vec<Case> {
    let case = |step, mistake, change: fn(&mut Built)| {
        let mut built = built(Product::Handheld, finger);
        change(&mut built);
        Case(step, mistake, built)
    };
    vec![
        case("display", "display-silent", |b| b.display = false),
        case("button", "button-dead", |b| b.button = Some(false)),
        case("button", "button-stuck", |b| b.button = Some(true)),
        case("buzzer", "buzzer", |b| b.buzzer = false),
    ]
}

#[test]
fn a_handheld_with_parts_that_can_be_ordered_passes() {
    if let Some(evening) = evening(&built(Product::Handheld, FingerName::Mems), 0) {
        assert!(evening.passed, "{}", evening.text);
    }
}

#[test]
fn a_mistake_of_each_kind_of_a_handheld_is_named() {
    play(of_a_hand(FingerName::Analog));
}

#[test]
#[ignore = "long"]
fn probes_without_motors_pass_with_each_finger() {
    for (product, finger) in [Product::Handheld, Product::Arm]
        .into_iter()
        .flat_map(|product| FingerName::ALL.map(|finger| (product, finger)))
    {
        if let Some(evening) = evening(&built(product, finger), 0) {
            assert!(evening.passed, "{product:?}, {finger}: {}", evening.text);
        }
    }
}

#[test]
#[ignore = "long"]
fn ten_mistakes_of_each_product_with_each_finger_are_named() {
    for (product, finger) in PRODUCTS
        .into_iter()
        .flat_map(|product| FingerName::ALL.map(|finger| (product, finger)))
    {
        let cases = mistakes(product, finger);
        assert!(cases.len() >= 10, "{product:?}, {finger}: {}", cases.len());
        eprintln!("{product:?}, {finger}");
        play(cases);
    }
}
