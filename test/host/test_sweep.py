"""Sweeps with the real simulator and real environments: resumption, job counts, interruption, refusals."""

import json
import os
import random
import resource
import shlex
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from foldcar.car.body import body_json
from foldcar.car.design import Design
from foldcar.car.variation.spread import draw, spread_named
from foldcar.car.variation.vary_body import vary_body
from foldcar.errors import FoldcarError
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.results import NUMBERS, Result
from foldcar.simulation.runner import RunRequest
from foldcar.store.check import check_store
from foldcar.store.reader import Store
from foldcar.study import planned_designs
from foldcar.study.environments import Environment
from foldcar.study.experiments import read_study
from foldcar.study.progress import Progress
from foldcar.study.sweep import sweep
from forked_foldcar import ForkedProcess, original

WriteListing = Callable[[Any], Path]


def swept(
    listing: Path, store: Path, carsim: Path, jobs: int = 2, environments: int | None = None
) -> Progress:
    return sweep(
        read_study(listing, environments=environments), store, Carsim(carsim), jobs, "foldcar sweep …"
    )


def rows(store: Path) -> list[Result]:
    with Store.open(store) as opened:
        return list(opened.results())


def test_every_design_meets_every_environment(
    tmp_path: Path, write_listing: WriteListing, listing_data: Any, carsim_binary: Path
) -> None:
    counts = swept(write_listing(listing_data), tmp_path / "s.db", carsim_binary)

    results = rows(tmp_path / "s.db")
    assert [(r.design["width_mm"], r.sample) for r in results] == [
        (w, k) for w in (95, 245) for k in range(3)
    ]
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


def test_cars_are_folded_once_and_again_only_if_they_may_differ(
    tmp_path: Path, write_listing: WriteListing, listing_data: Any, carsim_binary: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store, folded = tmp_path / "s.db", list[dict[str, float]]()

    def counted(design: Design) -> dict[str, Any]:
        folded.append(dict(design.values))
        return body_json(design)

    def run() -> tuple[int, list[float]]:
        folded.clear()
        counts = swept(write_listing(listing_data), store, carsim_binary)
        return counts.new, [values["width"] for values in folded]

    monkeypatch.setattr(planned_designs, "body_json", counted)
    assert run() == (6, [95, 245])
    assert run() == (0, [])
    listing_data["vehicles"]["1"]["params"][0]["common"]["width"] = [20, 95, 245]
    # One that cannot be built is no design: the others are the same, under another family.
    assert run() == (0, [95, 245])
    assert run() == (0, [])
    monkeypatch.setattr(planned_designs, "_code", lambda: "changed")
    assert run() == (0, [95, 245])
    with sqlite3.connect(store) as connection:
        connection.execute("UPDATE design SET parameters = '{}' WHERE position = 1")
    assert run() == (0, [95, 245])
    with sqlite3.connect(store) as connection:
        connection.execute("DELETE FROM design WHERE position = 1")
    assert run() == (0, [95, 245])
    assert run() == (0, [])
    assert check_store(store).findings == []


def test_a_module_of_the_users_that_changes_changes_the_designs(tmp_path: Path) -> None:
    """The fingerprint covers the file that --components names, and its neighbours."""
    told = "import sys; from pathlib import Path; from foldcar.car.user_modules import load_components; " \
        "from foldcar.study.experiments import read_study; from foldcar.study.planned_designs import *; " \
        "load_components(Path(sys.argv[1])); study = read_study(Path(sys.argv[2])); " \
        "print(designs_fingerprint(study.experiments[0], {}))"
    part = "from foldcar.car.components.module import Module\nclass Tail(Module):\n    letter, title = 'Tail', 'a tail'\n"
    module = tmp_path / "tail.py"
    listing = Path(__file__).resolve().parents[2] / "scenarios" / "two_bumps.json"
    found = []
    for text, neighbour in ((part, ""), (part, ""), (part + "# new\n", ""), (part + "# new\n", "lid = 1\n")):
        module.write_text(text)
        (tmp_path / "lid.py").write_text(neighbour)
        done = subprocess.run([sys.executable, "-c", told, module, listing], capture_output=True, text=True, check=True)
        found.append(done.stdout)
    assert found[0] == found[1] and len(set(found)) == 3


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
    (pairs,) = connection.execute(
        "SELECT count(DISTINCT sample || ' ' || variation_id) FROM result"
    ).fetchone()
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


def start(listing: Path, store: Path, carsim: Path, environments: int) -> ForkedProcess:
    words = ["sweep", str(listing), "--store", str(store), "--environments", str(environments), "--jobs", "2"]
    return original().start(words, listing.parent, {**os.environ, "FOLDCAR_CARSIM": str(carsim)})


def stored_runs(store: Path) -> int:
    """How many runs a store has while it is being written; 0 before it is one."""
    try:
        with Store.open(store) as opened:
            return sum(experiment.stored_runs for experiment in opened.info().experiments.values())
    except FoldcarError:
        return 0


def test_killed_at_random_and_resumed_the_rows_are_the_same(
    tmp_path: Path, write_listing: WriteListing, listing_data: Any, carsim_binary: Path
) -> None:
    listing_data["vehicles"]["1"]["params"][0]["common"]["width"] = {"from": 65, "to": 245, "step": 90}
    listing, environments, pause = write_listing(listing_data), 60, random.Random(1)
    swept(listing, tmp_path / "alone.db", carsim_binary, environments=environments)

    seen = 0
    for _ in range(3):
        process = start(listing, tmp_path / "killed.db", carsim_binary, environments)
        while process.poll() is None and stored_runs(tmp_path / "killed.db") <= seen:
            time.sleep(0.02)
        time.sleep(0.2 * pause.random())
        process.kill()
        process.communicate()
        assert stored_runs(tmp_path / "killed.db") >= seen
        seen = stored_runs(tmp_path / "killed.db")
    counts = swept(listing, tmp_path / "killed.db", carsim_binary, environments=environments)

    assert counts.there == seen > 0
    assert rows(tmp_path / "killed.db") == rows(tmp_path / "alone.db")


def test_ctrl_c_stops_keeps_and_says_how_to_go_on(
    tmp_path: Path, write_listing: WriteListing, listing_data: Any, carsim_binary: Path
) -> None:
    process = start(write_listing(listing_data), tmp_path / "s.db", carsim_binary, 5000)
    while process.poll() is None and stored_runs(tmp_path / "s.db") == 0:
        time.sleep(0.05)

    process.send_signal(signal.SIGINT)
    output, errors = process.communicate(timeout=100)

    assert process.returncode == 130
    stored = stored_runs(tmp_path / "s.db")
    assert 0 < stored < 10000
    rule = "experiment 1: a run has passed if it reaches its Goal, within the time limit\n"
    assert errors == f"{rule}stopped: {stored} of 10000 runs are stored in {tmp_path / 's.db'}; " \
        "the same command resumes\n"  # fmt: skip
    assert output == ""
    assert sorted(file.name for file in tmp_path.iterdir()) == ["listing.json", "s.db"]


def test_a_full_disk_is_one_line_and_loses_nothing(
    tmp_path: Path, write_listing: WriteListing, listing_data: Any, carsim_binary: Path, new_foldcar: Any
) -> None:
    listing = write_listing(listing_data)
    swept(listing, tmp_path / "s.db", carsim_binary)
    limit = (tmp_path / "s.db").stat().st_size + 60_000

    answer = new_foldcar(
        "sweep", listing, "--store", "s.db", "--environments", "2000",
        env={**os.environ, "FOLDCAR_CARSIM": str(carsim_binary)},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)),
    )  # fmt: skip

    assert answer.returncode == 2
    rule, error = answer.stderr.splitlines()
    assert rule.startswith("experiment 1: a run has passed if") and error.startswith("foldcar: error: s.db: ")
    assert len(rows(tmp_path / "s.db")) >= 6


def simulator(tmp_path: Path, carsim: Path, batch: str) -> Path:
    """A program like carsim with another command `batch`."""
    script = tmp_path / "broken-carsim"
    script.write_text(f'#!/bin/sh\n[ "$1" = batch ] || exec {shlex.quote(str(carsim))} "$@"\n{batch}\n')
    script.chmod(0o755)
    return script


@pytest.mark.parametrize(
    ("batch", "message"),
    [
        ("cat > /dev/null; echo oops >&2; exit 3", "exit code 3 (oops) after 0 of "),
        ("cat > /dev/null", "exit code 0 after 0 of "),
        ("cat > /dev/null; echo '[]'", "answered what is no result: []"),
        ('cat > /dev/null; echo \'{"outcome": "flew"}\'', "answered an impossible result: "),
    ],
)
def test_a_simulator_that_breaks_down_is_named(
    tmp_path: Path,
    write_listing: WriteListing,
    listing_data: Any,
    carsim_binary: Path,
    batch: str,
    message: str,
) -> None:
    broken = simulator(tmp_path, carsim_binary, batch)

    with pytest.raises(FoldcarError) as caught:
        swept(write_listing(listing_data), tmp_path / "s.db", broken)

    assert str(caught.value).startswith(f"{broken}: {message}")


# Runs carsim's batch, but dies of a signal when it comes to a run of the first sample's scene.
DYING = """#!/usr/bin/env python3
import json, os, signal, subprocess, sys

if sys.argv[1] != "batch":
    os.execv({carsim!r}, ["carsim", *sys.argv[1:]])
process = subprocess.Popen([{carsim!r}, "batch"], stdin=subprocess.PIPE, text=True)
for line in sys.stdin:
    dies = '"run"' in line and json.loads(line)["run"]["scene"] == "s1"
    if dies:
        break
    process.stdin.write(line)
process.communicate()
if dies:
    print("box2d: assertion failed", file=sys.stderr, flush=True)
    os.kill(os.getpid(), signal.SIGABRT)
sys.exit(process.returncode)
"""


def test_a_run_that_crashes_is_a_result_and_the_rest_goes_on(
    tmp_path: Path, write_listing: WriteListing, listing_data: Any, carsim_binary: Path, foldcar: Any
) -> None:
    dying = tmp_path / "dying-carsim"
    dying.write_text(DYING.format(carsim=str(carsim_binary)))
    dying.chmod(0o755)
    listing = write_listing(listing_data)
    words = ("sweep", listing, "--store", "s.db", "--jobs", "1")
    swept(listing, tmp_path / "whole.db", carsim_binary)

    crashing = foldcar(*words, env={**os.environ, "FOLDCAR_CARSIM": str(dying)})
    again = foldcar(*words, env={**os.environ, "FOLDCAR_CARSIM": str(carsim_binary)})
    report = foldcar("report", "s.db", "-o", "report")

    assert crashing.returncode == 1
    assert "2 of 6 runs failed and count as not passed:\n  2 x the simulation crashed" in crashing.stderr
    results, whole = rows(tmp_path / "s.db"), rows(tmp_path / "whole.db")
    assert [result.sample for result in results if result.outcome == "failed"] == [0, 0]
    assert {result.message for result in results if result.sample == 0} == {
        "the simulation crashed (killed by SIGABRT (box2d: assertion failed))"
    }
    assert [result for result in results if result.sample] == [result for result in whole if result.sample]
    assert " % passed, 2 failed; store: s.db\n" in crashing.stdout
    # Failed runs are not repeated until the simulator changes.
    assert again.stdout.startswith("0 runs new, 6 there already, ")
    assert " % passed, 2 failed; store: s.db\n" in again.stdout
    assert "2 of 6 runs failed" in report.stdout
    assert "2 of 6 runs failed" in (tmp_path / "report" / "index.html").read_text()


def test_what_the_simulator_refuses_is_told_with_the_run(
    tmp_path: Path, write_listing: WriteListing, listing_data: Any, carsim_binary: Path
) -> None:
    listing_data["environments"]["1"]["scenic_params"] = {"friction": 1e6}

    with pytest.raises(FoldcarError) as caught:
        swept(write_listing(listing_data), tmp_path / "s.db", carsim_binary)

    assert "friction" in str(caught.value)


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("vehicles", "1", "params", 0, "common", "width"), [20]),
        (("vehicles", "1", "params", 0, "common", "width"), [50, 55]),
        (("environments", "1", "scenic_params"), {"no_such_param": 1}),
        (("experiments", "1", "params", "timeout"), 1e9),
    ],
)
def test_a_study_that_cannot_run_leaves_no_store(
    tmp_path: Path,
    write_listing: WriteListing,
    listing_data: Any,
    carsim_binary: Path,
    path: tuple[str | int, ...],
    value: Any,
) -> None:
    node = listing_data
    for step in path[:-1]:
        node = node[step]
    node[path[-1]] = value

    with pytest.raises(FoldcarError):
        swept(write_listing(listing_data), tmp_path / "folder" / "s.db", carsim_binary)

    assert not (tmp_path / "folder").exists()
