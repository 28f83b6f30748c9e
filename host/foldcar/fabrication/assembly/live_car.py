"""A car whose design is changed on its page: the page, and the car anew for other values.

Input: a design, values by parameter and names of parts by kind. Output: the page's text and JSON answers. A design that
cannot be built, or that fails a check, is answered by its error and the parameter at fault.
"""

import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from foldcar.car.design import Design, DesignError, compose
from foldcar.car.folded.model import FoldedCar
from foldcar.car.folded_car import folded_car
from foldcar.car.modules import parameters
from foldcar.car.parts.choices import OPTIONS
from foldcar.car.proof.plan import planned
from foldcar.car.verify import verify
from foldcar.errors import FoldcarError
from foldcar.fabrication.assembly.view_data import view_data
from foldcar.fabrication.assembly.view_page import facts, view_page

# A slider has about so many steps, each a decimal round number.
SLIDER_STEPS = 200
ROUND_STEPS = (0.01, 0.05, 0.1, 0.5, 1.0, 5.0)

Run = Callable[[Design], Mapping[str, Any]]


class LiveCar:
    """``words`` are the command that makes files of this vehicle, ``named`` the keys that it must set.

    ``run`` simulates a design.
    """

    def __init__(self, design: Design, words: Sequence[str], named: Sequence[str] = (), run: Run | None = None) -> None:
        self.design = design
        self._words = words
        self._named = named
        self._run = run
        # The last run and what was simulated for it: a draft and its checked car share it.
        self._driven: tuple[dict[str, float | str], Mapping[str, Any]] | None = None

    def page(self) -> str:
        """The page, with the design that the command names. FoldcarError if it cannot be built."""
        car = checked_car(self.design)
        run = self._run_of(self.design)
        choices = [{"key": kind, "help": f"part chosen as {kind}", "options": list(of)} for kind, of in OPTIONS.items()]
        live = {
            "parameters": [*self._sliders(), *choices],
            "values": _settings(self.design),
            "command": self._command(self.design),
        }
        return view_page(car, self.design.title, (), run, live)

    def answer(self, question: Any) -> dict[str, Any]:
        """The car of the values in ``question``, or ``error`` (one line) and ``parameter`` (None: of the whole car)."""
        return self._answered(question, self._made)

    def draft(self, question: Any) -> dict[str, Any]:
        """The same in a tenth of the time, but unchecked and without the ways of its parts."""

        def drafted(design: Design) -> dict[str, Any]:
            car = folded_car(design)
            return {"car": view_data(car, planned(car)), "run": self._run_of(design), "facts": facts(car)}

        return self._answered(question, drafted)

    def _answered(self, question: Any, make: Callable[[Design], dict[str, Any]]) -> dict[str, Any]:
        try:
            design = self._composed(question)
            return {**make(design), "title": design.title, "command": self._command(design)}
        except FoldcarError as error:
            at_fault = error.parameter if isinstance(error, DesignError) else getattr(error, "kind", None)
            return {"error": "; ".join(error.lines()), "parameter": at_fault}

    def _made(self, design: Design) -> dict[str, Any]:
        car = checked_car(design)
        return {"car": view_data(car), "run": self._run_of(design), "facts": facts(car)}

    def _run_of(self, design: Design) -> Mapping[str, Any] | None:
        if self._run is None:
            return None
        settings = _settings(design)
        if self._driven is None or self._driven[0] != settings:
            self._driven = settings, self._run(design)
        return self._driven[1]

    def _composed(self, question: Any) -> Design:
        if not isinstance(question, dict):
            raise FoldcarError("the values are not a JSON object")
        values, names = {}, {}
        for key, value in question.items():
            if key in OPTIONS:
                names[key] = str(value)
                continue
            if key not in self.design.values:
                raise FoldcarError(f"{self.design.type} has no parameter {key[:40]!r}")
            if isinstance(value, bool) or not isinstance(value, int | float):
                raise DesignError(key, "is not a number")
            values[key] = float(value)
        return compose(self.design.composition, values, self.design.choices.changed(names))

    def _sliders(self) -> list[dict[str, Any]]:
        found = []
        for key, value in self.design.values.items():
            declared = parameters()[key].declared
            least, most = declared.least_with(self.design.parts), declared.maximum
            # The slider's marks are counted from its lower end.
            step = min(ROUND_STEPS, key=lambda one: abs(one - (most - least) / SLIDER_STEPS))
            least = min(value, -(-least // step) * step)
            text = {"key": key, "unit": declared.unit, "help": declared.help}
            found.append({**text, "least": round(least, 6), "most": most, "step": step})
        return found

    def _command(self, design: Design) -> str:
        usual, settings = _settings(self.design), []
        for key, value in _settings(design).items():
            if key in self._named or value != usual[key]:
                settings += ["--set", f"{key}={value}" if isinstance(value, str) else f"{key}={value:g}"]
        return shlex.join([*self._words, *settings, "-o", "car"])


def _settings(design: Design) -> dict[str, float | str]:
    """Values (mm, degrees) by parameter and names of parts by kind."""
    return {**design.values, **asdict(design.choices)}


def checked_car(design: Design) -> FoldedCar:
    """The folded car; FoldcarError if a check finds something."""
    car = folded_car(design)
    findings = verify(design).findings
    if findings:
        more = f" (and {len(findings) - 1} more)" if len(findings) > 1 else ""
        raise FoldcarError(f"{findings[0]}{more}")
    return car
