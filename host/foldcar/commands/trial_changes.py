"""`foldcar trials correct`, `withdraw` and `restore`: changes of stored trials, each kept with its reason."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from foldcar.commands.options import Json, Number, StoreFile, print_json
from foldcar.errors import FoldcarError

if TYPE_CHECKING:
    from foldcar.store.trial_records import Correction

Numbers = Annotated[
    list[int], typer.Argument(metavar="TRIAL...", min=1, help="Numbers of trials, as `trials list` shows them.")
]
Reason = Annotated[str, typer.Option(metavar="TEXT", help="Why; it is kept with the change.")]
Operator = Annotated[str, typer.Option(metavar="NAME", help="Who changes it; kept with the change.")]


def correct(
    store: StoreFile,
    number: Number,
    reason: Reason,
    outcome: Annotated[str | None, typer.Option(metavar="OUTCOME", help="The outcome it should have.")] = None,
    note: Annotated[str | None, typer.Option(metavar="TEXT", help="The note it should have.")] = None,
    elapsed_time: Annotated[float | None, typer.Option(metavar="S", min=0, help="How long it drove, in seconds.")] = None,
    car: Annotated[
        str | None, typer.Option(metavar="CAR", help="What drove, built or simulated, if no car has said it itself.")
    ] = None,
    operator: Operator = "",
    as_json: Json = False,
) -> None:
    """Change what a trial says.

    What stood there is kept, with the reason.

    \b
    Example: foldcar trials correct study.db 7 --outcome tipped --reason "seen on the film"
    """
    from foldcar.store.opening import require_store
    from foldcar.store.reader import Store
    from foldcar.store.trial_writer import write_trials

    outcome, car = (None if word is None else word.lower() for word in (outcome, car))
    changes = {"outcome": outcome, "note": note, "elapsed_time_s": elapsed_time, "car": car}
    if all(value is None for value in changes.values()):
        raise FoldcarError("trials correct: say what to change: --outcome, --note, --elapsed-time or --car")
    _check_reason("correct", reason)
    require_store(store)
    with write_trials(store) as writer:
        writer.correct(number, {k: v for k, v in changes.items() if v is not None}, reason, operator)
    with Store.open(store) as opened:
        trail = list(opened.corrections(number))
    _print_trail(trail, as_json)


def withdraw(store: StoreFile, numbers: Numbers, reason: Reason, operator: Operator = "", as_json: Json = False) -> None:
    """Withdraw trials, such as practice.

    They stay in the store with their logs, but count nowhere.

    \b
    Example: foldcar trials withdraw study.db 7 8 --reason practice
    """
    _withdraw("withdraw", store, numbers, True, reason, operator, as_json)


def restore(store: StoreFile, numbers: Numbers, reason: Reason, operator: Operator = "", as_json: Json = False) -> None:
    """Let withdrawn trials count again.

    Both changes are kept, with their reasons.

    \b
    Example: foldcar trials restore study.db 8 --reason "was no practice"
    """
    _withdraw("restore", store, numbers, False, reason, operator, as_json)


def _withdraw(
    command: str, store: Path, numbers: list[int], withdrawn: bool, reason: str, operator: str, as_json: bool
) -> None:
    from foldcar.store.opening import require_store
    from foldcar.store.reader import Store
    from foldcar.store.trial_writer import write_trials

    _check_reason(command, reason)
    require_store(store)
    chosen = list(dict.fromkeys(numbers))
    with write_trials(store) as writer:
        writer.withdraw(chosen, withdrawn, reason, operator)
    with Store.open(store) as opened:
        latest = {one.trial: one for one in opened.corrections()}
        trail = [latest[number] for number in chosen]
    _print_trail(trail, as_json)


def _print_trail(trail: "Sequence[Correction]", as_json: bool) -> None:
    from foldcar.commands.trial_table import correction_text

    if as_json:
        print_json({"corrections": [asdict(one) for one in trail]})
        return
    for one in trail:
        typer.echo(correction_text(one))


def _check_reason(command: str, reason: str) -> None:
    if not reason.strip():
        raise FoldcarError(f"trials {command}: --reason: is empty")
