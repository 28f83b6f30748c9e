"""Sweeps with the real simulator and real environments: what is run and folded, once each; built cars that vary."""

import json
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from itertools import islice
from pathlib import Path
from typing import Any

import pytest

from conftest import PROJECT
from foldcar.car.body import body_json
from foldcar.car.design import Design
from foldcar.car.variation import draw, spread_named
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.results import NUMBERS
from foldcar.simulation.runner import RunRequest
from foldcar.store.check import check_store
from foldcar.study import planned_designs
from foldcar.study.dry_run import fold
from foldcar.study.environments import ExperimentEnvironment
from foldcar.study.experiments import read_study
from swept_listing import WriteListing, rows, swept

Run = Callable[..., tuple[int, int]]


@pytest.fixture
def store(tmp_path: Path) -> Path:
    return tmp_path / "s.db"


@pytest.fixture
def run(store: Path, write_listing: WriteListing, listing_data: Any, carsim_binary: Path) -> Run:
    """A function that sweeps the listing as it is then: how many runs are new, and how many were there."""

    def sweep(file: Path = store, **options: Any) -> tuple[int, int]:
        counts = swept(write_listing(listing_data), file, carsim_binary, **options)
        assert counts.passed == sum(result.outcome == "passed" for result in rows(file))
        return counts.new, counts.reused

    return sweep


def test_every_design_meets_every_environment_and_only_what_is_new_is_run(
    store: Path, listing_data: Any, run: Run
) -> None:
    assert run() == (6, 0)
    assert [(r.design["width_mm"], r.sample) for r in rows(store)] == [(w, k) for w in (95, 245) for k in range(3)]
    assert run() == (0, 6)
    assert run(environments=5) == (4, 6)
    listing_data["vehicles"]["1"]["params"][0]["common"]["width"] = [95, 120, 245]
    assert run() == (3, 6)
    listing_data["experiments"]["again"] = listing_data["experiments"]["1"]
    assert run() == (0, 18)
    listing_data["environments"]["1"]["seed"] = 43
    assert run() == (9, 9)
    listing_data["experiments"]["1"]["params"]["timeout"] = 60
    assert run() == (9, 9)


def test_a_sweep_keeps_out_of_another_studys_store(
    tmp_path: Path, write_listing: WriteListing, listing_data: Any, foldcar: Any, refused: Any
) -> None:
    listing_data["experiments"]["1"]["params"]["environments"] = 1
    listing = write_listing(listing_data)
    assert foldcar("sweep", listing, "--store", "s.db").returncode == 0
    listing.rename(tmp_path / "renamed.json")
    assert foldcar("sweep", "renamed.json", "--store", "s.db").returncode == 0

    listing_data["experiments"] = {"other": listing_data["experiments"]["1"]}
    write_listing(listing_data)

    message = refused("sweep", "listing.json", "--store", "s.db", "--json")
    assert message.startswith("s.db: holds the study of another listing, renamed.json; sweep")
    assert "--store listing.db" in message
    (tmp_path / "s.db").rename(tmp_path / "listing.db")
    assert "--store listing_2.db" in refused("sweep", "listing.json", "--store", "listing.db", "--json")


def test_a_million_designs_are_estimated_from_some_that_are_spread_out(
    write_listing: WriteListing, listing_data: Any
) -> None:
    groups = {"common": ("width", 100), "W": ("length", 60), "B": ("length", 80)}
    listing_data["vehicles"]["1"]["params"] = [
        {group: {name: {"from": first, "to": first + 99, "step": 1}}} for group, (name, first) in groups.items()
    ]
    (experiment,) = read_study(write_listing(listing_data)).experiments
    family = experiment.family
    spread = list(islice(family.spread_out(), 100))
    assert {values[0] // 10 for _, values in spread} == {*range(10, 20)}
    small = family.narrowed({"width": 120, "W.length": 70})
    assert sorted(small.spread_out()) == [(at, (120, 70, 80 + at)) for at in range(100)]

    part, whole_s = fold(family, 0.1)

    members = list(part.members or ())
    assert 0 < len(members) < 10_000 and members == sorted(members)
    assert whole_s >= 0.1 * 1_000_000 / len(members)


def test_rows_do_not_depend_on_jobs(tmp_path: Path, run: Run) -> None:
    run(tmp_path / "one.db", jobs=1, environments=8)
    run(tmp_path / "three.db", jobs=3, environments=8)

    assert rows(tmp_path / "one.db") == rows(tmp_path / "three.db")


def test_equal_environments_are_run_once(store: Path, listing_data: Any, run: Run) -> None:
    listing_data["environments"]["1"]["scenic_params"] = {"position_sd": 1e-12, "heading_sd": 1e-12}

    assert run(environments=20) == (2, 38)
    assert len(rows(store)) == 40


def test_nearby_cars_are_other_runs_and_the_same_for_every_design(store: Path, listing_data: Any, run: Run) -> None:
    params = listing_data["experiments"]["1"]["params"]

    assert run() == (6, 0)
    nominal = rows(store)
    params["variation"] = "workshop"
    assert run() == (6, 0)
    assert run() == (0, 6)
    varied = rows(store)
    params["variation_seed"] = 42
    assert run() == (0, 6)
    params["variation_seed"] = 7
    assert run() == (6, 0)
    assert len({tuple(r.metrics["elapsed_time_s"] for r in runs) for runs in (nominal, varied, rows(store))}) == 3
    connection = sqlite3.connect(store)
    (pairs,) = connection.execute("SELECT count(DISTINCT sample || ' ' || variation_id) FROM result").fetchone()
    connection.close()
    assert pairs == 3
    del params["variation"], params["variation_seed"]
    assert run() == (0, 6)
    assert rows(store) == nominal


def test_a_sweep_does_with_a_nearby_car_what_carsim_does_with_its_body(
    tmp_path: Path, write_listing: WriteListing, listing_data: Any, carsim_binary: Path
) -> None:
    listing_data["experiments"]["1"]["params"]["variation"] = "workshop"
    listing = write_listing(listing_data)
    swept(listing, tmp_path / "s.db", carsim_binary)

    (experiment,) = read_study(listing).experiments
    environment, carsim = ExperimentEnvironment(experiment), Carsim(carsim_binary)
    expected = []
    for design in experiment.family:
        body = body_json(design)
        settings = experiment.settings(design, body, carsim.parameter_table())
        for k in range(3):
            reality = draw(spread_named("workshop", ""), 42, k)
            texts = [json.dumps(part) for part in (body, environment.sample(k), settings, reality)]
            request = RunRequest("car", "scene", texts[2], "", k, texts[3])
            expected += carsim.run({"car": texts[0]}, {"scene": texts[1]}, [request])

    assert [(r.outcome, r.metrics) for r in rows(tmp_path / "s.db")] == [
        (answer["outcome"], {name: answer[name] for name in NUMBERS}) for answer in expected
    ]


def test_cars_are_folded_once_and_again_only_if_they_may_differ(
    store: Path, listing_data: Any, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    folded = list[dict[str, float]]()

    def counted(design: Design) -> dict[str, Any]:
        folded.append(dict(design.values))
        return body_json(design)

    def new_and_folded() -> tuple[int, list[float]]:
        folded.clear()
        return run()[0], [values["width"] for values in folded]

    monkeypatch.setattr(planned_designs, "body_json", counted)
    assert new_and_folded() == (6, [95, 245])
    assert new_and_folded() == (0, [])
    listing_data["vehicles"]["1"]["params"][0]["common"]["width"] = [20, 95, 245]
    # One that cannot be built is no design: the others are the same, under another family.
    assert new_and_folded() == (0, [95, 245])
    assert new_and_folded() == (0, [])
    monkeypatch.setattr(planned_designs, "_code_digest", lambda: "changed")
    assert new_and_folded() == (0, [95, 245])
    with sqlite3.connect(store) as connection:
        connection.execute("DELETE FROM design WHERE position = 1")
    assert new_and_folded() == (0, [95, 245])
    assert new_and_folded() == (0, [])
    assert check_store(store).findings == []


def test_a_module_of_the_users_that_changes_changes_the_designs(tmp_path: Path) -> None:
    """The fingerprint covers the file that --components names, and its neighbours."""
    program = (
        "import sys; from pathlib import Path; from foldcar.car.user_modules import load_components; "
        "from foldcar.study.experiments import read_study; from foldcar.study.planned_designs import *; "
        "load_components(Path(sys.argv[1])); study = read_study(Path(sys.argv[2])); "
        "print(designs_fingerprint(study.experiments[0], {}))"
    )
    part = "from foldcar.car.components.module import Module\nclass Tail(Module):\n    letter, title = 'Tail', 'a tail'\n"
    module = tmp_path / "tail.py"
    listing = PROJECT / "scenarios" / "two_bumps.json"
    fingerprints = []
    for text, neighbour in ((part, ""), (part, ""), (part + "# new\n", ""), (part + "# new\n", "lid = 1\n")):
        module.write_text(text)
        (tmp_path / "lid.py").write_text(neighbour)
        done = subprocess.run(
            [sys.executable, "-c", program, module, listing], capture_output=True, text=True, check=True
        )
        fingerprints.append(done.stdout)
    assert fingerprints[0] == fingerprints[1] and len(set(fingerprints)) == 3
