"""Stores of studies that were run apart, as one store: every row once, contradictions refused."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from foldcar.store.check import check_store, store_digest
from foldcar.store.errors import StoreError
from foldcar.store.merge import merge_stores
from foldcar.store.reader import Store
from foldcar.store.tables import EXPERIMENT, MEASURED, RUN, SAMPLE, TRIAL, VERSION, Table
from foldcar.store.trial_records import Ending
from foldcar.store.trial_writer import write_trials
from full_store import alter, change, contents, full_store
from swept_listing import swept
from test_store import answer, fill
from test_trial_store import begin

OLD = (
    f"is a store of version 1, and this foldcar reads version {VERSION}: "
    "sweep into a new store, or use the foldcar that made it"
)


def digest(store: Path) -> tuple[str, int]:
    with Store.open(store) as opened:
        return store_digest(opened)


def shown(store: Path) -> list[Any]:
    """What reports show of a store: experiments with their facts, and their results."""
    with Store.open(store) as opened:
        return [dict(opened.info().experiments), sorted(opened.results(), key=repr)]


@pytest.fixture
def listing(listing_data: dict[str, Any], write_listing: Callable[[Any], Path]) -> Path:
    """Two experiments that share their cars, and in part their environments."""
    listing_data["experiments"]["2"] = {"veh_id": 1, "env_id": 2, "params": {"timeout": 60, "environments": 2}}
    listing_data["environments"]["2"] = {**listing_data["environments"]["1"], "seed": 7}
    return write_listing(listing_data)


def made(listing: Path, store: Path, binary: Path, experiment: str | None = None, **options: Any) -> Path:
    """The store, swept."""
    swept(listing, store, binary, experiment=experiment, **options)
    return store


def test_halves_of_a_study_are_the_whole(tmp_path: Path, listing: Path, carsim_binary: Path) -> None:
    whole = made(listing, tmp_path / "whole.db", carsim_binary)
    first = made(listing, tmp_path / "a.db", carsim_binary, "1", environments=1)
    again = made(listing, tmp_path / "b.db", carsim_binary, "1")
    second = made(listing, tmp_path / "c.db", carsim_binary, "2")
    before = {store: store.read_bytes() for store in (first, again, second)}

    counts = merge_stores([second, first, again], tmp_path / "new" / "m.db")

    assert digest(tmp_path / "new" / "m.db") == digest(whole)
    assert digest(first) != digest(again) != digest(whole)
    assert shown(tmp_path / "new" / "m.db") == shown(whole)
    assert check_store(tmp_path / "new" / "m.db").findings == []
    assert (counts["run"], counts["experiment"], counts["build"]) == (10, 2, 1)
    assert {store: store.read_bytes() for store in before} == before
    # The next sweep has nothing left to simulate.
    assert swept(listing, tmp_path / "new" / "m.db", carsim_binary).new == 0


@pytest.fixture
def thresholded(listing_data: dict[str, Any], write_listing: Callable[[Any], Path]) -> Path:
    """A listing of which designs are decided in fewer than its 12 environments."""
    listing_data["experiments"]["1"]["params"] |= {"environments": 12, "threshold": 0.5}
    return write_listing(listing_data)


def test_sweeps_until_one_rule_are_one_and_others_are_refused(
    tmp_path: Path, thresholded: Path, carsim_binary: Path
) -> None:
    whole, part = (made(thresholded, tmp_path / f"{n}.db", carsim_binary, environments=n) for n in (12, 2))
    stopped, other = (made(thresholded, tmp_path / name, carsim_binary, until=name) for name in ("decided", "40pp"))
    few = made(thresholded, tmp_path / "few.db", carsim_binary, until="decided", environments=2)

    for name, stores in {"m1": [stopped, few], "m2": [few, stopped]}.items():
        merge_stores(stores, tmp_path / name)
        assert shown(tmp_path / name) == shown(stopped)
    merge_stores([part, whole], tmp_path / "m3")
    assert shown(tmp_path / "m3") == shown(whole)
    for stores in ([stopped, other], [whole, stopped]):
        with pytest.raises(StoreError, match=r'experiment "1": until is .*, .* in .*: give one of them another name'):
            merge_stores(stores, tmp_path / "m.db")
    assert not (tmp_path / "m.db").exists()


def test_a_store_with_itself_is_itself(tmp_path: Path, store: Path) -> None:
    shutil.copy(store, tmp_path / "copy.db")

    merge_stores([store, tmp_path / "copy.db"], tmp_path / "m.db")

    assert contents(tmp_path / "m.db") == contents(store)


def test_trials_are_kept_with_their_logs_and_corrections(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    store = full_store(tmp_path / "a" / "s.db")
    # Other logs of the same names.
    other = full_store(tmp_path / "b" / "s.db")
    for log in (tmp_path / "b" / "s-logs").iterdir():
        log.write_bytes(b"other " + log.read_bytes())
    change(other, TRIAL, "log IS NOT NULL", log_sha256=None)

    merge_stores([store, other], tmp_path / "m.db")

    with Store.open(store) as first, Store.open(other) as second, Store.open(tmp_path / "m.db") as opened:
        trials, both = list(opened.trials()), [*first.trials(), *second.trials()]
        # Imported trials are of one sheet: they are there once.
        assert [trial.uuid for trial in trials] == list(dict.fromkeys(trial.uuid for trial in both))
        assert len(trials) == 6 and [trial.withdrawn for trial in trials].count(True) == 2
        assert len(opened.corrections()) == 6 and opened.corrections(1)[0].after == "over the edge"
    report = check_store(tmp_path / "m.db")
    assert (report.findings, report.logs) == ([], 4)
    for trial in trials:
        if trial.log is not None:
            assert (tmp_path / trial.log).read_bytes().endswith(b"log of trial 1" if trial.note else b"log of trial 2")


@pytest.mark.parametrize("newest_first", [True, False])
def test_of_a_trial_that_was_corrected_in_a_copy_the_corrected_state_counts(
    tmp_path: Path, store: Path, newest_first: bool
) -> None:
    shutil.copy(store, tmp_path / "copy.db")
    with write_trials(tmp_path / "copy.db") as writer:
        writer.withdraw([1, 3], True, "wrong tyres", "Ada")
    stores = [tmp_path / "copy.db", store]

    merge_stores(stores if newest_first else stores[::-1], tmp_path / "m.db")

    with Store.open(tmp_path / "m.db") as opened:
        assert [trial.withdrawn for trial in opened.trials()] == [True, True, True, False]
        assert [change.reason for change in opened.corrections(3)] == ["wrong tyres"]


def test_a_trial_of_which_two_stores_say_different_things_is_named(tmp_path: Path, store: Path) -> None:
    shutil.copy(store, tmp_path / "copy.db")
    for path, outcome in ((store, "passed"), (tmp_path / "copy.db", "timeout")):
        with write_trials(path) as writer:
            writer.correct(1, {"outcome": outcome}, "seen again", "Ada")

    with pytest.raises(StoreError, match=r"^trial 1 of .*copy\.db \(.*\): outcome is timeout in .*, passed in .*: corr"):
        merge_stores([store, tmp_path / "copy.db"], tmp_path / "m.db")
    with write_trials(store) as writer:
        writer.correct(1, {"outcome": "timeout"}, "a third look", "Ada")
    merge_stores([store, tmp_path / "copy.db"], tmp_path / "m.db")
    with Store.open(tmp_path / "m.db") as opened:
        assert opened.trial(1).outcome == "timeout" and opened.trial(1).corrections == 5


def test_a_trial_that_was_running_when_its_store_was_copied_is_the_completed_one(tmp_path: Path) -> None:
    with write_trials(tmp_path / "s.db") as writer:
        number = begin(writer)
    shutil.copy(tmp_path / "s.db", tmp_path / "copy.db")
    with write_trials(tmp_path / "s.db") as writer:
        writer.complete(number, Ending("passed", "goal", 2.0, "", None))
    for stores in (["s.db", "copy.db"], ["copy.db", "s.db"]):
        merge_stores([tmp_path / name for name in stores], tmp_path / "m.db")
        with Store.open(tmp_path / "m.db") as opened:
            assert [trial.outcome for trial in opened.trials()] == ["passed"]
        (tmp_path / "m.db").unlink()


@pytest.mark.parametrize(
    ("table", "where", "values", "message"),
    [
        (RUN, "body_id = 1 AND scene_id = 1", {"outcome": "stuck"},
         r"^run \(build_id \S+, body_id \w{12}, .*\): outcome is stuck in .*b\.db, \w+ in .*a\.db: the same build"),
        (RUN, "body_id = 1 AND scene_id = 1", {"elapsed_time_s": 0.125}, "elapsed_time_s is 0.125 in .*b.db, "),
        (EXPERIMENT, "position = 0", {"vehicle": "other"},
         '^experiment "1": vehicle is other in .*b.db, .* another name'),
    ],
)  # fmt: skip
def test_contradictions_are_refused_and_nothing_is_written(
    tmp_path: Path, table: Table, where: str, values: dict[str, Any], message: str
) -> None:
    fill(tmp_path / "a.db", answer=answer)
    shutil.copy(tmp_path / "a.db", tmp_path / "b.db")
    change(tmp_path / "b.db", table, where, **values)

    with pytest.raises(StoreError, match=message):
        merge_stores([tmp_path / "a.db", tmp_path / "b.db"], tmp_path / "m.db")

    assert sorted(file.name for file in tmp_path.iterdir()) == ["a.db", "b.db"]


def test_other_measurements_are_refused(tmp_path: Path) -> None:
    first = full_store(tmp_path / "a.db")
    second = Path(shutil.copy(first, tmp_path / "b.db"))
    same = merge_stores([first, second], tmp_path / "same.db")
    change(second, MEASURED, "parameter = 'track_m'", value=0.003)

    with pytest.raises(
        StoreError, match=r"^measured \(experiment 1, parameter track_m\): value is 0.003 in .*b.db, 0.002 in"
    ):
        merge_stores([first, second], tmp_path / "m.db")

    assert same["measured"] == 1


def test_other_designs_are_refused(tmp_path: Path) -> None:
    fill(tmp_path / "a.db")
    fill(tmp_path / "c.db", widths=(65, 95, 120))

    for names in ("ac", "ca"):
        with pytest.raises(StoreError, match='experiment "1": '):
            merge_stores([tmp_path / f"{name}.db" for name in names], tmp_path / "m.db")


def test_what_cannot_be_merged_is_said_in_one_line(tmp_path: Path, foldcar: Callable[..., Any]) -> None:
    for name in ("a.db", "old.db"):
        fill(tmp_path / name)
    alter(tmp_path / "old.db", "PRAGMA user_version = 1")
    facts = {
        ("a.db", "old.db", "-o", "m.db"): f"old.db: {OLD}",
        ("a.db", "none.db", "-o", "m.db"): "none.db: no such store",
        ("a.db", "-o", "m.db"): "merge: name two stores or more",
        ("a.db", "old.db", "-o", "a.db"): "a.db: is read by this command; name another file to write",
        ("a.db", "a.db", "-o", "old.db"): "old.db: already exists; name a new store",
    }
    for words, line in facts.items():
        refused = foldcar("merge", *words)
        assert (refused.returncode, refused.stderr) == (2, f"foldcar: error: {line}\n")
    assert not (tmp_path / "m.db").exists()

    merged = foldcar("merge", "a.db", "a.db", "-o", "m.db")
    digests = [foldcar("export", name, "--digest").stdout for name in ("a.db", "m.db")]

    digest, runs, _ = digests[0].split()
    assert int(runs) > 0 and merged.stdout.startswith(f"m.db: {runs} runs, ")
    assert len(digest) == 64 and digests[0] == digests[1]


def test_parameters_of_objects_that_one_store_lacks_come_from_the_other(tmp_path: Path) -> None:
    full = full_store(tmp_path / "full.db")
    lacking = tmp_path / "lacking.db"
    shutil.copyfile(full, lacking)
    change(lacking, SAMPLE, "sample = 0", objects=None)
    objects = [row["objects"] for row in contents(full)["sample"]]
    assert len(set(objects)) == 3

    for order in ((full, lacking), (lacking, full)):
        merged = tmp_path / f"{order[0].stem}_first.db"
        merge_stores(order, merged)
        assert [row["objects"] for row in contents(merged)["sample"]] == objects
