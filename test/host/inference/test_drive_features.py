"""Features of drives: paths as carsim has them, and quarters of a way that a formula drives."""

import json
import math
import subprocess
from pathlib import Path

import numpy as np
import pytest

from foldcar.inference.calibration.drive_features import (
    CLIMBING,
    FAMILIES,
    FEATURES,
    LEAST_RAD,
    PITCH,
    ROLL,
    SPEED,
    STAGES,
    TIME,
    TURNING,
    drive_end,
    path_features,
    possible_ends,
    told_features,
)
from foldcar.simulation.compact_path import answered_path
from study_car import car_body

SCENE = {
    "start": {"x_m": 0.2, "y_m": -0.1, "heading_rad": 0.3},
    "goal": {"kind": "line", "x_m": 1.2, "y_m": 5.0, "heading_rad": 0.0},
}


def test_a_compact_path_is_the_path_of_the_same_run(carsim_binary: Path) -> None:
    scene = {"id": "s", "friction": 0.6, "start": {"x_m": 0, "y_m": 0, "heading_rad": 3.0}, "terrain": [
        {"kind": "box", "x_m": -0.4, "y_m": 0.1, "heading_rad": 0, "length_m": 0.1, "width_m": 0.3, "height_m": 0.02}
    ], "goal": None, "course": {"x_min_m": -5, "x_max_m": 5, "y_min_m": -5, "y_max_m": 5}}  # fmt: skip
    run = {"body": "b", "scene": "s", "speed_m_s": 0.4, "yaw_rate_rad_s": 0.5, "time_limit_s": 2.03}
    run["path_interval_s"] = 0.05
    lines = [{"body": {"id": "b", **car_body()}}, {"scene": scene}, {"run": {"id": "r", **run}}]
    lines.append({"run": {"id": "c", "path_form": "compact", **run}})
    text = "".join(json.dumps(line) + "\n" for line in lines)
    answer = subprocess.run([carsim_binary, "batch"], input=text, capture_output=True, text=True, check=True)
    whole, compact = map(json.loads, answer.stdout.splitlines())

    rows, compact_rows = np.array(whole["path"])[:, :7], answered_path(compact)

    assert compact_rows.shape == rows.shape and len(rows) > 30
    assert compact_rows[:, 0] == pytest.approx(rows[:, 0], abs=1e-9)
    # Rounded to half of 0.5 mm and of 2 mrad; headings go on beyond a half turn.
    assert np.abs(compact_rows[:, 1:4] - rows[:, 1:4]).max() < 0.00026
    assert np.abs(np.unwrap(compact_rows[:, 4]) - np.unwrap(rows[:, 4])).max() < 0.0011
    assert np.abs(compact_rows[:, 5:] - rows[:, 5:]).max() < 0.0011


def driven(way_m: float) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """A path along x from the start of SCENE at 0.5 m/s, drifting to the left by a tenth, nose up at 0.4 m."""
    t = np.arange(0, way_m / 0.5 + 1e-9, 0.01)
    x = 0.5 * t
    zero = np.zeros_like(t)
    return np.column_stack(
        [t, 0.2 + x, -0.1 + 0.1 * x, zero, 0.3 + x, -0.2 * np.exp(-(((x - 0.4) / 0.05) ** 2)), 0.05 + zero]
    )


def test_quarters_of_the_way_have_their_times_places_and_headings() -> None:
    features = path_features(driven(1.5), SCENE)

    assert FEATURES == len(FAMILIES) == 3 * STAGES + 3
    for stage in range(STAGES):
        at_m = min(0.25 * (stage + 1), 0.999)
        took_s = (at_m - 0.25 * stage) / 0.5
        assert features[3 * stage : 3 * stage + 3] == pytest.approx([math.log(took_s), 0.1 * at_m, at_m], abs=1e-6)
        assert FAMILIES[3 * stage : 3 * stage + 3] == (CLIMBING if stage else SPEED, TURNING, TURNING)
    assert features[PITCH] == pytest.approx(math.log(0.2 + LEAST_RAD), abs=1e-3)
    assert features[ROLL] == pytest.approx(math.log(0.05 + LEAST_RAD))
    assert math.isnan(features[TIME]) and drive_end("passed", features) == 0


def test_a_drive_that_ends_early_has_the_quarters_that_it_did() -> None:
    features = path_features(driven(0.6), SCENE)

    assert np.isfinite(features[: 3 * STAGES]).tolist() == [True] * 6 + [False] * 6
    # Within the third quarter, tipped or not: of the ends that an outcome alone allows.
    stuck, tipped = drive_end("stuck", features), drive_end("tipped", features)
    assert (stuck, tipped) == (5, 6) and possible_ends("stuck")[stuck] and possible_ends("tipped")[tipped]
    assert not possible_ends("stuck")[tipped] and not possible_ends("passed")[[stuck, tipped]].any()


def test_a_disc_is_reached_at_its_edge_and_what_follows_does_not_count() -> None:
    disc = {**SCENE, "goal": {"kind": "disc", "x_m": 1.2, "y_m": -0.1, "radius_m": 0.4}}
    path = driven(1.5)
    # It rolls after the end, where a built car drives on.
    path[path[:, 1] > 0.9, 6] = 1.0

    features = path_features(path, disc)

    assert features[3 * STAGES - 3] == pytest.approx(math.log((0.6 * 0.999 - 0.45) / 0.5), abs=1e-6)
    assert features[ROLL] == pytest.approx(math.log(0.05 + LEAST_RAD))


def test_without_a_path_only_the_time_of_those_that_passed_is_known() -> None:
    features = told_features(2.5, passed=True)

    assert features[TIME] == math.log(2.5) and np.isnan(np.delete(features, TIME)).all()
    assert np.isnan(told_features(2.5, passed=False)).all() and np.isnan(told_features(None, passed=True)).all()
