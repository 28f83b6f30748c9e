"""Flat pieces, folds, splits and nesting against closed forms and independent geometry."""

import itertools
import math
import re
from collections import Counter
from dataclasses import replace

import pytest
import shapely
from shapely.geometry import LineString, Polygon, box

from cut_samples import FLAP, HEIGHT, LENGTH, RIGHT_ANGLE, THICKNESS, WIDTH, beam, cap, circle, disc, folded_box, rim
from foldcar.car.components.shape import on_circle
from foldcar.car.design import compose
from foldcar.car.folded.model import IDENTITY, Crease, EdgeRef, Face, Hole, Piece, PlacedPiece
from foldcar.car.folded_car import folded_car
from foldcar.fabrication.patterns.drawing import Circle, Path, Point
from foldcar.fabrication.patterns.film import dashes, narrowest_film
from foldcar.fabrication.patterns.flat_piece import FlatPiece, bend_deduction_mm, flat_piece, offset_edges
from foldcar.fabrication.patterns.labels import join_marks, label_paths
from foldcar.fabrication.patterns.nesting import NestingError, nest
from foldcar.fabrication.patterns.options import Options, options, sheet_size_mm
from foldcar.fabrication.patterns.piece_shapes import cut_shapes, piece_shapes
from foldcar.fabrication.patterns.sheets import pattern
from foldcar.fabrication.patterns.splitting import OVERLAP_MM, as_cut, split_to_fit


def plain(**changes: object) -> Options:
    """Options without clearance and bend deduction, which is 0 for right angles at k = 2 / pi."""
    return options("silhouette", **{"tab_clearance_mm": 0.0, "k_factor": 2 / math.pi, **changes})


# The bend deduction of a right angle with k = 0.5 and radius 0.
RIGHT_ANGLE_DEDUCTION = THICKNESS - RIGHT_ANGLE * THICKNESS / 2


def test_faces_along_oblique_edges_that_end_beside_their_corners_are_one_area() -> None:
    # A hub's walls are shorter than its edges, which a bend deduction moves inwards.
    car = folded_car(compose("W_B+film=card_160+horn=disc", {"width": 60, "B.length": 100}))
    hub = next(piece for piece in car.pieces if piece.name == "wheel hub")

    flat = flat_piece(hub, options("cricut"))

    of_faces = sum(face.outline.area for face in flat.faces)
    assert Polygon(flat.outline.exterior).area == pytest.approx(of_faces, abs=0.01)


def test_an_offset_square_is_smaller_and_edges_on_one_line_with_different_offsets_make_a_step() -> None:
    square = offset_edges([(0, 0), (10, 0), (10, 10), (0, 10)], [1, 1, 2, 0.5])
    stepped = offset_edges([(0, 0), (5, 0), (10, 0), (10, 10), (0, 10)], [0, 1, 0, 0, 0])

    assert square == [[(0.5, 1.0)], [(9.0, 1.0)], [(9.0, 8.0)], [(0.5, 8.0)]]
    assert stepped[1] == [(5, 0), (5, 1)]


def test_a_flat_is_as_long_and_as_large_as_its_faces_less_what_the_bends_save() -> None:
    high = 2 * WIDTH + 2 * HEIGHT + FLAP - 4 * RIGHT_ANGLE_DEDUCTION
    # The flap is mitred; openings for a servo and a screw.
    area = LENGTH * high - FLAP**2 - 23.4 * 12.7 - math.pi * 1.0**2

    flat = flat_piece(beam(), options("silhouette", tab_clearance_mm=0.0))

    x0, y0, x1, y1 = flat.outline.bounds
    assert (x1 - x0, y1 - y0) == pytest.approx((LENGTH, high), abs=1e-3)
    assert flat.area_mm2 == pytest.approx(area, rel=2e-5)


@pytest.mark.parametrize(("radius", "k_factor", "angle"), [(0.0, 0.5, 90), (1.0, 0.4, 90), (0.5, 0.3, 60)])
def test_bend_deduction_is_that_of_a_measured_arc(radius: float, k_factor: float, angle: float) -> None:
    chosen = options("silhouette", bend_radius_mm=radius, k_factor=k_factor)
    turn = math.radians(angle)
    # Two legs of the middle surface to its sharp corner, against legs to the arc's tangents and the neutral arc.
    middle = radius + THICKNESS / 2
    tangent_from_corner = middle / math.tan((math.pi - turn) / 2)
    points = on_circle(radius + k_factor * THICKNESS, (t * turn / 2000 for t in range(2001)))
    arc = sum(math.dist(a, b) for a, b in itertools.pairwise(points))

    assert bend_deduction_mm(turn, THICKNESS, chosen) == pytest.approx(2 * tangent_from_corner - arc, abs=1e-6)


def test_folds_are_valleys_or_mountains_by_their_angle_and_an_even_bend_has_none() -> None:
    assert {fold.kind for fold in flat_piece(beam(), plain()).folds} == {"valley"}
    assert {fold.kind for fold in flat_piece(cap(), plain()).folds} == {"mountain"}
    # A rim has folds at its teeth only.
    bent = flat_piece(rim(40.0), plain()).folds
    assert len(bent) == 80 and all(abs(fold.a[1] - fold.b[1]) < 1e-6 for fold in bent)


def test_tabs_lose_their_clearance_and_keep_their_fold() -> None:
    wide, narrow = flat_piece(cap(), plain()), flat_piece(cap(), plain(tab_clearance_mm=0.5))

    x0, _, x1, _ = wide.outline.bounds
    u0, _, u1, _ = narrow.outline.bounds
    assert (x1 - x0) - (u1 - u0) == pytest.approx(2 * 0.5, abs=1e-3)
    # Mitred sides stand at 45 degrees: their ends move by the clearance times the root of two.
    lengths = sorted(math.dist(fold.a, fold.b) for fold in narrow.folds)
    assert lengths[0] == pytest.approx(HEIGHT - 2 * 0.5 * math.sqrt(2), abs=1e-3)


@pytest.mark.parametrize("length", [1.0, 2.0, 7.3, 60.0, 200.0])
def test_dashes_leave_bridges_at_least_as_long_as_asked(length: float) -> None:
    cuts = dashes((0.0, 0.0), (length, 0.0), 1.5, 1.0)

    ends = [0.0, *(x for a, b in cuts for x in (a[0], b[0])), length]
    bridges = [b - a for a, b in itertools.pairwise(ends)][::2]
    assert all(round(bridge, 9) == round(bridges[1], 9) for bridge in bridges[1:-1])
    assert bridges[0] == pytest.approx(bridges[-1])
    if length > 3.5:
        assert all(math.dist(a, b) == pytest.approx(1.5) for a, b in cuts)
        assert min(bridges) >= 1.0 - 1e-9
    else:
        # A tiny fold bends without a cut.
        assert cuts == []


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


def test_a_long_strip_is_split_between_facets_and_overlaps_by_one() -> None:
    flat = flat_piece(rim(60.0), options("silhouette"))
    chosen = options("silhouette", sheet="a4")

    parts = split_to_fit(flat, chosen, itertools.count(7))

    assert len(parts) == 2
    facet = 2 * 60.0 * math.sin(math.pi / 40)
    widths = [part.outline.bounds[2] - part.outline.bounds[0] for part in parts]
    whole = flat.outline.bounds[2] - flat.outline.bounds[0]
    assert sum(widths) == pytest.approx(whole + facet, abs=0.01)
    assert max(widths) <= 297 - 2 * chosen.margin_mm
    assert sum(len(part.folds) for part in parts) == len(flat.folds)
    teeth = [face.outline.area for part in parts for face in part.faces if face.role == "tab"]
    assert len(teeth) == 80
    assert max(teeth) - min(teeth) < 1e-3
    assert [number for part in parts for number, _ in part.seams] == [7, 7]


def test_a_bend_is_neither_cut_nor_shortened() -> None:
    faces = tuple(Face(str(i), ((0.0, 0.0), (10.0, 0.0), (10.0, 8.0), (0.0, 8.0))) for i in range(9))
    creases = tuple(
        Crease(str(i), EdgeRef(str(i), 1), EdgeRef(str(i + 1), 3), 2 * math.pi / 9, bend=True) for i in range(8)
    )

    flat = flat_piece(Piece("hoop", "", faces, creases, THICKNESS), options("silhouette"))

    assert flat.folds == ()
    assert flat.outline.bounds == pytest.approx((0, 0, 90, 8), abs=1e-6)
    assert piece_shapes(flat, options("silhouette"), [])[0][-1].length_mm == pytest.approx(2 * (90 + 8))


def test_a_piece_too_large_both_ways_is_parted_lengthwise_and_across() -> None:
    flat = flat_piece(beam(), plain())
    chosen = plain(sheet="100x90", margin_mm=5.0)

    parts = split_to_fit(flat, chosen, itertools.count(7))

    for part in parts:
        x0, y0, x1, y1 = part.outline.bounds
        assert sorted((x1 - x0, y1 - y0)) <= [80, 90]
    assert {part.label for part in parts} == {f"beam, {i} of {len(parts)}" for i in range(1, len(parts) + 1)}
    # Every line where two parts meet has a number of its own, on both of them.
    numbers = Counter(number for part in parts for number, _ in part.seams)
    assert len(numbers) == len(parts) - 1
    assert all(count >= 2 for count in numbers.values())
    # Openings stay whole; film and folds are there once, but for the overlaps.
    assert sum(len(part.circles) for part in parts) == 1
    assert [ring.length for part in parts for ring in part.outline.interiors] == [pytest.approx(2 * (23.4 + 12.7))]
    folds = [math.dist(fold.a, fold.b) for part in parts for fold in part.folds]
    assert sum(folds) == pytest.approx(4 * LENGTH, abs=0.1)
    overlaps = sum(OVERLAP_MM * math.dist(*mark) for part in parts for mark in part.marks)
    assert 0.9 * overlaps < sum(part.area_mm2 for part in parts) - flat.area_mm2 <= overlaps
    assert sum(math.dist(*mark) for part in parts for mark in part.marks) > LENGTH


def test_parts_that_turn_stay_whole() -> None:
    car = folded_box(60.0)
    car = replace(car, placed=(PlacedPiece("disc", 0, "wheel0", IDENTITY),))

    with pytest.raises(NestingError, match=r"disc is 120\.0 x 120\.0 mm.*cannot be parted; --sheet 12in would do"):
        pattern(car, options("silhouette", sheet="110x115"), "box")


def test_the_sheet_that_would_do_does() -> None:
    car, small = folded_box(90.0), options("scissors", sheet="100x150")
    car = replace(car, placed=(PlacedPiece("disc", 0, "wheel0", IDENTITY),))

    with pytest.raises(NestingError) as refused:
        pattern(car, small, "box")

    advised = re.search(r"--sheet (\S+) would do", str(refused.value))
    assert advised
    assert pattern(car, options("scissors", sheet=advised[1]), "box").sheets
    assert sheet_size_mm("12x24in") == pytest.approx((304.8, 609.6))


def cuts_of(flat: FlatPiece, chosen: Options) -> list[tuple[int, LineString]]:
    """Every line that is cut, with the number of the fold whose dash it is, or -1."""
    folds = [LineString([fold.a, fold.b]).buffer(1e-6) for fold in flat.folds]
    found = []
    for shape in piece_shapes(flat, chosen, [])[0]:
        if isinstance(shape, Circle):
            line = shapely.Point(shape.center_mm).buffer(shape.radius_mm, quad_segs=64).exterior
        else:
            line = LineString([*shape.points_mm, *([shape.points_mm[0]] if shape.closed else [])])
        if shape.layer not in ("LABEL", "SCORE"):
            fold = next((i for i, along in enumerate(folds) if along.contains(line)), -1)
            found.append((fold, line))
    return found


@pytest.mark.parametrize("machine", ["silhouette", "laser"])
def test_film_between_cuts_is_wide_enough_to_hold(machine: str) -> None:
    chosen = options(machine)
    # Screw holes as near to folds and to an edge as they come.
    holes = (circle("near a fold", 30.0, 2.5, 2.0), circle("near the edge", 117.4, 15.0, 2.0))
    piece = beam()
    faces = tuple(replace(face, holes=holes) if face.name == "right" else face for face in piece.faces)
    for one in (replace(piece, faces=faces), cap()):
        flat = flat_piece(one, chosen)
        cuts = cuts_of(flat, chosen)
        least = min(
            a.distance(b) - (0.0 if machine == "silhouette" else chosen.kerf_mm)
            for (i, a), (k, b) in itertools.combinations(cuts, 2)
            if i != k or i == -1
        )

        film = narrowest_film(flat, chosen)

        assert film is not None
        assert film.width_mm == pytest.approx(least, abs=0.02)
        assert least >= 1.48
        for number, fold in enumerate(flat.folds):
            length = sum(line.length for i, line in cuts if i == number)
            assert 0.45 * math.dist(fold.a, fold.b) < length < 0.7 * math.dist(fold.a, fold.b)


def test_narrow_film_of_a_part_is_measured_and_named() -> None:
    opening = Hole("servo.opening", "opening", ((10.0, 10.0), (33.4, 10.0), (33.4, 22.7), (10.0, 22.7)))
    face = Face("wall", ((0.0, 0.0), (50.0, 0.0), (50.0, 40.0), (0.0, 40.0)), (opening, circle("screw", 35.45, 16, 2.2)))
    chosen = options("silhouette")

    film = narrowest_film(flat_piece(Piece("wall", "wall", (face,), (), THICKNESS), chosen), chosen)

    assert film is not None and film.narrow
    assert film.width_mm == pytest.approx(35.45 - 1.1 - 33.4, abs=1e-3)
    assert set(film.between) == {"opening", "screw"}


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

    for sheet in range(len(nested.titles)):
        placed = [
            shapely.transform(outline, lambda xy, m=copy.motion: [m.apply(tuple(p)) for p in xy])
            for (_, outline, _), copies in zip(pieces, nested.placements, strict=True)
            for copy in copies
            if copy.sheet == sheet
        ]
        title = nested.titles[sheet]
        assert title is not None
        placed.append(box(*title.apply((0.0, 0.0)), *title.apply((102.0, 9.0))))
        # Arcs of the grown outlines are polygons, up to 3 µm inside them.
        assert all(a.distance(b) >= 2.0 - 0.003 for a, b in itertools.combinations(placed, 2))
        assert all(box(4, 4, 196, 176).buffer(1e-6).contains(piece) for piece in placed)
    assert [len(copies) for copies in nested.placements] == [3, 9, 4]
    assert nest(pieces, (200.0, 180.0), 4.0, 2.0, (102.0, 9.0)) == nested


@pytest.mark.parametrize(
    ("size", "title_mm", "titles"),
    # Beside a slab that fills the height, a title as wide as the rest has room at any height, above it none.
    [((90, 172), (98.0, 9.0), 1), ((191.9, 171.9), (102.0, 9.0), 0)],
    ids=["a title in what pieces have left", "a piece that just fits"],
)
def test_pieces_and_titles_take_all_the_room(size: tuple[float, float], title_mm: Point, titles: int) -> None:
    nested = nest([("slab", box(0, 0, *size), 1)], (200.0, 180.0), 4.0, 2.0, title_mm)

    assert [title is not None for title in nested.titles] == [bool(titles)]


def test_a_piece_that_fits_no_sheet_is_named_with_both_sizes() -> None:
    with pytest.raises(NestingError, match=r"slab is 300\.0 x 40\.0 mm, but of a sheet of 200 x 180 mm"):
        nest([("slab", box(0, 0, 300, 40), 1)], (200.0, 180.0), 4.0, 2.0, (102.0, 9.0))


@pytest.mark.parametrize("turn", [0, 1, 2, 3])
def test_labels_stay_clear_of_cuts_and_folds_and_are_upright(turn: int) -> None:
    car = folded_box()
    for piece in car.pieces:
        flat = flat_piece(piece, plain())
        marks = list(join_marks(flat, car, car))
        paths, missing = label_paths(flat, flat.label, marks, turn)
        lines = [LineString([fold.a, fold.b]) for fold in flat.folds] + [flat.outline.boundary]
        lines += [shapely.Point(middle).buffer(diameter / 2) for middle, diameter in flat.circles]
        strokes = shapely.union_all([LineString(path.points_mm) for path in paths])
        assert missing == []
        assert strokes.distance(shapely.union_all(lines)) > 0.5


def test_every_join_is_numbered_on_both_of_its_pieces() -> None:
    car = folded_box()

    marked = {
        piece.name: [mark.text for mark in join_marks(flat_piece(piece, plain()), car, car)] for piece in car.pieces
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
