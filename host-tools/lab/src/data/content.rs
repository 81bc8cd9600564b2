//! Faults in the contents of a file, and their remedies. The reader of the file adds the place.

use std::io;

use tactus_core::features::MovementError;
use tactus_core::sensor::pressure::RATE_HZ;

use crate::data::recordings::npy::{MAX_SAMPLES, NpyError};
use crate::data::recordings::own::VERSION;

/// A fault in the contents of a file, and its remedy. The errors that hold it name the file, and the place in it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ContentError {
    /// The system could not read.
    #[error("{0}")]
    Io(io::Error),
    /// The file is longer than this, in bytes.
    #[error("longer than the {0} bytes it can have; fetch or record it again")]
    TooLong(u64),
    /// A number is too large for any movement.
    #[error(transparent)]
    Movement(#[from] MovementError),

    // tables
    /// No text.
    #[error("not UTF-8 text, so this is not a table in CSV")]
    NotUtf8,
    /// The CSV reader complains.
    #[error("{0}")]
    Csv(csv::Error),
    /// A column is missing; the header.
    #[error("no column {0} in the header ({1})")]
    NoColumn(&'static str, String),
    /// A column comes twice.
    #[error("two columns {0} in the header")]
    TwoColumns(&'static str),
    /// The table is longer than this, in bytes.
    #[error("the table is longer than {0} bytes; split it")]
    LongTable(u64),
    /// A row has another number of fields than the header.
    #[error(
        "{0} fields where the header has {1}: cut off or damaged; fetch or write the file again"
    )]
    Fields(usize, usize),
    /// A field has the wrong form.
    #[error("{0:?} is not {1}")]
    NotA(String, &'static str),
    /// A number is not finite.
    #[error("{0} is not a finite number; measure it again or leave the row out")]
    NotFinite(String),
    /// A name is missing.
    #[error("is empty; give a name or number")]
    NoName,
    /// A trial belongs to no set.
    #[error("{0:?} is neither train nor validate")]
    NoSet(String),
    /// A trial comes twice.
    #[error(
        "{set} trial {trial} of texture {texture}, movement {movement} comes twice; number the trials"
    )]
    TrialTwice {
        /// `train` or `validate`.
        set: &'static str,
        /// Its number.
        trial: u32,
        /// Name of the texture.
        texture: Box<str>,
        /// Name of the movement.
        movement: Box<str>,
    },

    /// A count is larger than the converter gives.
    #[error("{0} is not a count of 0 to 4095")]
    Count(u16),

    // recorded slides
    /// They are of another version of the format.
    #[error(
        "version {0}, and this program reads version {VERSION}: write the recordings anew, or use the program \
         that wrote them"
    )]
    Version(u32),
    /// Start and end of the steady part, s.
    #[error("the steady window {0} s to {1} s is not a stretch of time")]
    Window(f32, f32),
    /// The rate of a stream, Hz, and the stream.
    #[error("a rate of {0} Hz for {1} is impossible")]
    Rate(u32, &'static str),
    /// P_AC has another rate than [`RATE_HZ`].
    #[error("{0} Hz; all of Tactus counts on {RATE_HZ} Hz")]
    PacRate(u32),
    /// A stream is too long.
    #[error("the samples of {1} are {0}, more than a slide can have ({MAX_SAMPLES})")]
    Samples(usize, &'static str),
    /// A stream is shorter than the steady part.
    #[error(
        "{stream} (samples: {samples}, at {rate_hz} Hz) ends before the steady window does ({end_s} s)"
    )]
    EndsEarly {
        /// The stream.
        stream: &'static str,
        /// Its length.
        samples: usize,
        /// Its rate, Hz.
        rate_hz: u32,
        /// End of the steady part, s.
        end_s: f32,
    },
    /// A background power, counts^2.
    #[error("a background power of {0} is impossible")]
    BackgroundPower(f32),
    /// There is nothing of the still finger.
    #[error("the record of the still finger is empty")]
    NoStill,
    /// A row names a power and a file.
    #[error("there is a background_file too; leave one of them empty")]
    TwoBackgrounds,
    /// A stream has no file.
    #[error("no file is named")]
    NoFile,
    /// A hash of nothing.
    #[error("a hash, but no file is named")]
    HashAlone,
    /// A file that cannot be checked.
    #[error("a file without its hash")]
    FileAlone,
    /// A manifest without a slide.
    #[error("no slide is listed below the header; record some")]
    NoSlides,
    /// Two names of a texture of one number.
    #[error("is both {0:?} and {1:?}; give each texture one number and one name")]
    TwoNames(String, String),

    // files of samples
    /// The file was changed.
    #[error(
        "SHA-256 of {what} is {found}, the manifest says {expected}: the file was damaged or changed; fetch or record \
         it again"
    )]
    Hash {
        /// The contents that were hashed.
        what: &'static str,
        /// Its hash.
        found: Box<str>,
        /// The manifest's.
        expected: Box<str>,
    },
    /// The file does not unpack.
    #[error("no whole gzip stream ({0}); fetch it again")]
    Gzip(io::Error),
    /// The file does not unpack to the manifest's length: bytes found (of too many, one more than wanted) and wanted.
    #[error(
        "unpacks to {0} {more}bytes{odd}; the manifest says {1}",
        more = if .0 > .1 { "or more " } else { "" },
        odd = if .0.is_multiple_of(2) { "" } else { ", an odd number for 16-bit values" }
    )]
    Unpacked(u64, u64),
    /// The file is shorter than the manifest says.
    #[error("truncated: {0} bytes, the manifest says {1}; fetch it again")]
    Truncated(usize, u64),
    /// The file does not hold an array of samples.
    #[error(transparent)]
    Npy(#[from] NpyError),

    // manifests in JSON
    /// The JSON reader complains; a folder with that layout.
    #[error("{0}; the layout is that of {1}")]
    Json(serde_json::Error, &'static str),
    /// Another layout, of another sensor.
    #[error(
        "this is FabricSlide, slides of another finger without P_AC: `tactus evaluate --fabrics DIR` plays it"
    )]
    Fabrics,
    /// A field of a record is too long.
    #[error("{0} with {1} values; a slide has 1 to {MAX_SAMPLES}")]
    FieldLength(String, usize),
    /// A field of a record comes twice.
    #[error("{0} is listed twice")]
    Twice(String),
    /// A field of a record is missing.
    #[error("there is no {0} in it")]
    NoField(&'static str),
    /// The record has P_AC at another rate than [`RATE_HZ`].
    #[error("pac at {0} Hz; all of Tactus counts on {RATE_HZ} Hz")]
    PacFieldRate(u32),
    /// No material.
    #[error("no material is listed")]
    NoMaterial,
    /// A material has another number of slides than the manifest.
    #[error("n_slides is {0}, but \"slides\" lists {1}; they must agree")]
    SlidesDisagree(usize, usize),
    /// The length of a file, its slides, and the values of a slide.
    #[error(
        "bytes_raw is {0}, but slides ({1}) of {2} 16-bit values are not that many bytes; they must agree"
    )]
    LengthDisagrees(u64, usize, usize),
    /// A file is too long for the memory.
    #[error("bytes_raw is {0}, more than the {1} bytes one material can have; split it")]
    LongMaterial(u64, u64),
    /// A packed file is longer than its contents.
    #[error("bytes_gz is {0}, far more than the {1} bytes that are in it; correct the manifest")]
    LongPacked(u64, u64),

    // the publisher's files
    /// Time does not advance.
    #[error("not after the row before; fetch the file again")]
    NotAfter,
    /// Time goes back.
    #[error("before that of the row before; fetch the file again")]
    Before,
    /// More rows than a slide has.
    #[error("a slide has fewer rows than {0}")]
    Rows(usize),
    /// A force, N.
    #[error("{0} N would tear the finger off; fetch the file again")]
    Force(f64),
    /// The two files of a slide are of different times.
    #[error("no force at the time of the slide; fetch it and its _bio again")]
    NoForce,
    /// The name of a file of the Cluster dataset.
    #[error(
        "the name is not SURFACE_DIRECTION_SPEED_FORCE_REPETITION.csv of the Cluster Haptic Texture Dataset \
         (0_135_40_500_0.csv: multiples of 45 degrees, 20 to 60 mm/s, 500 or 1000 mN, 0 or 1); correct it or move the \
         file away"
    )]
    ClusterName,
    /// A surface that is not in the dataset, and the last one that is.
    #[error("there is no surface {0}: they are 0 to {1}; correct the name or move the file away")]
    Surface(u32, u32),
    /// Speed along the way, and that of the file's name, mm/s.
    #[error(
        "the finger moves at {0:.1} mm/s where the file's name says {1}: it was cut off or has a wrong name; fetch it \
         again"
    )]
    Speed(f64, u32),
    /// The force ends too early.
    #[error("ends before the finger has come to the end of its way; fetch it again")]
    NoForceThen,
    /// A slide from a publisher's file is not usable.
    #[error("{0}; fetch the file again, or move it and its _cw away")]
    Imported(Box<Self>),
}
