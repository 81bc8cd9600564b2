//! Which slides are for training, and which for testing.

/// Division of slides into training and test.
#[derive(Clone, Copy, PartialEq, Eq, Debug, serde::Serialize)]
#[cfg_attr(feature = "arguments", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum Protocol {
    /// Training slides at random from all of a session, tested on the rest: optimistic.
    Interleaved,
    /// Training slides at random from the first 19 of 34 (of another number, the same share), tested on the later ones;
    /// with --test, trained on slide numbers below 30 and tested on those above 34.
    Blocked,
    /// Trained on the first slides of a session, tested on all later ones; with --test, on all of that folder.
    Drift,
    /// Tested on one session after the other, each time with training slides at random from all other sessions.
    LeaveOneSessionOut,
    /// As leave-one-session-out, by runs of the machine: slides of one run share more than slides of one session.
    LeaveOneRunOut,
}

impl Protocol {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::Interleaved,
        Self::Blocked,
        Self::Drift,
        Self::LeaveOneSessionOut,
        Self::LeaveOneRunOut,
    ];

    /// Its name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Interleaved => "interleaved",
            Self::Blocked => "blocked",
            Self::Drift => "drift",
            Self::LeaveOneSessionOut => "leave-one-session-out",
            Self::LeaveOneRunOut => "leave-one-run-out",
        }
    }
}
