"""Exports: the rows as they stand in the store, whole files or none."""

import csv
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from foldcar.errors import FoldcarError
from foldcar.report.export import export_csv, export_parquet, list_type
from foldcar.simulation.results import METRICS, NUMBERS, Recorded
from foldcar.store.reader import Store
from foldcar.store.writer import PlannedRun
from test_store import answer, fill

KEYS = ["experiment", "vehicle", "environment", "sample", "outcome", "passed"]
COLUMNS = [*KEYS, *NUMBERS, "message", "width_mm", "height_mm"]


@pytest.fixture
def store_file(tmp_path: Path) -> Path:
    path = tmp_path / "s.db"
    fill(path)
    return path


def test_both_formats_have_a_row_per_run_and_read_back_exactly(tmp_path: Path, store_file: Path, foldcar: Any) -> None:
    done = foldcar("export", "s.db", "--csv", "runs.csv", "--parquet", "runs.parquet")
    assert done.stderr == "runs.csv: 4 runs\nruns.parquet: 4 runs\n"
    assert foldcar("export", "s.db", "--csv", "-").stdout == (tmp_path / "runs.csv").read_text()
    with Store.open(store_file) as store:
        results = list(store.results())

    with (tmp_path / "runs.csv").open(newline="") as file:
        header, *rows = csv.reader(file)
    for row, result in zip(rows, results, strict=True):
        cells = dict(zip(header, row, strict=True))
        assert cells["outcome"] == result.outcome
        assert float(cells["consumed_energy_j"]) == result.metrics["consumed_energy_j"]
        assert cells["width_mm"] == f"{result.design['width_mm']:g}"
    table = pq.read_table(tmp_path / "runs.parquet")
    assert table.column_names == header == COLUMNS
    assert table["elapsed_time_s"].to_pylist() == [r.metrics["elapsed_time_s"] for r in results]
    assert table["sample"].to_pylist() == [r.sample for r in results]
    assert table["width_mm"].to_pylist() == [r.design["width_mm"] for r in results]
    units = {field.name: field.metadata[b"unit"].decode() for field in table.schema if b"unit" in (field.metadata or {})}
    assert units == {**{metric.name: metric.unit for metric in METRICS}, "width_mm": "mm", "height_mm": "mm"}


@pytest.mark.parametrize(
    ("values", "kind"),
    [
        ([Recorded("series", [[0.0, 1], [0.5, None]])], "list<item: struct<time_s: double, value: double>>"),
        ([Recorded("series", [[0.0, [1, 2.5]]])], "list<item: struct<time_s: double, value: list<item: double>>>"),
        ([Recorded("final", ["a", "b"]), None], "list<item: string>"),
        ([Recorded("final", [True])], "list<item: bool>"),
        ([Recorded("final", [1.0, "a"])], None),
        ([Recorded("final", [1.0]), Recorded("series", [[0.0, 1.0]])], None),
        ([Recorded("final", [1.0]), Recorded("final", {"a": 1})], None),
    ],
)
def test_recorded_lists_that_are_alike_are_lists(values: Any, kind: str | None) -> None:
    list_kind = list_type(values)
    assert (None if list_kind is None else str(list_kind)) == kind


def test_recorded_values_are_columns_of_their_types(tmp_path: Path) -> None:
    recorded: list[dict[str, Any]] = [
        {"height": 0.5, "won": True, "side": "left", "mixed": 1},
        {"height": None, "won": False, "mixed": "one"},
        {"height": 2, "at": [1.0, 2.0]},
        {},
    ]

    def with_recorded(run: PlannedRun) -> dict[str, Any]:
        values = recorded[2 * run.design + run.sample]
        named = {name: {"kind": "final", "value": value} for name, value in values.items()}
        if run.design == 0:
            named["track"] = {"kind": "series", "value": [[0.25, run.sample]]}
        return {**answer(run), "recorded": named}

    fill(tmp_path / "s.db", answer=with_recorded)
    with Store.open(tmp_path / "s.db") as store:
        export_csv(store, tmp_path / "runs.csv")
        export_parquet(store, tmp_path / "runs.parquet")

    expected = {
        "recorded_at": [None, None, "[1.0, 2.0]", None],
        "recorded_height": [0.5, None, 2, None],
        "recorded_mixed": ["1", '"one"', None, None],
        "recorded_side": ["left", None, None, None],
        "recorded_track": ["[[0.25, 0]]", "[[0.25, 1]]", None, None],
        "recorded_won": [True, False, None, None],
    }
    table = pq.read_table(tmp_path / "runs.parquet")
    assert table.column_names == COLUMNS + list(expected)
    lists = {
        "recorded_at": [None, None, [1.0, 2.0], None],
        "recorded_track": [[{"time_s": 0.25, "value": 0.0}], [{"time_s": 0.25, "value": 1.0}], None, None],
    }
    assert {name: table[name].to_pylist() for name in expected} == {**expected, **lists}
    assert str(table.schema.field("recorded_at").type) == "list<element: double>"
    with (tmp_path / "runs.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    text = {None: "", True: "true", False: "false"}
    for name, values in expected.items():
        assert [row[name] for row in rows] == [
            text[value] if value is None or isinstance(value, bool) else str(value) for value in values
        ]


def test_failed_runs_have_a_message_and_no_numbers(tmp_path: Path) -> None:
    fill(tmp_path / "s.db", answer=lambda run: {"error": "crashed, badly"} if run.design else answer(run))
    with Store.open(tmp_path / "s.db") as store:
        export_csv(store, tmp_path / "runs.csv")
        export_parquet(store, tmp_path / "runs.parquet")

    with (tmp_path / "runs.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(row["outcome"], row["message"], row["elapsed_time_s"]) for row in rows] == [
        ("tipped", "", "0"), ("tipped", "", "1"),
        ("failed", "crashed, badly", ""), ("failed", "crashed, badly", ""),
    ]  # fmt: skip
    assert pq.read_table(tmp_path / "runs.parquet")["consumed_energy_j"].to_pylist() == [1 / 3, 1 / 3, None, None]


def test_an_export_that_fails_leaves_the_old_file(
    tmp_path: Path, store_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "runs.csv"
    target.write_text("old")

    def fail(*_: Any) -> Any:
        raise OSError(28, "No space left on device")
        yield

    monkeypatch.setattr(Store, "results", fail)
    for export in (export_csv, export_parquet):
        with Store.open(store_file) as store, pytest.raises(FoldcarError, match="cannot be written: No space"):
            export(store, target)
        assert target.read_text() == "old"
        assert {file.name for file in tmp_path.iterdir()} == {"runs.csv", "s.db"}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("none.db", "--csv", "a.csv"), "none.db: no such store"),
        (("s.db",), "export: nothing to write; use --csv FILE, --parquet FILE, --trials FILE or --digest"),
        (("s.db", "--csv", "none/b/a.csv"), "none/b/a.csv: cannot be written: the folder none does not exist"),
    ],
)
def test_mistakes_are_one_line(
    tmp_path: Path, store_file: Path, foldcar: Any, words: tuple[str, ...], message: str
) -> None:
    answer = foldcar("export", *words)

    assert answer.returncode == 2
    assert message in answer.stderr and answer.stderr.startswith("foldcar: error: ")
    assert answer.stderr.count("\n") == 1
    assert [file.name for file in tmp_path.iterdir()] == ["s.db"]
