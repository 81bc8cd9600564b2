//! The real ELF of the handheld probe and a host at its serial link, while a person holds it: judged by what comes over
//! the wire and by what the display shows.

use std::path::Path;

use tactus_core::sensor::FingerName;
use tactus_core::table::{Name, Table};
use tactus_core::wire::{Command, Event, Forget, Identify, Phase, Prompt, Report, Status};
use tactus_emulator::board::{Emulator, Options};
use tactus_emulator::host::talk::{TIMEOUT_S, Talk, TalkError};
use tactus_lab::sim::collection::Collection;
use tactus_lab::sim::handheld::ground;
use tactus_link::{PushTable, ReadTable, Request};
use tactus_world::flow::HEIGHT_MM;
use tactus_world::parts::PartFault;
use tactus_world::person::Manner;
use tactus_world::world::Setup;

use crate::common::elf_of;
use crate::person::Person;

const BURLAP: u8 = 101;

/// A handheld probe over a texture of the world that its own table is learned from, and the person who holds it.
pub(crate) struct Held {
    pub(crate) talk: Talk,
    pub(crate) person: Person,
    /// Requests to the person, one for each time that they changed.
    prompts: Vec<Prompt>,
    pub(crate) reports: Vec<Report>,
}

impl Held {
    pub(crate) fn new(texture: &str, manner: Manner) -> Option<Self> {
        Some(Self::with(
            &elf_of("TACTUS_HANDHELD_ELF")?,
            texture,
            manner,
            None,
        ))
    }

    pub(crate) fn with(elf: &Path, texture: &str, manner: Manner, store: Option<Vec<u8>>) -> Self {
        let collection = Collection::new(1, vec![BURLAP], 1);
        let number = tactus_lab::sim::collection::texture_number(texture).unwrap();
        let setup = collection.setup(number, 77);
        Self::of(elf, setup, manner, store)
    }

    fn of(elf: &Path, setup: Setup, manner: Manner, store: Option<Vec<u8>>) -> Self {
        let options = Options {
            store,
            motion: manner.tilt_mm.map(|_| ground(setup.texture, HEIGHT_MM)),
            ..Options::default()
        };
        let mut board = Emulator::start(elf, setup, options).unwrap();
        let person = Person::hold(&mut board, 5, manner);
        let mut held = Self {
            talk: Talk::new(board),
            person,
            prompts: Vec::new(),
            reports: Vec::new(),
        };
        held.until("ready", 2.0, |board| shows(board, "textures"));
        held
    }

    /// Lets the person go on until the board shows what it should.
    pub(crate) fn until(&mut self, what: &str, seconds: f64, seen: impl Fn(&mut Emulator) -> bool) {
        let until_ns = self.talk.now_ns() + (seconds * 1e9) as u64;
        while self.talk.now_ns() < until_ns {
            self.talk.step().unwrap();
            self.person.look(self.talk.board());
            if seen(self.talk.board()) {
                return;
            }
        }
        panic!("{what} is not seen within {seconds} s");
    }

    /// Presses the button for so many ms.
    pub(crate) fn press_for(&mut self, ms: u64) {
        self.talk.board().press(true).unwrap();
        self.talk.board().run_ms(ms).unwrap();
        self.talk.board().press(false).unwrap();
        // a button that bounces is looked at for 30 ms
        self.talk.board().run_ms(60).unwrap();
    }

    /// The person begins an episode.
    pub(crate) fn touch(&mut self) {
        self.rest();
        let hand = |board: &mut Emulator| board.rig().world().hand().unwrap().intend(0.5, 0.0);
        hand(self.talk.board());
        self.until("an episode", 3.0, |board| shows(board, "slide 1 of 5"));
    }

    /// The person begins an episode, and slides until the display shows this.
    pub(crate) fn slide_until(&mut self, text: &str) {
        self.touch();
        self.until(text, 60.0, |board| shows(board, text));
        self.rest();
    }

    /// Waits until the person's hand is free.
    pub(crate) fn rest(&mut self) {
        while !self.person.is_idle() {
            self.until("some time", 1.0, |_| true);
        }
    }

    /// Runs a request while the person does what the display says.
    pub(crate) fn run<T>(&mut self, request: Request<T>, seconds: f64) -> Result<T, TalkError> {
        let Self {
            talk,
            person,
            prompts,
            reports,
        } = self;
        reports.clear();
        prompts.clear();
        talk.run(request, seconds, |board, report| {
            if let Some(report) = report {
                person.hear(report);
                reports.push(report.clone());
                if let Event::Prompt(prompt) = report.event
                    && prompts.last() != Some(&prompt)
                {
                    prompts.push(prompt);
                }
            }
            person.look(board);
        })
    }

    pub(crate) fn status(&mut self) -> Status {
        self.run(Request::status(), TIMEOUT_S).unwrap()
    }

    pub(crate) fn table(&mut self) -> Vec<u8> {
        self.talk
            .run(ReadTable::default(), TIMEOUT_S, |_, _| ())
            .unwrap()
    }

    pub(crate) fn push(&mut self, table: &[u8]) {
        self.talk
            .run(PushTable::new(table).unwrap(), TIMEOUT_S, |_, _| ())
            .unwrap();
    }

    /// Checks that hold of every run: no slot late, no word lost, no reset, no frame damaged.
    pub(crate) fn end(mut self) {
        let counts = self.status().counts;
        assert_eq!(
            (counts.late_slots, counts.lost_samples, counts.lost_reports),
            (0, 0, 0),
            "{counts:?}"
        );
        assert_eq!(counts.damaged_frames, 0);
        assert_eq!(self.talk.losses(), (0, 0));
        let board = self.talk.board();
        assert_eq!(board.resets().unwrap(), []);
        assert_eq!(board.violations().unwrap(), []);
    }
}

pub(crate) fn shows(board: &mut Emulator, text: &str) -> bool {
    board.rig().display().shows(text)
}

fn name(name: &str) -> Name {
    name.try_into().unwrap()
}

#[test]
fn it_says_how_it_is_and_gives_and_takes_tables() {
    let Some(mut held) = Held::new("burlap", Manner::default()) else {
        return;
    };
    let status = held.status();
    assert_eq!(status.phase, Phase::Ready);
    assert!(status.factory && status.fault.is_none(), "{status:?}");
    assert_eq!(status.calibrated, 0);
    // a person presses it, and no lever
    let hard = held.run(Request::command(Command::SetHighForce(true)), TIMEOUT_S);
    assert!(matches!(hard, Err(TalkError::Refused(_))), "{hard:?}");
    assert!(!held.status().high_force);
    let bytes = held.table();
    let table = Table::read(&bytes).unwrap();
    assert_eq!(
        (table.crc(), table.textures()),
        (status.table_crc, status.textures)
    );
    let (from, to) = (name(table.name(3).unwrap()), name("my paper"));
    held.run(Request::rename(from, to), TIMEOUT_S).unwrap();
    let gone = name(table.name(5).unwrap());
    held.run(Request::forget(Forget::Texture(gone)), TIMEOUT_S)
        .unwrap();
    let changed = held.table();
    let changed = Table::read(&changed).unwrap();
    assert!(changed.find("my paper").is_some());
    assert_eq!(changed.textures() + 1, table.textures());
    held.until("one fewer", 1.0, |board| shows(board, "115 textures"));
    // another table, by parts; then its own again
    held.push(&bytes);
    assert_eq!(held.table(), bytes);
    assert!(!held.status().factory);
    held.until("all", 1.0, |board| shows(board, "116 textures"));
    held.run(Request::command(Command::FactoryTable), TIMEOUT_S)
        .unwrap();
    assert!(held.status().factory);
    held.end();
}

/// The cable is pulled out in the middle of a slide: nobody hears or says anything any more.
#[test]
#[ignore = "long"]
fn a_link_that_is_cut_leaves_a_probe_that_works() {
    let Some(mut held) = Held::new("burlap", Manner::default()) else {
        return;
    };
    let identify = Request::identify(Identify {
        threshold: 1.0,
        open: false,
        ..Identify::default()
    });
    let cut = {
        let Held { talk, person, .. } = &mut held;
        let mut slides = 0;
        talk.run(identify, 6.0, |board, report| {
            person.look(board);
            slides += u32::from(matches!(
                report,
                Some(Report {
                    event: Event::SlideReport { .. },
                    ..
                })
            ));
        })
    };
    assert!(matches!(cut, Err(TalkError::Silent(_))), "{cut:?}");
    // the person does not want to go on for a host that is not there
    held.until("asked", 5.0, |board| shows(board, "slide "));
    held.talk.board().press(true).unwrap();
    held.talk.board().run_ms(700).unwrap();
    held.talk.board().press(false).unwrap();
    held.until("ready", 3.0, |board| shows(board, "and hold"));
    held.rest();
    // and uses the probe
    held.talk
        .board()
        .rig()
        .world()
        .hand()
        .unwrap()
        .intend(0.5, 0.0);
    held.until("its own episode", 3.0, |board| shows(board, "slide 1 of 5"));
    held.until("verdict", 30.0, |board| shows(board, "next"));
    held.until("verdict", 1.0, |board| shows(board, "Burlap"));
    // the cable is back
    assert_eq!(held.status().fault, None);
    held.end();
}

/// A finger with an accelerometer is turned over.
#[test]
#[ignore = "long"]
fn a_finger_is_turned_over_for_a_host() {
    let Some(elf) = elf_of("TACTUS_HANDHELD_ELF") else {
        return;
    };
    let setup = Setup {
        texture: BURLAP,
        finger: FingerName::Mems,
        ..Setup::default()
    };
    let mut held = Held::of(&elf, setup, Manner::default(), None);
    let off = PartFault::AccelerometerOff {
        share: 0.03,
        zero_g: -0.04,
    };
    let mut rig = held.talk.board().rig();
    rig.world().break_part(off);
    rig.world().hand().unwrap().lean(0.02);
    drop(rig);
    let g_counts = 1.03e3 / 0.976;
    let turned = held.run(Request::turn_over(), TIMEOUT_S).unwrap();
    assert!(
        (turned.g_counts / g_counts - 1.0).abs() < 0.005,
        "{turned:?}"
    );
    assert!(
        (turned.offset_counts * 0.976 + 40.0).abs() < 5.0,
        "{turned:?}"
    );
    assert_eq!(held.prompts, [Prompt::Still, Prompt::TurnOver]);
    // it is turned back, and slides as before
    held.talk.board().rig().world().hand().unwrap().turn(false);
    held.talk.board().run_ms(3000).unwrap();
    held.slide_until("slide 2 of 5");
    held.end();
}

/// A bit of the taught table has changed in the flash: the display says so before anything else.
#[test]
fn a_damaged_table_is_told_on_the_display() {
    let Some(elf) = elf_of("TACTUS_HANDHELD_ELF") else {
        return;
    };
    let mut held = Held::with(&elf, "burlap", Manner::default(), None);
    let bytes = held.table();
    held.push(&bytes);
    let mut store = held.talk.board().store().unwrap();
    drop(held);
    let at = store
        .windows(64)
        .position(|some| some == &bytes[..64])
        .unwrap();
    store[at + 300] ^= 8;
    let mut held = Held::with(&elf, "burlap", Manner::default(), Some(store));
    held.until("the damage", 1.0, |board| shows(board, "Your textures are"));
    held.press_for(100);
    held.until("ready", 5.0, |board| shows(board, "and hold"));
    assert!(held.status().factory);
    held.end();
}

/// A display that holds its bus down: the probe identifies without one, and shows again once it has let go.
#[test]
fn a_display_that_hangs_costs_no_identification() {
    let Some(mut held) = Held::new("burlap", Manner::default()) else {
        return;
    };
    held.talk.board().hold_display(u32::MAX).unwrap();
    let identify = Request::identify(Identify::default());
    let found = held.talk.run(identify, 120.0, |board, report| {
        let Some(Event::Prompt(prompt)) = report.map(|report| &report.event) else {
            return;
        };
        let (force_n, mm_s) = match prompt {
            Prompt::Press => (0.5, 0.0),
            Prompt::Slide => (0.5, 25.0),
            _ => (0.0, 0.0),
        };
        board.rig().world().hand().unwrap().intend(force_n, mm_s);
    });
    assert_eq!(found.unwrap().verdict.name.as_str(), "Burlap");
    let seen = held.talk.board().rig().display().bytes();
    held.talk.board().hold_display(5).unwrap();
    held.until("a picture", 3.0, |board| {
        board.rig().display().bytes() > seen + 1024
    });
    held.end();
}
