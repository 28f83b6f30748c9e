"""Compares the logs in a car with the trials of a store, so that only stored logs are erased.

Input: a car, a store. Output: for each log in the car the trial that has all of its packets.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from foldcar.errors import FoldcarError
from foldcar.link.car import ConnectedCar
from foldcar.link.car_logs import StoredLog, erase_logs, fetch_log, list_logs
from foldcar.link.tlog import messages_of, packets_of, records_of
from foldcar.store.log_files import intact_log
from foldcar.store.reader import Store
from foldcar.store.trial_records import Trial
from foldcar.trials.cars_log import wait_for_storage
from foldcar.trials.person import PersonAnswers, print_line


@dataclass(frozen=True, slots=True)
class ComparedLog:
    """A log in the car, compared with a store: ``trial`` is the number of the trial whose log has all of its packets.

    It is None if the store has no such trial, and if the log ``is_empty``: it has no packet.
    """

    log: StoredLog
    trial: int | None
    is_empty: bool

    @property
    def is_stored(self) -> bool:
        """Whether nothing is lost if the log is erased."""
        return self.is_empty or self.trial is not None


def erase_stored_logs(car: ConnectedCar, store: Path, answers: PersonAnswers | None) -> None:
    """Erase the logs in a car, after comparing them with the logs of the store and printing them.

    A person is asked before, unless ``answers`` is None. Raises FoldcarError if a log is not in the store; then nothing
    is erased.
    """
    # While the car stores a log, it lists no logs.
    wait_for_storage(car, print_line)
    logs = list_logs(car)
    if not logs:
        print_line("the car has no logs")
        return
    print_line(f"comparing {len(logs)} of the car's logs with {store}")
    compared = compare_logs(car, logs, store)
    for item in compared:
        if item.is_empty:
            trial_text = "empty"
        elif item.is_stored:
            trial_text = f"trial {item.trial}"
        else:
            trial_text = f"not in {store}"
        print_line(f"  log {item.log.id:<5} {item.log.size_bytes / 1000:6.1f} kB  {trial_text}")
    missing = [str(item.log.id) for item in compared if not item.is_stored]
    if missing:
        raise FoldcarError(
            f"nothing is erased: {store} does not have log {', '.join(missing)} of the car; if another store has them, "
            "name that one, or keep them: the car overwrites its oldest log by itself"
        )
    if answers is None or answers.line("Erase them in the car? [y/N]: ").lower() in ("y", "yes"):
        erase_logs(car, logs)
        print_line("erased")


def compare_logs(car: ConnectedCar, logs: Sequence[StoredLog], store: Path) -> list[ComparedLog]:
    """Fetch the car's ``logs``, and find the trial of the store that has all packets of each. Raises FoldcarError."""
    with Store.open(store) as reader:
        trials = [trial for trial in reader.trials() if trial.log is not None]
    return [_compared(log, fetch_log(car, log), trials, store) for log in logs]


def _compared(log: StoredLog, content: bytes, trials: Sequence[Trial], store: Path) -> ComparedLog:
    """Return a log of the car, whose bytes are ``content``, with the trial of the store that has all of its packets."""
    records, _damaged_bytes = records_of(content)
    packets = {packet for _, packet in records}
    if not packets:
        return ComparedLog(log, trial=None, is_empty=True)
    # The car's messages have the number of the trial. Usually the trial has this number in the store, too; but if the
    # trials of two stores were merged, it may have another one. So the trials with these numbers are compared first.
    numbers_in_log = {message.trial_id for _, message in messages_of(records) if message.get_type() == "FOLDCAR_TRIAL"}
    likely_trials = [trial for trial in trials if trial.id in numbers_in_log]
    other_trials = [trial for trial in trials if trial.id not in numbers_in_log]
    for trial, stored_packets in _packets([*likely_trials, *other_trials], store):
        if packets <= stored_packets:
            return ComparedLog(log, trial=trial.id, is_empty=False)
    return ComparedLog(log, trial=None, is_empty=False)


def _packets(trials: Sequence[Trial], store: Path) -> Iterator[tuple[Trial, set[bytes]]]:
    """Yield the trials whose log exists, each with the packets in its log."""
    for trial in trials:
        assert trial.log is not None
        file = intact_log(store, trial.id, trial.log, trial.log_sha256)
        if file is not None:
            yield trial, packets_of(file)
