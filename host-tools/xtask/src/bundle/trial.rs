//! A release tried where nothing else is: the first commands of the book's four readers, in an empty folder.

use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

use anyhow::{Context as _, Result, ensure};

use super::Files;
use crate::shell;

/// Unpacks the files and runs what their readers would run first. Errors: one of the commands does not do it.
pub(super) fn run(files: &Files) -> Result<()> {
    let folder = tempfile::tempdir()?;
    let at = folder.path();
    super::write(&at.join("release"), files)?;
    let program = files.keys().find(|name| is_command(name));
    let program = program.context("a release has a command")?;
    let program = at.join("release").join(program);
    let tactus = |words: &str| said(at, &program, words);
    // the curious
    let told = tactus("")?;
    ensure!(told.contains("It is ") && told.contains("Right."), "{told}");
    // whoever has data of their own
    for (name, tone) in [("cork", 90.0), ("felt", 170.0), ("denim", 320.0)] {
        for number in 0..6_u32 {
            let file = at.join("my-data").join(name).join(format!("{number}.wav"));
            std::fs::create_dir_all(file.parent().context("it has one")?)?;
            std::fs::write(file, wav(tone, number))?;
        }
    }
    tactus("import my-data recordings")?;
    let told = tactus("evaluate --recordings recordings --runs 20")?;
    ensure!(told.contains("20 runs over 3 textures"), "{told}");
    // the maker, whose probe is not plugged in
    let told = tactus("device doctor --port /dev/no-probe").unwrap_or_else(|why| why.to_string());
    ensure!(told.contains("no-probe"), "{told}");
    // the inspector
    let told = tactus("verify --simulated --texture corkboard --material marble")?;
    ensure!(told.contains("ifferent"), "{told}");
    wheel(at, files)?;
    println!(
        "tried in an empty folder: tactus, import, evaluate, doctor, verify, and the wheel where there is one"
    );
    Ok(())
}

fn is_command(name: &str) -> bool {
    name.starts_with("tactus-") && name.contains(std::env::consts::ARCH) && !name.ends_with(".whl")
}

/// The output of a command line in a folder, with nothing of this user's. An exit code of 3 or 4 is a verdict.
fn said(at: &Path, program: &Path, words: &str) -> Result<String> {
    let mut command = Command::new(program);
    command.args(words.split_whitespace()).current_dir(at);
    command.env_clear().env("HOME", at).env("NO_COLOR", "1");
    let output = command
        .output()
        .with_context(|| program.display().to_string())?;
    let mut told = String::from_utf8_lossy(&output.stdout).into_owned();
    let _ = write!(told, "{}", String::from_utf8_lossy(&output.stderr));
    ensure!(
        matches!(output.status.code(), Some(0 | 3 | 4)),
        "`tactus {words}` of the release: {}: {told}",
        output.status
    );
    Ok(told)
}

/// A second of a tone in noise, 16 bits at 4 kHz.
fn wav(tone_hz: f64, seed: u32) -> Vec<u8> {
    let mut state = seed
        .wrapping_mul(2_654_435_761)
        .wrapping_add(tone_hz as u32);
    let samples = (0..8000_u32).flat_map(|n| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let noise = f64::from(state >> 16) / 32768.0 - 1.0;
        let tone = (std::f64::consts::TAU * tone_hz * f64::from(n) / 4000.0).sin();
        ((3000.0 * tone + 1500.0 * noise) as i16).to_le_bytes()
    });
    let samples: Vec<u8> = samples.collect();
    let length = samples.len() as u32;
    let mut file = b"RIFF".to_vec();
    file.extend((length + 36).to_le_bytes());
    file.extend(b"WAVEfmt \x10\0\0\0\x01\0\x01\0");
    file.extend(4000_u32.to_le_bytes());
    file.extend(8000_u32.to_le_bytes());
    file.extend(b"\x02\0\x10\0data");
    file.extend(length.to_le_bytes());
    file.extend(samples);
    file
}

/// Installs this machine's wheel beside nothing else, and imports it.
fn wheel(at: &Path, files: &Files) -> Result<()> {
    let is_ours = |name: &&String| name.ends_with(".whl") && name.contains(std::env::consts::ARCH);
    let Some(name) = files.keys().find(is_ours) else {
        return Ok(());
    };
    let mut install = Command::new("python3");
    install.args(["-m", "pip", "install", "--quiet", "--target"]);
    install
        .arg(at.join("site"))
        .arg(at.join("release").join(name));
    if !install.status().is_ok_and(|status| status.success()) {
        return shell::skip(
            "the wheel of the release",
            "pip cannot install it: is there a network?",
        );
    }
    let mut python = Command::new("python3");
    python.args(["-c", "import tactus; print('tactus', tactus.__version__)"]);
    shell::run(python.env("PYTHONPATH", at.join("site")).current_dir(at))
}
