"""Sampled values of scenes and cars as columns, and which of them separates passed from failed."""

import csv
import json
from pathlib import Path
from typing import Any

import numpy
import pytest
from scipy.stats import mannwhitneyu

from foldcar.car.variation import draw, spread_named
from foldcar.report.environment_labels import objects_of_pieces
from foldcar.report.environment_values import environment_values, read_scenes
from foldcar.statistics.separation import binned, separations
from foldcar.store.reader import Store
from foldcar.store.tables import SAMPLE
from full_store import change
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
    built = {"variation": "workshop", "variation_seed": 5}
    return swept(tmp_path_factory.mktemp("values"), PROGRAM, ENVIRONMENTS, built)


@pytest.fixture(scope="module")
def stair_store(tmp_path_factory: pytest.TempPathFactory, carsim_binary: Path) -> Path:
    """A sweep of one car over a stair and a gate of a user's classes."""
    return swept(tmp_path_factory.mktemp("stair"), STAIR, 12, {})


def swept(folder: Path, program: str, environments: int, experiment: dict[str, Any]) -> Path:
    """The store of a sweep of one car in samples of a program, with the listing l.json beside it."""
    (folder / "bumps.scenic").write_text(program)
    params = {"timeout": 20, "environments": environments, **experiment}
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
    assert columns["scene_bump_1.height_m"] == pytest.approx([height[0] for height in heights])
    assert columns["scene_bump_2.height_m"] == pytest.approx([height[1] for height in heights])
    assert columns["scene_highest_m"] == pytest.approx([max(height) for height in heights])
    assert columns["car_supply_v"] == pytest.approx([variation["supply_v"] for variation in drawn])
    # Channels 0 and 2 are left wheels; a neutral's error turns right servos the other way.
    speeds = [variation["servo_speed"] for variation in drawn]
    assert columns["car_left_less_right_servo_speed"] == pytest.approx([(a + c - b - d) / 2 for a, b, c, d, *_ in speeds])
    neutrals = [variation["neutral_us"] for variation in drawn]
    assert columns["car_mean_neutral_us"] == pytest.approx([(a - b + c - d) / 4 for a, b, c, d, *_ in neutrals])
    # What is the same everywhere tells nothing.
    assert not {"scene_goal_x_m", "scene_start_x_m", "scene_bump_1.length_m", "scene_pieces"} & set(columns)
    friction = next(column for column in environments.columns if column.name == "scene_friction")
    assert (friction.label, friction.unit) == ("friction", "")
    # Objects have the program's names; the bumps of the loop have none.
    labels = {column.name: (column.label, column.unit, column.scale) for column in environments.columns}
    assert labels["scene_bump_1.height_m"] == ("bump 1 height", "mm", 1000)
    assert labels["scene_kerb2.height_m"] == ("kerb2 height", "mm", 1000)
    assert labels["scene_steps[1].height_m"] == ("steps[1] height", "mm", 1000)


STAIR = """
model model
class Stair(StepPyramid):
    rise: Range(0.005, 0.02)
    step_height: self.rise
class Gate(Terrain):
    gap: Range(0.1, 0.2)
    posts: 2
    painted: True
    colours: "red and white"
    far: 1e300
    def pieces(self):
        return [block(0.02, 0.02, self.tall), {**block(0.02, 0.02, self.tall), "y_m": self.gap}]
ego = new Robot at (0, 0), facing -90 deg
stair = new Stair at (0.8, 0), facing -90 deg, with steps DiscreteRange(2, 4)
gate = new Gate at (1.4, 0.3), facing -90 deg, with tall Range(0.03, 0.05)
new StepPyramid at (1.4, -0.6), with step_height Range(0.01, 0.02)
rough = new RoughGround at (1.7, 0.4), with length 0.2, with width 0.2
goal = new Goal at (1.9, 0), facing -90 deg
"""


def test_an_object_s_own_parameters_are_columns_and_not_the_sizes_of_its_pieces(stair_store: Path) -> None:
    with Store.open(stair_store) as opened:
        info = opened.info().experiments["1"]
        environments = environment_values(opened, info)
        scenes = [scene for _, scene in sorted(read_scenes(opened, info).items())]
    columns = {column.name: environments.values[:, at] for at, column in enumerate(environments.columns)}
    labels = {column.name: (column.label, column.unit) for column in environments.columns}

    # Independently, from the pieces. A pyramid's lowest block is one step high; each block is one step of the stair.
    counts = [len(scene["terrain"]) - 2 - 3 - 1 for scene in scenes]
    assert columns["scene_stair.steps"] == pytest.approx(counts) and set(counts) == {2, 3, 4}
    pieces = [scene["terrain"] for scene in scenes]
    lowest = [min(piece["height_m"] for piece in terrain[:count]) for terrain, count in zip(pieces, counts, strict=True)]
    assert columns["scene_stair.rise"] == pytest.approx(lowest, abs=2e-9)
    gates = [terrain[count : count + 2] for terrain, count in zip(pieces, counts, strict=True)]
    assert columns["scene_gate.gap"] == pytest.approx([right["y_m"] - left["y_m"] for left, right in gates], abs=2e-9)
    # The height of the posts is given by `with` only.
    assert columns["scene_gate.tall"] == pytest.approx([left["height_m"] for left, _ in gates])
    lone = [min(piece["height_m"] for piece in terrain[-4:-1]) for terrain in pieces]
    assert columns["scene_step_pyramid.step_height_m"] == pytest.approx(lone)
    assert labels["scene_step_pyramid.step_height_m"] == ("step pyramid step height", "mm")
    # The unit of a user's own parameter is not known.
    assert labels["scene_stair.rise"] == ("stair rise", "") and labels["scene_gate.gap"] == ("gate gap", "")
    # No piece, no seed, no switch, no text, and nothing that follows linearly from an earlier column.
    left_out = {"stair.step_height_m", "rough.seed", "gate.painted", "gate.colours", "gate.far"}
    assert not {f"scene_{name}" for name in left_out} & set(columns) and not [name for name in columns if "box" in name]


def test_without_stored_parameters_a_label_says_which_piece(stair_store: Path) -> None:
    """As in a sample of an older version. The stair has the same number of steps in all samples, so the same pieces."""
    old = stair_store.with_name("old.db")
    program = stair_store.parent / "fixed.scenic"
    program.write_text(STAIR.replace("DiscreteRange(2, 4)", "3"))
    listing = json.loads((stair_store.parent / "l.json").read_text())
    listing["environments"]["1"]["scenic_filename"] = program.name
    (stair_store.parent / "fixed.json").write_text(json.dumps(listing))
    foldcar("sweep", stair_store.parent / "fixed.json", "--store", old)
    with Store.open(old) as opened:
        named = environment_values(opened, opened.info().experiments["1"])
    change(old, SAMPLE, "sample = 2", objects=None)

    with Store.open(old) as opened:
        environments = environment_values(opened, opened.info().experiments["1"])

    assert "scene_stair.rise" in {column.name for column in named.columns}
    labels = {column.name: column.label for column in environments.columns}
    # Pieces that are linear in an earlier one are left out: the other blocks of the stair and of the pyramid.
    assert labels["scene_box_1_height_m"] == "stair, block 1: height"
    assert labels["scene_box_5_y_m"] == "gate, block 2: y"
    assert labels["scene_box_6_height_m"] == "step pyramid, block 1: height"


def test_pieces_without_the_names_of_objects_are_called_by_their_kind() -> None:
    terrain = [{"kind": kind} for kind in ("ramp", "box", "box")]
    named = [("kerb2", 2), ("step", 1)]

    assert objects_of_pieces(named, [{"terrain": terrain}]) == [("kerb2", [0, 1]), ("step", [2])]
    by_kind = [("slope 1", [0]), ("block 1", [1]), ("block 2", [2])]
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
