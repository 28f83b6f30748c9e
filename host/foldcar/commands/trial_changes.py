"""Commands of `foldcar trials` that change stored trials: `correct`, `withdraw`, `restore`, and `measure`."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from foldcar.commands.options import OneExperiment, TrialNumber, TrialStore, print_lines
from foldcar.errors import FoldcarError

if TYPE_CHECKING:
    from foldcar.store.trial_records import Correction
    from foldcar.store.trial_writer import TrialWriter

TrialNumbers = Annotated[
    list[int], typer.Argument(metavar="TRIAL...", min=1, help="Numbers of trials (see `trials list`).")
]
Reason = Annotated[str, typer.Option(metavar="TEXT", help="Reason, stored with the change.")]
Operator = Annotated[str, typer.Option(metavar="NAME", help="Your name, stored with the change.")]


def correct(
    store: TrialStore,
    number: TrialNumber,
    reason: Reason,
    outcome: Annotated[str | None, typer.Option(metavar="OUTCOME", help="Correct outcome.")] = None,
    note: Annotated[str | None, typer.Option(metavar="TEXT", help="New note.")] = None,
    elapsed_time: Annotated[float | None, typer.Option(metavar="S", min=0, help="Correct driving time (s).")] = None,
    kind: Annotated[
        str | None, typer.Option(metavar="KIND", help="built or simulated; only if the car did not report it.")
    ] = None,
    car: Annotated[str | None, typer.Option(metavar="NAME", help="Name of the built car.")] = None,
    operator: Operator = "",
) -> None:
    """Correct a trial's data.

    The store keeps the old values and the reason.

    \b
    Example: foldcar trials correct study.db 7 --outcome tipped --reason "seen on the film"
    """
    from foldcar.store.trial_records import checked_name

    outcome, kind = (None if word is None else word.lower() for word in (outcome, kind))
    car_name = None if car is None else checked_name(car, "--car")
    # In the store, the column "car" has the kind of the car, built or simulated. Its name is in the column "car_name".
    new_values = {"outcome": outcome, "note": note, "elapsed_time_s": elapsed_time, "car": kind, "car_name": car_name}
    changes = {column: value for column, value in new_values.items() if value is not None}
    if not changes:
        raise FoldcarError("trials correct: nothing to change; use --outcome, --note, --elapsed-time, --kind or --car")
    _change("correct", store, reason, lambda writer: writer.correct(number, changes, reason, operator))


def withdraw(store: TrialStore, numbers: TrialNumbers, reason: Reason, operator: Operator = "") -> None:
    """Exclude trials from all rates.

    Withdraw practice drives, for example. The store keeps withdrawn trials and their logs.

    \b
    Example: foldcar trials withdraw study.db 7 8 --reason practice
    """
    chosen = dict.fromkeys(numbers)
    _change(
        "withdraw",
        store,
        reason,
        lambda writer: writer.withdraw(chosen, withdrawn=True, reason=reason, operator=operator),
    )


def restore(store: TrialStore, numbers: TrialNumbers, reason: Reason, operator: Operator = "") -> None:
    """Make withdrawn trials count again.

    The store keeps both changes with their reasons.

    \b
    Example: foldcar trials restore study.db 8 --reason "was no practice"
    """
    chosen = dict.fromkeys(numbers)
    _change(
        "restore",
        store,
        reason,
        lambda writer: writer.withdraw(chosen, withdrawn=False, reason=reason, operator=operator),
    )


def measure(
    store: TrialStore,
    values: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="NAME=VALUE...", help="Measured values; NAME= deletes a value. Default: show the stored values."
        ),
    ] = None,
    experiment: OneExperiment = None,
) -> None:
    """Store measurements of built cars and obstacles.

    The belief about built cars then takes them as known. obstacle_height is the ratio of real to planned obstacle height.
    com_height_m is how much higher the centre of mass is than in the design, track_m how much wider the track is.

    \b
    Example: foldcar trials measure study.db obstacle_height=1.04 com_height_m=0.005 track_m=0.002
    """
    from foldcar.belief.priors import NAMES, PARAMETERS, measured_value
    from foldcar.store.measured import experiment_to_measure, measured_values, write_measured
    from foldcar.store.reader import Store

    names_to_delete = {text[:-1].strip() for text in values or () if text.endswith("=")}
    for name in names_to_delete - set(NAMES):
        raise FoldcarError(f"trials measure: {name}=: unknown parameter; known: {', '.join(NAMES)}")
    changes: dict[str, float | None] = dict.fromkeys(names_to_delete)
    for text in values or ():
        if not text.endswith("="):
            name, value = measured_value(text, "trials measure:")
            if name in changes:
                raise FoldcarError(f"trials measure: {name}: is given twice; give each parameter once")
            changes[name] = value
    with Store.open(store) as reader:
        experiment_id = experiment_to_measure(reader, experiment)
    if changes:
        with write_measured(store) as writer:
            writer.measure(experiment_id, changes)
    with Store.open(store) as reader:
        measured = measured_values(reader, experiment_id)
    units = {parameter.name: parameter.unit for parameter in PARAMETERS}
    lines = [f"experiment {experiment_id}: {name} {value:g} {units[name]}" for name, value in measured.items()]
    print_lines(*(lines or [f"experiment {experiment_id}: no measured values"]))


def _change(command: str, store: Path, reason: str, change: "Callable[[TrialWriter], list[Correction]]") -> None:
    """Call ``change`` with a writer of an existing store, and print the corrections that it returns.

    ``command`` is the command's name for errors. Raises FoldcarError if the reason is empty or the store does not exist.
    """
    from foldcar.commands.tables import correction_text
    from foldcar.store.connection import require_store
    from foldcar.store.trial_writer import write_trials

    if not reason.strip():
        raise FoldcarError(f"trials {command}: --reason: is empty")
    require_store(store)
    with write_trials(store) as writer:
        corrections = change(writer)
    print_lines(*map(correction_text, corrections))
