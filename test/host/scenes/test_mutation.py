"""`mutate`: noise as Scenic documents it; what is placed relative to a Point follows."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import kstest

import foldcar
from foldcar.errors import FoldcarError
from foldcar.scenes.source import SceneSource, open_environment

HEAD = "model model\nparam course_x_max = 4\n"
# A start, two bumps and a goal, placed relative to three points.
POINTS = """start = new Point at (0, 0)
middle = new {kind} at (0.7, 0.2), facing -90 deg
end = new Point at (1.8, 0)
ego = new Robot at start, facing -90 deg
left = new Bump left of middle by 0.1, with width 0.1, with height 0.01
right = new Bump right of middle by 0.1, with width 0.1, with height 0.01
goal = new Goal at end, facing -90 deg
"""
NOISE = 0.02
COUNT = 120
# A sample of this size passes a test at this level in all but one of 10,000 cases.
LEVEL = 1e-4


def opened(folder: Path, text: str, **options: Any) -> SceneSource:
    program = folder / "program.scenic"
    program.write_text(HEAD + text)
    return open_environment(program, {}, 5, **options)


def oriented() -> str:
    return POINTS.format(kind="OrientedPoint")


def plain() -> str:
    # Without a heading of the point, left of it is where the bump's own heading says.
    return POINTS.format(kind="Point").replace("0.2), facing -90 deg", "0.2)")


def xy(place: dict[str, Any]) -> tuple[float, float]:
    return place["x_m"], place["y_m"]


def test_things_at_a_mutated_point_move_with_it_by_the_documented_noise(tmp_path: Path) -> None:
    """The noise is normal with a standard deviation of scale x 1 m in x and in y."""
    # Where it stands makes no difference.
    source = opened(tmp_path, plain().replace("ego =", f"mutate start, middle, end by {NOISE}\nego ="))
    scenes = [source.sample(k) for k in range(COUNT)]
    left, right = (np.array([xy(scene["terrain"][side]) for scene in scenes]) for side in (0, 1))
    assert np.ptp(left - right, axis=0) == pytest.approx(0, abs=3e-9)
    moved = {
        "start": np.array([xy(scene["start"]) for scene in scenes]) - (0, 0),
        "middle": (left + right) / 2 - (0.7, 0.2),
        "end": np.array([xy(scene["goal"]) for scene in scenes]) - (1.8, 0),
    }
    for place in moved.values():
        for axis in (0, 1):
            assert kstest(place[:, axis] / NOISE, "norm").pvalue > LEVEL
    # Six independent noises: the correlation of two has a standard deviation of 1 / sqrt(n).
    correlations = np.corrcoef(np.hstack(list(moved.values())).T) - np.eye(6)
    assert np.abs(correlations).max() < 4.5 / math.sqrt(COUNT)


def test_things_at_a_mutated_oriented_point_turn_about_it(tmp_path: Path) -> None:
    """Its heading has a standard deviation of scale x 5 degrees; what is left of it turns about it."""
    course = "param course_x_min = -9, course_x_max = 9, course_y_min = -9, course_y_max = 9\n"
    source = opened(tmp_path, f"{oriented()}mutate middle by 1.5\n{course}")
    headings, offsets = [], []
    for k in range(COUNT):
        try:
            left, right = source.sample(k)["terrain"]
        except FoldcarError:
            continue  # a bump at the start
        assert left["heading_rad"] == right["heading_rad"]
        headings.append(left["heading_rad"])
        across = np.subtract(xy(left), xy(right))
        offsets.append(abs(complex(*across) - 0.3 * complex(0, 1) * np.exp(1j * left["heading_rad"])))
    assert len(headings) > 0.9 * COUNT
    assert max(offsets) < 1e-8
    assert kstest(np.array(headings) / (1.5 * math.radians(5)), "norm").pvalue > LEVEL


def test_points_of_an_imported_program_and_a_custom_noise(tmp_path: Path) -> None:
    (tmp_path / "places.scenic").write_text("spot = new Point at (0.7, 0.2), with positionStdDev (0.5, 0, 0)\n")
    text = "ego = new Robot at (0, 0), facing -90 deg\ngoal = new Goal at (2, 0), facing -90 deg\n"
    source = opened(
        tmp_path,
        f"from places import spot\n{text}new Bump at spot, with height 0.01, with width 0.1\nmutate spot by 0.1\n",
    )
    places = np.array([xy(source.sample(k)["terrain"][0]) for k in range(COUNT)])
    assert set(places[:, 1]) == {0.2}
    assert kstest((places[:, 0] - 0.7) / 0.05, "norm").pvalue > LEVEL


def test_a_frozen_mutated_point_keeps_its_noise_and_what_stands_at_it(tmp_path: Path) -> None:
    source = opened(tmp_path, f"{plain()}mutate middle, end by {NOISE}\n")
    scene = source.scenic_scene(3)
    kept = source.describe(scene, 3)
    foldcar.condition(source.scenario, scene, objects=["middle"])
    scenes = [source.sample(k) for k in range(20)]
    assert all(scene["terrain"] == kept["terrain"] for scene in scenes)
    assert len({xy(scene["goal"]) for scene in scenes}) == 20


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("mutate middle by Range(0, 1)", 'line 10: TypeError: "mutate X by Y" with Y not a number'),
        ("number = 3\nmutate number", 'line 11: TypeError: "mutate X" with X not an object'),
    ],
)
def test_what_cannot_be_mutated(tmp_path: Path, text: str, part: str) -> None:
    with pytest.raises(FoldcarError) as caught:
        opened(tmp_path, f"{oriented()}{text}\n")
    assert part in str(caught.value)
