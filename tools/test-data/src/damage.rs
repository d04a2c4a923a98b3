//! Damaged texts for tests of parsers. Random bytes fail in the first line; these reach further.

const WORDS: [&str; 21] = [
    "",
    "-1",
    "0",
    "1e999",
    "nan",
    "-inf",
    "1e-320",
    "4294967296",
    "18446744073709551615",
    "\"",
    "\"\"",
    "'",
    "[",
    "]]",
    "[[sample]]",
    "[[job]]",
    "=",
    "\t",
    "\n",
    "\0",
    "é",
];

/// Replaces the words at these places by others (indices wrap around), and optionally cuts the text after a word.
pub fn damaged(text: &str, words: &[(usize, usize)], lost: Option<usize>) -> String {
    let mut split: Vec<&str> = text.split_inclusive([' ', '\t', '\n', ',', '"']).collect();
    let count = split.len().max(1);
    for (place, word) in words {
        if let Some(place) = split.get_mut(place % count) {
            *place = WORDS[word % WORDS.len()];
        }
    }
    if let Some(lost) = lost {
        split.truncate(lost % count);
    }
    split.concat()
}
