"""The side view from the commands: where its two sides would differ, sweep, run, report and advice say so."""

import json
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from browser import study_of
from foldcar.store.reader import Store
from foldcar.study.side_view_check import one_sided
from study_car import car_body, empty_scene, run_carsim

Command = Callable[..., "subprocess.CompletedProcess[str]"]


def swept(foldcar: Command, listing: Path, store: str, *words: Any) -> "subprocess.CompletedProcess[str]":
    done = foldcar("sweep", listing, "--store", store, "--engine", "side-view", *words)
    assert done.returncode == 0, done.stderr
    return done


@pytest.fixture
def listing_of(listing_data: Any, write_listing: Any, tmp_path: Path) -> Callable[..., Path]:
    """A function that writes a listing of one object on the way to a goal; more settings are the experiment's."""

    def make(obstacle: str, **params: Any) -> Path:
        program = tmp_path / "way.scenic"
        goal = "goal = new Goal at (1, 0), facing -90 deg\nego = new Robot at (0, 0), facing goal\n"
        program.write_text("\n".join(("model model", obstacle, goal)))
        listing_data["environments"]["1"] = {"scenic_filename": str(program), "seed": 1}
        listing_data["experiments"]["1"]["params"] |= {"timeout": 20, **params}
        file: Path = write_listing(listing_data)
        return file

    return make


ACROSS = "new Bump at (0.4, 0), facing -90 deg, with length 0.06, with width 1, with height 0.012"
PATCH = "new FrictionPatch at (0.4, 0.5), facing -90 deg"


def test_across_the_course_it_warns_of_nothing_and_passes(
    tmp_path: Path, foldcar: Command, listing_of: Callable[..., Path]
) -> None:
    done = swept(foldcar, listing_of(ACROSS), "s.db")

    assert "differ" not in done.stderr + done.stdout
    with Store.open(tmp_path / "s.db") as store:
        info = store.info().experiments["1 (side-view)"]
        results = list(store.results("1 (side-view)"))
    assert (info.engine, info.warning) == ("side-view", "")
    assert info.carsim_build.endswith(" side-view")
    assert results and all(result.outcome == "passed" for result in results)


TURNED = ACROSS.replace("-90 deg", "-80 deg")


@pytest.mark.parametrize(
    ("obstacle", "named"),
    [
        (TURNED, "ground (not the same under both tracks in sample 0)"),
        ("ramp = new Ramp at (0.9, 0), facing -90 deg, with height 0.06", "off a crest (ramp of 60 mm in sample 0)"),
        (f"{PATCH}, with length 0.5, with width 1, with friction 0.1", "ground (not the same"),
    ],
)
def test_what_differs_from_side_to_side_is_named(
    foldcar: Command, listing_of: Callable[..., Path], obstacle: str, named: str
) -> None:
    done = foldcar("run", listing_of(obstacle), "--experiment", "1", "--set", "width=95", "--engine", "side-view")

    (line,) = [line for line in done.stderr.splitlines() if "which matter here" in line]
    assert named in line and line.endswith("Use --engine multibody.")


def test_it_is_named_by_the_sweep_and_wherever_its_rates_are_shown(
    tmp_path: Path, foldcar: Command, listing_of: Callable[..., Path]
) -> None:
    listing, named = listing_of(TURNED), "ground (not the same under both tracks"

    done = swept(foldcar, listing, "s.db")

    (line,) = [line for line in done.stderr.splitlines() if "which matter here" in line]
    assert line.startswith("experiment 1 (side-view): ") and named in line and line.endswith("Use --engine multibody.")
    warning = line.partition(": ")[2]
    page = foldcar("report", "s.db", "-o", "page")
    assert warning in " ".join(page.stdout.split())
    assert json.dumps(named)[1:-1] in (tmp_path / "page" / "index.html").read_text()
    assert warning in study_of(tmp_path / "page")["experiments"][0]["remarks"]
    assert named in " ".join(foldcar("select", "s.db").stdout.split())
    assert "which matter here" not in foldcar("sweep", listing, "--store", "s.db").stderr


def test_a_segment_too_heavy_for_its_wheels_fails_with_its_numbers(carsim_binary: Path) -> None:
    body = car_body()
    body["segments"][0]["mass_kg"] = 101 * 2 * body["wheels"][0]["mass_kg"]
    run = {"id": "r", "body": "b", "scene": "s", "speed_m_s": 0.3, "time_limit_s": 1}
    lines = [{"body": {**body, "id": "b"}}, {"scene": {**empty_scene(), "id": "s"}}, {"run": run}]

    done = run_carsim(carsim_binary, lines, "--side-view", "batch")

    error = json.loads(done.stdout)["error"]
    assert (done.returncode, error["run"]) == (2, "r")
    assert "more than 100 times as heavy as a pair of wheels" in error["message"]


def test_cars_that_vary_wheel_by_wheel_have_unlike_sides(foldcar: Command, listing_of: Callable[..., Path]) -> None:
    listing = listing_of(ACROSS, variation="workshop")

    assert "the cars' sides (built cars vary" in swept(foldcar, listing, "s.db").stderr


def test_a_body_is_one_sided_by_its_mass_or_any_pair_of_wheels() -> None:
    body = car_body()
    assert one_sided(body) == ""
    aside = json.loads(json.dumps(body))
    aside["segments"][0]["com_y_m"] = -0.05 * body["track_m"]
    assert one_sided(aside) == "the centre of mass"
    for change, named in (
        ({"radius_m": 0.0605}, "radius"),
        ({"grip": 0.9}, "grip"),
        ({"servo": {**body["wheels"][0]["servo"], "stall_torque_n_m": 0.12}}, "stall torque"),
        ({"servo": {**body["wheels"][0]["servo"], "no_load_speed_rad_s": 10.0}}, "no-load speed"),
    ):
        other = json.loads(json.dumps(body))
        other["wheels"][0] |= change
        assert one_sided(other) == named
