"""A store as a folder: all of it, readable without foldcar, the same store again; bad folders refused whole."""

import csv
import json
import shutil
import zlib
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from foldcar.errors import FoldcarError
from foldcar.store.check import check_store
from foldcar.store.errors import StoreError
from foldcar.store.folder import export_folder, import_folder
from foldcar.store.migrations import VERSION
from foldcar.store.reader import Store
from foldcar.store.rows import checksum
from foldcar.store.tables import TABLES, TRIAL
from foldcar.store.trial_records import Ending
from foldcar.store.trial_writer import write_trials
from foldcar.store.writer import PlannedRun
from old_stores import contents
from test_store import RECORDED, answer, fill
from test_trial_store import begin

ODD = 'a "quoted", text;\r\nwith ünicode 🚗, \\N and\ttabs\n'


def exported(store: Path, folder: Path, kind: str = "csv") -> Path:
    with Store.open(store) as opened:
        export_folder(opened, folder, kind)
    return folder


def files(folder: Path) -> dict[str, bytes]:
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_a_folder_makes_the_same_store_again(tmp_path: Path, store: Path, foldcar: Any, kind: str) -> None:
    out = foldcar("export", "s.db", "--folder", "out", "--format", kind)
    back = foldcar("import", "out", "--store", "new/s.db")
    again = foldcar("export", "new/s.db", "--folder", "again", "--format", kind)

    assert (out.returncode, back.returncode, again.returncode) == (0, 0, 0), out.stderr + back.stderr + again.stderr
    assert back.stdout == out.stderr.replace("out: ", "new/s.db: ")
    assert contents(tmp_path / "new" / "s.db") == contents(tmp_path / "s.db")
    assert files(tmp_path / "out") == files(tmp_path / "again")
    assert check_store(tmp_path / "new" / "s.db").findings == []
    assert files(tmp_path / "new" / "s-logs") == files(tmp_path / "s-logs") != {}


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_odd_values_come_back_to_the_last_bit(tmp_path: Path, kind: str) -> None:
    def odd(run: PlannedRun) -> dict[str, Any]:
        if run.design:
            return {"error": ODD}
        numbers = {"elapsed_time_s": 5e-324, "distance_to_target_m": None, "max_roll_rad": -0.0, "max_pitch_rad": 1.7e308}
        return {**answer(run), **numbers, "recorded": RECORDED}

    path = tmp_path / "s.db"
    fill(path, answer=odd)
    with write_trials(path) as writer:
        number = begin(writer)
        writer.complete(number, Ending("passed", "goal", 2.0, "", None))
        writer.correct(number, {"note": "1.5", "elapsed_time_s": 3.0}, ODD, "")
        writer.correct(number, {"note": ODD}, "no", "ü")
        writer.correct(number, {"note": ""}, "none", "")

    new = tmp_path / "new" / "s.db"
    import_folder(exported(path, tmp_path / "out", kind), new)

    assert contents(new) == contents(path)
    assert files(exported(new, tmp_path / "again", kind)) == files(tmp_path / "out")
    with Store.open(new) as opened:
        assert [(c.before, c.after) for c in opened.corrections(1)] == [
            ("", "1.5"), (2.0, 3.0), ("1.5", ODD), (ODD, ""),
        ]  # fmt: skip
        assert {result.message for result in opened.results()} == {None, ODD}


def test_the_folder_explains_itself(tmp_path: Path, store: Path) -> None:
    folder = exported(store, tmp_path / "out")

    explained = (folder / "README.txt").read_text()
    for table in TABLES:
        assert f"\n{table.name}.csv: a row is " in explained
        with (folder / f"{table.name}.csv").open(newline="") as file:
            header = next(csv.reader(file))
        for name in header[:-1]:
            assert f"\n    {name}: " in explained.partition(f"\n{table.name}.csv: ")[2]
    assert "    consumed_energy_j: electrical energy drawn from the servo supply, in J" in explained
    manifest = json.loads((folder / "manifest.json").read_text())
    assert set(manifest["files"]) == set(files(folder))
    listing = json.loads((folder / "listing.json").read_text())
    assert set(listing["experiments"]) == {"1", "recorded"}


def test_others_verify_the_tables_as_the_readme_tells_it(tmp_path: Path, store: Path) -> None:
    table = pq.read_table(exported(store, tmp_path / "p", "parquet") / "run.parquet")
    for row in table.to_pylist():
        told = row.pop("checksum")
        there = {name: value for name, value in row.items() if value is not None}
        assert zlib.crc32(b"run" + json.dumps(there, sort_keys=True, separators=(",", ":")).encode("ascii")) == told


def test_logs_that_are_gone_do_not_lock_the_rest_away(tmp_path: Path, store: Path, foldcar: Any) -> None:
    gone, kept = sorted((tmp_path / "s-logs").iterdir())
    gone.unlink()

    out = foldcar("export", "s.db", "--folder", "out")
    back = foldcar("import", "out", "--store", "new/s.db")

    assert out.returncode == back.returncode == 0
    assert f"s.db: log s-logs/{gone.name} is gone\n" in out.stderr
    assert [file.name for file in (tmp_path / "new" / "s-logs").iterdir()] == [kept.name]


def test_an_export_replaces_an_export_and_nothing_else(tmp_path: Path, store: Path, foldcar: Any) -> None:
    exported(store, tmp_path / "out")
    assert foldcar("export", "s.db", "--folder", "out", "--format", "parquet").returncode == 0
    assert "run.parquet" in files(tmp_path / "out") and "run.csv" not in files(tmp_path / "out")
    (tmp_path / "out" / "mine.txt").write_text("mine")
    before = files(tmp_path / "out")

    refused = foldcar("export", "s.db", "--folder", "out")

    assert refused.returncode == 2 and "contains mine.txt, which its manifest does not name" in refused.stderr
    assert files(tmp_path / "out") == before


def test_an_export_that_fails_leaves_the_old_folder(tmp_path: Path, store: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = files(exported(store, tmp_path / "out"))
    real = Store.rows

    def full(self: Store, table: Any, *rest: Any) -> Any:
        if table.name == "trial":
            raise OSError(28, "No space left on device")
        return real(self, table, *rest)

    monkeypatch.setattr(Store, "rows", full)
    with pytest.raises(FoldcarError, match="out: cannot be written: No space left"):
        exported(store, tmp_path / "out")

    assert files(tmp_path / "out") == before
    assert sorted(file.name for file in tmp_path.iterdir()) == ["out", "s-logs", "s.db"]


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        ("manifest.json", '"kind"', '"kin"', "manifest.json: is no manifest"),
        ("manifest.json", f'"version": {VERSION}', '"version": 99', "manifest.json: version: is 99, this"),
        ("manifest.json", '"run.csv"', '"../s.db"', 'manifest.json: files: "../s.db" leads out of the folder'),
        ("run.csv", "max_roll_rad", "roll_rad", 'run.csv: column "roll_rad" is unknown or there twice; known: build_id'),
        ("run.csv", "outcome,", "", 'run.csv: has no column "outcome"'),
        ("run.csv", '"passed"', '"flew"', "run.csv: row 1: outcome: 'flew' is none of passed, tipped"),
        ("run.csv", '"passed",0.', '"passed",1.', "run.csv: row 1: checksum: does not match the row"),
        ("run.csv", '"passed",0.', '"passed",x', "run.csv: row 1: elapsed_time_s: 'x"),
        ("run.csv", '"failed",,', '"failed",', "run.csv: row 2: has "),
        ("run.csv", '"passed"', '"passed', "run.csv: row 1: ',' expected after '\"'"),
        ("sample.csv", "1,0,1", "1,0,", "sample.csv: row 1: scene_id: is empty"),
        ("design.csv", "}", "]", "design.csv: row 1: parameters: is no JSON"),
        ("trial.csv", "goal", "g\xffal", "trial.csv: row 1 or later: is no UTF-8 text"),
        ("correction.csv", "\n1,", "\n9,", "correction.csv: row 1: checksum: does not match"),
    ],
)
def test_a_changed_file_is_refused_whole(
    tmp_path: Path, store: Path, file: str, old: str, new: str, message: str
) -> None:
    folder = exported(store, tmp_path / "out")
    content = (folder / file).read_bytes()
    assert old.encode() in content
    (folder / file).write_bytes(content.replace(old.encode(), new.encode("latin-1"), 1))

    with pytest.raises(StoreError) as caught:
        import_folder(folder, tmp_path / "new" / "s.db")

    assert message in str(caught.value) and "\n" not in str(caught.value)
    assert files(tmp_path / "new") == {}


def test_what_is_missing_or_leads_out_is_refused_whole(tmp_path: Path, store: Path, foldcar: Any) -> None:
    def refused() -> str:
        answer = foldcar("import", "out", "--store", "new/s.db")
        assert answer.returncode == 2 and answer.stderr.count("\n") == 1, answer.stderr
        assert answer.stderr.startswith("foldcar: error: out/") and files(tmp_path / "new") == {}
        return str(answer.stderr)

    folder = exported(store, tmp_path / "out")
    log = next((folder / "logs").rglob("*.tlog"))
    content = log.read_bytes()
    log.write_bytes(content + b"x")
    assert "does not match its SHA-256 in manifest.json" in refused()
    log.unlink()
    log.symlink_to("/etc/passwd")
    assert "leads out of the folder" in refused()
    log.unlink()
    log.write_bytes(content)
    lines = (folder / "trial.csv").read_bytes().splitlines(keepends=True)
    (folder / "trial.csv").write_bytes(b"".join(lines[:-1]))
    assert "trial.csv: has 4 rows, manifest.json says 5" in refused()
    (folder / "run.csv").unlink()
    assert "run.csv: is missing" in refused()
    (folder / "manifest.json").unlink()
    assert "manifest.json: cannot be read: No such file" in refused()


def test_a_log_that_leads_out_is_refused_though_its_checksum_fits(tmp_path: Path, store: Path) -> None:
    folder = exported(store, tmp_path / "out", "parquet")
    rows = pq.read_table(folder / "trial.parquet")
    changed = [{**rows.to_pylist()[0], "log": "../../etc/passwd"}, *rows.to_pylist()[1:]]
    changed[0]["checksum"] = checksum(TRIAL, changed[0])
    pq.write_table(pa.Table.from_pylist(changed, schema=rows.schema), folder / "trial.parquet")

    with pytest.raises(StoreError, match=r'trial\.parquet: row 1: log: "\.\./\.\./etc/passwd" leads out of the folder'):
        import_folder(folder, tmp_path / "new" / "s.db")


@pytest.mark.parametrize("place", (20, 80))
def test_damaged_parquet_is_refused(tmp_path: Path, store: Path, place: int) -> None:
    folder = exported(store, tmp_path / "out", "parquet")
    content = bytearray((folder / "trial.parquet").read_bytes())
    content[len(content) * place // 100] ^= 0x10
    (folder / "trial.parquet").write_bytes(content)

    try:
        import_folder(folder, tmp_path / "new" / "s.db")
    except StoreError as error:
        assert "trial.parquet: " in str(error)
        assert files(tmp_path / "new") == {}
    else:
        # What the file says beside its values, such as their extremes, is not read.
        assert contents(tmp_path / "new" / "s.db") == contents(store)


def test_what_is_there_is_not_overwritten(tmp_path: Path, store: Path, foldcar: Any) -> None:
    folder = exported(store, tmp_path / "out")
    before = store.read_bytes()
    assert "s.db: is there already" in foldcar("import", "out", "--store", "s.db").stderr
    assert store.read_bytes() == before

    (tmp_path / "new").mkdir()
    shutil.copytree(folder / "logs" / "s-logs", tmp_path / "new" / "s-logs")
    log = sorted((tmp_path / "new" / "s-logs").iterdir())[1]
    log.write_text("another")
    refused = foldcar("import", "out", "--store", "new/s.db")
    assert f"new/s-logs/{log.name}: is there already, with other contents" in refused.stderr
    assert log.read_text() == "another" and not (tmp_path / "new" / "s.db").exists()
