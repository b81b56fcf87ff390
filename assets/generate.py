#!/usr/bin/env python3
"""Generates the meshes of CapSense: objects/hand.glb, objects/forearm.stl,
objects/leg.stl and the electrodes electrodes/*.stl.

A body is a smooth union of round cones (spheres of varying radius swept along a segment), given as a signed
distance. Marching tetrahedra on a grid of Kuhn tetrahedra turns it into triangles; that surface is closed and
2-manifold by construction. Its vertices are then moved onto the exact surface, and quadric edge collapses
(Garland and Heckbert 1997, with the link condition of Dey et al. 1999, which keeps a surface a 2-manifold) leave as
many triangles as a real-time depth camera likes. The result is checked edge by edge before it is written.

An electrode is a union of rectangles, cut along the lines of all their sides into rectangles of two triangles each.

Only the standard library is used, and only operations that IEEE 754 rounds exactly (+ - * / sqrt), so every run on
every machine writes the same bytes.

    python3 assets/generate.py            writes the files beside this script
    python3 assets/generate.py --check    writes nothing; exit code 1 if a file differs from what would be written
    python3 assets/generate.py --out DIR  writes elsewhere
"""

import heapq
import json
import struct
import sys
from math import sqrt
from pathlib import Path

# --- Bodies -----------------------------------------------------------------------------------------------------
# Coordinates in metres. Hand frame: origin at the centre of the palm, fingers along +y, palm towards -z, so that
# the thumb of this right hand is at -x. A bone is (start, end, radius at start, radius at end).

METACARPALS = [
    ((-0.015, -0.042, 0.000), (-0.031, 0.032, 0.000), 0.0135, 0.0115),
    ((-0.006, -0.044, 0.001), (-0.010, 0.037, 0.002), 0.0140, 0.0120),
    ((0.005, -0.044, 0.001), (0.012, 0.034, 0.002), 0.0140, 0.0115),
    ((0.014, -0.042, 0.000), (0.031, 0.026, 0.000), 0.0135, 0.0105),
]
# Ball of the thumb and heel of the hand, on the palm's side.
PADS = [
    ((-0.014, -0.036, -0.006), (-0.034, -0.004, -0.008), 0.0145, 0.0125),
    ((0.018, -0.036, -0.005), (0.027, 0.002, -0.004), 0.0125, 0.0105),
]
# Each finger: knuckle, middle joint, last joint, tip, gently bent towards the palm; then the radii there.
FINGERS = [
    ([(-0.032, 0.034, 0.000), (-0.038, 0.072, -0.001), (-0.041, 0.095, -0.005), (-0.042, 0.112, -0.010)],
     [0.0098, 0.0086, 0.0077, 0.0068]),
    ([(-0.010, 0.040, 0.002), (-0.012, 0.083, 0.001), (-0.012, 0.109, -0.003), (-0.012, 0.128, -0.008)],
     [0.0100, 0.0088, 0.0078, 0.0070]),
    ([(0.013, 0.037, 0.002), (0.016, 0.077, 0.001), (0.018, 0.101, -0.003), (0.019, 0.119, -0.008)],
     [0.0096, 0.0084, 0.0075, 0.0068]),
    ([(0.033, 0.028, 0.000), (0.041, 0.059, -0.001), (0.046, 0.078, -0.005), (0.049, 0.093, -0.009)],
     [0.0086, 0.0074, 0.0066, 0.0060]),
]
THUMB = ([(-0.026, -0.026, -0.006), (-0.047, 0.004, -0.013), (-0.063, 0.031, -0.017), (-0.073, 0.053, -0.019)],
         [0.0140, 0.0115, 0.0098, 0.0080])
# Radius and ulna, from the wrist to the elbow, where a plane cuts the arm.
WRIST_Y = -0.055
ELBOW_Y = WRIST_Y - 0.25
FOREARM = [
    ([(-0.010, -0.062, 0.001), (-0.014, -0.160, 0.005), (-0.013, -0.330, 0.016)], [0.0185, 0.0270, 0.0345]),
    ([(0.010, -0.062, 0.001), (0.014, -0.160, 0.005), (0.013, -0.330, 0.016)], [0.0185, 0.0270, 0.0345]),
]
# Shin and the two heads of the calf, from the ankle at +y to the knee, where a plane cuts the leg; the calf is at -z.
KNEE_Y = -0.18
LEG = [
    ([(0.000, 0.160, 0.008), (0.000, 0.000, 0.010), (0.000, -0.230, 0.006)], [0.0330, 0.0380, 0.0520]),
    ([(0.012, 0.080, -0.012), (0.015, -0.060, -0.022), (0.014, -0.210, -0.012)], [0.0300, 0.0430, 0.0400]),
    ([(-0.012, 0.080, -0.012), (-0.015, -0.050, -0.020), (-0.014, -0.210, -0.012)], [0.0300, 0.0410, 0.0400]),
]


def cone(bone):
    """Distance to a round cone, exact for equal radii and within 2 % of a bone's slope otherwise."""
    (ax, ay, az), (bx, by, bz), start, end = bone
    dx, dy, dz = bx - ax, by - ay, bz - az
    inverse = 1.0 / (dx * dx + dy * dy + dz * dz)
    taper = end - start

    def distance(x, y, z):
        px, py, pz = x - ax, y - ay, z - az
        t = (px * dx + py * dy + pz * dz) * inverse
        t = 0.0 if t < 0.0 else 1.0 if t > 1.0 else t
        px, py, pz = px - t * dx, py - t * dy, pz - t * dz
        return sqrt(px * px + py * py + pz * pz) - (start + t * taper)

    return distance


def smooth_min(a, b, width):
    """The smaller of two distances, rounded off where they differ by less than `width`."""
    gap = width - abs(a - b)
    low = a if a < b else b
    return low - gap * gap / (4.0 * width) if gap > 0.0 else low


def blend(cones, width):
    """Smooth union of round cones."""
    def distance(x, y, z):
        value = cones[0](x, y, z)
        for part in cones[1:]:
            value = smooth_min(value, part(x, y, z), width)
        return value

    return distance


def chain(joints, radii):
    """A finger or an arm's bone: cones from joint to joint, which meet in a sphere."""
    cones = [cone((joints[k], joints[k + 1], radii[k], radii[k + 1])) for k in range(len(joints) - 1)]
    return lambda x, y, z: min(part(x, y, z) for part in cones)


def forearm_distance():
    """Radius and ulna, ended by a plane with a slightly rounded rim at the elbow."""
    bones = blend([chain(*bone) for bone in FOREARM], 0.020)

    def distance(x, y, z):
        return -smooth_min(-bones(x, y, z), y - ELBOW_Y, 0.010)

    return distance


def leg_distance():
    """The lower leg, ended by a plane with a slightly rounded rim at the knee."""
    bones = blend([chain(*bone) for bone in LEG], 0.025)

    def distance(x, y, z):
        return -smooth_min(-bones(x, y, z), y - KNEE_Y, 0.010)

    return distance


def hand_distance():
    """Palm, fingers, thumb and forearm. Fingers join the palm smoothly, but never each other."""
    palm = blend([cone(bone) for bone in METACARPALS + PADS], 0.012)
    fingers = [chain(*finger) for finger in FINGERS]
    thumb = chain(*THUMB)
    arm = forearm_distance()

    def distance(x, y, z):
        body = smooth_min(palm(x, y, z), arm(x, y, z), 0.020)
        finger = min(f(x, y, z) for f in fingers)
        return smooth_min(smooth_min(body, finger, 0.006), thumb(x, y, z), 0.008)

    return distance


# --- Polygons ---------------------------------------------------------------------------------------------------

# The six Kuhn tetrahedra of a cell: from corner 0 to corner 7 along the axes in each order; bits of a corner: x, y, z.
KUHN = [(0, 1, 3, 7), (0, 2, 6, 7), (0, 4, 5, 7), (0, 3, 2, 7), (0, 6, 4, 7), (0, 5, 1, 7)]


def marching_tetrahedra(distance, low, high, step):
    """Triangles (outward) of the surface distance = 0, closed as long as the grid holds the body."""
    counts = [int((high[a] - low[a]) / step) + 2 for a in range(3)]
    nx, ny, nz = counts
    values = []
    for k in range(nz):
        z = low[2] + k * step
        for j in range(ny):
            y = low[1] + j * step
            values.extend(distance(low[0] + i * step, y, z) for i in range(nx))
    # A value of exactly zero would put a vertex of several edges in one place.
    values = [v if abs(v) > 1e-9 else 1e-9 for v in values]
    offsets = [(c & 1) + nx * (c >> 1 & 1) + nx * ny * (c >> 2 & 1) for c in range(8)]
    vertices, triangles, on_edge = [], [], {}

    def point(node):
        i, rest = node % nx, node // nx
        return (low[0] + i * step, low[1] + rest % ny * step, low[2] + rest // ny * step)

    def vertex(inside, outside):
        key = (inside, outside)
        if key not in on_edge:
            t = values[inside] / (values[inside] - values[outside])
            # Away from the corners there are no slivers; `onto_surface` makes up for it.
            t = min(max(t, 0.15), 0.85)
            a, b = point(inside), point(outside)
            on_edge[key] = len(vertices)
            vertices.append(tuple(a[m] + t * (b[m] - a[m]) for m in range(3)))
        return on_edge[key]

    for k in range(nz - 1):
        for j in range(ny - 1):
            for i in range(nx - 1):
                base = i + nx * (j + ny * k)
                signs = [values[base + o] < 0.0 for o in offsets]
                if all(signs) or not any(signs):
                    continue
                for tet in KUHN:
                    nodes = [base + offsets[c] for c in tet]
                    inside = [n for n, c in zip(nodes, tet) if signs[c]]
                    outside = [n for n, c in zip(nodes, tet) if not signs[c]]
                    if not inside or not outside:
                        continue
                    if len(inside) == 1:
                        faces = [[vertex(inside[0], o) for o in outside]]
                    elif len(outside) == 1:
                        faces = [[vertex(n, outside[0]) for n in inside]]
                    else:
                        quad = [vertex(inside[0], outside[0]), vertex(inside[0], outside[1]),
                                vertex(inside[1], outside[1]), vertex(inside[1], outside[0])]
                        faces = [[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]]
                    a, b = point(inside[0]), point(outside[0])
                    for face in faces:
                        # The linear interpolant rises from every inside node to every outside node.
                        normal = face_normal(*(vertices[v] for v in face))
                        rising = dot(normal, sub(b, a))
                        triangles.append(tuple(face) if rising > 0.0 else (face[0], face[2], face[1]))
    return vertices, triangles


def sub(a, b):
    """a - b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def dot(a, b):
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a, b):
    """Vector product."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def face_normal(a, b, c):
    """Normal of a triangle, as long as twice its area."""
    return cross(sub(b, a), sub(c, a))


def relax(vertices, triangles, rounds):
    """Moves every vertex to the mean of its neighbours, which evens out the triangles of the grid."""
    around = [[] for _ in vertices]
    for face in triangles:
        for k in range(3):
            around[face[k]].append(face[(k + 1) % 3])
    for _ in range(rounds):
        moved = []
        for neighbours in around:
            x = y = z = 0.0
            for v in neighbours:
                px, py, pz = vertices[v]
                x, y, z = x + px, y + py, z + pz
            count = len(neighbours)
            moved.append((x / count, y / count, z / count))
        vertices = moved
    return vertices


def onto_surface(distance, vertices, longest):
    """Newton steps along the gradient, which remove the error of linear interpolation."""
    d = 1e-5
    moved = []
    for start in vertices:
        x, y, z = start
        for _ in range(2):
            f = distance(x, y, z)
            g = ((distance(x + d, y, z) - distance(x - d, y, z)) / (2 * d),
                 (distance(x, y + d, z) - distance(x, y - d, z)) / (2 * d),
                 (distance(x, y, z + d) - distance(x, y, z - d)) / (2 * d))
            scale = f / max(dot(g, g), 0.25)
            x, y, z = x - scale * g[0], y - scale * g[1], z - scale * g[2]
        far = sub((x, y, z), start)
        moved.append((x, y, z) if dot(far, far) < longest * longest else start)
    return moved


def decimate(vertices, triangles, target):
    """Edge collapses of least quadric error until `target` triangles are left."""
    vertices = list(vertices)
    faces = {number: face for number, face in enumerate(triangles)}
    around = [[] for _ in vertices]
    quadrics = [[0.0] * 10 for _ in vertices]
    for number, face in faces.items():
        n = face_normal(*(vertices[v] for v in face))
        length = sqrt(dot(n, n))
        if length > 0.0:
            u = (n[0] / length, n[1] / length, n[2] / length)
            w = -dot(u, vertices[face[0]])
            plane = (u[0], u[1], u[2], w)
            quadric = [0.5 * length * plane[a] * plane[b] for a in range(4) for b in range(a, 4)]
        else:
            quadric = [0.0] * 10
        for v in face:
            around[v].append(number)
            quadrics[v] = [p + q for p, q in zip(quadrics[v], quadric)]

    def cost(quadric, p):
        x, y, z = p
        q = quadric
        return (q[0] * x * x + q[4] * y * y + q[7] * z * z + q[9]
                + 2.0 * (q[1] * x * y + q[2] * x * z + q[3] * x + q[5] * y * z + q[6] * y + q[8] * z))

    def neighbours(v):
        return {w for number in around[v] for w in faces[number] if w != v}

    def optimum(q, near, reach):
        """Where the quadric is least, by Cramer's rule; None if that is ill-defined or far from `near`."""
        rows = ((q[0], q[1], q[2]), (q[1], q[4], q[5]), (q[2], q[5], q[7]))
        right = (-q[3], -q[6], -q[8])
        determinant = dot(rows[0], cross(rows[1], rows[2]))
        trace = q[0] + q[4] + q[7]
        if determinant <= 1e-6 * trace * trace * trace:
            return None
        # The matrix is symmetric: its rows are its columns.
        place = (dot(right, cross(rows[1], rows[2])) / determinant, dot(rows[0], cross(right, rows[2])) / determinant,
                 dot(rows[0], cross(rows[1], right)) / determinant)
        gap = sub(place, near)
        return place if dot(gap, gap) <= reach * reach else None

    def proposal(a, b):
        quadric = [p + q for p, q in zip(quadrics[a], quadrics[b])]
        pa, pb = vertices[a], vertices[b]
        middle = tuple(0.5 * (pa[m] + pb[m]) for m in range(3))
        span = sub(pb, pa)
        place = optimum(quadric, middle, sqrt(dot(span, span)))
        if place is None:
            place = min((cost(quadric, p), rank, p) for rank, p in enumerate((middle, pa, pb)))[2]
        # A little of the squared length keeps flat regions from collapsing into slivers.
        return cost(quadric, place) + 1e-9 * dot(span, span), place

    stamp = [0] * len(vertices)
    heap = []

    def push(a, b):
        a, b = min(a, b), max(a, b)
        error, place = proposal(a, b)
        heapq.heappush(heap, (error, a, b, stamp[a], stamp[b], place))

    def thickness(corners, normal):
        """Height of a triangle over its longest side."""
        a, b, c = corners
        longest = max(dot(e, e) for e in (sub(b, a), sub(c, b), sub(a, c)))
        return sqrt(dot(normal, normal)) / longest if longest > 0.0 else 0.0

    def keeps_shape(v, other, place):
        """No triangle that stays may turn over or become a sliver."""
        for number in around[v]:
            face = faces[number]
            if other in face:
                continue
            old = [vertices[w] for w in face]
            new = [place if w == v else vertices[w] for w in face]
            before, after = face_normal(*old), face_normal(*new)
            if dot(before, after) <= 0.25 * sqrt(dot(before, before) * dot(after, after)):
                return False
            if thickness(new, after) < min(0.2, thickness(old, before)):
                return False
        return True

    done = -1
    while len(faces) > target:
        if not heap:
            # Edges refused before may do now, as long as the last pass collapsed any.
            if done == len(faces):
                break
            done = len(faces)
            for face in faces.values():
                for a, b in ((face[0], face[1]), (face[1], face[2]), (face[2], face[0])):
                    if a < b:
                        push(a, b)
        _, a, b, age_a, age_b, place = heapq.heappop(heap)
        if stamp[a] != age_a or stamp[b] != age_b:
            continue
        # Link condition: exactly the two vertices opposite the edge are neighbours of both of its ends.
        if len(neighbours(a) & neighbours(b)) != 2:
            continue
        if not keeps_shape(a, b, place) or not keeps_shape(b, a, place):
            continue
        for number in list(around[b]):
            face = faces[number]
            if a in face:
                for v in face:
                    around[v].remove(number)
                del faces[number]
            else:
                faces[number] = tuple(a if v == b else v for v in face)
                around[a].append(number)
        around[b] = []
        vertices[a] = place
        quadrics[a] = [p + q for p, q in zip(quadrics[a], quadrics[b])]
        stamp[b] = -1
        stamp[a] += 1
        for v in sorted(neighbours(a)):
            push(a, v)
    kept = sorted({v for face in faces.values() for v in face})
    renumber = {v: k for k, v in enumerate(kept)}
    return [vertices[v] for v in kept], [tuple(renumber[v] for v in face) for face in faces.values()]


def to_single(vertices):
    """Rounds to 32-bit floats, which is what the files hold."""
    return [struct.unpack("<3f", struct.pack("<3f", *v)) for v in vertices]


def check(name, vertices, triangles, handles=0, metres=1.0):
    """Stops with a message unless the surface is one closed, oriented 2-manifold; returns its volume."""
    seen = set()
    fans = [[] for _ in vertices]
    for face in triangles:
        if len(set(face)) != 3:
            sys.exit(f"{name}: degenerate triangle {face}")
        for k in range(3):
            directed = (face[k], face[(k + 1) % 3])
            if directed in seen:
                sys.exit(f"{name}: edge {directed} is used twice in one direction")
            seen.add(directed)
            fans[face[k]].append((face[(k + 1) % 3], face[(k + 2) % 3]))
    for a, b in seen:
        if (b, a) not in seen:
            sys.exit(f"{name}: edge ({a}, {b}) has a triangle on one side only")
    for v, fan in enumerate(fans):
        following = dict(fan)
        start = fan[0][0]
        at, steps = following[start], 1
        while at != start:
            at, steps = following[at], steps + 1
        if steps != len(fan):
            sys.exit(f"{name}: the triangles around vertex {v} are not one fan")
    if len(set(vertices)) != len(vertices):
        sys.exit(f"{name}: two vertices in one place")
    edges = len(seen) // 2
    euler = len(vertices) - edges + len(triangles)
    if euler != 2 - 2 * handles:
        sys.exit(f"{name}: Euler characteristic {euler}, not that of one body with {handles} handles")
    volume = 0.0
    for face in triangles:
        a, b, c = (vertices[v] for v in face)
        volume += dot(a, cross(b, c)) / 6.0
    if volume <= 0.0:
        sys.exit(f"{name}: the surface faces inwards")
    low = [min(v[m] for v in vertices) for m in range(3)]
    high = [max(v[m] for v in vertices) for m in range(3)]
    print(f"{name}: {len(vertices)} vertices, {edges} edges, {len(triangles)} triangles, watertight, "
          f"volume {volume * metres**3 * 1e6:.3g} cm3")
    print(f"  x {low[0]:+.4f} .. {high[0]:+.4f}, y {low[1]:+.4f} .. {high[1]:+.4f}, "
          f"z {low[2]:+.4f} .. {high[2]:+.4f}{' m' if metres == 1.0 else ''}")
    return volume


# --- Electrodes -------------------------------------------------------------------------------------------------
# Two combs whose fingers interlock, in a frame. A rectangle is (left, near, right, far) in millimetres.

COMB_A = [(-40, -38, -34, 38)] + [(-34, y - 3, 30, y + 3) for y in (-30, -10, 10, 30)]
COMB_B = [(34, -38, 40, 38)] + [(-30, y - 3, 34, y + 3) for y in (-20, 0, 20)]
FRAME = [(-52, -50, 52, -44), (-52, 44, 52, 50), (-52, -44, -46, 44), (46, -44, 52, 44)]
# Copper of a printed circuit board; its upper face lies in the sensing surface.
FRAME_LOW, FRAME_HIGH = -0.035, 0.0


def cells(rectangles):
    """Corners (near left, near right, far right, far left) of what all sides' lines cut the rectangles into."""
    xs = sorted({x for left, _, right, _ in rectangles for x in (left, right)})
    ys = sorted({y for _, near, _, far in rectangles for y in (near, far)})
    return [((x, y), (right, y), (right, far), (x, far))
            for y, far in zip(ys, ys[1:]) for x, right in zip(xs, xs[1:])
            if any(a <= x and right <= c and b <= y and far <= d for a, b, c, d in rectangles)]


def sheet(rectangles):
    """A flat sheet at z = 0, facing upwards."""
    faces = [face for a, b, c, d in cells(rectangles) for face in ((a, b, c), (a, c, d))]
    points = sorted({p for face in faces for p in face})
    number = {p: k for k, p in enumerate(points)}
    return [(x, y, 0.0) for x, y in points], [tuple(number[p] for p in face) for face in faces]


def plate(rectangles, low, high):
    """A closed plate, facing outwards."""
    faces = []
    border = {}
    for a, b, c, d in cells(rectangles):
        faces += [tuple((*p, high) for p in face) for face in ((a, b, c), (a, c, d))]
        faces += [tuple((*p, low) for p in face) for face in ((a, c, b), (a, d, c))]
        for p, q in ((a, b), (b, c), (c, d), (d, a)):
            if border.pop((q, p), None) is None:
                border[(p, q)] = True
    for p, q in border:
        faces += [((*p, low), (*q, low), (*q, high)), ((*p, low), (*q, high), (*p, high))]
    points = sorted({p for face in faces for p in face})
    number = {p: k for k, p in enumerate(points)}
    return points, [tuple(number[p] for p in face) for face in faces]


# --- Files ------------------------------------------------------------------------------------------------------

def glb(name, vertices, triangles):
    """Binary glTF 2.0 with one mesh of one primitive, positions and indices only."""
    if len(vertices) > 65535:
        sys.exit(f"{name}: too many vertices for 16-bit indices")
    positions = b"".join(struct.pack("<3f", *v) for v in vertices)
    indices = b"".join(struct.pack("<3H", *face) for face in triangles)
    indices += bytes(-len(indices) % 4)
    document = {
        "asset": {"version": "2.0", "generator": "assets/generate.py", "copyright": "MIT OR Apache-2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": name, "mesh": 0}],
        "meshes": [{"name": name, "primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "mode": 4}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": len(vertices), "type": "VEC3",
             "min": [min(v[m] for v in vertices) for m in range(3)],
             "max": [max(v[m] for v in vertices) for m in range(3)]},
            {"bufferView": 1, "componentType": 5123, "count": 3 * len(triangles), "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": len(positions), "target": 34962},
            {"buffer": 0, "byteOffset": len(positions), "byteLength": 6 * len(triangles), "target": 34963},
        ],
        "buffers": [{"byteLength": len(positions) + len(indices)}],
    }
    text = json.dumps(document, separators=(",", ":")).encode("ascii")
    text += b" " * (-len(text) % 4)
    body = positions + indices
    total = 12 + 8 + len(text) + 8 + len(body)
    return (struct.pack("<4sII", b"glTF", 2, total) + struct.pack("<I4s", len(text), b"JSON") + text
            + struct.pack("<I4s", len(body), b"BIN\0") + body)


def stl(name, vertices, triangles, unit="metres"):
    """Binary STL."""
    out = [f"{name}, {unit}, written by assets/generate.py".encode("ascii").ljust(80, b" "),
           struct.pack("<I", len(triangles))]
    for face in triangles:
        a, b, c = (vertices[v] for v in face)
        n = face_normal(a, b, c)
        length = sqrt(dot(n, n)) or 1.0
        out.append(struct.pack("<12fH", n[0] / length, n[1] / length, n[2] / length, *a, *b, *c, 0))
    return b"".join(out)


def stl_text(name, vertices, triangles):
    """ASCII STL of a sheet that faces upwards."""
    lines = [f"solid {name}"]
    for face in triangles:
        lines += ["  facet normal 0 0 1", "    outer loop"]
        lines += ["      vertex " + " ".join(f"{x:g}" for x in vertices[v]) for v in face]
        lines += ["    endloop", "  endfacet"]
    return "\n".join([*lines, f"endsolid {name}", ""]).encode("ascii")


def electrodes():
    """The files of the combs and their frame, in millimetres."""
    frame = plate(FRAME, FRAME_LOW, FRAME_HIGH)
    check("frame", *frame, handles=1, metres=1e-3)
    return {
        "electrodes/comb_a.stl": stl_text("comb_a", *sheet(COMB_A)),
        "electrodes/comb_b.stl": stl("comb_b", *sheet(COMB_B), "millimetres"),
        "electrodes/frame.stl": stl("frame", *frame, "millimetres"),
    }


def body(name, distance, low, high, step, target, shift):
    """Polygons, exact positions, fewer triangles, checks."""
    vertices, triangles = marching_tetrahedra(distance, low, high, step)
    vertices = onto_surface(distance, relax(vertices, triangles, 3), 2.0 * step)
    check(f"{name}, all triangles", vertices, triangles)
    vertices, triangles = decimate(vertices, triangles, target)
    vertices = to_single([tuple(v[m] - shift[m] for m in range(3)) for v in vertices])
    check(name, vertices, triangles)
    return vertices, triangles


def main():
    """Makes every file; see the top of this script."""
    arguments = sys.argv[1:]
    out = Path(__file__).resolve().parent
    verify = arguments == ["--check"]
    if len(arguments) == 2 and arguments[0] == "--out":
        out = Path(arguments[1])
    elif arguments and not verify:
        sys.exit(__doc__)
    hand = body("hand", hand_distance(), (-0.095, -0.315, -0.060), (0.070, 0.145, 0.060), 0.0035, 6000, (0.0, 0.0, 0.0))
    centre = (0.0, 0.5 * (WRIST_Y + ELBOW_Y), 0.0075)
    forearm = body("forearm", forearm_distance(), (-0.070, -0.315, -0.050), (0.070, -0.020, 0.070), 0.006, 2000, centre)
    leg = body("leg", leg_distance(), (-0.090, -0.200, -0.100), (0.090, 0.220, 0.090), 0.008, 2000, (0.0, 0.0, 0.0))
    files = {
        "objects/hand.glb": glb("hand", *hand),
        "objects/forearm.stl": stl("forearm", *forearm),
        "objects/leg.stl": stl("leg", *leg),
        **electrodes(),
    }
    for path, data in files.items():
        target = out / path
        if len(data) > 300_000:
            sys.exit(f"{path}: {len(data)} bytes, more than 300 kB")
        if verify:
            if not target.is_file() or target.read_bytes() != data:
                sys.exit(f"{path} differs from what this script writes")
            print(f"{path}: as generated")
        else:
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(data)
            print(f"{path}: {len(data)} bytes")


if __name__ == "__main__":
    main()
