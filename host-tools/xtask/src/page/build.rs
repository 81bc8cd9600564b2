//! The page with the simulated probe: one file of HTML, with its script, its style and the WebAssembly module in it.
//!
//! One file, since a browser loads neither modules nor WebAssembly from beside a page that was opened from a folder.
//! For the same reason its scripts are plain ones; a content-security policy allows these by their hashes, and nothing
//! else.
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, ensure};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use sha2::{Digest as _, Sha256};

use crate::shell::{root, run, target};
use crate::toolchain::{self, BROWSER};

/// The crate, from the top.
pub(super) const CRATE: &str = "host-tools/page";
/// What the page's world was learned from: it stands beside the module in the page.
const TRIALS: &str = "host-tools/lab/src/live/world-1.trials";
/// The module is downloaded by whoever opens the page; half a megabyte of it imports recordings.
const MOST_BYTES: usize = 1_650_000;

pub(crate) struct Built {
    pub(crate) page: PathBuf,
    pub(crate) wasm: PathBuf,
    pub(crate) wasm_bytes: usize,
}

/// Builds the page: with the profile `release`, as small as it gets, or `tested`, which takes less time.
pub(crate) fn build(profile: &str) -> Result<Built> {
    let toolchain = toolchain::get(BROWSER)?;
    eprintln!("Building with {}", toolchain.version());
    let mut cargo = toolchain.cargo_build(BROWSER);
    cargo.args(["--profile", profile, "--manifest-path"]);
    run(cargo.arg(root().join(CRATE).join("Cargo.toml"))).context("the page does not build")?;
    let built = toolchain.folder(BROWSER).join(BROWSER.triple);
    let wasm = built.join(profile).join("tactus_page.wasm");
    let module = read(&wasm)?;
    ensure!(
        module.len() <= MOST_BYTES || profile != "release",
        "the module has {} bytes, {MOST_BYTES} are allowed",
        module.len()
    );
    let page = target().join("page").join("index.html");
    let html = assemble(
        &root().join(CRATE).join("www"),
        &module,
        &read(&root().join(TRIALS))?,
    )?;
    std::fs::create_dir_all(target().join("page")).context("cannot make target/page")?;
    std::fs::write(&page, html).with_context(|| format!("cannot write {}", page.display()))?;
    Ok(Built {
        page,
        wasm,
        wasm_bytes: module.len(),
    })
}

fn read(file: &Path) -> Result<Vec<u8>> {
    std::fs::read(file).with_context(|| format!("cannot read {}", file.display()))
}

/// The page of a folder, with everything that it names in it.
fn assemble(folder: &Path, module: &[u8], trials: &[u8]) -> Result<String> {
    let text = |name: &str| -> Result<String> {
        String::from_utf8(read(&folder.join(name))?).with_context(|| format!("{name} is no text"))
    };
    let mut html = text("index.html")?;
    let mut hashes = [String::new(), String::new()];
    let kinds = [
        ("<script src=\"", "\"></script>", "script"),
        ("<link rel=\"stylesheet\" href=\"", "\">", "style"),
    ];
    for (hashes, (before, after, tag)) in hashes.iter_mut().zip(kinds) {
        while let Some(at) = html.find(before) {
            let name = html[at + before.len()..]
                .split('"')
                .next()
                .unwrap_or_default();
            let named = format!("{before}{name}{after}");
            let content = text(name)?;
            let end = format!("</{tag}");
            ensure!(!content.contains(&end), "{name} contains {end}");
            ensure!(
                html.contains(&named),
                "index.html: {named} is written another way"
            );
            let hash = BASE64.encode(Sha256::digest(&content));
            hashes.push_str(&format!(" 'sha256-{hash}'"));
            html = html.replacen(&named, &format!("<{tag}>{content}</{tag}>"), 1);
        }
    }
    let [scripts, styles] = hashes;
    // no connection, no form, no frame: what is done here stays here
    let csp = format!(
        "default-src 'none'; script-src 'wasm-unsafe-eval'{scripts}; style-src{styles}; img-src data:; \
         base-uri 'none'; form-action 'none'"
    );
    for (mark, text) in [
        ("{{csp}}", csp),
        ("{{wasm}}", BASE64.encode(module)),
        ("{{trials}}", BASE64.encode(trials)),
    ] {
        ensure!(
            html.matches(mark).count() == 1,
            "index.html has not one {mark}"
        );
        html = html.replacen(mark, &text, 1);
    }
    Ok(html)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(files: &[(&str, &str)]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in files {
            std::fs::write(folder.path().join(name), text).unwrap();
        }
        folder
    }

    const HTML: &str = "<meta content=\"{{csp}}\"><link rel=\"stylesheet\" href=\"a.css\">\
        <p id=w>{{wasm}}</p><p id=t>{{trials}}</p><script src=\"a.js\"></script>";

    #[test]
    fn all_that_a_page_names_is_in_it_and_allowed_by_its_hash() {
        let folder = folder(&[("index.html", HTML), ("a.css", "p{}"), ("a.js", "go()")]);
        let html = assemble(folder.path(), b"\0asm", b"t").unwrap();
        assert!(html.contains("<style>p{}</style>") && html.contains("<script>go()</script>"));
        assert!(html.contains("<p id=w>AGFzbQ==</p><p id=t>dA==</p>"));
        // printf 'go()' | openssl dgst -sha256 -binary | base64
        assert!(html.contains("script-src 'wasm-unsafe-eval' 'sha256-"));
        assert!(!html.contains("a.js") && !html.contains("unsafe-inline"));
    }

    #[test]
    fn a_script_that_would_end_itself_is_an_error() {
        let folder = folder(&[("index.html", HTML), ("a.css", ""), ("a.js", "'</script>'")]);
        let error = assemble(folder.path(), b"", b"").unwrap_err().to_string();
        assert_eq!(error, "a.js contains </script");
    }

    #[test]
    fn the_page_loads_nothing() {
        let html = assemble(&root().join(CRATE).join("www"), b"", b"").unwrap();
        for word in ["http://", "https://", " src=", "import ", "fetch("] {
            let found = html.match_indices(word);
            // the name of a namespace is no address
            let loads =
                found.filter(|(at, _)| !html[*at..].starts_with("http://www.w3.org/2000/svg"));
            assert_eq!(loads.count(), 0, "{word}");
        }
    }
}
