//! Names that somebody typed, and the ones that were meant.

use tactus_lab::sim::collection::plain_name;

/// "no texture X; did you mean Y?", or all that there are where nothing is near.
pub(crate) fn unknown<'n>(wanted: &str, known: impl IntoIterator<Item = &'n str>) -> String {
    let known: Vec<&str> = known.into_iter().collect();
    match nearest(wanted, &known) {
        Some(name) => format!("no texture {wanted}; did you mean {name}?"),
        None => format!("no texture {wanted}; there are: {}", listed(&known)),
    }
}

/// The names, or the first of very many.
pub(crate) fn listed(names: &[impl AsRef<str>]) -> String {
    const MOST: usize = 150;
    let first: Vec<&str> = names.iter().take(MOST).map(AsRef::as_ref).collect();
    match names.len().saturating_sub(MOST) {
        0 => first.join(", "),
        more => format!("{} and {more} more", first.join(", ")),
    }
}

/// The name that was typed, however its capitals are; or as a shell completes it, if that is one name only.
pub(crate) fn find<'n>(wanted: &str, known: &[&'n str]) -> Result<&'n str, String> {
    let wanted = wanted.trim();
    let as_typed = known.iter().find(|name| **name == wanted);
    let capitals = || {
        let same = |name: &&&str| name.to_lowercase() == wanted.to_lowercase();
        known.iter().find(same)
    };
    let as_completed = || {
        let mut same = known
            .iter()
            .filter(|name| !wanted.is_empty() && plain_name(name) == wanted.to_lowercase());
        same.next().filter(|_| same.next().is_none())
    };
    as_typed
        .or_else(capitals)
        .or_else(as_completed)
        .copied()
        .ok_or_else(|| unknown(wanted, known.iter().copied()))
}

/// The name that differs least, if it differs by a slip: a third of its letters at most, or by words that were left
/// out.
pub(crate) fn nearest<'n>(wanted: &str, known: &[&'n str]) -> Option<&'n str> {
    let wanted = wanted.to_lowercase();
    let slips = known
        .iter()
        .map(|name| (strsim::levenshtein(&wanted, &name.to_lowercase()), *name))
        .filter(|(slips, name)| slips * 3 <= name.chars().count())
        .min_by_key(|(slips, _)| *slips);
    let part = || {
        let mut holding = known
            .iter()
            .filter(|name| wanted.len() >= 3 && name.to_lowercase().contains(&wanted));
        // of several, none is meant more than the others
        holding.next().filter(|_| holding.next().is_none()).copied()
    };
    slips.map(|(_, name)| name).or_else(part)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slip_finds_the_name_that_was_meant() {
        let known = ["Burlap", "bath towel", "Denim twill", "Jean denim"];
        for (wanted, meant) in [
            ("burlpa", Some("Burlap")),
            ("BURLAPS", Some("Burlap")),
            ("bath", Some("bath towel")),
            ("bathtowel", Some("bath towel")),
            // two of them have it
            ("denim", None),
            ("granite", None),
            ("", None),
        ] {
            assert_eq!(nearest(wanted, &known), meant, "{wanted}");
        }
        assert_eq!(
            unknown("burlpa", known),
            "no texture burlpa; did you mean Burlap?"
        );
        assert!(unknown("granite", known).ends_with("bath towel, Denim twill, Jean denim"));
        assert_eq!(find(" bath TOWEL ", &known), Ok("bath towel"));
        // as a shell completes it; of two, neither
        assert_eq!(find("bath-towel", &known), Ok("bath towel"));
        assert!(find("bath-towel", &["bath towel", "Bath, towel"]).is_err());
        // of two that differ by their capitals, the one that was typed
        assert_eq!(find("felt", &["Felt", "felt"]), Ok("felt"));
        assert_eq!(find("bath towe", &known), Err(unknown("bath towe", known)));
    }
}
