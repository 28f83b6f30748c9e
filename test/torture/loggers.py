"""Trials that are disturbed: the program killed or interrupted, the cable pulled, the disk full, the car gone.

What was received stays, the trial is aborted, and the next trial into the same store goes well.
"""

import random
import signal
from pathlib import Path

from processes import ended, kill, moment, require_no_process, start, wait
from study import LossError, foldcar, require_sound

from foldcar.errors import FoldcarError
from foldcar.link.tlog import read_tlog
from foldcar.store.reader import Store
from live_car import LOG, car_at_port, inject, write_free_course

ENDINGS = ("kill", "interrupt", "unplug", "brown-out", "no car", "limit")


def disturbed_log(folder: Path, whole: Path, chance: random.Random) -> str:
    """One trial disturbed in one way, and one after it."""
    write_free_course(folder)
    how, at, limit = chance.choice(ENDINGS), moment(chance), None
    if how == "limit":
        limit = int(10 ** chance.uniform(3, 5.2))
    with car_at_port(goal_x_m=None) as car:
        words = [*LOG, "--port", car.port, "--countdown", "0", "--yes"]
        process = start(folder, words, limit_bytes=limit)
        running = wait(process, at)
        if how == "kill":
            process.kill()
        elif how == "interrupt" and running:
            process.send_signal(chance.choice((signal.SIGINT, signal.SIGTERM, signal.SIGHUP)))
        elif how == "unplug" and running:
            inject(car, inject="unplug", for_s=1.5)
        elif how == "brown-out" and running:
            inject(car, inject="brown_out")
        elif how == "no car":
            kill(car.process.pid)
        code, _, _ = ended(process)
    require_no_process(folder)
    what = f"{how} after {at:.3f} s, exit code {code}"
    logs = {file: file.read_bytes() for file in sorted(folder.glob("s-logs/*.tlog"))}
    for file in logs:
        try:
            times = [time_us for time_us, _ in read_tlog(file)]
        except FoldcarError as error:
            raise LossError(f"{what}: {error}") from None
        if times != sorted(times):
            raise LossError(f"{what}: {file.name}: packets are not in order of time")
    with car_at_port(goal_x_m=None) as car:
        again = foldcar(folder, *LOG, "--port", car.port, "--countdown", "0", "--yes")
    if again.returncode != 0:
        raise LossError(f"{what}: the next trial: exit code {again.returncode}: {again.stderr}")
    with Store.open(folder / "s.db") as store:
        trials = list(store.trials())
    if {str(folder / str(trial.log)) for trial in trials[:-1]} < {str(file) for file in logs}:
        raise LossError(f"{what}: {len(logs)} logs, but {len(trials) - 1} trials")
    for file, content in logs.items():
        if file.read_bytes() != content:
            raise LossError(f"{what}: {file.name} has changed")
    if any(trial.ending == "running" for trial in trials):
        raise LossError(f"{what}: a trial runs for ever")
    require_sound(folder)
    return f"{what}; {', '.join(f'{trial.outcome} ({trial.ending})' for trial in trials)}"
