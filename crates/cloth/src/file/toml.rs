use std::ops::Range;
use std::path::Path;

use serde::Serialize;
use serde::de::DeserializeOwned;
use toml::de::{DeString, DeTable, DeValue};
use toml::{Spanned, Value};

use super::read::{ReadError, read_text};
use super::words::{NAMELESS, in_words};

/// Longest part of a line that a message quotes [characters].
const QUOTE: usize = 60;

/// What to do about the backslashes of paths, which TOML takes for escapes in double quotes.
const SINGLE_QUOTES: &str = "put a path with backslashes into single quotes";

/// Reads the TOML file at `path`.
pub fn read_toml<T: DeserializeOwned + Serialize>(path: &Path) -> Result<T, ReadError> {
    parse_toml(&read_text(path)?, path)
}

/// Reads TOML from `text`; errors name `path` as its origin, line, column [characters] and key, and
/// what was expected there, in one line.
pub fn parse_toml<T: DeserializeOwned + Serialize>(
    text: &str,
    path: &Path,
) -> Result<T, ReadError> {
    parse_toml_with(text, path, |text| toml::from_str(text))
}

/// As [`parse_toml`] by another parser than the plain one, whose errors are put into the same words.
pub fn parse_toml_with<T: Serialize>(
    text: &str,
    path: &Path,
    parse: impl Fn(&str) -> Result<T, toml::de::Error>,
) -> Result<T, ReadError> {
    let value = parse(text).map_err(|error| {
        let mut message = in_words(error.message());
        if let Some(names) = error.span().and_then(|span| {
            let (before, after) = (text.get(..span.start)?, text.get(span.end..)?);
            let found = text.get(span)?;
            let nameless = parse(&format!("{before}\"\"{after}"));
            names_instead(&message, nameless.err()?.message(), found)
        }) {
            message = names;
        }
        let start = error.span().map_or(0, |span| span.start);
        let entry = faulty_entry(text, start, &error, &parse);
        located(text, path, entry.unwrap_or(start), message)
    })?;
    // Of a list that is longer than it wants the parser drops the rest.
    let kept = Value::try_from(&value).expect("what was read is representable");
    let given = DeTable::parse(text).expect("it has been read").into_inner();
    match changed_in_table(&given, &kept, "").or_else(|| given.iter().find_map(controlled)) {
        Some((start, message)) => Err(located(text, path, start, message)),
        None => Ok(value),
    }
}

/// Most entries of a file in which one is sought that is at fault: the file is parsed once for each.
const SOUGHT: usize = 256;

/// Where the entry stands that makes an `error` at the byte `start`, if no entry stands there: that without which there is
/// none, or another, when those before it are left out, too. Tables that are told by their kind, or have any keys beside
/// known ones, are read from a copy that has forgotten where its entries stand.
fn faulty_entry<T>(
    text: &str,
    start: usize,
    error: &toml::de::Error,
    parse: &impl Fn(&str) -> Result<T, toml::de::Error>,
) -> Option<usize> {
    let document = DeTable::parse(text).ok()?;
    let mut entries = Vec::new();
    collect_entries(document.get_ref(), &mut entries);
    entries.sort_by_key(|[key, _]| key.start);
    let is_missing = |message: &str| message.starts_with("missing field");
    let is_there = |[key, value]: &[Range<usize>; 2]| (key.start..value.end).contains(&start);
    if is_missing(error.message()) || entries.len() > SOUGHT || entries.iter().any(is_there) {
        return None;
    }
    let mut without: Vec<Range<usize>> = Vec::new();
    for [key, value] in entries {
        let line = text[..key.start].rfind('\n').map_or(0, |end| end + 1);
        // All of a key with dots, but no more of a table in a line than the entry.
        let from = match text[line..key.start].contains(['{', '=']) {
            true => key.start,
            false => line,
        };
        without.push(from..value.end);
        let (mut left, mut end) = (String::new(), 0);
        for gap in &without {
            left += &text[end..gap.start];
            end = gap.end;
        }
        left += &text[end..];
        match parse(&left).err().map(|other| other.message().to_owned()) {
            Some(other) if other == error.message() => continue,
            Some(other) if is_missing(&other) || DeTable::parse(&left).is_err() => without.pop(),
            _ => {
                let name = format!("`{}`", &text[key.clone()]);
                let is_of_key =
                    error.message().starts_with("unknown") && error.message().contains(&name);
                return Some(if is_of_key { key.start } else { value.start });
            }
        };
    }
    None
}

/// Keys and values of a table and of those in it, where they stand.
fn collect_entries(table: &DeTable, into: &mut Vec<[Range<usize>; 2]>) {
    for (key, value) in table {
        let is_table = |value: &Spanned<DeValue>| matches!(value.get_ref(), DeValue::Table(_));
        match value.get_ref() {
            DeValue::Table(inner) => collect_entries(inner, into),
            DeValue::Array(list) if list.iter().any(is_table) => {
                for value in list {
                    if let DeValue::Table(inner) = value.get_ref() {
                        collect_entries(inner, into);
                    }
                }
            }
            _ => into.push([key.span(), value.span()]),
        }
    }
}

/// The error at the byte `start` of `text`.
fn located(text: &str, path: &Path, start: usize, mut message: String) -> ReadError {
    let before = text.get(..start).unwrap_or(text);
    let line_start = before.rfind('\n').map_or(0, |end| end + 1);
    let line = text[line_start..].lines().next().unwrap_or_default();
    let table = table_above(line, before.len() - line_start);
    let key = line.split('=').next().unwrap_or_default().trim();
    if let Some(table) = table {
        message += &format!(" in `[{}]`", quote(&table));
    } else if !key.is_empty() && !message.contains(&format!("`{key}`")) {
        message += &format!(" in `{}`", quote(line.trim()));
    }
    // Where the file is no TOML at all, a backslash is most often that of a path.
    if line.contains('\\') && DeTable::parse(text).is_err() {
        message += &format!(", {SINGLE_QUOTES}");
    }
    let line = before.matches('\n').count() + 1;
    let column = before[line_start..].chars().count() + 1;
    ReadError::Fault {
        path: path.into(),
        place: format!(":{line}:{column}"),
        fault: message,
    }
}

/// The table at the `column` of a `line`, where it is there only by the header of another below it.
fn table_above(line: &str, column: usize) -> Option<String> {
    let (before, after) = line.split_at_checked(column)?;
    let above = before.trim_start().strip_prefix('[')?;
    let (key, _) = after.split_once('.')?;
    let is_name = |c: char| c.is_alphanumeric() || c == '_' || c == '-';
    // No number in a list.
    let is_key = key.starts_with(|c: char| c.is_alphabetic()) && key.chars().all(is_name);
    is_key.then(|| format!("{}{key}", above.trim_start_matches('[')))
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

/// The beginning of a line, without what a terminal would obey.
fn quote(line: &str) -> String {
    let shown = |c: char| if c.is_control() { '\u{fffd}' } else { c };
    line.chars().take(QUOTE).map(shown).collect()
}

/// The first list below `given`, at its byte, of which a table or a shorter list was `kept`.
fn changed(given: &Spanned<DeValue>, kept: &Value, key: &str) -> Option<(usize, String)> {
    let fault = |fault: String| Some((given.span().start, format!("`{key}` is {fault}")));
    match (given.get_ref(), kept) {
        (DeValue::Array(_), Value::Table(_)) => fault("a list, expected a table".into()),
        (DeValue::Array(given), Value::Array(kept)) if given.len() != kept.len() => {
            let (found, expected) = (given.len(), kept.len());
            fault(format!("a list of {found}, expected {expected}"))
        }
        (DeValue::Array(given), Value::Array(kept)) => (given.iter().zip(kept).enumerate())
            .find_map(|(index, (given, kept))| changed(given, kept, &format!("{key}[{index}]"))),
        (DeValue::Table(given), kept) => changed_in_table(given, kept, &format!("{key}.")),
        _ => None,
    }
}

fn changed_in_table(given: &DeTable, kept: &Value, before: &str) -> Option<(usize, String)> {
    given.iter().find_map(|(key, given)| {
        let key = key.get_ref();
        changed(given, kept.get(&**key)?, &format!("{before}{key}"))
    })
}

/// The first text at or below a key, at its byte, with a control character: the tab that `"C:\tools"`
/// has, for no key means one.
fn controlled((key, given): (&Spanned<DeString>, &Spanned<DeValue>)) -> Option<(usize, String)> {
    match given.get_ref() {
        DeValue::String(text) if text.contains(char::is_control) => {
            let (key, text) = (key.get_ref(), text.chars().take(QUOTE).collect::<String>());
            let fault = format!("`{key}` has control characters in {text:?}, {SINGLE_QUOTES}");
            Some((given.span().start, fault))
        }
        DeValue::Array(list) => list.iter().find_map(|given| controlled((key, given))),
        DeValue::Table(table) => table.iter().find_map(controlled),
        _ => None,
    }
}

/// `message` with what was `found` and the names that may stand there, if it wants a name: those that
/// the parser lists in `nameless`, its message about an empty name there.
fn names_instead(message: &str, nameless: &str, found: &str) -> Option<String> {
    let (_, names) = nameless.split_once("unknown variant ``, expected ")?;
    let names = in_words(names);
    // Where that is comes after it in some messages, and is in `message` too.
    let names = names.rsplit_once(" in `").map_or(&*names, |parts| parts.0);
    let found = found.lines().next().unwrap_or_default();
    let found = quote(found);
    let named = format!("invalid type: `{found}`, expected {names}");
    (message.contains(NAMELESS)).then(|| message.replace(NAMELESS, &named))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use serde::{Deserialize, Serialize};

    #[derive(Debug, Deserialize, Serialize)]
    #[serde(deny_unknown_fields)]
    struct Plan {
        #[serde(rename = "part")]
        _part: Part,
    }

    #[derive(Debug, Deserialize, Serialize)]
    #[serde(deny_unknown_fields)]
    struct Part {
        #[serde(rename = "length_mm")]
        _length_mm: f64,
    }

    #[derive(Debug, Deserialize, Serialize)]
    #[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
    enum Solid {
        Ball {
            #[serde(default)]
            radius_mm: f64,
            #[serde(default)]
            height_mm: f64,
        },
    }

    /// What is wrong in a table that is told by its kind is found among its entries, wherever these stand.
    #[test]
    fn entries_of_tables_told_by_their_kind_are_found() {
        let rest = ": invalid type: string \"x\"";
        for (text, place) in [
            (
                "[a.b]\nkind = \"ball\"\nradius_mm = 1\nheight_mm = \"x\"",
                format!("4:13{rest}"),
            ),
            (
                "a.b.kind = \"ball\"\na.b.height_mm = \"x\"",
                format!("2:17{rest}"),
            ),
            (
                "[a]\nb.kind = \"ball\"\nb.height_mm = \"x\"",
                format!("3:15{rest}"),
            ),
            (
                "[a.b]\nkind = \"ball\"\nradius = 1",
                "3:1: unknown field `radius`".into(),
            ),
            (
                "[a.b]\nkind = \"ball\"\nradius_mm = \"x\"\nheight_mm = \"x\"",
                format!("4:13{rest}"),
            ),
            ("[a.b]\nkind = \"bal\"", "2:8: unknown name `bal`".into()),
            (
                "[a.b]\nradius_mm = 1",
                "1:1: missing field `kind` in `[a.b]`".into(),
            ),
            (
                "[[a.b.c]]\nradius_mm = 1",
                "1:5: missing field `kind` in `[a.b]`".into(),
            ),
        ] {
            let read = parse_toml::<BTreeMap<String, BTreeMap<String, Solid>>>;
            let message = read(text, Path::new("a.toml")).unwrap_err().to_string();
            assert!(message.starts_with(&format!("a.toml:{place}")), "{message}");
        }
    }

    #[test]
    fn tables_above_are_those_of_headers() {
        for (line, column, expected) in [
            ("[a.b.c]", 1, Some("a")),
            ("[a.b.c]", 3, Some("a.b")),
            ("[a.b.c]", 5, None),
            ("[[a.b]]", 2, Some("a")),
            ("  [1.5, 2]", 3, None),
            ("[\"a.b\"]", 1, None),
            ("a.b = 1", 0, None),
            ("", 1, None),
        ] {
            assert_eq!(table_above(line, column).as_deref(), expected, "{line}");
        }
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

    /// Paths of Windows in double quotes: escapes that TOML knows, and others.
    #[test]
    fn backslashes_of_paths_are_seen() {
        let read = |text: &str| parse_toml::<toml::Table>(text, Path::new("a.toml"));
        let control = "`path` has control characters in ";
        for (path, start) in [
            (
                r"C:\tools\new.stl",
                format!("2:8: {control}{:?}", "C:\tools\new.stl"),
            ),
            (
                r"C:\before.stl",
                format!("2:8: {control}{:?}", "C:\u{8}efore.stl"),
            ),
            (r"C:\dome.stl", "2:12: missing escaped value, ".into()),
            (r"C:\users\dome.stl", "2:13: too few unicode ".into()),
            (r"C:\parts\", "2:12: missing escaped value, ".into()),
        ] {
            for text in [format!("path = \"{path}\""), format!("path = [\"{path}\"]")] {
                let text = format!("other = 'C:\\tools\\a.stl'\n{text}");
                let found = read(&text).unwrap_err().to_string();
                let column = usize::from(text.contains('['));
                assert!(
                    column == 1 || found.starts_with(&format!("a.toml:{start}")),
                    "{found}"
                );
                assert!(
                    found.ends_with(SINGLE_QUOTES) && !found.contains('\n'),
                    "{found}"
                );
            }
            assert!(read(&format!("path = '{path}'")).is_ok());
        }
    }

    /// The names that a value of the wrong type could have been.
    #[test]
    fn names_are_listed() {
        #[derive(Debug, Deserialize, Serialize)]
        #[serde(rename_all = "snake_case")]
        enum Colour {
            Red,
            Green,
            Mixed { _share: f64 },
        }
        #[derive(Debug, Deserialize, Serialize)]
        struct Paint {
            #[serde(rename = "colour")]
            _colour: Colour,
        }
        let names = "expected one of `red`, `green`, `mixed`";
        for (value, start) in [
            ("3", "invalid type: `3`, "),
            ("true # red", "invalid type: `true`, "),
            ("\"blue\"", "unknown name `blue`, "),
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
