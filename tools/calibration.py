"""Renews the tables of docs/fidelity.md on the published trials.

Usage: calibration.py FOLDER PAGE. FOLDER keeps what is simulated: a second call simulates nothing that is there. Input:
the width study and the published trials. Output: the page with the text between its marks replaced.
"""

import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from page_block import replaced

from foldcar.inference.calibration.experiment import Simulator, nominal_counts, read_experiment
from foldcar.inference.calibration.inference import Inference, infer
from foldcar.inference.calibration.observations import observe
from foldcar.inference.calibration.summary import summarise
from foldcar.outputs import atomic_file
from foldcar.simulation.carsim import Carsim
from foldcar.store.reader import Store

PROJECT = Path(__file__).resolve().parents[1]
RUNS, SEED = 24_000, 1
# Parameters on the page: from this share of explained variance on.
SHOWN = 0.1


def main(folder: Path, page: Path) -> None:
    """Simulate what is missing in ``folder`` and renew the tables of ``page``."""
    folder.mkdir(parents=True, exist_ok=True)
    store = swept_store(folder / "width_study.db")
    with Store.open(store) as opened:
        experiment = read_experiment(opened, "1")
        observed = observe(opened, experiment, simulated=False)
        nominal = nominal_counts(opened, experiment)
    simulator = Simulator(experiment, Carsim(), len(os.sched_getaffinity(0)), SEED)
    inference: Inference = kept(folder / "inference.pickle", partial(infer, simulator, observed, RUNS))
    summary = summarise(inference, experiment, nominal, SEED, RUNS, leave_one_out=True)
    tables = {"published": published(summary), "parameters": parameters(summary), "findings": findings(summary)}
    text = page.read_text(encoding="utf-8")
    for mark, lines in tables.items():
        block = "".join(f"{line}\n" for line in lines)
        text = replaced(text, page, f"<!-- {mark} of tools/calibration.py -->", f"<!-- end of {mark} -->", block)
    with atomic_file(page) as file:
        file.write(text.encode())


def kept(file: Path, made: Callable[[], Any]) -> Any:
    """What the file keeps, or else what is made and kept in it."""
    if not file.exists():
        with atomic_file(file) as part:
            part.write(pickle.dumps(made()))
    return pickle.loads(file.read_bytes())


def swept_store(store: Path) -> Path:
    """The width study's store with the published trials."""
    if not store.exists():
        foldcar("sweep", "scenarios/width_study.json", "--store", store)
        foldcar("trials", "import", store, "scenarios/published_trials.csv")
    return store


def foldcar(*words: str | Path) -> None:
    """Run a command of foldcar in the project's folder."""
    command = [sys.executable, "-c", "from foldcar.cli import main; main()", *map(str, words)]
    subprocess.run(command, cwd=PROJECT, check=True)


def published(summary: dict[str, Any]) -> list[str]:
    """Each width: trials, nominal and calibrated success, predictions with and without its own trials."""
    head = ["width (mm)", "trials", "nominal", "calibrated", "predicted", "without"]
    rows, driven = [], [design for design in summary["designs"] if design["counted"]]
    for design, left in zip(driven, summary["leave_one_out"], strict=True):
        simulated = f"{100 * design['simulated']['median']:.0f} ({ends(design['simulated'])})"
        trials = f"{design['passed']}/{design['counted']}: {100 * design['passed'] / design['counted']:.0f}"
        width = f"{design['design']['width_mm']:g}"
        predictions = (ends(design["predicted"]), ends(left["predicted"]))
        rows.append([width, trials, f"{100 * design['nominal']:.0f}", simulated, *predictions])
    return table(head, rows)


def parameters(summary: dict[str, Any]) -> list[str]:
    """Parameters that the trials inform, before and after, and how much of their variance the trials explain."""
    rows = []
    for parameter in summary["parameters"]:
        if parameter["explained"] is not None and parameter["explained"] < SHOWN:
            continue
        intervals = (parameter["prior"], parameter["posterior"])
        before, after = (f"{p['median']:.2g} ({p['low']:.2g} to {p['high']:.2g})" for p in intervals)
        explained = "" if parameter["explained"] is None else f"{100 * parameter['explained']:.0f}"
        rows.append([parameter["name"], before, after, explained])
    return table(["parameter", "prior", "posterior", "explained %"], rows)


def findings(summary: dict[str, Any]) -> list[str]:
    """Coverage and the strongest correlations."""
    strongest = summary["correlations"][:3]
    pairs = ", ".join(f"{' and '.join(pair['parameters'])} {pair['correlation']:+.2f}" for pair in strongest)
    return [
        f"- {summary['findings'][0]}",
        f"- The trials cannot tell apart what is correlated: {pairs}.",
    ]


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """A table in Markdown."""
    return [f"|{'|'.join(head)}|", "|---" * len(head) + "|", *(f"|{'|'.join(row)}|" for row in rows)]


def ends(interval: dict[str, float]) -> str:
    """An interval in percent."""
    return f"{100 * interval['low']:.0f} to {100 * interval['high']:.0f}"


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
