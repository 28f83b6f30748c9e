"""One order: the guide's page, its pictures, the view and the parts list follow the steps that are proved."""

import html
import re
from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from foldcar.car.folded.model import FoldedCar
from foldcar.car.folded.pose import compose
from foldcar.car.proof.plan import planned
from foldcar.car.proof.prove import assembly_steps, prove_steps
from foldcar.car.proof.step import Added, AssemblyStep
from foldcar.fabrication.assembly.guide import guide_page
from foldcar.fabrication.assembly.guide_pictures import Scene
from foldcar.fabrication.assembly.guide_state import State
from foldcar.fabrication.assembly.parts_list import parts_list
from foldcar.fabrication.assembly.view_steps import view_steps
from foldcar.fabrication.patterns.options import options
from foldcar.fabrication.patterns.sheets import cut_car
from page_check import page_findings
from test_assembly_proof import car

# Those between differ from these in their width.
PAGES = ("w65", "six", "hinged")


@cache
def page(name: str) -> str:
    folded = car(name)
    return guide_page(folded, cut_car(folded, options("laser", sheet="1000x1000")), "laser", f"a <{name}>")


def label(folded: FoldedCar, added: Added) -> str:
    labels = {("piece", piece.name): piece.label for piece in folded.pieces}
    labels |= {("mount", mount.name): mount.part for mount in folded.mounts}
    return labels.get((added.kind, added.name), added.name)


def told(lines: list[str], labels: set[str]) -> Iterator[str]:
    """The labels of what goes in, in the order of a step's lines; "4 times: …" repeats."""
    for line in lines:
        times, text = re.fullmatch(r"(?:(\d+) times: )?(.*)", line).groups()
        for _ in range(int(times or 1)):
            for part in text.split("; then "):
                found = re.match(r"(?:(\d+) × )?(.+?): (?:from |lay |wind |stretch )", part)
                name = next((one for one in labels if found and one.lower() == found[2].lower()), None)
                if found and name:
                    yield from [name] * int(found[1] or 1)


@pytest.mark.parametrize("name", PAGES)
def test_the_guide_s_page_puts_things_in_in_the_order_that_is_proved(name: str) -> None:
    folded, steps = car(name), assembly_steps(car(name))
    sections = re.findall(r"<h2><b>\d+</b>(.*?)<small>.*?</h2>(.*?)</section>", page(name), re.DOTALL)
    sections = sections[-len(steps) - 1 : -1] if "connect" in sections[-1][0] else sections[-len(steps) :]

    for step, (title, text) in zip(steps, sections, strict=True):
        lines = [html.unescape(line) for line in re.findall(r"<li>(.*?)</li>", text, re.DOTALL)]
        shown = [one for one in step.adds if not step.unit or one.body == step.adds[0].body]
        proved = [label(folded, one) for one in shown if one.name != folded.parts.wiring.name]
        assert html.unescape(title).startswith(step.title)
        assert list(told(lines, set(proved))) == proved, (title, lines)


@pytest.mark.parametrize("name", PAGES)
def test_the_guide_is_one_page_that_needs_no_other_file(name: str) -> None:
    guide = page(name)

    assert page_findings(guide) == []
    assert f"a &lt;{name}&gt;" in guide and f"<{name}>" not in guide
    assert not re.search(r'(src|href)="', guide)


@pytest.mark.parametrize("name", PAGES)
def test_the_guide_says_from_where_screws_come_what_they_pass_and_where_nuts_go(name: str) -> None:
    text = html.unescape(page(name))
    servos = len(car(name).axles)

    screws = "2 × M2x8 screw with nut: from outside through the FS90R servo, the beam and the servo doubler"
    how = f"{screws}, with the PH0 screwdriver, its nut from inside"
    assert f"{servos} times: FS90R servo: from outside; then {how}" in text
    assert (
        "2 × M2x12 screw with nut: from below through the bridge, the M2 spacer, nylon and the HUZZAH32 Feather, "
        "with the PH0 screwdriver, its nut from above" in text
    )
    # The wing hides these nuts: it comes after them.
    order = ["HUZZAH32 Feather: from above", "M2x12 screw with nut: from below", "FeatherWing: from above"]
    assert sorted(order, key=text.index) == order


@pytest.mark.parametrize("name", PAGES)
def test_nuts_are_drawn_apart_on_the_side_from_which_they_are_proved_to_come(name: str) -> None:
    folded = car(name)
    mounts, state, drawn = {mount.name: mount for mount in folded.mounts}, State(folded), 0
    for step in assembly_steps(folded):
        state.take(step)
        shape = Scene(step, state).shape
        for added in (one for one in step.adds if one.nut_mm):
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


def swapped(steps: tuple[AssemblyStep, ...], first: str, second: str) -> tuple[AssemblyStep, ...]:
    """The steps with two things of one step in each other's place."""
    changed = []
    for step in steps:
        names = [one.name for one in step.adds]
        if first in names and second in names:
            adds, i, k = list(step.adds), names.index(first), names.index(second)
            adds[i], adds[k] = adds[k], adds[i]
            step = replace(step, adds=tuple(adds))
        changed.append(step)
    assert tuple(changed) != steps
    return tuple(changed)


@pytest.mark.parametrize(
    ("first", "second", "words"),
    [
        ("HUZZAH32 Feather", "board screw 1", "board screw 1 passes HUZZAH32 Feather, which is not there yet"),
        ("board screw 2", "8-channel Servo FeatherWing", "the nut of board screw 2 has no way out"),
        ("HUZZAH32 Feather", "8-channel Servo FeatherWing", "HUZZAH32 Feather has no way out"),
        ("front left servo", "front left servo screw 1", "passes front left servo, which is not there yet"),
        ("horn of wheel0", "centre screw of wheel0", "passes horn of wheel0, which is not there yet"),
    ],
)
def test_a_wrong_order_is_found(first: str, second: str, words: str) -> None:
    folded = car("w95")

    found = [str(finding) for finding in prove_steps(folded, swapped(planned(folded), first, second)).findings]

    assert any(words in one for one in found), found


def test_a_step_too_early_is_found() -> None:
    folded = car("w95")
    steps = list(planned(folded))
    shut = next(i for i, step in enumerate(steps) if step.title == "Shut the lid")
    steps.insert(9, steps.pop(shut))

    found = [str(finding) for finding in prove_steps(folded, steps).findings]

    assert any(folded.parts.battery.name in one and "beam: lid" in one for one in found), found


@pytest.mark.parametrize("name", ["w95", "hinged"])
def test_parts_list_and_view_follow_the_same_order(name: str) -> None:
    folded, steps = car(name), assembly_steps(car(name))
    parts = {mount.name: mount.part for mount in folded.mounts}
    used = dict.fromkeys(parts[one.name] for step in steps for one in step.adds if one.kind == "mount")
    shown = view_steps(folded)

    assert [row.name for row in parts_list(folded) if row.name in used] == list(used)
    for number, step in enumerate(steps, 1):
        starts = [
            next(begin for n, _, begin, _ in shown.ways[one.kind, one.name, one.copy] if n == number)
            for one in step.adds if one.kind != "unit"
        ]  # fmt: skip
        assert starts == sorted(starts)
        for one in (one for one in step.adds if one.nut_mm):
            (first, *_) = [way for n, way, _, _ in shown.ways["nut", one.name, 0] if n == number]
            assert np.allclose(first[0], -np.array(one.nut_mm[-1]), atol=1e-3)
