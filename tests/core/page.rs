//! The probe that a page shows, and what it says to the page's requests.

use std::io::{BufWriter, Write as _};

use serde_json::{Value, json};
use tactus_lab::live::Session;
use tactus_tests::{count, seeds};

/// Asks, and reads the reply; an error of the session fails the test.
fn ask(session: &mut Session, request: &Value) -> Value {
    let reply = session.ask(&request.to_string());
    let reply: Value = serde_json::from_str(&reply).unwrap();
    assert_ne!(reply["is"], "error", "{request}: {reply}");
    reply
}

fn world(textures: u8, paper: bool, drift: f64) -> Value {
    json!({"do": "world", "world": 1, "textures": textures, "paper": paper, "drift": drift, "trial": 1})
}

fn identify(texture: u8, seed: u32) -> Value {
    json!({"do": "identify", "texture": texture, "seed": seed, "threshold": 0.99, "false_alarm": 0.02,
        "max_slides": 10})
}

/// A probe, and what it knows.
fn probe(settings: &Value) -> (Session, Value) {
    let mut session = Session::default();
    ask(&mut session, settings);
    let known = ask(&mut session, &json!({"do": "prepare"}));
    assert_eq!(known["is"], "ready");
    (session, known)
}

/// The events until the probe is done.
fn happenings(session: &mut Session, ms: u32) -> Vec<Value> {
    let mut all = Vec::new();
    loop {
        let frame = ask(session, &json!({"do": "step", "ms": ms}));
        all.extend_from_slice(frame["happened"].as_array().unwrap());
        if frame["busy"] == false {
            return all;
        }
    }
}

fn of<'a>(all: &'a [Value], what: &str) -> Vec<&'a Value> {
    all.iter().filter(|one| one["what"] == what).collect()
}

fn explore(session: &mut Session, texture: u8, seed: u32) -> Value {
    ask(session, &identify(texture, seed));
    let all = happenings(session, 1000);
    let verdicts = of(&all, "verdict");
    assert_eq!(verdicts.len(), 1, "{all:?}");
    verdicts[0].clone()
}

#[test]
fn an_exploration_is_told_step_by_step() {
    let (mut session, known) = probe(&world(20, false, 1.0));
    let textures = known["textures"].as_array().unwrap().len();
    assert_eq!(textures, 20);
    assert_eq!(known["lengths_ms"], json!([500, 1000, 2000]));
    for map in known["maps"].as_array().unwrap() {
        assert_eq!(map.as_array().unwrap().len(), textures);
    }
    ask(&mut session, &identify(1, 3));
    let (mut frames, mut phases, mut samples) = (0, Vec::new(), 0);
    let mut all = Vec::new();
    let mut at_ms = 0;
    loop {
        let frame = ask(&mut session, &json!({"do": "step", "ms": 16}));
        let now_ms = frame["at_ms"].as_u64().unwrap();
        assert!(at_ms == 0 || now_ms - at_ms <= 17, "{at_ms} to {now_ms}");
        (at_ms, frames) = (now_ms, frames + 1);
        if phases.last() != Some(&frame["phase"]) {
            phases.push(frame["phase"].clone());
        }
        samples += frame["pac"].as_array().unwrap().len();
        all.extend_from_slice(frame["happened"].as_array().unwrap());
        if frame["busy"] == false {
            break;
        }
    }
    assert!(frames > 300, "{frames}");
    for phase in ["Pressing", "Background", "Sliding", "Lifting"] {
        assert!(phases.contains(&json!(phase)), "{phases:?}");
    }
    let slides = of(&all, "slide");
    assert!(samples > 1000 * slides.len(), "{samples}");
    assert_eq!(of(&all, "chosen").len(), slides.len());
    assert!(!of(&all, "look").is_empty());
    for look in of(&all, "look") {
        let posterior = look["standing"]["posterior"].as_array().unwrap();
        assert_eq!(posterior.len(), textures);
        let sum: f64 = posterior.iter().map(|p| p.as_f64().unwrap()).sum();
        assert!((sum - 1.0).abs() < 1e-3, "{sum}");
        assert!(look["place"].is_array());
    }
    let verdict = of(&all, "verdict")[0];
    assert_eq!(
        (&verdict["told"], &verdict["texture"]),
        (&json!("sure"), &known["textures"][0])
    );
    // the probe's own posterior of the last slide is the one that the follower computes
    let last = slides.last().unwrap();
    assert_eq!(last["standing"]["posterior"][0], verdict["probability"]);
    assert_eq!(of(&all, "done").len(), 1);
}

#[test]
fn a_texture_that_is_new_is_taught_and_found_again() {
    let (mut session, known) = probe(&world(20, false, 1.0));
    let numbers = known["numbers"].as_array().unwrap();
    let unknown = (1..=117).filter(|number| !numbers.contains(&json!(number)));
    let (mut found_new, mut found_again) = (0, 0);
    for texture in unknown.step_by(12).take(6) {
        let verdict = explore(&mut session, texture, u32::from(texture));
        if verdict["told"] != "new" {
            continue;
        }
        found_new += 1;
        let name = format!("mine {texture}");
        assert_eq!(verdict["wants_label"], true);
        ask(&mut session, &json!({"do": "label", "name": name}));
        let all = happenings(&mut session, 0);
        let learned = of(&all, "learned");
        assert_eq!(learned.len(), 1, "{all:?}");
        let textures = learned[0]["known"]["textures"].as_array().unwrap();
        assert_eq!(textures.len(), 20 + found_new);
        assert!(textures.contains(&json!(name)));
        let again = explore(&mut session, texture, 1000 + u32::from(texture));
        found_again += usize::from(again["texture"] == name.as_str() && again["told"] != "new");
    }
    assert!(found_new >= 4, "{found_new} of 6");
    assert!(found_again + 1 >= found_new, "{found_again} of {found_new}");
}

#[test]
fn a_skin_that_wears_makes_the_known_doubtful_and_in_the_end_new() {
    let (mut session, known) = probe(&world(20, false, 1.0));
    let mut doubtful = 0;
    let textures = [0, 3, 6, 9, 12, 15].into_iter().take(count(6, 3) as usize);
    for at in textures.clone() {
        let texture = known["numbers"][at].as_u64().unwrap() as u8;
        let (mut told, mut slides) = (Vec::new(), Vec::new());
        for wear in 0..=20 {
            ask(
                &mut session,
                &json!({"do": "skin", "wear": f64::from(wear) / 20.0}),
            );
            let verdict = explore(&mut session, texture, 7);
            let name = &known["textures"][at];
            let word = verdict["told"].as_str().unwrap().to_owned();
            if ["sure", "changed"].contains(&word.as_str()) {
                assert_eq!(&verdict["texture"], name, "worn by {wear} of 20");
            }
            slides.push(verdict["slides"].as_u64().unwrap());
            told.push(word);
        }
        let name = &known["textures"][at];
        assert_eq!(told[0], "sure", "{name} with a new skin");
        assert_eq!(told[20], "new", "{name} without ridges: {told:?}");
        // between the two it slides again before it answers
        doubtful += usize::from(slides.iter().any(|more| *more > slides[0]));
    }
    assert!(doubtful * 2 >= textures.count(), "{doubtful}");
}

#[test]
fn nonsense_is_answered_by_a_sentence() {
    let why = |session: &mut Session, request: &Value| {
        let reply: Value = serde_json::from_str(&session.ask(&request.to_string())).unwrap();
        reply["why"].as_str().unwrap_or_default().to_owned()
    };
    let mut session = Session::default();
    for (request, words) in [
        (json!({"do": "step", "ms": 1}), "there is no probe yet"),
        (identify(1, 1), "there is no probe yet"),
        (json!({"do": "dance"}), "no request: unknown variant"),
        (world(1, false, 1.0), "2 to 117"),
    ] {
        let said = why(&mut session, &request);
        assert!(said.contains(words), "{request}: {said}");
    }
    let (mut session, _) = probe(&world(5, false, 1.0));
    let press = json!({"do": "move", "texture": 1, "seed": 1, "force_n": 5.0, "speed_mm_s": 20.0});
    for (request, words) in [
        (identify(118, 1), "1 to 117"),
        (json!({"do": "label", "name": " "}), "needs a name"),
        (press, "N"),
    ] {
        let said = why(&mut session, &request);
        assert!(said.contains(words), "{request}: {said}");
    }
    assert_eq!(why(&mut session, &identify(1, 1)), "");
    assert_eq!(
        why(&mut session, &identify(1, 1)),
        "the probe is busy: stop it first"
    );
}

#[test]
fn a_movement_by_hand_is_measured_and_a_stop_lifts() {
    let (mut session, known) = probe(&world(5, false, 1.0));
    let mut moved = |force_n: &Value, speed_mm_s: &Value| {
        let by_hand = json!({"do": "move", "texture": 1, "seed": 1, "force_n": force_n, "speed_mm_s": speed_mm_s});
        ask(&mut session, &by_hand);
        let all = happenings(&mut session, 100);
        let moved = of(&all, "moved");
        assert_eq!(moved.len(), 1, "{all:?}");
        moved[0].clone()
    };
    let free = moved(&json!(0.8), &json!(40.0));
    assert!(free["measured"]["traction_n"].as_f64().unwrap() > 0.0);
    assert_eq!(free["movement"], Value::Null);
    let of_table = &known["movements"][1];
    let known = moved(&of_table[0], &of_table[1]);
    assert_eq!(known["movement"], 1);
    assert!(known["place"].is_array());
    ask(&mut session, &identify(1, 1));
    ask(&mut session, &json!({"do": "step", "ms": 3000}));
    ask(&mut session, &json!({"do": "stop"}));
    let all = happenings(&mut session, 100);
    let ended = of(&all, "verdict").len() + of(&all, "refused").len();
    assert_eq!(ended, 1, "{all:?}");
    assert_eq!(explore(&mut session, 1, 2)["told"], "sure");
}

/// With TACTUS_PAGE_REPLIES, `cargo xtask test --step page` asks the same in WebAssembly and compares the replies byte
/// by byte: of some seeds, each another texture, then a lesson, at last the paper's method.
#[test]
fn replies() {
    let mut session = Session::default();
    let mut lines = Vec::new();
    let mut ask = |request: &Value| {
        let request = request.to_string();
        let reply = session.ask(&request);
        let parsed: Value = serde_json::from_str(&reply).unwrap();
        assert!(parsed["is"] != "error", "{request}: {reply}");
        lines.push((request, reply));
        parsed
    };
    let done = |ask: &mut dyn FnMut(&Value) -> Value, request: Value| {
        ask(&request);
        let mut frames = 0;
        loop {
            let frame = ask(&json!({"do": "step", "ms": 500}));
            if let Some(texture) = request.get("texture").filter(|_| frames > 10) {
                assert_eq!(frame["texture"], *texture, "{request}");
            }
            if frame["busy"] == false {
                break;
            }
            frames += 1;
            assert!(frames < 1000, "{request} is not over in time");
        }
    };
    let prepare = json!({"do": "prepare"});
    ask(&world(20, false, 1.0));
    ask(&prepare);
    for seed in seeds(50) {
        done(&mut ask, identify((seed * 7 % 117 + 1) as u8, seed as u32));
    }
    done(&mut ask, json!({"do": "label", "name": "learned here"}));
    ask(&world(30, true, 0.0));
    ask(&prepare);
    for seed in 1..=5 {
        done(&mut ask, identify(20, seed));
    }
    if let Some(file) = std::env::var_os("TACTUS_PAGE_REPLIES") {
        let mut file = BufWriter::new(std::fs::File::create(file).unwrap());
        for (request, reply) in lines {
            writeln!(file, "{request}\n{reply}").unwrap();
        }
        file.flush().unwrap();
    }
}
