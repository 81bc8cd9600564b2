//! Sampling commands, their timing, and the order in which channels are sampled.

use super::word::with_parity;
use crate::sensor::pressure;
use crate::sensor::slot::Transaction;

/// Shortest time between a command and the read of its answer, us (SPM 8.3.1.1). Earlier, the answer is an error frame.
pub const GAP_US: u32 = 50;
/// Time left after a read, us: 10 in HDR and MM; SPM fig. 14 has 5.
pub const REST_US: u32 = 10;
/// The bytes on MOSI while a sample is read (SPM).
pub const READ_MOSI: [u8; 2] = [0x00, 0x01];

/// The bytes of the commands, by channel number. The second byte is ignored (SPM); 0 as in LIB.
#[allow(clippy::indexing_slicing)] // while compiling
const COMMANDS: &[[u8; 2]; Channel::E19 as usize + 1] = &{
    let mut all = [[0x00; 2]; Channel::E19 as usize + 1];
    let mut number = 0;
    while number < all.len() {
        all[number] = [command(number as u8), 0x00];
        number += 1;
    }
    all
};

/// 0x80, the channel number, and odd parity in the lowest bit.
const fn command(number: u8) -> u8 {
    with_parity(0x40 | number, 1)
}

/// A channel of the sensor. The discriminant is the channel number of SPM table 7 and HDR.
///
/// There is no channel 16: its command, 0xA1, starts a streaming mode that is only left by 5 s without clock.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
#[repr(u8)]
#[allow(missing_docs)] // nineteen electrodes have no more to say than their numbers
pub enum Channel {
    /// Dynamic pressure.
    Pac = 0,
    /// Static pressure.
    Pdc = 1,
    /// Dynamic temperature.
    Tac = 2,
    /// Static temperature.
    Tdc = 3,
    /// Hall sensor.
    Hall = 15,
    E1 = 17,
    E2,
    E3,
    E4,
    E5,
    E6,
    E7,
    E8,
    E9,
    E10,
    E11,
    E12,
    E13,
    E14,
    E15,
    E16,
    E17,
    E18,
    E19,
}

impl Channel {
    /// All channels by number.
    #[rustfmt::skip]
    pub const ALL: [Self; 24] = {
        use Channel::*;
        [
            Pac, Pdc, Tac, Tdc, Hall,
            E1, E2, E3, E4, E5, E6, E7, E8, E9, E10, E11, E12, E13, E14, E15, E16, E17, E18, E19,
        ]
    };

    /// The command that samples this channel: 0x80, the channel number, and odd parity in the lowest bit.
    pub const fn command(self) -> u8 {
        command(self as u8)
    }

    /// The channel that a command samples, for a simulated sensor; `None` if it is no sampling command.
    pub fn from_command(command: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|c| c.command() == command)
    }

    /// The transactions for a sample of this channel: the command and, 50 us later, the read.
    #[allow(clippy::indexing_slicing)] // the last channel is the last command
    pub const fn transactions(self) -> [Transaction; 2] {
        [
            Transaction::first_port(&COMMANDS[self as usize], 0, GAP_US),
            Transaction::first_port(&READ_MOSI, READ_MOSI.len() as u8, REST_US),
        ]
    }
}

impl From<pressure::Channel> for Channel {
    fn from(channel: pressure::Channel) -> Self {
        match channel {
            pressure::Channel::Pac => Self::Pac,
            pressure::Channel::Pdc => Self::Pdc,
        }
    }
}

/// Both pressures in turn, each at half of the slot rate: 2200 Hz at 4400 slots a second (SPM 9.2.3).
pub const PRESSURE_SLOTS: [Channel; 2] = [Channel::Pac, Channel::Pdc];

/// The pattern of the maker's PC library, 44 slots: E1 to E19, PDC, TAC, TDC, each followed by PAC. At 4400 slots a
/// second PAC comes at 2200 Hz and every other channel at 100 Hz. The Hall channel is not in it.
///
/// Order from HDR, `BT_FRAME_STRUCTURE_DEFAULT` (the BioTac SP's header has the same with E20 to E24 after E19).
#[rustfmt::skip]
pub const FULL_FRAME: [Channel; 44] = {
    use Channel::*;
    [
        E1, Pac, E2, Pac, E3, Pac, E4, Pac, E5, Pac, E6, Pac, E7, Pac, E8, Pac, E9, Pac, E10, Pac,
        E11, Pac, E12, Pac, E13, Pac, E14, Pac, E15, Pac, E16, Pac, E17, Pac, E18, Pac, E19, Pac,
        Pdc, Pac, Tac, Pac, Tdc, Pac,
    ]
};

#[cfg(test)]
mod tests {
    use super::*;

    /// SPM table 7 and HDR, written out.
    const COMMANDS: [u8; 24] = [
        0x80, 0x83, 0x85, 0x86, 0x9E, 0xA2, 0xA4, 0xA7, 0xA8, 0xAB, 0xAD, 0xAE, 0xB0, 0xB3, 0xB5,
        0xB6, 0xB9, 0xBA, 0xBC, 0xBF, 0xC1, 0xC2, 0xC4, 0xC7,
    ];

    #[test]
    fn every_command_is_the_one_in_the_makers_table() {
        for (channel, command) in Channel::ALL.into_iter().zip(COMMANDS) {
            assert_eq!(channel.command(), command, "{channel:?}");
            assert_eq!(channel.command().count_ones() % 2, 1, "{channel:?}");
        }
    }

    #[test]
    fn only_the_commands_in_the_table_are_channels_and_streaming_is_none() {
        for command in 0..=255 {
            let expected = COMMANDS.iter().position(|c| *c == command);
            assert_eq!(
                Channel::from_command(command),
                expected.map(|i| Channel::ALL[i])
            );
        }
        assert_eq!(Channel::from_command(0xA1), None);
    }

    #[test]
    fn pressures_take_turns() {
        let slots = PRESSURE_SLOTS.map(Channel::command);
        assert_eq!(slots, [0x80, 0x83]);
        let shared = pressure::Channel::PATTERN.map(Channel::from);
        assert_eq!(shared, PRESSURE_SLOTS);
        let by_slot = [0, 1, 2, u32::MAX].map(pressure::Channel::of_slot);
        let [pac, pdc] = pressure::Channel::PATTERN;
        assert_eq!(by_slot, [pac, pdc, pac, pdc]);
        assert_eq!(
            pressure::SLOTS_HZ / PRESSURE_SLOTS.len() as u32,
            pressure::RATE_HZ
        );
    }

    #[test]
    fn the_full_frame_is_the_makers_44_slots() {
        // the commands of HDR's BT_FRAME_STRUCTURE_DEFAULT without the PACs between them
        const OTHERS: [u8; 22] = [
            0xA2, 0xA4, 0xA7, 0xA8, 0xAB, 0xAD, 0xAE, 0xB0, 0xB3, 0xB5, 0xB6, 0xB9, 0xBA, 0xBC,
            0xBF, 0xC1, 0xC2, 0xC4, 0xC7, 0x83, 0x85, 0x86,
        ];
        let commands = FULL_FRAME.map(Channel::command);
        for (slot, command) in commands.into_iter().enumerate() {
            let expected = if slot % 2 == 1 {
                0x80
            } else {
                OTHERS[slot / 2]
            };
            assert_eq!(command, expected, "slot {slot}");
        }
        let pdc = FULL_FRAME.iter().filter(|c| **c == Channel::Pdc).count() as u32;
        assert_eq!(pressure::SLOTS_HZ * pdc / 44, 100);
    }

    #[test]
    fn a_sample_is_a_command_a_gap_of_50_us_a_read_of_0001_and_a_rest() {
        for (channel, command) in Channel::ALL.into_iter().zip(COMMANDS) {
            let [sent, read] = channel.transactions();
            assert_eq!(
                (sent.out, sent.answer, sent.gap_us),
                (&[command, 0x00][..], 0, 50)
            );
            assert_eq!(
                (read.out, read.answer, read.gap_us),
                (&[0x00, 0x01][..], 2, 10)
            );
            assert_eq!((sent.port, read.port), (0, 0));
        }
    }
}
