"""Writes the seed corpus: for every built-in profile a stream of the shape it is made for, and every profile file."""

import pathlib
import struct

here = pathlib.Path(__file__).parent
devices = here.parent / "assets" / "devices"
source = (here.parent / "crates/capsense-hw/src/profile/built_in.rs").read_text()
names = [line.strip().strip('",') for line in source.split("profiles![")[1].split("];")[0].splitlines() if '"' in line]


def crc16(data):
    crc = 0xFFFF
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc


def cobs(data):
    return b"".join(bytes([len(part) + 1]) + part for part in data.split(b"\0"))


def own(channels):
    stream = b""
    for sequence in (0, 1, 4):
        plain = bytes([1, 0]) + struct.pack("<IQB", sequence, 1000 * sequence, 0)
        plain += b"".join(struct.pack("<i", 1000 * channel - 500) for channel in range(channels))
        stream += cobs(plain + struct.pack("<H", crc16(plain))) + b"\0"
    return stream


text = {
    "text": "-9089\n12\t345\t346\t347\nnan 3 inf\n",
    "ad7747": "4.1234567890, 4.0000000000, 3.9000000000\n",
    "fdc1004-breakout": "✓ found\nTime\tCH1\n12.5\t11.14\tERROR\t3.20\t0.02\t[OEAO] CAPDAC: CH2=4\n",
    "fdc1004-labelled": "Capacitance (pF):  1.20 3.40 0.00 31.99\n",
    "fdc1004-multichannel": "cap A, 12345 , 11.1383\ncap B, 0 , -1.0000\nCapacitance out of bounds\n",
    "fdc2214-sketch": "FDC2x1x test\r\nSensor OK\r\n43823473, 43820011, 34580067, 34580100\r\n",
    "grid-252": "12,,,40" + "," * 248 + "\n",
    "grid-labelled": "8123 , Row 0, Col 1 : 43823473\n",
    "mpr121-filtered": "Filt: " + "\t".join(["512"] * 12) + "\nBase: 1\n",
    "mpr121-plotter": "0,512,512,  550,498,498,  \n",
    "plotter": "left:1,\t right:-2.5\r\n",
    "teensy": "touch_values: 850 851 849 \n",
    "teleplot": "C2:1627551892437:1234§km²|g\n>C3:5.5\n",
}
evm = bytes([0x4C, 5, 1, 0, 0, 0x19]) + struct.pack(">4I", 43823473, 2, 3, 0x20000004) + bytes(10)
binary = {
    "fdc2214-evm": evm * 3,
    "marker-memory": (b"\r\n" + struct.pack("<8H", *range(8)) + b"\0\xff\xff") * 3,
    "marker-u16": b"\x02\xfe\x34\x12\xff\xff\x03\xfd" * 3,
    "trailer-i16": (struct.pack("<6h", 1, 222, -3, 4, 5, 6) + b"\xde\0") * 3,
}
channels = {"ad7147": 12, "ad7745": 1, "ad7746": 2, "fdc2112": 2, "fdc2212": 2, "generic": 3, "mpr121": 12}

for index, name in enumerate(names):
    stream = text[name].encode() if name in text else binary.get(name) or own(channels.get(name, 4))
    folder = here / "corpus" / "built_in"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"seed-{name}").write_bytes(bytes([index, 1]) + stream)
    folder = here / "corpus" / "profile"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"seed-{name}").write_bytes((devices / f"{name}.toml").read_bytes())

folder = here / "corpus" / "framed"
folder.mkdir(parents=True, exist_ok=True)
frame = bytes([0xAA, 5, 1, 2, 3, 4])
xor = 0
for byte in frame:
    xor ^= byte
# One start byte, a told length one behind it plus 2, exclusive or over all, values of 8 bits at 2.
(folder / "seed-told").write_bytes(bytes([1, 1 | 2 << 1, 2, 2 << 3, 1, 0]) + (frame + bytes([xor])) * 4)
# One start byte, one end byte, 8 bytes, values of 16 bits at 2, two of them.
(folder / "seed-fixed").write_bytes(bytes([5, 8 << 1, 16, 2 << 3 | 2, 0, 3]) + bytes([0xAA, 0, 1, 2, 3, 4, 0, 0x55]) * 4)
