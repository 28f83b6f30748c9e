"""Sampled values of scenes and cars as columns, and which of them separates passed from failed."""

import csv
import json
from pathlib import Path
from typing import Any

import numpy
import pytest
from scipy.stats import mannwhitneyu

from foldcar.car.variation import draw, spread_named
from foldcar.report.environment_values import environment_values, objects_of_pieces
from foldcar.statistics.separation import binned, separations
from foldcar.store.reader import Store
from swept_listing import foldcar

PROGRAM = """
model model
param friction = Range(0.4, 0.8)
for x in (0.4, 0.7):
    new Bump at (Range(x, x + 0.1), 0), facing -90 deg, with height Range(0.01, 0.02)
kerb2 = new Kerb at (0.9, 0), facing -90 deg, with length 0.1, with height Range(0.005, 0.01)
steps = [new Step at (x, 0.5), with length 0.1, with width 0.1, with height Range(0.01, 0.02) for x in (0.2, 0.4)]
goal = new Goal at (1.2, 0), facing -90 deg
ego = new Robot at (0, 0), facing goal
"""
ENVIRONMENTS = 6


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory, carsim_binary: Path) -> Path:
    """A sweep of one car over two bumps and a kerb, as the workshop builds it."""
    folder = tmp_path_factory.mktemp("values")
    (folder / "bumps.scenic").write_text(PROGRAM)
    params = {"timeout": 20, "environments": ENVIRONMENTS, "variation": "workshop", "variation_seed": 5}
    listing = {
        "experiments": {"1": {"veh_id": 1, "env_id": 1, "params": params}},
        "vehicles": {"1": {"type": "W_B_W", "params": [{"common": {"width": 95}}]}},
        "environments": {"1": {"scenic_filename": "bumps.scenic", "seed": 3}},
    }
    (folder / "l.json").write_text(json.dumps(listing))
    foldcar("sweep", folder / "l.json", "--store", folder / "s.db")
    return folder / "s.db"


def test_values_are_those_that_scenic_samples_and_the_workshop_draws(store: Path) -> None:
    scenes = store.parent / "scenes.jsonl"
    foldcar("sample", store.parent / "bumps.scenic", "-n", ENVIRONMENTS, "--seed", 3, "-o", scenes)
    sampled = [json.loads(line) for line in scenes.read_text().splitlines()]
    sampled = [scene.get("scene", scene) for scene in sampled]
    drawn = [draw(spread_named("workshop", ""), 5, sample) for sample in range(ENVIRONMENTS)]

    with Store.open(store) as opened:
        environments = environment_values(opened, opened.info().experiments["1"])
    columns = {column.name: environments.values[:, at] for at, column in enumerate(environments.columns)}

    assert columns["scene_friction"] == pytest.approx([scene["friction"] for scene in sampled])
    heights = [[piece["height_m"] for piece in scene["terrain"]] for scene in sampled]
    assert columns["scene_box_1_height_m"] == pytest.approx([height[0] for height in heights])
    assert columns["scene_box_2_height_m"] == pytest.approx([height[1] for height in heights])
    assert columns["scene_highest_m"] == pytest.approx([max(height) for height in heights])
    assert columns["car_supply_v"] == pytest.approx([variation["supply_v"] for variation in drawn])
    # Channels 0 and 2 are left wheels; a neutral's error turns right servos the other way.
    speeds = [variation["servo_speed"] for variation in drawn]
    assert columns["car_left_less_right_servo_speed"] == pytest.approx([(a + c - b - d) / 2 for a, b, c, d, *_ in speeds])
    neutrals = [variation["neutral_us"] for variation in drawn]
    assert columns["car_mean_neutral_us"] == pytest.approx([(a - b + c - d) / 4 for a, b, c, d, *_ in neutrals])
    # What is the same everywhere tells nothing.
    assert not {"scene_goal_x_m", "scene_start_x_m", "scene_box_1_length_m", "scene_pieces"} & set(columns)
    friction = next(column for column in environments.columns if column.name == "scene_friction")
    assert (friction.label, friction.unit) == ("friction", "")
    # Objects have the program's names; the bumps of the loop have none.
    labels = {column.name: (column.label, column.unit, column.scale) for column in environments.columns}
    assert labels["scene_box_1_height_m"] == ("bump 1 height", "mm", 1000)
    assert labels["scene_ramp_1_height_m"] == ("kerb2 height", "mm", 1000)
    assert labels["scene_box_5_height_m"] == ("steps[1] height", "mm", 1000)


def test_pieces_without_the_names_of_objects_are_called_by_their_kind() -> None:
    terrain = [{"kind": kind} for kind in ("ramp", "box", "box")]
    named = [("kerb2", 2), ("step", 1)]

    assert objects_of_pieces(named, [{"terrain": terrain}]) == [("kerb2", [0, 1]), ("step", [2])]
    by_kind = [("ramp or kerb 1", [0]), ("block 1", [1]), ("block 2", [2])]
    assert objects_of_pieces([], [{"terrain": terrain}]) == by_kind
    assert objects_of_pieces([("kerb2", 2)], [{"terrain": terrain}]) == by_kind
    # Environments with other pieces have no common names.
    assert objects_of_pieces(named, [{"terrain": terrain}, {"terrain": terrain[:2]}]) is None


def test_the_export_has_them_beside_every_run(store: Path) -> None:
    foldcar("export", store, "--csv", store.parent / "runs.csv")
    with (store.parent / "runs.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))

    with Store.open(store) as opened:
        environments = environment_values(opened, opened.info().experiments["1"])

    for row in rows:
        for at, column in enumerate(environments.columns):
            value = environments.values[int(row["sample"]), at]
            assert row[column.name] == "" if numpy.isnan(value) else float(row[column.name]) == value


def test_of_one_design_the_separation_is_mann_whitneys_statistic() -> None:
    random = numpy.random.default_rng(0)
    values = numpy.column_stack([random.normal(size=40), random.integers(0, 5, 40), numpy.full(40, 3.0)])
    passed = values[:, 0] + random.normal(size=40) > 0
    design, environment = numpy.zeros(40, int), numpy.arange(40)

    difference_of = {
        separation.column: separation.difference for separation in separations(values, design, environment, passed)
    }

    assert set(difference_of) == {0, 1}  # a constant column separates nothing
    for column, difference in difference_of.items():
        u = mannwhitneyu(values[passed, column], values[~passed, column]).statistic
        assert difference == pytest.approx(2 * u / (passed.sum() * (~passed).sum()) - 1)


def test_intervals_hold_the_separation_of_all_environments_together() -> None:
    """Six columns, of which the first tells; the truth from a large sample; designs share environments."""
    random = numpy.random.default_rng(2)
    hard = numpy.array([-0.5, 0.3, 1.2])

    def sample(number: int) -> tuple[numpy.ndarray, numpy.ndarray, numpy.ndarray, numpy.ndarray]:
        values = random.normal(size=(number, 6))
        design, environment = (at.ravel() for at in numpy.indices((3, number)))
        noise = random.normal(size=number)
        return values, design, environment, (values[:, 0] + noise)[environment] > hard[design]

    truth = {separation.column: separation.difference for separation in separations(*sample(2000))}
    covered, ranked = [], 0
    for _ in range(60):
        columns = separations(*sample(40))
        ranked += columns[0].column == 0
        covered.append(
            all(
                separation.low - 0.03 <= abs(truth[separation.column]) <= separation.high + 0.03 for separation in columns
            )
        )

    assert ranked == 60
    assert numpy.mean(covered) > 0.9


def sample_with_noise(random: numpy.random.Generator, environments: int, effect: float) -> Any:
    """Twelve columns, the first of which has the correlation ``effect`` with how hard an environment is to 20 designs."""
    values = random.normal(size=(environments, 12))
    difficulty = effect * values[:, 0] + numpy.sqrt(1 - effect**2) * random.normal(size=environments)
    design, environment = (at.ravel() for at in numpy.indices((20, environments)))
    noise = 0.5 * random.normal(size=len(design))
    return values, design, environment, difficulty[environment] + noise > random.normal(size=20)[design]


@pytest.mark.parametrize("missing", [False, True])
def test_columns_that_tell_nothing_seldom_seem_to_tell_even_of_ten_environments(missing: bool) -> None:
    random, alarms = numpy.random.default_rng(3), 0
    for _ in range(200):
        values, design, environment, passed = sample_with_noise(random, 10, 0.0)
        # As a sweep leaves them that stops where enough is known.
        run = environment < random.integers(6, 11, 20)[design] if missing else numpy.full(len(design), True)
        alarms += any(
            separation.low > 0 for separation in separations(values, design[run], environment[run], passed[run])
        )

    # 5 % of 200 are 10; bounds of normal theory gave 35 %.
    assert alarms <= 19


def test_a_column_that_tells_is_found() -> None:
    random = numpy.random.default_rng(4)
    found_columns = [
        {separation.column for separation in separations(*sample_with_noise(random, 40, 0.6)) if separation.low > 0}
        for _ in range(60)
    ]

    assert sum(0 in hits for hits in found_columns) > 40


def test_bins_count_every_run_once() -> None:
    values = numpy.array([0.0, 1.0, 2.0, 3.0, numpy.nan])
    environment, passed = numpy.array([0, 0, 1, 2, 3, 4]), numpy.array([1, 0, 1, 1, 0, 1])

    bins = binned(values, environment, passed, max_bins=2)

    assert [(bin.first, bin.last, bin.runs, bin.passed) for bin in bins] == [(0, 1, 3, 2), (2, 3, 2, 1)]
