//! Degrees of confusion that are kept: constants of table and candidates, computed once instead of at every decision.
//! A PC has the memory for them; a chip has not, and its image has none of this.

use heapless::Vec;

use super::choice::{ExpectedOutcome, benefit};
use super::config::{Method, NEGLIGIBLE};
use super::gaussians::{self, LiveGaussian, LiveTexture, confuse_with, left};
use super::likeness::{self, Candidate};
use super::posterior::{Explorer, LEAST};
use crate::table::{Action, MAX_ACTIONS};

/// Actions side by side in [`Degrees`].
const LANES: usize = 4;
/// Textures side by side: their sums do not wait for each other.
const ROWS: usize = 4;

/// Degrees of confusion of two textures by some actions (eq. 7).
pub type Degrees = [f32; LANES];

/// Degrees of confusion of every two candidates of an explorer by each of its actions, in memory that the caller
/// brings. They serve every explorer of the same table, candidates and method: [`Explorer::expected_outcomes_by`].
#[derive(Clone, Copy, Debug)]
pub struct Confusions<M> {
    /// Square matrices, one for every few actions, and below each a row of what every texture has to do with its own
    /// degrees (`LiveGaussian`'s root). A texture with itself has 0: eq. 10 leaves it out.
    matrices: M,
    textures: usize,
}

impl<M: AsRef<[Degrees]> + AsMut<[Degrees]>> Confusions<M> {
    /// How much memory those of an explorer take.
    pub fn len_for<const N: usize>(explorer: &Explorer<'_, N>) -> usize {
        let textures = explorer.posterior.len();
        explorer.actions.len().div_ceil(LANES) * textures * (textures + 1)
    }

    /// Computes them; `None` where the memory is not as large as [`Confusions::len_for`] says.
    pub fn new<const N: usize>(explorer: &Explorer<'_, N>, mut memory: M) -> Option<Self> {
        let all = memory.as_mut();
        if all.len() != Self::len_for(explorer) {
            return None;
        }
        all.fill([0.0; LANES]);
        let textures = explorer.posterior.len();
        let matrices = all.chunks_exact_mut(textures * (textures + 1));
        for (matrix, actions) in matrices.zip(explorer.actions.chunks(LANES)) {
            let own = textures * textures;
            matrix
                .iter_mut()
                .skip(own)
                .for_each(|roots| *roots = [1.0; LANES]);
            for (lane, action) in actions.iter().enumerate() {
                explorer.confuse_all(*action, |a, b, degree| {
                    let at = match b {
                        Some(b) => [a * textures + b, b * textures + a],
                        None => [own + a; 2],
                    };
                    for at in at {
                        let degrees = matrix.get_mut(at);
                        if let Some(slot) = degrees.and_then(|degrees| degrees.get_mut(lane)) {
                            *slot = degree;
                        }
                    }
                });
            }
        }
        Some(Self {
            matrices: memory,
            textures,
        })
    }
}

impl<const N: usize> Explorer<'_, N> {
    /// As [`Explorer::expected_outcomes`], to the bit, by degrees of confusion that were computed before: of an
    /// explorer of the same table, candidates and method.
    pub fn expected_outcomes_by(
        &self,
        confusions: &Confusions<impl AsRef<[Degrees]>>,
    ) -> Vec<ExpectedOutcome, MAX_ACTIONS> {
        if self.slides == 0 {
            return self.expected_outcomes();
        }
        // filled where it lies, and not moved: it is large
        let mut live: Vec<(u16, f32), N> = Vec::new();
        for (&probability, texture) in self.posterior.iter().zip(0..) {
            if probability >= NEGLIGIBLE {
                // `live` has space: it is as long as the posterior
                let _ = live.push((texture, probability));
            }
        }
        let textures = confusions.textures;
        let matrices = confusions.matrices.as_ref();
        let matrices = matrices.chunks_exact((textures * (textures + 1)).max(1));
        let mut weights: Vec<[Degrees; 2], N> = Vec::new();
        let uncertainty = matrices.flat_map(|matrix| {
            weights.clear();
            let (degrees, roots) = matrix
                .split_at_checked(textures * textures)
                .unwrap_or_default();
            for &(texture, probability) in &live {
                let roots = roots.get(usize::from(texture)).copied().unwrap_or_default();
                // `weights` has space: it is as long as `live`
                let _ = weights.push([roots.map(|root| probability * root), roots]);
            }
            uncertainty(degrees, textures, &live, &weights)
        });
        let actions = self.actions.iter().zip(&self.made).zip(uncertainty);
        actions
            .map(|((&action, &made), uncertainty)| ExpectedOutcome {
                action,
                uncertainty,
                benefit: benefit(uncertainty, made),
            })
            .collect()
    }

    /// Passes `tell` the degree of confusion of every two candidates by an action, as a decision computes it: that
    /// adds it to both, times a probability that is 1 here; and a candidate's own root, where it has one.
    fn confuse_all(&self, action: Action, mut tell: impl FnMut(usize, Option<usize>, f32)) {
        let is_candidate = |log: &i32| *log >= LEAST;
        let certain: Vec<f32, N> = self
            .log
            .iter()
            .map(|l| if is_candidate(l) { 1.0 } else { 0.0 })
            .collect();
        let candidates = self.log.iter().zip(0..).filter(|(l, _)| is_candidate(l));
        let candidates: Vec<u16, N> = candidates.map(|(_, texture)| texture).collect();
        let method = self.config.method;
        if method == Method::Fused {
            let mut live: Vec<Candidate, N> = Vec::new();
            likeness::gather(&self.table, action.movement, &certain, &mut live);
            confuse_each(
                &mut live,
                &candidates,
                likeness::confuse,
                |c| &mut c.confused,
                tell,
            );
        } else if let Some(property) = self.only_property(action) {
            let mut live: Vec<LiveGaussian, N> = Vec::new();
            let action = Action::of(action.movement, property);
            self.gather_one(method, action, &certain, &mut live);
            for (c, texture) in live.iter_mut().zip(&candidates) {
                tell(usize::from(*texture), None, c.root);
                c.weight = 1.0;
            }
            confuse_each(
                &mut live,
                &candidates,
                gaussians::confuse,
                |c| &mut c.confused,
                tell,
            );
        } else {
            let mut live: Vec<LiveTexture, N> = Vec::new();
            self.gather(action, &certain, &mut live);
            let properties = self.measured.iter().count();
            let confuse = |a: &mut LiveTexture, others: &mut [LiveTexture]| {
                confuse_with(a, others, properties);
            };
            confuse_each(&mut live, &candidates, confuse, |c| &mut c.confused, tell);
        }
    }
}

/// Confuses each of `live` with those after it, and tells by how much.
fn confuse_each<L>(
    live: &mut [L],
    textures: &[u16],
    confuse: impl Fn(&mut L, &mut [L]),
    confused: impl Fn(&mut L) -> &mut f32,
    mut tell: impl FnMut(usize, Option<usize>, f32),
) {
    let (mut rest, mut textures) = (live, textures);
    while let (Some((a, others)), Some((of_a, after))) =
        (rest.split_first_mut(), textures.split_first())
    {
        confuse(a, others);
        for (b, of_b) in others.iter_mut().zip(after) {
            let degree = core::mem::take(confused(b));
            tell(usize::from(*of_a), Some(usize::from(*of_b)), degree);
        }
        (rest, textures) = (others, after);
    }
}

/// Uncertainty that is expected to remain (eq. 10) by each of some actions, of which this is the matrix, when these
/// textures are that probable, and have these weights and roots.
#[inline(never)]
fn uncertainty(
    matrix: &[Degrees],
    textures: usize,
    live: &[(u16, f32)],
    weights: &[[Degrees; 2]],
) -> Degrees {
    let mut all = [0.0; LANES];
    for (some, own) in live.chunks(ROWS).zip(weights.chunks(ROWS)) {
        let rows = core::array::from_fn(|row| {
            // where there are fewer, the first of them again
            let (texture, _) = some.get(row).or(some.first())?;
            matrix
                .get(usize::from(*texture) * textures..)?
                .get(..textures)
        });
        let [Some(a), Some(b), Some(c), Some(d)] = rows else {
            continue;
        };
        // What is added, and in which order, is as where degrees are computed: those before a texture, then those
        // after it.
        let mut confused = [[0.0; LANES]; ROWS];
        for (&(texture, _), [weights, _]) in live.iter().zip(weights) {
            for (confused, row) in confused.iter_mut().zip([a, b, c, d]) {
                let Some(degrees) = row.get(usize::from(texture)) else {
                    continue;
                };
                for ((sum, degree), weight) in confused.iter_mut().zip(degrees).zip(weights) {
                    *sum += degree * weight;
                }
            }
        }
        for ([weights, roots], confused) in own.iter().zip(confused) {
            let own = weights.iter().zip(roots);
            for ((sum, confused), (weight, root)) in all.iter_mut().zip(confused).zip(own) {
                *sum += left(*weight, *root, confused);
            }
        }
    }
    all
}
