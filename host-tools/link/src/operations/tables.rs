//! What a probe keeps: its table, the names in it, and its settings. Before something is lost, the table is kept in a
//! file and somebody
//! is asked.

use std::io::Write as _;

use serde::Serialize;
use tactus_core::table::Table;
use tactus_core::wire::{Command, Forget, Status};

use super::{Result, name_of};
use crate::person::{Backup, Question, QuestionKind};
use crate::request::Request;
use crate::say;
use crate::session::LinkError;
use crate::table::{PushTable, for_probe};
use crate::{OperationError, Probe};

/// Asks whether to go on, after this was said.
async fn confirm(probe: &Probe, said: String, asked: &str) -> Result<()> {
    let question = Question {
        said,
        asked: asked.to_owned(),
        kind: QuestionKind::Consent,
    };
    match probe.ask(question).await? {
        true => Ok(()),
        false => Err(OperationError::said("nothing was changed")),
    }
}

/// Says what will be lost, keeps the table that the probe uses now, and asks. Nothing has happened to the probe yet.
async fn consent(probe: &Probe, lost: impl FnOnce(&Table<'_>) -> String) -> Result<()> {
    let bytes = probe.table().await?;
    let table = Table::read(&bytes)?;
    // what `push` would not take brings nothing back
    PushTable::new(&bytes)?;
    let backup = Backup {
        // one file for one table, however often it is kept
        name: format!("table-{:08x}.tact", table.crc()),
        bytes: bytes.to_vec(),
    };
    let lost = lost(&table);
    let kept = probe.keep(backup).await?;
    let said = format!("{lost}\nThe probe's table is kept: {kept}");
    confirm(probe, said, "Go on?").await
}

/// Gives a texture another name.
pub async fn rename(probe: &Probe, from: &str, to: &str) -> Result<()> {
    let (from, to) = (name_of(from)?, name_of(to)?);
    probe.get(Request::rename(from.clone(), to.clone())).await?;
    writeln!(probe.words(), "{from} is {to} now.")?;
    Ok(())
}

/// Has the probe forget something, with somebody's consent.
pub async fn forget(probe: &Probe, what: Forget) -> Result<()> {
    let said = say::forgotten(&what);
    consent(probe, |_| format!("The probe is to forget {said}.")).await?;
    probe.get(Request::forget(what)).await?;
    writeln!(probe.words(), "The probe has forgotten {said}.")?;
    Ok(())
}

/// Goes back to the table that came with the firmware, with somebody's consent; the status then.
pub async fn factory(probe: &Probe) -> Result<Status> {
    // the firmware's own table is never lost
    if !probe.hello().await?.factory {
        consent(probe, |old| say::replaced(old, None)).await?;
    }
    probe.get(Request::command(Command::FactoryTable)).await?;
    let now = probe.get(Request::status()).await?;
    writeln!(probe.words(), "{}", say::uses_factory(&now))?;
    Ok(now)
}

/// Gives the probe the table of a file, with somebody's consent where another one is lost; the status then.
pub async fn push(probe: &Probe, file: &str, bytes: &[u8]) -> Result<Status> {
    let of_file = |source| OperationError::File {
        file: file.to_owned(),
        source,
    };
    let table = Table::read(bytes).map_err(|why| of_file(why.into()))?;
    let bytes = for_probe(&table);
    let table = Table::read(&bytes).map_err(|why| of_file(why.into()))?;
    PushTable::new(&bytes).map_err(of_file)?;
    let status = probe.hello().await?;
    table
        .of_finger(status.finger)
        .map_err(|why| of_file(LinkError::Table(why)))?;
    // the firmware's own table is never lost
    if !status.factory && status.table_crc != table.crc() {
        consent(probe, |old| say::replaced(old, Some(&table))).await?;
    }
    let now = use_table(probe, table, "push it again").await?;
    let (textures, crc) = (say::count(now.textures, "texture"), now.table_crc);
    writeln!(
        probe.words(),
        "{file}: the probe uses it now: {textures}, checksum {crc:08x}"
    )?;
    Ok(now)
}

/// Gives the probe another table instead of the one that it was made from, with somebody's consent; the status then.
pub async fn replace_table(probe: &Probe, bytes: &[u8], lost: &str, again: &str) -> Result<Status> {
    let bytes = for_probe(&Table::read(bytes)?);
    consent(probe, |_| lost.to_owned()).await?;
    let now = use_table(probe, Table::read(&bytes)?, again).await?;
    let crc = now.table_crc;
    writeln!(probe.words(), "The probe uses it now: checksum {crc:08x}")?;
    Ok(now)
}

/// Has the probe use a table; what it says it uses then counts, and not what was sent.
async fn use_table(probe: &Probe, table: Table<'_>, again: &str) -> Result<Status> {
    probe.get(PushTable::new(table.as_bytes())?).await?;
    let now = probe.get(Request::status()).await?;
    let (uses, pushed) = (now.table_crc, table.crc());
    if uses != pushed {
        return Err(OperationError::said(format!(
            "the probe uses the table {uses:08x} and not {pushed:08x}, the one pushed: {again}"
        )));
    }
    Ok(now)
}

/// Settings that a probe keeps besides its table and its calibration.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct Settings {
    /// Share of false alarms that was set; `None`: the table's own holds.
    pub false_alarm: Option<f32>,
    /// The share that the table in use was learned for; `None`: it has no limits.
    pub table_false_alarm: Option<f32>,
    /// Movements may press with up to 2 N.
    pub high_force: bool,
}

/// Shows the probe's settings.
pub async fn settings(probe: &Probe) -> Result<Settings> {
    let status = probe.get(Request::status()).await?;
    let limits = Table::read(&probe.table().await?)?.limits();
    let settings = Settings {
        false_alarm: status.false_alarm,
        table_false_alarm: limits.map(|limits| limits.false_alarm),
        high_force: status.high_force,
    };
    say::show_settings(&settings, &mut probe.words())?;
    Ok(settings)
}

/// Sets for which share of false alarms the probe's limits are; `None`: that of its table.
pub async fn set_false_alarm(probe: &Probe, share: Option<f32>) -> Result<()> {
    let set = Command::SetFalseAlarm(share);
    probe.get(Request::command(set)).await
}

/// Sets whether movements may press with up to 2 N, with the consent of somebody who knows mount and stop; a person
/// presses the board's button where there is one.
pub async fn set_high_force(probe: &Probe, on: bool) -> Result<()> {
    if on && !probe.hello().await?.high_force {
        confirm(probe, say::HIGH_FORCE.to_owned(), say::YIELDS).await?;
    }
    let set = Command::SetHighForce(on);
    probe.perform(Request::command(set)).await
}
