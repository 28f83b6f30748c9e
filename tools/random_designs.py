"""Makes cars of random designs: each is made and passes its checks, or is refused in one line that says what would do.

    .venv/bin/python tools/random_designs.py 300 --seed 1

Types, parts, parameters and machines are drawn over their whole ranges and somewhat beyond. The sheets of each car are
written in every format and read back. Where a refusal names a limit
of a parameter, a distance of axles or a sheet, the design is tried again with that, until it is made: a refusal that does
not say what would do, or says what does not, counts as a fault. The exit code is 1 if there are faults.
"""

import argparse
import random
import re
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from foldcar.car.components.component import Parameter
from foldcar.car.design import Design, DesignError, compose
from foldcar.car.design_parameters import parameter_of, parameters
from foldcar.car.folded_car import folded_car
from foldcar.car.parts.catalogue import OPTIONS, PartChoices, catalogue
from foldcar.car.verify import CheckError, raise_on_findings, verify
from foldcar.errors import FoldcarError
from foldcar.fabrication.patterns.options import MACHINES, Options, options
from foldcar.fabrication.patterns.sheet_files import WRITERS, pdf
from foldcar.fabrication.patterns.sheets import pattern

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "test" / "host"))
from sheet_reader import READERS, check_pdf, check_sheet, check_text

# A refusal says what would do: a limit, an alternative, what it needs.
SAYS_WHAT_WOULD_DO = re.compile(
    r"minimum|maximum|below the|above the|at least|at most|would do|needs|must|known:|serves|takes|has no module|only",
    re.IGNORECASE,
)
LIMIT = re.compile(r"(below the|above the)(?: minimum| maximum)? (-?[0-9.]+(?:e-?[0-9]+)?)")
APART = re.compile(r"axles at least ([0-9.]+) apart.* puts two of them ([0-9.]+) apart")
SHEET = re.compile(r"--sheet (\S+) would do")
# Limits depend on each other: a chain of refusals ends, or the advice leads nowhere.
MAX_TRIES = 12


@dataclass(frozen=True)
class Draw:
    """A random design, not composed yet, and the machine that is to cut it."""

    type: str
    values: Mapping[str, float]
    machine: str
    sheet: str | None

    def __str__(self) -> str:
        settings = " ".join(f"{key}={value:.6g}" for key, value in self.values.items())
        return f"{self.type} {settings} --material {self.machine}" + (f" --sheet {self.sheet}" if self.sheet else "")


@dataclass
class Outcome:
    """What became of a draw: its refusals in order, whether it was made in the end, and the fault, if there is one."""

    draw: Draw
    refusals: list[str] = field(default_factory=list)
    made: bool = False
    fault: str = ""


def draws(count: int, seed: int) -> Iterator[Draw]:
    """Random designs; the same for the same seed."""
    chance = random.Random(seed)
    for number in range(count):
        modules = _type(chance)
        letters = set(modules.split("_"))
        values = {}
        for key, parameter in parameters().items():
            if parameter.modules.isdisjoint(letters) or parameter.declared.optional or chance.random() < 0.25:
                continue
            values[key] = _value(chance, parameter.declared)
        values |= _places(random.Random(f"{seed} {number}"), modules)
        machine = chance.choice(list(MACHINES))
        sheet = chance.choice([None, None, *MACHINES[machine].sheets])
        parts = PartChoices().changed({kind: chance.choice(list(names)) for kind, names in OPTIONS.items()})
        yield Draw(modules + (parts.suffix if chance.random() < 0.5 else ""), values, machine, sheet)


def _type(chance: random.Random) -> str:
    """One to three segments with a wheel module or two; the boards' module anywhere in them."""
    segments = [["W"] * chance.choice((1, 1, 2)) for _ in range(chance.choice((1, 1, 1, 2, 3)))]
    home = chance.choice(segments)
    home.insert(chance.randint(0, len(home)), "B")
    return "_H_".join("_".join(letters) for letters in segments)


def _places(chance: random.Random, modules: str) -> dict[str, float]:
    """Sometimes an axle without servos, or one with wheels of another radius."""
    axles, values = modules.count("W"), dict[str, float]()
    if axles > 1 and chance.random() < 0.3:
        values[f"W{chance.randint(1, axles)}.driven"] = 0.0
    if axles > 1 and chance.random() < 0.3:
        values[f"W{chance.randint(1, axles)}.radius"] = _value(chance, parameters()["radius"].declared)
    return values


def _value(chance: random.Random, declared: Parameter) -> float:
    """A value, mostly near the default, sometimes at or beyond a limit."""
    default, least, most = declared.default_with(catalogue()), declared.minimum_with(catalogue()), declared.maximum
    kind = chance.random()
    if kind < 0.6:
        value = default * chance.uniform(0.7, 1.6)
    elif kind < 0.85:
        value = least + (min(most, 4 * default) - least) * chance.random() ** 2
    elif kind < 0.95:
        value = chance.choice((least, least, most))
    else:
        value = chance.choice((least - abs(least) * 0.1 - 1, most * 1.1 + 1))
    return round(value, chance.choice((0, 1, 3)))


def sheets(design: Design, chosen: Options) -> None:
    """Make and check the car and its sheets as `make_car` does, then read the written sheets back; CheckError."""
    made = pattern(folded_car(design), chosen, design.title, "foldcar pattern")
    findings = [*map(str, verify(design).findings), *made.torn]
    for sheet in made.sheets:
        findings += check_sheet(sheet, chosen.margin_mm)
        for ending, write in WRITERS.items():
            findings += check_text(READERS[ending], sheet, write(sheet), chosen)
    raise_on_findings(design.title, [*findings, *check_pdf(made.sheets, pdf(made.sheets, design.title))])


def tried(draw: Draw, make: Callable[[Design, Options], object] = sheets) -> Outcome:
    """What becomes of the draw, following what its refusals say would do."""
    outcome = Outcome(draw)
    try:
        while not outcome.made:
            refusal = _refusal(draw, make)
            if refusal is None:
                outcome.made = True
                continue
            outcome.refusals.append(str(refusal))
            following = _followed(draw, refusal)
            if isinstance(refusal, CheckError):
                outcome.fault = f"fails its checks: {refusal}"
            elif "\n" in str(refusal):
                outcome.fault = f"more than a line: {refusal}"
            elif not SAYS_WHAT_WOULD_DO.search(str(refusal)):
                outcome.fault = f"says not what would do: {refusal}"
            elif outcome.refusals.count(str(refusal)) > 1 or len(outcome.refusals) > MAX_TRIES:
                outcome.fault = f"what should do does not: {' | '.join(outcome.refusals[-3:])}"
            elif following is not None:
                draw = following
                continue
            break
    except Exception as error:
        outcome.fault = f"{type(error).__name__}: {error} ({draw})"
    return outcome


def _refusal(draw: Draw, make: Callable[[Design, Options], object]) -> FoldcarError | None:
    try:
        design = compose(draw.type, draw.values)
        folded_car(design)
        make(design, options(draw.machine, sheet=draw.sheet))
    except FoldcarError as error:
        return error
    return None


def _followed(draw: Draw, error: FoldcarError) -> Draw | None:
    """The draw with the value or the sheet that the refusal names; None if it names none that can be set."""
    limit, sheet, apart = (pattern.search(str(error)) for pattern in (LIMIT, SHEET, APART))
    if apart:
        # Distances are shown with four digits, and those along a folded car grow by less than its modules.
        declared = parameters()["W.length"].declared
        length = draw.values.get("W.length", declared.default_with(catalogue())) + float(apart[1]) - float(apart[2]) + 0.5
        # Beyond it a smaller radius is what would do.
        return replace(draw, values={**draw.values, "W.length": length}) if length <= declared.maximum else None
    if isinstance(error, DesignError) and error.parameter and parameter_of(error.parameter) and limit:
        return replace(draw, values={**draw.values, error.parameter: float(limit[2])})
    return replace(draw, sheet=sheet[1]) if sheet else None


def main() -> int:
    """Try as many designs as asked and report."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("count", type=int, help="number of designs")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    counts: Counter[str] = Counter()
    for number, draw in enumerate(draws(arguments.count, arguments.seed), 1):
        outcome = tried(draw)
        kind = "made" if outcome.made and not outcome.refusals else "made as advised" if outcome.made else "refused"
        counts[kind if not outcome.fault else "faults"] += 1
        if outcome.fault:
            print(f"{number}: {draw}\n   {outcome.fault}", flush=True)
        elif not outcome.made:
            print(f"{number}: refused: {outcome.refusals[-1]}", flush=True)
    summary = ", ".join(f"{number} {kind}" for kind, number in sorted(counts.items()))
    print(f"{arguments.count} designs of seed {arguments.seed}: {summary}")
    return 1 if counts["faults"] else 0


if __name__ == "__main__":
    sys.exit(main())
