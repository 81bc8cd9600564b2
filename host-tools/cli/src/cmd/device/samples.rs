//! What a person says of the sample between the trials of a training or a recording.

use std::io::IsTerminal as _;

use tactus_link::operations;

/// A person's statement about the sample.
#[derive(clap::Args, Clone, Copy, Debug)]
pub(crate) struct Sample {
    /// Note that the sample was moved or turned from slide to slide, and do not ask for it
    #[arg(long, conflicts_with = "same_spot")]
    moved: bool,
    /// Note that the sample stayed where it was, and do not ask to move it
    #[arg(long)]
    same_spot: bool,
}

impl Sample {
    /// The statement of the command line.
    pub(crate) fn said(self) -> Option<bool> {
        (self.moved || self.same_spot).then_some(self.moved)
    }

    /// The same, or that whoever sits at the terminal is asked between trials.
    pub(crate) fn known(self) -> operations::Sample {
        match self.said() {
            None if std::io::stdin().is_terminal() => operations::Sample::Asked,
            said => operations::Sample::Noted(said),
        }
    }
}
