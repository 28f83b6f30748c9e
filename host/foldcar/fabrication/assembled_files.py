"""The files of a car besides its sheets: its shape for other programs; guide, wiring and parts list.

Input: a FoldedCar, for the guide also the car with its pieces as cut, a title. Output: contents by relative path.
"""

from collections.abc import Mapping

from foldcar.car.folded.model import FoldedCar
from foldcar.fabrication.assembly.fold_file import fold_text
from foldcar.fabrication.assembly.obj import mtl_text, obj_text
from foldcar.fabrication.assembly.parts_list import parts_list_csv, parts_list_text
from foldcar.fabrication.assembly.solids import film_mesh, film_solids, mount_solids
from foldcar.fabrication.assembly.stl import stl_bytes
from foldcar.fabrication.assembly.wiring import wiring_text
from foldcar.fabrication.assembly.wiring_drawing import wiring_drawing


def shape_files(folded: FoldedCar, title: str) -> dict[str, bytes]:
    """FOLD, STL and OBJ."""
    texts = {
        **{f"fold/{piece.name}.fold": fold_text(piece, title) for piece in folded.pieces},
        "car.obj": obj_text([*film_solids(folded), *mount_solids(folded)], "car.mtl"),
        "car.mtl": mtl_text(),
    }
    return {"car.stl": stl_bytes(film_mesh(folded), title), **_encoded(texts)}


def pages(folded: FoldedCar, as_cut: FoldedCar, strips: Mapping[str, int], title: str) -> dict[str, bytes]:
    """Guide, wiring and parts list; ``as_cut`` and ``strips`` are those of a CutCar."""
    # It alone needs this, in a process of its own.
    from foldcar.fabrication.assembly.guide import guide_page

    texts = {
        "assembly.html": guide_page(folded, as_cut, strips, title),
        "wiring.md": wiring_text(folded, title),
        "wiring.svg": wiring_drawing(folded, title),
        "parts.md": parts_list_text(folded, title),
        "parts.csv": parts_list_csv(folded),
    }
    return _encoded(texts)


def _encoded(texts: Mapping[str, str]) -> dict[str, bytes]:
    return {name: text.encode() for name, text in texts.items()}
