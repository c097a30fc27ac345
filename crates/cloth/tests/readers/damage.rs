//! Damages files as disks, editors, hands and enemies do, and holds readers against what comes.

use std::collections::HashSet;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use std::{env, fs};

/// Counts what is allocated, and ends the process where a reader asks for more than it may.
#[global_allocator]
static ALLOCATOR: cap::Cap<std::alloc::System> = cap::Cap::new(std::alloc::System, usize::MAX);

/// Memory of a reader on top of what was there before [bytes].
const MEMORY: usize = 512 << 20;
/// A reader that takes as long hangs: they take milliseconds.
const HANG: Duration = Duration::from_secs(60);

/// Values at the ends of what formats hold.
const EXTREMES: [&str; 24] = [
    "0",
    "-0",
    "-1",
    "1",
    "2",
    "255",
    "65536",
    "4294967295",
    "4294967296",
    "9223372036854775807",
    "18446744073709551616",
    "1e10",
    "1e39",
    "-1e39",
    "1e300",
    "1e400",
    "1e-300",
    "5e-324",
    "nan",
    "inf",
    "-inf",
    "null",
    "true",
    "\"\"",
];

/// What is put between other tokens.
const TOKENS: [&str; 16] = [
    "[", "]", "{", "}", ",", ", 1", "\"", "=", ":", "\n", "[[", "]]", "#", "\u{feff}", "\u{0}", "é",
];

/// Where the input lies that is being read, or at which a test has failed.
pub fn folder() -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("readers");
    fs::create_dir_all(&folder).expect("a folder for inputs");
    folder
}

/// A text with a byte-order mark, with other line ends, in Latin-1 and in UTF-16.
pub fn dialects(text: &str) -> Vec<Vec<u8>> {
    let returns = text.replace('\n', "\r");
    let wide = |text: &str| text.encode_utf16().flat_map(u16::to_le_bytes).collect();
    vec![
        format!("\u{feff}{text}").into(),
        text.replace('\n', "\r\n").into(),
        format!("\u{feff}{returns}").into(),
        [text.to_uppercase().as_bytes(), b"\xb5 "].concat(),
        wide(text),
        wide(&format!("\u{feff}{text}")),
    ]
}

/// Reads every file of the `corpus` and as many damaged ones as `DRAPE_DAMAGED` says, `count`
/// without, as `name` in [`folder`]. What has shown a behaviour that is new is damaged further.
/// `read` also makes of what it has read whatever comes next.
///
/// # Panics
/// If a reader panics, hangs, exhausts the memory, or refuses in more than a plain line.
pub fn survives(
    name: &str,
    corpus: &[Vec<u8>],
    count: usize,
    read: impl Fn(&Path) -> Result<(), String>,
) {
    let given = |name: &str| {
        env::var(name)
            .ok()
            .map(|text| text.parse().expect("a number"))
    };
    let count = given("DRAPE_DAMAGED").unwrap_or(count as u64) as usize;
    let mut damage = Damage(given("DRAPE_SEED").unwrap_or(1));
    let path = folder().join(name);
    let (mut corpus, mut valid) = (corpus.to_vec(), Vec::new());
    let (mut seen, mut accepted) = (HashSet::new(), 0);
    let (first, mut slowest) = (corpus.len(), Duration::ZERO);
    for index in 0..first + count {
        let bytes = match index < first {
            true => corpus[index].clone(),
            // Most often what is read, which has deeper to go.
            false if damage.below(4) > 0 && !valid.is_empty() => damage.apply(&valid, &corpus),
            false => damage.apply(&corpus, &corpus),
        };
        fs::write(&path, &bytes).expect("inputs are written");
        let (place, start) = (path.display(), Instant::now());
        let _ = ALLOCATOR.set_limit(ALLOCATOR.allocated() + MEMORY);
        let outcome = catch_unwind(AssertUnwindSafe(|| read(&path)));
        let _ = ALLOCATOR.set_limit(usize::MAX);
        slowest = slowest.max(start.elapsed());
        assert!(slowest < HANG, "{place}: {slowest:?}");
        let outcome = outcome.unwrap_or_else(|_| panic!("{place}: input {index} panics"));
        let behaviour = match outcome {
            Ok(()) => {
                accepted += 1;
                if valid.len() < 200 {
                    valid.push(bytes.clone());
                }
                "accepted".into()
            }
            Err(message) => {
                check(&message, &path);
                message.replace(|c: char| c.is_ascii_digit(), "")
            }
        };
        // As far as the first thing that is quoted.
        let kind = behaviour.split(['`', '"', '[']).take(3).collect::<String>();
        if seen.insert(kind) && index >= first {
            corpus.push(bytes);
        }
    }
    let refused = first + count - accepted;
    println!(
        "{name}: {accepted} accepted, {refused} refused in {} ways, {slowest:?}",
        seen.len()
    );
}

/// Names of Rust's and of its crates, which say nothing to whoever wrote the file.
const RUST: [&str; 12] = [
    "usize", "u32", "u64", "f32", "f64", "i64", "variant", "sequence", "struct", "newtype",
    "tuple", "panicked",
];

fn check(message: &str, path: &Path) {
    let place = path.display();
    assert!(
        !message.is_empty() && message.len() < 2000,
        "{place}: {message}"
    );
    assert!(!message.contains(['\n', '\r']), "{place}: {message:?}");
    // What is quoted is the file's own.
    let own: String = message.split(['`', '"']).step_by(2).collect();
    for word in own.split(|c: char| !c.is_alphanumeric() && c != '_') {
        assert!(!RUST.contains(&word), "{place}: `{word}` in {message}");
    }
}

/// A random stream (SplitMix64).
struct Damage(u64);

impl Damage {
    /// At least 0, below `end` > 0.
    fn below(&mut self, end: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % end as u64) as usize
    }

    fn range(&mut self, end: usize) -> std::ops::Range<usize> {
        let [a, b] = [self.below(end + 1), self.below(end + 1)];
        a.min(b)..a.max(b)
    }

    fn one<'a, T: ?Sized>(&mut self, of: &[&'a T]) -> &'a T {
        of[self.below(of.len())]
    }

    /// One of `files`, damaged in one to three places, also by parts of `others`.
    fn apply(&mut self, files: &[Vec<u8>], others: &[Vec<u8>]) -> Vec<u8> {
        let mut bytes = files[self.below(files.len())].clone();
        for _ in 0..=self.below(2) * self.below(3) {
            let other = &others[self.below(others.len())];
            bytes = match self.below(4) {
                0 => self.bytes(bytes, other),
                1 => self.pieces(&bytes, other, |text| {
                    text.split_inclusive(|&b| b == b'\n').collect()
                }),
                _ => self.pieces(&bytes, other, tokens),
            };
            bytes.truncate(1 << 16);
        }
        bytes
    }

    fn bytes(&mut self, mut bytes: Vec<u8>, other: &[u8]) -> Vec<u8> {
        let (at, part) = (self.below(bytes.len() + 1), self.range(bytes.len()));
        match self.below(5) {
            0 => bytes.truncate(at),
            1 => drop(bytes.drain(part)),
            2 => drop(bytes.splice(at..at, other[self.range(other.len())].to_vec())),
            3 if at < bytes.len() => bytes[at] ^= 1 << self.below(8),
            _ => {
                let ends = [
                    u32::MAX,
                    0,
                    1,
                    1 << 31,
                    1e30f32.to_bits(),
                    f32::NAN.to_bits(),
                ];
                let number = ends[self.below(6)].to_le_bytes();
                let end = bytes.len().min(at + 4);
                bytes.splice(at..end, number);
            }
        }
        bytes
    }

    /// Damages a file in lines or tokens.
    fn pieces(
        &mut self,
        bytes: &[u8],
        other: &[u8],
        split: impl for<'a> Fn(&'a [u8]) -> Vec<&'a [u8]>,
    ) -> Vec<u8> {
        let (mut pieces, others) = (split(bytes), split(other));
        let (at, part) = (self.below(pieces.len().max(1)), self.range(pieces.len()));
        let text = match self.below(3) {
            0 if !others.is_empty() => self.one(&others),
            1 => self.one(&TOKENS).as_bytes(),
            _ => self.one(&EXTREMES).as_bytes(),
        };
        let is_number = |i: &usize| pieces[*i][0].is_ascii_digit();
        let numbers: Vec<usize> = (0..pieces.len()).filter(is_number).collect();
        match self.below(7) {
            _ if pieces.is_empty() => pieces.push(text),
            0 => drop(pieces.remove(at)),
            1 => pieces.insert(at, text),
            2 => pieces[at] = text,
            3 if !part.is_empty() => pieces.swap(part.start, at),
            4 if part.len() < 30 => {
                let twice = pieces[part.clone()].to_vec();
                drop(pieces.splice(part.end..part.end, twice));
            }
            _ if numbers.is_empty() => pieces[at] = text,
            _ => pieces[numbers[self.below(numbers.len())]] = self.one(&EXTREMES).as_bytes(),
        }
        pieces.concat()
    }
}

/// Words, numbers, and all else by the byte.
fn tokens(bytes: &[u8]) -> Vec<&[u8]> {
    let is_word = |b: &u8| b.is_ascii_alphanumeric() || b"_.+-".contains(b);
    bytes.chunk_by(|a, b| is_word(a) && is_word(b)).collect()
}
