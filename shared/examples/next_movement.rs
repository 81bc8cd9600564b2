//! Choose the next movement: what each movement is expected to leave, and which one has the greatest benefit.
//!
//! `cargo run -p tactus-core --example next_movement`

use tactus_core::explorer::{Config, Explorer, Method};
use tactus_core::features::PropertySet;
use tactus_core::table::{Table, factory};

pub(crate) fn main() {
    // 117 simulated textures at three movements
    let table = Table::read(factory::RIG).expect("the factory's table is whole");
    let config = Config {
        method: Method::of(table.contents()),
        ..Config::default()
    };
    // all textures are equally probable in the beginning; `Explorer::among` takes some of them
    let explorer = Explorer::<'_, 128>::new(table, PropertySet::ALL, config).expect("it fits");
    println!("{} textures", table.textures());

    let outcomes = explorer.expected_outcomes();
    for action in &outcomes {
        let movement = table
            .movement(action.action.movement)
            .expect("of the table");
        println!(
            "{:.2} N at {:.1} mm/s leaves {:5.2} % uncertainty, benefit {:.3}",
            movement.force_n(),
            movement.speed_mm_s(),
            100.0 * action.uncertainty,
            action.benefit
        );
    }
    let next = explorer.choose(&outcomes, 0);
    println!("next: movement {} of the table", next.movement + 1);
}
