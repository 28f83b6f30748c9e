"""Exports: the rows as they stand in the store, whole files or none."""

import csv
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from foldcar.errors import FoldcarError
from foldcar.export import export_csv, export_parquet
from foldcar.store import Store
from test_store import fill

COLUMNS = [
    "experiment", "vehicle", "environment", "sample", "outcome", "elapsed_time_s", "distance_to_target_m",
    "consumed_energy_j", "max_roll_rad", "max_pitch_rad", "width_mm", "height_mm",
]  # fmt: skip


@pytest.fixture
def store_file(tmp_path: Path) -> Path:
    path = tmp_path / "s.db"
    fill(path)
    return path


def test_csv_has_a_row_per_run_and_reads_back_exactly(tmp_path: Path, store_file: Path) -> None:
    with Store.open(store_file) as store:
        count = export_csv(store, tmp_path / "runs.csv")
        results = list(store.results())

    with (tmp_path / "runs.csv").open(newline="") as file:
        header, *rows = csv.reader(file)
    assert header == COLUMNS
    assert count == len(rows) == len(results) == 4
    for row, result in zip(rows, results, strict=True):
        cells = dict(zip(header, row, strict=True))
        assert cells["outcome"] == result.outcome
        assert float(cells["consumed_energy_j"]) == result.consumed_energy_j
        assert cells["width_mm"] == f"{result.design['width_mm']:g}"


def test_parquet_has_the_same_rows(tmp_path: Path, store_file: Path) -> None:
    with Store.open(store_file) as store:
        export_parquet(store, tmp_path / "runs.parquet")
        results = list(store.results())

    table = pq.read_table(tmp_path / "runs.parquet")
    assert table.column_names == COLUMNS
    assert table["elapsed_time_s"].to_pylist() == [r.elapsed_time_s for r in results]
    assert table["sample"].to_pylist() == [r.sample for r in results]
    assert table["width_mm"].to_pylist() == [r.design["width_mm"] for r in results]


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
        with (
            Store.open(store_file) as store,
            pytest.raises(FoldcarError, match="cannot be written: No space"),
        ):
            export(store, target)
        assert target.read_text() == "old"
        assert {file.name for file in tmp_path.iterdir()} == {"runs.csv", "s.db"}


def test_the_command_writes_files_and_standard_output(tmp_path: Path, store_file: Path, foldcar: Any) -> None:
    to_files = foldcar("export", "s.db", "--csv", "a.csv", "--parquet", "a.parquet")
    to_output = foldcar("export", "s.db", "--csv", "-")

    assert (to_files.returncode, to_output.returncode) == (0, 0)
    assert to_output.stdout == (tmp_path / "a.csv").read_text()
    assert pq.read_metadata(tmp_path / "a.parquet").num_rows == 4
    (tmp_path / "any").touch()
    assert (tmp_path / "a.csv").stat().st_mode == (tmp_path / "any").stat().st_mode


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("none.db", "--csv", "a.csv"), "none.db: no such store"),
        (("s.db",), "export: say what to write: --csv FILE or --parquet FILE"),
        (("s.db", "--csv", "none/a.csv"), "none/a.csv: cannot be written: No such file or directory"),
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
