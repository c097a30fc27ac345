//! What is sent to a page: a header of JSON and columns of numbers.

use serde::Serialize;
use serde_json::{Value, json};

/// A message to a page. Its bytes are the length of the header (`u32`), the header, and the columns as its key
/// `parts` lists them, each begun at a multiple of four; little-endian.
pub struct Message {
    header: Value,
    parts: Vec<Value>,
    body: Vec<u8>,
}

/// A type of numbers that JavaScript has arrays of.
pub trait WireNumber: Copy {
    const NAME: &'static str;
    fn write(self, to: &mut Vec<u8>);
}

macro_rules! numbers {
    ($($type:ty),*) => {$(impl WireNumber for $type {
        const NAME: &'static str = stringify!($type);
        fn write(self, to: &mut Vec<u8>) {
            to.extend(self.to_le_bytes());
        }
    })*};
}
numbers!(u8, i8, u16, u32, f32);

impl Message {
    /// # Panics
    /// If the header is no object.
    pub fn new(header: &impl Serialize) -> Self {
        let header = serde_json::to_value(header).expect("plain data is JSON");
        assert!(header.is_object(), "a header has keys");
        Self {
            header,
            parts: Vec::new(),
            body: Vec::new(),
        }
    }

    /// With one more column.
    pub fn with<N: WireNumber>(mut self, name: &str, numbers: impl IntoIterator<Item = N>) -> Self {
        let start = self.body.len();
        numbers.into_iter().for_each(|n| n.write(&mut self.body));
        let count = (self.body.len() - start) / size_of::<N>();
        self.body.resize(self.body.len().next_multiple_of(4), 0);
        self.parts.push(json!([name, N::NAME, count]));
        self
    }

    /// As it is sent.
    pub fn bytes(mut self) -> Vec<u8> {
        self.header["parts"] = self.parts.into();
        let mut header = self.header.to_string();
        while !header.len().is_multiple_of(4) {
            header.push(' ');
        }
        let length = (header.len() as u32).to_le_bytes();
        [&length[..], header.as_bytes(), &self.body].concat()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_begin_at_multiples_of_four() {
        let message = Message::new(&json!({"a": 1}))
            .with("b", [1u8, 2, 3])
            .with("c", [1.5f32]);
        let bytes = message.bytes();
        let length = u32::from_le_bytes(bytes[..4].try_into().unwrap()) as usize;
        let header: Value = serde_json::from_slice(&bytes[4..4 + length]).unwrap();
        assert_eq!(
            header,
            json!({"a": 1, "parts": [["b", "u8", 3], ["c", "f32", 1]]})
        );
        assert_eq!(length % 4, 0);
        let body = [&[1, 2, 3, 0][..], &1.5f32.to_le_bytes()].concat();
        assert_eq!(bytes[4 + length..], body);
    }
}
