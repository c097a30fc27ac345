/// What stands for a value of the wrong type where the parser says that it wants a name.
pub(super) const NAMELESS: &str = "invalid type, expected a name in quotes or a table";

/// End of the message about a whole number beyond those that TOML has.
const LARGE: &str = "`, expected at most 9223372036854775807";

/// What parsers say, and what they mean for whoever wrote the file.
const WORDS: [(&str, &str); 30] = [
    (
        "wanted exactly 1 element, more than 1 element",
        "several kinds of what can be one only",
    ),
    (
        "wanted exactly 1 element, found 0 elements",
        "no kind, expected exactly one",
    ),
    ("expected f64", "expected a number"),
    ("expected f32", "expected a number"),
    ("expected usize", "expected a whole number >= 0"),
    ("expected u64", "expected a whole number >= 0"),
    ("expected u32", "expected a whole number >= 0"),
    ("expected a boolean", "expected true or false"),
    ("expected a sequence", "expected a list"),
    ("expected a map", "expected a table"),
    ("expected a string", "expected text in quotes"),
    ("expected path string", "expected a path in quotes"),
    ("expected internally tagged enum", "expected a table for"),
    ("expected struct", "expected a table for"),
    ("expected an array of length", "expected a list of length"),
    ("elements in sequence", "in the list"),
    ("fewer elements in array", "fewer"),
    ("invalid type: sequence", "invalid type: a list"),
    ("invalid type: map", "invalid type: a table"),
    ("floating point `", "number `"),
    ("unknown variant", "unknown name"),
    ("variant identifier", "a name in quotes"),
    ("invalid type: unit variant, expected string only", NAMELESS),
    ("wanted string or table", NAMELESS),
    ("` as i128, expected any valid TOML value", LARGE),
    ("` as i128", "`"),
    (
        "u64 value was too large",
        "invalid value, expected at most 9223372036854775807",
    ),
    ("trailing characters", "more than was expected"),
    (
        "Found a varint that didn't terminate. Is the usize too big for this platform?",
        "a number that does not end",
    ),
    ("that was > u32::max_value()", "that is too large"),
];

/// A message of a parser, which may have several lines and names Rust's types, in one line and in
/// words for whoever wrote the file.
pub fn in_words(message: impl ToString) -> String {
    // What they quote has no end, and may say something to a terminal.
    let message = message.to_string();
    let shown = |c: char| if c.is_control() { ' ' } else { c };
    let message: String = message.chars().take(1000).map(shown).collect();
    let line = message.split_whitespace().collect::<Vec<_>>().join(" ");
    let plain = |line: String, (rust, words): &(&str, &str)| line.replace(rust, words);
    let line = WORDS.iter().fold(line, plain);
    // What a table is for is a name of Rust's, too.
    match line.split_once(" for ") {
        Some((before, after)) if before.ends_with("expected a table") => {
            let rest = after.split_once(' ').map(|(_, rest)| format!(" {rest}"));
            before.to_owned() + &rest.unwrap_or_default()
        }
        _ => line,
    }
}
