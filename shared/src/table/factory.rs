//! The tables that come with the firmware: textures of a simulated world, learned there by
//! `cargo xtask campaign factory`. A probe is trained by its user, or receives a table from the host. A table that is
//! not named takes no space in an image.
use crate::sensor::FingerName;

macro_rules! tables {
    ($($(#[$doc:meta])* $name:ident $file:literal;)*) => {
        $($(#[$doc])* pub const $name: &[u8] = include_bytes!(concat!("../../tables/", $file));)*

        /// Every one of them with the name of its file.
        pub const ALL: &[(&str, &[u8])] = &[$(($file, $name)),*];
    };
}

tables! {
    /// The rig's with a BioTac: 117 textures at three movements.
    RIG "factory.tact";
    /// The rig's with the finger `analog`.
    RIG_ANALOG "factory-analog.tact";
    /// The rig's with the finger `mems`.
    RIG_MEMS "factory-mems.tact";
    /// The handheld's with a BioTac. Its whitening says how slides of one texture by hand differ.
    HANDHELD "handheld.tact";
    /// The handheld's with the finger `analog`.
    HANDHELD_ANALOG "handheld-analog.tact";
    /// The handheld's with the finger `mems`.
    HANDHELD_MEMS "handheld-mems.tact";
    /// That of a BioTac on somebody else's arm, which need not know the shear: band powers only.
    ARM "arm.tact";
}

/// The rig's table of a finger.
pub const fn rig(finger: FingerName) -> &'static [u8] {
    match finger {
        FingerName::Biotac => RIG,
        FingerName::Analog => RIG_ANALOG,
        FingerName::Mems => RIG_MEMS,
    }
}

/// The table of a finger on somebody else's arm. Only a BioTac has one of its own; the rig's of the others names the
/// finger and the movements, and knows the shear, which an arm's slides do not have: such a probe is trained, or
/// receives a table.
pub const fn arm(finger: FingerName) -> &'static [u8] {
    match finger {
        FingerName::Biotac => ARM,
        FingerName::Analog | FingerName::Mems => rig(finger),
    }
}

/// The handheld's table of a finger.
pub const fn handheld(finger: FingerName) -> &'static [u8] {
    match finger {
        FingerName::Biotac => HANDHELD,
        FingerName::Analog => HANDHELD_ANALOG,
        FingerName::Mems => HANDHELD_MEMS,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::FingerCode;
    use crate::table::Table;

    #[test]
    fn each_is_of_its_finger() {
        for finger in FingerName::ALL {
            // a hand with a BioTac has no slides of one of them that count
            let by_hand = 117 - u16::from(finger == FingerName::Biotac);
            for (table, textures) in [(rig(finger), 117), (handheld(finger), by_hand)] {
                let table = Table::read(table).unwrap();
                assert_eq!(table.textures(), textures);
                assert_eq!(table.finger(), FingerCode::of(finger));
            }
        }
        for (file, table) in ALL {
            assert!(Table::read(table).is_ok(), "{file}");
        }
    }
}
