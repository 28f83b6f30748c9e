"""The published programs and their listings: the placed objects, and that the simulator accepts and runs them."""

import math
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy
import pytest
from scipy.stats import kstest

from foldcar.scenes.source import open_environment
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.engines import MUJOCO, MULTIBODY
from foldcar.simulation.heights import carsim_heights
from foldcar.simulation.runner import CarsimError
from foldcar.store.info import engine_id
from foldcar.store.reader import Store
from foldcar.study.environments import ExperimentEnvironment
from foldcar.study.experiments import engine_study, read_study
from foldcar.study.sweep import Sweep

SCENARIOS = Path(__file__).resolve().parents[3] / "scenarios"
PROGRAMS = sorted(path.stem for path in SCENARIOS.glob("*.scenic"))
LISTINGS = sorted(path.stem for path in SCENARIOS.glob("*.json"))


def samples(name: str, count: int, params: dict[str, Any] | None = None) -> list[dict[str, Any]]:
    source = open_environment(SCENARIOS / f"{name}.scenic", params or {}, 42)
    return [source.sample(k) for k in range(count)]


@pytest.mark.parametrize("name", PROGRAMS)
def test_carsim_takes_every_scene_and_success_is_defined(name: str, carsim_binary: Path) -> None:
    heights, source = carsim_heights(Carsim(carsim_binary)), open_environment(SCENARIOS / f"{name}.scenic", {}, 42)
    assert source.success.defined
    for scene in (source.sample(k) for k in range(3)):
        x_m, y_m = (numpy.array([scene["start"][key]]) for key in ("x_m", "y_m"))
        assert abs(heights(scene, x_m, y_m)) < 5e-3


# Two have a dozen environments each.
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow if name in ("fidelity", "across") else ()) for name in LISTINGS]
)
def test_listings_are_sound_and_small(name: str) -> None:
    study = read_study(SCENARIOS / f"{name}.json")
    # Of all designs, as it takes seconds to see which of a thousand cannot be built.
    families = [(experiment.family.members, experiment.family.choices.values()) for experiment in study.experiments]
    designs = [len(members) if members is not None else math.prod(map(len, choices)) for members, choices in families]
    runs = sum(count * experiment.environments for count, experiment in zip(designs, study.experiments, strict=True))
    most = {"width_study": 3700, "fidelity": 3700, "across": 2000, "kerb": 1_000_000}
    assert runs <= most.get(name, 500)
    for experiment in study.experiments:
        next(iter(experiment.family))
    environments = {
        repr((experiment.program, experiment.scenic_params, experiment.seed)): experiment
        for experiment in study.experiments
    }
    for experiment in environments.values():
        open_environment(experiment.program, dict(experiment.scenic_params), experiment.seed).sample(0)


@pytest.mark.parametrize("name", LISTINGS)
@pytest.mark.slow
def test_every_experiment_runs_in_both_engines(name: str, tmp_path: Path) -> None:
    """One car of each in two samples: each engine gives each run a result, a result of its own."""
    try:
        carsims = [Carsim(engine=engine) for engine in (MULTIBODY, MUJOCO)]
    except CarsimError as error:
        pytest.skip(str(error))
    study = read_study(SCENARIOS / f"{name}.json", environments=2)
    first = [
        replace(
            experiment,
            family=replace(
                experiment.family, choices={key: choice[:1] for key, choice in experiment.family.choices.items()}
            ),
        )
        for experiment in study.experiments
    ]
    study = replace(study, experiments=tuple(first))
    # Compiled once for both.
    environments = {experiment.place: ExperimentEnvironment(experiment) for experiment in first}
    for carsim in carsims:
        named = engine_study(study, carsim)
        Sweep(named, tmp_path / "s.db", carsim, "", lambda experiment: environments[experiment.place]).run(1)

    with Store.open(tmp_path / "s.db") as store:
        in_multibody, in_mujoco = (
            [result for experiment in first for result in store.results(engine_id(experiment.id, carsim.engine))]
            for carsim in carsims
        )
    assert len(in_multibody) == 2 * len(first)
    for run, other_run in zip(in_multibody, in_mujoco, strict=True):
        assert (run.sample, run.design) == (other_run.sample, other_run.design)
        for result in (run, other_run):
            assert result.outcome != "failed" and result.metrics["elapsed_time_s"] > 0
            assert result.metrics["consumed_energy_j"] > 0
        assert run.metrics != other_run.metrics


def test_figure_10_has_a_bump_for_each_side() -> None:
    (scene,) = samples("paper_bumps", 1)
    assert scene["goal"] is None
    assert scene["start"] == {"x_m": 0.0, "y_m": 1.0, "heading_rad": pytest.approx(-math.pi / 2)}
    size = {"length_m": 0.1, "width_m": 0.1, "height_m": 0.03, "heading_rad": pytest.approx(math.pi / 2)}
    assert scene["terrain"] == [
        {"kind": "box", "x_m": pytest.approx(x_m), "y_m": pytest.approx(0), **size} for x_m in (-0.1, 0.1)
    ]


def test_figure_11_moves_the_start_and_both_bumps_and_turns_the_car_to_the_end() -> None:
    scenes = samples("paper_bumps_mutated", 100)
    for scene in scenes:
        left, right = scene["terrain"]
        assert (right["x_m"] - left["x_m"], right["y_m"] - left["y_m"]) == pytest.approx((0.2, 0), abs=3e-9)
    # The end's place is seen in the direction of the car only: x, over a distance of 2 m.
    directions = [(scene["start"]["heading_rad"] + math.pi / 2) * 2 for scene in scenes]
    places = {
        "x_m of the start": ([scene["start"]["x_m"] for scene in scenes], 0.01),
        "y_m of the start": ([scene["start"]["y_m"] - 1 for scene in scenes], 0.01),
        "x_m of a bump": ([scene["terrain"][0]["x_m"] + 0.1 for scene in scenes], 0.01),
        "y_m of a bump": ([scene["terrain"][0]["y_m"] for scene in scenes], 0.01),
        "x_m of the end less that of the start": (directions, math.hypot(0.01, 0.01)),
    }
    for values, sd in places.values():
        assert kstest([value / sd for value in values], "norm").pvalue > 1e-4


def test_figure_12_has_ten_bumps_in_their_region_that_never_intersect() -> None:
    for scene in samples("ten_random_bumps", 30):
        bumps = scene["terrain"]
        assert len(bumps) == 10
        limits = {"x_m": (-1, 1), "y_m": (-0.25, 0.25), "height_m": (0.01, 0.03)}
        for key, (low, high) in {**limits, "length_m": (0.05, 0.1), "width_m": (0.05, 0.1)}.items():
            assert all(low <= bump[key] <= high for bump in bumps)
        assert [bump["heading_rad"] for bump in bumps] == pytest.approx([math.pi / 2] * 10)
        assert scene["start"] == {"x_m": 0.0, "y_m": 1.0, "heading_rad": pytest.approx(-math.pi / 2)}
        assert scene["goal"]["heading_rad"] == pytest.approx(-math.pi / 2)
        for bump, other_bump in combinations(bumps, 2):
            # All face +y: length lies along y.
            apart_x = abs(bump["x_m"] - other_bump["x_m"]) >= (bump["width_m"] + other_bump["width_m"]) / 2
            apart_y = abs(bump["y_m"] - other_bump["y_m"]) >= (bump["length_m"] + other_bump["length_m"]) / 2
            assert apart_x or apart_y
