"""Wavefront OBJ: an object with a material for every part, a group for every rigid body; millimetres, z is up."""

from collections.abc import Sequence

from foldcar.fabrication.assembly.solids import Material, Solid

# Diffuse colour and opacity.
MATERIALS: dict[Material, tuple[tuple[float, float, float], float]] = {
    "film": ((0.93, 0.91, 0.85), 0.9),
    "tyre": ((0.35, 0.36, 0.38), 1.0),
    "servo": ((0.16, 0.35, 0.62), 1.0),
    "board": ((0.10, 0.42, 0.25), 1.0),
    "battery": ((0.75, 0.55, 0.20), 1.0),
    "other": ((0.55, 0.55, 0.55), 1.0),
}


def obj_text(solids: Sequence[Solid], material_file: str) -> str:
    """The OBJ file; ``material_file`` is the name of the file with ``mtl_text`` beside it."""
    lines = ["# foldcar, millimetres, x forward, y left, z up", f"mtllib {material_file}"]
    first = 1
    for solid in solids:
        lines += [f"o {solid.name.replace(' ', '_')}", f"g {solid.body}", f"usemtl {solid.material}"]
        lines += [f"v {x:.5f} {y:.5f} {z:.5f}" for x, y, z in solid.mesh.vertices_mm.tolist()]
        lines += [f"f {a + first} {b + first} {c + first}" for a, b, c in solid.mesh.triangles.tolist()]
        first += len(solid.mesh.vertices_mm)
    return "\n".join([*lines, ""])


def mtl_text() -> str:
    """The materials' file."""
    lines = ["# foldcar"]
    for name, ((red, green, blue), opacity) in MATERIALS.items():
        lines += [f"newmtl {name}", f"Kd {red} {green} {blue}", f"d {opacity}", "Ns 10", "illum 2"]
    return "\n".join([*lines, ""])
