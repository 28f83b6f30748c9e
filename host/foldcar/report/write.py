"""Writes a report: all files are written to a temporary folder first and then moved to their places."""

import shutil
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import matplotlib
from threadpoolctl import threadpool_limits

from foldcar.errors import FoldcarError
from foldcar.figures.output import save_figure, svg_text
from foldcar.figures.style import RC
from foldcar.interrupts import held
from foldcar.outputs import check_output_folder
from foldcar.report.across_plot import across_drawings
from foldcar.report.figure_options import THRESHOLDS, FigureOptions
from foldcar.report.page import page_html
from foldcar.report.page_data import NO_OPTIONS, Experiment, page_data, read_experiments
from foldcar.report.paper_figures import Drawing, drawings
from foldcar.report.replay import UNITS, Replayer
from foldcar.report.replay_choice import OutcomeGrid
from foldcar.store.reader import Store

PAGE = "index.html"


def write_report(
    store: Store,
    folder: Path,
    report_command: Sequence[str],
    simulated_trials: bool,
    replayer: Replayer,
    options: FigureOptions = NO_OPTIONS,
) -> dict[str, Any]:
    """Write the page and its figures (SVG, PNG, PDF) into ``folder``, replacing those of an earlier report.

    ``simulated_trials``: show trials of simulated cars too; ``replayer`` simulates the runs that the page replays;
    ``options`` are those of the figures. Returns the page's data, for a summary on the terminal. Raises FoldcarError if
    there is nothing to report or the folder cannot be written.
    """
    check_output_folder(folder)
    # A store with neither runs nor trials says so.
    infos = store.info().experiments if store.holds_study() or next(store.trials(), None) is None else {}
    options.check(infos.values())
    experiments = read_experiments(store, options, simulated_trials)
    if not any(one.trials if not one.designs.swept else one.info.stored_runs for one in experiments):
        raise FoldcarError(f"{store.path}: contains no runs yet; sweep the listing first")
    data = page_data(store, report_command, experiments)
    swept = {one.info.id: one.designs for one in experiments if one.designs.swept}
    shared = list(across_drawings(swept, options.chosen or THRESHOLDS))
    blobs: dict[str, str] = {}
    planned = list(shared)
    for number, (one, shown) in enumerate(zip(experiments, data["experiments"], strict=True)):
        with threadpool_limits(1):
            own = list(drawings(one.designs, one.effects, one.places, one.thresholds, options.sample))
        planned += own
        shown["files"] = [[drawing.caption, f"{drawing.name}.svg"] for drawing in (*own, *shared)]
        blobs |= _add_replay(store, one, shown, f"e{number}", replayer)
        if options.sample >= one.info.environments > 0:
            shown["remarks"].append(f"There is no environment {options.sample} here, so times to cross are not drawn.")
    try:
        with (
            tempfile.TemporaryDirectory(dir=folder.parent, prefix=f".{folder.name}.") as temporary,
            held(lambda: shutil.rmtree(temporary)),
        ):
            made = Path(temporary)
            _save_figures(planned, made)
            # Names of files may hold bytes that are no text.
            (made / PAGE).write_text(page_html(data, blobs), encoding="utf-8", errors="backslashreplace")
            folder.mkdir(exist_ok=True)
            # The page is moved last, so that it never refers to missing figures.
            for file in sorted(made.iterdir(), key=lambda file: file.name == PAGE):
                file.replace(folder / file.name)
    except OSError as error:
        raise FoldcarError(f"{folder}: cannot be written: {error.strerror or error}") from error
    return data


def _add_replay(store: Store, one: Experiment, shown: dict[str, Any], key: str, replayer: Replayer) -> dict[str, str]:
    """Puts an experiment's replay where the page looks for it; its blobs by their ids."""
    if not one.designs.swept:
        return {}
    grid = OutcomeGrid(one.designs.designs[: one.designs.swept], one.info.environments)
    grid.enter(one.designs.runs)
    replay = replayer.replay(store, one.info, grid, one.trials)
    shown["remarks"] += replay.remarks
    if not replay.runs:
        return {}
    shown["replays"] = replay.runs
    shown["replay"] = {"key": key, "units": UNITS, "trials": replay.trials}
    return {f"{key}-{name}": text for name, text in replay.blobs.items()}


def _save_figures(planned: Iterable[Drawing], folder: Path) -> None:
    with matplotlib.rc_context(RC), threadpool_limits(1):
        for drawing in planned:
            figure = drawing.draw()
            for suffix in (".png", ".pdf"):
                save_figure(figure, folder / f"{drawing.name}{suffix}")
            (folder / f"{drawing.name}.svg").write_text(svg_text(figure), encoding="utf-8")
