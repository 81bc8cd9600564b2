//! The operations that a page asks for.

use std::cell::RefCell;
use std::io::Write as _;

use tactus_core::table::{Name, Table};
use tactus_core::wire::{Forget, Identify};

use super::message::{File, Folder, Work};
use super::operations::{self as here, Wanted};
use crate::data::recording::{Labels, Texture};
use crate::data::recordings::files_of;
use crate::eval::show::count;
use tactus_link::operations;
use tactus_link::{OperationError, Probe, say};

type Result<T> = std::result::Result<T, OperationError>;

#[derive(Default)]
pub(super) struct Kept {
    pub(super) files: Vec<File>,
    pub(super) folders: Vec<Folder>,
}

fn name_of(name: &str) -> Result<Name> {
    say::name_of(name).map_err(OperationError::said)
}

/// Does what is asked for; then the page knows the table in use.
pub(super) async fn work(probe: &Probe, work: Work, kept: &RefCell<Kept>) -> Result<()> {
    match work {
        Work::Status => {
            operations::status(probe).await?;
        }
        Work::Home => operations::home(probe).await?,
        Work::Identify {
            threshold,
            false_alarm,
            max_slides,
            seed,
        } => {
            let status = probe.hello().await?;
            let wanted = Identify {
                threshold,
                max_slides,
                seed,
                // told, so that a log says what was decided by
                false_alarm: false_alarm.or(status.false_alarm),
                ..Identify::default()
            };
            here::identify(probe, wanted, |_| ()).await?;
        }
        Work::Teach { name } => {
            here::teach(probe, &name).await?;
        }
        Work::Train(training) => {
            here::train(probe, &training).await?;
        }
        Work::Verify {
            name,
            threshold,
            max_slides,
            seed,
        } => {
            let status = probe.hello().await?;
            let texture = Table::read(&probe.table().await?)?.find(&name);
            let texture = texture.ok_or_else(|| {
                OperationError::said(format!(
                    "no texture {name}: choose one that the probe knows"
                ))
            })?;
            let wanted = Identify {
                threshold,
                max_slides,
                seed,
                false_alarm: status.false_alarm,
                ..Identify::default()
            };
            here::verify(probe, texture, wanted).await?;
        }
        Work::Record(wanted) => record(probe, &wanted, kept).await?,
        Work::Rename { from, to } => operations::rename(probe, &from, &to).await?,
        Work::Forget { name } => {
            operations::forget(probe, Forget::Texture(name_of(&name)?)).await?;
        }
        Work::ForgetTraining { name } => {
            operations::forget(probe, Forget::Training(name_of(&name)?)).await?;
        }
        Work::ForgetSelfLearned => operations::forget(probe, Forget::SelfLearned).await?,
        Work::Factory => {
            operations::factory(probe).await?;
        }
        Work::Settings => {
            operations::settings(probe).await?;
        }
        Work::FalseAlarm { share } => {
            operations::set_false_alarm(probe, share).await?;
            operations::settings(probe).await?;
        }
        Work::HighForce { on } => {
            operations::set_high_force(probe, on).await?;
            operations::settings(probe).await?;
        }
        Work::Pull => pull(probe, kept).await?,
        Work::Push { file, bytes } => {
            operations::push(probe, &file, &bytes).await?;
        }
    }
    probe.table().await?;
    Ok(())
}

async fn record(probe: &Probe, wanted: &Wanted, kept: &RefCell<Kept>) -> Result<()> {
    let recorded = here::record(probe, wanted).await?;
    let texture = Texture {
        id: 1,
        name: wanted.name.trim().to_owned(),
    };
    let labelled = recorded.labelled(&Labels::default());
    let files = files_of(&texture, &labelled).map_err(OperationError::said)?;
    let files = files.into_iter().map(|(name, bytes)| File { name, bytes });
    let plain = |c: char| if c.is_alphanumeric() { c } else { '-' };
    // a name that a folder can have everywhere
    let folder: String = wanted.name.to_lowercase().chars().map(plain).collect();
    writeln!(
        probe.words(),
        "{folder}: {} of {}. Next: tactus features --recordings {folder}",
        count(labelled.len() as u64, "slide"),
        count(1_u8, "texture")
    )?;
    kept.borrow_mut().folders.push(Folder {
        name: folder,
        files: files.collect(),
    });
    Ok(())
}

async fn pull(probe: &Probe, kept: &RefCell<Kept>) -> Result<()> {
    let bytes = probe.table().await?;
    let table = Table::read(&bytes)?;
    let (textures, length, crc) = (count(table.textures(), "texture"), bytes.len(), table.crc());
    let name = format!("table-{crc:08x}.tact");
    writeln!(
        probe.words(),
        "{name}: {textures}, {length} bytes, checksum {crc:08x}"
    )?;
    let bytes = bytes.to_vec();
    kept.borrow_mut().files.push(File { name, bytes });
    Ok(())
}
