"""The store: what it refuses, what it keeps, who may write it."""

import hashlib
import sqlite3
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

from foldcar.errors import FoldcarError
from foldcar.simulation.results import NUMBERS, Recorded
from foldcar.store.connection import APPLICATION_ID, check_new
from foldcar.store.errors import StoreError
from foldcar.store.reader import Store
from foldcar.store.tables import OLDEST_TRIALS, TABLES, VERSION, VIEWS
from foldcar.store.writer import PlannedDesign, PlannedExperiment, PlannedRun, StoreWriter, write_store
from written_study import EXPERIMENT_FACTS, FACTS


def plan(
    writer: StoreWriter, name: str = "1", widths: tuple[int, ...] = (65, 95), spread: str = "nominal"
) -> PlannedExperiment:
    """Record an experiment whose bodies are told apart by their width."""
    environment_id, spread_id = writer.environment("fingerprint"), writer.spread(spread)
    facts = {**EXPERIMENT_FACTS, "varied": {"width_mm": [65, 95]}}
    planned = PlannedExperiment(name, "car", "steps", environment_id, spread_id, 2, facts)
    writer.put_experiment(
        planned, (PlannedDesign({"width_mm": w, "height_mm": 50}, {"width": w}, {"speed": 1}) for w in widths)
    )
    return planned


def answer(run: PlannedRun) -> dict[str, Any]:
    outcome, elapsed_time_s = "passed" if run.design else "tipped", 10.0 * run.design + run.sample
    return {"outcome": outcome, **dict.fromkeys(NUMBERS, 1.0 / 3.0), "elapsed_time_s": elapsed_time_s}


def fill(
    path: Path,
    name: str = "1",
    widths: tuple[int, ...] = (65, 95),
    build: str = "b1",
    spread: str = "nominal",
    answer: Callable[[PlannedRun], Mapping[str, Any]] = answer,
) -> int:
    """Store every run that is missing; gives their number."""
    with write_store(path) as writer:
        writer.begin_study(FACTS, build)
        planned = plan(writer, name, widths, spread)
        new = 0
        for sample in (0, 1):
            writer.put_sample(planned.environment_id, sample, {"scene": sample})
            writer.put_draw(planned.spread_id, sample, {spread: sample})
            missing = [run for run in writer.planned_runs(planned, sample) if run.outcome is None]
            writer.add_results((run, answer(run)) for run in missing)
            new += len(missing)
    return new


def test_results_come_back_in_order_and_to_the_last_bit(tmp_path: Path) -> None:
    fill(tmp_path / "s.db")

    with Store.open(tmp_path / "s.db") as store:
        results = list(store.results())

    assert [(r.design["width_mm"], r.sample, r.outcome, r.metrics["elapsed_time_s"]) for r in results] == [
        (65, 0, "tipped", 0.0),
        (65, 1, "tipped", 1.0),
        (95, 0, "passed", 10.0),
        (95, 1, "passed", 11.0),
    ]
    assert {(r.experiment, r.vehicle, r.environment) for r in results} == {("1", "car", "steps")}
    assert results[0].metrics["consumed_energy_j"] == 1.0 / 3.0


def test_the_facts_of_the_study_are_kept(tmp_path: Path) -> None:
    fill(tmp_path / "s.db")

    with Store.open(tmp_path / "s.db") as store:
        info = store.info()
        with pytest.raises(StoreError, match='no experiment "2"; it has 1'):
            list(store.results("2"))

    assert {name: getattr(info, name) for name in FACTS} == FACTS
    (experiment,) = info.experiments.values()
    assert (experiment.id, experiment.carsim_build, experiment.seed) == ("1", "b1", 42)
    assert (experiment.planned_runs, experiment.stored_runs) == (4, 4)
    assert experiment.varied == {"width_mm": [65, 95]}


def test_nothing_that_is_there_is_run_again(tmp_path: Path) -> None:
    path = tmp_path / "s.db"

    assert fill(path) == 4
    assert fill(path) == 0
    assert fill(path, widths=(65, 95, 120)) == 2
    assert fill(path, name="other", widths=(95, 120, 140)) == 2
    assert fill(path, build="b2") == 4
    assert fill(path, build="b2", spread="workshop") == 4
    assert fill(path, build="b2", spread="workshop") == 0
    with Store.open(path) as store:
        assert len(list(store.results("other"))) == 6
        assert [r.design["width_mm"] for r in store.results("1")] == [65, 65, 95, 95]


def test_a_run_takes_less_than_a_hundred_bytes(tmp_path: Path) -> None:
    """New rows stand behind those there, so that pages are full: a million runs are 100 MB."""
    widths, samples = tuple(range(50, 350)), 60

    def measured(run: PlannedRun) -> dict[str, Any]:
        return {"outcome": "passed", **{name: 1 / (run.design + run.sample + at + 2) for at, name in enumerate(NUMBERS)}}

    with write_store(tmp_path / "s.db") as writer:
        writer.begin_study(FACTS, "b1")
        planned = plan(writer, widths=widths)
        before = (tmp_path / "s.db").stat().st_size
        for sample in range(samples):
            writer.put_sample(planned.environment_id, sample, {"scene": sample})
            writer.put_draw(planned.spread_id, sample, {})
            runs = list(writer.planned_runs(planned, sample))
            for at in range(0, len(runs), 50):
                writer.add_results((run, measured(run)) for run in runs[at : at + 50])

    size = (tmp_path / "s.db").stat().st_size
    assert size - before < (60 + 8 * len(NUMBERS)) * len(widths) * samples


FAILED = "the simulation left the finite numbers"
RECORDED = {
    "top": {"kind": "final", "value": 1 / 3},
    "track": {"kind": "series", "value": [[0.25, [1e-7, 2]], [0.5, None]]},
    'a "name"': {"kind": "initial", "value": "text ü"},
    "true": {"kind": "final", "value": True},
}


def test_failed_runs_and_recorded_values_come_back_as_they_went_in(tmp_path: Path) -> None:
    def mixed(run: PlannedRun) -> dict[str, Any]:
        if run.design == 0:
            return {"error": FAILED}
        return {**answer(run), "distance_to_target_m": None, "recorded": RECORDED if run.sample else {}}

    fill(tmp_path / "s.db", answer=mixed)
    with Store.open(tmp_path / "s.db") as store:
        failed, _, bare, full = store.results()
        types = store.recorded_types()
    connection = sqlite3.connect(tmp_path / "s.db")
    query = "SELECT json_extract(recorded, '$.top.value') FROM result WHERE outcome = 'passed' ORDER BY sample"
    shown = connection.execute(query).fetchall()
    connection.close()

    assert (failed.outcome, failed.message) == ("failed", FAILED)
    assert failed.metrics == dict.fromkeys(NUMBERS)
    assert (bare.message, bare.metrics["distance_to_target_m"], bare.recorded) == (None, None, {})
    assert full.recorded == {name: Recorded(**value) for name, value in RECORDED.items()}
    assert types == {'a "name"': {"text"}, "top": {"real"}, "track": {"series"}, "true": {"true"}}
    assert shown == [(None,), (1 / 3,)]
    assert fill(tmp_path / "s.db") == 0


def test_scenes_and_variations_that_look_alike_may_differ(tmp_path: Path) -> None:
    with write_store(tmp_path / "s.db") as writer:
        writer.begin_study(FACTS, "b1")
        planned = plan(writer)
        for sample, identity in ((0, "one"), (1, "two")):
            writer.put_sample(planned.environment_id, sample, {}, dynamic=True)
            writer.put_draw(planned.spread_id, sample, {}, identity)
        runs = [next(writer.planned_runs(planned, sample)) for sample in (0, 1)]

        assert len({run.scene_id for run in runs}) == len({run.variation_id for run in runs}) == 2
        assert [writer.texts("scene", [run.scene_id])[run.scene_id] for run in runs] == ["{}", "{}"]


def test_whether_a_program_is_dynamic_is_remembered(tmp_path: Path) -> None:
    for dynamic in (True, False):
        with write_store(tmp_path / "s.db") as writer:
            assert writer.is_dynamic(writer.environment("fingerprint"), lambda dynamic=dynamic: dynamic)


def test_a_failed_transaction_leaves_nothing(tmp_path: Path) -> None:
    path = tmp_path / "s.db"
    fill(path)

    with pytest.raises(KeyError), write_store(path) as writer:
        writer.begin_study(FACTS, "b2")
        planned = plan(writer)
        runs = list(writer.planned_runs(planned, 0))
        writer.add_results([(runs[0], answer(runs[0])), (runs[1], {"outcome": "passed"})])

    with Store.open(path) as store:
        assert list(store.results()) == []


def test_a_finished_store_is_one_file_and_reading_makes_none(tmp_path: Path) -> None:
    path = tmp_path / "made" / "s.db"
    fill(path)
    before = path.read_bytes()

    with Store.open(path) as store:
        list(store.results())
        store.info()
        assert [file.name for file in path.parent.iterdir()] == ["s.db"]

    assert path.read_bytes() == before


def test_a_creation_that_was_cut_short_does_not_bar_the_way(tmp_path: Path) -> None:
    (tmp_path / "empty.db").touch()
    sqlite3.connect(tmp_path / "wal.db").execute("PRAGMA journal_mode = WAL").close()

    assert fill(tmp_path / "empty.db") == 4
    assert fill(tmp_path / "wal.db") == 4


def foreign(path: Path, *statements: str) -> Path:
    connection = sqlite3.connect(path)
    for statement in statements:
        connection.execute(statement)
    connection.commit()
    connection.close()
    return path


def test_what_is_no_store_is_refused_and_left_alone(tmp_path: Path) -> None:
    text = tmp_path / "text.db"
    text.write_text("not a database, but long enough to be mistaken for one " * 10)
    listing = tmp_path / "text.json"
    listing.write_text('// A study.\n{"experiments": {}, "vehicles": {}}')
    other = foreign(tmp_path / "other.db", "CREATE TABLE t (a)")
    made = "CREATE TABLE t (a)", f"PRAGMA application_id = {APPLICATION_ID}"
    newer, older, previous = (
        foreign(tmp_path / f"{version}.db", *made, f"PRAGMA user_version = {version}")
        for version in (VERSION + 1, OLDEST_TRIALS - 1, OLDEST_TRIALS)
    )
    ways_out = f"and this foldcar reads version {VERSION}: sweep into a new store, or use the foldcar that made it"
    takes_trials = ways_out.replace(", or", "; `foldcar trials import NEW.db OLD.db` takes its trials along, or")

    for path, message in (
        (text, "is not a foldcar store: file is not a database"),
        (other, "is not a foldcar store"),
        (listing, f"is a listing, not a store; `foldcar sweep {listing} --store text.db` simulates it into a store"),
        (newer, f"is a store of version {VERSION + 1}, {ways_out}"),
        (older, f"is a store of version {OLDEST_TRIALS - 1}, {ways_out}"),
        (previous, f"is a store of version {OLDEST_TRIALS}, {takes_trials}"),
    ):
        before = path.read_bytes()
        with pytest.raises(FoldcarError) as caught:
            Store.open(path)
        assert str(caught.value) == f"{path}: {message}"
        with pytest.raises(FoldcarError) as caught, write_store(path):
            pass
        assert str(caught.value) == f"{path}: {message}"
        assert path.read_bytes() == before


def test_a_change_of_the_tables_changes_the_version() -> None:
    """Stores of one version have the same tables: after a change of one raise VERSION. A table may be dropped without."""
    statements = "".join([*(table.sql for table in TABLES), *VIEWS.values()])
    assert (VERSION, hashlib.sha256(statements.encode()).hexdigest()[:16]) == (6, "38a192ac248be12b")


def test_what_is_no_file_is_no_store_and_reading_creates_none(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="no such store"):
        Store.open(tmp_path / "none" / "s.db")
    with pytest.raises(StoreError, match="is not a file"):
        Store.open(tmp_path)
    with pytest.raises(StoreError, match="is a folder, not a store"), write_store(tmp_path):
        pass

    assert list(tmp_path.iterdir()) == []
    (tmp_path / "study.db").touch()
    with pytest.raises(StoreError, match=r'no such store; did you mean "study\.db"\?'):
        Store.open(tmp_path / "studdy.db")
    (tmp_path / "link.db").symlink_to("nowhere.db")
    with pytest.raises(StoreError, match=r"link\.db: no such store$"):
        Store.open(tmp_path / "link.db")


def test_a_name_that_sqlite_does_not_take_for_a_file_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, foldcar: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    done = foldcar("sweep", "none.json", "--store", ":memory:")

    assert (done.returncode, done.stdout) == (2, "")
    message = "SQLite does not treat this as a file name; use another, such as study.db"
    assert done.stderr == f"foldcar: error: :memory:: {message}\n"
    for name in (":memory:", "file:s.db"):
        for use in (check_new, Store.open, lambda path: write_store(path).__enter__()):
            with pytest.raises(StoreError, match=message):
                use(Path(name))
    assert list(tmp_path.iterdir()) == []
