"""Trials in the store: stored beside runs, imported, corrected with a record, exported, shown in the report."""

import csv
import json
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

from foldcar.analysis.rate import wilson_interval
from foldcar.cli import app
from foldcar.report.page_data import page_data
from foldcar.store.errors import StoreError
from foldcar.store.reader import Store
from foldcar.store.trial_records import Ending, TrialDesign
from foldcar.store.trial_writer import CarFacts, Drive, TrialWriter, now_utc, write_trials
from test_report_command import width_outcome
from written_study import write_study

PUBLISHED = Path(__file__).resolve().parents[2] / "scenarios" / "published_trials.csv"
HEADER = "vehicle_type,width_mm,outcome,count,source\n"


def begin(
    writer: TrialWriter, width_mm: float = 95, sample: int = 2, car: str | None = "built", log: str = "logs/t.tlog"
) -> int:
    drive = Drive({"id": "b"}, {"time_limit_s": 120}, {"friction": 0.6}, "fingerprint", "bumps.scenic", sample)
    moved = {"A": (0.01, -0.02, 0.5)}
    facts = CarFacts("0123", "abcd", "/dev/pts/7", car)
    return writer.begin("1", TrialDesign("W_B_W", {"width_mm": width_mm}), drive, moved, facts, log, "Ada")


def test_a_trial_is_aborted_until_it_is_completed(tmp_path: Path) -> None:
    with write_trials(tmp_path / "s.db") as writer:
        number = begin(writer)
        assert writer.unfinished() == [(number, "logs/t.tlog")]

    with Store.open(tmp_path / "s.db") as store:
        trial = store.trial(number)
    assert (trial.outcome, trial.ending, trial.completed) == ("aborted", "running", False)
    assert (trial.experiment, trial.sample, trial.operator, trial.log) == ("1", 2, "Ada", "logs/t.tlog")
    assert trial.deviations == {"A": (0.01, -0.02, 0.5)}

    with write_trials(tmp_path / "s.db") as writer:
        writer.complete(number, Ending("passed", "goal", 2.5, "fine", "ff"))
        assert writer.unfinished() == []
    with Store.open(tmp_path / "s.db") as store:
        trial = store.trial(number)
        assert store.trial_drive(number) == ('{"id":"b"}', '{"time_limit_s":120}', '{"friction":0.6}')
    assert (trial.outcome, trial.ending, trial.elapsed_time_s, trial.note) == ("passed", "goal", 2.5, "fine")
    assert trial.completed and trial.log_sha256 == "ff" and trial.ended_utc is not None


def test_trials_that_count_are_counted_by_sample(tmp_path: Path) -> None:
    with write_trials(tmp_path / "s.db") as writer:
        for sample, outcome, car in (
            (0, "passed", "built"), (0, "tipped", "built"), (0, "stuck", "built"), (1, "stuck", "built"),
            (1, "aborted", "built"), (0, "passed", "simulated"), (2, "passed", "simulated"), (2, "passed", None),
        ):  # fmt: skip
            writer.complete(begin(writer, sample=sample, car=car), Ending(outcome, "", None, "", None))
        writer.withdraw([3], True, "r", "")

        counts = writer.trial_counts("1", TrialDesign("W_B_W", {"width_mm": 95}), "fingerprint")

        assert counts == {0: 2, 1: 1}
        assert writer.trial_counts("1", TrialDesign("W_B_W", {"width_mm": 96}), "fingerprint") == {}


def test_corrections_leave_a_trail(tmp_path: Path, foldcar: Any) -> None:
    with write_trials(tmp_path / "s.db") as writer:
        writer.complete(begin(writer), Ending("passed", "goal", 2.5, "", None))

    answer = foldcar(
        "trials", "correct", "s.db", "1", "--outcome", "tipped", "--elapsed-time", "1.5",
        "--reason", "seen on film", "--operator", "Bo",
    )  # fmt: skip
    again = foldcar("trials", "correct", "s.db", "1", "--outcome", "stuck", "--reason", "no, stuck")

    assert (answer.returncode, again.returncode) == (0, 0), answer.stderr + again.stderr
    with Store.open(tmp_path / "s.db") as store:
        trial, trail = store.trial(1), store.corrections(1)
    assert (trial.outcome, trial.elapsed_time_s, trial.corrections) == ("stuck", 1.5, 3)
    assert [(c.field, c.before, c.after, c.reason, c.operator) for c in trail] == [
        ("outcome", "passed", "tipped", "seen on film", "Bo"),
        ("elapsed_time_s", 2.5, 1.5, "seen on film", "Bo"),
        ("outcome", "tipped", "stuck", "no, stuck", ""),
    ]
    assert 'outcome "passed" -> "tipped"' in foldcar("trials", "list", "s.db").stdout


def test_a_long_list_has_the_same_lines_and_reads_corrections_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    note = "[/] as [red]typed[/red], 5 \u03bcm"
    with write_trials(tmp_path / "s.db") as writer:
        for number in range(1, 5):
            writer.complete(begin(writer, 90.0 + number), Ending("passed", "goal", 2.5, note, None))
            writer.correct(number, {"outcome": "stuck"}, f"reason {number}", "Bo")
    read: list[object] = []
    corrections = Store.corrections
    monkeypatch.setattr(Store, "corrections", lambda *words: read.append(words) or corrections(*words))
    listed = []
    for most in (500, 1):
        monkeypatch.setattr("foldcar.shown_console.MOST_FRAMED", most)
        answer = CliRunner().invoke(app, ["trials", "list", str(tmp_path / "s.db")])
        assert answer.exit_code == 0, answer.output
        listed.append([line.rstrip() for line in answer.stdout.splitlines()])

    assert listed[0] == listed[1] and len(read) == 2
    assert sum(line.endswith(note) for line in listed[0]) == 4
    assert [line for line in listed[1] if line.startswith("* ")] == [
        f'* trial {number}: outcome "passed" -> "stuck" on {now_utc()[:10]} by Bo: reason {number}'
        for number in range(1, 5)
    ]


def test_the_published_table_is_imported_once(tmp_path: Path, foldcar: Any) -> None:
    first = foldcar("trials", "import", "s.db", PUBLISHED)
    second = foldcar("trials", "import", "s.db", PUBLISHED)

    assert first.stdout == "44 trials imported, 1 to 44; store: s.db\n", first.stderr
    assert second.returncode == 2 and "are in s.db already" in second.stderr
    counts: dict[float, list[int]] = {}
    with Store.open(tmp_path / "s.db") as store:
        for trial in store.trials():
            assert trial.design["radius_mm"] == 60 and trial.source is not None
            assert sum(trial.design[f"{part}_length_mm"] * n for part, n in (("W", 2), ("B", 1))) == 200
            counts.setdefault(trial.design["width_mm"], [0, 0])[trial.outcome != "passed"] += 1
    # The paper's Table 1: width, passed, failed.
    assert counts == {65: [0, 10], 95: [7, 3], 115: [3, 9], 180: [0, 12]}
    answer = foldcar("trials", "replay", "s.db", "1")
    assert answer.returncode == 2 and "trial 1 was imported without a scene" in answer.stderr


def test_exports_have_a_row_for_each_trial_and_parquet_numbers_lists_and_units(tmp_path: Path, foldcar: Any) -> None:
    with write_trials(tmp_path / "s.db") as writer:
        writer.complete(begin(writer), Ending("passed", "goal", 2.5, 'a "note"', "ff"))
        begin(writer, width_mm=120.5)

    assert foldcar("export", "s.db", "--trials", "t.csv").returncode == 0
    assert foldcar("export", "s.db", "--trials", "t.parquet").returncode == 0

    with (tmp_path / "t.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(row["trial"], row["width_mm"], row["outcome"], row["note"]) for row in rows] == [
        ("1", "95", "passed", 'a "note"'),
        ("2", "120.5", "aborted", ""),
    ]
    assert json.loads(rows[0]["deviations"]) == {"A": [0.01, -0.02, 0.5]}
    table = pq.read_table(tmp_path / "t.parquet")
    assert table["trial"].to_pylist() == [1, 2] and table["width_mm"].to_pylist() == [95.0, 120.5]
    assert table["elapsed_time_s"].to_pylist() == [2.5, None] and table["note"].to_pylist()[0] == 'a "note"'
    assert table["deviations"].to_pylist()[0] == [{"name": "A", "x_m": 0.01, "y_m": -0.02, "heading_rad": 0.5}]
    assert table.schema.field("elapsed_time_s").metadata[b"unit"] == b"s"
    assert table.schema.field("width_mm").metadata[b"unit"] == b"mm"


def test_a_sweep_and_a_session_keep_out_of_each_others_way(tmp_path: Path) -> None:
    with (
        write_trials(tmp_path / "s.db"),
        pytest.raises(StoreError, match="another sweep or trial is writing"),
        write_trials(tmp_path / "s.db"),
    ):
        pass


def test_a_car_that_the_file_does_not_tell_is_the_experiments_or_refused(tmp_path: Path, foldcar: Any) -> None:
    write_study(tmp_path / "s.db", {"width_mm": (95.0, 115.0)}, 3, width_outcome)
    (tmp_path / "t.csv").write_text(HEADER + "W_B_W,95,passed,1,me\nW_B_W,99,stuck,2,me\n")
    (tmp_path / "bad.csv").write_text("vehicle_type,height_mm,outcome,source\nW_B_W,50,passed,you\n")
    (tmp_path / "new.csv").write_text(HEADER + "W_B_W,95,passed,1,me\n")

    said = foldcar("trials", "import", "s.db", "t.csv", "--experiment", "1")
    refused = foldcar("trials", "import", "s.db", "bad.csv", "--experiment", "1")
    alone = foldcar("trials", "import", "new.db", "new.csv", "--experiment", "1")

    assert 'note: experiment "1" was swept without a car of width 99 mm' in said.stderr
    assert "it has 2 trials" in said.stderr
    assert refused.returncode == 2 and refused.stderr.count("\n") == 1
    assert 'bad.csv: line 2: width_mm: is not given; experiment "1" has several values' in refused.stderr
    assert "note: new.csv: does not tell all of its cars; taken by default: height 50 mm, radius 60 mm" in alone.stderr
    with Store.open(tmp_path / "s.db") as store:
        assert [trial.design["width_mm"] for trial in store.trials()] == [95, 99, 99]


def test_the_report_shows_trials_beside_runs(tmp_path: Path, foldcar: Any) -> None:
    write_study(tmp_path / "s.db", {"width_mm": (95.0, 115.0)}, 3, width_outcome)
    rows = [(95.0, "passed", 7), (95.0, "stuck", 3), (95.0, "aborted", 2), (97.0, "tipped", 1)]
    with write_trials(tmp_path / "s.db") as writer:
        for width, outcome, count in rows:
            design = {"width_mm": width, "height_mm": 50.0}
            row = {"experiment": "1", "vehicle_type": "W_B_W", "design": design, "source": "me", "car": "built"}
            writer.import_trials([{**row, "outcome": outcome}] * count)
        unknown_car = {"design": {"width_mm": 95.0, "height_mm": 60.0}, "source": "me", "car": "built"}
        writer.import_trials([{"experiment": "1", "vehicle_type": "W_B_W", "outcome": "passed", **unknown_car}])

    answer = foldcar("report", "s.db", "-o", "out", "--no-replay")

    assert answer.returncode == 0, answer.stderr
    with Store.open(tmp_path / "s.db") as store:
        (one,) = page_data(store)["experiments"]
    at = one["designs"]["name"].index("95 mm")
    assert (one["designs"]["trials"][at], one["designs"]["trials_passed"][at]) == (10, 7)
    ends = one["designs"]["trials_low"][at], one["designs"]["trials_high"][at]
    assert ends == pytest.approx(wilson_interval(7, 10), abs=1e-6)
    assert "1 trial of cars that do not belong to this family" in " ".join(one["remarks"])
    assert "7 of 10" in answer.stdout


def test_trials_alone_make_a_page(tmp_path: Path, foldcar: Any) -> None:
    foldcar("trials", "import", "s.db", PUBLISHED)
    with write_trials(tmp_path / "s.db") as writer:
        writer.complete(begin(writer, car="simulated"), Ending("passed", "goal", 2.5, "<b>", None))

    answer = foldcar("report", "s.db", "-o", "out", "--no-replay")

    assert answer.returncode == 0, answer.stderr
    page = (tmp_path / "out" / "index.html").read_text()
    assert "<title>foldcar report: s.db</title>" in page
    # 10 of 44 in the paper's Table 1.
    assert "10 of 44 trials of built cars passed; nothing was simulated to compare with." in page
    assert "1 of a simulated car (--simulated-trials shows them)" in page and "1 of a simulated" in answer.stdout
    assert "7 of 10" in answer.stdout
    assert [len(list((tmp_path / "out").glob(f"experiment_*.{suffix}"))) for suffix in ("svg", "png")] == [1, 1]


def test_a_store_without_runs_and_trials_has_no_report(tmp_path: Path, refused: Any) -> None:
    with write_trials(tmp_path / "s.db"):
        pass

    assert "holds no study yet" in refused("report", "s.db", "-o", "out", "--no-replay")
