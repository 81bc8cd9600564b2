//! Layout of words in a drawing: their width and their lines.

/// Width of a letter as part of its height: that of wide ones in the usual fonts, so that words fit in all of them.
const WIDE: f64 = 0.6;

/// Estimated width of words of this height, px.
pub(crate) fn width(words: &str, em: f64) -> i32 {
    (words.chars().count() as f64 * em * WIDE).ceil() as i32
}

/// Words in lines of at most so many px; a word that is longer has a line of its own. Words that a space without a
/// break joins count as one.
pub(crate) fn lines(words: &str, em: f64, most: i32) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in words.split(' ').filter(|word| !word.is_empty()) {
        let last = lines.last().map_or("", String::as_str);
        let longer = format!("{last} {word}");
        if last.is_empty() || width(&longer, em) <= most {
            lines.pop();
            lines.push(longer.trim_start().to_owned());
        } else {
            lines.push(word.to_owned());
        }
    }
    lines
}

/// Left, top, right and bottom, px.
pub(crate) type Area = [i32; 4];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_broken_where_a_line_ends() {
        assert_eq!(lines("one two three", 10.0, 60), ["one two", "three"]);
        assert_eq!(lines("unbreakable", 10.0, 12), ["unbreakable"]);
        assert_eq!(lines("", 10.0, 12), [""]);
    }
}
