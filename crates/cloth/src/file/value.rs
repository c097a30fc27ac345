/// Resolved configurations without keys that are skipped if this is so read as they always did.
pub(crate) fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// A value of a configuration that makes no sense.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{key}` is {found}, expected {expected}")]
pub struct ValueError {
    /// Where it stands, from the outermost table on.
    pub key: String,
    pub found: String,
    pub expected: String,
}

impl ValueError {
    /// Names what stands at `key`, and what was expected there.
    pub fn new(key: &str, found: impl ToString, expected: impl Into<String>) -> Self {
        Self {
            key: key.into(),
            found: shortened(&found.to_string()),
            expected: expected.into(),
        }
    }

    /// Refuses what stands at `key` unless it `is_valid`.
    pub fn unless(
        is_valid: bool,
        key: &str,
        found: impl ToString,
        expected: impl Into<String>,
    ) -> Result<(), Self> {
        match is_valid {
            true => Ok(()),
            false => Err(Self::new(key, found, expected)),
        }
    }

    /// Refuses what stands at `key` unless it is a number from `min` to `max`.
    pub fn unless_within(key: &str, found: f64, [min, max]: [f64; 2]) -> Result<(), Self> {
        let expected = format!("a number from {min} to {max}");
        Self::unless((min..=max).contains(&found), key, found, expected)
    }

    /// This error with its key in the table `outer`.
    pub fn within(mut self, outer: &str) -> Self {
        self.key = format!("{outer}.{}", self.key);
        self
    }
}

/// A text with exponents for numbers of more than 24 digits, which say less.
fn shortened(text: &str) -> String {
    let is_of_number = |c: char| c.is_ascii_digit() || c == '.';
    let parts = text.split_inclusive(|c| !is_of_number(c));
    let part = |part: &str| {
        let digits = part.trim_end_matches(|c| !is_of_number(c));
        match digits.parse::<f64>() {
            Ok(number) if digits.len() > 24 => format!("{number:e}{}", &part[digits.len()..]),
            _ => part.into(),
        }
    };
    parts.map(part).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_numbers_have_exponents_wherever_they_stand() {
        let found = format!("[{}, -{}, 0.35]", 1e300, 1e-300);
        let error = ValueError::new("key", found, "less");
        assert_eq!(error.found, "[1e300, -1e-300, 0.35]");
    }
}
