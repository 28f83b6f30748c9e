"""The class of every command: it refuses numbers that are none as people type them (typed_numbers.py).

What turns the words of a command line into numbers takes underscores and, depending on its version, digits of other
scripts.
"""

import inspect
from typing import Any, get_args

import typer
from typer.core import TyperCommand

from foldcar.typed_numbers import decimal_number, whole_number


class StrictCommand(TyperCommand):
    """A command whose options and arguments that are numbers have been typed as such."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Refuse the first word that is no number; then parse all, as any command does."""
        if not ctx.resilient_parsing:
            typed = self.make_parser(ctx).parse_args(args=list(args))[0]
            for param in self.params:
                parse = _parser(self.callback, param.name)
                words = typed.get(param.name)
                for word in words if isinstance(words, list | tuple) else [words]:
                    if parse is not None and isinstance(word, str):
                        _check(parse, word, ctx, param)
        return super().parse_args(ctx, args)


def _parser(callback: Any, name: str | None) -> Any:
    """What reads the texts of that parameter of the command's function; None unless it is a number or numbers."""
    declared = inspect.signature(inspect.unwrap(callback)).parameters.get(name or "")
    kinds = _kinds(declared.annotation) if declared else set()
    return whole_number if int in kinds else decimal_number if float in kinds else None


def _kinds(annotation: Any) -> set[Any]:
    """The types that an annotation, as Annotated[list[int] | None, …], is made of."""
    parts = get_args(annotation)
    return {kind for part in parts for kind in _kinds(part)} if parts else {annotation}


def _check(parse: Any, word: str, ctx: Any, param: Any) -> None:
    try:
        parse(word)
    except ValueError:
        kind = "whole number" if parse is whole_number else "number"
        raise typer.BadParameter(f"{word!r} is no {kind}, as 12", ctx=ctx, param=param) from None
