//! What arguments of several commands may say.

use std::path::PathBuf;

use drape_cloth::sim::Accuracy;

/// A preset of the accuracy by its name.
pub(super) fn accuracy(name: &str) -> Result<Accuracy, String> {
    Accuracy::named(name).ok_or("expected fast, balanced or accurate".into())
}

pub(super) fn positive(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(number) if number > 0.0 && number <= 1e6 => Ok(number),
        _ => Err("expected a number > 0 and at most 1000000".into()),
    }
}

pub(super) fn not_negative(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(number) if (0.0..=1e6).contains(&number) => Ok(number),
        _ => Err("expected a number from 0 to 1000000".into()),
    }
}

/// A picture must not replace what is compared.
pub(super) fn png(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    match path.extension() {
        Some(end) if end.eq_ignore_ascii_case("png") => Ok(path),
        _ => Err("expected a file that ends in .png".into()),
    }
}
