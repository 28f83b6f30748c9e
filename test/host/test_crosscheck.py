"""The cross-check: agreement computed from given results, and the command, which sweeps both engines into one store."""

import csv
import json
import resource
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from conftest import two_widths
from foldcar.analysis.rate import wilson_interval
from foldcar.errors import FoldcarError
from foldcar.report.crosscheck_agreement import Case, agreement
from foldcar.store.reader import Store
from forked_foldcar import original
from under_coverage import unmeasured

STEP = """model model
ego = new Robot at (0, 0), facing -90 deg
goal = new Goal at (0.8, 0), facing -90 deg
new Step at (0.5, 0), facing -90 deg, with height Range(0.01, 0.05)
"""
WORDS = ("--environments", "2", "--baseline", "1", "--jobs", "2", "-o", "check")


def pair(design: int, sample: int, first: str, second: str) -> Any:
    """A case and its results in two engines."""
    return Case("1", design, sample, {"width_mm": 100.0 + design}), {"outcome": first}, {"outcome": second}


@pytest.fixture(scope="module")
def checked(tmp_path_factory: pytest.TempPathFactory, carsim_binary: Path) -> tuple[Path, str]:
    """The folder of a listing with its cross-check, and what the command printed."""
    folder, listing = tmp_path_factory.mktemp("crosscheck"), two_widths()
    (folder / "step.scenic").write_text(STEP)
    listing["environments"]["2"] = {"scenic_filename": "step.scenic", "seed": 1}
    listing["experiments"]["2"] = {**listing["experiments"]["1"], "env_id": 2}
    (folder / "listing.json").write_text(json.dumps(listing))
    done = original().run(["crosscheck", "listing.json", *WORDS], folder)
    assert done.returncode == 0, done.stderr
    return folder, done.stdout


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
    assert found.confusion["stuck", "tipped"] == found.confusion["passed", "stuck"] == 2
    assert agreement(pairs[:6]).correlation is None


def test_rejected_runs_are_shown_and_not_compared() -> None:
    pairs = [pair(0, 0, "passed", "passed"), pair(0, 1, "rejected", "passed"), pair(0, 2, "stuck", "rejected")]

    found = agreement(pairs)

    assert (found.runs, found.alike) == (1, 1)
    assert found.confusion["rejected", "passed"] == 1
    with pytest.raises(FoldcarError, match="nothing to compare"):
        agreement(pairs[1:])


def test_the_command_compares_and_goes_on_from_what_is_there(checked: tuple[Path, str]) -> None:
    listed, shown = checked
    folder = listed / "check"
    with (folder / "runs.csv").open() as lines:
        rows = list(csv.DictReader(lines))
    first = [row for row in rows if row["experiment"] == "1"]
    assert [(row["design"], row["sample"]) for row in first] == [("1", "0"), ("2", "0"), ("1", "1"), ("2", "1")]
    assert all(row["multibody_outcome"] and row["mujoco_outcome"] for row in rows)
    for engine in ("mujoco_half_step", "mujoco_ellipsoid_tyres"):
        assert [bool(row[f"{engine}_outcome"]) for row in first] == [True, True, False, False]
    # Another step is other numbers.
    assert first[0]["mujoco_elapsed_time_s"] != first[0]["mujoco_half_step_elapsed_time_s"]
    # The side view claims scenes that are alike on both sides.
    flat = [row for row in rows if row["side_view_outcome"]]
    assert {row["experiment"] for row in flat} == {"2"}

    numbers, page = json.loads((folder / "summary.json").read_text()), (folder / "index.html").read_text()
    names = ("multibody – MuJoCo", "side-view – MuJoCo")
    for name, engine, some in ((names[0], "multibody", rows), (names[1], "side_view", flat)):
        alike = sum((row[f"{engine}_outcome"] == "passed") == (row["mujoco_outcome"] == "passed") for row in some)
        assert numbers["comparisons"][name]["alike"] == alike
        assert f"<td>{name}</td><td>{len(some)}</td><td>{100 * alike / len(some):.1f}</td>" in page
    assert [names[1] in numbers["by_experiment"][name] for name in "12"] == [False, True]
    assert all((folder / f"success_{number}.png").read_bytes().startswith(b"\x89PNG") for number in (1, 2))

    with Store.open(folder / "study.db") as store:
        infos = store.info().experiments
    engines = ["1", "1 (MuJoCo)", "1 (MuJoCo, half step)", "1 (MuJoCo, ellipsoid tyres)"]
    assert [name for name in infos if name.startswith("1")] == engines
    assert {infos[name].listed_id for name in engines} == {"1"}
    assert len({infos[name].carsim_build for name in engines}) == 4
    assert [infos[name].stored_runs for name in engines] == [4, 4, 2, 2]

    assert original().run(["crosscheck", "listing.json", *WORDS], listed).stdout == shown
    with Store.open(folder / "study.db") as store:
        assert {name: one.stored_runs for name, one in store.info().experiments.items()} == {
            name: one.stored_runs for name, one in infos.items()
        }


def test_an_interrupt_loses_nothing(tmp_path: Path, write_listing: Any, listing_data: Any) -> None:
    words = ["crosscheck", str(write_listing(listing_data)), "--environments", "20", "--jobs", "2", "-o", "check"]
    process = original().start(words, tmp_path)
    file = tmp_path / "check" / "study.db"
    deadline = time.monotonic() + 300
    while time.monotonic() < deadline and stored_runs(file, "1 (MuJoCo)") == 0:
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    _, message = process.communicate()

    assert process.returncode == 130
    assert message.endswith("stopped: finished runs are in check/study.db; the same command resumes\n")
    with Store.open(file) as store:
        assert store.info().experiments["1"].stored_runs == 40
        assert store.info().experiments["1 (MuJoCo)"].stored_runs > 0


@pytest.mark.slow
def test_a_full_disk_is_one_line_and_loses_nothing(
    tmp_path: Path, write_listing: Any, listing_data: Any, foldcar: Any, new_foldcar: Any
) -> None:
    words = ("crosscheck", write_listing(listing_data), "--baseline", "0", "--jobs", "1", "-o", "check")
    assert foldcar(*words, "--environments", "1").returncode == 0
    limit = (tmp_path / "check" / "study.db").stat().st_size + 16_000

    def limited(most: int) -> Any:
        return {"preexec_fn": lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (most, limit)), "env": unmeasured()}

    full = new_foldcar(*words, "--environments", "500", **limited(limit))

    assert full.returncode == 2
    rule, error = full.stderr.splitlines()
    assert rule.startswith("experiment 1: a run has passed if") and error.startswith("foldcar: error: check/study.db: ")
    assert stored_runs(tmp_path / "check" / "study.db", "1") >= 2
    # The pictures do not fit.
    full = new_foldcar(*words, "--environments", "1", **limited(9000))
    assert full.returncode == 2 and full.stderr.splitlines()[-1].startswith("foldcar: error: check/")


def stored_runs(file: Path, experiment: str) -> int:
    """Runs that a store which is being written shows of an experiment."""
    if not file.exists():
        return 0
    try:
        with Store.open(file) as store:
            info = store.info().experiments.get(experiment)
    except FoldcarError:
        return 0
    return info.stored_runs if info is not None else 0


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
        "record final ego.position.x as x_m\n"
    )
    listing_data["environments"]["1"]["scenic_filename"] = "drive.scenic"
    file = write_listing(listing_data)
    done = foldcar("crosscheck", file, "--environments", "1", "--baseline", "0", "--jobs", "1", "-o", "check")

    assert done.returncode == 0, done.stderr
    with (tmp_path / "check" / "runs.csv").open() as lines:
        rows = list(csv.DictReader(lines))
    assert len(rows) == 2
    for row in rows:
        assert row["multibody_outcome"] == row["mujoco_outcome"] == "passed"
        times = [float(row[f"{engine}_elapsed_time_s"]) for engine in ("multibody", "mujoco")]
        assert times[0] == pytest.approx(times[1], rel=0.03)
    with Store.open(tmp_path / "check" / "study.db") as store:
        ends = [result.recorded["x_m"].value for result in store.results()]
    # Scenic looks every 0.1 s at most: 70 mm of way.
    assert len(ends) == 6 and all(0.8 < end < 0.88 for end in ends)
