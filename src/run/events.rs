use std::fs;
use std::path::Path;

use anyhow::Result;

use super::folder::RunFolder;
use super::log::Log;
use super::metrics::kept_lines;

/// Starts a file of scalars for TensorBoard at `wall_time`, in seconds since 1970. TensorBoard
/// finds it if `tfevents` is in its name. Fails if `path` exists.
///
/// A file is a chain of TFRecords: length (u64), masked CRC-32C of the length, data, masked
/// CRC-32C of the data, all little-endian. Each record is an `Event` protocol buffer; the
/// first holds the file version, the others one step's scalars as `simple_value`.
///
/// Checked once against TensorBoard 2.21: its `EventAccumulator` read a file of two tags
/// and six steps and gave back every tag, step, wall
/// time and value, NaN included. Its `RecordWriter` made the golden bytes of the tests.
pub(super) fn create_events(path: &Path, wall_time: f64) -> Result<Log> {
    let mut log = Log::create(path)?;
    log.append(&framed(&version_event(wall_time)))?;
    Ok(log)
}

/// One event of such a file: the `values` (tag, value) of `step`.
pub(super) fn scalar_record(wall_time: f64, step: u64, values: &[(&str, f64)]) -> Vec<u8> {
    framed(&scalar_event(wall_time, step, values))
}

/// `Event { wall_time = 1, file_version = 3 }`.
fn version_event(wall_time: f64) -> Vec<u8> {
    let mut event = Vec::new();
    put(&mut event, 1, WIRE_64_BIT, &wall_time.to_le_bytes());
    put_bytes(&mut event, 3, b"brain.Event:2");
    event
}

/// `Event { wall_time = 1, step = 2, summary = 5 }`, `Summary { repeated value = 1 }`,
/// `Value { tag = 1, simple_value = 2 }`.
fn scalar_event(wall_time: f64, step: u64, values: &[(&str, f64)]) -> Vec<u8> {
    let mut summary = Vec::new();
    for (tag, value) in values {
        let mut message = Vec::new();
        put_bytes(&mut message, 1, tag.as_bytes());
        put(&mut message, 2, WIRE_32_BIT, &(*value as f32).to_le_bytes());
        put_bytes(&mut summary, 1, &message);
    }
    let mut event = Vec::new();
    put(&mut event, 1, WIRE_64_BIT, &wall_time.to_le_bytes());
    put(&mut event, 2, WIRE_VARINT, &[]);
    put_varint(&mut event, step);
    put_bytes(&mut event, 5, &summary);
    event
}

// Wire types of protocol buffers.
const WIRE_VARINT: u64 = 0;
const WIRE_64_BIT: u64 = 1;
const WIRE_LENGTH: u64 = 2;
const WIRE_32_BIT: u64 = 5;

/// The key of a field, and its value where that has one length always.
fn put(out: &mut Vec<u8>, field: u64, wire_type: u64, value: &[u8]) {
    put_varint(out, field << 3 | wire_type);
    out.extend(value);
}

/// Seven bits a byte, lowest first; the top bit says that more follow.
fn put_varint(out: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

fn put_bytes(out: &mut Vec<u8>, field: u64, bytes: &[u8]) {
    put(out, field, WIRE_LENGTH, &[]);
    put_varint(out, bytes.len() as u64);
    out.extend(bytes);
}

/// `data` as one TFRecord.
fn framed(data: &[u8]) -> Vec<u8> {
    let length = (data.len() as u64).to_le_bytes();
    let [of_length, of_data] = [&length[..], data].map(|bytes| masked_crc(bytes).to_le_bytes());
    [&length[..], &of_length, data, &of_data].concat()
}

/// TFRecord stores checksums rotated and shifted, so that a record holding its own
/// checksum does not checksum to a constant.
fn masked_crc(bytes: &[u8]) -> u32 {
    crc32c::crc32c(bytes)
        .rotate_right(15)
        .wrapping_add(0xa282_ead8)
}

/// Cuts the metrics back to their first `lines` and writes the events anew from them.
pub(super) fn reopen_logs(folder: &RunFolder, lines: u64, wall_time: f64) -> Result<[Log; 2]> {
    let kept = kept_lines(&folder.metrics, lines)?;
    let metrics = Log::resume(&folder.metrics, kept.iter().map(|(_, length)| length).sum())?;
    let _ = fs::remove_file(&folder.events);
    let mut events = create_events(&folder.events, wall_time)?;
    for (line, _) in &kept {
        let number = |v: Option<f64>| v.unwrap_or(f64::NAN);
        let values = line.values.iter();
        let values: Vec<(&str, f64)> = values.map(|(k, &v)| (k.as_str(), number(v))).collect();
        let wall_time = line.values.get("wall_time").copied().flatten();
        let record = scalar_record(wall_time.unwrap_or_default(), line.step, &values);
        events.append(&record)?;
    }
    Ok([metrics, events])
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    /// Splits a file into the data of its records and checks every checksum.
    fn unframed(mut bytes: &[u8]) -> Vec<Vec<u8>> {
        let mut records = Vec::new();
        while !bytes.is_empty() {
            let (length, rest) = bytes.split_at(8);
            let (length_crc, rest) = rest.split_at(4);
            assert_eq!(length_crc, masked_crc(length).to_le_bytes());
            let (data, rest) =
                rest.split_at(u64::from_le_bytes(length.try_into().unwrap()) as usize);
            let (data_crc, rest) = rest.split_at(4);
            assert_eq!(data_crc, masked_crc(data).to_le_bytes());
            records.push(data.to_vec());
            bytes = rest;
        }
        records
    }

    #[test]
    fn scalar_event_matches_the_bytes_worked_out_by_hand() {
        let expected = [
            &[0x09][..], // field 1, 64 bit: wall time 1.5
            &[0, 0, 0, 0, 0, 0, 0xf8, 0x3f],
            &[0x10, 0xac, 0x02],             // field 2, varint: step 300
            &[0x2a, 10],                     // field 5, ten bytes: summary
            &[0x0a, 8],                      // field 1, eight bytes: value
            &[0x0a, 1, b'd'],                // field 1: tag
            &[0x15, 0x00, 0x00, 0x00, 0x40], // field 2, 32 bit: 2
        ]
        .concat();
        assert_eq!(scalar_event(1.5, 300, &[("d", 2.0)]), expected);
    }

    /// An event as serialised and framed by TensorBoard's `RecordWriter`.
    #[test]
    fn record_matches_the_bytes_of_tensorboard() {
        let golden = b"\x18\0\0\0\0\0\0\0\xa3\x7f\x4b\x22\
            \x09\0\0\0\0\0\0\xf8\x3f\x10\xac\x02\x2a\x0a\x0a\x08\x0a\x01d\x15\0\0\0\x40\
            \xe8\xe2\xec\x96";
        assert_eq!(framed(&scalar_event(1.5, 300, &[("d", 2.0)])), golden);
    }

    #[test]
    fn file_is_a_chain_of_valid_records() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("events.out.tfevents.drape");
        let mut events = create_events(&path, 1.0).unwrap();
        let record = scalar_record(2.0, 5, &[("a", 1.0), ("b", f64::NAN)]);
        events.append(&record).unwrap();
        events.sync().unwrap();
        let bytes = fs::read(&path).unwrap();
        assert_eq!(
            unframed(&bytes),
            [
                version_event(1.0),
                scalar_event(2.0, 5, &[("a", 1.0), ("b", f64::NAN)])
            ]
        );
    }
}
