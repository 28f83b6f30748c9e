"""Runs in other realities: drawn by their number alone, simulated once, resumed, and as many as the learning needs."""

import io
import json
import math
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

import foldcar as foldcar_api
from foldcar.belief import priors
from foldcar.belief.priors import MAX_SCORE, NAMES, values_of
from foldcar.belief.reality import drawn_reality
from foldcar.commands import progress_bar
from foldcar.commands.sweep import reality_lines
from foldcar.errors import FoldcarError
from foldcar.evidence import remarks
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.runner import RunRequest
from foldcar.store.merge import merge_stores
from foldcar.store.reader import Store
from foldcar.store.reality_runs import BLOCK, CHECK, RealityRuns, read_reality_runs
from foldcar.store.stored_drives import read_drives
from foldcar.store.tables import REALITY_RUN
from foldcar.store.writer import canonical_json, write_store
from foldcar.study import reality_runs
from foldcar.study.chunks import LocalSimulators
from foldcar.study.experiment_runs import Progress
from foldcar.study.experiments import read_study
from foldcar.study.reality_draws import MAX_SCENES, draw_runs
from foldcar.study.reality_runs import MAX_ERROR, STAGES, RealityCounts, next_number, offered_runs
from foldcar.study.sweep import Sweep
from full_store import contents
from study_car import listing_of
from swept_listing import STEP_PYRAMIDS, json_output, swept
from swept_listing import foldcar as run_foldcar

SAMPLES = 20
WIDTHS = [95, 245]


def write_widths(tmp_path: Path, **params: Any) -> Path:
    """A listing of two widths in 20 environments of step pyramids."""
    file = tmp_path / "widths.json"
    data = listing_of(STEP_PYRAMIDS, {"width": WIDTHS}, timeout=60, environments=SAMPLES)
    data["experiments"]["1"]["params"] |= params
    file.write_text(json.dumps(data))
    return file


@pytest.fixture
def widths(tmp_path: Path) -> Path:
    return write_widths(tmp_path)


@pytest.fixture(autouse=True)
def learned(monkeypatch: pytest.MonkeyPatch) -> list[tuple[RealityRuns, Any]]:
    """What the sweep has learned from. The error is 50 points divided by the square root of the number of runs."""
    calls: list[tuple[RealityRuns, Any]] = []

    def learning_error(runs: RealityRuns, designs: Any, variation: Any, counts: Any) -> float:
        calls.append((runs, designs))
        return float(0.5 / math.sqrt(len(runs.number)))

    monkeypatch.setattr(reality_runs, "learning_error", learning_error)
    return calls


def rows_of(store: Path) -> list[dict[str, Any]]:
    return contents(store)[REALITY_RUN.name]


def facts_of(store: Path, experiment: str = "1") -> tuple[int, str]:
    with Store.open(store) as opened:
        info = opened.info().experiments[experiment]
        return info.realities, info.no_realities


def test_a_number_draws_the_same_run_whatever_is_drawn_with_it() -> None:
    whole = draw_runs(7, range(1000), 37, 150)

    for numbers in (range(1), range(995, 1000), range(109, 111), range(437, 801)):
        part = draw_runs(7, numbers, 37, 150)
        for name in ("number", "scores", "design", "sample"):
            assert np.array_equal(getattr(part, name), getattr(whole, name)[numbers.start : numbers.stop])
    assert not np.array_equal(draw_runs(8, range(1000), 37, 150).scores, whole.scores)


def test_draws_have_the_distributions_that_they_should() -> None:
    drawn = draw_runs(1, range(40_000), 7, 30)
    own = drawn.number % BLOCK >= CHECK
    scores = drawn.scores[own]

    # Standard normal numbers clipped to ± 2.5 have a variance of 0.9843; parameters are independent.
    assert np.abs(scores).max() == MAX_SCORE and abs(np.mean(scores == MAX_SCORE) - 0.00621) < 0.0005
    assert np.abs(scores.mean(axis=0)).max() < 4 / math.sqrt(len(scores))
    assert np.allclose(np.cov(scores.T), np.eye(len(NAMES)) * 0.9843, atol=0.03)
    for values, number in ((drawn.design[own], 7), (drawn.sample, 30)):
        counts = np.bincount(values, minlength=number)
        expected = counts.sum() / number
        assert len(counts) == number and np.abs(counts - expected).max() < 5 * math.sqrt(expected)
    assert draw_runs(1, range(5000), 7, 10**6).sample.max() == MAX_SCENES - 1


def test_a_check_group_shares_reality_and_design_and_nothing_else() -> None:
    drawn = draw_runs(3, range(20 * BLOCK), 37, 100)
    block = drawn.number // BLOCK
    checked = drawn.number % BLOCK < CHECK

    for group in range(20):
        members = checked & (block == group)
        assert members.sum() == CHECK
        assert len(np.unique(drawn.scores[members], axis=0)) == len(np.unique(drawn.design[members])) == 1
        assert len(np.unique(drawn.sample[members])) > 3
    assert len(np.unique(drawn.scores, axis=0)) == 20 * (BLOCK - CHECK + 1)


def test_stored_runs_are_those_of_their_numbers(widths: Path, tmp_path: Path, carsim_binary: Path) -> None:
    store = tmp_path / "s.db"
    swept(widths, store, carsim_binary, realities=130)

    with Store.open(store) as opened:
        runs, scenes = read_reality_runs(opened, "1"), scenes_of(opened)
        info = opened.info().experiments["1"]
    drawn = draw_runs(info.variation_seed, range(130), len(WIDTHS), SAMPLES)
    assert np.array_equal(runs.number, drawn.number) and np.array_equal(runs.scores, drawn.scores)
    assert np.array_equal(runs.design, drawn.design) and np.array_equal(runs.sample, drawn.sample)
    assert set(runs.passed) == {0.0, 1.0}
    # Three runs once more, one by one, from the listing.
    study = read_study(widths)
    carsim = Carsim(carsim_binary)
    (experiment,) = study.experiments
    designs = list(Sweep(study, tmp_path / "none.db", carsim, "a test").designs["1"])
    for number in (0, 57, 129):
        (values,) = values_of(drawn.scores[[number]])
        car = f"reality {number}"
        reality = drawn_reality(values, experiment.variation, experiment.variation_seed, number, car)
        design = designs[drawn.design[number]]
        bodies, places = {"b": canonical_json(design.body)}, {"s": scenes[int(drawn.sample[number])]}
        settings = canonical_json(design.settings)
        (answer,) = carsim.run(bodies, places, [RunRequest("b", "s", settings, "x", 0, canonical_json(reality))])
        assert float(answer["outcome"] == "passed") == runs.passed[number]


def scenes_of(store: Store) -> dict[int, str]:
    """The experiment's scenes by sample."""
    drives = read_drives(store, "1")
    return {sample: drives.text("scene", scene) for sample, scene in drives.scenes.items()}


def test_one_simulator_and_two_store_the_same(widths: Path, tmp_path: Path, carsim_binary: Path) -> None:
    for jobs in (1, 2):
        swept(widths, tmp_path / f"{jobs}.db", carsim_binary, jobs=jobs, realities=120)

    assert len(rows_of(tmp_path / "1.db")) == 120
    assert rows_of(tmp_path / "1.db") == rows_of(tmp_path / "2.db")


def test_workers_of_a_scheduler_store_the_same(widths: Path, tmp_path: Path, carsim_binary: Path) -> None:
    swept(widths, tmp_path / "here.db", carsim_binary, realities=60)

    run_foldcar("sweep", widths, "--store", tmp_path / "there.db", "--realities", "60", "--scheduler", "local:2")

    assert rows_of(tmp_path / "there.db") == rows_of(tmp_path / "here.db")


def test_a_stopped_sweep_keeps_finished_chunks_and_resumes(
    widths: Path, tmp_path: Path, carsim_binary: Path, learned: list[Any]
) -> None:
    swept(widths, tmp_path / "whole.db", carsim_binary, realities=150)
    learned.clear()

    def stop(progress: Any) -> None:
        if progress.realities and progress.realities["1"].new >= 40:
            raise InterruptedError

    study = read_study(widths)
    with pytest.raises(InterruptedError):
        Sweep(study, tmp_path / "s.db", Carsim(carsim_binary), "a test", realities=150).run(1, stop)
    kept = len(rows_of(tmp_path / "s.db"))
    assert 40 <= kept < 150 and not learned
    with Store.open(tmp_path / "s.db") as opened:
        info = opened.info().experiments["1"]
        (sentence,) = remarks.on_runs(opened, info)
    assert sentence == (
        f"Unfinished: {kept} of 150 planned runs in other realities are here. If the sweep does not run any more, its "
        "command resumes it."
    )

    counts = swept(widths, tmp_path / "s.db", carsim_binary, realities=150).realities["1"]

    assert (counts.new, counts.reused, counts.done) == (150 - kept, kept, 150)
    assert rows_of(tmp_path / "s.db") == rows_of(tmp_path / "whole.db")
    with Store.open(tmp_path / "s.db") as opened:
        assert remarks.on_runs(opened, opened.info().experiments["1"]) == []


def test_ctrl_c_says_how_many_runs_are_stored(widths: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-c", "from foldcar.__main__ import main; main()", "sweep", widths, "--store", "s.db"]
    process = subprocess.Popen(
        [*map(str, command), "--realities", "20000", "--jobs", "1"],
        cwd=tmp_path,
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        while process.poll() is None and not _stored_realities(tmp_path / "s.db"):
            time.sleep(0.1)
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=60)
    finally:
        process.kill()

    assert process.returncode == 130, errors
    stored = len(rows_of(tmp_path / "s.db"))
    last = errors.splitlines()[-1]
    counts = f"40 of 40 runs, and {stored:,} of 20,000 in other realities, are stored in s.db"
    assert last == f"stopped: {counts}; the same command resumes"


def _stored_realities(store: Path) -> int:
    """How many runs in other realities a store has while it is written; 0 before it is a store."""
    try:
        with Store.open(store) as opened:
            return len(read_reality_runs(opened, "1").number)
    except FoldcarError:
        return 0


def test_the_error_decides_how_many_runs_there_are(
    widths: Path, tmp_path: Path, carsim_binary: Path, learned: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reality_runs, "STAGES", (25, 64, 100))
    answers = [next_number(runs, error) for runs, error in [(25, 0.05), (25, 0.06), (100, None), (64, None)]]
    assert answers == [None, 64, None, 100]

    # The error is 10 points, 6.3 points, 5 points.
    assert swept(widths, tmp_path / "s.db", carsim_binary, realities=None).realities["1"].total == 100

    assert [len(runs.number) for runs, _ in learned] == [25, 64, 100]
    assert all(designs.tolist() == [[95.0], [245.0]] for _, designs in learned)
    assert facts_of(tmp_path / "s.db") == (100, "")
    # Once more: nothing is new, and the error is asked once.
    again = swept(widths, tmp_path / "s.db", carsim_binary, realities=None).realities["1"]
    assert (again.new, again.reused, len(learned)) == (0, 100, 4)
    assert again.error == pytest.approx(0.05)


def test_fewer_runs_than_the_store_has_are_learned_from_and_kept(
    widths: Path, tmp_path: Path, carsim_binary: Path, learned: list[Any]
) -> None:
    store = tmp_path / "s.db"
    for number, stored in ((50, 50), (20, 50), (0, 50), (40, 50)):
        swept(widths, store, carsim_binary, realities=number)

        with Store.open(store) as opened:
            assert len(read_reality_runs(opened, "1")) == number
        assert len(rows_of(store)) == stored
    assert [len(runs) for runs, _ in learned] == [50, 20, 40]


def test_twice_as_many_runs_are_offered_if_the_error_is_large() -> None:
    asked = [(4000, 0.06), (3998, 0.06), (500, 0.2), (25, 0.2), (4000, 0.05), (4000, None), (500_001, 0.2)]

    assert [offered_runs(runs, error) for runs, error in asked] == [8000, 8000, 1000, 200, None, None, None]


def test_help_and_page_have_the_numbers_of_the_code(foldcar: Any) -> None:
    first, last = STAGES
    page = (Path(__file__).resolve().parents[3] / "docs" / "realities.md").read_text(encoding="utf-8")

    assert f"needs, {first} or {last}." in " ".join(foldcar("sweep", "-h").stdout.replace("│", " ").split())
    assert f"The sweep simulates {first:,} runs in other realities." in page
    assert f"is then above {100 * MAX_ERROR:g} percentage points, it simulates {last - first:,} more." in page
    numbers = {10: "ten", 20: "twenty"}
    assert f"The first {numbers[CHECK]} runs of a group drive the same design" in page and BLOCK == 100


def test_the_number_may_be_given_and_the_output_offers_more(widths: Path, tmp_path: Path) -> None:
    words = ("sweep", widths, "--store", tmp_path / "s.db", "--realities", "25")
    output = run_foldcar(*words)

    *_, line, offer = output.splitlines()
    assert line == (
        "experiment 1: 25 runs in other realities, 25 of them new; too few to learn the success rate of built cars"
    )
    assert offer == "  at least 200 are needed: --realities 4000"
    assert "too few runs in other realities to learn from" in run_foldcar("select", tmp_path / "s.db")
    counts = json_output(*words)["realities"]["1"]
    assert {**counts, "seconds": 0} == {
        "total": 25, "new": 0, "reused": 25, "failed": 0, "error": 0.1, "left_out": "", "seconds": 0,
    }  # fmt: skip
    # An error of at most 5 points needs no more.
    words = (*words[:-1], "200")
    assert json_output(*words)["realities"]["1"]["new"] == 175
    enough = run_foldcar(*words)
    assert "the success rate of built cars is learned from them with an error " in enough
    assert "--realities" not in enough and "Want a car that works?" in run_foldcar("select", tmp_path / "s.db")


def test_one_run_is_singular_and_an_error_above_five_points_offers_more() -> None:
    one, many = RealityCounts(total=1, new=1), RealityCounts(total=400, error=0.1)

    assert next(reality_lines("1", one)).startswith("experiment 1: 1 run in other realities, 1 of them new; too few ")
    assert list(reality_lines("1", many)) == [
        "experiment 1: 400 runs in other realities, 0 of them new; the success rate of built cars is learned from them "
        "with an error of 10.0 points",
        "  more runs make the error smaller: --realities 800",
    ]


def test_an_error_that_few_groups_cannot_measure_is_not_called_0() -> None:
    """An estimate whose square is below 0 is clipped."""
    (line,) = reality_lines("1", RealityCounts(total=600, error=0.0))
    (small,) = reality_lines("1", RealityCounts(total=8000, error=0.0006))

    assert line.endswith("learned from them with an error that is too small to be measured by 6 groups of runs")
    assert small.endswith("with an error of 0.1 points")


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"realities": 0}, "the sweep left them out (--realities 0)"),
        ({"samples": 19}, "they need 20 or more samples of the environment, and the sweep has 19"),
    ],
)
def test_a_sweep_without_other_realities_says_why(
    widths: Path, tmp_path: Path, options: dict[str, Any], reason: str
) -> None:
    study = foldcar_api.sweep(widths, tmp_path / "s.db", jobs=2, **options)

    assert (study.experiments["1"].realities, study.experiments["1"].no_realities) == (0, reason)
    assert rows_of(tmp_path / "s.db") == []
    words = [word for name, value in options.items() for word in (f"--{name}", value)]
    assert json_output("sweep", widths, "--store", tmp_path / "s.db", *words)["realities"]["1"]["left_out"] == reason


def test_programs_that_cannot_be_changed_or_judged_have_none(tmp_path: Path, carsim_binary: Path) -> None:
    reasons = {
        "beside.scenic": "its program runs beside the simulation, which other realities cannot change",
        "unjudged.scenic": "the success rate cannot be learned: ",
    }
    texts = {
        "beside.scenic": "model foldcar.scenes.vocabulary.model\nego = new Robot\nnew Goal at (0, 1)\n"
        "require always ego.position.x < 9\n",
        "unjudged.scenic": "model foldcar.scenes.vocabulary.model\nego = new Robot\nterminate after 0.5 seconds\n",
    }
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
        data = listing_of(tmp_path / name, {"width": [95]}, timeout=2, environments=SAMPLES)
        listing = tmp_path / f"{name}.json"
        listing.write_text(json.dumps(data))

        swept(listing, tmp_path / f"{name}.db", carsim_binary, realities=40)

        realities, reason = facts_of(tmp_path / f"{name}.db")
        assert realities == 0 and reason.startswith(reasons[name]), reason


def test_an_experiment_in_a_reality_has_none(widths: Path, tmp_path: Path, refused: Any) -> None:
    (tmp_path / "high.json").write_text('{"obstacle_height": 1.2}')
    words = ("sweep", widths, "--store", tmp_path / "s.db", "--reality", tmp_path / "high.json")

    ((name, counts),) = json_output(*words)["realities"].items()

    assert name.startswith("1 (reality high")
    assert counts["left_out"] == "the experiment itself is simulated in another reality"
    assert refused(*words, "--realities", "5") == (
        "--realities: the runs of --reality are all in that reality; use only one of these options"
    )


def test_a_number_in_python_is_checked(widths: Path, tmp_path: Path) -> None:
    with pytest.raises(FoldcarError, match="realities: 1000001 is not an integer from 0 to 1000000"):
        foldcar_api.sweep(widths, tmp_path / "s.db", realities=1_000_001)


def test_changed_priors_or_spreads_draw_other_realities(
    widths: Path, tmp_path: Path, carsim_binary: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = tmp_path / "s.db"
    swept(widths, store, carsim_binary, realities=20)
    (experiment,) = read_study(widths).experiments
    before = reality_runs.realities_fingerprint(experiment)

    swept(write_widths(tmp_path, variation="workshop"), store, carsim_binary, realities=30)

    with Store.open(store) as opened:
        assert len(read_reality_runs(opened, "1").number) == 30
    assert len(rows_of(store)) == 50
    (changed,) = read_study(tmp_path / "widths.json").experiments
    assert reality_runs.realities_fingerprint(changed) != before
    wide = tuple(priors.replace(row, sd=2 * row.sd) for row in priors.PARAMETERS)
    for name, value in (("PARAMETERS", wide), ("CHECK", CHECK + 1)):
        with monkeypatch.context() as patch:
            patch.setattr(reality_runs, name, value)
            assert reality_runs.realities_fingerprint(experiment) != before
    assert reality_runs.realities_fingerprint(experiment) == before


def test_runs_of_designs_that_are_gone_are_not_read(widths: Path, tmp_path: Path, carsim_binary: Path) -> None:
    store = tmp_path / "s.db"
    swept(widths, store, carsim_binary, realities=40)
    data = listing_of(STEP_PYRAMIDS, {"width": [245, 300]}, timeout=60, environments=SAMPLES)
    widths.write_text(json.dumps(data))

    counts = swept(widths, store, carsim_binary, realities=40).realities["1"]

    with Store.open(store) as opened:
        runs = read_reality_runs(opened, "1")
        designs = opened.designs("1")
    kept = [row for row in rows_of(store)]
    assert len(kept) == 40 + counts.new and counts.new > 0
    # All runs of 245 mm are there, those of before too; none of 95 mm.
    assert [design["width_mm"] for design in designs.values()] == [245.0, 300.0]
    assert len(runs.number) == len(kept) - sum(draw_runs(_seed(store), range(40), 2, SAMPLES).design == 0)


def _seed(store: Path) -> int:
    with Store.open(store) as opened:
        return opened.info().experiments["1"].variation_seed


def test_failed_simulations_are_stored_as_unknown(widths: Path, tmp_path: Path, carsim_binary: Path) -> None:
    class Failing(LocalSimulators):
        """Simulators whose every second answer is an error."""

        def run(self, runner: Any, bodies: Any, scenes: Any, requests: Sequence[RunRequest]) -> Any:
            answers, seconds = super().run(runner, bodies, scenes, requests)
            if "another reality" not in requests[0].label:
                return answers, seconds
            return [{"error": "broken"} if at % 2 else answer for at, answer in enumerate(answers)], seconds

    sweep = Sweep(read_study(widths), tmp_path / "s.db", Carsim(carsim_binary), "a test", realities=40)
    counts = sweep.run(Failing(1)).realities["1"]

    assert counts.failed == 20 and counts.too_many_failed
    with Store.open(tmp_path / "s.db") as opened:
        assert np.isnan(read_reality_runs(opened, "1").passed).sum() == 20


def test_merged_stores_have_the_runs_of_both(widths: Path, tmp_path: Path, carsim_binary: Path) -> None:
    few, many, none = tmp_path / "few.db", tmp_path / "many.db", tmp_path / "none.db"
    for store, number in ((few, 30), (many, 50), (none, 0)):
        swept(widths, store, carsim_binary, realities=number)

    for name, stores in {"m1": [few, many, none], "m2": [none, many, few]}.items():
        merge_stores(stores, tmp_path / name)
        assert facts_of(tmp_path / name) == (50, "")
        with Store.open(tmp_path / name) as merged, Store.open(many) as opened:
            runs, expected = read_reality_runs(merged, "1"), read_reality_runs(opened, "1")
        for field in ("scores", "design", "sample", "passed", "number"):
            assert np.array_equal(getattr(runs, field), getattr(expected, field))
    with write_store(few) as writer:
        writer._run("UPDATE reality_run SET passed = 1 - passed WHERE number = 7")
    with pytest.raises(FoldcarError, match=r"^reality_run \(build_id .*number 7\): passed is .*one of them is not that"):
        merge_stores([few, many], tmp_path / "m3")


def test_rows_with_different_numbers_of_scores_are_damage(widths: Path, tmp_path: Path, carsim_binary: Path) -> None:
    store = tmp_path / "s.db"
    swept(widths, store, carsim_binary, realities=20)
    with write_store(store) as writer:
        writer._run("UPDATE reality_run SET scores = '[1.5]' WHERE number = 7")

    with Store.open(store) as opened, pytest.raises(FoldcarError, match="different numbers of scores"):
        read_reality_runs(opened, "1")


def test_a_dry_run_counts_them(widths: Path, tmp_path: Path) -> None:
    words = ("sweep", widths, "--store", tmp_path / "s.db", "--dry-run")

    without, given, default = (
        json_output(*words, *options) for options in (("--realities", "0"), ("--realities", "9"), ())
    )

    assert [result["experiments"][0]["realities"] for result in (without, given, default)] == [0, 9, 8000]
    assert given["bytes"] - without["bytes"] == 900
    assert default["seconds"] > without["seconds"]
    assert "and up to 8,000 runs in other realities" in run_foldcar(*words)
    assert "in other realities" not in run_foldcar(*words, "--realities", "0")


def test_a_stopping_rule_leaves_enough_scenes(tmp_path: Path, carsim_binary: Path) -> None:
    listing = write_widths(tmp_path, environments=60)

    counts = swept(listing, tmp_path / "s.db", carsim_binary, until="40pp", realities=50)

    assert counts.total < 120
    with Store.open(tmp_path / "s.db") as opened:
        runs = read_reality_runs(opened, "1")
        assert len(runs.number) == 50 and runs.sample.max() >= 40


def test_a_search_keeps_those_of_the_sweep(widths: Path, tmp_path: Path, carsim_binary: Path) -> None:
    store = tmp_path / "s.db"
    swept(widths, store, carsim_binary, realities=20)

    run_foldcar("optimize", widths, "--store", store, "--designs", "2", "--samples", "2")

    assert facts_of(store) == (20, "")
    with Store.open(store) as opened:
        assert len(read_reality_runs(opened, "1").number) == 20
        assert not any("realities" in sentence for sentence in remarks.on_runs(opened, opened.info().experiments["1"]))


def test_a_second_bar_counts_them(monkeypatch: pytest.MonkeyPatch) -> None:
    console = Console(file=io.StringIO(), force_terminal=True, width=100)
    monkeypatch.setattr(progress_bar, "shown_console", lambda stderr: console)
    progress = Progress(total=40, judged=40, new=40, passed=20)
    lines = []
    with progress_bar.ProgressBar(progress) as bar:
        bar.update(progress)
        lines.append(shown_lines(bar))
        progress.realities = {
            "1": RealityCounts(total=100, new=30, reused=10, seconds=2.0),
            "2": RealityCounts(total=60, new=30, seconds=1.0),
            "3": RealityCounts(left_out="the sweep left them out (--realities 0)"),
        }
        bar.update(progress)
        lines.append(shown_lines(bar))

    assert [line.split()[0] for line in lines[0]] == ["sweep"]
    sweep, realities = lines[1]
    assert sweep.startswith("sweep ") and "40/40" in sweep and "50 % passed" in sweep
    assert realities.startswith("realities ") and "70/160" in realities and "20 runs/s" in realities


def shown_lines(bar: progress_bar.ProgressBar) -> list[str]:
    """The lines of a bar, without colours."""
    plain = Console(file=io.StringIO(), width=100)
    plain.print(bar._bar.get_renderable())
    return plain.file.getvalue().splitlines()  # type: ignore[attr-defined,no-any-return]
