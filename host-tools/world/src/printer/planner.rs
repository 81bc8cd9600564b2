//! The planner of a printer's motion: a queue of straight lines, acceleration, and look-ahead over the corners.

use std::collections::VecDeque;

use super::STEP_MM;
use crate::conditions::TICK_S;

/// Fastest, mm/s, and steepest change of it, mm/s^2, of each axis (Marlin's Ender 3: M203, M201).
const FASTEST_MM_S: [f64; 3] = [500.0, 500.0, 5.0];
const STEEPEST_MM_S2: [f64; 3] = [500.0, 500.0, 100.0];
/// Speed change that a corner may have at once, mm/s (Marlin: classic jerk of 10, 10 and 0.3).
const JERK_MM_S: [f64; 3] = [10.0, 10.0, 0.3];
/// Blocks of its queue (Marlin: BLOCK_BUFFER_SIZE).
const BLOCKS: usize = 16;
/// Fewer microsteps than these are kept until they add up (Marlin: MIN_STEPS_PER_SEGMENT).
const FEWEST_STEPS: f64 = 6.0;
/// Fastest at which motors that are stopped at once keep their steps, mm/s; beyond, they lose a full step or some
/// (chosen).
const KEEPS_STEPS_MM_S: f64 = 15.0;

#[derive(Clone, Debug)]
struct Block {
    from: [f64; 3],
    along: [f64; 3],
    length_mm: f64,
    made_mm: f64,
    fastest: f64,
    steepest: f64,
    /// Fastest at its begin, by the corner before it, and by what comes behind it.
    corner: f64,
    entry: f64,
}

/// A planner.
#[derive(Clone, Debug)]
pub(super) struct Planner {
    blocks: VecDeque<Block>,
    place: [f64; 3],
    /// Where it was told to go last.
    end: [f64; 3],
    speed: f64,
    direction: [f64; 3],
    /// Ticks until the first of the blocks begins.
    pub(super) waits: u64,
    /// All takes so many times as long.
    pub(super) slower: f64,
    /// It stands, whatever it has.
    pub(super) held: bool,
    /// Where the motors are behind what they were told, mm.
    pub(super) lost_mm: [f64; 3],
    /// The motors have their supply; without it, steps are lost.
    pub(super) powered: bool,
}

impl Default for Planner {
    fn default() -> Self {
        Self {
            blocks: VecDeque::new(),
            place: [0.0; 3],
            end: [0.0; 3],
            speed: 0.0,
            direction: [0.0; 3],
            waits: 0,
            slower: 1.0,
            held: false,
            lost_mm: [0.0; 3],
            powered: true,
        }
    }
}

impl Planner {
    /// Where it is now, mm.
    pub(super) fn place(&self) -> [f64; 3] {
        self.place
    }

    /// Where it will be when all is done, mm.
    pub(super) fn end(&self) -> [f64; 3] {
        self.end
    }

    pub(super) fn speeds(&self) -> [f64; 3] {
        self.direction.map(|along| along * self.speed)
    }

    pub(super) fn is_full(&self) -> bool {
        self.blocks.len() >= BLOCKS
    }

    pub(super) fn blocks(&self) -> usize {
        self.blocks.len()
    }

    pub(super) fn is_done(&self) -> bool {
        self.blocks.is_empty()
    }

    /// A straight line from the end of all others.
    pub(super) fn push(&mut self, to: [f64; 3], feed_mm_s: f64) {
        let from = self
            .blocks
            .back()
            .map_or(self.place, |b| at(b, b.length_mm));
        self.end = to;
        let way = [0, 1, 2].map(|n| to[n] - from[n]);
        let length_mm = way.iter().map(|mm| mm * mm).sum::<f64>().sqrt();
        let steps = way.iter().zip(STEP_MM).map(|(mm, step)| mm.abs() / step);
        if steps.fold(0.0, f64::max) < FEWEST_STEPS - 0.5 {
            return;
        }
        let along = way.map(|mm| mm / length_mm);
        let of = |most: [f64; 3]| {
            let each = along
                .iter()
                .zip(most)
                .map(|(a, most)| most / a.abs().max(1e-9));
            each.fold(f64::INFINITY, f64::min)
        };
        let fastest = feed_mm_s.max(0.05).min(of(FASTEST_MM_S));
        let corner = match self.blocks.back() {
            Some(last) => {
                let change = [0, 1, 2].map(|n| (along[n] - last.along[n]).abs());
                let each = change
                    .iter()
                    .zip(JERK_MM_S)
                    .map(|(c, most)| most / c.max(1e-9));
                each.fold(fastest.min(last.fastest), f64::min)
            }
            None => 0.0,
        };
        self.blocks.push_back(Block {
            from,
            along,
            length_mm,
            made_mm: 0.0,
            fastest,
            steepest: of(STEEPEST_MM_S2),
            corner,
            entry: 0.0,
        });
        // from the last one back: each must be able to slow down to the next
        let mut exit = 0.0;
        for block in self.blocks.iter_mut().rev() {
            let reaches = (exit * exit + 2.0 * block.steepest * block.length_mm).sqrt();
            block.entry = block.corner.min(reaches);
            exit = block.entry;
        }
    }

    /// Stands at once where it is, and drops what it has: at speed, motors lose steps.
    pub(super) fn stop(&mut self) {
        if self.speed > KEEPS_STEPS_MM_S {
            let lost = self.direction.map(|along| 0.2 * along.round());
            self.lost_mm = [0, 1, 2].map(|n| self.lost_mm[n] - lost[n]);
        }
        self.blocks.clear();
        (self.speed, self.end) = (0.0, self.place);
    }

    pub(super) fn tick(&mut self) {
        if self.waits > 0 {
            self.waits -= 1;
            return;
        }
        let exit = self.blocks.get(1).map_or(0.0, |next| next.entry);
        let Some(block) = self.blocks.front_mut() else {
            self.speed = 0.0;
            return;
        };
        let left = block.length_mm - block.made_mm;
        let most = (exit * exit + 2.0 * block.steepest * left).sqrt();
        let wanted = match self.held {
            true => 0.0,
            false => block.fastest.min(most),
        };
        let change = block.steepest * TICK_S;
        self.speed += (wanted - self.speed).clamp(-change, change);
        let made = self.speed * TICK_S / self.slower;
        // the last bit of a line that has slowed down
        block.made_mm += match wanted > 0.0 {
            true => made.max(change * TICK_S),
            false => made,
        };
        self.direction = block.along;
        let over = block.made_mm - block.length_mm;
        let place = at(block, block.made_mm.min(block.length_mm));
        if !self.powered {
            self.lost_mm = [0, 1, 2].map(|n| self.lost_mm[n] + self.place[n] - place[n]);
        }
        self.place = place;
        if over >= 0.0 {
            self.blocks.pop_front();
            match self.blocks.front_mut() {
                Some(next) => {
                    next.made_mm = over;
                    self.speed = self.speed.min(next.entry.max(next.steepest * TICK_S));
                }
                None => self.speed = 0.0,
            }
        }
    }
}

fn at(block: &Block, made_mm: f64) -> [f64; 3] {
    [0, 1, 2].map(|n| block.from[n] + block.along[n] * made_mm)
}
