//! The table `[measurement]`: which channels there are, and what is wrong with each.

use super::check::Checker;
use super::raw::{
    RawConverter, RawCrosstalk, RawEach, RawInfluence, RawMains, RawMeasurement, RawOffsetDac, Tuple,
};
use super::source::{SceneError, Source};
use capsense_core::measurement::{
    ChannelModel, Converter, Crosstalk, Influence, Mains, MeasurementError, MeasurementModel, OffsetDac,
};

/// More scans than this for an offset are a mistake.
const MOST_CALIBRATION_SCANS: usize = 1_000_000;

pub(super) fn measurement(
    check: Checker<'_>,
    raw: Option<&RawMeasurement>,
    electrodes: &[String],
    frame_rate: f64,
) -> Result<Option<MeasurementModel>, SceneError> {
    let Some(raw) = raw else { return Ok(None) };
    let channels = channels(check, raw, electrodes)?;
    let seed = match u64::try_from(raw.seed.unwrap_or(0)) {
        Ok(seed) => seed,
        Err(_) => return check.error("measurement.seed", "must not be negative"),
    };
    let scans = raw.calibration_scans.unwrap_or(0);
    let scans = check.count("measurement.calibration_scans", scans, 0, MOST_CALIBRATION_SCANS)?;
    let model = MeasurementModel {
        seed,
        seconds_per_channel: raw.seconds_per_channel.unwrap_or(0.0),
        crosstalk: crosstalk(check, raw.crosstalk.as_ref(), channels.len())?,
        channels,
        mains: raw.mains.as_ref().map(mains).unwrap_or_default(),
        temperature: raw.temperature.as_ref().map(influence).unwrap_or_default(),
        humidity: raw.humidity.as_ref().map(influence).unwrap_or_default(),
        converter: raw.converter.as_ref().map(|raw| converter(check, raw)).transpose()?,
        calibration_scans: scans as u32,
    };
    model.check(frame_rate, electrodes.len()).map_err(|error| locate(check.source, &error))?;
    Ok(Some(model))
}

/// A complaint of the core about a parameter, with its place in the file.
pub(super) fn locate(source: &Source, error: &MeasurementError) -> SceneError {
    source.error(&format!("measurement.{}", error.key), error.message.clone())
}

/// The channels that are named, or the upper triangle of the matrix, row by row.
fn channels(
    check: Checker<'_>,
    raw: &RawMeasurement,
    electrodes: &[String],
) -> Result<Vec<ChannelModel>, SceneError> {
    let entries = match &raw.channels {
        Some(named) => pairs(check, "measurement.channels", named, electrodes)?,
        None => {
            let size = electrodes.len();
            (0..size).flat_map(|row| (row..size).map(move |column| (row, column))).collect()
        }
    };
    let dead = match &raw.dead {
        Some(named) => pairs(check, "measurement.dead", named, electrodes)?,
        None => Vec::new(),
    };
    if let Some(index) = dead.iter().position(|pair| !entries.contains(pair)) {
        return check.error(&format!("measurement.dead[{index}]"), "is not among the channels");
    }
    let each = |key: &str, raw: Option<&RawEach>| each(check, key, raw, entries.len());
    let gain = each("gain", raw.gain.as_ref())?;
    let gain_spread = each("gain_spread", raw.gain_spread.as_ref())?;
    let offset = each("offset", raw.offset.as_ref())?;
    let offset_spread = each("offset_spread", raw.offset_spread.as_ref())?;
    let white_noise = each("white_noise", raw.white_noise.as_ref())?;
    let drift = each("drift", raw.drift.as_ref())?;
    let delay = each("delay", raw.delay.as_ref())?;
    let jitter = each("jitter", raw.jitter.as_ref())?;
    let dacs = offset_dacs(check, raw.offset_dac.as_ref(), entries.len())?;
    let channel = |(index, &(row, column)): (usize, &(usize, usize))| ChannelModel {
        row,
        column,
        gain: gain[index],
        gain_spread: gain_spread[index],
        offset_farads: offset[index],
        offset_spread_farads: offset_spread[index],
        white_noise_farads: white_noise[index],
        drift_farads: drift[index],
        delay_seconds: delay[index],
        jitter_seconds: jitter[index],
        dac: dacs[index],
        dead: dead.contains(&(row, column)),
    };
    Ok(entries.iter().enumerate().map(channel).collect())
}

/// Entries of the upper triangle from pairs of names, none twice.
fn pairs(
    check: Checker<'_>,
    key: &str,
    named: &[Tuple<String, 2>],
    electrodes: &[String],
) -> Result<Vec<(usize, usize)>, SceneError> {
    let mut pairs = Vec::with_capacity(named.len());
    for (index, names) in named.iter().enumerate() {
        let key = format!("{key}[{index}]");
        let mut ends = [0, 0];
        for (end, name) in ends.iter_mut().zip(names.iter()) {
            match electrodes.iter().position(|electrode| electrode == name) {
                Some(at) => *end = at,
                None => return check.error(&key, format!("no electrode is named `{name}`")),
            }
        }
        let pair = (ends[0].min(ends[1]), ends[0].max(ends[1]));
        if pairs.contains(&pair) {
            return check.error(&key, "is there twice");
        }
        pairs.push(pair);
    }
    Ok(pairs)
}

fn each(
    check: Checker<'_>,
    key: &str,
    raw: Option<&RawEach>,
    channels: usize,
) -> Result<Vec<f64>, SceneError> {
    match raw {
        None => Ok(vec![0.0; channels]),
        Some(RawEach::All(value)) => Ok(vec![*value; channels]),
        Some(RawEach::One(values)) if values.len() == channels => Ok(values.clone()),
        Some(RawEach::One(values)) => {
            let message = format!("has {} numbers for {channels} channels", values.len());
            check.error(&format!("measurement.{key}"), message)
        }
    }
}

fn offset_dacs(
    check: Checker<'_>,
    raw: Option<&RawOffsetDac>,
    channels: usize,
) -> Result<Vec<OffsetDac>, SceneError> {
    let Some(raw) = raw else { return Ok(vec![OffsetDac::default(); channels]) };
    let largest = check.count("measurement.offset_dac.largest", raw.largest, 1, 65_535)? as u32;
    let dac = OffsetDac { farads_per_step: raw.step, largest, setting: None, gain_spread: raw.spread };
    if raw.setting.is_none() {
        return Ok(vec![dac; channels]);
    }
    let settings = each(check, "offset_dac.setting", raw.setting.as_ref(), channels)?;
    let set = |setting: &f64| {
        if setting.fract() == 0.0 && (0.0..=f64::from(largest)).contains(setting) {
            Ok(OffsetDac { setting: Some(*setting as u32), ..dac })
        } else {
            let message = format!("must be a whole number from 0 to {largest}, but is {setting}");
            check.error("measurement.offset_dac.setting", message)
        }
    };
    settings.iter().map(set).collect()
}

fn crosstalk(
    check: Checker<'_>,
    raw: Option<&RawCrosstalk>,
    channels: usize,
) -> Result<Vec<Crosstalk>, SceneError> {
    match raw {
        None => Ok(Vec::new()),
        Some(RawCrosstalk::Neighbours(factor)) => {
            let both = |to: usize| [(to - 1, to), (to, to - 1)];
            let pairs = (1..channels).flat_map(both);
            Ok(pairs.map(|(from, to)| Crosstalk { from, to, factor: *factor }).collect())
        }
        Some(RawCrosstalk::Matrix(rows)) => {
            let square = rows.len() == channels && rows.iter().all(|row| row.len() == channels);
            if !square {
                let message = format!("must have {channels} rows and columns, one for each channel");
                return check.error("measurement.crosstalk", message);
            }
            let paths = rows.iter().enumerate().flat_map(|(to, row)| {
                row.iter().enumerate().map(move |(from, &factor)| Crosstalk { from, to, factor })
            });
            // NaN is not 0 and stays, to be refused.
            Ok(paths.filter(|path| path.factor != 0.0).collect())
        }
    }
}

fn mains(raw: &RawMains) -> Mains {
    Mains { farads: raw.amplitude, hertz: raw.frequency, integration_seconds: raw.integration }
}

fn influence(raw: &RawInfluence) -> Influence {
    Influence { change: raw.change, seconds: raw.seconds, gain: raw.gain, offset_farads: raw.offset }
}

fn converter(check: Checker<'_>, raw: &RawConverter) -> Result<Converter, SceneError> {
    let bits = check.count("measurement.converter.bits", raw.bits, 1, 32)? as u32;
    Ok(Converter { farads_per_code: raw.step, bits, zero: raw.zero })
}
