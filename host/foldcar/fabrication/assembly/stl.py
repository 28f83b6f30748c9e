"""Binary STL, in millimetres."""

import numpy as np

from foldcar.fabrication.assembly.skin import Mesh

HEADER_BYTES = 80
TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def stl_bytes(mesh: Mesh, title: str) -> bytes:
    """The file's content. ``title`` goes into its header, cut to 80 bytes; it must not begin with ``solid``."""
    corners = mesh.vertices_mm[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    records = np.zeros(len(corners), dtype=TRIANGLE)
    records["normal"] = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0)
    records["corners"] = corners
    header = f"foldcar, millimetres: {title}".encode("ascii", "replace")[:HEADER_BYTES].ljust(HEADER_BYTES)
    return b"".join((header, np.uint32(len(records)).tobytes(), records.tobytes()))
