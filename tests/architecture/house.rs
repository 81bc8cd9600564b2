//! The rooms of every package, in their order.

use super::rules::Package;

pub(crate) const PACKAGES: [Package; 11] = [
    Package {
        folder: "shared",
        steps: &[
            &["sensor"],
            &["dsp"],
            &["features"],
            &["table"],
            &["explorer"],
            &["rig"],
            &["store"],
            &["wire"],
            &["probe"],
            &["handheld"],
        ],
        strangers: &[("explorer", "rig")],
        outside: &["lib"],
    },
    Package {
        folder: "host-tools/link",
        steps: &[],
        strangers: &[],
        outside: &[],
    },
    Package {
        folder: "host-tools/world",
        steps: &[],
        strangers: &[],
        outside: &[],
    },
    Package {
        folder: "host-tools/lab",
        steps: &[&["data"], &["eval"], &["sim"], &["live"], &["remote"]],
        strangers: &[],
        outside: &["lib"],
    },
    Package {
        folder: "host-tools/study",
        steps: &[],
        strangers: &[],
        outside: &[],
    },
    Package {
        folder: "host-tools/cli",
        steps: &[],
        strangers: &[],
        outside: &[],
    },
    Package {
        folder: "firmware",
        // an image knows no other image
        steps: &[
            &["board"],
            &["chip"],
            &["tasks"],
            &["bench", "selftest", "handheld", "rig", "arm"],
        ],
        strangers: &[],
        outside: &["lib", "bin"],
    },
    Package {
        folder: "host-tools/emulator",
        steps: &[&["board"], &["host"], &["scenario"], &["runs"]],
        strangers: &[],
        outside: &["lib", "main"],
    },
    Package {
        folder: "host-tools/page",
        steps: &[],
        strangers: &[],
        outside: &[],
    },
    Package {
        folder: "host-tools/python",
        steps: &[],
        strangers: &[],
        outside: &[],
    },
    Package {
        folder: "host-tools/xtask",
        steps: &[],
        strangers: &[],
        outside: &[],
    },
];
