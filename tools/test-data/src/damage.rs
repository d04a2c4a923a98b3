//! Damage to texts that a user may have written, for tests of readers: random bytes fail in a file's first line, these reach beyond it.

/// Words that readers stumble over.
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

/// A text in which the words at these places gave way to others (each by its number, taken around), and of which all from a word on may be
/// lost.
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
