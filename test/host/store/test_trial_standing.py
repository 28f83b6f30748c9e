"""Trials of simulated cars and withdrawn ones: marked wherever they are shown; they count only if that is wanted."""

import contextlib
import csv
import json
import re
import sqlite3
import uuid
from pathlib import Path
from typing import Any

import pytest

from browser import study_of
from foldcar.store.check import check_store
from foldcar.store.reader import Store
from foldcar.store.trial_records import Ending, TrialDesign
from foldcar.store.trial_writer import write_trials
from full_store import contents
from live_car import write_free_course
from test_report_command import EXPERIMENT_FACTS, width_outcome
from test_trial_store import begin
from written_study import add_trials, write_study

CARS = ("built", "built", "simulated", "simulated", None)


@pytest.fixture
def mixed(tmp_path: Path) -> Path:
    """A study of 95 and 115 mm with trials of 95 mm: built passed, stuck; simulated 2 passed; 1 unknown passed."""
    path = write_study(tmp_path / "s.db", {"width_mm": (95.0, 115.0)}, 3, width_outcome, **EXPERIMENT_FACTS)
    with write_trials(path) as writer:
        for outcome, car in zip(("passed", "stuck", "passed", "passed", "passed"), CARS, strict=True):
            row = {"experiment": "1", "vehicle_type": "W_B_W", "design": {"width_mm": 95.0, "height_mm": 50.0}}
            trial = {"uuid": str(uuid.uuid4()), "outcome": outcome, "source": "me", "car": car}
            writer.import_trials([{**row, **trial}])
    return path


def counted(folder: Path) -> tuple[int, int, int]:
    """Trials of 95 mm that count on the report's page, how many of them passed, and how many simulated cars it lists."""
    (experiment,) = study_of(folder)["experiments"]
    at = experiment["designs"]["name"].index("95 mm")
    simulated = sum(trial["standing"] == "simulated" for trial in experiment["trials"])
    return experiment["designs"]["trials"][at], experiment["designs"]["trials_passed"][at], simulated


def test_the_report_counts_built_cars_and_says_what_is_left_out(mixed: Path, foldcar: Any) -> None:
    plain = foldcar("report", "s.db", "-o", "plain")
    done = foldcar("report", "s.db", "-o", "asked", "--simulated-trials")

    assert (plain.returncode, done.returncode) == (0, 0), plain.stderr + done.stderr
    page = (mixed.parent / "plain" / "index.html").read_text()
    assert counted(mixed.parent / "plain") == (2, 1, 0)
    assert "Trials left out: 2 of a simulated car (--simulated-trials counts them); 1 of a car that may be" in page
    assert "Trials left out: 2 of a simulated car" in plain.stdout
    page = (mixed.parent / "asked" / "index.html").read_text()
    # Both simulated cars passed; they count like the built ones, and the page's first sentence says so.
    assert counted(mixed.parent / "asked") == (4, 3, 2)
    (experiment,) = study_of(mixed.parent / "asked")["experiments"]
    first = "Trials of SIMULATED cars count here as trials of built ones. "
    assert experiment["headline"].startswith(first) and first in " ".join(done.stdout.split()) + " "
    assert "SIMULATED cars drove 2 of 4 trials." in experiment["remarks"]
    assert "foldcar report s.db -o asked --simulated-trials" in page
    for command in ("select", "compare"):
        assert first.strip() in " ".join(foldcar(command, "s.db", "--simulated-trials").stdout.split())
        assert "SIMULATED" not in foldcar(command, "s.db").stdout


def test_the_export_leaves_them_out_too(mixed: Path, foldcar: Any) -> None:
    plain = foldcar("export", "s.db", "--trials", "plain.csv")
    done = foldcar("export", "s.db", "--trials", "asked.csv", "--simulated-trials")

    def cars(name: str) -> list[str]:
        with (mixed.parent / name).open(newline="") as file:
            return [row["car"] for row in csv.DictReader(file)]

    assert cars("plain.csv") == ["built"] * 2 and cars("asked.csv") == ["built"] * 2 + ["simulated"] * 2
    assert plain.stderr.startswith("plain.csv: 2 trials\nplain.csv: Trials left out: 2 of a simulated car")
    assert done.stderr.startswith("asked.csv: 4 trials\nasked.csv: Trials left out: 1 of a car that may be built")


def test_the_list_marks_them(mixed: Path, foldcar: Any) -> None:
    listed = foldcar("trials", "list", "s.db").stdout

    cars = [re.split(r"  +", line.strip())[4] for line in listed.splitlines()[1:6]]
    assert cars == ["built", "built", "simulated", "simulated", "unknown"]
    assert "5 trials\nof built cars: 1 of 2 passed, 0 aborted\n" in listed
    assert "of a simulated car: 2 of 2 passed, 0 aborted; these do not count\n" in listed
    assert "of a car that may be built or simulated: 1 of 1 passed, 0 aborted; these do not count\n" in listed


def test_a_withdrawn_trial_counts_nowhere_and_leaves_a_trail(mixed: Path, foldcar: Any) -> None:
    foldcar("export", "s.db", "--trials", "before.csv")
    answer = foldcar("trials", "withdraw", "s.db", "1", "3", "--reason", "wrong tyres", "--operator", "Ada")

    assert answer.returncode == 0, answer.stderr
    lines = [r"\* trial 1: withdrawn on \d{4}-\d\d-\d\d by Ada: wrong tyres", r"\* trial 3: withdrawn on .*"]
    assert re.fullmatch("\n".join(lines) + "\n", answer.stdout)
    listed = foldcar("trials", "list", "s.db").stdout
    assert "of built cars: 0 of 1 passed" in listed and "withdrawn: 2 of 2 passed" in listed
    assert listed.count("passed, withdrawn") == 2 and "by Ada: wrong tyres" in listed
    exported = foldcar("export", "s.db", "--trials", "after.csv")
    assert exported.stderr.startswith("after.csv: 1 trial\n") and "2 withdrawn" in exported.stderr
    again = foldcar("trials", "withdraw", "s.db", "2", "1", "--reason", "r")
    assert (again.returncode, again.stderr) == (2, "foldcar: error: s.db: trial 1 is withdrawn already\n")
    restored = foldcar("trials", "restore", "s.db", "1", "3", "--reason", "they were right")
    assert restored.returncode == 0 and "trial 3: restored on " in restored.stdout
    foldcar("export", "s.db", "--trials", "restored.csv")
    before, after = (
        list(csv.DictReader((mixed.parent / f"{name}.csv").read_text().splitlines())) for name in ("before", "restored")
    )
    changes = [[(c["before"], c["after"]) for c in json.loads(row.pop("corrections") or "[]")] for row in after]
    assert [{**row, "corrections": ""} for row in after] == before and changes == [[(0, 1), (1, 0)], []]
    with Store.open(mixed) as store:
        trail = [(c.field, c.before, c.after, c.reason, c.operator) for c in store.corrections(1)]
    assert trail == [("withdrawn", 0, 1, "wrong tyres", "Ada"), ("withdrawn", 1, 0, "they were right", "")]
    assert check_store(mixed).findings == []


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("restore", "s.db", "1", "--reason", "r"), "s.db: trial 1 is not withdrawn"),
        (("withdraw", "s.db", "2", "77", "--reason", "r"), "s.db: has no trial 77"),
        (("correct", "s.db", "5", "--reason", "r", "--kind", "real"), "s.db: trial 5: car: 'real' is not one of built, "),
        (("correct", "s.db", "6", "--reason", "r", "--kind", "built"),
         "s.db: trial 6: car: the car itself reported that it is simulated; this cannot be corrected"),
    ],
)  # fmt: skip
def test_mistakes_change_nothing(mixed: Path, foldcar: Any, words: tuple[str, ...], message: str) -> None:
    with write_trials(mixed) as writer:
        assert begin(writer, car="simulated") == 6
    before = contents(mixed)

    answer = foldcar("trials", *words)

    assert (answer.returncode, answer.stdout) == (2, "")
    assert answer.stderr.startswith(f"foldcar: error: {message}") and answer.stderr.count("\n") == 1
    assert contents(mixed) == before and not (mixed.parent / "none.db").exists()


def test_a_person_says_what_drove_where_no_car_did(mixed: Path, foldcar: Any) -> None:
    answer = foldcar("trials", "correct", "s.db", "5", "--kind", "built", "--reason", "I drove it", "--operator", "Bo")

    assert 'trial 5: car none -> "built"' in answer.stdout, answer.stderr
    exported = foldcar("export", "s.db", "--trials", "t.csv")
    assert exported.stderr.startswith("t.csv: 3 trials\n")
    assert foldcar("trials", "correct", "s.db", "5", "--kind", "simulated", "--reason", "no").returncode == 0


def test_the_next_sample_depends_on_trials_that_count(tmp_path: Path) -> None:
    with write_trials(tmp_path / "s.db") as writer:
        for sample, car in ((0, "built"), (0, "built"), (0, "simulated"), (1, "simulated"), (1, None)):
            writer.complete(begin(writer, sample=sample, car=car), Ending("passed", "", None, "", None))
        writer.withdraw([2], True, "r", "")
        for outcome in ("stuck", "aborted"):
            writer.complete(begin(writer, sample=2), Ending(outcome, "", None, "", None))

        counts, none = (
            writer.trial_counts("1", TrialDesign("W_B_W", {"width_mm": width}), "fingerprint") for width in (95, 96)
        )

    assert (counts, none) == ({0: 1, 2: 1}, {})


def test_any_sqlite_tool_reads_the_view(mixed: Path, foldcar: Any) -> None:
    with write_trials(mixed) as writer:
        writer.complete(begin(writer, sample=4), Ending("tipped", "goal", 2.5, "n", None))
        begin(writer, car="simulated")
        writer.withdraw([2], True, "wrong tyres", "Ada")

    with contextlib.closing(sqlite3.connect(mixed)) as connection:
        connection.row_factory = sqlite3.Row
        width = "json_extract(parameters, '$.width_mm') AS width_mm"
        rows = [dict(row) for row in connection.execute(f"SELECT *, {width} FROM trial_result")]
        (share,) = connection.execute("SELECT avg(outcome = 'passed') FROM trial_result WHERE counts").fetchone()
    assert [(r["trial"], r["car"], r["withdrawn"], r["counts"], r["width_mm"]) for r in rows] == [
        (1, "built", 0, 1, 95), (2, "built", 1, 0, 95), (3, "simulated", 0, 0, 95), (4, "simulated", 0, 0, 95),
        (5, "unknown", 0, 0, 95), (6, "built", 0, 1, 95), (7, "simulated", 0, 0, 95),
    ]  # fmt: skip
    assert [r["withdrawn_because"] for r in rows[:3]] == [None, "wrong tyres", None] and rows[1]["corrections"] == 1
    assert (rows[5]["sample"], rows[5]["scenic_program"], rows[5]["outcome"]) == (4, "bumps.scenic", "tipped")
    # The experiment's own program and environment, where nothing says that the trial had another.
    assert rows[0]["environment"] is not None and rows[0]["scenic_program"] is not None
    assert share == 0.5


def test_designs_are_named_by_all_parameters_that_vary(tmp_path: Path, foldcar: Any) -> None:
    """The trials are of one width and two radii; the family has several of both."""
    varied = {"width_mm": (95.0, 115.0), "radius_mm": (50.0, 60.0)}
    store = write_study(tmp_path / "s.db", varied, 2, lambda design, sample: "passed")
    add_trials(store, [({"width_mm": 95.0, "radius_mm": radius}, 0, "passed") for radius in (50.0, 60.0)])

    listed = foldcar("trials", "list", "s.db").stdout

    assert "width 95 mm, radius 50 mm" in listed and "width 95 mm, radius 60 mm" in listed


def test_a_car_with_other_parts_is_named_by_its_type(tmp_path: Path, foldcar: Any) -> None:
    """In the list, in the remark on its import, and in the remarks of `compare`, between semicolons."""
    write_free_course(tmp_path)
    assert foldcar("sweep", "l.json", "--store", "s.db").returncode == 0
    lines = ["vehicle_type,width_mm,height_mm,outcome,source,experiment"]
    for kind in ("W_B_W,95,", "W_B_W+tyre=grip_tape,95,", "W_B_W,95,60"):
        lines += [f"{kind},passed,notes,1"] * 2
    (tmp_path / "t.csv").write_text("\n".join(lines))

    imported = foldcar("trials", "import", "s.db", "t.csv")

    assert "swept without a car of W_B_W+tyre=grip_tape of 95 mm; it has 2 trials" in imported.stderr, imported.stderr
    assert "swept without a car of 95 mm" not in imported.stderr
    listed = foldcar("trials", "list", "s.db").stdout
    assert listed.count("  W_B_W+tyre=grip_tape of width 95 mm, ") == 2 and listed.count("  W_B_W of width 95 mm, ") == 4
    compared = foldcar("compare", "s.db").stdout
    assert (
        "Some trials of 95 mm; W_B_W+tyre=grip_tape of 95 mm; width 95 mm, height 60 mm have no car's name." in compared
    )
