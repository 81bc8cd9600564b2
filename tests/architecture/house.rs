//! The rooms of every package, in their order.

use crate::rules::Package;

pub(crate) const PACKAGES: [Package; 7] = [
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
        folder: "host-tools",
        steps: &[
            &["data"],
            &["eval"],
            &["sim"],
            &["live"],
            &["study"],
            &["link"],
            &["bringup"],
            &["remote"],
            &["cmd"],
        ],
        // link and bring-up know the core only
        strangers: &[
            ("link", "data"),
            ("link", "eval"),
            ("link", "sim"),
            ("link", "live"),
            ("link", "study"),
            ("bringup", "data"),
            ("bringup", "eval"),
            ("bringup", "sim"),
            ("bringup", "live"),
            ("bringup", "study"),
        ],
        outside: &["lib", "main"],
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
