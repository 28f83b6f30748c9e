"""A flat piece as shapes on layers: kerf-compensated cuts, fold dashes or score lines, labels."""

from collections.abc import Iterable, Iterator

import shapely
from shapely.geometry import Polygon

from foldcar.fabrication.patterns.drawing import Circle, LayerName, Path, Shape
from foldcar.fabrication.patterns.film import fold_cuts
from foldcar.fabrication.patterns.flat_piece import FlatPiece
from foldcar.fabrication.patterns.labels import EdgeMark, label_paths
from foldcar.fabrication.patterns.options import Options

FOLD_LAYERS: dict[str, LayerName] = {"mountain": "FOLD_MOUNTAIN", "valley": "FOLD_VALLEY"}


def piece_shapes(
    flat: FlatPiece, chosen: Options, marks: Iterable[EdgeMark], quarter_turns: int = 0
) -> tuple[list[Shape], list[str]]:
    """The piece's shapes in its own frame, texts upright after the quarter turns; warnings as texts."""
    labels, missing = label_paths(flat, flat.label, marks, quarter_turns)
    warnings = [f'{flat.label}: no room for the label "{text}"' for text in missing]
    shapes: list[Shape] = list(labels)
    shapes += [Path("SCORE", mark) for mark in flat.marks]
    shapes += _folds(flat, chosen)
    shapes += cut_shapes(flat, chosen.kerf_mm)
    return shapes, warnings


def cut_shapes(flat: FlatPiece, kerf_mm: float) -> list[Shape]:
    """Outline and openings, offset by half a kerf so that the cut piece has its size."""
    half = kerf_mm / 2
    shapes: list[Shape] = [Circle("CUT_INNER", middle, diameter / 2 - half) for middle, diameter in flat.circles]
    shapes += [Path("CUT_INNER", slit) for slit in flat.slits]
    for ring in flat.outline.interiors:
        hole = Polygon(ring).buffer(-half, join_style="mitre", mitre_limit=3) if half else Polygon(ring)
        # An opening narrower than the kerf vanishes; part of it may remain.
        parts = [part for part in shapely.get_parts(hole) if not part.is_empty]
        shapes += [_path("CUT_INNER", part.exterior.coords[:-1]) for part in parts]
    return [*shapes, _path("CUT_OUTER", outer_cut(flat, kerf_mm).exterior.coords[:-1])]


def outer_cut(flat: FlatPiece, kerf_mm: float) -> Polygon:
    """The polygon along which the piece is cut out."""
    outer = Polygon(flat.outline.exterior)
    return outer.buffer(kerf_mm / 2, join_style="mitre", mitre_limit=3) if kerf_mm else outer


def _path(layer: LayerName, points: Iterable[tuple[float, ...]]) -> Path:
    return Path(layer, tuple((float(x), float(y)) for x, y in points), closed=True)


def _folds(flat: FlatPiece, chosen: Options) -> Iterator[Shape]:
    for fold in flat.folds:
        # A flexure is neither cut nor scored, which would weaken it; a line on the label layer shows its place.
        if fold.kind == "flexure":
            yield Path("LABEL", (fold.a, fold.b))
        elif chosen.fold == "score":
            yield Path(FOLD_LAYERS[fold.kind], (fold.a, fold.b))
    for fold, cuts in fold_cuts(flat, chosen):
        yield from (Path(FOLD_LAYERS[fold.kind], cut) for cut in cuts)
        if not cuts:
            yield Path("LABEL", (fold.a, fold.b))
