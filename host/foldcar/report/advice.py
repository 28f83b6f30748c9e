"""What advice and calibration say of each experiment of a store, as the report lays it out.

Input: a store. Output: sentences, recommendations and tables by experiment; where advice fails, a remark says why.
"""

from dataclasses import replace

from foldcar.advice.comparison import Comparison, ExperimentComparison, compare_evidence
from foldcar.advice.evidence import read_evidence, unswept_trials
from foldcar.advice.selecting import Selection, select_evidence
from foldcar.analysis.gap import Gap
from foldcar.analysis.rate import Rate
from foldcar.analysis.words import points, rank_text
from foldcar.calibration.summary import findings
from foldcar.errors import FoldcarError
from foldcar.report.advice_slots import Part, Recommendation, Slots, Table
from foldcar.store.calibrations import Calibration, calibrations
from foldcar.store.reader import Store

DASH = "–"


def read_advice(store: Store, threshold: float | None = None) -> dict[str, Slots]:
    """The advice for every swept experiment by its name; ``threshold`` None: the listing's.

    Sheets are not nested: `foldcar select` does that.
    """
    try:
        evidence = read_evidence(store)
        selections = select_evidence(evidence, threshold=threshold, with_cost=False)
        comparison = compare_evidence(evidence, unswept_trials(store))
    except FoldcarError as error:
        unknown = Slots(parts=(Part("What to build next", (f"No advice: {error}.",)),))
        return {name: unknown for name in store.experiment_ids()}
    found = {one.info.id: _slots(one, comparison) for one in selections}
    for calibration in calibrations(store):
        slots = found.get(calibration.experiment)
        if slots is not None:
            found[calibration.experiment] = replace(slots, parts=(*slots.parts, _calibrated(calibration)))
    return found


def _slots(selection: Selection, comparison: Comparison) -> Slots:
    compared = next(one for one in comparison.experiments if one.info.id == selection.info.id)
    sentences = []
    # Where nothing reaches the threshold, the table says what bounds it; a headline would sound like praise.
    reaching = [one for one in selection.recommendations if one.trials_done or one.simulated.value >= selection.threshold]
    if reaching or selection.enough:
        sentences.append(selection.sentence)
    if compared.mean_gap is not None:
        sentences.append(compared.sentence)
    parts = [_compared(compared)] if compared.designs else []
    if selection.recommendations or selection.enough:
        parts.insert(0, _selected(selection))
    return Slots(_recommendations(selection), tuple(parts), tuple(sentences))


def _recommendations(selection: Selection) -> tuple[Recommendation, ...]:
    """Those that a figure over a single parameter can mark."""
    if len(selection.info.varied) != 1:
        return ()
    (parameter,) = selection.info.varied
    return tuple(
        Recommendation(parameter, one.design[parameter], one.label, one.reason) for one in selection.recommendations
    )


def _selected(selection: Selection) -> Part:
    expected = any(one.expected is not None for one in selection.recommendations)
    columns = ["design", "simulation %", *["expected %"] * expected, "trials done", "more trials"]
    rows = [
        [
            one.label,
            _rate(one.simulated),
            *[_rate(one.expected)] * expected,
            str(one.trials_done),
            str(one.trials),
        ]
        for one in selection.recommendations
    ]
    half = points(selection.precision, sign=False)
    remarks = [f"{one.label}: {one.reason}." for one in selection.recommendations]
    remarks += selection.remarks
    if selection.environments:
        samples = ", ".join(map(str, selection.environments))
        remarks.append(f"Environments to set up, the same for all (`foldcar log --sample K`): {samples}.")
    caption = f"More trials: until a rate is known to ±{half} points (95 %). `foldcar select` counts sheets too."
    return Part("What to build next", tuple(remarks), tables=(Table(caption, columns, rows),) if rows else ())


def _compared(compared: ExperimentComparison) -> Part:
    rectified = any(one.rectified is not None for one in compared.designs)
    columns = ["design", "runs", "simulation %", "passed of trials", "trials %", *["rectified %"] * rectified]
    rows = [
        [
            one.label,
            str(one.evidence.runs),
            _rate(one.simulated),
            f"{one.evidence.trials_passed} of {len(one.evidence.trials)}",
            _rate(one.driven),
            *[_rate(one.rectified)] * rectified,
            _gap(one.gap),
            one.verdict or DASH,
        ]
        for one in compared.designs
    ]
    caption = "Gap: trials minus simulation, in points; all gaps of the table hold together with 95 %."
    if rectified:
        caption += " Rectified: the trials' rate with the help of simulation."
    ranks = rank_text(compared.ranks)
    remarks = [*([ranks] if ranks else []), *compared.remarks]
    if compared.mean_gap is None:
        remarks.insert(0, compared.sentence)
    table = Table(caption, [*columns, "gap", "verdict"], rows)
    return Part("Simulation against trials", tuple(remarks), tables=(table,))


def _calibrated(calibration: Calibration) -> Part:
    """The simulator's parameters, as the trials leave them, and what that says."""
    rows = [
        [one["name"], one["unit"], _ends(one["prior"]), _ends(one["posterior"])]
        for one in calibration.summary["parameters"]
    ]
    caption = f"The simulator's parameters: median and interval. Calibrated {calibration.created_utc} (UTC)."
    table = Table(caption, ["parameter", "unit", "before", "after the trials"], rows)
    return Part(f"Calibration {calibration.name}", tuple(findings(calibration.summary)), tables=(table,))


def _ends(ends: dict[str, float]) -> str:
    return f"{ends['median']:.3g} ({ends['low']:.3g} to {ends['high']:.3g})"


def _rate(rate: Rate | None) -> str:
    return DASH if rate is None else f"{100 * rate.value:.0f} ({100 * rate.low:.0f} to {100 * rate.high:.0f})"


def _gap(found: Gap | None) -> str:
    return DASH if found is None else f"{points(found.value)} ({points(found.low)} to {points(found.high)})"


