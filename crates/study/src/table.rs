//! A table of what a study has measured, and its form as text, Markdown, CSV and JSON.
//!
//! [`Table::of`] takes any rows; each column names itself, its unit and how its cells are got, so
//! that a column is one line of a study. A column `left` in `m` is headed `left [m]` for readers
//! and is the field `left_m` of CSV and JSON.
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

/// What a place of a table holds.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    Text(String),
    /// Not finite where there is no number.
    Number(f64),
    Count(usize),
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Self::Text(text.into())
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl From<f64> for Cell {
    fn from(number: f64) -> Self {
        Self::Number(number)
    }
}

impl From<Option<f64>> for Cell {
    fn from(number: Option<f64>) -> Self {
        Self::Number(number.unwrap_or(f64::NAN))
    }
}

impl From<usize> for Cell {
    fn from(count: usize) -> Self {
        Self::Count(count)
    }
}

/// How a reader is shown the numbers of a column; files have all digits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    /// Decimals.
    Fixed(usize),
    /// Significant digits.
    Digits(usize),
    /// Not at all: the column is in CSV and JSON only.
    Hidden,
}

#[derive(Clone, Debug, PartialEq)]
struct Column {
    name: String,
    /// Empty for none.
    unit: &'static str,
    format: Format,
    cells: Vec<Cell>,
}

/// Rows of cells under named columns.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// Of its file and its key in JSON.
    pub name: &'static str,
    /// What a reader has to know, one line or more.
    pub title: String,
    /// Whether it is for CSV and JSON only.
    pub is_hidden: bool,
    columns: Vec<Column>,
}

/// A [`Table`] that is being made of `rows`.
pub struct TableOf<'a, R> {
    rows: &'a [R],
    table: Table,
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
            is_hidden: false,
            columns: Vec::new(),
        };
        TableOf { rows, table }
    }
}

impl<R> TableOf<'_, R> {
    fn column<C: Into<Cell>>(
        mut self,
        name: impl Into<String>,
        unit: &'static str,
        format: Format,
        of: impl Fn(&R) -> C,
    ) -> Self {
        self.table.columns.push(Column {
            name: name.into(),
            unit,
            format,
            cells: self.rows.iter().map(|row| of(row).into()).collect(),
        });
        self
    }

    /// A column of texts or counts.
    pub fn text<C: Into<Cell>>(self, name: impl Into<String>, of: impl Fn(&R) -> C) -> Self {
        self.column(name, "", Format::Fixed(0), of)
    }

    /// A column of numbers with so many decimals.
    pub fn number<C: Into<Cell>>(
        self,
        name: impl Into<String>,
        unit: &'static str,
        decimals: usize,
        of: impl Fn(&R) -> C,
    ) -> Self {
        self.column(name, unit, Format::Fixed(decimals), of)
    }

    /// A column of numbers with so many significant digits.
    pub fn digits<C: Into<Cell>>(
        self,
        name: impl Into<String>,
        unit: &'static str,
        digits: usize,
        of: impl Fn(&R) -> C,
    ) -> Self {
        self.column(name, unit, Format::Digits(digits), of)
    }

    /// A column that is in CSV and JSON only.
    pub fn hidden<C: Into<Cell>>(
        self,
        name: impl Into<String>,
        unit: &'static str,
        of: impl Fn(&R) -> C,
    ) -> Self {
        self.column(name, unit, Format::Hidden, of)
    }

    /// The table, for CSV and JSON only.
    pub fn end_hidden(self) -> Table {
        Table {
            is_hidden: true,
            ..self.table
        }
    }

    /// The table.
    pub fn end(self) -> Table {
        self.table
    }
}

impl Column {
    /// Field in CSV and JSON.
    fn key(&self) -> String {
        let unit = self.unit.replace('%', "percent").replace("1/", "per ");
        let words = format!("{} {unit}", self.name).to_lowercase();
        let words = words.split(|c: char| !c.is_alphanumeric());
        let words: Vec<&str> = words.filter(|word| !word.is_empty()).collect();
        words.join("_")
    }

    fn head(&self) -> String {
        match self.unit {
            "" => self.name.clone(),
            unit => format!("{} [{unit}]", self.name),
        }
    }

    fn is_text(&self) -> bool {
        self.cells.iter().any(|cell| matches!(cell, Cell::Text(_)))
    }

    /// A cell as a reader is shown it.
    fn shown(&self, row: usize) -> String {
        match (&self.cells[row], self.format) {
            (Cell::Text(text), _) => text.clone(),
            (Cell::Count(count), _) => count.to_string(),
            (Cell::Number(number), _) if !number.is_finite() => "-".into(),
            (Cell::Number(number), _) if number.abs() >= 1e6 => format!("{number:.3e}"),
            (Cell::Number(number), Format::Digits(digits)) => significant(*number, digits),
            (Cell::Number(number), Format::Fixed(decimals)) => {
                let shown = format!("{number:.decimals$}");
                // No sign where all digits are 0.
                let is_zero = shown.trim_matches(['-', '0', '.']).is_empty();
                shown[usize::from(is_zero && shown.starts_with('-'))..].to_owned()
            }
            (Cell::Number(number), Format::Hidden) => number.to_string(),
        }
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
    fn row_count(&self) -> usize {
        self.columns.first().map_or(0, |column| column.cells.len())
    }

    fn shown(&self) -> Vec<&Column> {
        let all = self.columns.iter();
        all.filter(|c| c.format != Format::Hidden).collect()
    }

    /// For a terminal: columns under each other, numbers at their right.
    pub fn text(&self) -> String {
        let columns = self.shown();
        let mut lines = vec![String::new(); self.row_count() + 1];
        for column in columns {
            let cells = (0..self.row_count()).map(|row| column.shown(row));
            let cells: Vec<String> = std::iter::once(column.head()).chain(cells).collect();
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

    /// As a table of Markdown.
    pub fn markdown(&self) -> String {
        self.markdown_of(&self.shown())
    }

    /// As a table of Markdown with some of its columns, named without their units.
    ///
    /// # Errors
    /// If there is none of a name.
    pub fn markdown_with(&self, names: &[&str]) -> Result<String, String> {
        let find = |name: &&str| {
            let found = self.columns.iter().find(|column| column.name == **name);
            found.ok_or_else(|| format!("table `{}` has no column `{name}`", self.name))
        };
        let columns: Result<Vec<&Column>, String> = names.iter().map(find).collect();
        Ok(self.markdown_of(&columns?))
    }

    fn markdown_of(&self, columns: &[&Column]) -> String {
        let line = |cells: Vec<String>| {
            let cells = cells.iter().map(|cell| cell.replace('|', "\\|"));
            format!("| {} |", cells.collect::<Vec<_>>().join(" | "))
        };
        let mut lines = vec![line(columns.iter().map(|c| c.head()).collect())];
        let rule = |c: &&Column| if c.is_text() { "---" } else { "---:" }.to_owned();
        lines.push(line(columns.iter().map(rule).collect()));
        lines.extend(
            (0..self.row_count()).map(|row| line(columns.iter().map(|c| c.shown(row)).collect())),
        );
        lines.join("\n")
    }

    /// As CSV (RFC 4180); numbers that do not exist are empty.
    pub fn csv(&self) -> String {
        let quoted = |text: &str| match text.contains([',', '"', '\n', '\r']) {
            true => format!("\"{}\"", text.replace('"', "\"\"")),
            false => text.to_owned(),
        };
        let line = |of: &dyn Fn(&Column) -> String| {
            let cells = self.columns.iter().map(of);
            cells.collect::<Vec<_>>().join(",") + "\n"
        };
        let mut text = line(&Column::key);
        for row in 0..self.row_count() {
            text += &line(&|column| match &column.cells[row] {
                Cell::Text(text) => quoted(text),
                Cell::Count(count) => count.to_string(),
                Cell::Number(number) if number.is_finite() => number.to_string(),
                Cell::Number(_) => String::new(),
            });
        }
        text
    }

    /// As a list of objects; numbers that do not exist are null.
    pub fn json(&self) -> Value {
        let object = |row: usize| {
            let fields = self.columns.iter().map(|column| {
                let value = match &column.cells[row] {
                    Cell::Text(text) => text.as_str().into(),
                    Cell::Count(count) => (*count).into(),
                    Cell::Number(number) => (*number).into(),
                };
                (column.key(), value)
            });
            Value::Object(fields.collect())
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
        .number("distance left", "m", 2, |row| row.1)
        .hidden("share", "%", |row| row.2)
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
            table.markdown(),
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
            replace_tables(text, "s", &["rates"], |_, columns| match columns {
                [] => Ok(table.markdown()),
                columns => table.markdown_with(columns),
            })
        };
        let text = "a\n<!-- table s.rates -->\nold\n<!-- end -->\nb <!-- table t.x --> c";
        let found = replace(text).unwrap();
        assert_eq!(found, text.replace("old", &table.markdown()));
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
