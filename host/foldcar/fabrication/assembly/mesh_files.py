"""A car's shape for other programs, in millimetres: STL of its film, OBJ of all its parts with their colours.

Input: meshes and solids in the car's frame (x forward, y left, z up). Output: contents of files.
"""

from collections.abc import Sequence

from foldcar.fabrication.assembly.skin import Mesh
from foldcar.fabrication.assembly.solids import Material, Solid

# Diffuse colours, 0 to 255.
COLOURS: dict[Material, tuple[int, int, int]] = {
    "film": (237, 232, 217),
    "tyre": (89, 92, 97),
    "servo": (41, 89, 158),
    "board": (26, 107, 64),
    "battery": (191, 140, 51),
    "other": (140, 140, 140),
}
DIGITS = 5


def stl_bytes(mesh: Mesh) -> bytes:
    """A binary STL file."""
    import trimesh
    from trimesh.exchange.stl import export_stl

    content: bytes = export_stl(trimesh.Trimesh(mesh.vertices_mm, mesh.triangles, process=False))
    return content


def obj_files(solids: Sequence[Solid], name: str) -> dict[str, bytes]:
    """NAME.obj, an object for each solid, and NAME.mtl with their materials."""
    import trimesh
    from trimesh.exchange.obj import export_obj
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import SimpleMaterial

    materials = {key: SimpleMaterial(name=key, diffuse=colour) for key, colour in COLOURS.items()}
    scene = trimesh.Scene()
    for solid in solids:
        # Of a name OBJ takes what comes before a blank.
        title = solid.name.replace(" ", "_")
        visual = TextureVisuals(material=materials[solid.material])
        mesh = trimesh.Trimesh(
            solid.mesh.vertices_mm, solid.mesh.triangles, process=False, visual=visual, metadata={"name": title}
        )
        scene.add_geometry(mesh, node_name=title, geom_name=title)
    text, others = export_obj(
        scene,
        include_normals=False,
        return_texture=True,
        digits=DIGITS,
        mtl_name=f"{name}.mtl",
        header="foldcar, millimetres, x forward, y left, z up",
    )
    return {f"{name}.obj": text.encode(), **others}
