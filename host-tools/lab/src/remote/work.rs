//! What is done with a probe, as `tactus device` does it.

use std::io::{self, Write as _};
use std::ops::ControlFlow;

use tactus_core::explorer::Strategy;
use tactus_core::table::Table;
use tactus_core::wire::{self, Command, Event, Forget, Identify};

use super::bench::{Bench, WorkError};
use super::message::{File, Folder, Question, Work};
use super::say::{
    HIGH_FORCE, Prompts, YIELDS, compare, forgotten, move_sample, name_of, not_noted, of_sample,
    replaced, show_found, show_settings, show_training, show_verifying, status_rows, uses_factory,
};
use super::verifying::{Verifying, config_of, words};
use crate::data::recorder::Recorder;
use crate::data::recording::{Labels, Texture};
use crate::data::recordings::files_of;
use crate::eval::alike;
use crate::eval::samples::{Noting, Trials, fewest, noting};
use crate::eval::show::{Show, count};
use crate::eval::verified::{print_answer, print_slide};
use crate::live::Happening;
use tactus_link::lifting::Stopped;
use tactus_link::{LinkError, PortError, PushTable, Request};

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
        Work::Train {
            name,
            trials,
            moved,
            seed,
        } => {
            let name = name_of(&name)?;
            let wanted = wire::Train {
                name,
                trials,
                pilot: false,
                seed,
            };
            train(bench, wanted, moved).await
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
        Work::Record {
            name,
            slides,
            moved,
            seed,
        } => record(bench, &name, slides, moved, seed).await,
        Work::Rename { from, to } => rename(bench, &from, &to).await,
        Work::Forget { name } => forget(bench, Forget::Texture(name_of(&name)?)).await,
        Work::ForgetTraining { name } => forget(bench, Forget::Training(name_of(&name)?)).await,
        Work::ForgetSelfLearned => forget(bench, Forget::SelfLearned).await,
        Work::Factory => factory(bench).await,
        Work::Settings => settings(bench).await,
        Work::FalseAlarm { share } => {
            let set = Command::SetFalseAlarm(share);
            bench.get(Request::command(set)).await?;
            settings(bench).await
        }
        Work::HighForce { on } => high_force(bench, on).await,
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

/// Has the sample moved before the next trial; whether it was.
async fn ask_to_move(bench: &Bench, name: &str) -> Result<bool, WorkError> {
    let question = Question {
        asked: format!("{}.", move_sample(name)),
        yes: "It is moved",
        no: "It stays",
    };
    let answer = bench.ask(question).await?;
    // between two trials the finger is lifted
    answer.ok_or(Stopped::Lifted.into())
}

async fn train(bench: &Bench, wanted: wire::Train, moved: Option<bool>) -> Result<(), WorkError> {
    let bytes = bench.table().await?;
    let table = Table::read(&bytes)?;
    let before: Vec<String> = table.names().map(str::to_owned).collect();
    let wire::Train {
        name, trials, seed, ..
    } = wanted.clone();
    let movements = table.movements().len();
    let noted = table.find(&name).map(|texture| table.moved(texture));
    let (mut prompts, mut out) = (Prompts::default(), bench.out.clone());
    let (mut samples, mut slides) = (Trials::default(), 0_u32);
    // trials of before, and somebody who knows whether the sample lies as it did
    if moved.is_none() && fewest(table, &name).is_some_and(|there| there < trials) {
        samples.said(Some(ask_to_move(bench, &name).await?));
    }
    for part in 0.. {
        let wanted = wire::Train {
            // slides of the next part begin elsewhere, too
            seed: seed.wrapping_add(part),
            ..wanted.clone()
        };
        let each = |report: &wire::Report| {
            show_training(report, &mut prompts, &mut out)?;
            let Event::TrainingSlide { left, .. } = report.event else {
                return Ok(ControlFlow::Continue(()));
            };
            let left = usize::from(left);
            if slides == 0 && left + 1 < usize::from(trials) * movements {
                samples.said(noted.flatten());
            }
            slides += 1;
            let ends_trial = left > 0 && left.is_multiple_of(movements);
            Ok(match ends_trial && moved.is_none() {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            })
        };
        if bench
            .run_until(Request::train(wanted), each)
            .await?
            .is_some()
        {
            break;
        }
        samples.said(Some(ask_to_move(bench, &name).await?));
    }
    writeln!(out, "{name}: {} made.", count(slides, "slide"))?;
    if slides > 0 {
        if moved.is_some() {
            samples.said(moved);
        }
        // one trial is moved from nowhere
        let moved = samples.moved().filter(|_| trials > 1);
        if let Some(why) = note_in_table(bench, &name, moved).await? {
            writeln!(out, "{}", not_noted(&why))?;
        }
        let bytes = bench.table().await?;
        let table = Table::read(&bytes)?;
        let moved = table.find(&name).and_then(|texture| table.moved(texture));
        writeln!(out, "{}", of_sample(moved))?;
    }
    learned(bench, &name, &before).await
}

/// Notes it in the table that the probe uses. `None`: done, or there was nothing to note; else why not, in a sentence.
async fn note_in_table(
    bench: &Bench,
    name: &str,
    moved: Option<bool>,
) -> Result<Option<String>, WorkError> {
    let noted = noting(&bench.table().await?, name, moved);
    let noted = match noted.map_err(|why| WorkError::Said(why.to_string()))? {
        Noting::Nothing => return Ok(None),
        Noting::Impossible(why) => return Ok(Some(why.to_owned())),
        Noting::Table(noted) => noted,
    };
    let push = match PushTable::new(&noted) {
        Ok(push) => push,
        Err(why) => return Ok(Some(why.to_string())),
    };
    match bench.get(push).await {
        Ok(()) => Ok(None),
        Err(WorkError::Port {
            why: PortError::Link(why @ LinkError::Refused(_)),
            ..
        }) => Ok(Some(why.to_string())),
        Err(why) => Err(why),
    }
}

async fn verify(bench: &Bench, name: &str, wanted: Identify) -> Result<(), WorkError> {
    let status = bench.hello().await?;
    let bytes = bench.table().await?;
    let texture = Table::read(&bytes)?.find(name).ok_or_else(|| {
        WorkError::Said(format!(
            "no texture {name}: choose one that the probe knows"
        ))
    })?;
    let wanted = Identify {
        false_alarm: wanted.false_alarm.or(status.false_alarm),
        ..wanted
    };
    let mut verifying = Verifying::new(&bytes, texture, config_of(&wanted))?;
    let wanted = Identify {
        among: std::iter::once(texture).collect(),
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
    let verified = verifying.end();
    print_answer(&verified, &mut bench.out.clone())?;
    bench.happens(Happening::Verified {
        answer: verified.answer,
        said: words(|out| print_answer(&verified, out)),
    });
    Ok(())
}

async fn record(
    bench: &Bench,
    name: &str,
    slides: u8,
    moved: Option<bool>,
    seed: u32,
) -> Result<(), WorkError> {
    let name = name_of(name)?.to_string();
    let status = bench.hello().await?;
    let calibration = bench.get(Request::read_calibration()).await?;
    bench.get(Request::command(Command::Stream(true))).await?;
    let mut recorder = Recorder::new(calibration.pressure);
    // a slide of each movement, then the sample is moved
    let part = match moved {
        None => Table::read(&bench.table().await?)?.movements().len() as u8,
        Some(_) => slides,
    };
    let (mut lost, mut kept) = (Vec::new(), Vec::new());
    let (mut prompts, mut samples) = (Prompts::default(), Trials::default());
    let mut out = bench.out.clone();
    for (trial, begin) in (0..slides).step_by(part.max(1).into()).enumerate() {
        if trial > 0 {
            samples.said(Some(ask_to_move(bench, &name).await?));
        }
        let wanted = Recorder::wanted(trial, part.min(slides - begin), seed);
        let each = |report: &wire::Report| {
            match recorder.hear(0, report) {
                Some(Ok(slide)) => {
                    let (number, movement) = (slide.number, slide.movement);
                    writeln!(out, "{name}, slide {number} of {slides}: {movement}")?;
                    kept.push((trial, slide));
                }
                Some(Err(why)) => lost.push(why),
                None => prompts.show(report, &mut out)?,
            }
            io::Result::Ok(())
        };
        bench.run(Request::identify(wanted), each).await?;
    }
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
    let labelled = kept.into_iter().map(|(trial, slide)| {
        let labels = Labels {
            finger: status.finger,
            calibrated: status.calibrated,
            moved: moved.or_else(|| samples.before_trial(trial)),
            ..Labels::default()
        };
        (slide, labels)
    });
    let labelled: Vec<_> = labelled.collect();
    let files = files_of(&texture, &labelled)?;
    let files = files
        .into_iter()
        .map(|(name, bytes)| File { name, bytes })
        .collect();
    let folder = plain(&name);
    writeln!(
        out,
        "{folder}: {} of {}. Next: tactus features --recordings {folder}",
        count(labelled.len() as u64, "slide"),
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

/// Says what will be `lost`, keeps the table that the probe uses now, and asks. Nothing has happened to the probe yet.
async fn consent(bench: &Bench, lost: impl FnOnce(&Table<'_>) -> String) -> Result<(), WorkError> {
    let bytes = bench.table().await?;
    let table = Table::read(&bytes)?;
    let backup = format!("table-{:08x}.tact", table.crc());
    let said = format!("{}\nThe probe's table is kept: {backup}", lost(&table));
    bench.keep(backup, bytes.clone());
    confirm(bench, &said, "Go on?").await
}

/// Says something, and asks whether to go on.
async fn confirm(bench: &Bench, said: &str, question: &str) -> Result<(), WorkError> {
    writeln!(bench.out.clone(), "{said}")?;
    let question = Question {
        asked: format!("{said}\n{question}"),
        yes: "Yes",
        no: "No",
    };
    match bench.ask(question).await? {
        Some(true) => Ok(()),
        _ => Err(WorkError::Said("nothing was changed".to_owned())),
    }
}

async fn rename(bench: &Bench, from: &str, to: &str) -> Result<(), WorkError> {
    let (from, to) = (name_of(from)?, name_of(to)?);
    let renamed = Request::rename(from.clone(), to.clone());
    bench.get(renamed).await?;
    bench.table().await?;
    writeln!(bench.out.clone(), "{from} is {to} now.")?;
    Ok(())
}

async fn forget(bench: &Bench, what: Forget) -> Result<(), WorkError> {
    let said = forgotten(&what);
    consent(bench, |_| format!("The probe is to forget {said}.")).await?;
    bench.get(Request::forget(what)).await?;
    bench.table().await?;
    writeln!(bench.out.clone(), "The probe has forgotten {said}.")?;
    Ok(())
}

async fn factory(bench: &Bench) -> Result<(), WorkError> {
    // the firmware's own table is never lost
    if !bench.hello().await?.factory {
        consent(bench, |old| replaced(old, None)).await?;
    }
    bench.get(Request::command(Command::FactoryTable)).await?;
    let now = bench.get(Request::status()).await?;
    bench.table().await?;
    let said = uses_factory(now.textures, &format!("{:08x}", now.table_crc));
    writeln!(bench.out.clone(), "{said}")?;
    Ok(())
}

async fn settings(bench: &Bench) -> Result<(), WorkError> {
    let status = bench.get(Request::status()).await?;
    let bytes = bench.table().await?;
    let of_table = Table::read(&bytes)?.limits();
    let of_table = of_table.map(|limits| limits.false_alarm);
    show_settings(&status, of_table, &mut bench.out.clone())?;
    Ok(())
}

async fn high_force(bench: &Bench, on: bool) -> Result<(), WorkError> {
    if on && !bench.hello().await?.high_force {
        confirm(bench, HIGH_FORCE, YIELDS).await?;
    }
    let set = Command::SetHighForce(on);
    bench.get(Request::command(set)).await?;
    settings(bench).await
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
    // the firmware's own table is never lost
    if !status.factory && status.table_crc != table.crc() {
        consent(bench, |old| replaced(old, Some(&table))).await?;
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
        bench.out.clone(),
        "{file}: the probe uses it now: {textures}, checksum {checksum}"
    )?;
    Ok(())
}
