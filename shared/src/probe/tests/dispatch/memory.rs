//! Tables, textures and calibrations that a host has kept.

use super::*;

#[test]
fn textures_are_trained_renamed_and_deleted() {
    let mut probe = probe();
    feels(&mut probe, &[31_000]);
    let [.., train] = &mut all()[..6] else {
        panic!();
    };
    command(&mut probe, train.clone()).unwrap();
    assert_eq!(probe.rig.began, [3]);
    assert_eq!(probe.events.tables.last().unwrap().textures, 5);
    let skin = block_on(probe.memory.store().unwrap().skin()).unwrap();
    assert!(skin.energy_j() >= 1.0);
    let rename = |from, to| Command::Rename {
        from: name(from),
        to: name(to),
    };
    command(&mut probe, rename("elm", "oak")).unwrap();
    assert!(probe.memory.table().unwrap().find("oak").is_some());
    let unknown = command(&mut probe, rename("elm", "ash")).unwrap_err();
    assert_eq!(unknown, "there is no texture elm in the table");
    command(&mut probe, Command::Forget(Forget::Texture(name("oak")))).unwrap();
    assert_eq!(probe.events.tables.last().unwrap().textures, 4);
    assert!(command(&mut probe, Command::Forget(Forget::Texture(name("oak")))).is_err());
    command(&mut probe, Command::FactoryTable).unwrap();
    assert!(probe.events.tables.last().unwrap().factory);
}

#[test]
fn a_calibration_is_measured_reported_used_and_kept() {
    let mut probe = probe();
    command(&mut probe, Command::Calibrate).unwrap();
    assert_eq!(probe.rig.homed, 1, "it did not know where it was");
    let used = probe.rig.state.calibration;
    let (standstill, per_mm_s) = used.unloaded_a;
    assert!((standstill - 0.05).abs() < 1e-4 && (per_mm_s - 1e-3).abs() < 1e-5);
    assert_eq!(used.pressure.pdc_no_contact, 700.0);
    let told = Event::Calibration(used.to_bytes());
    assert_eq!(probe.events.told, [told]);
    let kept = |probe: &mut Tested| block_on(probe.memory.store().unwrap().calibration()).unwrap();
    assert_eq!(kept(&mut probe), Some(used));
    let write = |bytes: &[u8]| Command::WriteCalibration(Vec::from_slice(bytes).unwrap());
    let short = command(&mut probe, write(&[0; 59])).unwrap_err();
    assert_eq!(short, "a calibration has 64 bytes");
    assert!(command(&mut probe, write(&[0xFF; 64])).is_err());
    assert_eq!(
        (kept(&mut probe), probe.rig.state.calibration),
        (Some(used), used)
    );
    command(&mut probe, write(&CALIBRATION.to_bytes())).unwrap();
    assert_eq!(kept(&mut probe), Some(CALIBRATION));
    // the next life begins with it
    let skin = SkinCare::after(2.0, 1.0);
    let store = probe.memory.store().unwrap();
    block_on(store.set_skin(&skin)).unwrap();
    let mut fresh = self::probe();
    fresh.rig.state.calibration = used;
    block_on(restore(store, &mut fresh.rig)).unwrap();
    assert_eq!(
        (fresh.rig.state.calibration, fresh.rig.state.skin),
        (CALIBRATION, skin)
    );
}

#[test]
fn a_high_force_holds_only_where_it_is_kept() {
    let mut probe = probe();
    for allow in [true, false, true] {
        command(&mut probe, Command::SetHighForce(allow)).unwrap();
        assert_eq!(probe.rig.state.high_force, allow);
    }
    // after a reset
    let mut fresh = self::probe();
    let store = probe.memory.store().unwrap();
    block_on(restore(store, &mut fresh.rig)).unwrap();
    assert!(fresh.rig.state.high_force);
    // erased with the other settings
    block_on(store.erase_settings()).unwrap();
    let mut fresh = self::probe();
    block_on(restore(store, &mut fresh.rig)).unwrap();
    assert!(!fresh.rig.state.high_force);
    let mut broken = probe_with(fused_table(), None);
    assert!(command(&mut broken, Command::SetHighForce(true)).is_err());
    assert!(!broken.rig.state.high_force);
}

/// Sends a table in parts, each twice.
#[test]
fn a_table_comes_and_goes_in_parts_of_which_one_may_come_twice() {
    let mut probe = probe();
    let pushed = table();
    push(&mut probe, &pushed).unwrap();
    let in_use = *probe.events.tables.last().unwrap();
    assert_eq!(
        (in_use.textures, in_use.bytes, in_use.factory),
        (3, pushed.len() as u32, false)
    );
    let pull = |probe: &mut Tested| {
        probe.events.told.clear();
        let length = probe.memory.in_force().len() as u32;
        for offset in (0..length).step_by(PART) {
            command(probe, Command::ReadTable(offset)).unwrap();
        }
        let mut pulled = vec::Vec::new();
        for told in &probe.events.told {
            let Event::TablePart {
                offset,
                length: all,
                bytes,
            } = told
            else {
                panic!("{told:?}");
            };
            assert_eq!((*offset as usize, *all), (pulled.len(), length));
            pulled.extend_from_slice(bytes);
        }
        pulled
    };
    assert_eq!(pull(&mut probe), pushed);
    let length = pushed.len() as u32;
    command(&mut probe, Command::ReadTable(length)).unwrap();
    let beyond = command(&mut probe, Command::ReadTable(length + 1)).unwrap_err();
    assert_eq!(beyond, "the table has no such byte");
    // a part that is missing is an error, and so is a table that is damaged: the former one stays
    command(&mut probe, Command::BeginTable(600)).unwrap();
    let early = Command::WriteTable {
        offset: 8,
        bytes: Vec::from_slice(&[0; 8]).unwrap(),
    };
    assert!(
        command(&mut probe, early)
            .unwrap_err()
            .contains("send the table anew")
    );
    let mut damaged = fused_table();
    damaged[40] ^= 1;
    assert!(push(&mut probe, &damaged).unwrap_err().contains("checksum"));
    assert_eq!(pull(&mut probe), pushed);
    command(&mut probe, Command::FactoryTable).unwrap();
    assert_eq!(pull(&mut probe), fused_table());
}
