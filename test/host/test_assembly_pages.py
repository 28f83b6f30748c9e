"""Parts list, wiring, guide and view of folded cars: their content follows the design; pages open in a browser."""

import csv
import io
import re
import subprocess
import xml.etree.ElementTree as ET
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import shapely

from browser import browse
from foldcar.car.body import body_json
from foldcar.car.design import Design, compose
from foldcar.car.folded.model import FoldedCar
from foldcar.car.folded_car import folded_car
from foldcar.fabrication.assembly.facets import mount_shape, together
from foldcar.fabrication.assembly.guide import guide_page
from foldcar.fabrication.assembly.guide_shapes import Body, whole_car
from foldcar.fabrication.assembly.guide_steps import steps
from foldcar.fabrication.assembly.hidden_surfaces import Facet, camera, seen_facets
from foldcar.fabrication.assembly.parts_list import parts_list, parts_list_csv, total_mass_kg
from foldcar.fabrication.assembly.poses import face_poses, glued_offset_mm, moved
from foldcar.fabrication.assembly.view_page import Drawing, view_page
from foldcar.fabrication.assembly.wiring import wiring_text
from foldcar.fabrication.assembly.wiring_drawing import wiring_drawing
from foldcar.fabrication.patterns.options import options
from foldcar.fabrication.patterns.sheets import cut_car, pattern
from foldcar.fabrication.patterns.svg import svg
from folded_box import folded_box
from page_check import page_findings

Command = Callable[..., "subprocess.CompletedProcess[str]"]
HINGED = {"width": 95.0, "height": 50.0, "radius": 40.0, "W.length": 90.0, "B.length": 80.0}


def designs() -> list[Design]:
    return [compose("W_B_W", {}), compose("W_B_H_W_H_W", HINGED)]


@pytest.mark.parametrize("design", designs(), ids=lambda design: design.type)
def test_parts_weigh_what_the_simulated_car_weighs(design: Design) -> None:
    body = body_json(design)

    rows = parts_list(folded_car(design))

    simulated = sum(part["mass_kg"] for part in (*body["segments"], *body["wheels"]))
    assert total_mass_kg(rows) == pytest.approx(simulated, rel=1e-6)


def test_parts_as_csv_count_servos_screws_and_horns() -> None:
    rows = {row["part"]: row for row in csv.DictReader(io.StringIO(parts_list_csv(folded_car(designs()[0]))))}

    assert float(rows["FS90R servo"]["quantity"]) == 4
    assert float(rows["FS90R servo"]["mass_g"]) == pytest.approx(36)
    assert float(rows["M2x8 screw with nut"]["quantity"]) == 8
    assert float(rows["servo horn"]["quantity"]) == 4


def test_wiring_names_every_servo_with_its_output_and_direction() -> None:
    folded = folded_car(designs()[0])

    text = wiring_text(folded, "a car")
    drawn = "".join(ET.fromstring(wiring_drawing(folded, "a car")).itertext())

    for axle in folded.axles:
        (line,) = (line for line in text.splitlines() if line.startswith(f"| {axle.channel} |"))
        assert f"CH{axle.channel + 1}_DIRECTION {axle.direction:+d}" in line and axle.servo in line
        assert axle.servo in drawn and f"{axle.channel} · CH{axle.channel + 1}" in drawn
    assert "Outputs 4, 5, 6, 7 stay empty" in text


def test_hidden_surfaces_agree_with_rays() -> None:
    body = Body(folded_car(designs()[0]), "segment0")
    film = [body.base_shape(0.6), *(body.piece_shape(placed, 0.6) for placed in body.others)]
    facets = list(together([*film, *body.mount_shapes(0.6)]).facets)
    view = camera(-55, 32)
    seen = {one.facet.key: one for one in seen_facets(facets, view)}
    low_u, low_v, high_u, high_v = shapely.total_bounds([one.region for one in seen.values()])
    points = np.random.default_rng(1).uniform((low_u, low_v), (high_u, high_v), (1500, 2))

    edges = shapely.union_all([one.region.boundary for one in seen.values()])
    planes = [plane for facet in facets if (plane := crossed_plane(facet, view.toward)) is not None]

    disagreeing = compared = 0
    for u, v in points[shapely.distance(shapely.points(points), edges) >= 0.5]:
        nearest = hit_by_ray(planes, view.right * u + view.up * v, view.toward)
        if nearest is None:
            continue
        compared += 1
        disagreeing += not seen[nearest].region.covers(shapely.Point(u, v))

    assert compared > 300
    assert disagreeing == 0


class Plane(NamedTuple):
    """A facet and its outline in two axes of its own plane, mm; ``slope`` is its normal's part along the line."""

    facet: Facet
    slope: float
    x: np.ndarray
    y: np.ndarray
    outline: shapely.Polygon


def crossed_plane(facet: Facet, toward: np.ndarray) -> Plane | None:
    """The facet's plane, unless lines along ``toward`` run in it or meet the inner side of a closed body."""
    slope = float(facet.normal @ toward)
    if abs(slope) < 1e-9 or (facet.closed and slope < 0):
        return None
    x = facet.rings_mm[0][1] - facet.rings_mm[0][0]
    x = x / np.linalg.norm(x)
    y = np.cross(facet.normal, x)
    rings = [np.column_stack([ring @ x, ring @ y]) for ring in facet.rings_mm]
    outline = shapely.Polygon(rings[0], rings[1:])
    shapely.prepare(outline)
    return Plane(facet, slope, x, y, outline)


def hit_by_ray(planes: list[Plane], origin: np.ndarray, toward: np.ndarray) -> str | None:
    """The facet nearest to the camera on the line through ``origin``, by intersecting the line with each plane."""
    best: tuple[float, str] | None = None
    for facet, slope, x, y, outline in planes:
        depth = facet.normal @ (facet.rings_mm[0][0] - origin) / slope
        at = origin + depth * toward
        if (best is None or depth > best[0]) and outline.covers(shapely.Point(at @ x, at @ y)):
            best = (depth, facet.key)
    return best[1] if best else None


# On 12 inch sheets the wide car's beam is cut in two.
@pytest.mark.parametrize(
    ("design", "parted"), [*((design, 0) for design in designs()), (compose("W_B_W", {"width": 180.0}), 1)]
)
def test_guide_shows_every_piece_and_tells_every_join(design: Design, parted: int) -> None:
    folded = folded_car(design)
    pieces = cut_car(folded, options("silhouette"))
    cut = pieces.car

    found = steps(folded, cut, pieces.strips)

    text = " ".join(line for step in found for line in step.lines)
    told: set[int] = set()
    for first, last in re.findall(r"(\d+)(?: to (\d+))?", " ".join(re.findall(r"[Jj]oins? ([\d, to]+)", text))):
        told |= set(range(int(first), int(last or first) + 1))
    assert told == {join.number for join in cut.joins}
    assert sum(step.title.startswith("Glue the parts of") for step in found) == parted
    captions = [picture.caption for picture in found[0].pictures]
    assert len(captions) == len(folded.pieces) + parted
    assert all(step.pictures for step in found)
    for picture in (picture for step in found for picture in step.pictures):
        assert list(ET.fromstring(picture.svg).iter("{http://www.w3.org/2000/svg}path"))


# A rim of the 60 mm wheel is longer than a 12 inch sheet, and shorter than one of half a metre.
@pytest.mark.parametrize(("sheet", "glued"), [("12in", ["Glue the 2 parts of the strip"]), ("500x500", [])])
def test_guide_glues_a_rim_together_if_the_sheets_have_it_in_parts(sheet: str, glued: list[str]) -> None:
    folded = folded_car(designs()[0])
    pieces = cut_car(folded, options("silhouette", sheet=sheet))

    found = steps(folded, pieces.car, pieces.strips)

    text = " ".join(line for step in found for line in step.lines)
    assert re.findall(r"Glue the \d+ parts of the strip", text) == glued
    rims = [flat for flat in pieces.pieces if "rim" in flat.origin]
    assert len(rims) == (2 if glued else 1)


def test_guide_is_one_page_that_needs_no_other_file() -> None:
    folded = folded_car(designs()[0])

    guide = guide_page(folded, folded, {}, "a <car>")

    HTMLParser().feed(guide)
    assert "a &lt;car&gt;" in guide and "<car>" not in guide
    assert not re.search(r'(src|href)="', guide)


def test_whole_car_is_drawn_without_what_is_inside() -> None:
    folded = folded_car(designs()[0])
    view = camera(38, 30)

    keys = {one.facet.key for one in seen_facets(whole_car(folded, view).facets, view)}

    assert any(key.startswith("beam") for key in keys) and any(key.startswith("wheel rim") for key in keys)
    assert not any("deck" in key or "LiPo" in key for key in keys)


def test_box_of_a_mount_has_three_visible_sides() -> None:
    (servo,) = folded_box().mounts

    seen = seen_facets(mount_shape(servo).facets, camera(30, 30))

    assert len(seen) == 3
    width, depth, height = servo.size_mm
    assert sum(one.region.area for one in seen) == pytest.approx(
        depth * height * np.cos(np.pi / 6) ** 2
        + width * height * np.sin(np.pi / 6) * np.cos(np.pi / 6)
        + width * depth * np.sin(np.pi / 6),
        rel=1e-3,
    )


def test_view_page_is_one_file() -> None:
    page = view_page(folded_box(), "a box", [Drawing("<?xml?><svg></svg>", "sheet")])

    assert "</script><" not in page.replace("</script>\n", "")
    assert not re.search(r'<(script|link|img)[^>]*(src|href)=', page)
    assert "<?xml" not in page and '<svg role="img" aria-label="sheet"></svg>' in page


def test_pages_are_valid_html() -> None:
    folded = folded_car(designs()[0])
    cut = pattern(folded, options("silhouette", sheet="a4"), "a car")
    sheets = [Drawing(svg(sheet), sheet.name) for sheet in cut.sheets]

    assert len(sheets) > 1
    assert page_findings(view_page(folded, "a car", sheets)) == []
    assert page_findings(guide_page(folded, folded, {}, "a car")) == []


@pytest.mark.parametrize("fold", [0, 1])
def test_view_folds_to_the_place_that_the_design_says(tmp_path: Path, fold: int) -> None:
    folded = folded_car(designs()[0])

    shown = shown_by_browser(folded, tmp_path, fold)

    box = np.array([float(value) for value in shown["box"].split()])
    if fold == 1:
        assert box == pytest.approx(film_box(folded), abs=2e-3)
    else:
        assert box[5] - box[2] == pytest.approx(0, abs=1e-3)


def test_view_command_writes_a_page_that_draws(tmp_path: Path, foldcar: Command) -> None:
    from PIL import Image

    design = Path(__file__).resolve().parents[2] / "patterns" / "hinged.json"
    done = foldcar("view", design, "-o", tmp_path / "car.html")
    assert done.returncode == 0, done.stderr

    browse(tmp_path / "car.html", "fold=0.5", f"--screenshot={tmp_path / 'car.png'}")

    stage = np.asarray(Image.open(tmp_path / "car.png").convert("RGB"))[120:640, 40:1000]
    assert 0.03 < (stage != stage[0, 0]).any(axis=2).mean() < 0.9


def test_view_command_refuses_what_it_cannot_show(tmp_path: Path, foldcar: Command) -> None:
    design = Path(__file__).resolve().parents[2] / "patterns" / "published_cars.json"

    several = foldcar("view", design, "-o", tmp_path / "x.html")
    unknown = foldcar("view", design, "--vehicle", "w66", "-o", tmp_path / "x.html")
    narrow = foldcar("view", design, "--vehicle", "w65", "--set", "width=30", "-o", tmp_path / "x.html")

    for done, word in ((several, "--vehicle"), (unknown, "w66"), (narrow, "width")):
        assert done.returncode == 2 and word in done.stderr and len(done.stderr.splitlines()) == 1
    assert not (tmp_path / "x.html").exists()


def shown_by_browser(folded: FoldedCar, folder: Path, fold: float) -> dict[str, str]:
    """The values that the page reports of its state."""
    page = folder / "car.html"
    page.write_text(view_page(folded, "a car", []), encoding="utf-8")
    shown = dict(re.findall(r'data-(\w+)="([^"]*)"', browse(page, f"fold={fold}", "--dump-dom")))
    assert shown.get("state") == "ready"
    return shown


def film_box(folded: FoldedCar) -> np.ndarray:
    """Minimum and maximum coordinates of the assembled film's faces, with glued tabs offset by their thickness."""
    pieces = {piece.name: piece for piece in folded.pieces}
    points = []
    for placed in folded.placed:
        piece = pieces[placed.piece]
        offsets = glued_offset_mm(piece)
        for face in piece.faces:
            outline = np.array([(x, y, offsets.get(face.name, 0.0)) for x, y in face.outline_mm])
            points.append(moved(np.array(placed.pose) @ face_poses(piece)[face.name], outline))
    together_mm = np.concatenate(points)
    return np.concatenate([together_mm.min(axis=0), together_mm.max(axis=0)])
