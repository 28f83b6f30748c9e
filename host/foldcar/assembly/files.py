"""All files about a car besides its cut sheets: shapes, lists, wiring, guide.

Input: a FoldedCar. Output: contents by file name; whoever calls writes them.
"""

from foldcar.assembly.fold_file import fold_text
from foldcar.assembly.guide import guide_page
from foldcar.assembly.obj import mtl_text, obj_text
from foldcar.assembly.parts_list import parts_list_csv, parts_list_text
from foldcar.assembly.skin import joined
from foldcar.assembly.solids import film_solids, mount_solids
from foldcar.assembly.stl import stl_bytes
from foldcar.assembly.wiring import wiring_text
from foldcar.assembly.wiring_drawing import wiring_drawing
from foldcar.sheet.model import FoldedCar

MATERIALS_FILE = "car.mtl"


def assembly_files(folded: FoldedCar, title: str) -> dict[str, bytes]:
    """``car.stl`` has the film alone, ``car.obj`` bought parts too; one FOLD file for each piece."""
    film = film_solids(folded)
    texts = {
        "car.obj": obj_text([*film, *mount_solids(folded)], MATERIALS_FILE),
        MATERIALS_FILE: mtl_text(),
        "parts.md": parts_list_text(folded, title),
        "parts.csv": parts_list_csv(folded),
        "wiring.md": wiring_text(folded, title),
        "wiring.svg": wiring_drawing(folded, title),
        "guide.html": guide_page(folded, title),
    }
    texts |= {f"fold/{piece.name.replace(' ', '_')}.fold": fold_text(piece, title) for piece in folded.pieces}
    files = {name: text.encode() for name, text in texts.items()}
    return {"car.stl": stl_bytes(joined([solid.mesh for solid in film]), title), **files}
