//! Words of the command line as arguments.

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use tactus_core::explorer::Config;
use tactus_core::features::FeatureSet;
use tactus_core::table::{Drift, is_false_alarm};
use tactus_lab::eval::evaluate::Method;
use tactus_lab::eval::experiment::Protocol;

const METHODS: [Method; 8] = [
    Method::Fused,
    Method::FusedCycle,
    Method::FusedRandom,
    Method::StudentAll,
    Method::Student,
    Method::Paper,
    Method::Cycle,
    Method::Random,
];

fn one_of<T: Copy>(what: &str, wanted: &str, all: &[T], name: impl Fn(T) -> String) -> PyResult<T> {
    let found = all.iter().copied().find(|one| name(*one) == wanted);
    found.ok_or_else(|| {
        let known = all.iter().map(|one| name(*one)).collect::<Vec<_>>();
        PyValueError::new_err(format!("{what} {wanted:?} is none of {}", known.join(", ")))
    })
}

/// A way to decide by its name.
pub(crate) fn method(name: &str) -> PyResult<Method> {
    one_of("method", name, &METHODS, method_name)
}

/// As the command line has it.
pub(crate) fn method_name(method: Method) -> String {
    let name = serde_json::to_value(method);
    let name = name.ok().and_then(|name| name.as_str().map(str::to_owned));
    name.unwrap_or_default()
}

/// A protocol by its name.
pub(crate) fn protocol(name: &str) -> PyResult<Protocol> {
    let of = |protocol: Protocol| protocol.name().to_owned();
    one_of("protocol", name, &Protocol::ALL, of)
}

/// Features by their name; none: the best that every slide has.
pub(crate) fn features(name: Option<&str>) -> PyResult<Option<FeatureSet>> {
    let of = |set: FeatureSet| format!("{set:?}").to_lowercase();
    name.map(|name| one_of("features", name, &FeatureSet::ALL, of))
        .transpose()
}

/// Standard deviations of band powers, ln, and of traction, as a share.
pub(crate) fn drift((bands, traction): (f32, f32)) -> PyResult<Drift> {
    let drift = Some(Drift { bands, traction }).filter(|drift| drift.is_possible());
    drift.ok_or_else(|| {
        PyValueError::new_err("drift: two numbers from 0 to 10, such as (0.12, 0.04), or (0, 0)")
    })
}

/// A share of false alarms.
pub(crate) fn false_alarm(share: Option<f32>) -> PyResult<Option<f32>> {
    match share {
        Some(share) if !is_false_alarm(share) => Err(PyValueError::new_err(
            "false_alarm: a share from 0.0005 to 0.2, such as 0.02",
        )),
        share => Ok(share),
    }
}

/// When an exploration ends.
pub(crate) fn config(
    method: Method,
    threshold: f32,
    max_slides: u8,
    share: Option<f32>,
    open: bool,
) -> PyResult<Config> {
    if !(0.0 < threshold && threshold <= 1.0) {
        let say = "threshold: a probability between 0 and 1, such as 0.99; 1 is never exceeded";
        return Err(PyValueError::new_err(say));
    }
    if !(1..=254).contains(&max_slides) {
        return Err(PyValueError::new_err("max_slides: 1 to 254"));
    }
    Ok(Config {
        method: method.method(),
        strategy: method.strategy(),
        threshold,
        max_slides,
        open,
        false_alarm: false_alarm(share)?,
        ..Config::default()
    })
}
