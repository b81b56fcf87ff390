#!/usr/bin/env python3
"""Generates the scenes of section V of the CapSense paper: three electrodes, four trajectories at two speeds, and a plate.

What the paper does not publish are choices, explained in docs/validation.md; those of the stripes, the rod and the trajectories T3
and T4 are what `cargo run --release --example experiments -- fit FOLDER` prints. Only the standard library is used.

    python3 assets/section_v.py            writes the files beside this script
    python3 assets/section_v.py --check    writes nothing; exit code 1 if a file differs from what would be written
"""

import sys
from math import dist
from pathlib import Path

# --- Section V-B, in millimetres --------------------------------------------------------------------------------
# A vertical rod whose tip passes 3 mm above the electrodes. The gap between the first two electrodes is at y = 0.

SPEEDS = (0.116, 0.0166)
RATE = 27.76
TIP = 3.0
ROD_RADIUS, ROD_LENGTH = 5.0, 150.0
LENGTH, WIDTH, GAP = 100.0, 5.0, 4.0
PATCH = (48.0, 40.0)
LEGS, PITCH = 4, 18.0

# Corners of the tip's way, and how many samples it waits for at first at the fast speed.
TRAJECTORIES = {
    "t1_along": ([(-104.0, 0.0, TIP), (104.0, 0.0, TIP)], 0.0),
    "t2_across": ([(0.0, -104.0, TIP), (0.0, 104.0, TIP)], 0.0),
    "t3_triangular": ([(-104.4, 0.0, 3.0), (-8.6, 0.0, 34.5), (88.2, 0.0, 3.0)] * 3, 27.19),
    "t4_zigzag": ([(1.2 + 17.24 * (k - 5), -1.1 + (100.15 if k % 2 else -100.15), TIP) for k in range(11)], 2.23),
}
SAMPLES = {"t3_triangular": 251, "t4_zigzag": 481}


def metres(values):
    """A list of lengths, as TOML."""
    return "[" + ", ".join(f"{round(1e-3 * v, 6):g}" for v in values) + "]"


def rectangle(x, y, width, height):
    """A rectangular electrode around a centre."""
    return f"rectangle = {{ center = {metres((x, y))}, size = {metres((width, height))} }}"


def meander_side(offset):
    """A way that meanders along LEGS legs, moved by an offset to its left. Corners are right angles."""
    half = 0.5 * LENGTH - 0.5 * GAP - WIDTH
    points = []
    for leg in range(LEGS):
        y = PITCH * (leg - 0.5 * (LEGS - 1))
        points += [(-half, y), (half, y)] if leg % 2 == 0 else [(half, y), (-half, y)]
    normals = []
    for (ax, ay), (bx, by) in zip(points, points[1:]):
        length = dist((ax, ay), (bx, by))
        normals.append((-(by - ay) / length, (bx - ax) / length))
    moved = []
    for k, (x, y) in enumerate(points):
        sides = {normals[max(k - 1, 0)], normals[min(k, len(normals) - 1)]}
        moved.append((x + offset * sum(n[0] for n in sides), y + offset * sum(n[1] for n in sides)))
    return moved


def meander(offset):
    """An electrode of WIDTH along a meander."""
    outline = meander_side(offset + 0.5 * WIDTH) + meander_side(offset - 0.5 * WIDTH)[::-1]
    return "polygon = [" + ", ".join(metres(p) for p in outline) + "]"


def electrodes():
    """What each sensor consists of: a remark and outlines."""
    step = WIDTH + GAP
    return {
        "stripe": ("three stripes of 100 x 5 mm with gaps of 4 mm",
                   [rectangle(0.0, step * (k - 0.5), LENGTH, WIDTH) for k in range(3)]),
        "patch": ("two patches of 48 x 40 mm with a gap of 4 mm",
                  [rectangle(0.0, side * 0.5 * (PATCH[1] + GAP), *PATCH) for side in (-1, 1)]),
        "meander": ("two traces of 5 mm that meander side by side, 100 x 68 mm, with gaps of 4 mm",
                    [meander(side * 0.5 * step) for side in (-1, 1)]),
    }


def trajectory(corners, wait, speed):
    """A table of times and places of the rod's centre."""
    time = wait / RATE * SPEEDS[0] / speed
    rows, last = ["t,x,y,z"], None
    for x, y, z in corners:
        time += dist((x, y, z), last) * 1e-3 / speed if last else 0.0
        last = (x, y, z)
        rows.append(f"{time:.5f},{1e-3 * x:.5f},{1e-3 * y:.5f},{1e-3 * (z + 0.5 * ROD_LENGTH):.5f}")
    return "\n".join(rows) + "\n"


def scene(name, speed, path, remark, outlines):
    """One scene of section V-B."""
    shape, what = path.split("_")
    names = [f'[[sensor.electrode]]\nname = "E{k + 1}"\n{outline}\n' for k, outline in enumerate(outlines)]
    slow = SPEEDS[0] / speed
    ends = f"frames = {round((SAMPLES[path] - 1) * slow) + 1}\n" if path in SAMPLES else ""
    return f"""# Section V-B of the CapSense paper: {remark}; trajectory {shape.upper()} ({what}) at {speed} m/s.
# Written by assets/section_v.py. What is measured is the coupling of E1 and E2; docs/validation.md says what is a choice.

[domain]
min = [-0.3, -0.3, -0.05]
max = [0.3, 0.3, 0.35]

[mesh]
generate = {{ elements = 150000 }}

{chr(10).join(names)}
[[object]]
name = "rod"
cylinder = {{ radius = {1e-3 * ROD_RADIUS:g}, length = {1e-3 * ROD_LENGTH:g} }}
material = {{ conductor = "grounded" }}
trajectory = {{ file = "{path}_{speed}.csv" }}

[simulation]
frame_rate = {RATE}                     # samples per second
{ends}geometry = "solids"
"""


# --- Section V-C ------------------------------------------------------------------------------------------------
# Six squares of 30 mm on a polycarbonate plate; a limb comes, turns and goes.

LIMBS = {
    "forearm": [(0.0, (0.0, 0.0, 0.16), (0.0, 0.0, 0.0, 1.0)), (1.5, (0.0, 0.0, 0.06), (0.0, 0.0, 0.0, 1.0)),
                (3.0, (0.01, 0.0, 0.06), (0.0, 0.0, 0.382683432, 0.923879533)),
                (4.5, (0.03, 0.0, 0.12), (0.0, 0.130526192, 0.0, 0.991444861))],
    "leg": [(0.0, (0.0, 0.0, 0.20), (0.0, 0.0, 0.0, 1.0)), (1.5, (0.0, 0.0, 0.09), (0.0, 0.0, 0.0, 1.0)),
            (3.0, (0.01, 0.02, 0.09), (0.0, 0.0, 0.258819045, 0.965925826)),
            (4.5, (0.03, 0.0, 0.15), (0.130526192, 0.0, 0.0, 0.991444861))],
}


def limb_trajectory(samples):
    """A table of poses."""
    rows = [f"{t:g}," + ",".join(f"{v:g}" for v in place + turn) for t, place, turn in samples]
    return "t,x,y,z,qx,qy,qz,qw\n" + "\n".join(rows) + "\n"


def plate(limb):
    """The plate and a limb."""
    names = [f'[[sensor.electrode]]\nname = "E{1 + column + 3 * row}"\n'
             + rectangle(38.0 * (column - 1), 42.0 * (row - 0.5), 30.0, 30.0) + "\n"
             for row in range(2) for column in range(3)]
    return f"""# Section V-C of the CapSense paper: 3 x 2 electrodes of 30 mm on a polycarbonate plate, and a {limb} that comes,
# turns and goes. Written by assets/section_v.py; `cargo run --release --example experiments -- limbs` runs random trajectories.

[domain]
min = [-0.25, -0.25, -0.1]
max = [0.25, 0.25, 0.3]
wall = "open"                          # the limb's ends stick out where it turns

[mesh]
generate = {{ elements = 100000 }}

[sensor]
substrate = {{ thickness = 1e-3, relative_permittivity = 2.95, size = [0.115, 0.085], back = "open" }}

{chr(10).join(names)}
[camera]
pixels = [96, 96]
layers = 2

[[object]]
name = "{limb}"
file = "../../objects/{limb}.stl"
unit = "m"
material = {{ conductor = {{ capacitance = 150e-12 }} }}
trajectory = {{ file = "{limb}.csv" }}

[simulation]
frame_rate = 50.0
"""


# --- Files ------------------------------------------------------------------------------------------------------

def files():
    """All files and their texts."""
    made = {}
    for speed in SPEEDS:
        for path, (corners, wait) in TRAJECTORIES.items():
            made[f"section_v_b/{path}_{speed}.csv"] = trajectory(corners, wait, speed)
            for name, (remark, outlines) in electrodes().items():
                made[f"section_v_b/{name}_{path}_{speed}.toml"] = scene(name, speed, path, remark, outlines)
    for limb, samples in LIMBS.items():
        made[f"section_v_c/{limb}.csv"] = limb_trajectory(samples)
        made[f"section_v_c/{limb}.toml"] = plate(limb)
    return made


def main():
    """Writes or checks; see the top of this script."""
    if sys.argv[1:] not in ([], ["--check"]):
        sys.exit(__doc__)
    for path, text in files().items():
        target = Path(__file__).resolve().parent / "scenes" / path
        if not sys.argv[1:]:
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(text, encoding="utf-8")
        elif not target.is_file() or target.read_text(encoding="utf-8") != text:
            sys.exit(f"{path} differs from what this script writes")


if __name__ == "__main__":
    main()
