"""Trials in the store: stored beside runs, imported, corrected with a record, exported, shown in the report."""

import csv
import hashlib
import json
import os
import re
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from foldcar.report.page_data import page_data
from foldcar.store.errors import StoreError
from foldcar.store.reader import Store
from foldcar.store.trial_records import Ending, TrialDesign
from foldcar.store.trial_writer import CarFacts, Drive, TrialWriter, write_trials
from foldcar.trials.drive_end import DriveEnd
from foldcar.trials.recording import record_outcome, store_end
from test_report_command import EXPERIMENT_FACTS, width_outcome
from written_study import import_trials, write_study

PUBLISHED = Path(__file__).resolve().parents[3] / "scenarios" / "published_trials.csv"
HEADER = "vehicle_type,width_mm,outcome,count,source\n"
WIDTHS = {"width_mm": (95.0, 115.0)}

LOG = "s-logs/trial-0001-20261122T113100Z.tlog"


def begin(writer: TrialWriter, width_mm: float = 95, sample: int = 2, car: str | None = "built") -> int:
    drive = Drive({"id": "b"}, {"time_limit_s": 120}, {"friction": 0.6}, "fingerprint", "bumps.scenic", sample)
    moved = {"A": (0.01, -0.02, 0.5)}
    facts = CarFacts("0123", "abcd", "/dev/pts/7", car)
    return writer.begin("1", TrialDesign("W_B_W", {"width_mm": width_mm}), drive, moved, facts, LOG, "Ada")


def test_a_trial_is_aborted_until_it_is_completed(tmp_path: Path) -> None:
    with write_trials(tmp_path / "s.db") as writer:
        number = begin(writer)
        assert writer.unfinished() == [(number, LOG, "aborted")]

    with Store.open(tmp_path / "s.db") as store:
        trial = store.trial(number)
    assert (trial.outcome, trial.ending, trial.completed) == ("aborted", "running", False)
    assert (trial.experiment, trial.sample, trial.operator, trial.log) == ("1", 2, "Ada", LOG)
    assert trial.deviations == {"A": (0.01, -0.02, 0.5)}

    with write_trials(tmp_path / "s.db") as writer:
        writer.complete(number, Ending("passed", "goal", 2.5, "fine", "ff"))
        assert writer.unfinished() == []
    with Store.open(tmp_path / "s.db") as store:
        trial = store.trial(number)
        assert store.trial_drive(number) == ('{"id":"b"}', '{"time_limit_s":120}', '{"friction":0.6}')
    assert (trial.outcome, trial.ending, trial.elapsed_time_s, trial.note) == ("passed", "goal", 2.5, "fine")
    assert trial.completed and trial.log_sha256 == "ff" and trial.ended_utc is not None


def test_photos_have_names_that_every_command_reads(tmp_path: Path, foldcar: Any) -> None:
    """Such as links into a folder of other names (git-annex), and names that would end a line."""
    (tmp_path / "annex").mkdir()
    (tmp_path / "annex" / "SHA256E-s5--1f").write_bytes(b"photo")
    (tmp_path / "link.jpg").symlink_to(tmp_path / "annex" / "SHA256E-s5--1f")
    (tmp_path / "a\ntrial 9: photo forged.jpg").write_bytes(b"two lines")
    (tmp_path / "folder.jpg").mkdir()
    latin = Path(os.fsdecode(os.fsencode(tmp_path) + b"/\xe9.jpg"))
    latin.write_bytes(b"latin")
    with write_trials(tmp_path / "s.db") as writer:
        writer.complete(begin(writer), Ending("passed", "goal", 2.5, "", None))
        writer.put_media(1, "photo", tmp_path / "link.jpg")
        writer.put_media(1, "photo", tmp_path / "a\ntrial 9: photo forged.jpg")
        with pytest.raises(StoreError, match=r"folder\.jpg: is not a file"):
            writer.put_media(1, "photo", tmp_path / "folder.jpg")
        with pytest.raises(StoreError, match="its path is not UTF-8 text; rename it"):
            writer.put_media(1, "photo", latin)

    listed = foldcar("trials", "list", "s.db").stdout
    assert "trial 1: photo link.jpg\n" in listed
    assert "\ntrial 1: photo a\\ntrial 9: photo forged.jpg\n" in listed
    assert foldcar("trials", "import", "n.db", "s.db").returncode == 0
    with Store.open(tmp_path / "n.db") as store:
        assert {medium.sha256 for medium in store.media()} == {
            hashlib.sha256(content).hexdigest() for content in (b"photo", b"two lines")
        }


def test_an_outcome_that_cannot_be_stored_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    end = DriveEnd("goal", "passed", 2.5)
    with write_trials(tmp_path / "s.db") as writer:
        number = begin(writer)
        store_end(writer, number, end, tmp_path / LOG)

        def full(*_: object) -> None:
            raise StoreError("s.db: database or disk is full")

        monkeypatch.setattr(writer, "complete", full)
        message = (
            "s.db: database or disk is full; trial 1 remains stored as passed; "
            "enter stuck later with `foldcar trials correct`"
        )
        with pytest.raises(StoreError, match=re.escape(message)):
            record_outcome(writer, number, end, tmp_path / LOG, None, "stuck", "", None)


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


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("correct", "s.db", "1", "--reason", "r"), "trials correct: nothing to change"),
        (("correct", "s.db", "1", "--reason", " ", "--note", "n"), "trials correct: --reason: is empty"),
        (("correct", "s.db", "9", "--reason", "r", "--note", "n"), "s.db: has no trial 9"),
        (("correct", "s.db", "1", "--reason", "r", "--outcome", "flew"), "s.db: trial 1: outcome: 'flew' is not one of"),
        (("correct", "s.db", "1", "--reason", "r", "--elapsed-time", "inf"), "s.db: trial 1: elapsed_time_s: inf is not"),
        (("replay", "s.db", "9"), "s.db: has no trial 9"),
    ],
)
def test_mistakes_are_one_line(tmp_path: Path, foldcar: Any, words: tuple[str, ...], message: str) -> None:
    with write_trials(tmp_path / "s.db") as writer:
        writer.complete(begin(writer), Ending("passed", "goal", 2.5, "", None))

    answer = foldcar("trials", *words)

    assert (answer.returncode, answer.stdout) == (2, "")
    assert answer.stderr.startswith(f"foldcar: error: {message}") and answer.stderr.count("\n") == 1
    with Store.open(tmp_path / "s.db") as store:
        assert store.trial(1).outcome == "passed" and store.corrections(1) == []


@pytest.mark.parametrize(
    ("outcome", "time_s", "words", "is_taken"),
    [
        ("passed", 2.5, ("--elapsed-time", "120.2"), False),
        ("passed", 2.5, ("--elapsed-time", "120.0"), True),
        ("timeout", 120.0, ("--outcome", "passed", "--elapsed-time", "130"), False),
        ("timeout", 120.0, ("--outcome", "passed", "--elapsed-time", "119"), True),
        ("passed", 2.5, ("--outcome", "tipped", "--elapsed-time", "130"), True),
    ],
)
def test_a_trial_does_not_pass_after_its_time_limit(
    outcome: str, time_s: float, words: tuple[str, ...], is_taken: bool, tmp_path: Path, foldcar: Any
) -> None:
    with write_trials(tmp_path / "s.db") as writer:
        writer.complete(begin(writer), Ending(outcome, "goal", time_s, "", None))

    answer = foldcar("trials", "correct", "s.db", "1", *words, "--reason", "seen on film")

    with Store.open(tmp_path / "s.db") as store:
        trial = store.trial(1)
    if is_taken:
        assert answer.returncode == 0 and trial.corrections
    else:
        limit = f"elapsed_time_s: {float(words[-1]):g} is above the trial's time limit of 120 s, so it has not passed"
        assert (answer.returncode, answer.stderr) == (2, f"foldcar: error: s.db: trial 1: {limit}\n")
        assert (trial.outcome, trial.elapsed_time_s, trial.corrections) == (outcome, time_s, 0)


def test_the_published_table_is_imported_once(tmp_path: Path, foldcar: Any) -> None:
    first = foldcar("trials", "import", "s.db", PUBLISHED)
    second = foldcar("trials", "import", "s.db", PUBLISHED)

    assert first.stdout == "44 trials imported, 1 to 44; store: s.db\n", first.stderr
    assert second.stdout == "0 trials imported; 44 were imported before; store: s.db\n", second.stderr
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


def test_a_sheet_that_grew_imports_its_new_rows_and_one_that_changed_is_refused(tmp_path: Path, foldcar: Any) -> None:
    rows = "W_B_W,95,passed,2,me\nW_B_W,99,stuck,1,me\n"
    (tmp_path / "t.csv").write_text(HEADER + rows)
    more = "W_B_W,99,tipped,1,me\nW_B_W,95,stuck,1,you\n"
    (tmp_path / "grown.csv").write_text(HEADER + rows.replace(",2,", ",3,") + more)
    (tmp_path / "changed.csv").write_text(HEADER + rows.replace("stuck", "tipped"))

    first, grown, changed = (foldcar("trials", "import", "s.db", name, "--experiment", "1")
                             for name in ("t.csv", "grown.csv", "changed.csv"))  # fmt: skip

    assert first.stdout == "3 trials imported, 1 to 3; store: s.db\n", first.stderr
    assert grown.stdout == "3 trials imported, 4 to 6; 3 were imported before; store: s.db\n", grown.stderr
    assert changed.returncode == 2
    assert changed.stderr.splitlines()[-1] == (
        'foldcar: error: s.db: trial 3 was imported from the same row of "me", but outcome was stuck, not tipped: '
        "correct it, or give other rows another source"
    )
    # A correction is no other row.
    foldcar("trials", "correct", "s.db", "3", "--outcome", "tipped", "--reason", "seen on the film")
    again = foldcar("trials", "import", "s.db", "t.csv", "--experiment", "1")
    assert again.stdout == "0 trials imported; 3 were imported before; store: s.db\n", again.stderr
    with Store.open(tmp_path / "s.db") as store:
        assert [trial.outcome for trial in store.trials()] == ["passed", "passed", "tipped", "passed", "tipped", "stuck"]


def test_exports_have_a_row_for_each_trial_and_in_parquet_numbers_lists_and_units(tmp_path: Path, foldcar: Any) -> None:
    with write_trials(tmp_path / "s.db") as writer:
        writer.complete(begin(writer), Ending("passed", "goal", 2.5, 'a "note"', "ff"))
        begin(writer, width_mm=120.5)

    for file in ("t.csv", "t.parquet"):
        answer = foldcar("export", "s.db", "--trials", file)
        assert answer.returncode == 0, answer.stderr

    with (tmp_path / "t.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len({row["uuid"] for row in rows}) == 2 and all(len(row["uuid"]) == 36 for row in rows)
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


def test_a_car_that_the_file_does_not_tell_is_the_experiments_or_refused(tmp_path: Path, foldcar: Any) -> None:
    write_study(tmp_path / "s.db", WIDTHS, 3, width_outcome, **EXPERIMENT_FACTS)
    (tmp_path / "t.csv").write_text(HEADER + "W_B_W,95,passed,1,me\nW_B_W,99,stuck,2,me\n")
    (tmp_path / "bad.csv").write_text("vehicle_type,height_mm,outcome,source\nW_B_W,50,passed,you\n")
    (tmp_path / "new.csv").write_text(HEADER + "W_B_W,95,passed,1,me\n")

    done = foldcar("trials", "import", "s.db", "t.csv", "--experiment", "1")
    refused = foldcar("trials", "import", "s.db", "bad.csv", "--experiment", "1")
    alone = foldcar("trials", "import", "new.db", "new.csv", "--experiment", "1")

    assert 'note: experiment "1" was swept without a car of width 99 mm' in done.stderr
    assert "it has 2 trials" in done.stderr
    assert refused.returncode == 2 and refused.stderr.count("\n") == 1
    assert 'bad.csv: line 2: width_mm: missing; experiment "1" has several values' in refused.stderr
    assert (
        "new.csv: does not have all parameters of its cars; defaults are used: height 50 mm, radius 60 mm" in alone.stderr
    )
    with Store.open(tmp_path / "s.db") as store:
        assert [trial.design["width_mm"] for trial in store.trials()] == [95, 99, 99]


def test_the_report_shows_trials_beside_runs(tmp_path: Path) -> None:
    write_study(tmp_path / "s.db", WIDTHS, 3, width_outcome, **EXPERIMENT_FACTS)
    trials = [(95.0, "passed")] * 7 + [(95.0, "stuck")] * 3 + [(95.0, "aborted")] * 2 + [(97.0, "tipped")]
    import_trials(tmp_path / "s.db", [({"width_mm": width}, None, outcome) for width, outcome in trials])
    with write_trials(tmp_path / "s.db") as writer:
        unknown_car = {"uuid": "u", "design": {"width_mm": 95.0, "height_mm": 60.0}, "source": "me", "car": "built"}
        writer.import_trials([{"experiment": "1", "vehicle_type": "W_B_W", "outcome": "passed", **unknown_car}])

    with Store.open(tmp_path / "s.db") as store:
        (experiment,) = page_data(store)["experiments"]
    at = experiment["designs"]["name"].index("95 mm")
    assert (experiment["designs"]["trials"][at], experiment["designs"]["trials_passed"][at]) == (10, 7)
    # Wilson's score interval of 7 in 10 at z = 1.959964, solved by hand.
    z, n, p = 1.959964, 10, 0.7
    middle = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * (p * (1 - p) / n + z * z / (4 * n * n)) ** 0.5
    ends = experiment["designs"]["trials_low"][at], experiment["designs"]["trials_high"][at]
    assert ends == pytest.approx((middle - half, middle + half), abs=1e-6)
    assert "1 trial of cars that do not belong to this family" in " ".join(experiment["remarks"])


def test_trials_alone_make_a_page(tmp_path: Path, foldcar: Any) -> None:
    foldcar("trials", "import", "s.db", PUBLISHED)
    with write_trials(tmp_path / "s.db") as writer:
        writer.complete(begin(writer, car="simulated"), Ending("passed", "goal", 2.5, "<b>", None))

    answer = foldcar("report", "s.db", "-o", "out")

    assert answer.returncode == 0, answer.stderr
    page = (tmp_path / "out" / "index.html").read_text()
    assert "<title>foldcar report: s.db</title>" in page
    # 10 of 44 in the paper's Table 1.
    assert "10 of 44 trials of built cars passed; nothing was simulated to compare with." in page
    assert "1 of a simulated car (--simulated-trials counts them)" in page and "1 of a simulated" in answer.stdout
    assert "7 of 10" in answer.stdout
    assert [len(list((tmp_path / "out").glob(f"experiment_*.{suffix}"))) for suffix in ("svg", "png")] == [1, 1]
