"""The cross-check: agreement computed from given results, the cache of results, and the command."""

import csv
import json
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from foldcar.analysis.intervals import wilson_interval
from foldcar.crosscheck.agreement import agreement, worst
from foldcar.crosscheck.cases import Case
from foldcar.crosscheck.ending import Ending, State
from foldcar.crosscheck.result_cache import ResultCache
from foldcar.simulation.carsim_limits import CarsimLimits
from shell_signals import like_a_shell
from study_car import empty_scene


def pair(design: int, sample: int, first: str, second: str, apart_m: float = 0.0) -> Any:
    """A case and its results in two engines, which end ``apart_m`` apart."""
    case = Case("1", design, sample, {"width_mm": 100.0 + design}, {}, {"sample": sample}, {})
    ends = ([0.0, 0.0], [0.0, apart_m])
    return case, *({"outcome": o, "end": end} for o, end in zip((first, second), ends, strict=True))


def test_agreement_counts_runs_and_compares_success_rates() -> None:
    pairs = [
        *(pair(0, k, "passed", "passed") for k in range(4)),
        *(pair(1, k, "passed", "stuck") for k in range(2)),
        *(pair(1, k, "stuck", "tipped") for k in range(2, 4)),
        *(pair(2, k, "tipped", "tipped") for k in range(3)),
        pair(2, 3, "tipped", "passed"),
    ]
    found = agreement(pairs)

    assert (found.runs, found.alike) == (12, 9)
    assert found.interval == wilson_interval(9, 12)
    assert [(d.first, d.second) for d in found.designs.values()] == [(4, 4), (2, 0), (0, 1)]
    # Rates 1, 1/2, 0 against 1, 0, 1/4: means 1/2 and 5/12, covariance 1/4, variances 1/6 and 13/72.
    covariance = ((1 - 5 / 12) * 0.5 + (0.25 - 5 / 12) * -0.5) / 3
    variances = (0.5 / 3, ((7 / 12) ** 2 + (5 / 12) ** 2 + (2 / 12) ** 2) / 3)
    assert found.correlation == pytest.approx(covariance / (variances[0] * variances[1]) ** 0.5)
    assert found.rmse == pytest.approx(((0.5**2 + 0.25**2) / 3) ** 0.5)
    assert found.bias == pytest.approx(0.25 / 3)
    assert found.kinds == [(("passed", "stuck"), 2), (("tipped", "passed"), 1)]
    assert found.confusion["stuck", "tipped"] == 2


def test_one_rate_for_all_has_no_correlation() -> None:
    found = agreement([pair(0, 0, "passed", "passed"), pair(1, 0, "passed", "stuck")])

    assert found.correlation is None


def test_the_worst_are_disagreements_that_end_furthest_apart_each_in_its_own_scene() -> None:
    scenes = [{"scene": k} for k in range(4)]
    raw = [
        pair(0, 0, "passed", "stuck", 0.5),
        pair(1, 0, "passed", "stuck", 0.9),
        pair(0, 1, "passed", "passed", 2.0),
        pair(0, 2, "tipped", "stuck", 3.0),
        pair(0, 3, "tipped", "passed", 0.7),
    ]
    pairs = [
        (Case(c.experiment, c.design, c.sample, c.columns, c.body, scenes[c.sample], {}), a, b)
        for c, a, b in raw
    ]

    assert [(case.design, case.sample) for case, *_ in worst(pairs, 3)] == [(1, 0), (0, 3)]


def test_the_cache_keeps_whole_lines_and_passes_over_a_torn_one(tmp_path: Path) -> None:
    file = tmp_path / "results.jsonl"
    with ResultCache(file) as cache:
        cache.put("a", "carsim", {"outcome": "passed"})
    file.write_text(file.read_text() + '{"key": "b", "engine": "carsim", "resu')
    with ResultCache(file) as cache:
        assert (cache.get("a"), cache.get("b")) == ({"outcome": "passed"}, None)
        cache.put("b", "carsim", {"outcome": "stuck"})
    with ResultCache(file) as cache:
        assert cache.get("b") == {"outcome": "stuck"}


def state(x_m: float = 0.0, y_m: float = 0.0, heading_rad: float = 0.0, up: float = 1.0) -> State:
    return State(x_m, y_m, 0.06, heading_rad, 0.0, 0.0, up)


def test_endings_follow_the_rules(carsim_limits: CarsimLimits) -> None:
    rules = carsim_limits.trial
    scene = empty_scene(goal_x_m=1.0)

    assert Ending(scene, state(), rules).check(state(0.99), 1.0) is None
    assert Ending(scene, state(), rules).check(state(1.0), 1.0) == "passed"
    assert Ending(scene, state(), rules).check(state(1.0, up=0.25), 1.0) == "tipped"
    assert Ending(scene, state(2.0), rules).check(state(3.0), 1.0) is None
    assert Ending(scene, state(), rules).check(state(0.5, 10.1), 1.0) == "off_course"
    assert Ending({**scene, "goal": None}, state(), rules).check(state(2.0), 1.0) is None
    disc = {"kind": "disc", "x_m": 1.0, "y_m": 0.0, "radius_m": 0.2}
    assert Ending({**scene, "goal": disc}, state(), rules).check(state(0.81, 0.05), 1.0) == "passed"


def test_a_car_is_stuck_after_four_seconds_without_way_or_turn(carsim_limits: CarsimLimits) -> None:
    rules = carsim_limits.trial
    ending = Ending(empty_scene(goal_x_m=1.0), state(), rules)

    assert ending.check(state(0.009), 3.9) is None
    assert ending.check(state(0.011), 3.95) is None
    assert ending.check(state(0.011, heading_rad=0.034), 7.9) is None
    assert ending.check(state(0.011, heading_rad=0.036), 7.94) is None
    assert ending.check(state(0.011, heading_rad=0.036), 11.93) is None
    assert ending.check(state(0.011, heading_rad=0.036), 11.95) == "stuck"


def test_the_command_compares_and_goes_on_from_what_is_there(
    foldcar: Callable[..., "subprocess.CompletedProcess[str]"], write_listing: Any, listing_data: Any
) -> None:
    file = write_listing(listing_data)
    words = ("crosscheck", file, "--environments", "2", "--baseline", "1", "--jobs", "2", "-o", "check")
    done = foldcar(*words)

    assert done.returncode == 0, done.stderr
    folder = file.parent / "check"
    with (folder / "runs.csv").open() as lines:
        rows = list(csv.DictReader(lines))
    assert [(row["design"], row["sample"]) for row in rows] == [
        ("1", "0"),
        ("2", "0"),
        ("1", "1"),
        ("2", "1"),
    ]
    assert all(row["carsim_outcome"] and row["mujoco_outcome"] for row in rows)
    assert [bool(row["mujoco_half_step_outcome"]) for row in rows] == [True, True, False, False]
    alike = sum((row["carsim_outcome"] == "passed") == (row["mujoco_outcome"] == "passed") for row in rows)
    numbers = json.loads((folder / "summary.json").read_text())
    assert numbers["comparisons"]["carsim – MuJoCo"]["alike"] == alike
    page = (folder / "index.html").read_text()
    assert f"<td>carsim – MuJoCo</td><td>4</td><td>{100 * alike / 4:.1f}</td>" in page
    assert (folder / "success_1.png").read_bytes().startswith(b"\x89PNG")

    kept = (folder / "results.jsonl").read_bytes()
    assert foldcar(*words).stdout == done.stdout
    assert (folder / "results.jsonl").read_bytes() == kept


def test_an_interrupt_loses_nothing(tmp_path: Path, write_listing: Any, listing_data: Any) -> None:
    command = [sys.executable, "-c", "from foldcar.cli import main; main()", "crosscheck"]
    command += [str(write_listing(listing_data)), "--environments", "40", "--jobs", "2", "-o", "check"]
    process = subprocess.Popen(
        command, cwd=tmp_path, stderr=subprocess.PIPE, text=True, start_new_session=True, preexec_fn=like_a_shell
    )
    file = tmp_path / "check" / "results.jsonl"
    deadline = time.monotonic() + 300
    while time.monotonic() < deadline and '"mujoco"' not in (file.read_text() if file.exists() else ""):
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    _, message = process.communicate(timeout=300)

    assert process.returncode == 130
    assert message == "stopped: finished runs are in check; the same command resumes\n"
    for line in file.read_text().splitlines():
        assert json.loads(line)["result"]["outcome"]


def test_without_mujoco_one_line_says_how_to_get_it(
    new_foldcar: Callable[..., "subprocess.CompletedProcess[str]"],
    tmp_path: Path,
    write_listing: Any,
    listing_data: Any,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    (tmp_path / "mujoco.py").write_text("raise ImportError('no module named mujoco')\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=":")
    done = new_foldcar("crosscheck", write_listing(listing_data), "-o", "check")

    assert done.returncode == 2
    assert "pip install 'foldcar[crosscheck]'" in done.stderr and done.stderr.count("\n") == 1
    assert not (tmp_path / "check").exists()


def test_a_program_with_dynamics_decides_in_both_engines(
    foldcar: Callable[..., "subprocess.CompletedProcess[str]"],
    tmp_path: Path,
    write_listing: Any,
    listing_data: Any,
) -> None:
    (tmp_path / "drive.scenic").write_text(
        "model model\n"
        "ego = new Robot at (0, 0), facing -90 deg\n"
        "terminate when ego.position.x > 0.8\n"
        "record final ego.position.x > 0.8 as passed\n"
    )
    listing_data["environments"]["1"]["scenic_filename"] = "drive.scenic"
    file = write_listing(listing_data)
    done = foldcar("crosscheck", file, "--environments", "1", "--baseline", "1", "--jobs", "1", "-o", "check")

    assert done.returncode == 0, done.stderr
    with (tmp_path / "check" / "runs.csv").open() as lines:
        rows = list(csv.DictReader(lines))
    results = [json.loads(line) for line in (tmp_path / "check" / "results.jsonl").read_text().splitlines()]
    assert len(rows) == 2 and len(results) == 8
    for row in rows:
        assert row["carsim_outcome"] == row["mujoco_outcome"] == row["mujoco_half_step_outcome"] == "passed"
        times = [float(row[f"{engine}_elapsed_time_s"]) for engine in ("carsim", "mujoco")]
        assert times[0] == pytest.approx(times[1], rel=0.03)
    for one in results:
        # A tick is 14 mm of way, of which the end is the first beyond the limit.
        assert 0.8 < one["result"]["end"][0] < 0.815


def test_a_full_disk_is_one_line_and_the_command_goes_on_when_there_is_room(
    foldcar: Callable[..., "subprocess.CompletedProcess[str]"],
    new_foldcar: Callable[..., "subprocess.CompletedProcess[str]"],
    tmp_path: Path,
    write_listing: Any,
    listing_data: Any,
) -> None:
    words = ("crosscheck", write_listing(listing_data), "--environments", "1", "--baseline", "0", "-o", "check")
    limit = 700  # one result's line and a part of the next
    full = new_foldcar(*words, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)))

    assert full.returncode == 2
    assert "check/results.jsonl: cannot be written" in full.stderr and full.stderr.count("\n") == 1
    done = foldcar(*words)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "check" / "index.html").read_text().rstrip().endswith("</html>")
