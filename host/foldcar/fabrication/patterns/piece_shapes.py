"""A flat piece as shapes on layers: kerf-compensated cuts with holding tabs, fold dashes or score lines, labels."""

import itertools
from collections.abc import Iterable, Iterator

import numpy as np
import shapely
from shapely.geometry import LineString, Polygon
from shapely.ops import substring

from foldcar.fabrication.patterns.drawing import Circle, LayerName, Path, Shape
from foldcar.fabrication.patterns.film import fold_cuts
from foldcar.fabrication.patterns.flat_piece import FlatPiece
from foldcar.fabrication.patterns.labels import EdgeMark, label_paths
from foldcar.fabrication.patterns.options import Options

# Tabs hold an outline about so far apart, at two places at least.
TAB_PITCH_MM = 150.0
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
    shapes += cut_shapes(flat, chosen.kerf_mm, chosen.holding_tabs_mm)
    return shapes, warnings


def cut_shapes(flat: FlatPiece, kerf_mm: float, holding_tabs_mm: float = 0.0) -> list[Shape]:
    """Outline and openings, offset by half a kerf so that the cut piece has its size.

    With ``holding_tabs_mm`` the outline has gaps, in which a bridge of that width (mm) remains beside the kerf.
    """
    half = kerf_mm / 2
    shapes: list[Shape] = [Circle("CUT_INNER", middle, diameter / 2 - half) for middle, diameter in flat.circles]
    shapes += [Path("CUT_INNER", slit) for slit in flat.slits]
    for ring in flat.outline.interiors:
        hole = Polygon(ring).buffer(-half, join_style="mitre", mitre_limit=3) if half else Polygon(ring)
        # An opening narrower than the kerf vanishes; part of it may remain.
        parts = [part for part in shapely.get_parts(hole) if not part.is_empty]
        shapes += [_path("CUT_INNER", part.exterior.coords[:-1], True) for part in parts]
    outer = outer_cut(flat, kerf_mm).exterior
    if holding_tabs_mm:
        shapes += _held(outer, holding_tabs_mm + kerf_mm)
    else:
        shapes.append(_path("CUT_OUTER", outer.coords[:-1], True))
    return shapes


def _held(ring: shapely.LinearRing, gap_mm: float) -> Iterator[Path]:
    """The outline's cuts between its gaps, each in the middle of the longest straight edge of its part of the outline."""
    line = LineString(ring.coords)
    ends = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(np.asarray(ring.coords), axis=0).T))])
    count = max(2, round(line.length / TAB_PITCH_MM))
    part = line.length / count
    gaps = []
    for number in range(count):
        # The middle half of each part, so that gaps keep apart.
        clipped = np.clip(ends, (number + 0.25) * part, (number + 0.75) * part)
        low, high = clipped[:-1], clipped[1:]
        longest = int(np.argmax(high - low))
        middle = float(low[longest] + high[longest]) / 2
        gaps.append((middle - gap_mm / 2, middle + gap_mm / 2))
    for (_, start), (end, _) in itertools.pairwise(gaps):
        yield _path("CUT_OUTER", substring(line, start, end).coords, False)
    around = [*substring(line, gaps[-1][1], line.length).coords, *substring(line, 0.0, gaps[0][0]).coords[1:]]
    yield _path("CUT_OUTER", around, False)


def outer_cut(flat: FlatPiece, kerf_mm: float) -> Polygon:
    """The polygon along which the piece is cut out."""
    outer = Polygon(flat.outline.exterior)
    return outer.buffer(kerf_mm / 2, join_style="mitre", mitre_limit=3) if kerf_mm else outer


def _path(layer: LayerName, points: Iterable[tuple[float, ...]], closed: bool) -> Path:
    return Path(layer, tuple((float(x), float(y)) for x, y in points), closed)


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
