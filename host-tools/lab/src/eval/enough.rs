//! Textures and movements with slides enough: a folder is not refused because one texture is short of them.

use tactus_core::features::Movement;

use crate::eval::show::count;

/// The fewest slides that show the spread of a texture's slides.
pub(super) const LEAST: usize = 2;

/// The textures and movements that are learned, and from how many slides.
#[derive(Clone, PartialEq, Debug)]
pub struct Enough {
    /// Indices of the textures.
    pub textures: Vec<usize>,
    /// The movements.
    pub movements: Vec<Movement>,
    /// Slides to learn from, of each texture at each movement.
    pub slides: usize,
    /// Omissions and lowered numbers, in sentences.
    pub notes: Vec<String>,
}

impl Enough {
    /// Chooses from textures of which `has` says how many slides each can be learned from at a movement. A movement at
    /// which less than half as many textures have two slides as at the best one is left out, then the textures
    /// that have fewer at another. The slides are `wanted`, or as many as more than half of these textures have, and
    /// the textures with less are left out. `None`: none has enough.
    pub fn of(
        names: &[String],
        movements: &[Movement],
        wanted: usize,
        has: impl Fn(usize, Movement) -> usize,
    ) -> Option<Self> {
        let all = 0..names.len();
        let covers = |movement: &Movement| {
            let can = all
                .clone()
                .filter(|&texture| has(texture, *movement) >= LEAST);
            can.count()
        };
        let best = movements
            .iter()
            .map(covers)
            .max()
            .filter(|&best| best > 0)?;
        let (kept, dropped): (Vec<Movement>, Vec<Movement>) = movements
            .iter()
            .partition(|movement| 2 * covers(movement) >= best);
        let fewest = |texture| kept.iter().map(|&m| has(texture, m)).min().unwrap_or(0);
        let mut there: Vec<usize> = all.clone().map(fewest).filter(|n| *n >= LEAST).collect();
        there.sort_unstable_by(|a, b| b.cmp(a));
        let slides = (*there.get(there.len() / 2)?).min(wanted);
        let (textures, short): (Vec<usize>, Vec<usize>) =
            all.partition(|&texture| fewest(texture) >= slides);
        let mut notes = Vec::new();
        if !dropped.is_empty() {
            let dropped: Vec<String> = dropped.iter().map(Movement::to_string).collect();
            let dropped = dropped.join(", ");
            notes.push(format!(
                "Left out, as few textures have slides there: {dropped}."
            ));
        }
        if slides < wanted {
            notes.push(format!(
                "Learned from {} in place of {wanted}: half of the textures or more have no more.",
                count(slides as u64, "slide")
            ));
        }
        if !short.is_empty() {
            let short: Vec<&str> = short
                .iter()
                .map(|&texture| names[texture].as_str())
                .collect();
            notes.push(format!(
                "Left out, with too few slides: {}.",
                short.join(", ")
            ));
        }
        Some(Self {
            textures,
            movements: kept,
            slides,
            notes,
        })
    }
}
