//! Wrote `requests-5.jsonl`, `reports-5.jsonl`, `reasons-5.jsonl` and the tables of version 4 in this folder: see README.md. It
//! is compiled at that commit only, and shall stay as it is.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use tactus_lab::data::replay::measure;
use tactus_lab::eval::learn::{Expected, learn_for};
use tactus_lab::sim::collection::{Collection, calibrated};
use tactus_core::dsp::Plan;
use tactus_core::explorer::{ExplorerError, Method, ObserveError};
use tactus_core::features::{
    BLOCK, FeatureSet, Movement, MovementError, Observation, Property, SlideError,
};
use tactus_core::rig::calibration::RigCalibrationError;
use tactus_core::rig::{FAULTS, Fault, Refused, RigError};
use tactus_core::sensor::pressure::CalibrationError;
use tactus_core::store::{FlashFault, SettingsError, StoreError};
use tactus_core::table::{Action, Drift, EncodeError, Name, TableError};
use tactus_core::wire::*;

fn main() {
    let out = PathBuf::from(std::env::args().nth(1).expect("a folder"));
    lines(&out, "requests-5.jsonl", requests(&out));
    lines(&out, "reports-5.jsonl", reports(&out));
    lines(&out, "reasons-5.jsonl", failures());
    tables(&out);
}

fn lines<M: Serialize>(out: &Path, name: &str, messages: Vec<M>) {
    let mut file = fs::File::create(out.join(name)).unwrap();
    for message in messages {
        let mut buffer = [0; MAX_FRAME + 1];
        let frame = encode(&message, &mut buffer).unwrap();
        let frame: String = frame.iter().map(|b| format!("{b:02x}")).collect();
        writeln!(file, "{}", json!({"frame": frame, "message": message})).unwrap();
    }
}

/// The messages of a file of version 3, with the names of today.
fn before<M: DeserializeOwned>(out: &Path, name: &str) -> Vec<M> {
    let text = fs::read_to_string(out.join(name)).unwrap();
    let message = |line: &str| {
        let mut line: Value = serde_json::from_str(line).unwrap();
        serde_json::from_value(line["message"].take()).unwrap()
    };
    text.lines().map(message).collect()
}

fn name(name: &str) -> Name {
    Name::try_from(name).unwrap()
}

/// That each of `0..wanted` is there.
fn all(kinds: impl Iterator<Item = usize>, wanted: usize) {
    let kinds: std::collections::BTreeSet<usize> = kinds.collect();
    assert_eq!(kinds.into_iter().collect::<Vec<_>>(), (0..wanted).collect::<Vec<_>>());
}

fn requests(out: &Path) -> Vec<Request> {
    let mut requests: Vec<Request> = before(out, "requests.jsonl");
    let identify = Identify {
        false_alarm: Some(0.05),
        ..Identify::default()
    };
    for command in [
        Command::Identify(identify),
        Command::Weigh(490),
        Command::Weigh(1470),
    ] {
        requests.push(Request { id: 300, command });
    }
    // a message that is not listed does not compile
    let kind = |request: &Request| match request.command {
        Command::Status => 0,
        Command::Home => 1,
        Command::Stop => 2,
        Command::Identify(_) => 3,
        Command::Label(_) => 4,
        Command::Train(_) => 5,
        Command::Rename { .. } => 6,
        Command::Forget(Forget::Texture(_) | Forget::SelfLearned | Forget::Training(_)) => 7,
        Command::Calibrate => 8,
        Command::ReadCalibration => 9,
        Command::WriteCalibration(_) => 10,
        Command::Stream(_) => 11,
        Command::ReadTable(_) => 12,
        Command::BeginTable(_) => 13,
        Command::WriteTable { .. } => 14,
        Command::CommitTable => 15,
        Command::FactoryTable => 16,
        Command::Weigh(_) => 17,
    };
    all(requests.iter().map(kind), 18);
    requests
}

fn reports(out: &Path) -> Vec<Report> {
    let mut reports: Vec<Report> = before(out, "reports.jsonl");
    for report in &mut reports {
        if let Event::Booted { protocol, .. } = &mut report.event {
            *protocol = PROTOCOL;
        }
    }
    let agains = [
        Again::TooHard,
        Again::TooLight,
        Again::TooShort,
        Again::TooUneven,
        Again::Disturbed,
    ];
    let prompts = [
        Prompt::Lift,
        Prompt::Press,
        Prompt::Slide,
        Prompt::Weigh(980),
    ];
    let prompts = prompts.into_iter().chain(agains.map(Prompt::Again));
    let mut events: Vec<Event> = prompts.map(Event::Prompt).collect();
    for samples in [&[] as &[i16], &[-30, 0, 1, 4095], &[i16::MIN; BLOCK]] {
        events.push(Event::Pdc(samples.iter().copied().collect()));
    }
    events.push(Event::Weighed {
        mn: 980,
        counts: 85.25,
    });
    for changed in [false, true] {
        events.push(Event::Verdict(Verdict {
            texture: 300,
            name: name("Cotton"),
            probability: 0.995,
            sure: true,
            unknown: false,
            log_odds: Some(-1.5),
            slides: 3,
            wants_label: changed,
            changed,
        }));
    }
    events.push(Event::Trouble(Failure::Busy));
    events.extend(FAULTS.iter().map(|row| Event::Fault(row.fault)));
    reports.extend(events.into_iter().map(|event| Report {
        number: 300,
        at_ms: 70_000,
        event,
    }));
    let kind = |report: &Report| match &report.event {
        Event::Booted { .. } => 0,
        Event::Status(_) => 1,
        Event::Done(_) => 2,
        Event::Refused { .. } => 3,
        Event::Damaged(_) => 4,
        Event::Phase(_) => 5,
        Event::Chosen { .. } => 6,
        Event::SlideReport { .. } => 7,
        Event::Rejected { .. } => 8,
        Event::Verdict(_) => 9,
        Event::TextureLearned(_) => 10,
        Event::TrainingSlide { .. } => 11,
        Event::Live(_) => 12,
        Event::Fault(_) => 13,
        Event::Block(_) => 14,
        Event::Calibration(_) => 15,
        Event::TablePart { .. } => 16,
        Event::Trouble(_) => 17,
        Event::Prompt(_) => 18,
        Event::Pdc(_) => 19,
        Event::Weighed { .. } => 20,
    };
    all(reports.iter().map(kind), 21);
    reports
}

/// Every reason at every place where it can be, and every reason in that.
fn failures() -> Vec<Failure> {
    let mut failures = vec![
        Failure::Said(Text::try_from("so").unwrap()),
        Failure::Busy,
        Failure::Movement(2),
        Failure::Rejected,
        Failure::CalibrationLength,
        Failure::NoSuchByte,
        Failure::OtherProbe,
    ];
    failures.extend(rigs().map(Failure::Rig));
    failures.extend(explorers().map(Failure::Explorer));
    failures.extend(rejections().map(Failure::Slide));
    failures.extend(rejections().map(Failure::NoGoodSlide));
    failures.extend(trainings().map(Failure::Training));
    failures.extend(memories().map(Failure::Memory));
    failures.extend(calibrations().map(Failure::Calibration));
    failures.extend(memories().map(Failure::NotLearned));
    let kind = |failure: &Failure| match failure {
        Failure::Said(_) => 0,
        Failure::Busy => 1,
        Failure::Rig(_) => 2,
        Failure::Explorer(_) => 3,
        Failure::Slide(_) => 4,
        Failure::NoGoodSlide(_) => 5,
        Failure::Movement(_) => 6,
        Failure::Training(_) => 7,
        Failure::Rejected => 8,
        Failure::Memory(_) => 9,
        Failure::Calibration(_) => 10,
        Failure::CalibrationLength => 11,
        Failure::NoSuchByte => 12,
        Failure::NotLearned(_) => 13,
        Failure::OtherProbe => 14,
    };
    all(failures.iter().map(kind), 15);
    failures
}

fn rigs() -> impl Iterator<Item = RigError> {
    let mut errors = vec![
        RigError::Stopped,
        RigError::Hangs,
        RigError::NobodyThere,
        RigError::NotByHand,
    ];
    errors.extend(FAULTS.iter().map(|row| RigError::Fault(row.fault)));
    let mut refused = vec![
        Refused::Busy,
        Refused::NotHomed,
        Refused::Fault(Fault::LeverSlips),
        Refused::Force(2000),
        Refused::Speed(70_000),
        Refused::Length,
    ];
    refused.extend(calibrations().map(Refused::Calibration));
    let of_refused = |refused: &Refused| match refused {
        Refused::Busy => 0,
        Refused::NotHomed => 1,
        Refused::Fault(_) => 2,
        Refused::Force(_) => 3,
        Refused::Speed(_) => 4,
        Refused::Length => 5,
        Refused::Calibration(_) => 6,
    };
    all(refused.iter().map(of_refused), 7);
    errors.extend(refused.into_iter().map(RigError::Refused));
    let kind = |error: &RigError| match error {
        RigError::Refused(_) => 0,
        RigError::Fault(_) => 1,
        RigError::Stopped => 2,
        RigError::Hangs => 3,
        RigError::NobodyThere => 4,
        RigError::NotByHand => 5,
    };
    all(errors.iter().map(kind), 6);
    errors.into_iter()
}

fn calibrations() -> impl Iterator<Item = RigCalibrationError> {
    let pressures = [
        CalibrationError::Scale,
        CalibrationError::PacRest,
        CalibrationError::PdcNoContact,
    ];
    let of_pressure = |error: &CalibrationError| match error {
        CalibrationError::Scale => 0,
        CalibrationError::PacRest => 1,
        CalibrationError::PdcNoContact => 2,
    };
    all(pressures.iter().map(of_pressure), 3);
    let mut errors = pressures.map(RigCalibrationError::Pressure).to_vec();
    errors.extend([
        RigCalibrationError::Current,
        RigCalibrationError::Damaged,
        RigCalibrationError::Points,
        RigCalibrationError::NoLine,
    ]);
    let kind = |error: &RigCalibrationError| match error {
        RigCalibrationError::Pressure(_) => 0,
        RigCalibrationError::Current => 1,
        RigCalibrationError::Damaged => 2,
        RigCalibrationError::Points => 3,
        RigCalibrationError::NoLine => 4,
    };
    all(errors.iter().map(kind), 5);
    errors.into_iter()
}

fn explorers() -> impl Iterator<Item = ExplorerError> {
    let mut errors = vec![
        ExplorerError::NoSpace {
            textures: 300,
            capacity: 128,
        },
        ExplorerError::Candidates,
        ExplorerError::NothingToMeasure,
    ];
    errors.extend(FeatureSet::ALL.map(ExplorerError::Features));
    let methods = [
        Method::Paper,
        Method::Student,
        Method::StudentAll,
        Method::Fused,
    ];
    errors.extend(methods.map(ExplorerError::Method));
    let kind = |error: &ExplorerError| match error {
        ExplorerError::NoSpace { .. } => 0,
        ExplorerError::Candidates => 1,
        ExplorerError::NothingToMeasure => 2,
        ExplorerError::Features(_) => 3,
        ExplorerError::Method(Method::Paper | Method::Student | Method::StudentAll | Method::Fused) => 4,
    };
    all(errors.iter().map(kind), 5);
    errors.into_iter()
}

fn action() -> Action {
    Action {
        movement: 2,
        property: Some(Property::Roughness),
    }
}

fn rejections() -> impl Iterator<Item = Rejection> {
    let slides = [
        SlideError::NotStarted,
        SlideError::Unfinished {
            got: 70,
            wanted: 2200,
        },
        SlideError::TooShort(300),
        SlideError::NoBackground,
        SlideError::Silent,
        SlideError::Gap(5),
    ];
    let of_slide = |error: &SlideError| match error {
        SlideError::NotStarted => 0,
        SlideError::Unfinished { .. } => 1,
        SlideError::TooShort(_) => 2,
        SlideError::NoBackground => 3,
        SlideError::Silent => 4,
        SlideError::Gap(_) => 5,
    };
    all(slides.iter().map(of_slide), 6);
    let mut observed: Vec<ObserveError> = Property::ALL.map(ObserveError::Missing).to_vec();
    observed.extend(FeatureSet::ALL.map(ObserveError::Features));
    observed.push(ObserveError::Action(action()));
    let of_observed = |error: &ObserveError| match error {
        ObserveError::Missing(_) => 0,
        ObserveError::Features(_) => 1,
        ObserveError::Action(_) => 2,
    };
    all(observed.iter().map(of_observed), 3);
    let mut rejections: Vec<Rejection> = slides.map(Rejection::Slide).to_vec();
    rejections.extend(observed.into_iter().map(Rejection::Observe));
    rejections.extend([RigError::Stopped, RigError::Fault(Fault::Unsteady)].map(Rejection::Rig));
    rejections.push(Rejection::Training(TrainingError::Missing(Property::Traction)));
    let kind = |rejection: &Rejection| match rejection {
        Rejection::Rig(_) => 0,
        Rejection::Slide(_) => 1,
        Rejection::Observe(_) => 2,
        Rejection::Training(_) => 3,
    };
    all(rejections.iter().map(kind), 4);
    rejections.into_iter()
}

fn trainings() -> impl Iterator<Item = TrainingError> {
    let mut errors = vec![
        TrainingError::Name(41),
        TrainingError::Trials(1),
        TrainingError::Textures,
        TrainingError::NoSpace(300),
        TrainingError::Measures(None),
        TrainingError::Measures(Some(Property::Traction)),
        TrainingError::Missing(Property::Fineness),
        TrainingError::Features(FeatureSet::Force),
        TrainingError::Stats,
        TrainingError::Movement(Movement::FOR_TRACTION),
        TrainingError::Unfinished(Movement::FOR_ROUGHNESS),
        TrainingError::Pilot,
        TrainingError::Table,
    ];
    errors.extend(encodes().map(TrainingError::Encode));
    let kind = |error: &TrainingError| match error {
        TrainingError::Name(_) => 0,
        TrainingError::Trials(_) => 1,
        TrainingError::Textures => 2,
        TrainingError::NoSpace(_) => 3,
        TrainingError::Measures(_) => 4,
        TrainingError::Missing(_) => 5,
        TrainingError::Features(_) => 6,
        TrainingError::Stats => 7,
        TrainingError::Movement(_) => 8,
        TrainingError::Unfinished(_) => 9,
        TrainingError::Pilot => 10,
        TrainingError::Table => 11,
        TrainingError::Encode(_) => 12,
    };
    all(errors.iter().map(kind), 13);
    errors.into_iter()
}

fn encodes() -> impl Iterator<Item = EncodeError> {
    let mut errors = vec![
        EncodeError::Empty,
        EncodeError::Contents,
        EncodeError::Texture(117),
        EncodeError::NoSpace(300),
        EncodeError::Movements(2),
        EncodeError::Name(3),
        EncodeError::Range {
            texture: 4,
            action: action(),
            mean: -32.5,
        },
    ];
    errors.extend(broken().map(EncodeError::Invalid));
    let kind = |error: &EncodeError| match error {
        EncodeError::Empty => 0,
        EncodeError::Contents => 1,
        EncodeError::Texture(_) => 2,
        EncodeError::NoSpace(_) => 3,
        EncodeError::Movements(_) => 4,
        EncodeError::Name(_) => 5,
        EncodeError::Range { .. } => 6,
        EncodeError::Invalid(_) => 7,
    };
    all(errors.iter().map(kind), 8);
    errors.into_iter()
}

fn broken() -> impl Iterator<Item = TableError> {
    let errors = [
        TableError::Truncated { got: 3, wanted: 16 },
        TableError::Magic(*b"TACZ"),
        TableError::Version(9),
        TableError::Method(2),
        TableError::Length {
            header: 300,
            contents: 299,
        },
        TableError::Crc {
            stored: 1,
            computed: u32::MAX,
        },
        TableError::Header,
        TableError::Movement(1, MovementError::Force(20_000)),
        TableError::Movement(2, MovementError::Speed(200_000)),
        TableError::TwinMovement(2),
        TableError::Deviation {
            texture: 5,
            action: action(),
        },
        TableError::Whitening(1),
        TableError::Name(6),
        TableError::Number(7),
        TableError::Sections,
        TableError::Section(2),
    ];
    let kind = |error: &TableError| match error {
        TableError::Truncated { .. } => 0,
        TableError::Magic(_) => 1,
        TableError::Version(_) => 2,
        TableError::Method(_) => 3,
        TableError::Length { .. } => 4,
        TableError::Crc { .. } => 5,
        TableError::Header => 6,
        TableError::Movement(_, MovementError::Force(_) | MovementError::Speed(_)) => 7,
        TableError::TwinMovement(_) => 8,
        TableError::Deviation { .. } => 9,
        TableError::Whitening(_) => 10,
        TableError::Name(_) => 11,
        TableError::Number(_) => 12,
        TableError::Sections => 13,
        TableError::Section(_) => 14,
    };
    all(errors.iter().map(kind), 15);
    errors.into_iter()
}

fn memories() -> impl Iterator<Item = MemoryError> {
    let mut errors = vec![
        MemoryError::Broken(StoreError::Silent),
        MemoryError::NoTable(TableError::Header),
        MemoryError::NoEpisode,
        MemoryError::TableChanged,
        MemoryError::TrainOnly,
        MemoryError::Full,
        MemoryError::Unknown(name("silk")),
        MemoryError::Taken(name("silk")),
        MemoryError::LastTexture,
        MemoryError::StoredTable(TableError::Section(2)),
        MemoryError::NewestTable(TableError::Section(1)),
    ];
    errors.extend(broken().map(MemoryError::Table));
    errors.extend(encodes().map(MemoryError::Encode));
    errors.extend(stores().map(MemoryError::Store));
    let kind = |error: &MemoryError| match error {
        MemoryError::Broken(_) => 0,
        MemoryError::NoTable(_) => 1,
        MemoryError::NoEpisode => 2,
        MemoryError::TableChanged => 3,
        MemoryError::TrainOnly => 4,
        MemoryError::Full => 5,
        MemoryError::Unknown(_) => 6,
        MemoryError::Taken(_) => 7,
        MemoryError::LastTexture => 8,
        MemoryError::Table(_) => 9,
        MemoryError::Encode(_) => 10,
        MemoryError::Store(_) => 11,
        MemoryError::StoredTable(_) => 12,
        MemoryError::NewestTable(_) => 13,
    };
    all(errors.iter().map(kind), 14);
    errors.into_iter()
}

fn stores() -> impl Iterator<Item = StoreError> {
    let mut errors = vec![
        StoreError::NoSpace(16),
        StoreError::TooLong {
            length: 17_000,
            capacity: 16_352,
        },
        StoreError::NoTable,
        StoreError::Part {
            offset: 256,
            wanted: 0,
        },
        StoreError::Unfinished {
            got: 256,
            wanted: 300,
        },
        StoreError::Buffer(300),
        StoreError::Table(TableError::Sections),
        StoreError::Worn,
        StoreError::Calibration(RigCalibrationError::Damaged),
        StoreError::Silent,
    ];
    let flash = [FlashFault::Unaligned, FlashFault::Bounds, FlashFault::Work];
    let settings = [
        SettingsError::Corrupt,
        SettingsError::Schema(1),
        SettingsError::Full,
    ];
    errors.extend(flash.map(StoreError::Flash));
    errors.extend(settings.map(StoreError::Settings));
    let kind = |error: &StoreError| match error {
        StoreError::Flash(FlashFault::Unaligned | FlashFault::Bounds | FlashFault::Work) => 0,
        StoreError::NoSpace(_) => 1,
        StoreError::TooLong { .. } => 2,
        StoreError::NoTable => 3,
        StoreError::Part { .. } => 4,
        StoreError::Unfinished { .. } => 5,
        StoreError::Buffer(_) => 6,
        StoreError::Table(_) => 7,
        StoreError::Worn => 8,
        StoreError::Settings(
            SettingsError::Corrupt | SettingsError::Schema(_) | SettingsError::Full,
        ) => 9,
        StoreError::Calibration(_) => 10,
        StoreError::Silent => 11,
    };
    all(errors.iter().map(kind), 12);
    errors.into_iter()
}

/// A table for each set of features, one for no drift, one of too few textures for limits, one of Gaussians, and those in the
/// images.
fn tables(out: &Path) {
    let world = Collection {
        seed: 5,
        textures: vec![10, 47, 100],
        trials: 3,
    };
    let calibration = calibrated(world.setup(10, 0)).unwrap();
    let plan = Plan::new();
    let mut some = 0;
    let mut observe = |slide: &_| {
        let mut observed = Observation::from(&measure(&plan, slide).unwrap());
        // a slide of the rig has no pressure unless it is given one
        some += 37;
        observed.pressure.get_or_insert([some % 500, some % 90]);
        observed
    };
    let recorded = world.record(calibration, || ()).unwrap();
    let slides: Vec<Vec<Vec<Observation>>> = recorded
        .iter()
        .map(|slides| {
            let of = |movement| slides.iter().filter(move |slide| slide.movement == movement);
            let movements = Collection::MOVEMENTS.iter();
            movements.map(|&movement| of(movement).map(&mut observe).collect()).collect()
        })
        .collect();
    let usual = Expected::default();
    let none = Expected {
        drift: Some(Drift::NONE),
        false_alarm: 0.05,
    };
    let fused = Method::Fused;
    for (name, method, features, expected, textures) in [
        ("4-force", fused, Some(FeatureSet::Force), &usual, 3),
        ("4-pressure", fused, Some(FeatureSet::Pressure), &usual, 3),
        ("4-bands", fused, Some(FeatureSet::Bands), &usual, 3),
        ("4-properties", fused, Some(FeatureSet::Properties), &usual, 3),
        ("4-no-drift", fused, Some(FeatureSet::Force), &none, 3),
        ("4-two", fused, Some(FeatureSet::Force), &usual, 2),
        ("4-paper", Method::Paper, None, &usual, 3),
    ] {
        let (names, slides) = (&world.names()[..textures], &slides[..textures]);
        let bytes = learn_for(expected, method, features, names, &Collection::MOVEMENTS, slides);
        fs::write(out.join(name).with_extension("tact"), bytes.unwrap()).unwrap();
    }
    for name in ["factory", "handheld"] {
        let from = format!("firmware/{name}.tact");
        fs::copy(from, out.join(format!("4-{name}.tact"))).unwrap();
    }
}
