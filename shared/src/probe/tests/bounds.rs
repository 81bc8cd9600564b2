//! What a host may do to the flash, and a stored table that resets the probe.

use super::dispatch::{command, probe, push};
use crate::wire::{Command, Event, Failure, MemoryError};
use embassy_futures::block_on;
use std::string::ToString;

#[test]
fn a_host_erases_at_most_a_sector_a_second_after_the_tenth() {
    let mut probe = probe();
    let table = super::fused_table();
    let mut now_ms = u32::MAX - 30_000;
    let (mut erased_ms, mut refused) = (std::vec::Vec::new(), 0);
    let from_ms = now_ms;
    // as fast as the line takes it, for a minute and over the end of the clock
    while now_ms.wrapping_sub(from_ms) < 60_000 {
        probe.memory.at(now_ms);
        match push(&mut probe, &table) {
            Ok(()) => erased_ms.push(now_ms.wrapping_sub(from_ms)),
            Err(why) => {
                assert!(why.contains("ask again in a second"), "{why}");
                refused += 1;
            }
        }
        assert_eq!(probe.events.erased as usize, erased_ms.len());
        now_ms = now_ms.wrapping_add(50);
    }
    assert!(refused > 500);
    assert!((60..=71).contains(&erased_ms.len()), "{erased_ms:?}");
    assert!(erased_ms[9] < 1000, "ten are free");
    assert!(erased_ms[9..].windows(2).all(|two| two[1] - two[0] >= 1000));
    // what erases nothing is never refused
    for name in ["t0", "none"] {
        let renamed = Command::Rename {
            from: super::dispatch::name(name),
            to: super::dispatch::name("other"),
        };
        let _ = command(&mut probe, renamed);
    }
    assert_eq!(command(&mut probe, Command::Home), Ok(()));
}

#[test]
fn a_stored_table_that_reset_the_probe_is_not_read_again() {
    let mut probe = probe();
    let table = super::fused_table();
    push(&mut probe, &table).unwrap();
    assert!(!probe.events.tables.last().unwrap().factory);
    probe.events.told.clear();
    probe.memory.distrust();
    block_on(probe.memory.reload(&mut probe.events));
    let told = Event::Trouble(Failure::Memory(MemoryError::Unread));
    assert_eq!(probe.events.told, [told]);
    assert!(probe.events.tables.last().unwrap().factory);
    assert!(MemoryError::Unread.to_string().contains("push a table"));
    // the next one is read
    push(&mut probe, &table).unwrap();
    assert!(!probe.events.tables.last().unwrap().factory);
    assert_eq!(probe.memory.trouble(), None);
    // and the firmware's is no trouble
    probe.memory.distrust();
    command(&mut probe, Command::FactoryTable).unwrap();
    assert_eq!(probe.memory.trouble(), None);
}
