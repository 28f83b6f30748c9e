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

from foldcar.analysis.rate import wilson_interval
from foldcar.errors import FoldcarError
from foldcar.report.crosscheck_agreement import Case, agreement, read_cases
from foldcar.report.crosscheck_parted import parted
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.engines import MUJOCO, MULTIBODY
from foldcar.store.reader import Store
from forked_foldcar import original
from under_coverage import unmeasured


def pair(design: int, sample: int, first: str, second: str) -> Any:
    """A case and its results in two engines."""
    return Case("1", design, sample, {"width_mm": 100.0 + design}), {"outcome": first}, {"outcome": second}


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


def test_rejected_runs_are_shown_and_not_compared() -> None:
    pairs = [pair(0, 0, "passed", "passed"), pair(0, 1, "rejected", "passed"), pair(0, 2, "stuck", "rejected")]

    found = agreement(pairs)

    assert (found.runs, found.alike, found.kinds) == (1, 1, [])
    assert found.confusion["rejected", "passed"] == 1
    with pytest.raises(FoldcarError, match="nothing to compare"):
        agreement(pairs[1:])


def test_one_rate_for_all_has_no_correlation() -> None:
    found = agreement([pair(0, 0, "passed", "passed"), pair(1, 0, "passed", "stuck")])

    assert found.correlation is None


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
    assert [(row["design"], row["sample"]) for row in rows] == [("1", "0"), ("2", "0"), ("1", "1"), ("2", "1")]
    assert all(row["multibody_outcome"] and row["mujoco_outcome"] for row in rows)
    for engine in ("mujoco_half_step", "mujoco_ellipsoid_tyres"):
        assert [bool(row[f"{engine}_outcome"]) for row in rows] == [True, True, False, False]
    alike = sum((row["multibody_outcome"] == "passed") == (row["mujoco_outcome"] == "passed") for row in rows)
    numbers = json.loads((folder / "summary.json").read_text())
    assert numbers["comparisons"]["multibody – MuJoCo"]["alike"] == alike
    page = (folder / "index.html").read_text()
    assert f"<td>multibody – MuJoCo</td><td>4</td><td>{100 * alike / 4:.1f}</td>" in page
    assert (folder / "success_1.png").read_bytes().startswith(b"\x89PNG")
    with Store.open(folder / "study.db") as store:
        infos = store.info().experiments
        assert list(infos) == ["1", "1 (MuJoCo)", "1 (MuJoCo, half step)", "1 (MuJoCo, ellipsoid tyres)"]
        assert {info.listed_id for info in infos.values()} == {"1"}
        assert len({info.carsim_build for info in infos.values()}) == 4
        assert [info.stored_runs for info in infos.values()] == [4, 4, 2, 2]
    # Another step and another tyre are other numbers.
    times = {engine: float(rows[0][f"{engine}_elapsed_time_s"]) for engine in ("mujoco", "mujoco_half_step")}
    assert times["mujoco"] != times["mujoco_half_step"]

    assert foldcar(*words).stdout == done.stdout
    with Store.open(folder / "study.db") as store:
        assert sum(info.stored_runs for info in store.info().experiments.values()) == 12


def test_the_side_view_is_compared_where_both_sides_are_alike(
    tmp_path: Path, foldcar: Callable[..., "subprocess.CompletedProcess[str]"], write_listing: Any, listing_data: Any
) -> None:
    program = tmp_path / "step.scenic"
    program.write_text(
        "model model\nego = new Robot at (0, 0), facing -90 deg\ngoal = new Goal at (0.8, 0), facing -90 deg\n"
        "new Step at (0.5, 0), facing -90 deg, with height Range(0.01, 0.05)\n"
    )
    listing_data["environments"]["2"] = {"scenic_filename": str(program), "seed": 1}
    listing_data["experiments"]["2"] = {**listing_data["experiments"]["1"], "env_id": 2}
    done = foldcar("crosscheck", write_listing(listing_data), "--environments", "3", "--baseline", "0", "-o", "check")

    assert done.returncode == 0, done.stderr
    with Store.open(tmp_path / "check" / "study.db") as store:
        assert [name for name in store.info().experiments if "side" in name] == ["2 (side-view)"]
    with (tmp_path / "check" / "runs.csv").open() as lines:
        rows = list(csv.DictReader(lines))
    assert {row["experiment"] for row in rows if row["side_view_outcome"]} == {"2"}
    head, *table = json.loads((tmp_path / "check" / "summary.json").read_text())["by_experiment"]
    shown = {row[0]: row[head.index("side-view passed %")] for row in table}
    passed = [row["side_view_outcome"] == "passed" for row in rows if row["experiment"] == "2"]
    assert shown == {"1": "–", "2": f"{100 * sum(passed) / len(passed):.1f}"}
    assert "<td>side-view – MuJoCo</td>" in (tmp_path / "check" / "index.html").read_text()


def test_the_worst_are_simulated_again_to_the_same_end(
    tmp_path: Path, foldcar: Callable[..., "subprocess.CompletedProcess[str]"], write_listing: Any, listing_data: Any
) -> None:
    listing_data["vehicles"]["1"]["params"][0]["common"]["width"] = 95
    file = write_listing(listing_data)
    for engine in (MULTIBODY, MUJOCO):
        assert foldcar("sweep", file, "--store", "s.db", "--engine", engine).returncode == 0
    engines = {engine: Carsim(engine=engine) for engine in (MULTIBODY, MUJOCO)}
    with Store.open(tmp_path / "s.db") as store:
        cases, results = read_cases(store, ["1"], engines)
        first, second = ([one for one in results[engine] if one is not None] for engine in engines)
        # What ended alike in both is entered as if it had not: its end must be found again, or it is left out.
        pairs = [
            (case, one, {**other, "outcome": "stuck" if one["outcome"] == "passed" else "passed"})
            for case, one, other in zip(cases, first, second, strict=True)
        ]
        assert parted(store, pairs, engines, 2, 3) == []
        apart = [(case, one, other) for case, one, other in zip(cases, first, second, strict=True)]
        found = parted(store, apart, engines, 2, 3)
    for one in found:
        known = {case: (a, b) for case, a, b in apart}[one.case]
        for result, stored in zip((one.first, one.second), known, strict=True):
            assert result["path"][-1][0] == pytest.approx(stored["elapsed_time_s"])
    assert [one.apart_m for one in found] == sorted((one.apart_m for one in found), reverse=True)


def test_an_interrupt_loses_nothing(tmp_path: Path, write_listing: Any, listing_data: Any) -> None:
    words = ["crosscheck", str(write_listing(listing_data)), "--environments", "40", "--jobs", "2", "-o", "check"]
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
        assert store.info().experiments["1"].stored_runs == 80
        assert store.info().experiments["1 (MuJoCo)"].stored_runs > 0


@pytest.mark.slow
def test_a_full_disk_is_one_line_and_loses_nothing(
    tmp_path: Path, write_listing: Any, listing_data: Any, foldcar: Any, new_foldcar: Any
) -> None:
    words = ("crosscheck", write_listing(listing_data), "--baseline", "0", "--jobs", "1", "-o", "check")
    assert foldcar(*words, "--environments", "1").returncode == 0
    limit = (tmp_path / "check" / "study.db").stat().st_size + 16_000

    full = new_foldcar(
        *words,
        "--environments",
        "500",
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)),
        env=unmeasured(),
    )

    assert full.returncode == 2
    rule, error = full.stderr.splitlines()
    assert rule.startswith("experiment 1: a run has passed if") and error.startswith("foldcar: error: check/study.db: ")
    assert stored_runs(tmp_path / "check" / "study.db", "1") >= 2
    # The pictures do not fit.
    full = new_foldcar(
        *words,
        "--environments",
        "1",
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (9000, limit)),
        env=unmeasured(),
    )
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
