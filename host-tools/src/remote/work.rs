//! What is done with a probe, as `tactus device` does it.

use std::io::{self, Write as _};

use tactus_core::explorer::{Config, Strategy};
use tactus_core::table::Table;
use tactus_core::wire::{self, Command, Identify};

use super::bench::{Bench, WorkError};
use super::message::{File, Folder, Work};
use super::say::{
    Prompts, compare, name_of, of_sample, replaced, show_found, show_training, show_verifying,
    status_rows,
};
use super::verifying::Verifying;
use crate::data::recorder::Recorder;
use crate::data::recording::{Labels, Texture};
use crate::data::recordings::files_of;
use crate::eval::alike;
use crate::eval::evaluate::Method;
use crate::eval::show::{Show, count};
use crate::eval::verified::{print_answer, print_slide};
use crate::link::{PushTable, Request};

/// Does it.
pub(super) async fn work(bench: &Bench, work: Work) -> Result<(), WorkError> {
    match work {
        Work::Status => status(bench).await,
        Work::Home => home(bench).await,
        Work::Identify {
            threshold,
            false_alarm,
            max_slides,
            seed,
        } => {
            let wanted = Identify {
                threshold,
                max_slides,
                seed,
                false_alarm,
                ..Identify::default()
            };
            identify(bench, wanted).await
        }
        Work::Teach { name } => teach(bench, &name).await,
        Work::Train { name, trials, seed } => {
            let name = name_of(&name)?;
            let wanted = wire::Train {
                name,
                trials,
                pilot: false,
                seed,
            };
            train(bench, wanted).await
        }
        Work::Verify {
            name,
            threshold,
            max_slides,
            seed,
        } => {
            let wanted = Identify {
                threshold,
                max_slides,
                strategy: Strategy::Cycling,
                seed,
                ..Identify::default()
            };
            verify(bench, &name, wanted).await
        }
        Work::Record { name, slides, seed } => record(bench, &name, slides, seed).await,
        Work::Pull => pull(bench).await,
        Work::Push { file, bytes } => push(bench, &file, &bytes).await,
    }
}

/// What a person reads when a probe is there.
pub(super) async fn status(bench: &Bench) -> Result<(), WorkError> {
    let status = bench.hello().await?;
    let calibration = bench.get(Request::read_calibration()).await?;
    let mut out = bench.out.clone();
    for (name, value) in status_rows(&bench.name(), &status, &calibration, bench.losses()) {
        writeln!(out, "{name:<15} {value}")?;
    }
    bench.table().await?;
    Ok(())
}

async fn home(bench: &Bench) -> Result<(), WorkError> {
    let (mut prompts, mut out) = (Prompts::default(), bench.out.clone());
    let request = Request::command(Command::Home);
    bench
        .run(request, |report| prompts.show(report, &mut out))
        .await?;
    let out = &mut bench.out.clone();
    writeln!(
        out,
        "Ready: lever and stage have found their limit switches."
    )?;
    Ok(())
}

async fn identify(bench: &Bench, mut wanted: Identify) -> Result<(), WorkError> {
    let status = bench.hello().await?;
    let bytes = bench.table().await?;
    let table = Table::read(&bytes)?;
    // told, so that a log says what was decided by
    wanted.false_alarm = wanted.false_alarm.or(status.false_alarm);
    let (among, seed) = (table.textures(), wanted.seed);
    let mut out = bench.out.clone();
    writeln!(out, "An unknown texture, one of {among} (seed {seed}).")?;
    // for the log: with its samples every slide can be measured again
    bench.get(Request::command(Command::Stream(true))).await?;
    bench.explores(wanted.config(table.contents()));
    let mut show = Show::new(table, bench.out.clone());
    let request = Request::identify(wanted);
    let found = bench
        .run(request, |report| show.event(&report.event))
        .await?;
    bench.get(Request::command(Command::Stream(false))).await?;
    show_found(&found, bench.losses(), &mut out)?;
    Ok(())
}

/// The names of the textures that the probe knows.
async fn names(bench: &Bench) -> Result<Vec<String>, WorkError> {
    let bytes = bench.table().await?;
    Ok(Table::read(&bytes)?.names().map(str::to_owned).collect())
}

/// Compares what was learned with the rest of the probe's table.
async fn learned(bench: &Bench, name: &str, before: &[String]) -> Result<(), WorkError> {
    let bytes = bench.table().await?;
    let table = Table::read(&bytes)?;
    let nearest = table.find(name).and_then(|at| alike::nearest(table, at));
    if let Some(nearest) = nearest {
        let is_new = !before.iter().any(|known| known == name);
        compare(name, is_new, &nearest, &mut bench.out.clone())?;
    }
    Ok(())
}

async fn teach(bench: &Bench, name: &str) -> Result<(), WorkError> {
    let name = name_of(name)?;
    let before = names(bench).await?;
    let taught = bench.get(Request::label(name)).await?;
    let slides = count(taught.slides, "slide");
    let name = &taught.name;
    writeln!(
        bench.out.clone(),
        "The probe has learned {name} from {slides}."
    )?;
    learned(bench, name, &before).await
}

async fn train(bench: &Bench, wanted: wire::Train) -> Result<(), WorkError> {
    let before = names(bench).await?;
    let name = wanted.name.clone();
    let (mut prompts, mut out) = (Prompts::default(), bench.out.clone());
    let slides = bench
        .run(Request::train(wanted), |report| {
            show_training(report, &mut prompts, &mut out)
        })
        .await?;
    writeln!(out, "{name}: {} made.", count(slides, "slide"))?;
    learned(bench, &name, &before).await?;
    if slides > 0 {
        writeln!(out, "{}", of_sample(None))?;
    }
    Ok(())
}

async fn verify(bench: &Bench, name: &str, wanted: Identify) -> Result<(), WorkError> {
    let status = bench.hello().await?;
    let bytes = bench.table().await?;
    let texture = Table::read(&bytes)?.find(name).ok_or_else(|| {
        WorkError::Said(format!(
            "no texture {name}: choose one that the probe knows"
        ))
    })?;
    let config = Config {
        strategy: Strategy::Cycling,
        verify: true,
        false_alarm: wanted.false_alarm.or(status.false_alarm),
        threshold: wanted.threshold,
        max_slides: wanted.max_slides,
        method: Method::Fused.method(),
        ..Config::default()
    };
    let mut verifying = Verifying::new(&bytes, texture, config)?;
    let wanted = Identify {
        among: std::iter::once(texture).collect(),
        false_alarm: config.false_alarm,
        ..wanted
    };
    let (mut prompts, mut out) = (Prompts::default(), bench.out.clone());
    writeln!(out, "Is it {}?", verifying.reference())?;
    let request = Request::command(Command::Verify(wanted));
    bench
        .run(request, |report| match verifying.hear(&report.event) {
            Some(slide) => print_slide(slide, &mut out),
            None => show_verifying(report, &mut prompts, &mut out),
        })
        .await?;
    print_answer(&verifying.end(), &mut bench.out.clone())?;
    Ok(())
}

async fn record(bench: &Bench, name: &str, slides: u8, seed: u32) -> Result<(), WorkError> {
    let name = name_of(name)?.to_string();
    let status = bench.hello().await?;
    let calibration = bench.get(Request::read_calibration()).await?;
    bench.get(Request::command(Command::Stream(true))).await?;
    let mut recorder = Recorder::new(calibration.pressure);
    let (mut lost, mut kept) = (Vec::new(), Vec::new());
    let (mut prompts, mut out) = (Prompts::default(), bench.out.clone());
    // never sure: all slides are made
    let wanted = Identify {
        threshold: 1.0,
        max_slides: slides,
        strategy: Strategy::Cycling,
        open: false,
        seed,
        ..Identify::default()
    };
    bench
        .run(Request::identify(wanted), |report| {
            match recorder.hear(0, report) {
                Some(Ok(slide)) => {
                    let (number, movement) = (slide.number, slide.movement);
                    writeln!(out, "{name}, slide {number} of {slides}: {movement}")?;
                    kept.push(slide);
                }
                Some(Err(why)) => lost.push(why),
                None => prompts.show(report, &mut out)?,
            }
            io::Result::Ok(())
        })
        .await?;
    bench.get(Request::command(Command::Stream(false))).await?;
    let mut out = bench.out.clone();
    for why in &lost {
        writeln!(out, "{name}: a slide is not recorded: {why}")?;
    }
    if kept.is_empty() {
        return Err(WorkError::Said(format!(
            "{name}: no slide arrived whole; check the cable, then record again"
        )));
    }
    let texture = Texture {
        id: 1,
        name: name.clone(),
    };
    let labels = Labels {
        finger: status.finger,
        calibrated: status.calibrated,
        ..Labels::default()
    };
    let files = files_of(&texture, &labels, &kept)?;
    let files = files
        .into_iter()
        .map(|(name, bytes)| File { name, bytes })
        .collect();
    let folder = plain(&name);
    writeln!(
        out,
        "{folder}: {} of {}. Next: tactus features --recordings {folder}",
        count(kept.len() as u64, "slide"),
        count(1_u8, "texture")
    )?;
    bench.keep_folder(Folder {
        name: folder,
        files,
    });
    Ok(())
}

/// A name that a folder can have everywhere.
fn plain(name: &str) -> String {
    let plain = |c: char| if c.is_alphanumeric() { c } else { '-' };
    name.to_lowercase().chars().map(plain).collect()
}

async fn pull(bench: &Bench) -> Result<(), WorkError> {
    let bytes = bench.table().await?;
    let table = Table::read(&bytes)?;
    let (textures, length, crc) = (count(table.textures(), "texture"), bytes.len(), table.crc());
    let file = format!("table-{crc:08x}.tact");
    writeln!(
        bench.out.clone(),
        "{file}: {textures}, {length} bytes, checksum {crc:08x}"
    )?;
    bench.keep(file, bytes);
    Ok(())
}

async fn push(bench: &Bench, file: &str, bytes: &[u8]) -> Result<(), WorkError> {
    let of_file = |source| WorkError::File {
        file: file.to_owned(),
        source,
    };
    let table = Table::read(bytes).map_err(|why| of_file(why.into()))?;
    let push = PushTable::new(table.as_bytes()).map_err(of_file)?;
    let status = bench.hello().await?;
    table
        .of_finger(status.finger)
        .map_err(|why| of_file(why.into()))?;
    let mut out = bench.out.clone();
    // the firmware's own table is never lost
    if !status.factory && status.table_crc != table.crc() {
        let old = bench.table().await?;
        let lost = replaced(&Table::read(&old)?, Some(&table));
        let backup = format!("table-{:08x}.tact", status.table_crc);
        bench.keep(backup.clone(), old);
        writeln!(out, "{lost}\nThe probe's table is kept: {backup}")?;
        if !bench.ask("Go on?").await? {
            return Err(WorkError::Said("nothing was changed".to_owned()));
        }
    }
    bench.get(push).await?;
    // not what was sent counts, but what the probe uses from now on
    let now = bench.get(Request::status()).await?;
    let (checksum, pushed) = (
        format!("{:08x}", now.table_crc),
        format!("{:08x}", table.crc()),
    );
    if checksum != pushed {
        return Err(WorkError::Said(format!(
            "the probe uses the table {checksum} and not {pushed}, the one pushed: push it again"
        )));
    }
    bench.table().await?;
    let textures = count(now.textures, "texture");
    writeln!(
        out,
        "{file}: the probe uses it now: {textures}, checksum {checksum}"
    )?;
    Ok(())
}
