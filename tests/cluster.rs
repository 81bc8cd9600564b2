//! A folder in the layout of the Cluster Haptic Texture Dataset, written from its description (`documents/dataset_details.md` in
//! <https://github.com/cluster-lab/Cluster-Haptic-Texture-Dataset>).
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

/// The finger rests so long before it moves, s.
const REST: f64 = 0.3;
/// Length of the way, mm.
const WAY: f64 = 90.0;

/// One slide, whose acceleration is gravity and one tone.
#[derive(Clone, Copy, Debug)]
pub struct Slide {
    /// Number of the surface.
    pub surface: u32,
    /// Direction, degrees.
    pub degrees: u32,
    /// Speed, mm/s.
    pub mm_s: u32,
    /// Force, mN.
    pub mn: u32,
    /// Repetition.
    pub repetition: u32,
    /// Frequency of the tone, Hz.
    pub hz: f64,
    /// Its amplitude, g.
    pub g: f64,
    /// Rate of acceleration and force, Hz.
    pub rate: f64,
    /// How far the times are from even ones, at most, in parts of the time between two.
    pub jitter: f64,
}

/// The slide of the description's example, with a tone of 200 Hz and 0.5 g.
pub const EXAMPLE: Slide = Slide {
    surface: 0,
    degrees: 135,
    mm_s: 40,
    mn: 500,
    repetition: 0,
    hz: 200.0,
    g: 0.5,
    rate: 6000.0,
    jitter: 0.0,
};

impl Slide {
    /// Path of its file below `sensor_data/accel`, `force` and `position`.
    pub fn file(&self) -> String {
        let Self {
            surface,
            degrees,
            mm_s,
            mn,
            repetition,
            ..
        } = self;
        format!("{surface}/{surface}_{degrees}_{mm_s}_{mn}_{repetition}.csv")
    }

    /// Writes its three files below `root`.
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn write(&self, root: &Path) -> std::io::Result<()> {
        let seconds = 2.0 * REST + WAY / f64::from(self.mm_s);
        let (mut accel, mut force) = ("time,X,Y,Z\n".to_owned(), "time,force\n".to_owned());
        let mut off: u32 = 1;
        for n in 0..(seconds * self.rate) as u32 {
            // a generator of numbers will do for the jitter
            off = off.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let off = self.jitter * (f64::from(off >> 16) / 32_768.0 - 1.0);
            let time = 0.001 + (f64::from(n) + off) / self.rate;
            let z = -0.96 + self.g * (TAU * self.hz * time).sin();
            // in the description's steps
            let _ = writeln!(accel, "{time},0.014,0.067,{:.3}", z);
            let _ = writeln!(force, "{time},{:.3}", f64::from(self.mn) / 1e3);
        }
        let mut position = "time,X,Y\n".to_owned();
        for n in 0..(seconds * 100.0) as u32 {
            let time = f64::from(n) / 100.0;
            let way = ((time - REST) * f64::from(self.mm_s)).clamp(0.0, WAY);
            let angle = f64::from(self.degrees).to_radians();
            let (x, y) = (way * angle.sin(), 45.0 - way * angle.cos());
            let _ = writeln!(position, "{time},{x:.4},{y:.4}");
        }
        for (kind, text) in [("accel", accel), ("force", force), ("position", position)] {
            let path = root.join("sensor_data").join(kind).join(self.file());
            fs::create_dir_all(path.parent().unwrap_or(root))?;
            fs::write(path, text)?;
        }
        Ok(())
    }
}
