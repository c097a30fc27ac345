//! A table of what has been measured, and its form as text, Markdown, CSV and JSON.
//!
//! [`Table::of`] takes any rows; each column names itself, its unit and how its cells are got. A
//! column `left [m]` is the field `left_m` of CSV and JSON.
//!
//! [`replace_tables`] puts tables into a document, between a marker that names study and table, and
//! columns if not all shall be there, and the next end:
//!
//! ```markdown
//! <!-- table twin.runs: model, left -->
//! whatever stands here is replaced
//! <!-- end -->
//! ```

use serde_json::Value;

/// How a reader is shown the numbers of a column; files have all digits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// So many decimals.
    Fixed(usize),
    /// So many significant digits.
    Digits(usize),
    /// Not at all: the column is in CSV and JSON only.
    Hidden,
}

impl From<usize> for Format {
    fn from(decimals: usize) -> Self {
        Self::Fixed(decimals)
    }
}

#[derive(Clone, Debug, PartialEq)]
struct Column {
    /// Its name, and its unit in brackets if it has one.
    head: String,
    format: Format,
    /// Texts, counts, and numbers; null where there is none or it is not finite.
    cells: Vec<Value>,
}

/// Rows of cells under named columns.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// Of its file and its key in JSON.
    pub name: &'static str,
    /// What a reader has to know, one line or more; empty for a table in CSV and JSON only.
    pub title: String,
    columns: Vec<Column>,
}

/// A [`Table`] that is being made of `rows`.
pub struct TableOf<'a, R> {
    rows: &'a [R],
    table: Table,
}

impl<R> TableOf<'_, R> {
    /// A column of texts or counts.
    pub fn text<C: Into<Value>>(self, name: impl Into<String>, of: impl Fn(&R) -> C) -> Self {
        self.number(name, 0, of)
    }

    /// A column of numbers under its name and unit, as in `left [m]`; a format that is a number is
    /// that of the decimals.
    pub fn number<C: Into<Value>>(
        mut self,
        head: impl Into<String>,
        format: impl Into<Format>,
        of: impl Fn(&R) -> C,
    ) -> Self {
        self.table.columns.push(Column {
            head: head.into(),
            format: format.into(),
            cells: self.rows.iter().map(|row| of(row).into()).collect(),
        });
        self
    }

    /// The table.
    pub fn end(self) -> Table {
        self.table
    }
}

impl Column {
    /// Field in CSV and JSON.
    fn key(&self) -> String {
        let words = self.head.replace("[%]", "percent").replace("[1/", "per ");
        let words = words.to_lowercase();
        let words = words.split(|c: char| !c.is_alphanumeric());
        let words = words.filter(|word| !word.is_empty());
        words.collect::<Vec<_>>().join("_")
    }

    fn is_text(&self) -> bool {
        self.cells.iter().any(Value::is_string)
    }

    /// A cell as a reader is shown it.
    fn shown(&self, row: usize) -> String {
        let number = match &self.cells[row] {
            Value::Number(number) if number.is_f64() => number.as_f64().unwrap_or(f64::NAN),
            Value::Null => return "-".into(),
            cell => return plain(cell),
        };
        match self.format {
            _ if number.abs() >= 1e6 => format!("{number:.3e}"),
            Format::Digits(digits) => significant(number, digits),
            Format::Hidden => number.to_string(),
            Format::Fixed(decimals) => {
                let shown = format!("{number:.decimals$}");
                // No sign where all digits are 0.
                let is_zero = shown.trim_matches(['-', '0', '.']).is_empty();
                shown[usize::from(is_zero && shown.starts_with('-'))..].to_owned()
            }
        }
    }
}

/// A cell with all its digits and without quotes; empty for null.
fn plain(cell: &Value) -> String {
    match cell {
        Value::String(text) => text.clone(),
        Value::Number(number) if number.is_f64() => number.as_f64().unwrap_or(f64::NAN).to_string(),
        Value::Null => String::new(),
        count => count.to_string(),
    }
}

/// So many digits, without an exponent as long as it is short.
fn significant(number: f64, digits: usize) -> String {
    match number.abs() {
        0.0 => "0".into(),
        size if size < 1e-3 => format!("{number:.*e}", digits - 1),
        size => {
            let decimals = digits as f64 - 1.0 - size.log10().floor();
            format!("{number:.*}", decimals.max(0.0) as usize)
        }
    }
}

impl Table {
    /// Begins a table; [`TableOf::end`] gives it.
    pub fn of<'a, R>(
        name: &'static str,
        title: impl Into<String>,
        rows: &'a [R],
    ) -> TableOf<'a, R> {
        let table = Self {
            name,
            title: title.into(),
            columns: Vec::new(),
        };
        TableOf { rows, table }
    }

    fn row_count(&self) -> usize {
        self.columns.first().map_or(0, |column| column.cells.len())
    }

    fn shown(&self) -> Vec<&Column> {
        let all = self.columns.iter();
        all.filter(|c| c.format != Format::Hidden).collect()
    }

    /// Whether it is for CSV and JSON only.
    pub fn is_hidden(&self) -> bool {
        self.title.is_empty()
    }

    /// For a terminal: columns under each other, numbers at their right.
    pub fn text(&self) -> String {
        let mut lines = vec![String::new(); self.row_count() + 1];
        for column in self.shown() {
            let cells = (0..self.row_count()).map(|row| column.shown(row));
            let cells: Vec<String> = std::iter::once(column.head.clone()).chain(cells).collect();
            let width = cells.iter().map(|cell| cell.chars().count()).max();
            let width = width.unwrap_or(0);
            for (line, cell) in lines.iter_mut().zip(cells) {
                *line += &match column.is_text() {
                    true => format!("{cell:width$}  "),
                    false => format!("{cell:>width$}  "),
                };
            }
        }
        let lines: Vec<&str> = lines.iter().map(|line| line.trim_end()).collect();
        format!("{}\n{}", self.title, lines.join("\n"))
    }

    /// As a table of Markdown with the columns of these `names`, without their units; with all
    /// that readers are shown if there are none.
    ///
    /// # Errors
    /// If there is none of a name.
    pub fn markdown(&self, names: &[&str]) -> Result<String, String> {
        let find = |name: &&str| {
            let named = |column: &&Column| column.head.split(" [").next() == Some(name);
            let found = self.columns.iter().find(named);
            found.ok_or_else(|| format!("table `{}` has no column `{name}`", self.name))
        };
        let columns = match names {
            [] => self.shown(),
            names => names.iter().map(find).collect::<Result<_, _>>()?,
        };
        let line = |of: &dyn Fn(&Column) -> String| {
            let cells = columns.iter().map(|c| of(c).replace('|', "\\|"));
            format!("| {} |", cells.collect::<Vec<_>>().join(" | "))
        };
        let rule = |c: &Column| if c.is_text() { "---" } else { "---:" }.to_owned();
        let mut lines = vec![line(&|column| column.head.clone()), line(&rule)];
        lines.extend((0..self.row_count()).map(|row| line(&|column| column.shown(row))));
        Ok(lines.join("\n"))
    }

    /// As CSV (RFC 4180); numbers that do not exist are empty.
    pub fn csv(&self) -> String {
        let line = |of: &dyn Fn(&Column) -> String| {
            let cells = self.columns.iter().map(of);
            cells.collect::<Vec<_>>().join(",") + "\n"
        };
        let row = |row: usize| {
            line(&|column| match plain(&column.cells[row]) {
                text if text.contains([',', '"', '\n', '\r']) => {
                    format!("\"{}\"", text.replace('"', "\"\""))
                }
                text => text,
            })
        };
        line(&Column::key) + &(0..self.row_count()).map(row).collect::<String>()
    }

    /// As a list of objects; numbers that do not exist are null.
    pub fn json(&self) -> Value {
        let object = |row: usize| {
            let fields = self.columns.iter();
            Value::Object(fields.map(|c| (c.key(), c.cells[row].clone())).collect())
        };
        (0..self.row_count()).map(object).collect()
    }
}

/// What ends the place of a table in a document.
const END: &str = "<!-- end -->";

/// `text` with what `content` gives for a table and its columns in every place of a study, whose
/// tables have these `names`. Without columns it has all.
///
/// # Errors
/// If a place names none of the tables or has no end, if there is no place, or as `content` does.
/// The message tells what is missing, for after the name of the document.
pub fn replace_tables(
    text: &str,
    study: &str,
    names: &[&str],
    content: impl Fn(&str, &[&str]) -> Result<String, String>,
) -> Result<String, String> {
    let marker = format!("<!-- table {study}.");
    let mut parts = text.split(&marker);
    let mut replaced = parts.next().unwrap_or_default().to_owned();
    let mut count = 0;
    for part in parts {
        let (head, rest) = part.split_once(" -->").unwrap_or((part, ""));
        let (name, columns) = head.split_once(':').unwrap_or((head, ""));
        if !names.contains(&name) {
            let line = name.lines().next().unwrap_or_default();
            let names = names.join(", ");
            return Err(format!(
                "`{marker}{line}` names no table, expected one of {names}"
            ));
        }
        let closed = rest.split_once(END);
        // Its own end: not one that closes another table.
        let Some((_, after)) = closed.filter(|(old, _)| !old.contains("<!-- table ")) else {
            return Err(format!("`{marker}{head} -->` is not followed by `{END}`"));
        };
        let columns = columns.split(',').map(str::trim).filter(|c| !c.is_empty());
        let new = content(name, &columns.collect::<Vec<_>>())?;
        replaced += &format!("{marker}{head} -->\n{new}\n{END}{after}");
        count += 1;
    }
    match count {
        0 => Err(format!("there is no `{marker}NAME -->`")),
        _ => Ok(replaced),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        Table::of(
            "rates",
            "of both",
            &[("a|b", 1.0, 3), ("c,\"d\"", f64::NAN, 4)],
        )
        .text("name", |row| row.0)
        .number("distance left [m]", 2, |row| row.1)
        .number("share [%]", Format::Hidden, |row| row.2)
        .end()
    }

    #[test]
    fn a_table_has_four_forms() {
        let table = table();
        assert_eq!(
            table.text(),
            "of both\nname   distance left [m]\na|b                 1.00\nc,\"d\"                  -"
        );
        assert_eq!(
            table.markdown(&[]).unwrap(),
            "| name | distance left [m] |\n| --- | ---: |\n| a\\|b | 1.00 |\n| c,\"d\" | - |"
        );
        assert_eq!(
            table.csv(),
            "name,distance_left_m,share_percent\na|b,1,3\n\"c,\"\"d\"\"\",,4\n"
        );
        let expected = serde_json::json!([
            {"name": "a|b", "distance_left_m": 1.0, "share_percent": 3},
            {"name": "c,\"d\"", "distance_left_m": null, "share_percent": 4},
        ]);
        assert_eq!(table.json(), expected);
    }

    #[test]
    fn significant_digits_are_short() {
        for (value, text) in [
            (0.123_456_7, "0.12346"),
            (-0.3189, "-0.31890"),
            (1050.0, "1050.0"),
            (2.63e-5, "2.6300e-5"),
            (21_000.0, "21000"),
            (0.0, "0"),
        ] {
            assert_eq!(significant(value, 5), text);
        }
    }

    #[test]
    fn tables_are_put_between_their_markers() {
        let table = table();
        let replace = |text: &str| {
            replace_tables(text, "s", &["rates"], |_, columns| table.markdown(columns))
        };
        let text = "a\n<!-- table s.rates -->\nold\n<!-- end -->\nb <!-- table t.x --> c";
        let found = replace(text).unwrap();
        assert_eq!(found, text.replace("old", &table.markdown(&[]).unwrap()));
        assert_eq!(replace(&found).unwrap(), found);
        let text = "<!-- table s.rates: share, name -->\nold\n<!-- end -->";
        let few = "| share [%] | name |\n| ---: | --- |\n| 3 | a\\|b |\n| 4 | c,\"d\" |";
        assert_eq!(replace(text).unwrap(), text.replace("old", few));
        let message = |text: &str| replace(text).unwrap_err();
        assert_eq!(message("a"), "there is no `<!-- table s.NAME -->`");
        assert!(message("<!-- table s.rates --> a").contains("not followed by `<!-- end -->`"));
        assert!(message("<!-- table s.more -->").contains("`<!-- table s.more` names no table"));
        let unknown = "<!-- table s.rates: rate --><!-- end -->";
        assert_eq!(message(unknown), "table `rates` has no column `rate`");
    }
}
