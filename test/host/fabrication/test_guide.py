"""The guide: its page and pictures follow the steps that are proved, nothing is hidden, numbers can be read."""

import html
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from functools import cache
from itertools import combinations

import numpy as np
import pytest
import shapely

from browser import page_findings
from foldcar.car.folded.model import FoldedCar
from foldcar.car.folded.pose import compose
from foldcar.car.proof.prove import assembly_steps
from foldcar.car.proof.step import AddedPart
from foldcar.fabrication.assembly.facets import merge_shapes
from foldcar.fabrication.assembly.guide import build_steps, guide_page
from foldcar.fabrication.assembly.guide_pictures import Step, StepPicture, is_hidden, service_picture
from foldcar.fabrication.assembly.guide_state import AssemblyState
from foldcar.fabrication.assembly.hidden_surfaces import camera, visible_facets
from foldcar.fabrication.patterns.options import options
from foldcar.fabrication.patterns.sheets import CutCar, cut_car
from published_cars import car

CARS = ("w65", "hinged")


@cache
def cut(name: str) -> CutCar:
    return cut_car(car(name), options("laser", sheet="1000x1000"))


@cache
def guide(name: str) -> list[Step]:
    """The steps of a car's guide; their pictures are drawn once."""
    return build_steps(car(name), cut(name), "laser")


DRIVING = ["Load the firmware", "Find the neutrals", "Drive a metre"]


def assembly(name: str) -> list[Step]:
    """The steps of a car's guide that are proved."""
    count = len(assembly_steps(car(name)))
    proved = [step for step in guide(name) if step.title != "Solder the boards"]
    return proved[-len(DRIVING) - count : -len(DRIVING)]


@cache
def page() -> str:
    """That of the hinged car."""
    return guide_page(car("hinged"), cut("hinged"), "laser", "a <hinged>")


def label(folded: FoldedCar, added: AddedPart) -> str:
    labels = {("piece", piece.name): piece.label for piece in folded.pieces}
    labels |= {("mount", mount.name): mount.part for mount in folded.mounts}
    return labels.get((added.kind, added.name), added.name)


def named_parts(lines: tuple[str, ...], labels: set[str]) -> Iterator[str]:
    """The labels of what goes in, in the order of a step's lines; "4 times: …" repeats."""
    for line in lines:
        times, text = re.fullmatch(r"(?:(\d+) times: )?(.*)", line).groups()
        for _ in range(int(times or 1)):
            for part in text.split("; then "):
                match = re.match(r"(?:(\d+) × )?(.+?): (?:put|push|move|lay|wind|stretch|stick) it ", part)
                name = next((candidate for candidate in labels if match and candidate.lower() == match[2].lower()), None)
                if match and name:
                    yield from [name] * int(match[1] or 1)


@pytest.mark.parametrize("name", CARS)
def test_the_guide_puts_things_in_in_the_order_that_is_proved(name: str) -> None:
    folded, proved = car(name), assembly_steps(car(name))

    for step, shown in zip(proved, assembly(name), strict=True):
        first = [add for add in step.adds if not step.unit or add.body == step.adds[0].body]
        labels = [label(folded, part) for part in first if part.name != folded.parts.wiring.name]
        repeated = f" ({len(folded.axles)} times)" if step.unit == "wheel" else ""
        assert shown.title == step.title + repeated
        assert list(named_parts(shown.lines, set(labels))) == labels, (shown.title, shown.lines)


def test_the_guide_is_one_page_that_tells_all_steps_and_needs_no_other_file() -> None:
    text = page()

    assert page_findings(text) == []
    assert "a &lt;hinged&gt;" in text and "<hinged>" not in text
    assert not re.search(r'(src|href)="', text)
    assert "default-src &#39;none&#39;; script-src &#39;none&#39;" in text
    sections = re.findall(r"<h2><b>\d+</b>(.*?)<small>.*?</h2>(.*?)</section>", text, re.DOTALL)
    for step, (title, section) in zip(guide("hinged"), sections, strict=True):
        section = re.sub("</?code>", "`", section)
        lines = [html.unescape(line) for line in re.findall(r"<li>(.*?)</li>", section, re.DOTALL)]
        assert (html.unescape(title), tuple(lines)) == (step.title, step.lines)
        assert section.count("<svg") == len(step.pictures)


def test_the_guide_says_from_where_screws_come_what_they_pass_and_where_nuts_go() -> None:
    text = "\n".join(line for step in guide("w65") for line in step.lines)

    screws = "2 × M2x8 screw with nut: push it in from outside through the FS90R servo, the beam and the servo doubler"
    assert f"4 times: FS90R servo: push it in from outside; then {screws}, and put its nut on from inside." in text
    assert "Turn the screws with the PH0 screwdriver, and hold their nuts with pliers." in text
    # The wing hides these nuts: it comes after them, and after they are tight.
    boards = "\n".join(next(step.lines for step in guide("w65") if step.title.startswith("Screw the boards")))
    order = [
        "HUZZAH32 Feather: put it on from above",
        "M2x12 screw with nut: push it in from below",
        "Turn the screws",
        "FeatherWing: put it on from above",
    ]
    assert sorted(order, key=boards.index) == order


@pytest.mark.parametrize("name", CARS)
def test_everything_is_soldered_once_before_the_lipo_is_in_and_the_guide_ends_with_a_metre(name: str) -> None:
    texts = [" ".join((step.title, *step.lines)) for step in guide(name)]
    (soldering,) = [n for n, text in enumerate(texts) if "Solder now" in text]
    lipo = next(n for n, text in enumerate(texts) if text.startswith("Put the 500 mAh LiPo in"))

    assert soldering < lipo and not any("solder" in text.lower() for text in texts[lipo:])
    assert "cut the + lead of the square 4xAA holder (red) 30 mm from the holder" in texts[soldering]
    assert "Then solder the fuse" in texts[soldering]
    boards = next(n for n, text in enumerate(texts) if text.startswith("Solder the boards"))
    assert soldering < boards < lipo and "legs of EN (number 2 of the 12) and GND (number 4 of the 16)" in texts[boards]
    assert not any("1500 µs" in text for text in texts)
    assert [step.title for step in guide(name)][-3:] == DRIVING
    for word in ("`foldcar flash ", "`foldcar calibrate-servos`", "`foldcar log ", "turns backwards", "CHn_REVERSED"):
        assert word in " ".join(texts[-3:])


def test_nuts_are_drawn_apart_on_the_side_from_which_they_are_proved_to_come() -> None:
    folded = car("hinged")
    mounts, state, drawn = {mount.name: mount for mount in folded.mounts}, AssemblyState(folded), 0
    for step in assembly_steps(folded):
        state.advance(step)
        shape = StepPicture(step, state).shape
        for added in (add for add in step.adds if add.nut_mm):
            screw = mounts[added.name]
            axis = np.array(screw.pose)[:3, 2]
            at = {}
            for part, start in (("head", f"{screw.name} "), ("nut", f"nut of {screw.name} ")):
                rings = [facet.rings_mm[0].mean(axis=0) for facet in shape.facets if facet.key.startswith(start)]
                at[part] = np.mean(rings, axis=0)
            place = np.array(compose(screw.pose, screw.solids[2].pose))[:3, 3]
            proved = np.array(added.nut_mm[-1])
            # The nut's last move is onto the shank, towards the head; the head's is along the driver.
            assert proved @ axis == pytest.approx(np.linalg.norm(proved))
            assert (at["nut"] - place) @ proved < -10
            assert (at["head"] - place) @ axis > 10
            assert np.array(added.way_mm[-1]) @ axis < 0
            drawn += 1

    assert drawn == 2 * len(folded.axles) + 2


def test_hidden_surfaces_agree_with_rays() -> None:
    folded = car("w95")
    state = AssemblyState(folded)
    state.close_folds({piece.name: {crease.name: 0.6 for crease in piece.creases} for piece in folded.pieces})
    parts = [part for part in (*folded.placed, *folded.mounts) if part.body == "segment0" and not is_hidden(state, part)]
    facets = list(merge_shapes(state.shape(part) for part in parts).facets)
    view = camera(-55, 32)
    seen = {facet.facet.key: facet for facet in visible_facets(facets, view)}
    low_u, low_v, high_u, high_v = shapely.total_bounds([view.region for view in seen.values()])
    points = np.random.default_rng(1).uniform((low_u, low_v), (high_u, high_v), (500, 2))

    edges = shapely.union_all([view.region.boundary for view in seen.values()])
    # A facet that the rays run in, or the inner side of a closed body, is not met.
    slopes = [(facet, float(facet.normal @ view.toward)) for facet in facets]
    met = [(facet, slope) for facet, slope in slopes if abs(slope) > 1e-9 and not (facet.closed and slope < 0)]
    outlines = [shapely.Polygon(rings[0], rings[1:]) for rings in ([*map(view.flat, f.rings_mm)] for f, _ in met)]
    shapely.prepare(outlines)

    disagreeing = compared = 0
    for u, v in points[shapely.distance(shapely.points(points), edges) >= 0.5]:
        at = shapely.Point(u, v)
        depths = {
            float(facet.normal @ (facet.rings_mm[0][0] - view.right * u - view.up * v) / slope): facet.key
            for (facet, slope), outline in zip(met, outlines, strict=True)
            if outline.covers(at)
        }
        if depths:
            compared += 1
            disagreeing += not seen[depths[max(depths)]].region.covers(at)

    assert compared > 120
    assert disagreeing == 0


@pytest.mark.parametrize(
    ("name", "machine", "sheet"),
    [("w95", "silhouette", "12in"), ("hinged", "scissors", "a4")],
)
def test_guide_shows_every_piece_and_tells_every_join(name: str, machine: str, sheet: str) -> None:
    folded = car(name)
    parted = cut_car(folded, options(machine, sheet=sheet))

    guide_steps = build_steps(folded, parted, machine)

    text = " ".join(line for step in guide_steps for line in step.lines)
    numbers: set[int] = set()
    for first, last in re.findall(r"(\d+)(?: to (\d+))?", " ".join(re.findall(r"[Jj]oins? ([\d, to]+)", text))):
        numbers |= set(range(int(first), int(last or first) + 1))
    assert numbers == {join.number for join in parted.car.joins}
    whole = {piece.name for piece in folded.pieces} & {piece.name for piece in parted.car.pieces}
    assert len(re.findall(" is cut as ", text)) == len(folded.pieces) - len(whole)
    assert (len(whole) < len(folded.pieces)) == (sheet == "a4")
    assert len(guide_steps[0].pictures) == len(parted.car.pieces)
    assert all(step.pictures for step in guide_steps if step.title not in ["Join the parts of pieces", *DRIVING])


def test_pieces_in_the_guide_have_the_numbers_of_their_joins_none_on_another() -> None:
    folded, guide_steps = car("hinged"), guide("hinged")
    # The pictures of the page are drawn already.
    drawn = re.findall(r"<svg.*?</svg>", page(), re.DOTALL)[1:]
    pictures = [[ET.fromstring(drawn.pop(0)) for _ in step.pictures] for step in guide_steps]

    slots = 0
    for piece, picture in zip(folded.pieces, pictures[0], strict=True):
        # A layer lies on its number.
        sides = [(join, join.piece_a) for join in folded.joins]
        sides += [(join, join.piece_b) for join in folded.joins if join.kind not in ("laminate", "tuck")]
        numbers = [text.text for text in picture.iterfind("{*}text")]
        assert set(numbers) >= {str(join.number) for join, name in sides if name == piece.name}, piece.name
        # A number at the slot that a tongue goes through, beside the one on the tongue.
        slotted = [join for join in folded.joins if join.slot and join.piece_b == piece.name == join.piece_a]
        assert all(numbers.count(str(join.number)) == 2 for join in slotted)
        slots += len(slotted)
    assert slots
    for step, shown in zip(guide_steps, pictures, strict=True):
        for circles in (list(picture.iterfind("{*}circle")) for picture in shown):
            shapes = [(float(c.attrib["cx"]), float(c.attrib["cy"]), float(c.attrib["r"])) for c in circles]
            for a, b in combinations(shapes, 2):
                assert np.hypot(a[0] - b[0], a[1] - b[1]) > a[2] + b[2], step.title


def test_pictures_show_what_goes_in() -> None:
    folded, proved = car("w65"), assembly_steps(car("w65"))
    parts = {mount.name: mount.part for mount in folded.mounts}

    for step, shown in zip(proved, assembly("w65"), strict=True):
        first = step.adds[0].body if step.adds else ""
        seen = {view.facet.key for picture in shown.pictures for view in picture.visible}
        for added in step.adds:
            hidden_in_others = step.unit and added.body != first
            if added.kind == "unit" or hidden_in_others or added.name == folded.parts.wiring.name:
                continue
            # Of several screws of a kind, one may stand behind the film.
            names = [name for name, part in parts.items() if part == parts.get(added.name)]
            starts = [f"{added.name} {added.copy} "] if added.kind == "piece" else [f"{name} " for name in names]
            assert any(key.startswith(start) for key in seen for start in starts), (step.title, added.name)


def test_what_is_reached_in_service_is_named_inside_the_picture_and_readable() -> None:
    drawn = ET.fromstring(service_picture(car("hinged"))[-1].svg)

    left, top, wide, high = map(float, drawn.attrib["viewBox"].split())
    boxes = {}
    for text in drawn.iterfind("{*}text"):
        x, y, size = float(text.attrib["x"]), float(text.attrib["y"]), float(text.attrib["font-size"])
        base, length = y + float(text.attrib["dy"].removesuffix("em")) * size, 0.55 * size * len(text.text or "")
        start = x - length * {"start": 0, "middle": 0.5, "end": 1}[text.attrib["text-anchor"]]
        boxes[text.text] = shapely.box(start, base - 0.7 * size, start + length, base)
    assert set(boxes) == {"USB", "servo switch", "board switch", "LiPo's plug", "servos' plugs", "reset button"}
    assert all(shapely.box(left, top, left + wide, top + high).covers(box) for box in boxes.values())
    assert not any(a.intersects(b) for a, b in combinations(boxes.values(), 2))
