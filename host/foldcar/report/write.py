"""Write a report: all files go to a temporary folder first, then into the folder of the report."""

import os
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from urllib.parse import quote

from threadpoolctl import threadpool_limits

from foldcar.errors import FoldcarError
from foldcar.figures.output import UNDATED, save_figure
from foldcar.figures.page import bundle, web_page
from foldcar.figures.style import drawing_style
from foldcar.outputs import check_output_folder
from foldcar.report.drives import PageDrives, deflated
from foldcar.report.page_data import page_data
from foldcar.report.page_types import MediaFile, PageData
from foldcar.report.paper_figures import PaperFigure, drawings
from foldcar.report.reported_experiment import ReportedExperiment, read_experiments
from foldcar.report.stills import stills
from foldcar.simulation.engines import find_wasm
from foldcar.store.log_files import referred_file
from foldcar.store.reader import Store
from foldcar.store.trial_records import Media

PAGE = "index.html"
NO_MODULE = "this foldcar has no carsim.wasm; `make setup` builds it where Emscripten is installed"


def write_report(
    store: Store,
    folder: Path,
    report_command: Sequence[str],
    simulated_trials: bool,
    drives: PageDrives,
    thresholds: Sequence[float] = (),
) -> PageData:
    """Write the page and its figures (SVG, PNG, PDF) into ``folder``, replacing those of an earlier report.

    ``simulated_trials`` is as in :func:`read_experiments`; ``drives`` adds what the page simulates;
    ``thresholds`` are those of :func:`read_experiments`. Returns the page's data, for a summary on the terminal.
    Raises FoldcarError if there is nothing to report or the folder cannot be written.
    """
    check_output_folder(folder)
    experiments = read_experiments(store, thresholds, simulated_trials)
    if not any(_has_content(experiment) for experiment in experiments):
        raise FoldcarError(f"{store.path}: contains no runs yet; sweep the listing first")
    data = page_data(store, report_command, experiments)
    blobs: dict[str, str] = {}
    planned_figures: list[PaperFigure] = []
    for number, (experiment, shown) in enumerate(zip(experiments, data["experiments"], strict=True)):
        with threadpool_limits(1):
            figures = list(
                drawings(experiment.columns, experiment.effects, experiment.parameter_indices, experiment.thresholds)
            )
        planned_figures += figures
        shown["files"] = [[figure.caption, f"{figure.name}.svg"] for figure in figures]
        for trial in shown["trials"]:
            trial["media"] = [_shown_media(store, media, folder) for media in store.media(trial["number"])]
        blobs |= drives.add(store, experiment, shown, f"e{number}")
    if any(shown["drives"] for shown in data["experiments"]):
        module = find_wasm()
        if module is None:
            for shown in data["experiments"]:
                shown["drives"] = None
                shown["remarks"].append(f"The page cannot simulate: {NO_MODULE}.")
        else:
            blobs |= {"carsim": deflated(module.read_bytes()), "worker": bundle("worker.js")}
    try:
        with tempfile.TemporaryDirectory(dir=folder.parent, prefix=f".{folder.name}.") as temporary:
            made = Path(temporary)
            _save_figures(planned_figures, made)
            page = web_page("foldcar.report", "study", data=data, blobs=blobs, stills=stills(experiments))
            # Names of files may contain bytes that are not UTF-8.
            (made / PAGE).write_text(page, encoding="utf-8", errors="backslashreplace")
            folder.mkdir(exist_ok=True)
            # The page is moved last, so that it never refers to missing figures.
            for file in sorted(made.iterdir(), key=lambda file: file.name == PAGE):
                file.replace(folder / file.name)
    except OSError as error:
        raise FoldcarError(f"{folder}: cannot be written: {error.strerror or error}") from error
    return data


def _has_content(experiment: ReportedExperiment) -> bool:
    """Return whether a report can show something of an experiment: runs of a swept one, or trials of another."""
    return bool(experiment.info.stored_runs if experiment.evidence.swept else experiment.trials)


def other_figures(folder: Path, data: PageData) -> list[str]:
    """Return the names of the figures in a report's folder that are not of this report, such as an earlier report's."""
    own_stems = set()
    for experiment in data["experiments"]:
        own_stems |= {Path(file).stem for _, file in experiment["files"]}
    figures = [file for file in folder.glob("experiment_*") if file.suffix in UNDATED]
    return sorted(file.name for file in figures if file.stem not in own_stems)


def _shown_media(store: Store, media: Media, folder: Path) -> MediaFile:
    """Return kind, name and address of a photo or film for a page in ``folder``; no address for a missing file."""
    file = referred_file(store.path, media.file).resolve()
    try:
        address = quote(Path(os.path.relpath(file, folder.resolve())).as_posix())
    except ValueError:
        # On Windows, the file is on another drive than the page.
        address = file.as_uri()
    return {"kind": media.kind, "name": file.name, "address": address if file.is_file() else None}


def _save_figures(planned_figures: Iterable[PaperFigure], folder: Path) -> None:
    """Draw the figures and save each in all formats."""
    with drawing_style(), threadpool_limits(1):
        for planned in planned_figures:
            files = [folder / f"{planned.name}{suffix}" for suffix in UNDATED]
            save_figure(planned.draw(), files)
