//! The basis of a fused table: which features its slides have, and which of these move.

use tactus_core::features::{
    COARSE_BANDS, FEATURE_STEPS, FUSED_BANDS, FeatureSet, Observation, PDC_UNIT, Property,
};
use tactus_core::table::{Contents, Table, encoded_len};

use super::learn::Slides;
use super::show::count;

/// Largest difference between slides of one texture at which a feature is constant, in steps: a count of P_DC, and
/// what rounding adds. A feature that never moves measures nothing, and any change of it later would look like a new
/// texture.
const COUNT: i32 = (FEATURE_STEPS / PDC_UNIT) as i32 + 1;
/// The same of traction: a millinewton.
const MILLINEWTON: i32 = 2;

/// A feature beside the bands, as the training slides have it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Beside {
    NotMeasured,
    Constant,
    Moves,
}

/// The best features that every slide has, and that move: force, else P_DC, else bands alone, else the three
/// properties.
pub fn best_features(slides: &Slides) -> FeatureSet {
    let has = |set: FeatureSet| {
        let features = length(set, slides);
        let mut all = slides.iter().flatten().flatten();
        all.all(|slide| features > 0 && slide.vector(set, features).is_some())
            && beside(set, slides) == Beside::Moves
    };
    FeatureSet::ALL
        .into_iter()
        .find(|&set| has(set))
        .unwrap_or(FeatureSet::Bands)
}

/// Bytes of a table that fits into a probe with all its sections: most of 64 KB.
const ROOM: usize = 56 << 10;
/// So many degrees of freedom of the scatter within textures are needed for each feature of a set with all bands: with
/// fewer, coarse bands are wrong less often. The table must fit into a probe, with its sections.
const FREEDOM: usize = 2;

/// Number of features of a set that a table of these slides has; 0 where there is no band.
pub fn length(set: FeatureSet, slides: &Slides) -> usize {
    if set == FeatureSet::Properties {
        return 3;
    }
    let numbers = slides.iter().flatten().flatten();
    let numbers = numbers.map(Observation::numbers_of_bands);
    let fewer = |[a, b]: [usize; 2], [c, d]: [usize; 2]| [a.min(c), b.min(d)];
    let [all, coarse] = numbers.reduce(fewer).unwrap_or_default();
    if all == 0 {
        return 0;
    }
    let movements = slides.iter().map(Vec::len).max().unwrap_or(0);
    let freedom = |movement: usize| -> usize {
        let cells = slides.iter().filter_map(|texture| texture.get(movement));
        cells.map(|cell| cell.len().saturating_sub(1)).sum()
    };
    let fewest = (0..movements).map(freedom).min().unwrap_or(0);
    let features = set.others() + all;
    let contents = Contents::Fused(set, features as u8);
    let fits = encoded_len(contents, slides.len(), movements, 0) <= ROOM;
    if all == coarse || fits && fewest >= FREEDOM * features {
        features
    } else {
        set.others() + coarse
    }
}

/// Compares the features of a set beside the bands between the slides of each texture.
fn beside(set: FeatureSet, slides: &Slides) -> Beside {
    let resolution = match set {
        FeatureSet::Pressure => COUNT,
        FeatureSet::Force => MILLINEWTON,
        FeatureSet::Bands | FeatureSet::Properties => return Beside::Moves,
    };
    let values = |slide: &Observation| -> Option<[i16; 2]> {
        if set == FeatureSet::Pressure {
            return slide.pressure;
        }
        let traction = slide.properties.get(Property::Traction)?;
        Some([(traction * FEATURE_STEPS).round() as i16; 2])
    };
    // single slides do not say it
    let mut moves = slides.iter().flatten().all(|cell| cell.len() < 2);
    for cell in slides.iter().flatten() {
        let mut ends: Option<[[i16; 2]; 2]> = None;
        for slide in cell {
            let Some(now) = values(slide) else {
                return Beside::NotMeasured;
            };
            let [low, high] = ends.unwrap_or([now; 2]);
            let each =
                |of: fn(i16, i16) -> i16, end: [i16; 2]| [of(end[0], now[0]), of(end[1], now[1])];
            ends = Some([each(i16::min, low), each(i16::max, high)]);
        }
        let [low, high] = ends.unwrap_or_default();
        let wide = |n: usize| i32::from(high[n]) - i32::from(low[n]) > resolution;
        moves |= wide(0) || wide(1);
    }
    if moves {
        Beside::Moves
    } else {
        Beside::Constant
    }
}

/// The features that a table uses, and why not others of the slides that it was learned from, in words: `uses 26 bands;
/// no traction: not measured; P_DC constant: left out`.
pub fn in_words(table: Table<'_>, slides: &Slides) -> String {
    let Contents::Fused(set, features) = table.contents() else {
        return "uses the three properties".to_owned();
    };
    let bands = usize::from(features).saturating_sub(set.others());
    let mut words = match set {
        FeatureSet::Properties => return "uses the three properties".to_owned(),
        FeatureSet::Bands => "uses ".to_owned(),
        FeatureSet::Force => "uses traction and ".to_owned(),
        FeatureSet::Pressure => "uses P_DC and ".to_owned(),
    };
    words += &count(bands as u64, "band");
    let measured = slides.iter().flatten().flatten().next();
    let all_measured = measured.is_none_or(|slide| slide.numbers_of_bands()[1] == COARSE_BANDS);
    if all_measured && bands < FUSED_BANDS {
        words += " (26 with more, and longer, slides)";
    }
    for (other, name) in [
        (FeatureSet::Force, "traction"),
        (FeatureSet::Pressure, "P_DC"),
    ] {
        if other == set {
            continue;
        }
        words += &match beside(other, slides) {
            Beside::NotMeasured => format!("; no {name}: not measured"),
            Beside::Constant => format!("; {name} constant: left out"),
            Beside::Moves => format!("; {name} not used"),
        };
    }
    if !all_measured {
        words += "; no higher band: not measured";
    }
    words
}

#[cfg(test)]
mod tests {
    use rand::{RngExt as _, SeedableRng as _};
    use rand_chacha::ChaCha8Rng;
    use tactus_core::explorer::Method;
    use tactus_core::features::{Movement, Properties};

    use super::*;
    use crate::eval::learn::learn;

    /// Slides of four textures: bands that scatter, and P_DC and traction as given for each.
    fn slides(
        pressure: impl Fn(usize, usize) -> Option<[i16; 2]>,
        traction: impl Fn(usize, usize) -> Option<f32>,
    ) -> Vec<Vec<Vec<Observation>>> {
        let mut random = ChaCha8Rng::seed_from_u64(7);
        let mut slide = |texture: usize, n: usize| {
            let mut band = |b: usize| {
                let scatter: i16 = random.random_range(-200..200);
                2000 + 700 * texture as i16 * (b % 3) as i16 + scatter
            };
            Observation {
                properties: Properties::new([traction(texture, n), Some(1.0), Some(5.0)]),
                bands: (0..26).map(&mut band).collect(),
                pressure: pressure(texture, n),
                pace: None,
            }
        };
        let each = (0..4).map(|t| vec![(0..8).map(|n| slide(t, n)).collect()]);
        each.collect()
    }

    fn table(slides: &Slides) -> Vec<u8> {
        let names = ["cork", "felt", "silk", "wool"].map(str::to_owned);
        learn(Method::Fused, None, &names, &[Movement::UNKNOWN], slides).unwrap()
    }

    #[test]
    fn p_dc_that_never_moves_gives_the_table_without_it() {
        let without = table(&slides(|_, _| None, |_, _| None));
        let words = |bytes: &[u8], slides: &Slides| in_words(Table::read(bytes).unwrap(), slides);
        // constant, of another value for each texture, or dithering by less than a count
        let constants: [fn(usize, usize) -> [i16; 2]; 3] = [
            |_, _| [3072, 0],
            |texture, _| [1000 * texture as i16, 0],
            |_, n| [3072 + (n % 2) as i16 * 10, (n % 3) as i16 * 5],
        ];
        for constant in constants {
            let slides = slides(|t, n| Some(constant(t, n)), |_, _| Some(0.4));
            assert!(table(&slides) == without);
            assert_eq!(
                words(&without, &slides),
                "uses 14 bands (26 with more, and longer, slides); traction constant: left out; P_DC constant: left out"
            );
        }
        assert_eq!(
            words(&without, &slides(|_, _| None, |_, _| None)),
            "uses 14 bands (26 with more, and longer, slides); no traction: not measured; no P_DC: not measured"
        );
    }

    #[test]
    fn p_dc_and_traction_that_move_are_used() {
        let moves = |_: usize, n: usize| Some([3072 + 40 * n as i16, 12]);
        let with = slides(moves, |_, _| Some(0.4));
        assert_eq!(best_features(&with), FeatureSet::Pressure);
        assert_eq!(
            in_words(Table::read(&table(&with)).unwrap(), &with),
            "uses P_DC and 14 bands (26 with more, and longer, slides); traction constant: left out"
        );
        let with = slides(moves, |_, n| Some(0.4 + 0.01 * n as f32));
        assert_eq!(
            in_words(Table::read(&table(&with)).unwrap(), &with),
            "uses traction and 14 bands (26 with more, and longer, slides); P_DC not used"
        );
        // a sensor that came loose in one slide
        let with = slides(|t, n| moves(t, n).filter(|_| n != 3), |_, _| None);
        assert_eq!(best_features(&with), FeatureSet::Bands);
    }
}
