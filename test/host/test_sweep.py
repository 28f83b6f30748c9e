"""Sweeps with the real simulator and real environments: what is run, once each, whatever the jobs; nearby cars."""

import json
import sqlite3
from pathlib import Path
from typing import Any

from foldcar.car.body import body_json
from foldcar.car.variation import draw, spread_named, vary_body
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.results import NUMBERS
from foldcar.simulation.runner import RunRequest
from foldcar.study.environments import Environment
from foldcar.study.experiments import read_study
from swept_listing import WriteListing, rows, swept


def test_every_design_meets_every_environment(
    tmp_path: Path, write_listing: WriteListing, listing_data: Any, carsim_binary: Path
) -> None:
    counts = swept(write_listing(listing_data), tmp_path / "s.db", carsim_binary)

    results = rows(tmp_path / "s.db")
    assert [(r.design["width_mm"], r.sample) for r in results] == [(w, k) for w in (95, 245) for k in range(3)]
    assert (counts.new, counts.there, counts.total) == (6, 0, 6)
    assert counts.passed == sum(r.outcome == "passed" for r in results)


def test_only_what_is_new_is_run(
    tmp_path: Path, write_listing: WriteListing, listing_data: Any, carsim_binary: Path
) -> None:
    store = tmp_path / "s.db"

    def run(**options: Any) -> tuple[int, int]:
        counts = swept(write_listing(listing_data), store, carsim_binary, **options)
        return counts.new, counts.there

    assert run() == (6, 0)
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


def test_rows_do_not_depend_on_jobs(
    tmp_path: Path, write_listing: WriteListing, listing_data: Any, carsim_binary: Path
) -> None:
    listing = write_listing(listing_data)

    swept(listing, tmp_path / "one.db", carsim_binary, jobs=1, environments=8)
    swept(listing, tmp_path / "three.db", carsim_binary, jobs=3, environments=8)

    assert rows(tmp_path / "one.db") == rows(tmp_path / "three.db")


def test_equal_environments_are_run_once(
    tmp_path: Path, write_listing: WriteListing, listing_data: Any, carsim_binary: Path
) -> None:
    listing_data["environments"]["1"]["scenic_params"] = {"position_sd": 1e-12, "heading_sd": 1e-12}

    counts = swept(write_listing(listing_data), tmp_path / "s.db", carsim_binary, environments=20)

    assert (counts.new, counts.there) == (2, 38)
    results = rows(tmp_path / "s.db")
    assert len(results) == 40
    assert counts.passed == sum(result.outcome == "passed" for result in results)


def test_nearby_cars_are_other_runs_and_the_same_for_every_design(
    tmp_path: Path, write_listing: WriteListing, listing_data: Any, carsim_binary: Path
) -> None:
    store, params = tmp_path / "s.db", listing_data["experiments"]["1"]["params"]

    def run() -> tuple[int, int]:
        counts = swept(write_listing(listing_data), store, carsim_binary)
        return counts.new, counts.there

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
    assert len({tuple(r.metrics["elapsed_time_s"] for r in some) for some in (nominal, varied, rows(store))}) == 3
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
    environment, carsim = Environment(experiment), Carsim(carsim_binary)
    expected = []
    for design in experiment.family:
        body = body_json(design)
        settings = experiment.settings(design, body, carsim.parameter_table())
        for k in range(3):
            car = vary_body(body, draw(spread_named("workshop", ""), 42, k), carsim.limits().numbers)
            texts = [json.dumps(part) for part in (car, environment.sample(k), settings)]
            request = RunRequest("car", "scene", texts[2], "", k)
            expected += carsim.run({"car": texts[0]}, {"scene": texts[1]}, [request])

    assert [(r.outcome, r.metrics) for r in rows(tmp_path / "s.db")] == [
        (answer["outcome"], {name: answer[name] for name in NUMBERS}) for answer in expected
    ]
