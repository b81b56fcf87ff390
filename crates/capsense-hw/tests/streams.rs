//! Lines and frames of the shapes that real firmware sends, through the profiles that are shipped for them.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test")]

use capsense_hw::profile::built_in;
use capsense_hw::stream::checksum::Checksum;
use capsense_hw::stream::{Decoder, Encoder, Event, Sample, Start, Value};
use std::time::Duration;

/// Every event as text.
fn decode(profile: &str, start: Start, pieces: &[&[u8]]) -> Vec<String> {
    let mut decoder = Decoder::new(&built_in(profile).unwrap().stream, start).unwrap();
    let mut events = Vec::new();
    let mut note =
        |stamped: capsense_hw::stream::Stamped<'_>| events.push(told(stamped.length, stamped.event));
    for piece in pieces {
        decoder.push(piece, Duration::ZERO, &mut note);
    }
    decoder.finish(Duration::ZERO, &mut note);
    events
}

fn told(length: u64, event: Event<'_>) -> String {
    let values = |values: &[Value]| {
        let texts: Vec<String> = values
            .iter()
            .map(|value| match value {
                Value::Number(number) => number.to_string(),
                Value::Missing => "_".to_owned(),
                Value::Invalid => "!".to_owned(),
            })
            .collect();
        texts.join(" ")
    };
    match event {
        Event::Sample(sample) => {
            let clock =
                sample.device_time.map(|time| format!("@{} ", time.as_secs_f64())).unwrap_or_default();
            let status =
                if sample.status == 0 { String::new() } else { format!(" status {}", sample.status) };
            format!("{clock}{}{status}", values(sample.values))
        }
        Event::Text(line) => format!("`{}`", String::from_utf8_lossy(line)),
        Event::Resync => format!("passed over {length}"),
        Event::Gap(missing) => format!("gap {missing:?}"),
    }
}

fn lines(profile: &str, text: &str) -> Vec<String> {
    decode(profile, Start::Boundary, &[text.as_bytes()])
}

#[test]
fn fdc2214_sketch() {
    let events =
        lines("fdc2214-sketch", "FDC2x1x test\r\nSensor OK\r\n43823473, 43820011, 34580067, 34580100\r\n");
    assert_eq!(events, ["`FDC2x1x test`", "`Sensor OK`", "43823473 43820011 34580067 34580100"]);
}

#[test]
fn fdc1004_breakout() {
    let text = "✓ FDC1004 found\nTime\tCH1\tCH2\tCH3\tCH4\n12.5\t11.14\tERROR\t3.20\t0.02\t[OEAO] CAPDAC: CH2=4\n\
                12.6\t11.14\t2.50\t3.20\t0.02\n";
    let expected = [
        "`✓ FDC1004 found`",
        "`Time\tCH1\tCH2\tCH3\tCH4`",
        "@12.5 11.14 ! 3.2 0.02",
        "@12.6 11.14 2.5 3.2 0.02",
    ];
    assert_eq!(lines("fdc1004-breakout", text), expected);
}

#[test]
fn fdc1004_labelled() {
    let events =
        lines("fdc1004-labelled", "Capacitance (pF):  1.20 3.40 0.00 31.99\nCapacitance (pF):  1.2 3.4\n");
    assert_eq!(events, ["1.2 3.4 0 31.99", "`Capacitance (pF):  1.2 3.4`"]);
}

#[test]
fn fdc1004_multichannel() {
    let text = "cap A, 12345 , 11.1383\nCapacitance out of bounds, re-running setCAPDAC\ncap C, 0 , -1.0000\n\
                cap D, 7 , 0.5\ncap E, 7 , 0.5\n";
    let expected = [
        "11.1383 _ _ _",
        "`Capacitance out of bounds, re-running setCAPDAC`",
        "_ _ _ _",
        "_ _ _ 0.5",
        "`cap E, 7 , 0.5`",
    ];
    assert_eq!(lines("fdc1004-multichannel", text), expected);
}

#[test]
fn ad7747() {
    let events = lines("ad7747", "4.1234567890, 4.0000000000, 3.9000000000\n");
    assert_eq!(events, ["4.123456789 4 3.9"]);
}

#[test]
fn bare_numbers() {
    assert_eq!(lines("text", "-9089\n12\t345\t346\t347\n1,2 3\n"), ["-9089", "12 345 346 347", "1 2 3"]);
    assert_eq!(lines("text", "nan 3 inf\nOVF -3.-7 5\n\nhello 3\n"), ["! 3 !", "! ! 5", "``", "`hello 3`"]);
}

/// A grid of six electrodes as a robot carries it: rows of six counts between tabs, Windows line ends, the first line cut.
#[test]
fn six_counts_between_tabs() {
    let rows: Vec<String> = (0..40)
        .map(|n| (0..6).map(|c| (650 + 7 * c + n % 5).to_string()).collect::<Vec<_>>().join("\t"))
        .collect();
    let text = format!("54\t683\t672\t652\r\n{}\r\n", rows.join("\r\n"));
    let pieces: Vec<&[u8]> = text.as_bytes().chunks(17).collect();
    let events = decode("text", Start::Anywhere, &pieces);
    let expected: Vec<String> = rows.iter().map(|row| row.replace('\t', " ")).collect();
    assert_eq!(events[0], "passed over 16");
    assert_eq!(events[1..], expected);
}

#[test]
fn labelled_crossings() {
    let events = lines("grid-labelled", "8123 , Row 0, Col 1 : 43823473\n8123 , Row 9, Col 1 : 43823473\n");
    assert_eq!(events[0], "_ 43823473 _ _ _ _ _ _ _ _ _ _ _ _ _ _");
    assert_eq!(events[1], "`8123 , Row 9, Col 1 : 43823473`");
}

#[test]
fn grids_with_zeros_left_out() {
    let mut line = "12,,,40".to_owned() + &",".repeat(248) + "\n";
    let events = lines("grid-252", &line);
    assert_eq!(events, ["12 _ _ 40".to_owned() + &" _".repeat(248)]);
    line.insert_str(0, "5,");
    assert_eq!(lines("grid-252", &line).len(), 1, "one field too many may be empty");
    line.insert_str(0, "5,");
    assert!(lines("grid-252", &line)[0].starts_with('`'));
}

#[test]
fn touch_read() {
    assert_eq!(lines("teensy", "touch_values: 850 851 849 \n"), ["850 851 849"]);
}

#[test]
fn mpr121() {
    let twelve = (500..512).map(|count| count.to_string()).collect::<Vec<_>>();
    let text = format!("Filt: {}\nBase: {}\n", twelve.join("\t"), twelve.join("\t"));
    let events = lines("mpr121-filtered", &text);
    assert_eq!(events[0], twelve.join(" "));
    assert!(events[1].starts_with("`Base: 500"));
    assert_eq!(lines("mpr121-plotter", "0,512,512,  550,498,498,  \n"), ["0 512 512 550 498 498"]);
}

#[test]
fn plotters() {
    let expected = ["1 -2.5", "3", "`a:b`"];
    assert_eq!(lines("plotter", "left:1,\t right:-2.5\r\nleft:3\na:b\n"), expected);
    let text = "C2:1627551892437:1234§km²|g\n>C3:5.5\nC9:3\nC1:1627551892437:9|np\n";
    let expected = ["@1627551892.437 _ 1234 _ _", "_ _ 5.5 _", "`C9:3`", "@1627551892.437 9 _ _ _"];
    assert_eq!(lines("teleplot", text), expected);
}

#[test]
fn a_first_line_that_may_be_cut_is_passed_over() {
    let pieces: [&[u8]; 2] = [b"473, 43820011\n1, 2, ", b"3, 4\n5, 6, 7"];
    let events = decode("fdc2214-sketch", Start::Anywhere, &pieces);
    assert_eq!(events, ["passed over 14", "1 2 3 4", "passed over 7"]);
}

#[test]
fn a_line_too_long_is_passed_over_to_its_end() {
    let text = "9".repeat(5000) + ", 1, 2, 3\n5, 6, 7, 8\n";
    assert_eq!(lines("fdc2214-sketch", &text), ["passed over 5010", "5 6 7 8"]);
}

fn evm_frame(error: u8, first: u32) -> Vec<u8> {
    let mut frame = vec![0x4C, 0x05, 0x01, error, 0x00, 0x19];
    for channel in 0..4 {
        frame.extend((first + channel).to_be_bytes());
    }
    frame.resize(31, 0);
    frame.push(Checksum::Crc8Smbus.of(&frame) as u8);
    frame
}

#[test]
fn evaluation_module() {
    let stream = [evm_frame(0, 0x029C_AFF1), evm_frame(0, 0x229C_AFF1), evm_frame(5, 0)].concat();
    let events = decode("fdc2214-evm", Start::Anywhere, &[&[0x4C, 7], &stream]);
    assert_eq!(events[0], "passed over 2");
    assert_eq!(events[1], "43823089 43823090 43823091 43823092");
    let reading = built_in("fdc2214-evm").unwrap().reading(0, Value::Number(f64::from(0x229C_AFF1)));
    assert_eq!(reading.flags, 0x2000_0000);
    assert_eq!(events[3], "0 1 2 3 status 5");
    assert_eq!(events.len(), 4);
}

#[test]
fn markers() {
    let pair = [0x02, 0xFE, 0x34, 0x12, 0xFF, 0xFF, 0x03, 0xFD];
    let events = decode("marker-u16", Start::Anywhere, &[&pair, &pair, &[0x02], &pair, &pair]);
    assert_eq!(events, ["4660 65535", "4660 65535", "passed over 1", "4660 65535", "4660 65535"]);

    let memory =
        [&[0x0D, 0x0A][..], &[1, 0, 2, 0, 3, 0, 4, 0, 5, 0, 6, 0, 7, 0, 8, 0], &[0x00, 0xFF, 0xFF]].concat();
    let events = decode("marker-memory", Start::Anywhere, &[&memory[5..], &memory, &memory]);
    assert_eq!(events, ["passed over 16", "1 2 3 4 5 6 7 8", "1 2 3 4 5 6 7 8"]);
}

/// One that looks right is believed at the end of a stream, but not before noise.
#[test]
fn a_frame_alone() {
    let pair = [0x02, 0xFE, 0x34, 0x12, 0xFF, 0xFF, 0x03, 0xFD];
    assert_eq!(decode("marker-u16", Start::Anywhere, &[&pair]), ["4660 65535"]);
    assert_eq!(decode("marker-u16", Start::Boundary, &[&pair, &[7; 8]]), ["4660 65535", "passed over 8"]);
    assert_eq!(decode("marker-u16", Start::Anywhere, &[&pair, &[7; 8]]), ["passed over 16"]);
}

/// 222, which is DE 00, may be a count, too: one frame that looks right is no proof, the next one is.
#[test]
fn trailers_that_counts_may_equal() {
    let mut stream = Vec::new();
    for first in [1i16, 222, -3, 4] {
        for count in [first, 10, 20, -20, 30, 40] {
            stream.extend(count.to_le_bytes());
        }
        stream.extend([0xDE, 0x00]);
    }
    let events = decode("trailer-i16", Start::Anywhere, &[&stream[2..]]);
    assert_eq!(events[0], "passed over 12");
    assert_eq!(events[1..], ["222 10 20 -20 30 40", "-3 10 20 -20 30 40", "4 10 20 -20 30 40"]);
}

#[test]
fn own_frames_tell_gaps_clock_and_status() {
    let encoder = Encoder::new(&built_in("generic").unwrap().stream).unwrap();
    let mut stream = Vec::new();
    for sequence in [u32::MAX, 0, 4, 2] {
        let values = [Value::Number(-5.0), Value::Number(1_000_000.0)];
        let device_time = Some(Duration::from_micros(1500));
        let sample = Sample { values: &values, sequence: Some(sequence), device_time, status: 3 };
        encoder.encode(&sample, &mut stream);
    }
    let events = decode("generic", Start::Anywhere, &[b"boot: ok\0", &stream]);
    let sample = "@0.0015 -5 1000000 status 3";
    assert_eq!(events, ["passed over 9", sample, sample, "gap Some(3)", sample, "gap None", sample]);
}

#[test]
fn an_own_frame_behind_too_many_bytes_without_a_zero_is_none() {
    let encoder = Encoder::new(&built_in("generic").unwrap().stream).unwrap();
    let mut frame = Vec::new();
    encoder.encode(&Sample { values: &[Value::Number(5.0)], ..Sample::default() }, &mut frame);
    for noise in (900..1200).chain([5000]) {
        let events = decode("generic", Start::Anywhere, &[&vec![7; noise], &frame]);
        assert_eq!(events, [format!("passed over {}", noise + frame.len())]);
    }
}
