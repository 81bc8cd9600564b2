//! `tactus.toml`: what a user does not want to say again, the port, the recordings, and defaults of options.

use std::collections::BTreeMap;
use std::env;
use std::ffi::OsString;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use anyhow::{Context as _, ensure};
use serde::{Deserialize, Serialize};

use super::output::{Format, print_json, print_rows};

/// Show the settings in use, and where they come from
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tactus config
  tactus config --format json

The file is the one that TACTUS_CONFIG names (nothing: none), or else the first tactus.toml in this folder and those above it, or else
tactus/tactus.toml in ~/.config (XDG_CONFIG_HOME). What is given as an option goes before the environment, and that before the file:

  port = \"/dev/ttyACM0\"           # where --port is not given
  recordings = \"recordings\"       # where --recordings is not given; from the file's folder on
  quiet = true                    # no progress and no notices

  [defaults.identify]             # options of `tactus identify`, where they are not given
  threshold = 0.999
  [defaults.\"device identify\"]
  max-slides = 5")]
pub(crate) struct Args {
    /// How to print them
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

/// What a file may say.
#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
struct Said {
    port: Option<String>,
    recordings: Option<PathBuf>,
    #[serde(default)]
    quiet: bool,
    #[serde(default)]
    defaults: BTreeMap<String, BTreeMap<String, toml::Value>>,
}

/// The settings in use.
#[derive(Default)]
pub(crate) struct Config {
    file: Option<PathBuf>,
    said: Said,
}

static CONFIG: OnceLock<Config> = OnceLock::new();

/// The settings in use; none before they were read.
fn config() -> &'static Config {
    static NONE: OnceLock<Config> = OnceLock::new();
    CONFIG
        .get()
        .unwrap_or_else(|| NONE.get_or_init(Config::default))
}

/// A variable that says something.
fn named(variable: &str) -> Option<OsString> {
    env::var_os(variable).filter(|value| !value.is_empty())
}

/// The port, where no option says it.
pub(crate) fn port() -> Option<String> {
    let named = named("TACTUS_PORT").and_then(|port| port.into_string().ok());
    named.or_else(|| config().said.port.clone())
}

/// The folder of recordings, where no option says it.
pub(crate) fn recordings() -> Option<PathBuf> {
    let named = named("TACTUS_RECORDINGS").map(PathBuf::from);
    named.or_else(|| config().recordings())
}

/// Reads the settings; the arguments with the defaults that they say.
///
/// # Errors
/// The file cannot be read, or says what nobody knows.
pub(crate) fn read(
    program: &clap::Command,
    arguments: impl Iterator<Item = OsString>,
) -> anyhow::Result<Vec<OsString>> {
    let config = Config::read()?;
    let arguments = config.fill(program, arguments.collect())?;
    // read once
    let _ = CONFIG.set(config);
    Ok(arguments)
}

/// Tells which file is in use, where that is to be told.
pub(crate) fn tell() {
    if let Some(file) = &config().file {
        tracing::info!(file = %file.display(), "settings");
    }
}

/// Whether nothing is to be shown but results.
pub(crate) fn is_quiet() -> bool {
    config().said.quiet
}

impl Config {
    fn read() -> anyhow::Result<Self> {
        let Some(file) = find() else {
            return Ok(Self::default());
        };
        let name = file.display().to_string();
        let text = std::fs::read_to_string(&file).with_context(|| name.clone())?;
        let said = toml::from_str(&text).with_context(|| {
            format!("{name}: these are no settings; `tactus config --help` shows some")
        })?;
        Ok(Self {
            file: Some(file),
            said,
        })
    }

    fn recordings(&self) -> Option<PathBuf> {
        let folder = self.file.as_deref().and_then(Path::parent);
        let folder = folder.unwrap_or(Path::new(""));
        Some(folder.join(self.said.recordings.as_ref()?))
    }

    /// Appends the options that the file says and the arguments do not.
    fn fill(
        &self,
        program: &clap::Command,
        mut arguments: Vec<OsString>,
    ) -> anyhow::Result<Vec<OsString>> {
        let file = self.file.as_deref().unwrap_or(Path::new("")).display();
        for (name, options) in &self.said.defaults {
            let command = name
                .split(' ')
                .try_fold(program, |command, word| command.find_subcommand(word));
            let command =
                command.with_context(|| format!("{file}: there is no `tactus {name}`"))?;
            for (option, value) in options {
                let known = command
                    .get_arguments()
                    .find(|known| known.get_long() == Some(option));
                let known = known
                    .with_context(|| format!("{file}: `tactus {name}` has no option --{option}"))?;
                if !is_asked(program, &arguments, name) || is_given(known, &arguments) {
                    continue;
                }
                match value {
                    toml::Value::Boolean(true) => arguments.push(format!("--{option}").into()),
                    toml::Value::Boolean(false) => {}
                    toml::Value::String(value) => {
                        arguments.push(format!("--{option}={value}").into());
                    }
                    value => {
                        let plain = value.is_integer() || value.is_float();
                        ensure!(
                            plain,
                            "{file}: {option} of `tactus {name}` is no number and no text"
                        );
                        arguments.push(format!("--{option}={value}").into());
                    }
                }
            }
        }
        Ok(arguments)
    }
}

/// Whether the arguments ask for this command.
fn is_asked(program: &clap::Command, arguments: &[OsString], name: &str) -> bool {
    let mut command = program;
    let mut asked = Vec::new();
    for word in arguments.iter().skip(1).filter_map(|word| word.to_str()) {
        match command.find_subcommand(word) {
            Some(found) => {
                command = found;
                asked.push(found.get_name());
            }
            None if word.starts_with('-') => {}
            None => break,
        }
    }
    asked.join(" ") == name
}

/// Whether an option stands among the arguments, in its long or its short form.
fn is_given(option: &clap::Arg, arguments: &[OsString]) -> bool {
    let long = option.get_long().map(|long| format!("--{long}"));
    let short = option.get_short().map(|short| format!("-{short}"));
    let mut words = arguments.iter().filter_map(|word| word.to_str());
    words.any(|word| {
        let word = word.split_once('=').map_or(word, |(name, _)| name);
        Some(word) == long.as_deref() || short.as_ref().is_some_and(|short| word.starts_with(short))
    })
}

/// The file of settings.
fn find() -> Option<PathBuf> {
    const NAME: &str = "tactus.toml";
    if let Some(named) = env::var_os("TACTUS_CONFIG") {
        return (!named.is_empty()).then(|| named.into());
    }
    let here = env::current_dir().unwrap_or_default();
    let mut above = here.ancestors().map(|folder| folder.join(NAME));
    if let Some(there) = above.find(|file| file.is_file()) {
        return Some(there);
    }
    let home = named("HOME").map(|home| PathBuf::from(home).join(".config"));
    let folder = named("XDG_CONFIG_HOME").map(PathBuf::from).or(home)?;
    let file = folder.join("tactus").join(NAME);
    file.is_file().then_some(file)
}

/// What `config --format json` prints.
#[derive(Serialize)]
struct Summary {
    /// The file in use.
    file: Option<PathBuf>,
    port: Option<String>,
    recordings: Option<PathBuf>,
    quiet: bool,
    /// Options by command.
    defaults: BTreeMap<String, BTreeMap<String, toml::Value>>,
}

/// Prints the settings.
pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    let config = config();
    let summary = Summary {
        file: config.file.clone(),
        port: port(),
        recordings: recordings(),
        quiet: is_quiet(),
        defaults: config.said.defaults.clone(),
    };
    if args.format == Format::Json {
        return print_json(&summary, out);
    }
    let from = |variable: &str, there: bool| match (named(variable), there) {
        (Some(_), _) => format!("  (by {variable})"),
        (None, true) => String::new(),
        (None, false) => "not set".to_owned(),
    };
    let file = summary.file.map(|file| file.display().to_string());
    let port = summary.port.unwrap_or_default();
    let recordings = summary
        .recordings
        .map(|folder| folder.display().to_string());
    let recordings = recordings.unwrap_or_default();
    let mut rows = vec![
        ("file", file.unwrap_or_else(|| "none".to_owned())),
        (
            "port",
            port.clone() + &from("TACTUS_PORT", !port.is_empty()),
        ),
        (
            "recordings",
            recordings.clone() + &from("TACTUS_RECORDINGS", !recordings.is_empty()),
        ),
        ("quiet", if summary.quiet { "yes" } else { "no" }.to_owned()),
    ];
    for (command, options) in &summary.defaults {
        let options = options
            .iter()
            .map(|(name, value)| format!(" --{name}={value}"));
        rows.push((
            "default",
            format!("tactus {command}{}", options.collect::<String>()),
        ));
    }
    print_rows(&rows, out)
}
