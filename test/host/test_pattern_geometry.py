"""Flat pieces, folds, splits and nesting against closed forms and independent geometry."""

import itertools
import math

import pytest
import shapely
from cut_samples import FLAP, HEIGHT, LENGTH, RIGHT_ANGLE, THICKNESS, WIDTH, beam, cap, disc, folded_box, rim
from shapely.geometry import LineString, Polygon, box

from foldcar.car.folded.model import Crease, EdgeRef, Face, Piece
from foldcar.fabrication.patterns.dashes import dashes
from foldcar.fabrication.patterns.drawing import Circle, Path
from foldcar.fabrication.patterns.edge_offset import offset_edges
from foldcar.fabrication.patterns.flat_piece import bend_deduction_mm, flat_piece
from foldcar.fabrication.patterns.join_marks import join_marks
from foldcar.fabrication.patterns.labels import label_paths
from foldcar.fabrication.patterns.nesting import NestingError, nest
from foldcar.fabrication.patterns.options import Options, options
from foldcar.fabrication.patterns.piece_shapes import cut_shapes
from foldcar.fabrication.patterns.sheets import pattern
from foldcar.fabrication.patterns.split_body import as_cut
from foldcar.fabrication.patterns.split_strip import OVERLAP_MM, split_to_fit


def plain(**changes: object) -> Options:
    """Options without clearance and bend deduction, which is 0 for right angles at k = 2 / pi."""
    return options("silhouette", **{"tab_clearance_mm": 0.0, "k_factor": 2 / math.pi, **changes})


# The bend deduction of a right angle with k = 0.5 and radius 0.
RIGHT_ANGLE_DEDUCTION = THICKNESS - RIGHT_ANGLE * THICKNESS / 2


def test_an_offset_square_is_a_smaller_square() -> None:
    corners = offset_edges([(0, 0), (10, 0), (10, 10), (0, 10)], [1, 1, 2, 0.5])

    assert corners == [[(0.5, 1.0)], [(9.0, 1.0)], [(9.0, 8.0)], [(0.5, 8.0)]]


def test_edges_on_one_line_with_different_offsets_make_a_step() -> None:
    corners = offset_edges([(0, 0), (5, 0), (10, 0), (10, 10), (0, 10)], [0, 1, 0, 0, 0])

    assert corners[1] == [(5, 0), (5, 1)]


def test_a_flat_is_as_long_as_its_faces_less_what_the_bends_save() -> None:
    chosen = options("silhouette", tab_clearance_mm=0.0)

    flat = flat_piece(beam(), chosen)

    x0, y0, x1, y1 = flat.outline.bounds
    assert x1 - x0 == pytest.approx(LENGTH, abs=1e-3)
    assert y1 - y0 == pytest.approx(2 * WIDTH + 2 * HEIGHT + FLAP - 4 * RIGHT_ANGLE_DEDUCTION, abs=1e-3)


@pytest.mark.parametrize(("radius", "k_factor", "angle"), [(0.0, 0.5, 90), (1.0, 0.4, 90), (0.5, 0.3, 60)])
def test_bend_deduction_is_that_of_a_measured_arc(radius: float, k_factor: float, angle: float) -> None:
    chosen = options("silhouette", bend_radius_mm=radius, k_factor=k_factor)
    turn = math.radians(angle)
    # Two legs of the middle surface to its sharp corner, against legs to the arc's tangents and the neutral arc.
    middle = radius + THICKNESS / 2
    tangent_from_corner = middle / math.tan((math.pi - turn) / 2)
    points = [
        (
            (radius + k_factor * THICKNESS) * math.cos(t * turn / 2000),
            (radius + k_factor * THICKNESS) * math.sin(t * turn / 2000),
        )
        for t in range(2001)
    ]
    arc = sum(math.dist(a, b) for a, b in itertools.pairwise(points))

    assert bend_deduction_mm(turn, THICKNESS, chosen) == pytest.approx(2 * tangent_from_corner - arc, abs=1e-6)


def test_folds_are_valleys_or_mountains_by_their_angle() -> None:
    assert {fold.kind for fold in flat_piece(beam(), plain()).folds} == {"valley"}
    assert {fold.kind for fold in flat_piece(cap(), plain()).folds} == {"mountain"}


def test_an_evenly_bent_rim_has_folds_at_its_teeth_only() -> None:
    flat = flat_piece(rim(40.0), plain())

    assert len(flat.folds) == 80
    assert all(abs(fold.a[1] - fold.b[1]) < 1e-6 for fold in flat.folds)


def test_tabs_lose_their_clearance_and_keep_their_fold() -> None:
    wide, narrow = flat_piece(cap(), plain()), flat_piece(cap(), plain(tab_clearance_mm=0.5))

    x0, _, x1, _ = wide.outline.bounds
    u0, _, u1, _ = narrow.outline.bounds
    assert (x1 - x0) - (u1 - u0) == pytest.approx(2 * 0.5, abs=1e-3)
    # Mitred sides stand at 45 degrees: their ends move by the clearance times the root of two.
    lengths = sorted(math.dist(fold.a, fold.b) for fold in narrow.folds)
    assert lengths[0] == pytest.approx(HEIGHT - 2 * 0.5 * math.sqrt(2), abs=1e-3)


def test_the_plain_flat_has_the_area_of_its_faces() -> None:
    area = LENGTH * (2 * WIDTH + 2 * HEIGHT) + (LENGTH - FLAP) * FLAP - 23.4 * 12.7 - math.pi * 1.0**2
    # A strip along each of the four folds.
    area -= 4 * LENGTH * RIGHT_ANGLE_DEDUCTION

    flat = flat_piece(beam(), options("silhouette", tab_clearance_mm=0.0))

    assert flat.area_mm2 == pytest.approx(area, rel=2e-5)


@pytest.mark.parametrize("length", [1.0, 2.0, 7.3, 60.0, 200.0])
def test_dashes_leave_bridges_at_least_as_long_as_asked(length: float) -> None:
    cuts = dashes((0.0, 0.0), (length, 0.0), 1.5, 1.0)

    ends = [0.0, *(x for a, b in cuts for x in (a[0], b[0])), length]
    bridges = [b - a for a, b in itertools.pairwise(ends)][::2]
    assert len(set(round(bridge, 9) for bridge in bridges)) == 1
    if length > 3.5:
        assert all(math.dist(a, b) == pytest.approx(1.5) for a, b in cuts)
        assert bridges[0] >= 1.0 - 1e-9
    else:
        assert bridges[0] > 0


def test_cuts_move_by_half_a_kerf_so_that_pieces_keep_their_size() -> None:
    kerf = 0.2
    flat = flat_piece(beam(), plain())

    shapes = cut_shapes(flat, kerf)

    (outer,) = (Polygon(s.points_mm) for s in shapes if isinstance(s, Path) and s.layer == "CUT_OUTER")
    (inner,) = (Polygon(s.points_mm) for s in shapes if isinstance(s, Path) and s.layer == "CUT_INNER")
    (round_hole,) = (s for s in shapes if isinstance(s, Circle))
    # The film that a beam of the kerf's width leaves along these lines.
    left = outer.buffer(-kerf / 2, join_style="mitre").difference(inner.buffer(kerf / 2, join_style="mitre"))
    assert left.symmetric_difference(flat.outline).area < 0.01
    assert 2 * round_hole.radius_mm + kerf == pytest.approx(2.0)


def test_faces_that_touch_without_a_fold_are_cut_apart() -> None:
    panel = Face("panel", ((0.0, 0.0), (60.0, 0.0), (60.0, 20.0), (30.0, 20.0), (0.0, 20.0)))
    tabs = tuple(Face(name, ((0.0, 0.0), (30.0, 0.0), (30.0, 8.0), (0.0, 8.0)), (), "tab") for name in ("a", "b"))
    creases = tuple(
        Crease(tab.name, EdgeRef("panel", edge), EdgeRef(tab.name, 0), RIGHT_ANGLE)
        for tab, edge in zip(tabs, (2, 3), strict=True)
    )

    flat = flat_piece(Piece("two tabs", "", (panel, *tabs), creases, THICKNESS), plain())

    (slit,) = flat.slits
    assert sorted(slit) == [pytest.approx((30.0, 20.0), abs=0.01), pytest.approx((30.0, 28.0), abs=0.01)]
    assert flat_piece(beam(), plain()).slits == ()


def test_a_long_strip_is_split_between_teeth_and_overlaps() -> None:
    flat = flat_piece(rim(60.0), options("silhouette"))
    chosen = options("silhouette", sheet="a4")

    parts = split_to_fit(flat, chosen)

    assert len(parts) == 2
    widths = [part.outline.bounds[2] - part.outline.bounds[0] for part in parts]
    whole = flat.outline.bounds[2] - flat.outline.bounds[0]
    assert sum(widths) == pytest.approx(whole + OVERLAP_MM, abs=0.01)
    assert max(widths) <= 297 - 2 * chosen.margin_mm
    assert sum(len(part.folds) for part in parts) == len(flat.folds)
    teeth = [face.outline.area for part in parts for face in part.faces if face.role == "tab"]
    assert len(teeth) == 80
    assert max(teeth) - min(teeth) < 1e-3


def test_a_beam_too_large_for_the_sheet_is_parted_at_a_fold_and_joined_by_a_tab() -> None:
    chosen = options("silhouette", sheet="150x150", margin_mm=5)
    car = folded_box(40.0)

    cut = as_cut(car, chosen)
    pieces, joins = cut.pieces, cut.joins

    parts = [piece for piece in pieces if piece.name.startswith("beam, part")]
    assert len(parts) >= 2
    names = sorted(face.name for piece in parts for face in piece.faces if "splice" not in face.name)
    assert names == sorted(face.name for face in beam().faces)
    for part in parts:
        x0, y0, x1, y1 = flat_piece(part, chosen).outline.bounds
        assert max(x1 - x0, y1 - y0) <= 140
    new = [join for join in joins if join.number > 6]
    assert len(new) == len(parts) - 1
    by_name = {piece.name: {face.name for face in piece.faces} for piece in pieces}
    assert all(join.a.face in by_name[join.piece_a] and join.b.face in by_name[join.piece_b] for join in joins)


def test_a_fold_that_does_not_help_is_left_alone() -> None:
    pieces = as_cut(folded_box(40.0), options("silhouette", sheet="110x110", margin_mm=5)).pieces

    assert "beam" in [piece.name for piece in pieces]


def test_nested_pieces_keep_their_gap_and_stay_on_their_sheets() -> None:
    discs = Polygon(disc(30.0).faces[0].outline_mm)
    pieces = [("slab", box(0, 0, 90, 40), 3), ("disc", discs, 9), ("strip", box(0, 0, 150, 7.3), 4)]

    nested = nest(pieces, (200.0, 180.0), 4.0, 2.0, (102.0, 9.0))

    for sheet in range(len(nested.reserved)):
        placed = [
            shapely.transform(outline, lambda xy, m=copy.motion: [m.apply(tuple(p)) for p in xy])
            for (_, outline, _), copies in zip(pieces, nested.placements, strict=True)
            for copy in copies
            if copy.sheet == sheet
        ]
        placed.append(box(4, 4, 106, 13))
        assert all(a.distance(b) >= 2.0 for a, b in itertools.combinations(placed, 2))
        assert all(box(4, 4, 196, 176).buffer(1e-6).contains(piece) for piece in placed)
    assert [len(copies) for copies in nested.placements] == [3, 9, 4]
    assert nest(pieces, (200.0, 180.0), 4.0, 2.0, (102.0, 9.0)) == nested


def test_a_piece_that_just_fits_is_placed() -> None:
    nested = nest([("full", box(0, 0, 191.9, 171.9), 1)], (200.0, 180.0), 4.0, 2.0, (102.0, 9.0))

    assert nested.reserved == (False,)


def test_a_piece_that_fits_no_sheet_is_named_with_both_sizes() -> None:
    with pytest.raises(NestingError, match=r"slab is 300\.0 x 40\.0 mm, but of a sheet of 200 x 180 mm"):
        nest([("slab", box(0, 0, 300, 40), 1)], (200.0, 180.0), 4.0, 2.0, (102.0, 9.0))


@pytest.mark.parametrize("turn", [0, 1, 2, 3])
def test_labels_stay_clear_of_cuts_and_folds_and_are_upright(turn: int) -> None:
    car = folded_box()
    for piece in car.pieces:
        flat = flat_piece(piece, plain())
        marks = list(join_marks(flat, car.joins))
        paths, missing = label_paths(flat, flat.label, marks, turn)
        lines = [LineString([fold.a, fold.b]) for fold in flat.folds] + [flat.outline.boundary]
        lines += [shapely.Point(middle).buffer(diameter / 2) for middle, diameter in flat.circles]
        strokes = shapely.union_all([LineString(path.points_mm) for path in paths])
        assert missing == []
        assert strokes.distance(shapely.union_all(lines)) > 0.5


def test_every_join_is_numbered_on_both_of_its_pieces() -> None:
    car = folded_box()

    marked = {
        piece.name: [mark.text for mark in join_marks(flat_piece(piece, plain()), car.joins)] for piece in car.pieces
    }

    assert sorted(marked["beam"]) == ["1", "1", "2", "3", "4", "5"]
    assert sorted(marked["cap"]) == ["2", "3", "4", "5"]
    assert (marked["rim"], marked["disc"]) == (["6"], ["6"])


def test_sheets_hold_every_copy_of_every_piece() -> None:
    cut = pattern(folded_box(40.0), options("laser"), "box")

    outlines = [s for sheet in cut.sheets for s in sheet.shapes if isinstance(s, Path) and s.layer == "CUT_OUTER"]
    assert len(outlines) == sum(piece.count for piece in folded_box().pieces)
    assert cut.film_area_mm2 == pytest.approx(sum(piece.area_mm2 * piece.count for piece in cut.pieces))
    # The kerf's half along each outline is cut beyond the pieces.
    area = sum(Polygon(outline.points_mm).area for outline in outlines)
    length = sum(outline.length_mm for outline in outlines)
    openings = 23.4 * 12.7 + math.pi + 4 * math.pi / 4 * 7.4**2
    assert area == pytest.approx(cut.film_area_mm2 + openings + length * 0.15 / 2, rel=1e-3)
