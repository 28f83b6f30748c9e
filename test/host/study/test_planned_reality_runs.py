"""What is learned of built cars comes from the runs that a sweep planned, whatever other runs the store has."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from foldcar.evidence.belief import learned_rate
from foldcar.store.reader import Store
from foldcar.store.reality_runs import RealityRuns, read_reality_runs
from foldcar.study.reality_draws import draw_runs
from foldcar.study.reality_runs import planned_reality_runs
from study_car import listing_of
from swept_listing import STEP_PYRAMIDS, foldcar, swept

RUNS, SAMPLES = 300, 24
WIDE, NARROW = [95, 170, 245], [95, 170]


def write_listing(folder: Path, samples: int = SAMPLES, **widths_of: list[int]) -> Path:
    """A listing with an experiment for each name, all in the same environment."""
    listing: dict[str, Any] = listing_of(STEP_PYRAMIDS, {}, timeout=60, environments=samples)
    (experiment,), (vehicle,) = listing["experiments"].values(), listing["vehicles"].values()
    listing["experiments"] = {name: {**experiment, "veh_id": name} for name in widths_of}
    listing["vehicles"] = {
        name: {**vehicle, "params": [{"common": {"width": widths}}]} for name, widths in widths_of.items()
    }
    file = folder / "l.json"
    file.write_text(json.dumps(listing))
    return file


def planned(store: Path, experiment: str) -> tuple[RealityRuns, int]:
    """The planned runs, and how many runs of the experiment's designs and scenes the store has."""
    with Store.open(store) as opened:
        info = opened.info().experiments[experiment]
        runs = planned_reality_runs(opened, experiment, info.variation_seed, info.environments)
        learned = learned_rate(opened, info)
        assert learned is not None and learned.runs == len(runs) == RUNS
        drawn = draw_runs(info.variation_seed, range(RUNS), len(opened.designs(experiment)), info.environments)
        stored = len(read_reality_runs(opened, experiment))
    for name in ("number", "scores", "design", "sample"):
        assert np.array_equal(getattr(runs, name), getattr(drawn, name))
    return runs, stored


def assert_equal(runs: RealityRuns, others: RealityRuns) -> None:
    assert np.array_equal(runs.passed, others.passed) and np.array_equal(runs.number, others.number)


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory, carsim_binary: Path) -> RealityRuns:
    """The runs of an experiment that is alone in its store."""
    folder = tmp_path_factory.mktemp("alone")
    swept(write_listing(folder, wide=WIDE), folder / "s.db", carsim_binary, realities=RUNS)
    runs, stored = planned(folder / "s.db", "wide")
    assert stored == RUNS
    return runs


def test_another_experiment_with_the_same_designs_and_scenes_changes_nothing(
    alone: RealityRuns, tmp_path: Path, carsim_binary: Path
) -> None:
    listing = write_listing(tmp_path, wide=WIDE, narrow=NARROW)

    first = swept(listing, tmp_path / "s.db", carsim_binary, realities=RUNS)
    again = swept(listing, tmp_path / "s.db", carsim_binary, realities=RUNS)

    runs, stored = planned(tmp_path / "s.db", "wide")
    assert stored > RUNS and planned(tmp_path / "s.db", "narrow")[1] > RUNS
    assert_equal(runs, alone)
    # A repeated sweep states the same error, and so does `foldcar select`.
    errors = {name: counts.error for name, counts in first.realities.items()}
    assert errors == {name: counts.error for name, counts in again.realities.items()}
    with Store.open(tmp_path / "s.db") as opened:
        learned = [learned_rate(opened, opened.info().experiments[name]) for name in errors]
    assert [rate and rate.error for rate in learned] == list(errors.values())
    assert f"learned from {RUNS} runs in other realities" in foldcar("select", tmp_path / "s.db")


@pytest.mark.parametrize(("samples", "widths"), [(SAMPLES, NARROW), (SAMPLES - 4, WIDE)])
def test_runs_of_an_earlier_family_or_of_fewer_samples_change_nothing(
    alone: RealityRuns, samples: int, widths: list[int], tmp_path: Path, carsim_binary: Path
) -> None:
    swept(write_listing(tmp_path, samples, wide=widths), tmp_path / "s.db", carsim_binary, realities=RUNS)

    swept(write_listing(tmp_path, wide=WIDE), tmp_path / "s.db", carsim_binary, realities=RUNS)

    runs, stored = planned(tmp_path / "s.db", "wide")
    assert stored > RUNS
    assert_equal(runs, alone)
