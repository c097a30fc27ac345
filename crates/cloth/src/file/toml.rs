use std::path::Path;

use serde::de::DeserializeOwned;
use toml::Value;

use super::read::{ReadError, read_bytes};

/// End of the message about a whole number beyond those that TOML has.
const LARGE: &str = "`, expected at most 9223372036854775807";
/// Longest part of a line that a message quotes [characters].
const QUOTE: usize = 60;

/// Reads the TOML file at `path`.
pub fn read_toml<T: DeserializeOwned>(path: &Path) -> Result<T, ReadError> {
    let text = String::from_utf8(read_bytes(path)?);
    let text = text.map_err(|_| ReadError::fault(path, "not text in UTF-8"))?;
    parse_toml(&text, path)
}

/// Reads TOML from `text`; errors name `path` as its origin, line, column [characters] and key, and
/// what was expected there, in one line.
pub fn parse_toml<T: DeserializeOwned>(text: &str, path: &Path) -> Result<T, ReadError> {
    parse_toml_with(text, path, |text| toml::from_str(text))
}

/// As [`parse_toml`] by another parser than the plain one, whose errors are put into the same words.
pub fn parse_toml_with<T>(
    text: &str,
    path: &Path,
    parse: impl Fn(&str) -> Result<T, toml::de::Error>,
) -> Result<T, ReadError> {
    parse(text).map_err(|error| {
        let start = error.span().map_or(0, |span| span.start);
        let before = text.get(..start).unwrap_or(text);
        let line_start = before.rfind('\n').map_or(0, |end| end + 1);
        let line = text[line_start..].lines().next().unwrap_or_default().trim();
        let mut message = plain(error.message());
        if let Some(names) = error.span().and_then(|span| {
            let (before, after) = (text.get(..span.start)?, text.get(span.end..)?);
            let found = text.get(span)?;
            let nameless = parse(&format!("{before}\"\"{after}"));
            names_instead(&message, nameless.err()?.message(), found)
        }) {
            message = names;
        }
        let key = line.split('=').next().unwrap_or_default().trim();
        if !key.is_empty() && !message.contains(&format!("`{key}`")) {
            let quote: String = line.chars().take(QUOTE).collect();
            message += &format!(" in `{quote}`");
        }
        let line = before.matches('\n').count() + 1;
        let column = before[line_start..].chars().count() + 1;
        ReadError::Fault {
            path: path.into(),
            place: format!(":{line}:{column}"),
            fault: message,
        }
    })
}

/// Refuses a list at `path` or below where `tables` has a table: the parser would take it for the
/// values of the table, in their order. `a[]` are the elements of the list `a`.
pub fn refuse_lists(value: &Value, path: &str, tables: &[&str]) -> Result<(), String> {
    let below = |value, path: String| refuse_lists(value, &path, tables);
    match value {
        Value::Array(_) if tables.contains(&path) => {
            Err(format!("`{path}` is a list, expected a table"))
        }
        Value::Array(list) => (list.iter()).try_for_each(|value| below(value, format!("{path}[]"))),
        Value::Table(table) => (table.iter()).try_for_each(|(key, value)| match path {
            "" => below(value, key.clone()),
            _ => below(value, format!("{path}.{key}")),
        }),
        _ => Ok(()),
    }
}

/// What stands for a value of the wrong type where the parser says that it wants a name.
const NAMELESS: &str = "invalid type, expected a name in quotes or a table";

/// `message` with what was `found` and the names that may stand there, if it wants a name: those that
/// the parser lists in `nameless`, its message about an empty name there.
fn names_instead(message: &str, nameless: &str, found: &str) -> Option<String> {
    let (_, names) = nameless.split_once("unknown variant ``, expected ")?;
    let names = plain(names);
    // Where that is comes after it in some messages, and is in `message` too.
    let names = names.rsplit_once(" in `").map_or(&*names, |parts| parts.0);
    let found = found.lines().next().unwrap_or_default();
    let found: String = found.chars().take(QUOTE).collect();
    let named = format!("invalid type: `{found}`, expected {names}");
    (message.contains(NAMELESS)).then(|| message.replace(NAMELESS, &named))
}

/// A message of the parser, which may have several lines and names Rust's types, in one line
/// and in words for whoever wrote the file.
fn plain(message: &str) -> String {
    const WORDS: [(&str, &str); 16] = [
        (
            "wanted exactly 1 element, more than 1 element",
            "several kinds of what can be one only",
        ),
        ("expected f64", "expected a number"),
        ("expected f32", "expected a number"),
        ("expected usize", "expected a whole number >= 0"),
        ("expected u64", "expected a whole number >= 0"),
        ("expected u32", "expected a whole number >= 0"),
        ("expected a sequence", "expected a list"),
        ("expected path string", "expected a path in quotes"),
        ("expected internally tagged enum", "expected a table for"),
        ("expected struct", "expected a table for"),
        ("expected an array of length", "expected a list of length"),
        ("invalid type: unit variant, expected string only", NAMELESS),
        ("wanted string or table", NAMELESS),
        ("` as i128, expected any valid TOML value", LARGE),
        ("` as i128", "`"),
        (
            "u64 value was too large",
            "invalid value, expected at most 9223372036854775807",
        ),
    ];
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

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Plan {
        #[serde(rename = "part")]
        _part: Part,
    }

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Part {
        #[serde(rename = "length_mm")]
        _length_mm: f64,
    }

    fn message(text: &str) -> String {
        let error = parse_toml::<Plan>(text, Path::new("a.toml")).unwrap_err();
        error.to_string()
    }

    #[test]
    fn errors_are_one_line_with_place_and_key() {
        for (text, expected) in [
            (
                "[part]\nlength_mm = 1\n  widht = 2",
                "a.toml:3:3: unknown field `widht`, expected `length_mm`",
            ),
            (
                "# \u{b5}\n[part]\nlength_mm = \"\u{b5}\"",
                "a.toml:3:13: invalid type: string \"\u{b5}\", expected a number in `length_mm = \"\u{b5}\"`",
            ),
            (
                "part = 3",
                "a.toml:1:8: invalid type: integer `3`, expected a table in `part = 3`",
            ),
            (
                "[part]",
                "a.toml:1:1: missing field `length_mm` in `[part]`",
            ),
            ("", "a.toml:1:1: missing field `part`"),
        ] {
            assert_eq!(message(text), expected);
        }
        for (number, expected) in [
            ("9223372036854775808", "invalid value"),
            (
                "99999999999999999999",
                "invalid type: integer `99999999999999999999`",
            ),
        ] {
            let text = format!("a = {number}");
            let error = parse_toml::<toml::Table>(&text, Path::new("a.toml")).unwrap_err();
            let expected = format!("{expected}, expected at most 9223372036854775807 in `a = ");
            assert_eq!(
                error.to_string(),
                format!("a.toml:1:5: {expected}{number}`")
            );
        }
        for text in [
            "[part",
            "part = \"\"\"\n",
            "= 3",
            "\u{0}",
            "[part]\r\nlength_mm =",
        ] {
            let message = message(text);
            assert!(message.starts_with("a.toml:"), "{message}");
            assert!(!message.contains('\n'), "{message}");
        }
    }

    /// The names that a value of the wrong type could have been.
    #[test]
    fn names_are_listed() {
        #[derive(Debug, Deserialize)]
        #[serde(rename_all = "snake_case")]
        enum Colour {
            Red,
            Green,
            Mixed { _share: f64 },
        }
        #[derive(Debug, Deserialize)]
        struct Paint {
            #[serde(rename = "colour")]
            _colour: Colour,
        }
        let names = "expected one of `red`, `green`, `mixed`";
        for (value, start) in [
            ("3", "invalid type: `3`, "),
            ("true # red", "invalid type: `true`, "),
            ("\"blue\"", "unknown variant `blue`, "),
        ] {
            let text = format!("colour = {value}\n");
            let error = parse_toml::<Paint>(&text, Path::new("a.toml")).unwrap_err();
            let expected = format!("a.toml:1:10: {start}{names} in `colour = {value}`");
            assert_eq!(error.to_string(), expected);
        }
    }

    #[test]
    fn long_lines_are_cut() {
        let text = format!("[part]\nlength_mm = \"{}\"", "x".repeat(1000));
        let error = message(&text);
        let kept = format!(" in `length_mm = \"{}`", "x".repeat(47));
        assert!(error.ends_with(&kept), "{error}");
    }

    #[test]
    fn unreadable_files_are_named() {
        let error = read_toml::<Plan>(Path::new("none/a.toml")).unwrap_err();
        assert_eq!(error.to_string(), "cannot read none/a.toml");
        assert!(matches!(error, ReadError::Io { .. }));
    }
}
