"""Flat pieces, folds, splits and nesting against closed forms and independent geometry."""

import itertools
import math
import re
from dataclasses import replace

import pytest
import shapely
from shapely.geometry import LineString, Polygon, box

from cut_samples import FLAP, HEIGHT, LENGTH, RIGHT_ANGLE, THICKNESS, WIDTH, beam, cap, circle, disc, folded_box, rim
from foldcar.car.components.shape import on_circle
from foldcar.car.design import compose
from foldcar.car.folded.model import Crease, EdgeRef, Face, Hole, Piece
from foldcar.car.folded_car import folded_car
from foldcar.fabrication.patterns import nesting
from foldcar.fabrication.patterns.drawing import Circle, Path
from foldcar.fabrication.patterns.flat_piece import FlatPiece, bend_deduction_mm, flat_piece
from foldcar.fabrication.patterns.join_marks import join_marks
from foldcar.fabrication.patterns.labels import label_paths
from foldcar.fabrication.patterns.nesting import NestingError, nest
from foldcar.fabrication.patterns.options import Options, options, sheet_size_mm
from foldcar.fabrication.patterns.piece_shapes import cut_shapes, dashes, narrowest_film, piece_shapes
from foldcar.fabrication.patterns.sheets import pattern
from foldcar.fabrication.patterns.splitting import split_to_fit


@pytest.fixture(autouse=True)
def few_layouts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(nesting, "MAX_TRIES", 10)


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
    # A rim has folds at its teeth only, and is as long as its facets.
    bent = flat_piece(rim(40.0), options("silhouette"))
    assert len(bent.folds) == 80 and all(abs(fold.a[1] - fold.b[1]) < 1e-6 for fold in bent.folds)
    x0, _, x1, _ = bent.outline.bounds
    assert x1 - x0 == pytest.approx(40 * 2 * 40.0 * math.sin(math.pi / 40))


def test_tabs_lose_their_clearance_and_keep_their_fold() -> None:
    wide, narrow = flat_piece(cap(), plain()), flat_piece(cap(), plain(tab_clearance_mm=0.5))

    x0, _, x1, _ = wide.outline.bounds
    u0, _, u1, _ = narrow.outline.bounds
    assert (x1 - x0) - (u1 - u0) == pytest.approx(2 * 0.5, abs=1e-3)
    # Mitred sides stand at 45 degrees: their ends move by the clearance times the root of two.
    lengths = sorted(math.dist(fold.a, fold.b) for fold in narrow.folds)
    assert lengths[0] == pytest.approx(HEIGHT - 2 * 0.5 * math.sqrt(2), abs=1e-3)


@pytest.mark.parametrize("length", [2.0, 7.3, 60.0])
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


def test_the_sheet_that_would_do_does() -> None:
    car, small = folded_box(60.0), options("scissors", sheet="100x150")

    with pytest.raises(NestingError, match=r"disc is 120\.0 x 120\.0 mm.*cannot be split") as refused:
        pattern(car, small, "box")

    advised = re.search(r"--sheet (\S+) would do", str(refused.value))
    assert advised
    assert pattern(car, options("scissors", sheet=advised[1]), "box").sheets
    assert sheet_size_mm("12x24in") == pytest.approx((304.8, 609.6))


def cuts_of(flat: FlatPiece, chosen: Options) -> list[tuple[int, LineString]]:
    """Every line that is cut, with the number of the fold whose dash it is, or -1."""
    folds = [LineString([fold.a, fold.b]).buffer(1e-6) for fold in flat.folds]
    result = []
    for shape in piece_shapes(flat, chosen, [])[0]:
        if isinstance(shape, Circle):
            line = shapely.Point(shape.center_mm).buffer(shape.radius_mm, quad_segs=64).exterior
        else:
            line = LineString([*shape.points_mm, *([shape.points_mm[0]] if shape.closed else [])])
        if shape.layer not in ("LABEL", "SCORE"):
            fold = next((i for i, along in enumerate(folds) if along.contains(line)), -1)
            result.append((fold, line))
    return result


@pytest.mark.parametrize("machine", ["silhouette", "laser"])
def test_film_between_cuts_is_wide_enough_to_hold(machine: str) -> None:
    chosen = options(machine)
    # Screw holes as near to folds and to an edge as they come.
    holes = (circle("near a fold", 30.0, 2.5, 2.0), circle("near the edge", 117.4, 15.0, 2.0))
    piece = beam()
    faces = tuple(replace(face, holes=holes) if face.name == "right" else face for face in piece.faces)
    for shape in (replace(piece, faces=faces), cap()):
        flat = flat_piece(shape, chosen)
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

    cut = split_to_fit(car, chosen)
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
    # A fold that does not help is left alone.
    small = split_to_fit(car, options("silhouette", sheet="110x110", margin_mm=5))
    assert "beam" in [piece.name for piece in small.pieces]


def test_the_tab_of_a_split_piece_leaves_the_holes_of_its_face_open() -> None:
    chosen = options("scissors")
    car = folded_car(compose("W_B_W", {"width": 95}))

    pieces = split_to_fit(car, chosen).pieces

    beam_parts = [piece for piece in pieces if piece.name.startswith("beam, part")]
    faces = {face.name: face for piece in beam_parts for face in piece.faces}
    creases = {crease.name: crease for piece in car.pieces for crease in piece.creases}
    tabs = [face for name, face in faces.items() if name.endswith(" splice")]
    covered = 0
    for tab in tabs:
        child = creases[tab.name.removesuffix(" splice")].child
        outline = faces[child.face].outline_mm
        (ax, ay), (bx, by) = outline[child.index], outline[(child.index + 1) % len(outline)]
        turn = complex(bx - ax, by - ay) / abs(complex(bx - ax, by - ay))
        on_face = Polygon([(ax + (complex(*p) * turn).real, ay + (complex(*p) * turn).imag) for p in tab.outline_mm])
        # The tab lies on the face that it is taped to.
        assert Polygon(outline).buffer(1e-6).covers(on_face)
        for hole in faces[child.face].holes:
            assert on_face.distance(Polygon(hole.outline_mm)) > 0.9, (tab.name, hole.name)
            covered += on_face.convex_hull.intersects(Polygon(hole.outline_mm))
    # USB's hole begins 8.4 mm above the floor, a tab is 10 mm deep.
    assert covered > 0


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


def test_every_join_is_numbered_on_both_of_its_pieces_clear_of_cuts_and_folds() -> None:
    car, marked = folded_box(), {}
    for piece in car.pieces:
        flat = flat_piece(piece, plain())
        marks = list(join_marks(flat, car, car))
        marked[piece.name] = [mark.text for mark in marks]
        paths, missing = label_paths(flat, flat.label, marks, 1)
        lines = [LineString([fold.a, fold.b]) for fold in flat.folds] + [flat.outline.boundary]
        lines += [shapely.Point(middle).buffer(diameter / 2) for middle, diameter in flat.circles]
        strokes = shapely.union_all([LineString(path.points_mm) for path in paths])
        assert missing == []
        assert strokes.distance(shapely.union_all(lines)) > 0.5
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
