"""`foldcar run` simulates one design in one sampled environment, prints the result and optionally draws it."""

import json
from collections.abc import Iterator, Mapping
from typing import Any

import typer

from foldcar.commands.listed_run import listed_run, simulated_run
from foldcar.commands.options import (
    Components,
    Engine,
    ExperimentId,
    Json,
    Listing,
    Picture,
    Sample,
    Settings,
    print_result,
)

MIN_NAME_WIDTH = 22


def run(
    listing: Listing,
    experiment: ExperimentId,
    settings: Settings = None,
    sample: Sample = 0,
    plot: Picture = None,
    engine: Engine = "multibody",
    components: Components = None,
    as_json: Json = False,
) -> None:
    """Simulate one car in one environment.

    The command prints the outcome, the metrics and the recorded values. The names of metrics contain their units. Exit
    code 1 if the run failed.

    \b
    Example: foldcar run scenarios/width_study.json --experiment 1 --set width=115 --sample 3 --plot run.png
    """
    from foldcar.simulation.results import NUMBERS, outcome_of
    from foldcar.statistics.words import design_text

    listed = listed_run(listing, experiment, settings, sample, engine)
    listed_experiment, design, variation = listed.experiment, listed.design, listed.variation
    simulated, answer = simulated_run(listed)
    if listed.side_view_note:
        typer.echo(listed.side_view_note, err=True)
    lines = [
        (
            "experiment",
            f"{experiment}: vehicle {listed_experiment.family.vehicle} in environment {listed_experiment.environment}",
        ),
        ("design", f"{design.type}, {design_text(design.columns)}"),
        ("sample", f"{sample} (seed {listed_experiment.seed})"),
        *([("variation", f"{variation_text(variation)} (seed {listed_experiment.variation_seed})")] if variation else []),
        ("success", listed.environment.success.text),
        *_answer_lines(answer),
    ]
    if plot is not None:
        from foldcar.figures.run import draw_run
        from foldcar.simulation.heights import carsim_heights

        path = simulated.path(listed.carsim, answer, plot)
        draw_run(simulated.body, simulated.scene, answer, path, carsim_heights(listed.carsim), plot)
        lines.append(("picture", str(plot)))
    result = {
        "experiment": experiment,
        "vehicle": listed_experiment.family.vehicle,
        "environment": listed_experiment.environment,
        "vehicle_type": design.type,
        "design": design.columns,
        "sample": sample,
        "seed": listed_experiment.seed,
        "variation": variation,
        "variation_seed": listed_experiment.variation_seed,
        "outcome": outcome_of(answer),
        "message": answer.get("error"),
        "metrics": {name: answer.get(name) for name in NUMBERS},
        "recorded": answer.get("recorded", {}),
        "picture": plot,
    }
    width = max(MIN_NAME_WIDTH, *(len(name) + 1 for name, _ in lines))
    print_result(as_json, result, *(f"{name:<{width}}{text}" for name, text in lines))
    if "error" in answer:
        raise typer.Exit(1)


def _answer_lines(answer: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield pairs (name, text): the outcome, then metrics and recorded values, or the error of a failed run."""
    from foldcar.simulation.results import NUMBERS, outcome_of

    yield "outcome", outcome_of(answer)
    if "error" in answer:
        yield "message", answer["error"]
        return
    for name in NUMBERS:
        yield name, _value_text(answer[name])
    for name, recorded in answer.get("recorded", {}).items():
        yield f"recorded {name}", _recorded_text(recorded["kind"], recorded["value"])


def variation_text(variation: Mapping[str, Any]) -> str:
    """Return how a car differs from its design, as text: ``supply_v=-0.0931 servo_speed=0.0214,-0.0113,…``."""
    texts = []
    for name, value in variation.items():
        # Some values are one for each wheel or servo.
        numbers = value if isinstance(value, list) else [value]
        numbers_text = ",".join(f"{number:.3g}" for number in numbers)
        texts.append(f"{name}={numbers_text}")
    return " ".join(texts)


def _recorded_text(kind: str, value: Any) -> str:
    """Return a recorded value as text.

    ``kind`` is "initial", "final" or "series". A series is a list of [time in s, value]; its text is its length and its
    last value.
    """
    if kind == "initial":
        return f"{_value_text(value)} at the start"
    if kind != "series":
        return _value_text(value)
    if not value:
        return "series of 0"
    time_s, last_value = value[-1]
    return f"series of {len(value)}, {_value_text(last_value)} at {time_s:.3f} s"


def _value_text(value: Any) -> str:
    """Return a number with three decimals, a list of values, "-" for null, or strings and booleans as JSON."""
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.3f}"
    if isinstance(value, list):
        return f"[{', '.join(map(_value_text, value))}]"
    return json.dumps(value)
