//! Texture tables learned from slides, for every way of deciding.

use tactus_core::explorer::Method;
use tactus_core::features::{FeatureSet, Movement, Observation, PropertySet, Vector};
use tactus_core::table::{
    self, Contents, EncodeError, Experience, Scatter, WhitenError, Whitened, whiten,
};

/// Why slides do not make a table.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// The table cannot be written.
    #[error("the table cannot be written")]
    Encode(#[from] EncodeError),
    /// The slides do not show how slides of one texture differ.
    #[error(
        "the features cannot be whitened; learn from more slides, or with --features of a smaller set"
    )]
    Whiten(#[from] WhitenError),
    /// A slide lacks features.
    #[error("a slide of {texture} does not have {}; learn from other features", set.name())]
    Features {
        /// Name of the texture.
        texture: String,
        /// The features.
        set: FeatureSet,
    },
    /// There is nothing to learn from.
    #[error("there are no slides to learn from")]
    Empty,
}

/// Slides to learn from: per texture and movement.
pub type Slides = [Vec<Vec<Observation>>];

/// The properties that every slide has.
pub fn measured(slides: &Slides) -> PropertySet {
    slides
        .iter()
        .flatten()
        .flatten()
        .fold(PropertySet::ALL, |set, slide| {
            set.and(slide.properties.measured())
        })
}

/// The best features that every slide has: force, else P_DC, else bands alone, else the three properties.
pub fn best_features(slides: &Slides) -> FeatureSet {
    let has = |set: FeatureSet| {
        let mut all = slides.iter().flatten().flatten();
        all.all(|slide| length(set, slide) > 0 && slide.vector(set, length(set, slide)).is_some())
    };
    FeatureSet::ALL
        .into_iter()
        .find(|&set| has(set))
        .unwrap_or(FeatureSet::Bands)
}

/// Number of features that a slide has of a set; 0 where it has no band.
fn length(set: FeatureSet, slide: &Observation) -> usize {
    match set {
        FeatureSet::Properties => 3,
        _ if slide.bands.is_empty() => 0,
        _ => set.others() + slide.bands.len(),
    }
}

/// Learns a table for a method; the fused one from `features`, or the best there are.
///
/// # Errors
/// See [`TableError`].
pub fn learn(
    method: Method,
    features: Option<FeatureSet>,
    names: &[String],
    movements: &[Movement],
    slides: &Slides,
) -> Result<Vec<u8>, TableError> {
    if method == Method::Fused {
        let set = features.unwrap_or_else(|| best_features(slides));
        learn_fused(set, names, movements, slides)
    } else {
        let measured = measured(slides);
        let experience: Vec<Vec<Experience>> = slides
            .iter()
            .map(|row| {
                row.iter()
                    .map(|slides| experience(measured, slides))
                    .collect()
            })
            .collect();
        Ok(encode(measured, movements, names, &experience)?)
    }
}

/// The experience from these slides, which all have the properties of `measured`.
pub fn experience(measured: PropertySet, slides: &[Observation]) -> Experience {
    let mut experience = Experience::default();
    for slide in slides {
        // a slide that lacks a property was not counted into `measured`
        let _ = experience.learn(measured, &slide.properties);
    }
    experience
}

/// Writes a table of Gaussians of any size.
///
/// # Errors
/// See [`EncodeError`].
pub fn encode(
    measured: PropertySet,
    movements: &[Movement],
    names: &[String],
    experience: &[Vec<Experience>],
) -> Result<Vec<u8>, EncodeError> {
    let textures = names
        .iter()
        .zip(experience)
        .map(|(name, experience)| table::Texture { name, experience });
    let mut bytes = buffer(Contents::Gaussians(measured), names, movements.len());
    table::encode(&mut bytes, measured, movements, textures)?;
    Ok(bytes)
}

fn buffer(contents: Contents, names: &[String], movements: usize) -> Vec<u8> {
    let of_names = names.iter().map(|n| n.len() + 1).sum();
    vec![0; table::encoded_len(contents, names.len(), movements, of_names)]
}

fn learn_fused(
    set: FeatureSet,
    names: &[String],
    movements: &[Movement],
    slides: &Slides,
) -> Result<Vec<u8>, TableError> {
    let first = slides.iter().flatten().flatten().next();
    let features = length(set, first.ok_or(TableError::Empty)?);
    // per texture and movement, the features of the slides
    let vectors = slides
        .iter()
        .zip(names)
        .map(|(row, texture)| {
            let of = |slides: &Vec<Observation>| {
                let vectors = slides.iter().map(|slide| slide.vector(set, features));
                vectors.collect::<Option<Vec<Vector>>>()
            };
            row.iter()
                .map(of)
                .collect::<Option<Vec<Vec<Vector>>>>()
                .ok_or_else(|| TableError::Features {
                    texture: texture.clone(),
                    set,
                })
        })
        .collect::<Result<Vec<_>, _>>()?;
    let mut scatters = vec![Scatter::new(features); movements.len()];
    for row in &vectors {
        for (scatter, slides) in scatters.iter_mut().zip(row) {
            scatter.push(slides)?;
        }
    }
    let whitenings = whiten(&scatters)?;
    let whitened: Vec<Vec<Whitened>> = vectors
        .iter()
        .map(|row| {
            row.iter()
                .zip(&whitenings)
                .map(|(slides, whitening)| {
                    let white: Vec<Vector> = slides.iter().map(|x| whitening.apply(x)).collect();
                    mean(&white, features)
                })
                .collect()
        })
        .collect();
    let movements: Vec<_> = movements.iter().copied().zip(whitenings).collect();
    let contents = Contents::Fused(set, features as u8);
    let mut bytes = buffer(contents, names, movements.len());
    let textures = names.iter().map(String::as_str);
    let textures = textures.zip(whitened.iter().map(Vec::as_slice));
    table::encode_fused(&mut bytes, set, &movements, textures)?;
    Ok(bytes)
}

/// The mean of whitened slides, rounded once.
fn mean(slides: &[Vector], features: usize) -> Whitened {
    let mut whitened = Whitened {
        slides: u8::try_from(slides.len()).unwrap_or(u8::MAX),
        ..Whitened::default()
    };
    for (feature, mean) in whitened.mean.iter_mut().take(features).enumerate() {
        let sum: f64 = slides.iter().map(|slide| f64::from(slide[feature])).sum();
        *mean = (sum / slides.len().max(1) as f64).round() as i16;
    }
    whitened
}
