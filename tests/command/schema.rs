//! What is printed as JSON is as `docs/src/output.schema.json` says, which describes every field.

use serde_json::Value;

use crate::Scratch;

/// Checks a value against the part of JSON Schema that the file uses; nothing is printed that it does not describe.
fn check(value: &Value, schema: &Value, all: &Value, at: &str) {
    if let Some(to) = schema["$ref"].as_str() {
        let name = to.strip_prefix("#/$defs/").unwrap();
        return check(value, &all["$defs"][name], all, at);
    }
    if let Some(words) = schema["enum"].as_array() {
        return assert!(words.contains(value), "{at}: {value}");
    }
    let kind = match value {
        Value::Null => "null",
        Value::Bool(_) => "boolean",
        Value::String(_) => "string",
        Value::Array(_) => "array",
        Value::Object(_) => "object",
        Value::Number(_) => "number",
    };
    let is_kind = |of: &Value| of == kind || of == "integer" && value.is_u64();
    let kinds = schema["type"].as_array();
    let fits = kinds.map_or(is_kind(&schema["type"]), |kinds| kinds.iter().any(is_kind));
    assert!(fits, "{at}: {value} is no {}", schema["type"]);
    if let Some(number) = value.as_f64() {
        let most = schema["maximum"].as_f64().unwrap_or(f64::MAX);
        let least = schema["minimum"].as_f64().unwrap_or(f64::MIN);
        assert!((least..=most).contains(&number), "{at}: {number}");
        // 1.262, and not 1.2620001
        let is_set = ["force_n", "speed_mm_s"]
            .iter()
            .any(|name| at.ends_with(name));
        assert!(!is_set || value.to_string().len() <= 7, "{at}: {value}");
    }
    for item in value.as_array().into_iter().flatten() {
        check(item, &schema["items"], all, &format!("{at}[]"));
    }
    let Some(fields) = value.as_object() else {
        return;
    };
    for (name, field) in fields {
        let described = &schema["properties"][name];
        assert!(described.is_object(), "{at}.{name} is not described");
        check(field, described, all, &format!("{at}.{name}"));
    }
    for name in schema["required"].as_array().unwrap() {
        assert!(
            fields.contains_key(name.as_str().unwrap()),
            "{at}: no {name}"
        );
    }
}

#[test]
fn printed_objects_are_as_the_schema_says() {
    let all = include_str!("../../docs/src/output.schema.json");
    let all: Value = serde_json::from_str(all).unwrap();
    let at = Scratch::new();
    at.printed("simulate --textures 1,3,50,54,100 --trials 3 --seed 2 --out slides");
    at.printed("learn --recordings slides --train-slides 2 --out table");
    at.printed("learn --recordings slides --train-slides 2 --method paper --out paper");
    for (name, line, code) in [
        ("table", "table table", 0),
        ("table", "table paper", 0),
        ("report", "report table", 0),
        ("report", "report table --recordings SIMULATED", 0),
        ("report", "report paper --recordings slides", 0),
        (
            "verify",
            "verify --table table --texture burlap --sample slides --material burlap",
            0,
        ),
        (
            "verify",
            "verify --table table --texture burlap --sample slides --material 3",
            3,
        ),
        ("verify", "verify --simulated --among 4 --texture burlap", 0),
        (
            "identify",
            "identify --recordings slides --table table --material burlap",
            0,
        ),
        (
            "identify",
            "identify --recordings SIMULATED --table table --material corduroy",
            3,
        ),
        (
            "identify",
            "identify --simulated --among 3 --threshold 1 --max-slides 2",
            4,
        ),
        (
            "identify",
            "identify --simulated --among 3 --method paper",
            0,
        ),
    ] {
        let found = at.json(line, code);
        check(&found, &all["$defs"][name], &all, line);
    }
}
