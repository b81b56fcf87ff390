//! Recordings: written, cut off, recovered, exported, decoded again.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test")]

use capsense_hw::profile::{DeviceProfile, Transfer, built_in};
use capsense_hw::recording::{
    Decoded, Entry, Header, Note, RecordingError, RecordingReader, RecordingWriter, Samples, export_csv,
    export_parquet, recover,
};
use capsense_hw::stream::{Decoder, Encoder, Sample, Start, Value};
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::RowAccessor;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

const BEGAN: u64 = 1_800_000_000_000_000_000;
const PERIOD: Duration = Duration::from_millis(10);

fn farads(sample: usize, channel: usize) -> f64 {
    (1.0 + 0.1 * channel as f64 + 0.01 * (sample as f64 * 0.1).sin()) * 1e-12
}

/// What a board sends of `count` samples, each in pieces that are cut without regard to it.
fn bytes(profile: &DeviceProfile, sample: usize) -> Vec<u8> {
    let values: Vec<Value> = (0..4).map(|channel| profile.raw(channel, farads(sample, channel))).collect();
    let mut bytes = Vec::new();
    let device_time = Some(PERIOD * sample as u32);
    let sample = Sample { values: &values, sequence: Some(sample as u32), device_time, status: 0 };
    Encoder::new(&profile.stream).unwrap().encode(&sample, &mut bytes);
    bytes
}

/// Records samples as they come from a port, and tells the length of the file after each.
fn record(path: &Path, profile: &DeviceProfile, count: usize) -> (RecordingWriter, Vec<u64>) {
    let header = Header::new("/dev/ttyTEST", BEGAN, profile).unwrap();
    let mut writer = RecordingWriter::create(path, &header).unwrap();
    let mut decoder = Decoder::new(&profile.stream, Start::Anywhere).unwrap();
    writer.note(Duration::ZERO, &Note::Connected).unwrap();
    let (mut lengths, mut before) = (Vec::new(), Vec::new());
    for sample in 0..count {
        for (part, piece) in bytes(profile, sample).chunks(13).enumerate() {
            let time = PERIOD * sample as u32 + Duration::from_micros(part as u64);
            writer.raw(time, piece).unwrap();
            decoder.push(piece, time, &mut |stamped| writer.event(&stamped).unwrap());
            writer.tick(time).unwrap();
        }
        let now = fs::read(partial(path)).unwrap();
        assert!(now.starts_with(&before), "the file changed before its end");
        lengths.push(now.len() as u64);
        before = now;
    }
    (writer, lengths)
}

fn partial(path: &Path) -> PathBuf {
    PathBuf::from(format!("{}.partial", path.display()))
}

fn samples(path: &Path) -> Vec<Decoded> {
    Samples::new(RecordingReader::open(path).unwrap(), None).unwrap().map(Result::unwrap).collect()
}

#[test]
fn what_was_recorded_is_read_and_exported() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let profile = built_in("fdc2214").unwrap();
    let (writer, _) = record(&path, &profile, 100);
    assert!(!path.exists());
    assert_eq!(writer.finish().unwrap(), path);
    assert!(!partial(&path).exists());

    let reader = RecordingReader::open(&path).unwrap();
    assert_eq!(reader.header().device_profile().unwrap(), profile);
    let raw: Vec<u8> = reader
        .filter_map(|entry| match entry.unwrap() {
            Entry::Raw(_, bytes) => Some(bytes),
            Entry::Note(..) => None,
        })
        .flatten()
        .collect();
    assert_eq!(raw, (0..100).flat_map(|sample| bytes(&profile, sample)).collect::<Vec<u8>>());

    let read = samples(&path);
    assert_eq!(read.len(), 100);
    for (at, sample) in read.iter().enumerate() {
        assert_eq!((sample.sequence, sample.device_time), (Some(at as u32), Some(PERIOD * at as u32)));
        assert!(sample.time >= PERIOD * at as u32 && sample.time < PERIOD * (at as u32 + 1));
        let value = profile.reading(2, sample.values[2]).value.unwrap();
        assert!((value - farads(at, 2)).abs() < 2e-18, "{value} is not {}", farads(at, 2));
    }

    let csv = folder.path().join("a.csv");
    assert_eq!(export_csv(&path, None, &csv).unwrap().samples, 100);
    let text = fs::read_to_string(&csv).unwrap();
    let header = "time_s,device_time_s,sequence,status,C1_raw,C1_F,C2_raw,C2_F,C3_raw,C3_F,C4_raw,C4_F,flags";
    assert_eq!(text.lines().next(), Some(header));
    let row: Vec<&str> = text.lines().nth(8).unwrap().split(',').collect();
    assert_eq!((row.len(), row[1], row[2], row[12]), (13, "0.07", "7", ""));
    let Value::Number(number) = read[7].values[3] else { panic!("no number") };
    assert_eq!(
        (row[10].parse(), row[11].parse()),
        (Ok(number), Ok(profile.reading(3, read[7].values[3]).value.unwrap()))
    );

    let table = folder.path().join("a.parquet");
    assert_eq!(export_parquet(&path, None, &table).unwrap().channels, 4);
    let file = SerializedFileReader::new(fs::File::open(&table).unwrap()).unwrap();
    let rows: Vec<_> = file.get_row_iter(None).unwrap().map(Result::unwrap).collect();
    assert_eq!(rows.len(), 100);
    assert_eq!((rows[7].get_double(10).unwrap(), rows[7].get_long(2).unwrap()), (number, 7));
}

/// The program may be killed between any two bytes that reach the file: of what was told more than 200 ms before nothing
/// is lost, and what is saved is true.
#[test]
fn a_recording_cut_off_anywhere_is_recovered() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let profile = built_in("fdc2214-sketch").unwrap();
    let (writer, lengths) = record(&path, &profile, 300);
    let whole = fs::read(partial(&path)).unwrap();
    assert_eq!(*lengths.last().unwrap(), whole.len() as u64);
    drop(writer);
    let (cut, saved) = (folder.path().join("cut.mcap"), folder.path().join("saved.mcap"));
    let mut tried = 0;
    for length in (lengths[0] as usize..=whole.len()).step_by(whole.len() / 97) {
        fs::write(&cut, &whole[..length]).unwrap();
        recover(&cut, &saved).unwrap();
        let read = samples(&saved);
        let written = lengths.partition_point(|after| *after <= length as u64);
        assert!(read.len() + 22 >= written, "{} of {written} samples", read.len());
        for (at, sample) in read.iter().enumerate() {
            // The first line may have been cut when the port was opened.
            assert_eq!(sample.values[0], profile.raw(0, farads(at + 1, 0)));
        }
        fs::remove_file(&saved).unwrap();
        tried += 1;
    }
    assert!(tried >= 50);
}

/// As the documentation says: the whole recording takes the name that the one cut off would have had.
#[test]
fn a_recording_is_recovered_under_its_own_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let (writer, _) = record(&path, &built_in("fdc2214").unwrap(), 100);
    drop(writer);
    let report = recover(&partial(&path), &path).unwrap();
    assert!(report.messages > 0 && !samples(&path).is_empty());
    assert!(partial(&path).exists(), "nothing is taken away");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
    assert!(recover(&partial(&path), &path).is_err(), "nor overwritten");
}

#[test]
fn a_recording_that_is_cut_off_is_not_taken_for_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let (writer, _) = record(&path, &built_in("fdc2214").unwrap(), 100);
    writer.finish().unwrap();
    let whole = fs::read(&path).unwrap();
    let cut = folder.path().join("cut.mcap");
    fs::write(&cut, &whole[..whole.len() / 2]).unwrap();
    let error = export_csv(&cut, None, &folder.path().join("a.csv")).unwrap_err();
    assert!(
        matches!(error, RecordingError::Damaged { .. }) && error.to_string().contains("recover"),
        "{error}"
    );
    let report = recover(&path, &folder.path().join("copy.mcap")).unwrap();
    assert_eq!(report.cut_off, None);
    assert_eq!(samples(&folder.path().join("copy.mcap")), samples(&path));
}

#[test]
fn a_better_profile_decodes_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let mut profile = built_in("fdc2214").unwrap();
    record(&path, &profile, 5).0.finish().unwrap();
    let Transfer::Resonator(resonator) = &mut profile.transfer else { panic!("no resonator") };
    resonator.inductance_henries *= 2.0;
    let csv = folder.path().join("a.csv");
    export_csv(&path, Some(&profile), &csv).unwrap();
    let text = fs::read_to_string(&csv).unwrap();
    let value: f64 = text.lines().nth(1).unwrap().split(',').nth(5).unwrap().parse().unwrap();
    let expected = (farads(0, 0) + 33e-12) / 2.0 - 33e-12;
    assert!((value - expected).abs() < 1e-17, "{value} is not {expected}");
}

#[test]
fn what_is_missing_is_an_empty_cell_with_a_word() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let profile = built_in("fdc1004-breakout").unwrap();
    let mut writer = RecordingWriter::create(&path, &Header::new("p", BEGAN, &profile).unwrap()).unwrap();
    writer.raw(Duration::ZERO, b"\n12.5\t11.14\tERROR\t\t0.02\tnote\n").unwrap();
    writer.finish().unwrap();
    let csv = folder.path().join("a.csv");
    export_csv(&path, None, &csv).unwrap();
    let text = fs::read_to_string(&csv).unwrap();
    assert_eq!(text.lines().nth(1), Some("0,12.5,,0,11.14,1.114e-11,,,,,0.02,2e-14,C2:invalid C3:missing"));
    export_parquet(&path, None, &folder.path().join("a.parquet")).unwrap();
}

/// Half a line before the plug was pulled and half a line after make no line.
#[test]
fn halves_around_a_lost_connection_are_not_joined() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let header = Header::new("p", BEGAN, &built_in("text").unwrap()).unwrap();
    let mut writer = RecordingWriter::create(&path, &header).unwrap();
    let second = Duration::from_secs(1);
    writer.raw(second, b"1\n2\n12").unwrap();
    writer.note(2 * second, &Note::Disconnected { reason: "Broken pipe".to_owned() }).unwrap();
    writer.note(3 * second, &Note::Connected).unwrap();
    writer.raw(4 * second, b"34\n5\n").unwrap();
    writer.finish().unwrap();
    let numbers: Vec<Vec<Value>> = samples(&path).into_iter().map(|sample| sample.values).collect();
    assert_eq!(numbers, [[Value::Number(2.0)], [Value::Number(5.0)]]);
}

#[test]
fn nothing_is_overwritten_and_nothing_foreign_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    fs::write(&path, "precious").unwrap();
    let header = Header::new("p", BEGAN, &built_in("text").unwrap()).unwrap();
    assert!(matches!(RecordingWriter::create(&path, &header), Err(RecordingError::File { .. })));
    assert!(matches!(RecordingReader::open(&path), Err(RecordingError::Damaged { .. })));
    assert!(matches!(recover(&path, &folder.path().join("b.mcap")), Err(RecordingError::Foreign { .. })));
    assert!(!folder.path().join("b.mcap").exists());
    assert_eq!(fs::read_to_string(&path).unwrap(), "precious");

    let mut other = header.clone();
    other.version = 2;
    let later = folder.path().join("later.mcap");
    RecordingWriter::create(&later, &other).unwrap().finish().unwrap();
    assert!(matches!(RecordingReader::open(&later), Err(RecordingError::Foreign { .. })));
}
