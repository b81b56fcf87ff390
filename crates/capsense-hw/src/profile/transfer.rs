//! From a converter's result to capacitance, and back. Formulas are those of the data sheets.

use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// How a result depends on the capacitance at the input.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Transfer {
    /// In proportion, behind an offset that can be set: charge balancing, as in AD7147, AD7745/46, FDC1004.
    Linear(Linear),
    /// By the frequency of a resonant circuit: FDC2112/2114/2212/2214.
    Resonator(Resonator),
    /// By the voltage after charging with a known current for a known time: MPR121.
    Charge(Charge),
    /// In a way nobody has calibrated: the result stays a count.
    Counts,
}

/// C = (result - zero) · LSB + what the offset DAC takes off.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Linear {
    /// Least significant bit in farads; negative where the input inverts.
    pub farads_per_code: f64,
    /// Result at no capacitance beyond the DAC's.
    #[serde(default)]
    pub zero: f64,
    /// The offset DAC, if there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dac: Option<OffsetDac>,
}

/// A capacitance inside the converter that is subtracted from that at its input.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct OffsetDac {
    /// One step in farads.
    pub farads_per_step: f64,
    /// Number of settings, from 0.
    pub settings: u8,
    /// Settings by channel; 0 for channels that are not named.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub channels: Vec<u8>,
    /// Measured capacitance of every setting, in farads, in place of equal steps.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub measured: Vec<f64>,
}

/// f = FIN_SEL · fREF · (result / 2^fraction + offset / 2^16), C = 1 / (L (2πf)²) - C of the board.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Resonator {
    /// Reference frequency fREF in hertz.
    pub reference_hertz: f64,
    /// Bits of the result behind the binary point: 28 for FDC2212/14, 12 and the output gain's shift for FDC2112/14.
    pub fraction_bits: u8,
    /// Divider of the input frequency, FIN_SEL, by channel; the last holds for all that follow.
    pub input_divider: Vec<f64>,
    /// Register OFFSET by channel; 0 for channels that are not named.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub offset: Vec<u16>,
    /// Inductance of the circuit in henries.
    pub inductance_henries: f64,
    /// Capacitance of the circuit without the electrode, in farads.
    pub board_farads: f64,
}

/// C = I · T · full scale / (Vdd · result).
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Charge {
    /// Charging current I in amperes.
    pub amperes: f64,
    /// Charging time T in seconds.
    pub seconds: f64,
    /// Supply Vdd in volts.
    pub supply_volts: f64,
    /// Result at the supply voltage.
    pub full_scale: f64,
}

impl OffsetDac {
    /// What a setting subtracts, in farads.
    fn farads(&self, setting: u8) -> f64 {
        let measured = self.measured.get(usize::from(setting)).copied();
        measured.unwrap_or(f64::from(setting) * self.farads_per_step)
    }

    fn of_channel(&self, channel: usize) -> f64 {
        self.farads(self.channels.get(channel).copied().unwrap_or(0))
    }
}

impl Resonator {
    /// Frequency of a channel's circuit in hertz.
    pub fn frequency(&self, channel: usize, result: f64) -> f64 {
        let fraction = result / f64::from(self.fraction_bits).exp2() + self.offset(channel);
        self.full_scale(channel) * fraction
    }

    fn full_scale(&self, channel: usize) -> f64 {
        let divider = self.input_divider.get(channel).or(self.input_divider.last());
        divider.copied().unwrap_or(1.0) * self.reference_hertz
    }

    fn offset(&self, channel: usize) -> f64 {
        f64::from(self.offset.get(channel).copied().unwrap_or(0)) / 65536.0
    }

    fn capacitance(&self, frequency: f64) -> f64 {
        1.0 / (self.inductance_henries * (TAU * frequency).powi(2)) - self.board_farads
    }

    fn result(&self, channel: usize, capacitance: f64) -> f64 {
        let total = capacitance + self.board_farads;
        let frequency = 1.0 / (TAU * (self.inductance_henries * total).sqrt());
        let fraction = frequency / self.full_scale(channel) - self.offset(channel);
        fraction * f64::from(self.fraction_bits).exp2()
    }
}

impl Charge {
    /// Capacitance times result.
    fn product(&self) -> f64 {
        self.amperes * self.seconds * self.full_scale / self.supply_volts
    }
}

impl Transfer {
    /// What a result means, in farads, or in counts for [`Transfer::Counts`]; `None` if nothing finite.
    pub fn forward(&self, channel: usize, result: f64) -> Option<f64> {
        let value = match self {
            Self::Linear(linear) => {
                let dac = linear.dac.as_ref().map_or(0.0, |dac| dac.of_channel(channel));
                (result - linear.zero) * linear.farads_per_code + dac
            }
            Self::Resonator(resonator) => resonator.capacitance(resonator.frequency(channel, result)),
            Self::Charge(charge) => charge.product() / result,
            Self::Counts => result,
        };
        value.is_finite().then_some(value)
    }

    /// The result, before rounding and without a limit, of a capacitance in farads, or of counts. `None` where there is
    /// none, as for a negative capacitance in a resonant circuit.
    pub fn backward(&self, channel: usize, value: f64) -> Option<f64> {
        let result = match self {
            Self::Linear(linear) => {
                let dac = linear.dac.as_ref().map_or(0.0, |dac| dac.of_channel(channel));
                (value - dac) / linear.farads_per_code + linear.zero
            }
            Self::Resonator(resonator) => resonator.result(channel, value),
            Self::Charge(charge) => charge.product() / value,
            Self::Counts => value,
        };
        result.is_finite().then_some(result)
    }

    /// What is wrong with it: a key, and why.
    pub(super) fn check(&self) -> Result<(), (&'static str, String)> {
        let positive = |key, number: f64| {
            let fine = number.is_finite() && number > 0.0;
            if fine { Ok(()) } else { Err((key, "must be above 0".to_owned())) }
        };
        let finite = |key, number: f64| {
            if number.is_finite() { Ok(()) } else { Err((key, "must be finite".to_owned())) }
        };
        match self {
            Self::Linear(linear) => {
                positive("transfer.linear.farads_per_code", linear.farads_per_code.abs())?;
                finite("transfer.linear.zero", linear.zero)?;
                linear.dac.as_ref().map_or(Ok(()), OffsetDac::check)
            }
            Self::Resonator(resonator) => {
                positive("transfer.resonator.reference_hertz", resonator.reference_hertz)?;
                positive("transfer.resonator.inductance_henries", resonator.inductance_henries)?;
                finite("transfer.resonator.board_farads", resonator.board_farads)?;
                let key = "transfer.resonator.input_divider";
                resonator.input_divider.iter().try_for_each(|divider| positive(key, *divider))?;
                if resonator.input_divider.is_empty() {
                    return Err((key, "must name at least one".to_owned()));
                }
                Ok(())
            }
            Self::Charge(charge) => {
                positive("transfer.charge.amperes", charge.amperes)?;
                positive("transfer.charge.seconds", charge.seconds)?;
                positive("transfer.charge.supply_volts", charge.supply_volts)?;
                positive("transfer.charge.full_scale", charge.full_scale)
            }
            Self::Counts => Ok(()),
        }
    }
}

impl OffsetDac {
    fn check(&self) -> Result<(), (&'static str, String)> {
        if !self.farads_per_step.is_finite() || self.measured.iter().any(|farads| !farads.is_finite()) {
            return Err(("transfer.linear.dac.farads_per_step", "must be finite".to_owned()));
        }
        if self.channels.iter().any(|setting| *setting >= self.settings) {
            let message = format!("must be below {}", self.settings);
            return Err(("transfer.linear.dac.channels", message));
        }
        if !self.measured.is_empty() && self.measured.len() != usize::from(self.settings) {
            return Err(("transfer.linear.dac.measured", format!("must be {} numbers", self.settings)));
        }
        Ok(())
    }
}
