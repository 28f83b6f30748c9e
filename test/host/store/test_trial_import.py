"""`foldcar trials import` of stores, of earlier versions too, and of exported tables: the same trials come back."""

import contextlib
import csv
import io
import json
import shutil
import sqlite3
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from foldcar.store.errors import StoreError
from foldcar.store.log_files import log_file, referred_file, sha256_of
from foldcar.store.measured import measured_values
from foldcar.store.reader import Store
from foldcar.store.stored_drives import read_drives
from foldcar.store.tables import ENVIRONMENT, EXPERIMENT, OLDEST_TRIALS, VERSION
from foldcar.store.trial_import import take_trials
from foldcar.store.trial_records import Ending
from foldcar.store.trial_writer import CarFacts, Drive, TrialDesign, write_trials
from foldcar.trials.exported_trials import parquet_text
from full_store import contents
from written_study import FIXED, LOG, SETTINGS, add_trial, add_trials, body_of, fingerprint, write_study

# A store that each version of foldcar has written, with the trials of full_store.py. A new version adds its own.
STORES = Path(__file__).parents[1] / "data" / "stores"


@pytest.fixture
def old_store(tmp_path: Path) -> Path:
    """The oldest store, with its logs and its film, in a folder of its own."""
    shutil.copytree(STORES, tmp_path / "old")
    return tmp_path / "old" / f"version_{OLDEST_TRIALS}.db"


def trials_of(store: Path) -> list[dict[str, Any]]:
    """All that is stored of trials, without numbers and files of the store."""
    with Store.open(store) as reader:
        corrections = [asdict(correction) for correction in reader.corrections()]
        environments = reader.environments_of_trials()
        result = []
        for trial in reader.trials():
            own = [{**row, "trial": trial.uuid} for row in corrections if row["trial"] == trial.id]
            media = [(item.kind, item.sha256) for item in reader.media(trial.id)]
            drive = reader.trial_drive(trial.id)
            facts = {**asdict(trial), "environment": environments.get(trial.id), "corrections": own}
            result.append({**facts, "drive": drive, "media": media, "id": None, "log": trial.log is not None})
    return sorted(result, key=lambda trial: str(trial["uuid"]))


def test_there_is_a_store_of_every_version() -> None:
    for version in range(OLDEST_TRIALS, VERSION + 1):
        file = STORES / f"version_{version}.db"
        with contextlib.closing(sqlite3.connect(f"{file.as_uri()}?mode=ro", uri=True)) as database:
            assert database.execute("PRAGMA user_version").fetchone() == (version,)


@pytest.mark.parametrize("version", range(OLDEST_TRIALS, VERSION + 1))
def test_the_trials_of_every_version_come_with_all_that_belongs_to_them(
    version: int, old_store: Path, foldcar: Any, tmp_path: Path
) -> None:
    old = old_store.with_name(f"version_{version}.db")

    done = foldcar("trials", "import", "new/s.db", old)
    again = foldcar("trials", "import", "new/s.db", old)

    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == "4 trials imported, 1 to 4; store: new/s.db\n"
    assert again.stdout == "0 trials imported; 4 were imported before; store: new/s.db\n"
    new = tmp_path / "new" / "s.db"
    with Store.open(new) as reader:
        trials = list(reader.trials())
        drives = [reader.trial_drive(trial.id) for trial in trials]
        assert measured_values(reader, "1") == {"track_m": 0.002}
        (film,) = reader.media()
        corrections = [(row.trial, row.field, row.before, row.after, row.reason) for row in reader.corrections()]
    assert [trial.outcome for trial in trials] == ["tipped", "passed", "stuck", "passed"]
    assert [trial.withdrawn for trial in trials] == [False, True, False, False]
    assert [trial.car_name for trial in trials] == ["Ada", "Ada", None, None]
    assert trials[0].deviations == {"A": (0.01, 0, 0)}
    assert corrections == [
        (1, "note", "", "over the edge", "seen on the film"),
        (1, "outcome", "passed", "tipped", "seen on the film"),
        (2, "withdrawn", 0, 1, "practice"),
    ]
    assert [drive and json.loads(drive.scene) for drive in drives] == [{"friction": 0.6}, {"friction": 0.6}, None, None]
    for trial in trials[:2]:
        assert trial.log is not None
        log = log_file(new, trial.log)
        assert log.read_bytes() == f"log of trial {trial.id}".encode() and sha256_of(log) == trial.log_sha256
    assert referred_file(new, film.file).read_bytes() == b"film of trial 1"
    # The old store is as it was.
    assert old.read_bytes() == (STORES / old.name).read_bytes()


def test_a_log_that_was_changed_or_lost_is_named(old_store: Path, foldcar: Any) -> None:
    changed, lost = (sorted(old_store.parent.rglob("trial-*.tlog")))[:2]
    changed.write_bytes(b"something else")
    lost.unlink()

    done = foldcar("trials", "import", "new/s.db", old_store)
    foldcar("trials", "import", "other/s.db", old_store)
    merged = foldcar("merge", "new/s.db", "other/s.db", "-o", "m.db")

    assert done.stdout == "4 trials imported, 1 to 4; store: new/s.db\n"
    first, second = done.stderr.splitlines()
    assert first.startswith("note: new/s.db: trial (id=1): its log ") and first.endswith("not match its SHA-256")
    assert second.startswith("note: new/s.db: trial (id=2): its log ") and second.endswith(" is missing")
    assert merged.stderr == done.stderr.replace("new/s.db", "m.db").replace("log new/", "log "), merged.stderr


def test_an_older_version_that_lacks_a_column_is_read(
    old_store: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a later version will meet this one: a column is new, the number is smaller, other tables differ."""
    with contextlib.closing(sqlite3.connect(old_store)) as database:
        database.execute("DROP VIEW trial_result")
        database.execute("ALTER TABLE trial DROP COLUMN car_name")
        database.execute("DROP TABLE calibration")
        database.execute("PRAGMA user_version = 3")
        database.commit()
    with pytest.raises(StoreError, match="is a store of version 3, and this foldcar reads version"):
        take_trials(tmp_path / "new.db", old_store)
    for module in ("connection", "trial_import"):
        monkeypatch.setattr(f"foldcar.store.{module}.OLDEST_TRIALS", 3)

    with pytest.raises(StoreError, match=r"`foldcar trials import NEW\.db OLD\.db` takes its trials along"):
        Store.open(old_store)
    taken = take_trials(tmp_path / "new.db", old_store)

    assert (taken.new, taken.known) == ([1, 2, 3, 4], 0)
    with Store.open(tmp_path / "new.db") as reader:
        assert [trial.car_name for trial in reader.trials()] == [None] * 4


def test_trials_join_those_that_are_there_and_nothing_is_half_done(old_store: Path, foldcar: Any, tmp_path: Path) -> None:
    # One that can still be corrected.
    old_store = old_store.with_name(f"version_{VERSION}.db")
    store = write_study(tmp_path / "s.db", {"width_mm": [95.0]}, 3, lambda design, sample: "passed")
    own = add_trial(store, {"width_mm": 95.0}, 1, "passed")

    done = foldcar("trials", "import", "s.db", old_store)

    assert done.stdout == "4 trials imported, 2 to 5; store: s.db\n", done.stderr
    assert foldcar("check", "s.db").returncode == 0
    with Store.open(store) as reader:
        assert [trial.id for trial in reader.trials()] == [own, 2, 3, 4, 5]
    # A later correction there comes along; a contradiction is an error that changes nothing.
    assert foldcar("trials", "correct", old_store, "3", "--note", "later", "--reason", "r").returncode == 0
    assert foldcar("trials", "import", "s.db", old_store).returncode == 0
    with Store.open(store) as reader:
        assert reader.trial(4).note == "later" and len(reader.corrections(4)) == 1
    assert foldcar("trials", "measure", "s.db", "track_m=0.009", "--experiment", "1").returncode == 0
    before = contents(store)
    contradiction = foldcar("trials", "import", "s.db", old_store)
    assert (contradiction.returncode, contents(store)) == (2, before) and "value is 0.002 in" in contradiction.stderr
    itself = foldcar("trials", "import", "s.db", "s.db")
    assert itself.stderr == "foldcar: error: s.db: is the store itself; name another store\n"


@pytest.mark.parametrize("command", [("trials", "import", "s.db"), ("merge", "s.db", "-o", "m.db")])
def test_a_number_that_readers_refuse_does_not_reach_another_store(
    command: tuple[str, ...], old_store: Path, foldcar: Any, tmp_path: Path
) -> None:
    store = write_study(tmp_path / "s.db", {"width_mm": [95.0]}, 3, lambda design, sample: "passed")
    # Only stores of this version are merged.
    old_store = old_store.with_name(f"version_{VERSION}.db")
    with contextlib.closing(sqlite3.connect(old_store)) as database, database:
        database.execute("UPDATE trial SET elapsed_time_s = 9e20 WHERE id = 1")
    before = contents(store)

    done = foldcar(*command, old_store)

    message = "trial (id=1) is damaged: its elapsed_time_s is 9e+20, not -1e+15 to 1e+15"
    assert foldcar("trials", "import", "new.db", old_store).returncode == 2 and not (tmp_path / "new.db").exists()
    assert (done.returncode, done.stderr) == (2, f"foldcar: error: {old_store}: {message}\n")
    assert contents(store) == before and not (tmp_path / "m.db").exists()


@pytest.fixture
def driven(tmp_path: Path) -> Path:
    """A study with trials: as planned and displaced, named cars, corrected, with a text that a spreadsheet would run."""
    store = write_study(tmp_path / "s.db", {"width_mm": [95.0, 115.0]}, 3, lambda design, sample: "passed")
    add_trials(store, [({"width_mm": 95.0}, 0, "passed"), ({"width_mm": 115.0}, 1, "timeout")])
    design = {"width_mm": 115.0, **FIXED}
    scene = {"of": fingerprint("1"), "sample": 2}
    drive = Drive(body_of(design), SETTINGS, scene, fingerprint("1"), "step_pyramids.scenic", 2)
    with write_trials(store) as writer:
        number = writer.begin(
            "1", TrialDesign("W_B_W", design), drive, {"A": (0.01, -0.002, 0.1), "car": (0, 1e-3, 0)},
            CarFacts("fw", "hash", "/dev/null", "built", "Ada"), LOG, "Bo, Cy",
        )  # fmt: skip
        writer.complete(number, Ending("passed", "goal", 2.123456789012345, '\'=1+1 "said"\nhe', None))
        writer.correct(number, {"outcome": "tipped", "elapsed_time_s": 1.5}, "on the film; twice", "Bo")
    return store


@pytest.mark.parametrize("table", ["t.csv", "t.parquet"])
def test_exported_trials_are_the_same_trials_in_another_store(
    table: str, driven: Path, foldcar: Any, tmp_path: Path
) -> None:
    assert foldcar("export", "s.db", "--trials", table).returncode == 0

    first = foldcar("trials", "import", "new.db", table)
    again = foldcar("trials", "import", "new.db", table)

    assert (first.returncode, first.stdout) == (0, "3 trials imported, 1 to 3; store: new.db\n"), first.stderr
    assert again.stdout == "0 trials imported; 3 were imported before; store: new.db\n", again.stderr
    # A table has neither logs nor scenes nor ports.
    without = {"drive": None, "log": False, "log_sha256": None}
    assert trials_of(tmp_path / "new.db") == [{**trial, **without} for trial in trials_of(driven)]
    # The other way round nothing is new either, and a later correction arrives.
    assert foldcar("trials", "correct", "new.db", "1", "--note", "seen twice", "--reason", "r").returncode == 0
    assert foldcar("export", "new.db", "--trials", f"back_{table}").returncode == 0
    back = foldcar("trials", "import", "s.db", f"back_{table}")
    assert back.stdout == "0 trials imported; 3 were imported before; store: s.db\n", back.stderr
    with Store.open(driven) as reader:
        assert reader.trial(1).note == "seen twice" and reader.trial(1).log == LOG


@pytest.mark.parametrize("table", ["t.csv", "t.parquet"])
@pytest.mark.parametrize(("note", "stored"), [(" ", ""), ("a\rb", "a\nb"), ("a\r\nb", "a\nb"), ("\u2028", "")])
def test_blank_notes_and_all_line_ends_come_back_from_a_table(
    note: str, stored: str, table: str, driven: Path, foldcar: Any, tmp_path: Path
) -> None:
    words = ("--note", note, "--reason", f"because{note}of", "--operator", f"Bo{note}Cy")
    assert foldcar("trials", "correct", "s.db", "1", *words).returncode == 0
    assert foldcar("export", "s.db", "--trials", table).returncode == 0

    done = foldcar("trials", "import", "new.db", table)

    assert (done.returncode, done.stdout) == (0, "3 trials imported, 1 to 3; store: new.db\n"), done.stderr
    with Store.open(driven) as before, Store.open(tmp_path / "new.db") as after:
        assert after.trial(1).note == stored
        assert list(after.corrections()) == list(before.corrections())


def test_a_carriage_return_in_a_parquet_file_does_not_end_a_row(tmp_path: Path) -> None:
    pq.write_table(pa.table({"outcome": ["passed"], "note": ["a\rb"]}), tmp_path / "t.parquet")

    text = parquet_text(tmp_path / "t.parquet")

    assert list(csv.reader(io.StringIO(text, newline=""))) == [["outcome", "note"], ["passed", "a\nb"]]


@pytest.mark.parametrize("command", [("trials", "import", "new.db", "s.db"), ("merge", "new.db", "s.db", "-o", "m.db")])
def test_after_its_table_a_store_brings_what_the_table_lacks(
    command: tuple[str, ...], driven: Path, foldcar: Any, tmp_path: Path
) -> None:
    assert foldcar("export", "s.db", "--trials", "t.csv").returncode == 0
    assert foldcar("trials", "import", "new.db", "t.csv").returncode == 0

    done = foldcar(*command)

    assert done.returncode == 0, done.stderr
    assert trials_of(tmp_path / ("m.db" if "merge" in command else "new.db")) == trials_of(driven)


def test_a_contradiction_names_both_stores(driven: Path, foldcar: Any, tmp_path: Path) -> None:
    assert foldcar("trials", "import", "new.db", "s.db").returncode == 0
    for store in ("s.db", "new.db"):
        assert foldcar("trials", "correct", store, "1", "--note", store, "--reason", "r").returncode == 0

    done = foldcar("trials", "import", "new.db", "s.db")

    assert done.returncode == 2 and "note is s.db in s.db, new.db in new.db: correct one of them" in done.stderr


def test_exported_trials_are_compared_with_runs_of_the_same_drive_only(
    driven: Path, foldcar: Any, tmp_path: Path
) -> None:
    widths = {"width_mm": [95.0, 115.0]}
    for name in ("same.db", "other.db"):
        write_study(tmp_path / name, widths, 3, lambda design, sample: "passed")
    assert foldcar("export", "s.db", "--trials", "same.csv").returncode == 0
    text = (tmp_path / "same.csv").read_text()
    (tmp_path / "other.csv").write_text(text.replace('""speed_m_s"":0.3', '""speed_m_s"":0.05'))

    for name in ("same", "other"):
        assert foldcar("trials", "import", f"{name}.db", f"{name}.csv").returncode == 0
    remarks = {
        name: json.loads(foldcar("compare", f"{name}.db", "--json").stdout)["experiments"][0]["remarks"]
        for name in ("same", "other")
    }

    left_out = "3 trials left out, not driven as the runs: speed 0.05 m/s, not 0.3 m/s."
    assert left_out in remarks["other"] and not any("left out" in remark for remark in remarks["same"])


def test_trials_of_cars_with_own_modules_are_imported(foldcar: Any, tmp_path: Path) -> None:
    (tmp_path / "tail.py").write_text(
        "from foldcar.car.components.component import Parameter\nfrom foldcar.car.components.module import Module\n\n\n"
        "class Tail(Module):\n    letter = 'Tail'\n    title = 'a tail'\n"
        "    parameters = (*Module.parameters, Parameter('offset', 5, 0, 50, 'from the middle', 'the middle'))\n"
    )
    (tmp_path / "t.csv").write_text(
        "vehicle_type,outcome,source,experiment,width_mm,Tail_offset_mm\nW_B_W_Tail,passed,notes,1,95,10\n"
    )

    assert foldcar("trials", "import", "s.db", "t.csv", "--components", "tail.py").returncode == 0
    assert foldcar("export", "s.db", "--trials", "e.csv").returncode == 0
    without = foldcar("trials", "import", "new.db", "e.csv")
    done = foldcar("trials", "import", "new.db", "e.csv", "--components", "tail.py")

    assert without.returncode == 2 and "parameters of your own modules need --components FILE" in without.stderr
    assert done.returncode == 0, done.stderr
    with Store.open(tmp_path / "s.db") as old, Store.open(tmp_path / "new.db") as new:
        assert list(old.trials()) == list(new.trials())


@pytest.mark.parametrize(
    ("column", "cell", "message"),
    [
        ("uuid", "seven", 'uuid: "seven" is not a UUID'),
        ("deviations", '{"A": [1, 2]}', "deviations: "),
        ("corrections", '[{"field": "id"}]', "corrections: "),
        ("corrections", "[", "corrections: "),
        ("settings", '{"speed_m_s": 0.3}', "settings: "),
        ("settings", "0.3", "settings: "),
        (
            "corrections",
            '[{"corrected_utc": "2026-11-28", "field": "outcome", "before": "flew", "after": "passed", '
            '"reason": "r", "operator": ""}]',
            "corrections: an outcome is not one of passed, ",
        ),
        ("outcome", "passed", "outcome: passed is not what the trial's corrections made it, tipped: use "),
        ("elapsed_time_s", "2.5", "elapsed_time_s: 2.5 is not what the trial's corrections made it, 1.5: use "),
    ],
)
def test_a_changed_export_is_refused_with_its_line(
    column: str, cell: str, message: str, driven: Path, foldcar: Any, tmp_path: Path
) -> None:
    assert foldcar("export", "s.db", "--trials", "t.csv").returncode == 0
    with (tmp_path / "t.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    with (tmp_path / "t.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows([rows[0], {**rows[2], column: cell}])

    done = foldcar("trials", "import", "new.db", "t.csv")

    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert done.stderr.startswith(f"foldcar: error: t.csv: line 3: {message}")
    assert not (tmp_path / "new.db").exists()


def test_a_store_that_was_begun_with_trials_is_swept(
    foldcar: Any, tmp_path: Path, carsim_binary: Path, write_listing: Any, listing_data: Any
) -> None:
    """The import leaves gaps: it has the scene of the trial's sample only, which need not be the first."""
    (tmp_path / "p.scenic").write_text(
        "model model\nego = new Robot at (Range(0, 0.1), 0), facing -90 deg\n"
        "goal = new Goal at (0.5, 0), facing -90 deg\n"
    )
    listing_data["experiments"] = {"1": {"veh_id": 1, "env_id": 1, "params": {"environments": 4, "timeout": 20}}}
    listing_data["vehicles"] = {"1": {"type": "W_B_W", "params": [{"common": {"width": 95}}]}}
    listing_data["environments"] = {"1": {"scenic_filename": "p.scenic"}}
    listing = write_listing(listing_data)
    assert foldcar("sweep", listing, "--store", "old.db").returncode == 0
    with Store.open(tmp_path / "old.db") as reader:
        drives = read_drives(reader, "1")
        (parameters,), (body,), (settings,) = drives.parameters, drives.bodies, drives.settings
        inputs = [drives.value("body", body), drives.value("settings", settings), drives.value("scene", drives.scenes[2])]
        row = reader.row(EXPERIMENT, id="1")
        print_of_environment = reader.row(ENVIRONMENT, id=row["environment_id"])["fingerprint"]
    with write_trials(tmp_path / "old.db") as writer:
        car, design = CarFacts("fw", "hash", "/dev/null", "built"), TrialDesign("W_B_W", parameters)
        number = writer.begin("1", design, Drive(*inputs, print_of_environment, "p.scenic", 2), {}, car, LOG, "Ada")
        writer.complete(number, Ending("passed", "goal", 1.0, "", None))

    assert foldcar("trials", "import", "new.db", "old.db").returncode == 0
    swept = foldcar("sweep", listing, "--store", "new.db")
    compared = json.loads(foldcar("compare", "new.db", "--json").stdout)

    assert swept.stdout.startswith("4 new runs, 0 already stored"), swept.stderr
    assert foldcar("check", "new.db").returncode == 0
    (design_row,) = compared["experiments"][0]["designs"]
    assert (design_row["trials"], design_row["paired"]) == (1, 1)
