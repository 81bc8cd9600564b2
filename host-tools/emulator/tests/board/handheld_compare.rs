//! "Is it the same as that one?", asked of the real ELF of the handheld by its button alone: judged by what lies under
//! the finger, from the display and the go / no-go output.

use tactus_core::table::Table;
use tactus_lab::sim::scenario::texture;
use tactus_world::person::Manner;

use crate::handheld_link::{Held, shows};

/// The reference's place in the list.
const REFERENCE: u16 = 2;

#[test]
#[ignore = "long"]
fn a_texture_is_compared_with_one_that_is_chosen_by_the_button() {
    let Some(mut held) = Held::new("burlap", Manner::default()) else {
        return;
    };
    let bytes = held.table();
    let table = Table::read(&bytes).unwrap();
    let name = table.name(REFERENCE).unwrap();
    let world = |held: &mut Held, name: &str| {
        let number = texture(name).unwrap();
        held.talk.board().rig().world().place(number).unwrap();
    };
    let same = |held: &mut Held| held.talk.board().go().unwrap();
    world(&mut held, name);
    held.take("is it the same as ..?", 0);
    held.until("the list", 1.0, |board| shows(board, "Same as"));
    (0..REFERENCE).for_each(|_| held.click());
    let place = format!("{} of {}", REFERENCE + 1, table.textures() + 1);
    held.until("its place", 1.0, |board| {
        shows(board, &place) && shows(board, name)
    });
    held.press_for(700);
    assert!(!same(&mut held));
    // its own sample
    held.slide_until("It feels like");
    assert!(shows(held.talk.board(), "Same") && shows(held.talk.board(), name));
    assert!(same(&mut held));
    // another one: the output falls when it is touched, and stays low
    world(&mut held, "burlap");
    held.touch();
    assert!(!same(&mut held));
    held.until("the answer", 60.0, |board| {
        shows(board, "It does not feel like")
    });
    held.rest();
    assert!(shows(held.talk.board(), "Different") && shows(held.talk.board(), name));
    assert!(!same(&mut held));
    // the first one again, with no other question in between
    world(&mut held, name);
    held.slide_until("It feels like");
    assert!(same(&mut held));
    // another reference, from where the list was left
    held.press_for(700);
    held.until("the list", 1.0, |board| {
        shows(board, "Same as") && shows(board, &place)
    });
    held.click();
    held.press_for(700);
    assert!(!same(&mut held));
    held.slide_until("It does not feel like");
    assert!(shows(held.talk.board(), table.name(REFERENCE + 1).unwrap()));
    // and the end: the probe identifies as before, and has learned nothing
    held.press_for(100);
    held.until("ready", 5.0, |board| shows(board, "and hold"));
    held.slide_until("teach");
    assert!(!same(&mut held));
    assert_eq!(held.table(), bytes);
    held.end();
}
