//! What a release is made of: every crate in it, as CycloneDX 1.5, from cargo's own resolution. The same commit gives the same bytes.
use std::collections::{BTreeMap, BTreeSet};

use anyhow::{Context as _, Result, ensure};
use serde_json::{Value, json};

use crate::shell::cargo;

/// The chip for which the images are built.
const CHIP: &str = "thumbv7em-none-eabihf";

/// The bill of materials of the firmware's images.
pub(crate) fn firmware() -> Result<Vec<u8>> {
    let mut metadata = cargo();
    metadata.args(["metadata", "--format-version", "1", "--locked"]);
    metadata.args(["--filter-platform", CHIP]);
    let out = metadata.output().context("cannot start cargo")?;
    let said = String::from_utf8_lossy(&out.stderr);
    ensure!(out.status.success(), "cargo metadata: {said}");
    let bill = bill(&serde_json::from_slice(&out.stdout)?, "tactus-firmware")?;
    let mut bytes = serde_json::to_vec_pretty(&bill)?;
    bytes.push(b'\n');
    Ok(bytes)
}

/// The packages that a package is linked with, itself first; what is only needed to build or to test is left out.
fn bill(metadata: &Value, root: &str) -> Result<Value> {
    let packages = metadata["packages"].as_array().context("no packages")?;
    let by_id: BTreeMap<&str, &Value> = packages
        .iter()
        .filter_map(|package| Some((package["id"].as_str()?, package)))
        .collect();
    let nodes = metadata["resolve"]["nodes"].as_array();
    let needs: BTreeMap<&str, Vec<&str>> = nodes
        .context("no resolution")?
        .iter()
        .filter_map(|node| Some((node["id"].as_str()?, linked(node))))
        .collect();
    let root = packages.iter().find(|package| package["name"] == root);
    let root = root.with_context(|| format!("no package {root:?}"))?;
    let mut todo: Vec<&str> = root["id"].as_str().into_iter().collect();
    let mut seen = BTreeSet::new();
    while let Some(id) = todo.pop() {
        if seen.insert(id) {
            todo.extend(needs.get(id).into_iter().flatten());
        }
    }
    let of = |id: &str| by_id.get(id).map(|package| reference(package));
    let mut components = Vec::new();
    let mut dependencies = Vec::new();
    for id in &seen {
        let package = by_id.get(id).with_context(|| (*id).to_owned())?;
        let of_it: BTreeSet<String> = needs
            .get(id)
            .into_iter()
            .flatten()
            .filter_map(|n| of(n))
            .collect();
        dependencies.push(json!({"ref": reference(package), "dependsOn": of_it}));
        if package["id"] != root["id"] {
            components.push(component(package, "library"));
        }
    }
    let by_name = |one: &Value| {
        one["bom-ref"]
            .as_str()
            .or(one["ref"].as_str())
            .map(str::to_owned)
    };
    components.sort_by_key(by_name);
    dependencies.sort_by_key(by_name);
    Ok(json!({
        "$schema": "http://cyclonedx.org/schema/bom-1.5.schema.json",
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": {"component": component(root, "firmware")},
        "components": components,
        "dependencies": dependencies,
    }))
}

/// The packages that a node is linked with.
fn linked(node: &Value) -> Vec<&str> {
    let needs = node["deps"].as_array().map_or(&[][..], Vec::as_slice);
    let normal = needs.iter().filter(|need| {
        let kinds = need["dep_kinds"].as_array();
        kinds.is_some_and(|kinds| kinds.iter().any(|kind| kind["kind"].is_null()))
    });
    normal.filter_map(|need| need["pkg"].as_str()).collect()
}

fn reference(package: &Value) -> String {
    let [name, version] = ["name", "version"].map(|of| package[of].as_str().unwrap_or_default());
    format!("pkg:cargo/{name}@{version}")
}

fn component(package: &Value, kind: &str) -> Value {
    let mut component = json!({
        "type": kind,
        "bom-ref": reference(package),
        "name": package["name"],
        "version": package["version"],
    });
    // ours are in no registry
    if !package["source"].is_null() {
        component["purl"] = reference(package).into();
    }
    if let Some(licence) = package["license"].as_str() {
        // a slash is how SPDX was written once
        let expression = licence.replace('/', " OR ");
        component["licenses"] = json!([{ "expression": expression }]);
    }
    component
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_linked_is_listed_and_what_only_builds_is_not() {
        let package = |name: &str, source: Value| json!({"id": name, "name": name, "version": "1.0.0", "license": "MIT/Apache-2.0", "source": source});
        let registry = json!("registry+https://github.com/rust-lang/crates.io-index");
        let need = |of: &str, kind: Value| json!({"pkg": of, "dep_kinds": [{"kind": kind}]});
        let metadata = json!({
            "packages": [
                package("image", Value::Null),
                package("linked", registry.clone()),
                package("below", registry.clone()),
                package("builds", registry.clone()),
                package("other", registry),
            ],
            "resolve": {"nodes": [
                {"id": "image", "deps": [need("linked", Value::Null), need("builds", json!("build"))]},
                {"id": "linked", "deps": [need("below", Value::Null)]},
                {"id": "other", "deps": []},
            ]},
        });
        let bill = bill(&metadata, "image").unwrap();
        let names = bill["components"].as_array().unwrap().iter();
        let names: Vec<&str> = names.map(|one| one["name"].as_str().unwrap()).collect();
        assert_eq!(names, ["below", "linked"]);
        let below = &bill["components"][0];
        assert_eq!(below["purl"], "pkg:cargo/below@1.0.0");
        assert_eq!(below["licenses"][0]["expression"], "MIT OR Apache-2.0");
        assert_eq!(bill["metadata"]["component"]["type"], "firmware");
        assert!(bill["metadata"]["component"]["purl"].is_null());
        let image = &bill["dependencies"][1];
        assert_eq!(image["ref"], "pkg:cargo/image@1.0.0");
        assert_eq!(image["dependsOn"], json!(["pkg:cargo/linked@1.0.0"]));
        assert!(super::bill(&metadata, "nobody").is_err());
    }
}
