"""Where failed runs end along the way, and at which obstacle, against courses whose answer is known."""

from typing import Any

import numpy
import pytest

from foldcar.report.page_run_ends import CarExtents, read_course, run_ends
from foldcar.simulation.results import NUMBERS, OUTCOMES
from foldcar.store.run_arrays import RunArrays

OBJECTS = [("kerb1", 1), ("aside", 1), ("kerb2", 1)]
CAR = CarExtents(*(numpy.array([size]) for size in (0.1, 0.15, 0.06)))


def scene(shift_m: float, turn: bool = False) -> dict[str, Any]:
    """Two kerbs across the way from the start to a goal 3 m ahead, and a block beside it; ``turn``: along y, not x."""
    places = [(1.0, 0.0, 0.2, 1.0), (1.5, 0.4, 0.2, 0.2), (2.0 + shift_m, 0.0, 0.2, 1.0)]
    heading_rad = numpy.pi / 2 if turn else 0.0
    terrain = [
        {"kind": "box", "x_m": -y if turn else x, "y_m": x if turn else y, "heading_rad": heading_rad, "length_m": length,
         "width_m": width, "height_m": 0.02} for x, y, length, width in places
    ]  # fmt: skip
    goal = {"kind": "line", "x_m": 0.0 if turn else 3.0, "y_m": 3.0 if turn else 0.0, "heading_rad": heading_rad}
    return {"start": {"x_m": 0.0, "y_m": 0.0, "heading_rad": heading_rad}, "goal": goal, "terrain": terrain}


def ended(*runs: tuple[int, str, float]) -> RunArrays:
    """Runs of one design: the environment, the outcome, the progress at the end (m)."""
    sample, outcome, progress_m = zip(*runs, strict=True)
    metrics = numpy.full((len(runs), len(NUMBERS)), numpy.nan)
    metrics[:, NUMBERS.index("distance_to_target_m")] = 3 - numpy.array(progress_m)
    codes = numpy.array([OUTCOMES.index(name) for name in outcome], dtype=numpy.uint8)
    return RunArrays(numpy.zeros(len(runs), int), numpy.array(sample), codes, metrics)


@pytest.mark.parametrize("turn", [False, True])
def test_a_run_ends_at_the_obstacle_that_the_car_stands_over(turn: bool) -> None:
    course = read_course(OBJECTS, {0: scene(0.0, turn), 1: scene(0.3, turn)}, 2)
    runs = ended((0, "stuck", 0.85), (0, "tipped", 1.5), (0, "stuck", 1.85), (1, "stuck", 1.85), (1, "passed", 3.0))

    ends = run_ends(course, CAR, runs)

    assert ends is not None
    # The car reaches 0.1 m ahead of its middle; the block aside is out of its way and not shown.
    assert [obstacle["name"] for obstacle in ends["obstacles"]] == ["kerb1", "kerb2"]
    columns = [ends[name] for name in ("outcome", "bin", "obstacle", "count")]
    rows = {(OUTCOMES[outcome], bin, obstacle): count for outcome, bin, obstacle, count in zip(*columns, strict=True)}
    assert ends["step_m"] == 0.1
    assert rows == {("stuck", 8, 0): 1, ("tipped", 15, -1): 1, ("stuck", 18, 1): 1, ("stuck", 18, -1): 1}
    assert (ends["obstacles"][1]["from_m"], ends["obstacles"][1]["to_m"]) == pytest.approx((2.05, 2.25))
    assert ends["obstacles"][1]["least_m"] < 2.05 < 2.25 < ends["obstacles"][1]["most_m"]
    assert ends["goal_m"] == 3


def test_a_car_that_presses_against_a_face_touches_the_obstacle() -> None:
    course = read_course(OBJECTS, {0: scene(0.0)}, 1)
    # The first kerb begins 0.9 m ahead. The car's front is 2 mm before it, then 2 cm.
    touching, apart = (run_ends(course, CAR, ended((0, "stuck", place_m))) for place_m in (0.798, 0.78))
    assert touching is not None and apart is not None
    assert touching["obstacle"] == [0] and apart["obstacle"] == [-1]


def test_without_failures_or_a_goal_there_are_no_ends() -> None:
    course = read_course(OBJECTS, {0: scene(0.0), 1: scene(0.3)}, 2)
    assert run_ends(course, CAR, ended((0, "passed", 3.0))) is None
    assert run_ends(read_course(OBJECTS, {0: {**scene(0.0), "goal": None}}, 1), CAR, ended((0, "stuck", 1.0))) is None


def test_environments_with_different_pieces_keep_the_places_without_obstacles() -> None:
    fewer = scene(0.0)
    course = read_course(OBJECTS, {0: scene(0.0), 1: {**fewer, "terrain": fewer["terrain"][:2]}}, 2)

    ends = run_ends(course, CAR, ended((0, "stuck", 0.85), (1, "stuck", 0.85)))

    assert ends is not None and ends["obstacles"] == [] and ends["obstacle"] == [-1] and ends["count"] == [2]
