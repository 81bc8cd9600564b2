use std::time::Duration;

use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use tactus_core::features::{Block, Movement, Property};
use tactus_core::rig::Fault;
use tactus_core::table::Action;
use tactus_core::wire::{
    Command, Event, ExpectedOutcome, Failure, Live, Phase, Report, SlideReport, Status, Text,
    Verdict,
};

use super::state::{Monitor, NOTES, SHOWN};
use super::{End, KEYS, command_of, end_of, is_gone, view};

fn status() -> Status {
    Status {
        phase: Phase::Ready,
        textures: 4,
        table_bytes: 900,
        table_crc: 7,
        factory: true,
        skin_mj: (1500, 250),
        ..Status::default()
    }
}

/// A monitor that has received these events.
fn heard(events: impl IntoIterator<Item = Event>) -> Monitor {
    let names = ["Burlap", "Oak wood", "Velcro", "Felt"].map(str::to_owned);
    let mut monitor = Monitor::new("/dev/ttyACM0", status(), names.to_vec());
    for (event, number) in events.into_iter().zip(1u16..) {
        let at_ms = 1000 * u32::from(number);
        monitor.hear(&Report {
            number,
            at_ms,
            event,
        });
    }
    monitor
}

/// The screen, its lines without the blanks at their ends.
fn screen(monitor: &Monitor, width: u16, height: u16) -> Vec<String> {
    let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
    terminal.draw(|frame| view::draw(monitor, frame)).unwrap();
    let buffer = terminal.backend().buffer();
    buffer
        .content()
        .chunks(width.into())
        .map(|row| {
            let line: String = row.iter().map(|cell| cell.symbol()).collect();
            line.trim_end().to_owned()
        })
        .collect()
}

fn exploration() -> Vec<Event> {
    let action = Action {
        movement: 0,
        property: Some(Property::Roughness),
    };
    vec![
        Event::Chosen {
            slide: 1,
            movement: Movement::FOR_TRACTION,
            action,
            expected: [ExpectedOutcome {
                action,
                uncertainty: 0.125,
                benefit: 0.9,
            }]
            .into_iter()
            .collect(),
        },
        Event::Phase(Phase::Sliding),
        Event::SlideReport {
            slide: 1,
            action,
            observed: SlideReport {
                properties: [Some(0.512), Some(5.25), None],
                background: 1.0,
                ..SlideReport::default()
            },
            posterior: [0.05, 0.75, 0.15, 0.05].into_iter().collect(),
        },
        Event::Live(Live {
            force_mn: 1050,
            steps: 1600,
            stage_um: 31_250,
            speed_um_s: 10_040,
            current_ma: 132,
        }),
    ]
}

#[test]
fn a_slide_looks_like_this() {
    let screen = screen(&heard(exploration()), 80, 24);
    let golden = "\
+ Rig -----------------++ What it may be --------------------------------------+
|phase   sliding       ||Oak wood                 ###############.....  75.0 % |
|force   1.050 N       ||Velcro                   ###.................  15.0 % |
|########..!..... 2.1 N||Burlap                   #...................   5.0 % |
|speed    10.0 mm/s    ||Felt                     #...................   5.0 % |
|stage    31.3 mm      ||                                                      |
|lever    1.00 mm      ||                                                      |
|motor     132 mA      ||                                                      |
+----------------------++------------------------------------------------------+
+ Messages --------------------------------------------------------------------+
|0:00:01 slide 1: 1.26 N, 10.0 mm/s                                            |
|0:00:03 slide 1: most likely Oak wood, 75.0 %                                 |";
    let plain = |letter: char| match letter {
        '╭' | '╮' | '╰' | '╯' => '+',
        '─' => '-',
        '│' => '|',
        '█' => '#',
        '░' => '.',
        '┃' => '!',
        letter => letter,
    };
    let shown: String = screen[10..22].join("\n").chars().map(plain).collect();
    assert_eq!(shown, golden);
    assert_eq!(
        screen[0],
        " Tactus  /dev/ttyACM0  4 textures (factory)            nothing lost, up 0:00:04"
    );
}

#[test]
fn an_answer_a_fault_and_silence_are_said_in_words() {
    let mut events = exploration();
    events.push(Event::Verdict(Verdict {
        texture: 1,
        name: "Oak wood".try_into().unwrap(),
        probability: 0.995,
        sure: true,
        slides: 1,
        ..Verdict::default()
    }));
    let mut monitor = heard(events.clone());
    assert!(
        screen(&monitor, 80, 24)
            .join("\n")
            .contains("it is Oak wood: 99.5 % after 1 slide")
    );
    events.push(Event::Fault(Fault::EStop));
    monitor = heard(events);
    let faulted = screen(&monitor, 80, 24);
    assert!(
        faulted[0].ends_with("FAULT: emergency stop"),
        "{}",
        faulted[0]
    );
    assert!(
        faulted
            .iter()
            .any(|line| line.contains("release it, then reset (key h)"))
    );
    monitor.silent = Some(Duration::from_secs(4));
    assert!(screen(&monitor, 80, 24)[0].ends_with("SILENT for 4 s"));
    // it is over when the rig has found its switches again
    monitor.hear(&Report {
        number: 9,
        at_ms: 9000,
        event: Event::Phase(Phase::Homing),
    });
    assert_eq!(monitor.status.fault, None);
    // what is lost on the line stands where everybody looks
    monitor.silent = None;
    monitor.losses = (2, 3);
    assert!(screen(&monitor, 80, 24)[0].contains("line 2 damaged 3 lost"));
}

#[test]
fn a_trace_reaches_both_ends_of_its_scale() {
    let blocks = (0..40u16).map(|number| {
        let sample = |n: u16| {
            let t = f64::from(number * 64 + n) / 2200.0;
            (200.0 * (std::f64::consts::TAU * 100.0 * t).sin()) as i16
        };
        Event::Block(Block {
            number,
            pac: (0..64).map(sample).collect(),
            ..Block::default()
        })
    });
    let monitor = heard(blocks);
    assert_eq!(monitor.pac.len(), SHOWN);
    let all = screen(&monitor, 80, 24).join("\n");
    assert!(all.contains(" 256│") && all.contains("-256│"), "{all}");
}

#[test]
fn any_size_of_terminal_is_drawn_on() {
    let mut events = exploration();
    events.extend((0..60).map(|n| {
        Event::Rejected {
            slide: n,
            why: Failure::Said(
                Text::try_from("a reason that is much too long for a narrow terminal, and goes on")
                    .unwrap(),
            ),
        }
    }));
    let monitor = heard(events);
    for (width, height) in [(1, 1), (10, 5), (40, 12), (80, 24), (140, 40), (300, 90)] {
        assert_eq!(screen(&monitor, width, height).len(), usize::from(height));
    }
    assert_eq!(monitor.notes.len(), NOTES);
}

#[test]
fn from_76_to_200_columns_nothing_lies_over_anything_else() {
    let mut monitor = heard(exploration());
    monitor.losses = (12, 345);
    for width in 76..=200 {
        for height in [21, 24, 34, 50] {
            let screen = screen(&monitor, width, height);
            let all = screen.join("\n");
            // what is wrong is whole, and the panels are
            let losses = "line 12 damaged 345 lost, slots 0 late 0 lost";
            assert!(screen[0].ends_with(losses), "{all}");
            let corners = |corner| all.matches(corner).count();
            assert_eq!((corners('╭'), corners('╯')), (4, 4), "{all}");
            for part in ["P_AC", "sliding", "Oak wood", "10.0 mm/s"] {
                assert!(all.contains(part), "{width} x {height}: no {part}\n{all}");
            }
            let keys = &screen[usize::from(height) - 1];
            for (key, what) in KEYS {
                assert!(keys.contains(&format!(" {key}  {what}")), "{keys}");
            }
        }
    }
    for (width, height) in [(75, 24), (80, 20), (30, 5)] {
        let all = screen(&monitor, width, height).join("\n");
        let said = format!("Too small: {width} x {height}.");
        assert!(all.contains(&said) && all.contains("76 x 21"), "{all}");
    }
}

#[test]
fn keys_ask_for_what_they_say() {
    let key = |code, with| KeyEvent::new(code, with);
    let plain = |c| key(KeyCode::Char(c), KeyModifiers::NONE);
    let of = |key| command_of(key, &Default::default());
    assert!(matches!(of(plain('i')), Some(Command::Identify(_))));
    assert_eq!(of(plain('h')), Some(Command::Home));
    for stops in [plain('s'), key(KeyCode::Esc, KeyModifiers::NONE)] {
        assert_eq!(of(stops), Some(Command::Stop));
    }
    let control_c = key(KeyCode::Char('c'), KeyModifiers::CONTROL);
    let ends = [plain('q'), control_c, plain('c')].map(end_of);
    assert_eq!(ends, [Some(End::Quit), Some(End::Interrupt), None]);
}

#[test]
fn what_was_stopped_is_shown_no_more() {
    let mut monitor = heard(exploration());
    let shown = |monitor: &Monitor| screen(monitor, 80, 24)[..19].join("\n");
    assert!(shown(&monitor).contains("Oak wood"));
    monitor.asked(&Command::Stop);
    // reports of it are still on the line
    for event in exploration() {
        monitor.hear(&Report {
            number: 9,
            at_ms: 9000,
            event,
        });
    }
    let screen = shown(&monitor);
    assert!(!screen.contains("Oak wood"), "{screen}");
    assert!(screen.contains("i: find out"), "{screen}");
    monitor.asked(&Command::Identify(Default::default()));
    monitor.hear(&Report {
        number: 10,
        at_ms: 9500,
        event: exploration().remove(0),
    });
    assert!(shown(&monitor).contains("the rig makes the first slide"));
}

#[test]
fn between_slides_the_trace_is_said_to_be_the_last_ones() {
    let block = Event::Block(Block {
        pac: (0..64).collect(),
        ..Block::default()
    });
    let mut events = vec![Event::Phase(Phase::Sliding), block];
    let sliding = heard(events.clone());
    assert!(screen(&sliding, 76, 21)[1].contains("P_AC, counts, 1 s"));
    events.push(Event::Phase(Phase::Lifting));
    let after = heard(events);
    assert!(screen(&after, 76, 21)[1].contains("P_AC of the last slide"));
}

#[test]
fn the_end_of_homing_is_told() {
    let monitor = heard([Event::Phase(Phase::Homing), Event::Phase(Phase::Ready)]);
    assert!(
        screen(&monitor, 80, 24)
            .join("\n")
            .contains("homed: the rig is ready")
    );
    // not after every slide
    let monitor = heard([Event::Phase(Phase::Lifting), Event::Phase(Phase::Ready)]);
    assert!(monitor.notes.is_empty());
}

#[cfg(unix)]
#[test]
fn a_terminal_that_is_closed_is_noticed() {
    let (terminal, other) = std::io::pipe().unwrap();
    assert!(!is_gone(&terminal));
    drop(other);
    assert!(is_gone(&terminal));
}
