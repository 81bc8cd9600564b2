//! Median parameters of the textures: of each group, and of single textures about which the paper or the name tells
//! more.
//!
//! All are chosen. Heights are rms in um, lengths in mm.

use super::names::{Group, Named};

/// Medians of a group or of a texture.
#[derive(Clone, Copy)]
pub(super) struct Recipe {
    pub(super) friction: f64,
    /// Height and wavelength of the finest asperities.
    pub(super) fine: (f64, f64),
    /// Centre of the spectrum of those asperities' impulses, Hz.
    pub(super) impulse_hz: f64,
    /// Height and longest wavelength of the relief.
    pub(super) relief: (f64, f64),
    /// Exponent of the relief's power spectrum.
    pub(super) relief_exponent: f64,
    /// Height and period of the weave; none if 0.
    pub(super) weave: (f64, f64),
    /// The weave is moulded, machined or extruded, and so exact.
    pub(super) grating: bool,
    pub(super) friction_noise: f64,
    /// Deviation of ln(local amplitude).
    pub(super) heterogeneity: f64,
    /// Share of the vibrations swallowed.
    pub(super) damping: f64,
    pub(super) thickness_mm: f64,
    pub(super) compliance_mm_per_n: f64,
}

/// The group's medians.
#[rustfmt::skip]
fn of(group: Group) -> Recipe {
    use Group::*;
    //   friction, fine um, mm, Hz, relief um, mm, weave um, mm, friction noise, heterogeneity, damping, thickness,
    //   compliance
    let (
        friction, fine, impulse_hz, relief, weave, friction_noise, heterogeneity, damping, thickness_mm,
        compliance_mm_per_n,
    ) =
        match group {
            Paper       => (0.55, (2.0, 0.06),  900.0, ( 4.0, 1.0), ( 0.0, 1.0), 0.0040, 0.06, 0.0,  0.3, 0.02),
            Art         => (0.50, (4.0, 0.08),  500.0, (20.0, 1.5), ( 0.0, 1.0), 0.0053, 0.10, 0.1,  2.0, 0.20),
            Glass       => (1.00, (0.1, 0.05), 1200.0, ( 0.5, 2.0), ( 0.0, 1.0), 0.0033, 0.05, 0.0,  4.0, 0.00),
            Foam        => (0.95, (3.0, 0.10),  300.0, (60.0, 1.2), ( 0.0, 1.0), 0.0067, 0.08, 0.2, 10.0, 0.80),
            Tile        => (0.75, (0.6, 0.05), 1000.0, ( 3.0, 2.0), ( 0.0, 1.0), 0.0040, 0.06, 0.0,  6.0, 0.00),
            Wood        => (0.50, (2.0, 0.06),  900.0, ( 8.0, 1.0), ( 0.0, 1.0), 0.0053, 0.12, 0.0,  5.0, 0.01),
            Engineering => (0.60, (0.6, 0.05), 1000.0, ( 2.0, 1.0), ( 0.0, 1.0), 0.0040, 0.05, 0.0,  4.0, 0.00),
            Rubber      => (1.15, (0.4, 0.05),  300.0, ( 1.5, 1.0), ( 0.0, 1.0), 0.0040, 0.05, 0.0,  3.0, 0.10),
            Vinyl       => (0.85, (0.8, 0.06),  400.0, ( 8.0, 1.0), ( 0.0, 1.0), 0.0047, 0.07, 0.0,  1.0, 0.05),
            Leather     => (0.65, (2.0, 0.08),  450.0, (12.0, 0.8), ( 0.0, 1.0), 0.0053, 0.12, 0.1,  1.5, 0.10),
            Cotton      => (0.45, (3.0, 0.06), 1000.0, ( 8.0, 0.8), (10.0, 0.30), 0.0053, 0.07, 0.1, 0.4, 0.05),
            Fabric      => (0.50, (4.0, 0.07),  900.0, (12.0, 0.8), (12.0, 0.45), 0.0053, 0.09, 0.1, 0.8, 0.10),
            Weave       => (0.45, (5.0, 0.08),  900.0, (20.0, 1.0), (30.0, 0.90), 0.0053, 0.09, 0.1, 0.8, 0.08),
            Fur         => (0.40, (4.0, 0.08),  300.0, (25.0, 1.5), ( 0.0, 1.0), 0.0067, 0.12, 0.4, 10.0, 0.80),
        };
    // cells are round, grain and fibres are not
    let relief_exponent = if group == Foam { 4.0 } else { 3.0 };
    Recipe {
        friction, fine, impulse_hz, relief, relief_exponent, weave, grating: false, friction_noise, heterogeneity,
        damping, thickness_mm, compliance_mm_per_n,
    }
}

/// Medians of a texture, and whether more than its group is known of it.
#[rustfmt::skip]
pub(super) fn recipe(named: Named) -> (Recipe, bool) {
    let r = of(named.group);
    let hinted = match named.number {
        // PAPER Table 2: medium traction, rough, fine
        2 => Recipe { friction: 0.55, fine: (3.5, 0.06), relief: (6.0, 0.6), ..r },
        5 => Recipe { weave: (10.0, 0.8), ..r },
        // flutes under the liner
        8 => Recipe { weave: (8.0, 6.0), grating: true, ..r },
        // Table 2: low traction, rough, coarse
        10 => Recipe { friction: 0.30, fine: (2.0, 0.08), relief: (15.0, 1.2), weave: (38.0, 1.6), ..r },
        11 => Recipe { friction: 0.50, relief: (40.0, 0.8), ..r },
        17 => Recipe { friction: 0.90, fine: (1.5, 0.08), relief: (8.0, 0.8), ..r },
        18 | 19 => Recipe { friction: 0.75, fine: (0.4, 0.05), relief: (1.5, 1.0), ..r },
        // the grating in its name
        20 => Recipe { friction: 0.50, fine: (0.8, 0.06), relief: (4.0, 1.0), weave: (40.0, 5.0), grating: true, ..r },
        21 => Recipe { friction: 0.70, fine: (1.0, 0.06), relief: (5.0, 1.0), weave: (12.0, 1.5), grating: true, ..r },
        22 => Recipe { relief: (25.0, 2.0), ..r },
        23 => Recipe { relief: (60.0, 2.0), compliance_mm_per_n: 0.6, thickness_mm: 6.0, damping: 0.3, ..r },
        // ground, etched and rolled glass; Results: glass smooth with high friction
        24 => Recipe { friction: 0.85, fine: (1.2, 0.05), relief: (2.0, 1.0), ..r },
        25 => Recipe { friction: 1.10, relief: (15.0, 6.0), ..r },
        26 => Recipe { friction: 0.90, fine: (0.7, 0.05), relief: (1.0, 1.0), ..r },
        27 => Recipe { friction: 0.85, fine: (1.0, 0.05), relief: (5.0, 3.0), ..r },
        28 => Recipe { relief: (25.0, 3.0), ..r },
        29 => Recipe { friction: 0.80, fine: (3.0, 0.08), relief: (20.0, 2.0), compliance_mm_per_n: 0.05, ..r },
        // Table 2: high traction, very rough, coarse
        30 => Recipe { friction: 1.10, fine: (3.0, 0.10), relief: (160.0, 1.2), ..r },
        32 => Recipe { friction: 0.95, fine: (0.15, 0.05), relief: (0.8, 2.0), ..r },
        33 => Recipe { friction: 1.00, fine: (0.12, 0.05), relief: (0.8, 2.0), ..r },
        34 => Recipe { friction: 0.55, fine: (2.5, 0.06), relief: (15.0, 1.5), ..r },
        37 => Recipe { friction: 0.75, fine: (0.6, 0.05), relief: (3.0, 1.5), ..r },
        41 => Recipe { friction: 0.95, fine: (0.08, 0.05), relief: (0.5, 2.0), ..r },
        // T43 is the paper's "graphite". Results: the lowest traction. Table 2: medium roughness, fine
        42 => Recipe { friction: 0.28, fine: (1.8, 0.05), relief: (2.0, 0.5), friction_noise: 0.025, ..r },
        43 => Recipe { friction: 0.20, fine: (2.2, 0.05), relief: (2.0, 0.4), friction_noise: 0.025, ..r },
        // marks of the cutter at the feed per turn
        44 => Recipe { friction: 0.60, weave: (3.0, 0.25), grating: true, ..r },
        // T45 is the paper's "milled aluminum". Table 2: medium traction, smooth, very fine
        45 => Recipe { friction: 0.60, fine: (1.1, 0.04), relief: (1.0, 0.3), ..r },
        // Table 2: very high traction, very smooth, no features
        46 => Recipe { friction: 1.30, fine: (0.03, 0.05), relief: (0.3, 2.0), friction_noise: 0.0023, ..r },
        // Table 2: very high traction, smooth, no features
        47 => Recipe { friction: 1.30, fine: (0.20, 0.05), relief: (0.8, 1.5), ..r },
        57 | 58 => Recipe { relief: (18.0, 1.0), ..r },
        60 | 66 => Recipe { weave: (30.0, 3.0), grating: true, ..r },
        61 | 62 => Recipe { friction: 1.00, fine: (0.3, 0.05), relief: (1.5, 1.5), ..r },
        67 => Recipe { relief: (25.0, 1.2), ..r },
        69 => Recipe { friction: 0.80, fine: (1.0, 0.06), relief: (4.0, 0.8), ..r },
        // satins: Table 2 (T84): medium traction and roughness, very fine; Results: among the roughest
        74 | 84 | 88 | 99 => Recipe { friction: 0.50, fine: (6.0, 0.05), relief: (4.0, 0.4), weave: (2.0, 0.1), ..r },
        // Table 2: medium traction, very rough, medium fineness
        87 => Recipe { friction: 0.50, fine: (4.0, 0.07), relief: (15.0, 0.6), weave: (60.0, 0.7), ..r },
        // wales
        91 => Recipe { weave: (60.0, 2.5), ..r },
        95 => Recipe { relief: (80.0, 2.0), compliance_mm_per_n: 0.4, thickness_mm: 3.0, ..r },
        // Table 2: medium traction, very rough, very coarse
        100 => Recipe { friction: 0.50, fine: (5.0, 0.08), relief: (40.0, 1.5), weave: (110.0, 1.8), ..r },
        _ => return (r, false),
    };
    (hinted, true)
}
