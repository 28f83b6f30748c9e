"""An experiment's section of the report as numbers: what `foldcar report --json` prints. Shares are 0 to 1."""

from dataclasses import asdict
from typing import Any

from foldcar.report.sections import Section
from foldcar.report.series import Tally
from foldcar.report.trial_sections import TrialSection
from foldcar.report.trial_series import TrialGroup, TrialTally


def summary_object(section: Section) -> dict[str, Any]:
    """The section without its drawings; ``by`` holds, by parameter, an object for each value; ``trials`` too, by car."""
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
        "trials": _cars_object(section.trials.built, section.trials.simulated),
    }


def trials_object(section: TrialSection) -> dict[str, Any]:
    """The section of an experiment that has trials only."""
    return {
        "experiment": section.experiment,
        "vehicle_type": section.vehicle_type,
        "remarks": list(section.remarks),
        "trials": _cars_object(section.built, section.simulated),
    }


def _cars_object(built: TrialGroup, simulated: TrialGroup) -> dict[str, Any]:
    return {
        car: {
            "all": _trials_object(group.total),
            "by": {
                parameter: [{"value": value, **_trials_object(tally)} for value, tally in driven.items()]
                for parameter, driven in group.series.items()
            },
        }
        for car, group in (("built", built), ("simulated", simulated))
    }


def _tally_object(tally: Tally) -> dict[str, Any]:
    return {
        "runs": tally.runs,
        "rejected": tally.rejected,
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
