"""`foldcar doctor`: what is installed, what can be reached, which build; a line each."""

import typer

from foldcar.commands.options import Json, print_json


def doctor(as_json: Json = False) -> None:
    """Show what is installed and what can be reached.

    A line each: ok; absent, which only some commands need; missing, which all studies need. What to do stands after an
    arrow. Exit code 1 if something is missing. Nothing is changed, fetched or driven.

    \b
    Example: foldcar doctor
    """
    from dataclasses import asdict

    from foldcar.commands.doctor_findings import findings

    found = []
    for one in findings():
        found.append(one)
        if not as_json:
            todo = f" -> {one.advice}" if one.advice else ""
            typer.echo(f"{one.state:<8} {one.name:<11} {' '.join(one.text.split())}{todo}")
    if as_json:
        print_json({"findings": [asdict(one) for one in found]})
    if any(one.state == "missing" for one in found):
        raise typer.Exit(1)
