//! Checksums of frames, by the names of the catalogue of parametrised CRC algorithms.

use crc::{CRC_8_SMBUS, CRC_16_IBM_3740, CRC_16_MODBUS, CRC_16_XMODEM, CRC_32_ISO_HDLC, Crc, Table};
use serde::{Deserialize, Serialize};

static SMBUS: Crc<u8, Table<16>> = Crc::<u8, Table<16>>::new(&CRC_8_SMBUS);
static IBM_3740: Crc<u16, Table<16>> = Crc::<u16, Table<16>>::new(&CRC_16_IBM_3740);
static MODBUS: Crc<u16, Table<16>> = Crc::<u16, Table<16>>::new(&CRC_16_MODBUS);
static XMODEM: Crc<u16, Table<16>> = Crc::<u16, Table<16>>::new(&CRC_16_XMODEM);
static ISO_HDLC: Crc<u32, Table<16>> = Crc::<u32, Table<16>>::new(&CRC_32_ISO_HDLC);

/// A checksum.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Checksum {
    /// CRC-8, polynomial 0x07 from 0: that of TI's evaluation modules.
    #[serde(rename = "crc-8-smbus")]
    Crc8Smbus,
    /// CRC-16, polynomial 0x1021 from 0xFFFF, also called CCITT-FALSE: that of this project's own frames.
    #[serde(rename = "crc-16-ibm-3740")]
    Crc16Ibm3740,
    /// CRC-16 of Modbus, polynomial 0x8005 reflected from 0xFFFF.
    #[serde(rename = "crc-16-modbus")]
    Crc16Modbus,
    /// CRC-16 of XMODEM, polynomial 0x1021 from 0.
    #[serde(rename = "crc-16-xmodem")]
    Crc16Xmodem,
    /// CRC-32 of Ethernet and zip.
    #[serde(rename = "crc-32-iso-hdlc")]
    Crc32IsoHdlc,
    /// Sum of the bytes modulo 256.
    Sum8,
    /// All bytes combined by exclusive or.
    Xor8,
}

impl Checksum {
    /// Number of its bytes.
    pub fn size(self) -> usize {
        match self {
            Self::Crc8Smbus | Self::Sum8 | Self::Xor8 => 1,
            Self::Crc16Ibm3740 | Self::Crc16Modbus | Self::Crc16Xmodem => 2,
            Self::Crc32IsoHdlc => 4,
        }
    }

    /// The checksum of some bytes.
    pub fn of(self, bytes: &[u8]) -> u32 {
        match self {
            Self::Crc8Smbus => SMBUS.checksum(bytes).into(),
            Self::Crc16Ibm3740 => IBM_3740.checksum(bytes).into(),
            Self::Crc16Modbus => MODBUS.checksum(bytes).into(),
            Self::Crc16Xmodem => XMODEM.checksum(bytes).into(),
            Self::Crc32IsoHdlc => ISO_HDLC.checksum(bytes),
            Self::Sum8 => bytes.iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte)).into(),
            Self::Xor8 => bytes.iter().fold(0u8, |sum, byte| sum ^ byte).into(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Checksum;

    /// The catalogue gives for each CRC what it makes of these nine digits.
    #[test]
    fn crcs_are_those_of_the_catalogue() {
        for (checksum, expected) in [
            (Checksum::Crc8Smbus, 0xF4),
            (Checksum::Crc16Ibm3740, 0x29B1),
            (Checksum::Crc16Modbus, 0x4B37),
            (Checksum::Crc16Xmodem, 0x31C3),
            (Checksum::Crc32IsoHdlc, 0xCBF4_3926),
            (Checksum::Sum8, 0xDD),
            (Checksum::Xor8, 0x31),
        ] {
            assert_eq!(checksum.of(b"123456789"), expected, "{checksum:?}");
        }
    }

    /// Commands of TI's evaluation modules, with the byte that ends them.
    #[test]
    fn commands_of_evaluation_modules_end_in_crc_8() {
        let start = [0x4C, 0x05, 0x01, 0x00, 0x06, 0x01, 0x29, 0x04, 0x04, 0x30, 0x2A];
        assert_eq!(Checksum::Crc8Smbus.of(&start), 0xC1);
        assert_eq!(Checksum::Crc8Smbus.of(&[0x4C, 0x06, 0x01, 0x00, 0x01, 0x01]), 0xD2);
    }
}
