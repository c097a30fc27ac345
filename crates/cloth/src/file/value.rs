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
        // Hundreds of digits say less than an exponent.
        let found = found.to_string();
        let long = found.parse().ok().filter(|_| found.len() > 24);
        Self {
            key: key.into(),
            found: long.map_or(found, |number: f64| format!("{number:e}")),
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
