//! Fit of the fault that a rig names to the injected ones: by the injection, never by the firmware's state.

use std::fmt;

use tactus_core::rig::Fault as Named;

use tactus_world::faults::Fault;

/// Fit of the named faults to the injected ones.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Naming {
    /// No fault was named, and the request was done.
    Unnoticed,
    /// No fault was named, and the request was refused with a reason of its own: slides that were rejected, constants
    /// that are implausible.
    Refused,
    /// Each named fault fits an injected one.
    Right,
    /// The rig stopped, with a name that leads somewhere else.
    Other,
}

impl fmt::Display for Naming {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Unnoticed => "unnoticed",
            Self::Refused => "refused",
            Self::Right => "right",
            Self::Other => "other",
        })
    }
}

/// Fit of these names to the injected faults; `refused` is true if the request was not done.
pub fn judge<'f>(
    broke: impl Iterator<Item = &'f Fault> + Clone,
    named: &[Named],
    refused: bool,
) -> Naming {
    let fits = |name: &Named| broke.clone().any(|fault| right(*fault).contains(name));
    match named {
        [] if refused => Naming::Refused,
        [] => Naming::Unnoticed,
        named if named.iter().all(fits) => Naming::Right,
        _ => Naming::Other,
    }
}

/// The names that fit a fault: their description of the rig is true, and their remedy leads to the cause. Empty if the
/// rig has no name for it.
pub fn right(fault: Fault) -> &'static [Named] {
    match fault {
        Fault::SensorUnplugged | Fault::MisoStuck { .. } => &[Named::SensorSilent],
        Fault::BitFlips { .. } | Fault::WordNoise { .. } => {
            &[Named::SensorErrors, Named::SensorSilent, Named::Rejected]
        }
        Fault::SensorFrozen => &[Named::SensorFrozen],
        Fault::PdcDrift { .. } => &[Named::Unsteady, Named::PressureDead, Named::LeverNotHome],
        Fault::PdcStuck
        | Fault::PdcFades { .. }
        | Fault::PdcWeak { .. }
        | Fault::SkinLeaks { .. } => &[Named::PressureDead, Named::Unsteady],
        Fault::StageJammed | Fault::BridgeOff => {
            &[Named::StageStall, Named::StageOff, Named::StageNotHome]
        }
        Fault::FastDecay => &[Named::StageOff, Named::StageStall],
        Fault::StageVibrates { .. } | Fault::CurrentOffset { .. } | Fault::CurrentSaturated => &[],
        Fault::EncoderCut(_) | Fault::EncoderSwapped => {
            &[Named::EncoderSilent, Named::StageOff, Named::StageNotHome]
        }
        Fault::SupplyDip { .. } => &[
            Named::StageStall,
            Named::StageOff,
            Named::StageNotHome,
            Named::LeverSlips,
            Named::LeverNotHome,
            Named::NoContact,
        ],
        Fault::StageLimitStuck { closed: true, .. } => &[Named::StageLimit, Named::StageNotHome],
        Fault::StageLimitStuck { closed: false, .. } => &[Named::StageNotHome, Named::StageStall],
        Fault::LeverTopStuck { closed: true } => &[Named::LeverLimit, Named::LeverNotHome],
        Fault::LeverTopStuck { closed: false } => &[Named::LeverNotHome],
        Fault::SwitchesBounce { .. } => &[
            Named::LeverLimit,
            Named::LeverNotHome,
            Named::StageLimit,
            Named::StageNotHome,
        ],
        Fault::LeverLosesSteps { .. } => {
            &[Named::LeverSlips, Named::LeverNotHome, Named::NoContact]
        }
        Fault::LeverRunaway | Fault::LeverDirInverted => {
            &[Named::ForceHigh, Named::LeverSlips, Named::LeverNotHome]
        }
        Fault::EStop | Fault::EStopGlitch { .. } => &[Named::EStop],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_fits_what_broke_or_leads_elsewhere() {
        let broke = [Fault::EStop, Fault::SensorUnplugged];
        let judged = |named: &[Named], refused| judge(broke.iter(), named, refused);
        assert_eq!(judged(&[], false), Naming::Unnoticed);
        assert_eq!(judged(&[], true), Naming::Refused);
        let both = [Named::SensorSilent, Named::EStop];
        assert_eq!(judged(&both, true), Naming::Right);
        let one = [Named::EStop, Named::StageStall];
        assert_eq!(judged(&one, true), Naming::Other);
        assert_eq!(judge([].iter(), &[Named::EStop], true), Naming::Other);
    }
}
