"""Parts list, wiring, guide and view of folded cars: their content follows the design; pages open in a browser."""

import csv
import io
import re
import subprocess
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import shapely

from cut_samples import placed_box
from foldcar.car.body import body_json
from foldcar.car.design import Design, compose
from foldcar.car.folded.model import FoldedCar
from foldcar.car.folded_car import folded_car
from foldcar.car.proof.prove import assembly_steps
from foldcar.fabrication.assembly.facets import together
from foldcar.fabrication.assembly.guide import steps, whole_car
from foldcar.fabrication.assembly.guide_pictures import Step, service_picture, tiny
from foldcar.fabrication.assembly.guide_state import State
from foldcar.fabrication.assembly.hidden_surfaces import Facet, camera, seen_facets
from foldcar.fabrication.assembly.parts_list import parts_list, parts_list_csv, total_mass_kg
from foldcar.fabrication.assembly.view_page import view_page
from foldcar.fabrication.assembly.wiring import OE_GPIO, wiring_drawing, wiring_text
from foldcar.fabrication.patterns.drawing import Sheet
from foldcar.fabrication.patterns.options import options
from foldcar.fabrication.patterns.sheets import cut_car
from page_check import page_findings
from written_sheet import written_sample

Command = Callable[..., "subprocess.CompletedProcess[str]"]
HINGED = {"width": 95.0, "height": 50.0, "radius": 40.0, "W.length": 90.0, "B.length": 80.0}


def designs() -> list[Design]:
    return [compose("W_B_W", {}), compose("W_B_H_W_H_W", HINGED)]


@cache
def guide(number: int) -> tuple[FoldedCar, list[Step]]:
    """A design's car and the steps of its guide, whose pictures are drawn once."""
    folded = folded_car(designs()[number])
    return folded, steps(folded, cut_car(folded, options("laser")), "laser")


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
    assert float(rows["two-sided servo horn"]["quantity"]) == 4


def test_wiring_names_every_servo_with_its_output_and_direction() -> None:
    folded = folded_car(designs()[0])

    text = wiring_text(folded, "a car")
    drawn = "".join(ET.fromstring(wiring_drawing(folded, "a car")).itertext())

    for axle in folded.axles:
        (line,) = (line for line in text.splitlines() if line.startswith(f"| {axle.channel} |"))
        assert f"CH{axle.channel + 1}_DIRECTION {axle.direction:+d}" in line and axle.servo in line
        assert axle.servo in drawn and f"{axle.channel} · CH{axle.channel + 1}" in drawn
    assert "Outputs 4, 5, 6, 7 stay empty" in text


@pytest.mark.parametrize("design", designs(), ids=lambda design: design.type)
def test_texts_of_the_wiring_keep_off_each_other_and_off_lines(design: Design) -> None:
    drawn = ET.fromstring(wiring_drawing(folded_car(design), "a car"))

    boxes = {}
    for text in drawn.iterfind("{*}text"):
        x, y, size = (float(text.attrib[key]) for key in ("x", "y", "font-size"))
        length = size * sum(0.32 if c == " " else 0.95 if c in "mwMW" else 0.6 for c in text.text or "")
        start = x - length * {"start": 0, "middle": 0.5, "end": 1}[text.attrib["text-anchor"]]
        boxes[text.text, y] = shapely.box(start, y - 0.7 * size, start + length, y)
    lines = {}
    for path in drawn.iterfind("{*}path"):
        at = np.zeros(2)
        points: list[list[float]] = []
        for letter, numbers in re.findall(r"([MLHV])([-\d.,]+)", path.attrib["d"]):
            values = [float(number) for number in numbers.split(",")]
            at = np.array({"H": [values[0], at[1]], "V": [at[0], values[0]]}.get(letter, values))
            points = [*([] if letter == "M" else points), at.tolist()]
            if len(points) > 1:
                lines[str(points)] = shapely.LineString(points).buffer(float(path.attrib["stroke-width"]) / 2)
    # Symbols in a line, such as an extension with its length, cover it.
    rects = [[float(rect.attrib[key]) for key in ("x", "y", "width", "height")]
             for rect in list(drawn.iterfind("{*}rect"))[1:]]  # fmt: skip
    symbols = shapely.union_all([shapely.box(x, y, x + wide, y + high) for x, y, wide, high in rects if wide < 20])
    lines = {name: line.difference(symbols) for name, line in lines.items()}
    for dot in drawn.iterfind("{*}circle"):
        lines[str(dot.attrib)] = shapely.Point(float(dot.attrib["cx"]), float(dot.attrib["cy"])).buffer(1.1)
    assert {"terminal block", "150 mm", "75 mm more"} <= {text for text, _ in boxes} or design.composition != "W_B_W"
    for (text, box), (other, its) in combinations([*boxes.items(), *lines.items()], 2):
        assert isinstance(text, str) or not box.intersects(its), (text, other)


def test_wiring_offers_output_enable_with_a_pull_up_that_reaches_off() -> None:
    folded = folded_car(designs()[0])
    text, drawn = wiring_text(folded, "a car"), wiring_drawing(folded, "a car")

    # A divider of 2.2 kΩ to 3.3 V and the wing's 10 kΩ to ground; the PCA9685 takes 0.7 of its supply as high.
    off_v = 3.3 * 10 / (10 + 2.2)
    assert off_v > 1.15 * 0.7 * 3.3
    assert "2.2 kΩ" in text and f"at {off_v:.1f} V" in text and "above 2.3 V" in text and "2.2 kΩ" in drawn
    gate = (Path(__file__).parents[2] / "firmware/lib/feather_hal/output_gate.h").read_text(encoding="utf-8")
    assert f"kPin = {OE_GPIO};" in gate and f"from {OE_GPIO} of the" in text and f">{OE_GPIO}<" in drawn


def test_hidden_surfaces_agree_with_rays() -> None:
    car = folded_car(designs()[0])
    state = State(car)
    state.closed = {piece.name: {crease.name: 0.6 for crease in piece.creases} for piece in car.pieces}
    parts = [part for part in (*car.placed, *car.mounts) if part.body == "segment0" and not tiny(state, part)]
    facets = list(together(state.shape(part) for part in parts).facets)
    view = camera(-55, 32)
    seen = {one.facet.key: one for one in seen_facets(facets, view)}
    low_u, low_v, high_u, high_v = shapely.total_bounds([one.region for one in seen.values()])
    points = np.random.default_rng(1).uniform((low_u, low_v), (high_u, high_v), (500, 2))

    edges = shapely.union_all([one.region.boundary for one in seen.values()])
    planes = [plane for facet in facets if (plane := crossed_plane(facet, view.toward)) is not None]

    disagreeing = compared = 0
    for u, v in points[shapely.distance(shapely.points(points), edges) >= 0.5]:
        nearest = hit_by_ray(planes, view.right * u + view.up * v, view.toward)
        if nearest is None:
            continue
        compared += 1
        disagreeing += not seen[nearest].region.covers(shapely.Point(u, v))

    assert compared > 120
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


WIDE = compose("W_B_W", {"width": 180.0})


@pytest.mark.parametrize(
    ("design", "machine", "sheet"),
    [(designs()[0], "silhouette", "12in"), (designs()[1], "scissors", "a4"), (WIDE, "laser", "1000x1000")],
)
def test_guide_shows_every_piece_and_tells_every_join(design: Design, machine: str, sheet: str) -> None:
    folded = folded_car(design)
    cut = cut_car(folded, options(machine, sheet=sheet))

    found = steps(folded, cut, machine)

    text = " ".join(line for step in found for line in step.lines)
    told: set[int] = set()
    for first, last in re.findall(r"(\d+)(?: to (\d+))?", " ".join(re.findall(r"[Jj]oins? ([\d, to]+)", text))):
        told |= set(range(int(first), int(last or first) + 1))
    seams = {number for flat in cut.pieces for number, _ in flat.seams}
    assert told == {join.number for join in cut.car.joins} | seams
    whole = {piece.name for piece in folded.pieces} & {piece.name for piece in cut.car.pieces}
    assert len(re.findall(" is cut as ", text)) == len(folded.pieces) - len(whole)
    in_parts = re.findall(r"The ([\w ]+) is cut across, in (\d+) parts", text)
    assert {name: int(count) for name, count in in_parts} == cut.strips
    assert bool(cut.strips or len(whole) < len(folded.pieces)) == (sheet == "a4")
    assert len(found[0].pictures) == len(cut.car.pieces)
    assert all(step.pictures for step in found if step.title != "Join the parts of pieces")


@pytest.mark.parametrize("number", [0, 1])
def test_pieces_in_the_guide_have_the_numbers_of_their_joins_none_on_another(number: int) -> None:
    folded, found = guide(number)

    slots = 0
    for piece, picture in zip(folded.pieces, found[0].pictures, strict=True):
        # A layer lies on its number.
        sides = [(join, join.piece_a) for join in folded.joins]
        sides += [(join, join.piece_b) for join in folded.joins if join.kind not in ("laminate", "tuck")]
        drawn = [text.text for text in ET.fromstring(picture.svg).iterfind("{*}text")]
        assert set(drawn) >= {str(join.number) for join, name in sides if name == piece.name}, piece.name
        # A number at the slot that a tongue goes through, beside the one on the tongue.
        slotted = [join for join in folded.joins if join.slot and join.piece_b == piece.name == join.piece_a]
        assert all(drawn.count(str(join.number)) == 2 for join in slotted)
        slots += len(slotted)
    assert slots
    for step in found:
        for picture in step.pictures:
            circles = list(ET.fromstring(picture.svg).iterfind("{*}circle"))
            shapes = [(float(c.attrib["cx"]), float(c.attrib["cy"]), float(c.attrib["r"])) for c in circles]
            for a, b in combinations(shapes, 2):
                assert np.hypot(a[0] - b[0], a[1] - b[1]) > a[2] + b[2], step.title


def test_guide_tells_the_steps_that_are_proved_and_shows_what_goes_in() -> None:
    folded, told = guide(1)

    proved = assembly_steps(folded)
    parts = {mount.name: mount.part for mount in folded.mounts}

    assert [step.title for step in told[-len(proved) :]] == [
        step.title if step.unit != "wheel" else f"{step.title} ({len(folded.axles)} times)" for step in proved
    ]
    for step, shown in zip(proved, told[-len(proved) :], strict=True):
        first = step.adds[0].body if step.adds else ""
        seen = {one.facet.key for picture in shown.pictures for one in picture.seen}
        for added in step.adds:
            hidden_in_others = step.unit and added.body != first
            if added.kind == "unit" or hidden_in_others or added.name == folded.parts.wiring.name:
                continue
            # Of several screws of a kind, one may stand behind the film.
            names = [name for name, part in parts.items() if part == parts.get(added.name)]
            starts = [f"{added.name} {added.copy} "] if added.kind == "piece" else [f"{name} " for name in names]
            assert any(key.startswith(start) for key in seen for start in starts), (step.title, added.name)


@pytest.mark.parametrize("design", designs(), ids=lambda design: design.type)
def test_what_is_reached_in_service_is_named_inside_the_picture_and_readable(design: Design) -> None:
    drawn = ET.fromstring(service_picture(folded_car(design))[-1].svg)

    left, top, wide, high = map(float, drawn.attrib["viewBox"].split())
    boxes = {}
    for text in drawn.iterfind("{*}text"):
        x, y, size = float(text.attrib["x"]), float(text.attrib["y"]), float(text.attrib["font-size"])
        base, length = y + float(text.attrib["dy"].removesuffix("em")) * size, 0.55 * size * len(text.text or "")
        start = x - length * {"start": 0, "middle": 0.5, "end": 1}[text.attrib["text-anchor"]]
        boxes[text.text] = shapely.box(start, base - 0.7 * size, start + length, base)
    assert set(boxes) == {"USB", "switch", "LiPo's plug", "servos' plugs", "reset button"}
    assert all(shapely.box(left, top, left + wide, top + high).covers(box) for box in boxes.values())
    assert not any(a.intersects(b) for a, b in combinations(boxes.values(), 2))


def test_whole_car_is_drawn_without_what_is_inside() -> None:
    folded = folded_car(designs()[0])
    view = camera(38, 30)

    keys = {one.facet.key for one in seen_facets(whole_car(folded, view).facets, view)}

    assert any(key.startswith("beam") for key in keys) and any(key.startswith("wheel rim") for key in keys)
    assert not any("deck" in key or "LiPo" in key for key in keys)


def test_view_page_is_one_file() -> None:
    box = placed_box()

    page = view_page(box, "a box", [Sheet("sheet", 10, 10, (), film=box.parts.film.title)])

    assert "</script><" not in page.replace("</script>\n", "")
    assert not re.search(r"<(script|link|img)[^>]*(src|href)=", page)
    assert "<?xml" not in page and '<svg role="img" aria-label="sheet" ' in page


def test_pages_are_valid_html() -> None:
    sheet = written_sample().sheet
    folded = folded_car(designs()[0])
    sheets = [replace(sheet, name=f"sheet_{i}", film=folded.parts.film.title) for i in (1, 2)]

    assert page_findings(view_page(folded, "a car", sheets)) == []


def test_view_command_refuses_what_it_cannot_show(tmp_path: Path, foldcar: Command) -> None:
    design = Path(__file__).resolve().parents[2] / "patterns" / "published_cars.json"

    several = foldcar("view", design, "-o", tmp_path / "x.html")
    unknown = foldcar("view", design, "--vehicle", "w66", "-o", tmp_path / "x.html")
    narrow = foldcar("view", design, "--vehicle", "w65", "--set", "width=30", "-o", tmp_path / "x.html")

    for done, word in ((several, "--vehicle"), (unknown, "w66"), (narrow, "width")):
        assert done.returncode == 2 and word in done.stderr and len(done.stderr.splitlines()) == 1
    assert not (tmp_path / "x.html").exists()
