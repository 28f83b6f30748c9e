"""Sweeps of dynamic programs: worker processes, the store, the export."""

import contextlib
import csv
import json
import sqlite3
from pathlib import Path
from typing import Any

import pytest

from foldcar.car.body import body_json
from foldcar.scenes.source import open_environment
from foldcar.simulation import scenic_worker
from foldcar.simulation.carsim import Carsim
from foldcar.store.reader import Store
from foldcar.study.experiments import read_study
from swept_listing import WriteListing, rows, swept

HEAD = "model model\nego = new Robot at (Range(0, 0.02), 0), facing -90 deg\n"
GOAL = "goal = new Goal at (0.8, 0), facing -90 deg\nnew Bump at (0.4, 0), facing -90 deg, with height 0.01\n"
RECORDS = (
    "record initial ego.position.x as begin\nrecord final ego.position as end\nrecord ego.speed as speed\n"
    "record final simulation().currentRealTime as elapsed\n"
    # This needs Scenic beside carsim.
    "monitor Watch():\n    while True:\n        wait\nrequire monitor Watch()\n"
)


@pytest.fixture
def program(tmp_path: Path) -> Path:
    return tmp_path / "program.scenic"


@pytest.fixture
def listing(write_listing: WriteListing, listing_data: Any, program: Path) -> Path:
    """One width, three samples of ``program``."""
    listing_data["environments"]["1"]["scenic_filename"] = program.name
    listing_data["vehicles"]["1"]["params"][0]["common"]["width"] = 95
    return write_listing(listing_data)


def answers(listing: Path, carsim: Path, *samples: int) -> list[dict[str, Any]]:
    """What a worker answers to runs of the first design in these samples of program.scenic, beside the listing."""
    program, design = listing.with_name("program.scenic"), next(iter(read_study(listing).experiments[0].family))
    facts = {"program": str(program), "params": {}, "seed": 42, "condition": None, "files": None}
    source, body = open_environment(program, {}, 42), body_json(design)
    settings = read_study(listing).experiments[0].settings(design, body, Carsim(carsim).parameter_table())
    texts = {"body": json.dumps(body), "settings": json.dumps(settings)}
    with contextlib.closing(scenic_worker.ScenicWorker({**facts, "command": [str(carsim)]})) as worker:
        scenes = {k: json.dumps(source.sample(k)) for k in samples}
        return [worker.answer({**texts, "scene": scenes[k], "sample": k}) for k in samples]


def shown(store: Path, columns: str) -> list[Any]:
    connection = sqlite3.connect(store)
    try:
        return connection.execute(f"SELECT {columns} FROM result ORDER BY design_position, sample").fetchall()
    finally:
        connection.close()


def test_both_ways_store_the_same_and_recorded_values_reach_store_and_export(
    tmp_path: Path, listing: Path, program: Path, carsim_binary: Path, foldcar: Any
) -> None:
    program.write_text(HEAD + GOAL)
    swept(listing, tmp_path / "native.db", carsim_binary)
    native = rows(tmp_path / "native.db")
    program.write_text(HEAD + GOAL + RECORDS)
    store = tmp_path / "s.db"
    done = foldcar("sweep", listing, "--store", store, "--jobs", "1")
    assert done.returncode == 0, done.stderr

    with Store.open(store) as opened:
        assert [(r.outcome, r.metrics) for r in opened.results()] == [(r.outcome, r.metrics) for r in native]
    assert "passed" in {r.outcome for r in native}
    stored = shown(store, "recorded, elapsed_time_s, sample")
    connection = sqlite3.connect(store)
    starts = dict(
        connection.execute(
            "SELECT sample, json_extract(json, '$.start.x_m') FROM sample JOIN scene ON scene.id = scene_id"
        ).fetchall()
    )
    connection.close()
    for text, elapsed_s, sample in stored:
        recorded = json.loads(text)
        assert {name: entry["kind"] for name, entry in recorded.items()} == {
            "begin": "initial", "end": "final", "speed": "series", "elapsed": "final"
        }  # fmt: skip
        # The car settles by less than 0.1 mm before the trial begins.
        assert recorded["begin"]["value"] == pytest.approx(starts[sample], abs=1e-4)
        assert recorded["elapsed"]["value"] == elapsed_s
        times = [t_s for t_s, _ in recorded["speed"]["value"]]
        assert times[:3] == [0, 0.25, 0.5]
        assert times[-1] == elapsed_s

    assert foldcar("export", store, "--csv", tmp_path / "runs.csv").returncode == 0
    with (tmp_path / "runs.csv").open(newline="") as file:
        exported = list(csv.DictReader(file))
    assert len(exported) == len(stored) == 3
    for row, (text, _, _) in zip(exported, stored, strict=True):
        recorded = json.loads(text)
        assert float(row["recorded_begin"]) == recorded["begin"]["value"]
        assert json.loads(row["recorded_speed"]) == recorded["speed"]["value"]
        assert json.loads(row["recorded_end"]) == recorded["end"]["value"]


# Each changes something and records how often that was done, this run included.
LEAKS = (
    "seen = []\ndef noted():\n    seen.append(1)\n    return len(seen)\nrecord final noted() as list\n",
    "deep = [[]]\ndef dive():\n    deep[0].append(1)\n    return len(deep[0])\nrecord final dive() as list_in_a_list\n",
    "post = new Marker at (0.3, 0.3), with name 1\nmonitor M():\n    post.name += 1\n    wait\n"
    "require monitor M()\nrecord final post.name - 1 as attribute\n",
    "pole = new Marker at (0.3, 0.4), with name []\nmonitor N():\n    pole.name.append(1)\n    wait\n"
    "require monitor N()\nrecord final len(pole.name) as list_in_an_attribute\n",
    "param seen = [0]\nmonitor O():\n    globalParameters.seen[0] += 1\n    wait\nrequire monitor O()\n"
    "record final globalParameters.seen[0] as parameter\n",
    "import itertools\nnumbers = itertools.count(1)\nrecord final numbers.__next__() as iterator\n",
    "import colorsys\ncolorsys.seen = 0\nmonitor P():\n    colorsys.seen += 1\n    wait\n"
    "require monitor P()\nrecord final colorsys.seen as module\n",
    "drawn = []\ndef draw(x):\n    drawn.append(x)\n    return True\nrequire draw(ego.position.x)\n"
    "record final len(drawn) as sampling\n",
)
SETUP = (
    "model model\nmonitor M(seen):\n    seen.append(1)\n    wait\n"
    "scenario Main():\n    setup:\n        ego = new Robot at (Range(0, 0.02), 0), facing -90 deg\n"
    "        new Goal at (0.8, 0), facing -90 deg\n        seen = []\n        require monitor M(seen)\n"
    "        record final len(seen) as count\n    compose:\n        while True:\n            wait\n"
)


@pytest.mark.parametrize("text", [HEAD + GOAL + "".join(LEAKS), SETUP], ids=["leaks", "setup"])
def test_a_run_begins_as_if_it_were_the_first(listing: Path, program: Path, carsim_binary: Path, text: str) -> None:
    """Three runs of one worker, the samples in any order, in another worker too."""
    program.write_text(text)

    first, again, other = answers(listing, carsim_binary, 0, 0, 1)

    recorded = first["result"]["recorded"]
    assert {name: entry["value"] for name, entry in recorded.items()} == dict.fromkeys(recorded, 1)
    assert again == first
    assert [other, first] == answers(listing, carsim_binary, 1, 0)


def test_rows_do_not_depend_on_jobs(tmp_path: Path, listing: Path, program: Path, carsim_binary: Path) -> None:
    program.write_text(HEAD + GOAL + "import random\n" + LEAKS[0] + "record final random.random() as chance\n")
    counts = swept(listing, tmp_path / "one.db", carsim_binary, jobs=1)
    swept(listing, tmp_path / "two.db", carsim_binary, jobs=2)
    assert counts.failed == 0
    recorded = [json.loads(text) for (text,) in shown(tmp_path / "one.db", "recorded")]
    assert {values["list"]["value"] for values in recorded} == {1}
    assert len({values["chance"]["value"] for values in recorded}) == 3
    assert shown(tmp_path / "one.db", "*") == shown(tmp_path / "two.db", "*")
    assert len(rows(tmp_path / "one.db")) == 3


def test_a_violated_precondition_rejects_its_own_run_only(
    tmp_path: Path, listing: Path, program: Path, carsim_binary: Path
) -> None:
    program.write_text(
        "model model\nscenario Main():\n    precondition: ego.position.x > 0.005\n    setup:\n"
        "        ego = new Robot at (Range(0, 0.02), 0), facing -90 deg\n        record final 1 as one\n"
        "    compose:\n        while ego.position.x < 0.1:\n            wait\n"
    )
    counts, results = swept(listing, tmp_path / "s.db", carsim_binary, 1), rows(tmp_path / "s.db")
    starts = {k: scene["start"]["x_m"] for k in range(3) if (scene := open_environment(program, {}, 42).sample(k))}
    assert counts.failed == 0
    assert {r.outcome for r in results} == {"rejected", "terminated"}
    for sample, outcome in shown(tmp_path / "s.db", "sample, outcome"):
        assert outcome == ("terminated" if starts[sample] > 0.005 else "rejected")


def test_a_program_that_fails_in_some_runs_is_those_runs_result(
    tmp_path: Path, listing: Path, program: Path, carsim_binary: Path
) -> None:
    program.write_text(f"{HEAD}{GOAL}record initial 1 / (ego.position.x < 0.005) as y\n")
    counts, results = swept(listing, tmp_path / "s.db", carsim_binary, 1), rows(tmp_path / "s.db")
    assert counts.new == 3
    assert 0 < counts.failed < 3
    assert counts.failed == sum(r.outcome == "failed" for r in results)
    for outcome, sample, message in shown(tmp_path / "s.db", "outcome, sample, message"):
        expected = f"{program}: sample {sample}: line 5: ZeroDivisionError: division by zero"
        assert message == (expected if outcome == "failed" else None)


@pytest.mark.parametrize(
    "text",
    [
        "def forever():\n    while True:\n        pass\nrecord final forever() as never\n",
        # In monitors and behaviors Scenic has a timer of its own.
        "monitor M():\n    wait\n    while True:\n        x = 1\nrequire monitor M()\n",
    ],
    ids=["a record", "a monitor"],
)
def test_a_program_that_loops_or_sleeps_while_the_car_drives_fails_after_its_time(
    program: Path, listing: Path, carsim_binary: Path, monkeypatch: pytest.MonkeyPatch, text: str
) -> None:
    monkeypatch.setattr(scenic_worker, "RUN_LIMIT_S", 0.5)
    program.write_text(HEAD + GOAL + text)
    error = f"{program}: sample 0: running takes longer than the limit of 0.5 s of wall time"
    assert answers(listing, carsim_binary, 0) == [{"error": error}]


@pytest.mark.parametrize(
    ("end", "message"),
    [
        ("os._exit(3)", "the process that simulates with Scenic died (exit code 1)"),
        ("sys.exit(3)", "running: line 6: SystemExit: 3"),
    ],
)
def test_a_program_that_ends_the_process_costs_its_own_run_only(
    tmp_path: Path, listing: Path, program: Path, carsim_binary: Path, end: str, message: str
) -> None:
    deadly = f"import os, sys\ndef deadly(x): return x if x < 0.005 else {end}\n"
    program.write_text(f"{HEAD}{GOAL}{deadly}record initial deadly(ego.position.x) as one\n")
    counts, results = swept(listing, tmp_path / "s.db", carsim_binary, 1), rows(tmp_path / "s.db")
    assert counts.new == 3
    failed = [r for r in results if r.outcome == "failed"]
    assert 0 < len(failed) == counts.failed < 3
    for (stored_message,) in shown(tmp_path / "s.db", "message"):
        assert stored_message is None or stored_message.endswith(message)


def test_the_listings_condition_reaches_the_workers(
    tmp_path: Path, write_listing: WriteListing, listing_data: Any, program: Path, carsim_binary: Path
) -> None:
    program.write_text(f"{HEAD}{GOAL}{RECORDS}")
    environment = listing_data["environments"]["1"]
    environment.update(scenic_filename=program.name, condition={"sample": 2, "objects": ["ego"]})
    counts = swept(write_listing(listing_data), tmp_path / "s.db", carsim_binary, 1)
    assert (counts.new, counts.failed) == (6, 0)
    begins = {(car, json.loads(text)["begin"]["value"]) for car, text in shown(tmp_path / "s.db", "parameters, recorded")}
    assert len(begins) == 2
