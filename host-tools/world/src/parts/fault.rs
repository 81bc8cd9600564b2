//! Faults in the parts of a finger.

/// Something that breaks in a finger of parts.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum PartFault {
    /// The supply of the accelerometer dips: its registers are those of power-up again, its identity too, and it is
    /// off.
    AccelerometerBrownOut,
    /// The supply of the cell's converter dips: its registers are those of power-up again, and it converts no more.
    CellBrownOut,
    /// A signal wire of the cell is broken: the input goes to an end of its range.
    CellWire,
    /// Signal wires of the cell are exchanged: it reads less when it is pressed.
    CellReversed,
    /// The plug of all parts is out.
    Unplugged,
    /// That of the accelerometer is.
    AccelerometerUnplugged,
    /// Something blocks the cell: it reads the same, pressed or not.
    CellBlocked,
    /// The clocks of accelerometer and converter are off by this share.
    ClocksOff {
        /// Of either sign.
        share: f64,
    },
    /// The accelerometer reads this share above the data sheet's scale, and this much at 0.
    AccelerometerOff {
        /// Of either sign.
        share: f64,
        /// In g.
        zero_g: f64,
    },
}
