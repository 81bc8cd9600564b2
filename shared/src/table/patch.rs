//! Changing a table where it lies: as many bytes as before.

use heapless::Vec;

use super::encode::EncodeError;
use super::format::{Contents, LABEL_BYTES, Tally};
use super::gaussian::{SD_STEP, mean_step};
use super::lengths::MAX_LENGTHS;
use super::training_stats::{Experience, Whitened};
use super::view::Table;
use super::whitening::Whitening;
use crate::CRC32;
use crate::features::Property;

/// Puts what a fused table has learned on the go of a texture at a movement in its place, and marks the table as made
/// from the one that it was.
/// Errors: the bytes are no fused table, or have no such texture or movement.
#[inline]
pub fn retell(
    bytes: &mut [u8],
    texture: u16,
    movement: u8,
    whitened: &Whitened,
    tally: Tally,
) -> Result<(), EncodeError> {
    let table = Table::read_first(bytes).map_err(EncodeError::Invalid)?;
    let Contents::Fused(_, features) = table.contents else {
        return Err(EncodeError::Contents);
    };
    if texture >= table.textures || movement >= table.movements {
        return Err(EncodeError::Texture(texture));
    }
    let (layout, lineage) = (table.layout(), table.lineage());
    let length = table.bytes.len();
    let features = usize::from(features);
    let cell = usize::from(texture) * usize::from(table.movements) + usize::from(movement);
    let mut put = |at: usize, new: &[u8]| {
        // byte by byte: `copy_from_slice` has a panic that the compiler does not always see through
        for (to, from) in bytes.iter_mut().skip(at).zip(new) {
            *to = *from;
        }
    };
    for (mean, at) in whitened.mean.iter().take(features).zip((0..).step_by(2)) {
        put(layout.cells + cell * 2 * features + at, &mean.to_le_bytes());
    }
    put(layout.trials + cell, &[whitened.slides]);
    put(layout.lineage, &lineage.to_le_bytes());
    let label = layout.labels + usize::from(texture) * LABEL_BYTES;
    put(label + 2, &[tally.factory, tally.user, tally.itself]);
    if let Some((body, crc)) = bytes
        .get_mut(..length)
        .and_then(<[u8]>::split_last_chunk_mut)
    {
        *crc = CRC32.checksum(body).to_le_bytes();
    }
    Ok(())
}

impl Table<'_> {
    /// The statistics of a texture at a movement, to go on from; the table holds them rounded.
    pub fn experience(&self, texture: u16, movement: u8) -> Experience {
        let trials = self.trials(texture, movement);
        if trials == 0 {
            return Experience::default();
        }
        let mut experience = Experience {
            trials,
            ..Experience::default()
        };
        for (property, (mean, squares)) in Property::ALL
            .into_iter()
            .zip(experience.mean.iter_mut().zip(&mut experience.squares))
        {
            let (m, sd) = self.cell(texture, movement, property).unwrap_or_default();
            let sd = f32::from(sd) * SD_STEP;
            *mean = f32::from(m) * mean_step(property);
            *squares = sd * sd * f32::from(trials - 1);
        }
        experience
    }
}

/// Puts other features in the place of those that are whitened to 0 at a movement: what was learned keeps its place
/// among the whitened, and slides that differ from those of before by as much are whitened as those were. Of shorter
/// slides nothing is known of that movement then.
/// Errors: the bytes are no fused table of so many features, or have no such movement.
pub fn recentre(bytes: &mut [u8], movement: u8, centre: &[i16]) -> Result<(), EncodeError> {
    let table = Table::read(bytes).map_err(EncodeError::Invalid)?;
    let Contents::Fused(_, features) = table.contents else {
        return Err(EncodeError::Contents);
    };
    let features = usize::from(features);
    if movement >= table.movements || centre.len() != features {
        return Err(EncodeError::Contents);
    }
    let at = table.layout().whitenings + usize::from(movement) * Whitening::bytes(features);
    let movements = usize::from(table.movements);
    let cells = usize::from(table.textures) * movements;
    let shorter: Vec<usize, MAX_LENGTHS> = crate::up_to(table.trials_of_lengths());
    let new = centre.iter().flat_map(|x| x.to_le_bytes());
    for (to, from) in bytes.iter_mut().skip(at).zip(new) {
        *to = from;
    }
    for trials in shorter {
        let of_all = bytes.iter_mut().skip(trials).take(cells);
        for trials in of_all.skip(movement.into()).step_by(movements) {
            *trials = 0;
        }
    }
    if let Some((body, crc)) = bytes.split_last_chunk_mut() {
        *crc = CRC32.checksum(body).to_le_bytes();
    }
    Ok(())
}
