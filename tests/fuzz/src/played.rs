//! Scenarios for the handheld probe: files that anybody may have written.

use fastrand::Rng;
use serde_json::{Value, json};
use tactus_lab::sim::handheld::Person;
use tactus_lab::sim::scenario::{Scenario, Step, texture};

/// Words that the hand is followed for after each thing it means to do: 20 ms.
const WORDS: usize = 88;
/// Things that it means to do, at most: a simulated world takes its time.
const INTENTIONS: usize = 8;

/// A scenario. What is accepted comes to an end and can be begun, and its hand does not leave what numbers can tell.
///
/// # Panics
/// It is not so.
pub fn scenario(data: &[u8]) {
    let Ok(scenario) = Scenario::parse(data) else {
        return;
    };
    let written = serde_json::to_vec(&scenario).expect("what was read can be written");
    let again = Scenario::parse(&written).expect("what was written can be read");
    assert_eq!(again, scenario);
    assert!((0.0..=3600.0).contains(&scenario.longest_s()));
    let number = texture(&scenario.texture).expect("a texture that was checked");
    let starts = scenario.step.iter().filter(|s| **s == Step::PowerCycle);
    let last = scenario.setup(number, starts.count() as u64);
    let mut person = Person::new(last, scenario.hand);
    let intentions = scenario.step.iter().filter_map(|step| match *step {
        Step::Hand { force_n, pace_mm_s }
        | Step::Slide {
            force_n, pace_mm_s, ..
        }
        | Step::Explore {
            force_n, pace_mm_s, ..
        } => Some((force_n, pace_mm_s)),
        _ => None,
    });
    for (force_n, pace_mm_s) in intentions.take(INTENTIONS) {
        person.intend(force_n, pace_mm_s);
        for _ in 0..WORDS {
            assert!(person.word().is_some(), "the sensor answers");
        }
        let truth = person.truth();
        assert!(truth.force_n.is_finite() && truth.indentation_mm.is_finite());
        assert!((0.0..=75.0).contains(&truth.sample_mm) && truth.speed_mm_s.is_finite());
    }
}

/// What a scenario may become by one change that leaves it JSON: bytes changed at random seldom are, and would try
/// the parser of JSON, which is not ours. None when bytes shall be changed, as every fourth time.
pub fn another_scenario(data: &[u8], max_size: usize, seed: u32) -> Option<Vec<u8>> {
    let mut rng = Rng::with_seed(seed.into());
    let mut scenario: Value = serde_json::from_slice(data).ok()?;
    if rng.u8(..4) == 0 {
        return None;
    }
    let mut values = 0;
    each(&mut scenario, &mut |_| values += 1);
    let mut left = rng.usize(..values);
    each(&mut scenario, &mut |value| {
        if left == 0 {
            change(value, &mut rng);
        }
        left = left.wrapping_sub(1);
    });
    let other = serde_json::to_vec(&scenario).ok()?;
    (other.len() <= max_size).then_some(other)
}

/// A value and all in it, the inner ones first.
fn each(value: &mut Value, what: &mut impl FnMut(&mut Value)) {
    match value {
        Value::Array(inner) => inner.iter_mut().for_each(|v| each(v, what)),
        Value::Object(inner) => inner.values_mut().for_each(|v| each(v, what)),
        _ => (),
    }
    what(value);
}

fn change(value: &mut Value, rng: &mut Rng) {
    match value {
        Value::Number(number) => {
            let whole = rng.u64(..) >> rng.u32(..64);
            let others = match (number.as_u64(), number.as_f64().unwrap_or_default()) {
                (Some(is), _) => [is.wrapping_mul(10), is.wrapping_add(1), whole].map(|n| json!(n)),
                (None, is) => [json!(is * 10.0), json!(-is), json!(whole)],
            };
            *value = rng.choice(others).unwrap_or_default();
        }
        Value::String(text) => {
            let at = rng.usize(..=text.chars().count());
            let bytes = text
                .char_indices()
                .nth(at)
                .map_or(text.len(), |(byte, _)| byte);
            text.insert(bytes, rng.char(..));
        }
        Value::Array(inner) if !inner.is_empty() => {
            let (one, other) = (rng.usize(..inner.len()), rng.usize(..inner.len()));
            match rng.u8(..3) {
                0 => inner.swap(one, other),
                1 => drop(inner.remove(one)),
                _ => inner.insert(other, inner[one].clone()),
            }
        }
        Value::Object(inner) => {
            let key = rng.choice(inner.keys()).cloned();
            key.and_then(|key| inner.remove(&key));
        }
        Value::Bool(is) => *is = !*is,
        Value::Null | Value::Array(_) => (),
    }
}

/// The scenarios that the emulated board plays, and one with what none of them does.
pub(crate) fn seeds() -> Vec<Vec<u8>> {
    const MORE: &[u8] = br#"{"about": "more", "texture": "17", "world": 2, "seed": 3,
"hand": {"tremor": 0.01, "wander": 0.04, "uneven": 0.1},
"step": ["power-cycle", {"place": {"texture": "Polyester felt"}}, {"hand": {"force_n": 0.5, "pace_mm_s": -20}}, {"dark": {"within_s": 2}}]}"#;
    let ours: [&[u8]; 7] = [
        include_bytes!("../../../host-tools/emulator/scenarios/again.json"),
        include_bytes!("../../../host-tools/emulator/scenarios/faults.json"),
        include_bytes!("../../../host-tools/emulator/scenarios/known.json"),
        include_bytes!("../../../host-tools/emulator/scenarios/rest.json"),
        include_bytes!("../../../host-tools/emulator/scenarios/spell.json"),
        include_bytes!("../../../host-tools/emulator/scenarios/teach.json"),
        include_bytes!("../../../host-tools/emulator/scenarios/uneven.json"),
    ];
    let all = ours.into_iter().chain([MORE]);
    let right = all.inspect(|seed| drop(Scenario::parse(seed).expect("a seed that is right")));
    right.map(<[u8]>::to_vec).collect()
}
