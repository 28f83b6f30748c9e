"""Sweeps a listing as the command does, into a store, for tests of what is in it and in its report afterwards."""

import json
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from typer.testing import CliRunner

from foldcar.cli import app
from foldcar.errors import FoldcarError
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.results import Result
from foldcar.store.reader import Store
from foldcar.study.experiment_runs import Progress
from foldcar.study.experiments import engine_study, read_study
from foldcar.study.stopping import stopping_rules
from foldcar.study.sweep import Sweep
from study_car import listing_of

WriteListing = Callable[[Any], Path]
STEP_PYRAMIDS = Path(__file__).resolve().parents[2] / "scenarios" / "step_pyramids.scenic"


def straight_listing(write_listing: WriteListing, listing_data: Any, program: Path) -> Path:
    """A listing with one width and three samples of ``program``, whose course a car drives straight along."""
    listing_data["environments"]["1"]["scenic_filename"] = str(program)
    listing_data["vehicles"]["1"]["params"] = [{"common": {"width": 95}}]
    listing_data["experiments"]["1"]["params"]["timeout"] = 10
    return write_listing(listing_data)


def foldcar(*words: str | Path) -> str:
    """The output of a command in this process, which must succeed."""
    done = CliRunner().invoke(app, [*map(str, words)])
    assert done.exit_code == 0, done.output
    return done.output


def json_output(*words: str | Path) -> dict[str, Any]:
    """The result of a command as JSON, which may print notes beside it."""
    done = CliRunner().invoke(app, [*map(str, words), "--json"])
    assert done.exit_code == 0, done.output
    result: dict[str, Any] = json.loads(done.stdout)
    return result


def reported(folder: Path, widths: Sequence[int], environments: int) -> Path:
    """The folder with a swept store, s.db, with two trials, and its report."""
    listing = listing_of(STEP_PYRAMIDS, {"width": list(widths)}, timeout=120, environments=environments)
    (folder / "l.json").write_text(json.dumps(listing))
    foldcar("sweep", folder / "l.json", "--store", folder / "s.db")
    rows = ("vehicle_type,outcome,source,width_mm", "W_B_W,passed,notes,95", "W_B_W,tipped,notes,95", "")
    (folder / "t.csv").write_text("\n".join(rows))
    foldcar("trials", "import", folder / "s.db", folder / "t.csv", "--experiment", "1")
    foldcar("report", folder / "s.db", "-o", folder / "report")
    return folder


def swept(
    listing: Path,
    store: Path,
    carsim: Path | Carsim,
    jobs: int = 2,
    environments: int | None = None,
    experiment: str | None = None,
    until: str | None = None,
    stop_at: float = math.inf,
    realities: int | None = 0,
) -> Progress:
    """Sweep, or begin to: InterruptedError once ``stop_at`` runs are new. ``until`` is the option of that name."""
    simulator = Carsim(carsim) if isinstance(carsim, Path) else carsim
    study = engine_study(read_study(listing, experiment, environments), simulator)

    def stop(progress: Progress) -> None:
        if progress.new >= stop_at:
            raise InterruptedError

    rules = stopping_rules(until, study) if until else {}
    return Sweep(study, store, simulator, "foldcar sweep …", until=rules, realities=realities).run(jobs, stop)


def rows(store: Path) -> list[Result]:
    with Store.open(store) as opened:
        return list(opened.results())


def stored_runs(store: Path) -> int:
    """How many runs a store has while it is being written; 0 before it is one."""
    try:
        with Store.open(store) as opened:
            return sum(experiment.stored_runs for experiment in opened.info().experiments.values())
    except FoldcarError:
        return 0
