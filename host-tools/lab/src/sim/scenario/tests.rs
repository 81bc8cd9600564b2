//! Scenarios that are read, and those that cannot be played.

use super::*;

fn parse(steps: &str) -> Result<Scenario, InvalidScenario> {
    let json = format!(r#"{{"about": "", "texture": "burlap", "step": [{steps}]}}"#);
    Scenario::parse(json.as_bytes())
}

#[test]
fn what_is_read_is_what_is_written() {
    let scenario = parse(
        r#"{"see": {"text": ["Press"]}}, {"slide": {"force_n": 0.5, "pace_mm_s": 25, "seconds": 1.8}}, "power-cycle""#,
    )
    .unwrap();
    assert_eq!((scenario.world, scenario.seed), (1, 1));
    assert_eq!(scenario.hand, Manner::default());
    // 8 s until it is seen, 8 s until a slide is wanted, and the slide
    assert!((scenario.longest_s() - (8.0 + 8.0 + 0.3 + 1.8 + 0.15 + 0.5)).abs() < 1e-9);
    let again = Scenario::parse(&serde_json::to_vec(&scenario).unwrap()).unwrap();
    assert_eq!(again, scenario);
}

#[test]
fn what_cannot_be_played_is_refused_and_says_why() {
    for (steps, why) in [
        (r#"{"jump": {}}"#, "unknown variant"),
        (r#"{"hand": {"force_n": 0.5, "speed": 3}}"#, "unknown field"),
        (
            r#"{"note": {"text": ""}}, {"hand": {"force_n": 11}}"#,
            "step 2: force_n is 11",
        ),
        (r#"{"hand": {"force_n": -0.1}}"#, "force_n is -0.1"),
        (r#"{"hand": {"force_n": 1, "pace_mm_s": 1e9}}"#, "pace_mm_s"),
        (r#"{"wait": {"seconds": -1}}"#, "its time in s is -1"),
        (r#"{"place": {"texture": "moon dust"}}"#, "moon dust"),
        (
            r#"{"press": {"ms": 100, "times": 4294967295}}"#,
            "it may take",
        ),
        (r#"{"press": {"ms": 18446744073709551615}}"#, "it may take"),
        (
            r#"{"wait": {"seconds": 2000}}, {"wait": {"seconds": 2000}}"#,
            "it may take 4000 s",
        ),
        (
            r#"{"explore": {"force_n": 1, "pace_mm_s": 1, "slides": 4294967295}}"#,
            "it may take",
        ),
        (r#"{"see": {"text": []}}"#, "looks for no text"),
        (r#"{"miss": {"text": ["a", ""]}}"#, "looks for no text"),
        (r#"{"hear": {"hz": 0}}"#, "hz is 0"),
    ] {
        let error = parse(steps).unwrap_err().to_string();
        assert!(error.contains(why), "{steps}: {error}");
    }
    let error = |json: &str| Scenario::parse(json.as_bytes()).unwrap_err().to_string();
    assert!(error(r#"{"about": "", "texture": "x", "step": []}"#).contains("no texture"));
    let seed = r#"{"about": "", "texture": "burlap", "seed": 184467440737095516, "step": []}"#;
    assert!(error(seed).contains("seed is 184467440737095516"));
    let hand = r#"{"about": "", "texture": "burlap", "hand": {"tremor": 2}, "step": []}"#;
    assert!(error(hand).contains("the hand: tremor is 2"));
    let notes = vec![r#"{"note": {"text": ""}}"#; MAX_STEPS + 1].join(",");
    assert!(matches!(parse(&notes), Err(InvalidScenario::Steps(1001))));
    let long = vec![b' '; MAX_BYTES as usize + 1];
    assert!(matches!(
        Scenario::parse(&long),
        Err(InvalidScenario::TooLong)
    ));
    let missing = Scenario::read(Path::new("/nowhere.json")).unwrap_err();
    assert!(missing.to_string().contains("/nowhere.json"));
}
