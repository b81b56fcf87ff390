#!/usr/bin/env python3
"""Exchanges meshes with Gmsh and meshio: reads with both what `capsense mesh` writes, and has `capsense` read what both
write, in every format and encoding. Compares counts, groups, volumes and capacitances.

    python3 -m venv venv && venv/bin/pip install gmsh meshio
    venv/bin/python scripts/mesh_interop.py target/release/capsense

Exit code 0 if all agree, 1 if something does not, 77 if gmsh or meshio cannot be imported.
"""

import json
import pathlib
import re
import subprocess
import sys
import tempfile

try:
    import gmsh
    import meshio
    import numpy
except (ImportError, OSError) as error:  # gmsh raises the latter where a system library is missing
    print(f"skipped: {error}")
    sys.exit(77)

DESIGNED = """
[mesh]
generate = { elements = 6000 }
[sensor]
substrate = { thickness = 2e-3, relative_permittivity = 4.4, size = [0.2, 0.2] }
[[sensor.electrode]]
name = "E1"
rectangle = { center = [-0.05, 0.0], size = [0.06, 0.1] }
[[sensor.electrode]]
name = "E2"
rectangle = { center = [0.05, 0.0], size = [0.06, 0.1] }
"""

MESHED = """
[mesh]
file = "FILE"
[[sensor.electrode]]
name = "E1"
[[sensor.electrode]]
name = "E2"
[[object]]
name = "ball"
sphere = { radius = 0.05 }
material = { conductor = "grounded" }
position = [0.0, 0.0, 0.1]
[simulation]
geometry = "solids"
"""

failures = 0


def check(name, found, expected, tolerance=0.0):
    """Compares numbers, or dictionaries or lists of them."""
    global failures
    if isinstance(expected, dict):
        agree = found.keys() == expected.keys()
        agree = agree and all(numpy.allclose(found[k], expected[k], tolerance, 0.0) for k in expected)
    else:
        agree = numpy.allclose(found, expected, tolerance, 0.0)
    failures += not agree
    print(f"{'ok    ' if agree else 'FAILED'} {name}: {found}" + ("" if agree else f", expected {expected}"))


def volume_of(nodes, tets):
    corner = nodes[tets]
    edges = corner[:, 1:] - corner[:, :1]
    return numpy.linalg.det(edges).sum() / 6.0


def seen_by_gmsh(path):
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.open(str(path))
    tags, positions, _ = gmsh.model.mesh.getNodes()
    place = {tag: at for at, tag in enumerate(tags)}
    tet_nodes = gmsh.model.mesh.getElementsByType(4)[1].reshape(-1, 4)
    tets = numpy.array([[place[node] for node in tet] for tet in tet_nodes])
    groups = {}
    for dimension, tag in gmsh.model.getPhysicalGroups():
        entities = gmsh.model.getEntitiesForPhysicalGroup(dimension, tag)
        of_entity = (gmsh.model.mesh.getElements(dimension, entity)[1] for entity in entities)
        groups[gmsh.model.getPhysicalName(dimension, tag)] = sum(len(tags) for part in of_entity for tags in part)
    gmsh.finalize()
    volume = volume_of(positions.reshape(-1, 3), tets)
    return {"nodes": len(tags), "tets": len(tets), "volume": volume} | groups


def seen_by_meshio(path):
    mesh = meshio.read(path)
    tets = numpy.vstack([block.data for block in mesh.cells if block.type == "tetra"])
    seen = {"nodes": len(mesh.points), "tets": len(tets), "volume": volume_of(mesh.points, tets)}
    for name, sets in mesh.cell_sets.items():
        if not name.startswith("gmsh:"):
            seen[name] = sum(len(cells) for cells in sets if cells is not None)
    return seen


def seen_by_capsense(capsense, path):
    out = subprocess.run([capsense, "mesh", "info", path], capture_output=True, text=True, check=True).stdout
    number = lambda pattern: float(re.search(pattern, out).group(1))
    seen = {"nodes": number(r"nodes +(\d+)"), "tets": number(r"tetrahedra +(\d+)"), "volume": number(r"volume \S+ +(\S+)")}
    for name, count in re.findall(r'physical \w+ \d+ "([^"]+)" +(\d+)', out):
        seen[name] = float(count)
    return seen


def solved(capsense, folder, path):
    scene = folder / "meshed.toml"
    scene.write_text(MESHED.replace("FILE", path.name))
    out = subprocess.run([capsense, "solve", scene, "--json"], capture_output=True, text=True, check=True).stdout
    return json.loads(out)["capacitance_farads"]


def read_what_capsense_writes(capsense, folder):
    scene, path = folder / "designed.toml", folder / "designed.msh"
    scene.write_text(DESIGNED)
    subprocess.run([capsense, "mesh", scene, "--out", path], capture_output=True, check=True)
    expected = seen_by_capsense(capsense, path)
    check("capsense's mesh, its groups", sorted(expected.keys() - {"nodes", "tets", "volume"}) ==
          ["E1", "E2", "air", "ground", "substrate"], True)
    check("capsense's mesh, read by gmsh", seen_by_gmsh(path), expected, 1e-6)
    # meshio puts an element of several groups into one of them only; here none is in two.
    check("capsense's mesh, read by meshio", seen_by_meshio(path), expected, 1e-6)


def two_plates(as_volumes):
    """Two electrodes, sheets or plates, in a box whose outside is ground."""
    occ, height = gmsh.model.occ, 0.01
    box = occ.addBox(-0.25, -0.25, -0.05, 0.5, 0.5, 0.5)
    if as_volumes:
        plates = [(3, occ.addBox(x, -0.05, 0, 0.06, 0.1, height)) for x in (-0.08, 0.02)]
    else:
        plates = [(2, occ.addRectangle(x, -0.05, 0, 0.06, 0.1)) for x in (-0.08, 0.02)]
    _, parts = occ.fragment([(3, box)], plates)
    occ.synchronize()
    dimension = plates[0][0]
    electrodes = [[tag for d, tag in of_plate if d == dimension] for of_plate in parts[1:]]
    air = [tag for _, tag in parts[0] if not as_volumes or tag not in sum(electrodes, [])]
    outside = gmsh.model.getBoundary([(3, tag) for d, tag in gmsh.model.getEntities(3)], oriented=False)
    gmsh.model.addPhysicalGroup(2, [tag for _, tag in outside], name="ground")
    for name, entities in zip(("E1", "E2"), electrodes):
        gmsh.model.addPhysicalGroup(dimension, entities, name=name)
    gmsh.model.addPhysicalGroup(3, air, name="air")
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.06)
    gmsh.model.mesh.generate(3)


def written_by_gmsh(folder, as_volumes):
    """Paths of one mesh in all formats, encodings and some options."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    two_plates(as_volumes)
    paths = []

    def save(version, binary, option):
        kind = "plates" if as_volumes else "sheets"
        path = folder / f"{kind}_{version}_{'binary' if binary else 'ascii'}_{option}.msh"
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        gmsh.option.setNumber("Mesh.Binary", binary)
        gmsh.write(str(path))
        paths.append(path)

    formats = [(version, binary) for version in (2.2, 4.1) for binary in (0, 1)]
    for parametric in (0, 1):
        gmsh.option.setNumber("Mesh.SaveParametric", parametric)
        for version, binary in formats:
            save(version, binary, ("plain", "parametric")[parametric])
    gmsh.option.setNumber("Mesh.SaveParametric", 0)
    gmsh.model.mesh.setOrder(2)
    for version, binary in formats:
        save(version, binary, "second_order")
    gmsh.model.mesh.setOrder(1)
    gmsh.model.mesh.partition(3)
    for version, binary in formats:
        save(version, binary, "partitioned")
    gmsh.finalize()
    return paths


def write_what_capsense_reads(capsense, folder):
    for as_volumes in (False, True):
        paths = written_by_gmsh(folder, as_volumes)
        expected, capacitance = seen_by_gmsh(paths[0]), solved(capsense, folder, paths[0])
        for path in paths:
            check(f"gmsh's {path.name}", seen_by_capsense(capsense, path), expected, 1e-6)
            check(f"gmsh's {path.name}, solved", solved(capsense, folder, path), capacitance, 1e-3)
        mesh = meshio.read(paths[2])  # of format 4.1: only then does meshio know entities, which it needs to write it
        for binary in (False, True):
            path = folder / f"meshio_{binary}.msh"
            meshio.write(path, mesh, file_format="gmsh22", binary=binary)
            check(f"meshio's 2.2, binary {binary}", seen_by_capsense(capsense, path), expected, 1e-6)
            # In format 4.1, meshio 5 writes no groups.
            meshio.write(path, mesh, file_format="gmsh", binary=binary)
            seen = {k: v for k, v in seen_by_capsense(capsense, path).items() if k in ("nodes", "tets", "volume")}
            check(f"meshio's 4.1, binary {binary}", seen, {key: expected[key] for key in seen}, 1e-6)


def main():
    capsense = pathlib.Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory() as folder:
        read_what_capsense_writes(capsense, pathlib.Path(folder))
        write_what_capsense_reads(capsense, pathlib.Path(folder))
    print(f"{failures} failures")
    return min(failures, 1)


if __name__ == "__main__":
    sys.exit(main())
