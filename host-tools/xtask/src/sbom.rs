//! What a release is made of: every crate in it, as CycloneDX 1.5, from cargo's own resolution. The same commit gives the same bytes.
use std::collections::{BTreeMap, BTreeSet};

use anyhow::{Context as _, Result, ensure};
use serde_json::{Value, json};

use crate::shell::{cargo, root};
use crate::toolchain::{self, BROWSER, CHIP};

/// What a release has beside other things, with its own bill of materials.
#[derive(Clone, Copy)]
pub(crate) struct Part {
    name: &'static str,
    /// Where its workspace is.
    manifest: &'static str,
    package: &'static str,
    /// What it is, as CycloneDX says it.
    kind: &'static str,
    /// What it is built for; without one this machine.
    triple: Option<&'static str>,
}

/// The images.
pub(crate) const FIRMWARE: Part = Part {
    name: "firmware",
    manifest: "Cargo.toml",
    package: "tactus-firmware",
    kind: "firmware",
    triple: Some(CHIP.triple),
};
/// The program `tactus`.
pub(crate) const COMMAND: Part = Part {
    name: "command",
    manifest: "Cargo.toml",
    package: "tactus-probe",
    kind: "application",
    triple: None,
};
/// The Python package.
pub(crate) const WHEEL: Part = Part {
    name: "wheel",
    manifest: "host-tools/python/Cargo.toml",
    package: "tactus-python",
    kind: "library",
    triple: None,
};
/// The page with the simulated probe.
pub(crate) const PAGE: Part = Part {
    name: "page",
    manifest: "host-tools/page/Cargo.toml",
    package: "tactus-page",
    kind: "application",
    triple: Some(BROWSER.triple),
};

impl Part {
    /// The name of its bill: "sbom-firmware.cdx.json".
    pub(crate) fn file(self) -> String {
        format!("sbom-{}.cdx.json", self.name)
    }

    /// What cargo resolves for it.
    pub(crate) fn metadata(self) -> Result<Value> {
        let mut metadata = cargo();
        metadata.args(["metadata", "--format-version", "1", "--locked"]);
        metadata
            .arg("--manifest-path")
            .arg(root().join(self.manifest));
        let triple = match self.triple {
            Some(triple) => triple.to_owned(),
            None => toolchain::host()?,
        };
        metadata.args(["--filter-platform", &triple]);
        let out = metadata.output().context("cannot start cargo")?;
        let said = String::from_utf8_lossy(&out.stderr);
        ensure!(out.status.success(), "cargo metadata: {said}");
        Ok(serde_json::from_slice(&out.stdout)?)
    }

    /// Its bill of materials.
    pub(crate) fn bill(self, metadata: &Value) -> Result<Vec<u8>> {
        let bill = bill(&Linked::of(metadata, self.package)?, self.kind);
        let mut bytes = serde_json::to_vec_pretty(&bill)?;
        bytes.push(b'\n');
        Ok(bytes)
    }

    /// The packages of others in it, by name and version.
    pub(crate) fn packages(self, metadata: &Value) -> Result<BTreeMap<String, Value>> {
        let linked = Linked::of(metadata, self.package)?;
        let others = linked
            .packages
            .values()
            .filter(|of| !of["source"].is_null());
        Ok(others.map(|of| (reference(of), (*of).clone())).collect())
    }
}

/// A package and all that it is linked with; what is only needed to build or to test is left out.
struct Linked<'m> {
    root: &'m Value,
    /// By their identifiers.
    packages: BTreeMap<&'m str, &'m Value>,
    /// What each is linked with directly.
    needs: BTreeMap<&'m str, Vec<&'m str>>,
}

impl<'m> Linked<'m> {
    fn of(metadata: &'m Value, root: &str) -> Result<Self> {
        let packages = metadata["packages"].as_array().context("no packages")?;
        let mut by_id: BTreeMap<&str, &Value> = packages
            .iter()
            .filter_map(|package| Some((package["id"].as_str()?, package)))
            .collect();
        let runs_in_compiler = |id: &&str| by_id.get(id).is_some_and(|of| is_macro(of));
        let nodes = metadata["resolve"]["nodes"].as_array();
        let mut needs: BTreeMap<&str, Vec<&str>> = nodes
            .context("no resolution")?
            .iter()
            .filter_map(|node| {
                let mut of_it = linked(node);
                of_it.retain(|id| !runs_in_compiler(id));
                Some((node["id"].as_str()?, of_it))
            })
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
        by_id.retain(|id, _| seen.contains(id));
        needs.retain(|id, _| seen.contains(id));
        Ok(Self {
            root,
            packages: by_id,
            needs,
        })
    }
}

/// The bill of a package, a component of this kind.
fn bill(linked: &Linked<'_>, kind: &str) -> Value {
    let of = |id: &&str| linked.packages.get(id).map(|package| reference(package));
    let mut components = Vec::new();
    let mut dependencies = Vec::new();
    for (id, package) in &linked.packages {
        let needs = linked.needs.get(id).into_iter().flatten();
        let needs: BTreeSet<String> = needs.filter_map(of).collect();
        dependencies.push(json!({"ref": reference(package), "dependsOn": needs}));
        if package["id"] != linked.root["id"] {
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
    json!({
        "$schema": "http://cyclonedx.org/schema/bom-1.5.schema.json",
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": {"component": component(linked.root, kind)},
        "components": components,
        "dependencies": dependencies,
    })
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

/// Whether a package is a plug-in of the compiler, of which nothing is linked.
fn is_macro(package: &Value) -> bool {
    let targets = package["targets"].as_array().map_or(&[][..], Vec::as_slice);
    let mut kinds = targets
        .iter()
        .filter_map(|target| target["kind"].as_array());
    kinds.any(|kinds| kinds.iter().any(|kind| kind == "proc-macro"))
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
                json!({"id": "derives", "name": "derives", "version": "1.0.0", "targets": [{"kind": ["proc-macro"]}]}),
            ],
            "resolve": {"nodes": [
                {"id": "image", "deps": [need("linked", Value::Null), need("builds", json!("build")), need("derives", Value::Null)]},
                {"id": "linked", "deps": [need("below", Value::Null)]},
                {"id": "other", "deps": []},
            ]},
        });
        let bill = bill(&Linked::of(&metadata, "image").unwrap(), "firmware");
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
        assert!(Linked::of(&metadata, "nobody").is_err());
    }
}
