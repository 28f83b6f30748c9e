"""An experiment's section of the report as numbers: what `foldcar report --json` prints. Shares are 0 to 1."""

from dataclasses import asdict
from typing import Any

from foldcar.report.sections import Section
from foldcar.report.series import Tally
from foldcar.report.trial_series import TrialTally


def summary_object(section: Section) -> dict[str, Any]:
    """The section without its drawings; ``by`` and ``trials`` hold, by parameter, an object for each value."""
    info, summary = section.info, section.summary
    return {
        "experiment": info.id,
        "vehicle_type": info.vehicle_type,
        "scenic_program": info.scenic_program,
        "planned_runs": info.planned_runs,
        "success_rule": info.success_rule,
        "skipped": list(info.skipped),
        "remarks": list(section.remarks),
        "all": _tally_object(summary.total),
        "by": {
            series.parameter: [{"value": value, **_tally_object(tally)} for value, tally in series.tallies.items()]
            for series in summary.series
        },
        "trials": {
            parameter: [{"value": value, **_trials_object(tally)} for value, tally in driven.items()]
            for parameter, driven in section.trials.series.items()
        },
    }


def _tally_object(tally: Tally) -> dict[str, Any]:
    return {
        "runs": tally.runs,
        "passed": tally.passed if tally.judged else None,
        "success": tally.success,
        "success_interval": tally.interval,
        "mean_time_s": tally.mean_time_s,
        "outcomes": {outcome: tally.outcomes[outcome] for outcome in tally.seen},
        "recorded": {
            name: {"runs": extent.count, "mean": extent.mean, "lowest": extent.lowest, "highest": extent.highest}
            for name, extent in tally.recorded.items()
        },
    }


def _trials_object(tally: TrialTally) -> dict[str, Any]:
    return {
        **asdict(tally),
        "success": tally.success if tally.counted else None,
        "success_interval": tally.interval if tally.counted else None,
    }
