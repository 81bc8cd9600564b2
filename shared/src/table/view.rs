//! Reading a table where it is stored.

use heapless::Vec;

use super::format::{
    Action, CELL_BYTES, CRC_BYTES, Contents, DRIFT, HEADER, LABEL_BYTES, LENGTH, Layout, MAGIC,
    MAX_MOVEMENTS, MAX_TEXTURES, MOVEMENT_BYTES, MS, TWO, TableError, Tally, VERSION, array, each,
};
use super::gaussian::{Gaussian, Gaussians, SD_LEAST, SD_STEP, mean_step};
use super::name::valid_name;
use super::training_stats::Whitened;
use super::whitening::{Column, View, Whitening};
use crate::CRC32;
use crate::features::{MAX_FEATURES, Movement, Property, PropertySet, Vector};

/// A checked texture table, borrowed from where it is stored.
#[derive(Clone, Copy, Debug)]
pub struct Table<'a> {
    pub(super) bytes: &'a [u8],
    pub(super) textures: u16,
    pub(super) movements: u8,
    pub(super) contents: Contents,
    /// The bytes behind the names.
    pub(super) sections: &'a [u8],
    /// Variances of the drift of every movement; none where there is no drift.
    pub(super) drifts: &'a [u8],
    /// The section of limits and population; nothing in a table that is not calibrated.
    pub(super) novelty: &'a [u8],
    /// The section of slopes; nothing in a table that knows no speeds.
    pub(super) slopes: &'a [u8],
}

/// The table of one of the shorter lengths, where it lies.
#[derive(Clone, Copy)]
pub(super) struct Length<'a> {
    pub(super) ms: u16,
    /// Its table, without names and numbers.
    pub(super) table: Table<'a>,
    /// The bytes behind the trials.
    pub(super) rest: &'a [u8],
}

impl<'a> Table<'a> {
    /// Checks a table of which these are all bytes, and borrows it. None takes long: textures are counted before
    /// they are compared. Errors: the first check that failed.
    pub fn read(bytes: &'a [u8]) -> Result<Self, TableError> {
        let table = Self::read_first(bytes)?;
        match bytes.len() - table.bytes.len() {
            0 => Ok(table),
            more => Err(TableError::Behind(more)),
        }
    }

    /// As [`Table::read`], of the table at the beginning of a buffer.
    pub(crate) fn read_first(bytes: &'a [u8]) -> Result<Self, TableError> {
        let truncated = |wanted| TableError::Truncated {
            got: bytes.len(),
            wanted,
        };
        let header: [u8; HEADER] = array(bytes, 0).ok_or(truncated(HEADER))?;
        let length = Self::length_of_header(&header)?;
        let textures = array(&header, 12).map_or(0, u16::from_le_bytes);
        let [code, what] = array(&header, 6).unwrap_or_default();
        let [movements, features] = array(&header, 14).unwrap_or_default();
        let bytes = bytes.get(..length).ok_or(truncated(length))?;
        let (body, stored) = bytes.split_last_chunk().ok_or(TableError::Length {
            header: length,
            contents: HEADER,
        })?;
        let (stored, computed) = (u32::from_le_bytes(*stored), CRC32.checksum(body));
        if stored != computed {
            return Err(TableError::Crc { stored, computed });
        }
        let contents = Contents::from_codes([code, what, features])?;
        if textures == 0 || movements == 0 || usize::from(movements) > MAX_MOVEMENTS {
            return Err(TableError::Header);
        }
        if usize::from(textures) > MAX_TEXTURES {
            return Err(TableError::Textures(textures));
        }
        let mut table = Self {
            bytes,
            textures,
            movements,
            contents,
            sections: &[],
            drifts: &[],
            novelty: &[],
            slopes: &[],
        };
        let end = table.check()?;
        table.sections = body.get(end..).unwrap_or_default();
        table.check_sections()?;
        table.find_sections();
        let lengths = table.count_lengths();
        let lengths = lengths.ok_or(TableError::Section(LENGTH))?;
        if lengths > 0 && table.is_paced() {
            return Err(TableError::Section(LENGTH));
        }
        Ok(table)
    }

    /// The length of the table that begins with this header. Errors: it is no table's.
    fn length_of_header(header: &[u8; HEADER]) -> Result<usize, TableError> {
        let magic = array(header, 0).unwrap_or_default();
        if magic != MAGIC {
            return Err(TableError::Magic(magic));
        }
        let version = array(header, 4).map_or(0, u16::from_le_bytes);
        if version != VERSION {
            return Err(TableError::Version(version));
        }
        Ok(array(header, 8).map_or(0, u32::from_le_bytes) as usize)
    }

    /// Checks that a table of `wanted` bytes may begin with this header.
    pub(crate) fn check_header(header: &[u8; HEADER], wanted: usize) -> Result<(), TableError> {
        let length = Self::length_of_header(header)?;
        let textures = array(header, 12).map_or(0, u16::from_le_bytes);
        match length == wanted {
            false => Err(TableError::Length {
                header: length,
                contents: wanted,
            }),
            true if usize::from(textures) > MAX_TEXTURES => Err(TableError::Textures(textures)),
            true => Ok(()),
        }
    }

    #[inline]
    fn check(&self) -> Result<usize, TableError> {
        let mut at = self.layout().names;
        let length = |end| TableError::Length {
            header: self.bytes.len(),
            contents: end + CRC_BYTES,
        };
        if at + CRC_BYTES > self.bytes.len() {
            return Err(length(at));
        }
        for index in 0..self.movements {
            let (force_mn, speed_um_s) = self.stored_movement(index).ok_or(length(at))?;
            let movement = Movement::stored(force_mn, speed_um_s)
                .map_err(|why| TableError::Movement(index, why))?;
            if self.movements().take(index.into()).any(|m| m == movement) {
                return Err(TableError::TwinMovement(index));
            }
        }
        self.check_cells()?;
        let numbers = (0..self.textures).map(|texture| self.number(texture).into());
        if let Some(texture) = twins(numbers).first() {
            return Err(TableError::Number(*texture));
        }
        for texture in 0..self.textures {
            let (name, next) = self.name_at(at).map_err(length)?;
            let text = core::str::from_utf8(name).map_err(|_| TableError::Name(texture))?;
            valid_name(text).map_err(|why| TableError::Unnamed(texture, why))?;
            at = next;
        }
        let sums = self.names().map(|name| CRC32.checksum(name.as_bytes()));
        for texture in twins(sums) {
            let mut before = self.names().take(texture.into());
            if before.any(|other| self.name(texture) == Some(other)) {
                return Err(TableError::Name(texture));
            }
        }
        Ok(at)
    }

    /// That the cells of every movement can be compared with slides.
    #[inline(always)]
    pub(super) fn check_cells(&self) -> Result<(), TableError> {
        match self.contents {
            Contents::Gaussians(measured) => self.check_deviations(measured),
            Contents::Fused(..) => {
                let broken = (0..self.movements).find(|&m| self.whitening(m).is_none());
                broken.map_or(Ok(()), |m| Err(TableError::Whitening(m)))
            }
        }
    }

    #[inline]
    fn check_deviations(&self, measured: PropertySet) -> Result<(), TableError> {
        const LEAST: u16 = (SD_LEAST / SD_STEP) as u16;
        for texture in 0..self.textures {
            for movement in (0..self.movements).filter(|&m| self.trials(texture, m) >= 2) {
                for property in measured.iter() {
                    let cell = self.cell(texture, movement, property);
                    if cell.is_none_or(|(_, sd)| sd < LEAST) {
                        let action = Action::of(movement, property);
                        return Err(TableError::Deviation { texture, action });
                    }
                }
            }
        }
        Ok(())
    }

    pub(super) fn layout(&self) -> Layout {
        self.contents
            .layout(self.textures.into(), self.movements.into())
    }

    pub(super) fn section(&self, wanted: u16) -> Option<&'a [u8]> {
        let mut each = each(self.sections).flatten();
        each.find_map(|(kind, contents)| (kind == wanted).then_some(contents))
    }

    pub(super) fn lengths(&self) -> impl Iterator<Item = Length<'a>> + Clone + use<'a> {
        let table = *self;
        let sections = each(self.sections)
            .flatten()
            .filter(|(kind, _)| *kind == LENGTH);
        sections.map_while(move |(_, contents)| table.length_of(contents))
    }

    /// The contents of a section of kind 6; `None` where it is too short.
    pub(super) fn length_of(&self, contents: &'a [u8]) -> Option<Length<'a>> {
        let (ms, bytes) = contents.split_first_chunk::<MS>()?;
        let rest = bytes.get(self.layout().lineage..)?;
        let drift = self.section(DRIFT).map_or(0, <[u8]>::len);
        let (drifts, novelty) = rest.split_at_checked(drift)?;
        let drifts = drifts.get(TWO..).filter(|_| !self.drifts.is_empty());
        let table = Table {
            bytes,
            sections: &[],
            drifts: drifts.unwrap_or_default(),
            novelty,
            slopes: &[],
            ..*self
        };
        let ms = u16::from_le_bytes(*ms);
        Some(Length { ms, table, rest })
    }

    /// The table of the length that a movement stands for, this one for whole slides, and which of its movements that
    /// is; `None` outside.
    #[inline]
    pub(super) fn at(&self, movement: u8) -> Option<(Table<'a>, u8)> {
        match movement < self.movements {
            true => Some((*self, movement)),
            false => self.find_shorter(movement),
        }
    }

    /// Once in the image, not wherever a table is read.
    #[cold]
    #[inline(never)]
    fn find_shorter(&self, movement: u8) -> Option<(Table<'a>, u8)> {
        let number = movement.checked_div(self.movements)?.checked_sub(1)?;
        let length = self.lengths().nth(number.into())?;
        Some((length.table, movement % self.movements))
    }

    fn place(&self, texture: u16, movement: u8) -> Option<usize> {
        let place = usize::from(texture) * usize::from(self.movements) + usize::from(movement);
        (texture < self.textures).then_some(place)
    }

    fn stored_movement(&self, index: u8) -> Option<(u16, u32)> {
        let at = HEADER + usize::from(index) * MOVEMENT_BYTES;
        Some((
            u16::from_le_bytes(array(self.bytes, at)?),
            u32::from_le_bytes(array(self.bytes, at + 2)?),
        ))
    }

    pub(super) fn cell_bytes(&self, texture: u16, movement: u8) -> Option<&'a [u8]> {
        let (table, movement) = self.at(movement)?;
        let (_, cell) = table.contents.sizes();
        let at = table.layout().cells + table.place(texture, movement)? * cell;
        table.bytes.get(at..)?.get(..cell)
    }

    pub(super) fn cell(
        &self,
        texture: u16,
        movement: u8,
        property: Property,
    ) -> Option<(i16, u16)> {
        if !self.measured().contains(property) {
            return None;
        }
        let cells = self.cell_bytes(texture, movement)?;
        let [m0, m1, s0, s1] = array(cells, property.index() * CELL_BYTES)?;
        Some((i16::from_le_bytes([m0, m1]), u16::from_le_bytes([s0, s1])))
    }

    /// The bytes of the name at `at`, and where the next one begins; the checksum is no name.
    /// Errors: the error is the end that the name would have.
    fn name_at(&self, at: usize) -> Result<(&'a [u8], usize), usize> {
        let (body, _) = self.bytes.split_last_chunk::<CRC_BYTES>().ok_or(at)?;
        let end = at + 1 + usize::from(*body.get(at).ok_or(at + 1)?);
        Ok((body.get(at + 1..end).ok_or(end)?, end))
    }

    /// Number of textures.
    pub fn textures(&self) -> u16 {
        self.textures
    }

    /// The kind of data that the table holds of a texture.
    pub fn contents(&self) -> Contents {
        self.contents
    }

    /// The properties that there are Gaussians of.
    pub fn measured(&self) -> PropertySet {
        match self.contents {
            Contents::Gaussians(measured) => measured,
            Contents::Fused(..) => PropertySet::default(),
        }
    }

    /// The movements, in the order of [`Action::movement`].
    pub fn movements(&self) -> impl ExactSizeIterator<Item = Movement> + use<'_, 'a> {
        (0..self.movements).map(|index| {
            self.movement(index).unwrap_or(Movement::FOR_ROUGHNESS) // `read` has checked them all
        })
    }

    /// The movement with this index.
    pub fn movement(&self, index: u8) -> Option<Movement> {
        let (force_mn, speed_um_s) = self
            .stored_movement(index)
            .filter(|_| index < self.movements)?;
        Movement::stored(force_mn, speed_um_s).ok()
    }

    /// All (movement, property) pairs that there are Gaussians of, movement by movement, properties in the order of
    /// [`Property::ALL`].
    pub fn actions(&self) -> impl Iterator<Item = Action> + use<> {
        let measured = self.measured();
        (0..self.movements).flat_map(move |movement| {
            measured
                .iter()
                .map(move |property| Action::of(movement, property))
        })
    }

    /// The names, in the order of the textures' indices.
    pub fn names(&self) -> impl Iterator<Item = &'a str> + Clone + use<'a> {
        let table = *self;
        let mut at = self.layout().names;
        (0..self.textures).map_while(move |_| {
            let (name, next) = table.name_at(at).ok()?;
            at = next;
            core::str::from_utf8(name).ok()
        })
    }

    /// The name of a texture.
    pub fn name(&self, texture: u16) -> Option<&'a str> {
        self.names().nth(texture.into())
    }

    /// The texture with this name.
    pub fn find(&self, name: &str) -> Option<u16> {
        self.names()
            .zip(0..)
            .find_map(|(other, texture)| (other == name).then_some(texture))
    }

    /// Number of trials that a texture was learned from at a movement, 255 for more.
    pub fn trials(&self, texture: u16, movement: u8) -> u8 {
        let trials = self.at(movement).and_then(|(table, movement)| {
            let at = table.layout().trials + table.place(texture, movement)?;
            table.bytes.get(at).copied()
        });
        trials.unwrap_or(0)
    }

    /// The expected distribution of a property of a texture; `None` where fewer than two trials were made, for a
    /// property that was not measured, and outside the table.
    pub fn gaussian(&self, texture: u16, action: Action) -> Option<Gaussian> {
        self.gaussians(action).get(texture.into())
    }

    /// [`Table::gaussian`] of every texture, for those who ask for many.
    pub fn gaussians(&self, action: Action) -> Gaussians<'a> {
        let property = action.property.filter(|p| self.measured().contains(*p));
        let found = self.at(action.movement).zip(property);
        let cells = found.and_then(|((table, movement), property)| {
            let layout = table.layout();
            let (_, cell) = table.contents.sizes();
            let at = layout.cells + usize::from(movement) * cell + property.index() * CELL_BYTES;
            table.bytes.get(at..layout.trials)
        });
        let (trials, movements) = self.trials_at(action.movement);
        let (_, cell) = self.contents.sizes();
        Gaussians {
            cells: cells.unwrap_or_default(),
            trials,
            movements,
            stride: cell * movements,
            step: property.map_or(0.0, mean_step),
        }
    }

    pub(super) fn features(&self) -> usize {
        match self.contents {
            Contents::Fused(_, features) => features.into(),
            Contents::Gaussians(_) => 0,
        }
    }

    /// [`Table::trials`] of every texture, the first at the beginning, and how far one is from the next; none outside
    /// the table.
    pub(super) fn trials_at(&self, movement: u8) -> (&'a [u8], usize) {
        let trials = self.at(movement).and_then(|(table, movement)| {
            let layout = table.layout();
            let at = layout.trials + usize::from(movement);
            table.bytes.get(at..layout.lineage)
        });
        (trials.unwrap_or_default(), self.movements.into())
    }

    /// The whitened means at a movement; none in a table of Gaussians and outside the table.
    pub(crate) fn column(&self, movement: u8) -> Column<'a> {
        let (_, cell) = self.contents.sizes();
        let means = self.at(movement).and_then(|(table, movement)| {
            let layout = table.layout();
            let at = layout.cells + usize::from(movement) * cell;
            table.bytes.get(at..layout.trials)
        });
        let means = means.filter(|_| self.features() > 0);
        let (slides, movements) = self.trials_at(movement);
        Column {
            means: means.unwrap_or_default(),
            stride: cell * movements,
            slides,
            movements,
        }
    }

    /// The whitening of features at a movement; `None` in a table of Gaussians and outside the table.
    pub fn whitening(&self, movement: u8) -> Option<Whitening> {
        let View { features, bytes } = self.whitening_at(movement)?;
        Whitening::read(bytes, features)
    }

    fn whitening_at(&self, movement: u8) -> Option<View<'a>> {
        let Contents::Fused(_, features) = self.contents else {
            return None;
        };
        let (table, movement) = self.at(movement)?;
        let features = usize::from(features);
        let length = Whitening::bytes(features);
        let at = table.layout().whitenings + usize::from(movement) * length;
        let bytes = table.bytes.get(at..)?.get(..length)?;
        Some(View { features, bytes })
    }

    /// The whitened mean of a texture at a movement, in steps of 1/256 standard deviation; none in a table of Gaussians
    /// and outside the table.
    pub fn white_mean(
        &self,
        texture: u16,
        movement: u8,
    ) -> impl ExactSizeIterator<Item = i16> + Clone + use<'a> {
        let cells = match self.contents {
            Contents::Fused(..) => self.cell_bytes(texture, movement).unwrap_or_default(),
            Contents::Gaussians(_) => &[],
        };
        let (numbers, _) = cells.as_chunks();
        numbers.iter().map(|two| i16::from_le_bytes(*two))
    }

    /// The statistics of a texture at a movement in a fused table, to go on from.
    pub fn whitened(&self, texture: u16, movement: u8) -> Whitened {
        let mut whitened = Whitened {
            slides: self.trials(texture, movement),
            mean: [0; MAX_FEATURES],
        };
        for (mean, stored) in whitened
            .mean
            .iter_mut()
            .zip(self.white_mean(texture, movement))
        {
            *mean = stored;
        }
        whitened
    }

    /// Whitens features at a movement; `None` as [`Table::whitening`].
    pub fn whiten(&self, movement: u8, features: &[i16]) -> Option<Vector> {
        Some(self.whitening_at(movement)?.apply(features))
    }

    fn label(&self, texture: u16) -> [u8; LABEL_BYTES] {
        let at = self.layout().labels + usize::from(texture) * LABEL_BYTES;
        let label = (texture < self.textures).then(|| array(self.bytes, at));
        label.flatten().unwrap_or_default()
    }

    /// A texture's number, which stays its own when others are deleted or it is renamed.
    pub fn number(&self, texture: u16) -> u16 {
        let [low, high, ..] = self.label(texture);
        u16::from_le_bytes([low, high])
    }

    /// The number that one more texture gets.
    #[inline]
    pub(crate) fn next_number(&self) -> u16 {
        let numbers = (0..self.textures).map(|texture| self.number(texture));
        numbers.max().map_or(0, |most| most.wrapping_add(1))
    }

    /// The texture with this number.
    pub fn numbered(&self, number: u16) -> Option<u16> {
        (0..self.textures).find(|&texture| self.number(texture) == number)
    }

    /// From whom a texture was learned.
    pub fn tally(&self, texture: u16) -> Tally {
        let [_, _, factory, user, itself] = self.label(texture);
        Tally {
            factory,
            user,
            itself,
        }
    }

    /// The checksum of the table that was in the beginning, before anything was learned: its own, if nothing was.
    pub fn lineage(&self) -> u32 {
        let stored = array(self.bytes, self.layout().lineage).map_or(0, u32::from_le_bytes);
        if stored == 0 { self.crc() } else { stored }
    }

    /// The checksum, which also tells one table from another.
    pub fn crc(&self) -> u32 {
        self.bytes
            .split_last_chunk()
            .map_or(0, |(_, crc)| u32::from_le_bytes(*crc))
    }

    /// The table as stored.
    pub fn as_bytes(&self) -> &'a [u8] {
        self.bytes
    }
}

/// The textures whose value is also that of one before.
fn twins(values: impl Iterator<Item = u32>) -> Vec<u16, MAX_TEXTURES> {
    let (mut seen, mut twins) = (Vec::<u32, MAX_TEXTURES>::new(), Vec::new());
    for (value, texture) in values.zip(0..) {
        // both have space for all textures of a table
        if seen.contains(&value) {
            let _ = twins.push(texture);
        }
        let _ = seen.push(value);
    }
    twins
}
