"""Writes a report: all files are written to a temporary folder first and then moved to their places."""

import re
import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib

from foldcar.errors import FoldcarError
from foldcar.figures.output import save_figure, svg_text
from foldcar.figures.style import RC
from foldcar.interrupts import held
from foldcar.output_folder import check_output_folder
from foldcar.replay.replay import UNITS
from foldcar.report.advice import read_advice
from foldcar.report.advice_slots import Drawing, Part
from foldcar.report.environment_plot import environment_parts
from foldcar.report.figure_options import THRESHOLDS, FigureOptions
from foldcar.report.map_part import map_parts
from foldcar.report.page import page_html
from foldcar.report.page_data import page_data
from foldcar.report.replayer import Replayer
from foldcar.report.sections import NO_OPTIONS, NO_SLOTS, Section, read_section
from foldcar.report.settling import settling_parts
from foldcar.report.tips import with_tips
from foldcar.report.trial_sections import TrialSection, read_trial_sections
from foldcar.store.reader import Store

PAGE = "index.html"


def write_report(
    store: Store,
    folder: Path,
    report_command: Sequence[str],
    simulated_trials: bool,
    replayer: Replayer,
    options: FigureOptions = NO_OPTIONS,
) -> tuple[list[Section], list[TrialSection]]:
    """Write the page and its figures (SVG, PNG, PDF) into ``folder``, replacing those of an earlier report.

    ``simulated_trials``: show trials of simulated cars too; ``replayer`` simulates the runs that the page replays;
    ``options`` are those of the figures.
    Returns the sections of swept experiments and those of experiments that have trials only, for a summary on the
    terminal. Raises FoldcarError if there is nothing to report or the folder cannot be written.
    """
    info = store.info() if store.holds_study() or next(store.trials(), None) is None else None
    swept = info.experiments if info is not None else {}
    check_output_folder(folder)
    options.check(swept.values())
    with matplotlib.rc_context(RC):
        advice = read_advice(store, max(options.chosen, default=None)) if swept else {}
        sections = []
        for number, one in enumerate(swept.values()):
            slots = advice.get(one.id, NO_SLOTS)
            parts = (*map_parts(store, one, options), *slots.parts, *settling_parts(store, one, options))
            slots = replace(slots, parts=parts)
            sections.append(read_section(store, one, simulated_trials, replayer, f"e{number}", slots, options))
        across = environment_parts(store, swept.values(), options)
        driven = read_trial_sections(store, list(swept), simulated_trials, options.chosen or THRESHOLDS)
        if not driven and not any(section.summary.total.runs for section in sections):
            raise FoldcarError(f"{store.path}: contains no runs yet; sweep the listing first")
        data = page_data(store, report_command, options, simulated_trials)
        blobs = _add_files_and_replays(data, across, sections, driven)
        try:
            with (
                tempfile.TemporaryDirectory(dir=folder.parent, prefix=f".{folder.name}.") as temporary,
                held(lambda: shutil.rmtree(temporary)),
            ):
                made = Path(temporary)
                drawings = [drawing for part in across for drawing in part.drawings]
                drawings += [drawing for section in sections for drawing in section.all_drawings]
                drawings += [drawing for section in driven for drawing in section.all_drawings]
                _save_figures(drawings, made)
                page = page_html(data, blobs)
                # Names of files may hold bytes that are no text.
                (made / PAGE).write_text(page, encoding="utf-8", errors="backslashreplace")
                folder.mkdir(exist_ok=True)
                # The page is moved last, so that it never refers to missing figures.
                for file in sorted(made.iterdir(), key=lambda file: file.name == PAGE):
                    file.replace(folder / file.name)
        except OSError as error:
            raise FoldcarError(f"{folder}: cannot be written: {error.strerror or error}") from error
    return sections, driven


def _add_files_and_replays(
    data: dict[str, Any], across: Sequence[Part], sections: Sequence[Section], driven: Sequence[TrialSection]
) -> dict[str, str]:
    """Puts the figures' addresses and the replays where the page looks for them; the replays' blobs by their ids."""
    shared = [drawing for part in across for drawing in part.drawings]
    # The same store gives the same page.
    del data["made"]
    blobs: dict[str, str] = {}
    for one, section in zip(data["experiments"], sections, strict=False):
        one["files"] = [_file(drawing) for drawing in (*section.all_drawings, *shared)]
        one["remarks"] += [remark for remark in section.replay.remarks if remark not in one["remarks"]]
        if section.replay.runs:
            one["replays"] = section.replay.runs
            one["replay"] = {"key": section.key, "units": UNITS, "trials": section.replay.trials}
            blobs |= {f"{section.key}-{name}": text for name, text in section.replay.blobs.items()}
    for one, alone in zip(data["experiments"][len(sections) :], driven, strict=False):
        one["files"] = [_file(drawing) for drawing in alone.all_drawings]
    return blobs


def _file(drawing: Drawing) -> list[str]:
    return [re.split(r"[.;:]( |$)", drawing.caption)[0], f"{drawing.name}.svg"]


def _save_figures(drawings: Sequence[Drawing], folder: Path) -> None:
    for drawing in drawings:
        figure = drawing.draw(False)
        for suffix in (".png", ".pdf"):
            save_figure(figure, folder / f"{drawing.name}{suffix}")
        (folder / f"{drawing.name}.svg").write_text(with_tips(svg_text(figure)), encoding="utf-8")
