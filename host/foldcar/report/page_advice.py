"""The page's words on an experiment: its headline, which designs are most likely to work, which would tell most, ranges.

Input: designs with what is believed of them, a smooth model of simulation. Output: sentences that say no more than these.
A design's chance is that its success reaches the last threshold.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy
from numpy.typing import NDArray

from foldcar.analysis import selection
from foldcar.analysis.effects import Effects
from foldcar.analysis.gap import OPTIMISTIC, PESSIMISTIC
from foldcar.analysis.gaussian_process import unit_range
from foldcar.analysis.words import count, design_text, label_and_unit, listed, percent, rate_text, span_text, value_text
from foldcar.car.design_parameters import declared, key_of
from foldcar.report.page_designs import Designs
from foldcar.simulation.results import no_rate_text

# Designs that a line names.
NAMED = 3
# Designs that reach the threshold with this chance do so probably.
PROBABLY = 0.8
# Rates (0 to 1) that differ by no more are a tie.
TIE = 0.005
# More designs are thinned out before those that tell most are chosen: every pair of them is compared.
MOST_COMPARED = 150
DRAWS, ROUND_TRIALS = 1000, 10
# A rate that rises by less than this at an end of the range (0 to 1) does not count.
LEAST_RISE = 0.02
# Neighbouring values are a gap if they are further apart than the median step by this factor, and worth a word if the
# model puts a design between them on the wrong side of the threshold with at least this probability.
WIDE, LEAST_DOUBT = 1.5, 0.05


@dataclass(frozen=True)
class Advice:
    """``effects`` is the smooth model, None if there is none, of the parameters at ``places``."""

    designs: Designs
    effects: Effects | None
    places: Sequence[int]
    threshold: float

    @property
    def limit(self) -> str:
        """The threshold as it is written."""
        return percent(self.threshold)

    @cached_property
    def rates(self) -> NDArray[Any]:
        """What the known designs are judged by (known, 3): rate, low, high."""
        return numpy.array([self.designs.judged[index] for index in self.designs.known], dtype=float).reshape(-1, 3)

    @cached_property
    def chances(self) -> NDArray[Any]:
        """How probable it is that a further built car of each known design passes more often than the threshold."""
        return numpy.asarray((self.draws > self.threshold).mean(axis=0))

    @cached_property
    def draws(self) -> NDArray[Any]:
        """Draws of the known designs' true rates (draws, known), as far as simulation can be trusted before trials."""
        bias = self.designs.bias
        return numpy.zeros((1, 0)) if bias is None else bias.draws(DRAWS)

    @cached_property
    def unit(self) -> NDArray[Any]:
        """The known designs' parameters (known, k), each scaled to 0 to 1."""
        names = [list(self.designs.values)[place] for place in self.places]
        some = [[float(self.designs.designs[index][name]) for name in names] for index in self.designs.known]
        return unit_range(numpy.array(some).reshape(len(self.designs.known), len(names)))

    def headline(self) -> str:
        """The result in one or two sentences."""
        info, designs = self.designs.info, self.designs
        passed, trials = designs.tried.sum(axis=0).tolist()
        if not info.stored_runs:
            if not trials:
                return "No run is stored yet."
            return f"{passed} of {count(trials, 'trial')} of built cars passed; nothing was simulated to compare with."
        if not info.success_defined:
            return f"No car is called good or bad: {info.success_rule}."
        if not len(self.designs.known):
            return f"Nothing can be said: {no_rate_text(info.stored_runs)}."
        if designs.pooled is None:
            driven = " No built car was driven yet." if not trials else ""
            return f"In {info.simulation} {self._reaching()}.{driven}"
        said = []
        for how in (OPTIMISTIC, PESSIMISTIC):
            names = [name for name, one in designs.refuted.items() if one == how]
            said += [f"{how} at {listed(names)}"] if names else []
        wrong = f"Trials contradict {info.simulation}: it is {' and '.join(said)}. " if said else ""
        return f"{wrong}By {info.simulation} and {count(trials, 'trial')} together {self._probably()}."

    def judged(self, fresh: "Advice") -> tuple[str, dict[str, Any]]:
        """Headline and likely designs of a search: of what its best are worth in ``fresh`` environments."""
        found, number = fresh.likely(), count(len(self.designs.known), "design")
        if not found["designs"]:
            return f"A search tried {number}; none passes in fresh environments.", found
        best = found["designs"][0]
        leads = f"{fresh.designs.names[best]} leads with {found['why'][0]}"
        places = {fresh.designs.names[at]: at for at in found["designs"]}
        indices = [self.designs.names.index(name) for name in places]
        judged = f"{len(fresh.designs.known)} were judged in {fresh.designs.info.environments:,} fresh environments"
        said = {**found, "text": f"In fresh environments: {found['text']}", "designs": indices}
        return f"A search tried {number} and {judged}: {leads}.", said

    def _reaching(self) -> str:
        """Which designs pass more often than the threshold, and how sure that is."""
        share = f"more than {self.limit} of the environments"
        good = self.rates[:, 0] > self.threshold
        if not good.any():
            best = self.rates[:, 0].argmax()
            if self.rates[best, 0] == 0:
                return "no design passes a single environment"
            return f"no design passes {share}; the best, {self._name(best)}, passes {percent(self.rates[best, 0])}"
        sure = (self.rates[:, 1] > self.threshold) & ~numpy.isin(self.designs.known, self.designs.contradicting.beside)
        if good.all():
            which = "the design passes" if len(good) == 1 else f"every one of {count(len(good), 'design')} passes"
        elif len(self.designs.info.varied) == 1:
            which = f"{self._ranges(good)} pass" + ("es" if good.sum() == 1 else "")
        else:
            which = f"{good.sum():,} of {count(len(good), 'design')} pass" + ("es" if good.sum() == 1 else "")
        if sure[good].all():
            return f"{which} {share}, and so do the lower ends of the 95 % intervals"
        if not sure.any():
            return f"{which} {share}, but none of them surely (95 %)"
        ranges = self._ranges(sure) if len(self.designs.info.varied) == 1 else f"{sure.sum():,} of them"
        return f"{which} {share}, {ranges} surely (95 % each)"

    def _probably(self) -> str:
        """Which designs probably pass more often than the threshold; of none, which has the best chance."""
        share = f"more than {self.limit} of the environments"
        trusted = ~numpy.isin(self.designs.known, self.designs.contradicting.beside)
        good = (self.chances >= PROBABLY) & trusted
        if not good.any():
            best = int(self.chances.argmax())
            chance = percent(float(self.chances[best]))
            return f"no design is known to pass {share}; {self._name(best)} has the best chance, {chance}"
        if good.all():
            which = "the design" if len(good) == 1 else f"every one of {count(len(good), 'design')}"
        else:
            ranges = len(self.designs.info.varied) == 1
            which = self._ranges(good) if ranges else f"{good.sum():,} of {count(len(good), 'design')}"
        least = percent(float(self.chances[good].min()))
        verb = "passes" if good.sum() == 1 or good.all() else "pass"
        return f"{which} probably {verb} {share}, with a chance of at least {least}"

    def _name(self, at: "int | numpy.integer[Any]") -> str:
        return self.designs.names[int(self.designs.known[at])]

    def _ranges(self, chosen: NDArray[Any]) -> str:
        """Values of the one parameter as ranges of neighbours: ``75 to 150 mm``."""
        (name,) = self.designs.info.varied
        values = [self.designs.designs[index][name] for index in self.designs.known]
        order = sorted(range(len(values)), key=lambda at: values[at])
        runs: list[list[Any]] = []
        for before, at in zip([None, *order], order, strict=False):
            if chosen[at]:
                if before is None or not chosen[before]:
                    runs.append([])
                runs[-1].append(values[at])
        return listed([span_text(name, run[0], run[-1]) for run in runs])

    def likely(self) -> dict[str, Any]:
        """The designs most likely to work: the best by belief and some of its ties, varied."""
        if not len(self.designs.known) or not self.designs.info.success_defined or not self.rates[:, 0].any():
            return {"text": "", "designs": [], "why": []}
        rates = self.rates[:, 0] if self.designs.pooled is None else self.chances
        ties = numpy.flatnonzero(rates >= rates.max() - TIE)
        # First the one whose neighbours are good, too, then those farthest from it.
        first = ties[int(self._smooth[ties].argmax())]
        chosen = self._spread([first, *ties[ties != first]])
        why = [rate_text(*self.rates[at].tolist()) for at in chosen]
        names = [self._name(at) for at in chosen]
        if self.designs.pooled is not None:
            chosen, names = chosen[:1], names[:1]
            chance = f"{percent(float(self.chances[first]))} chance to pass more than {self.limit}"
            text = f"{names[0]}: {chance}; by simulation and trials together it passes {why[0]}"
        elif len(ties) > 1:
            least = f"at least {percent(self.rates[ties, 1].min())} by the 95 % interval of each"
            text = f"{count(len(ties), 'design')} tie at {percent(rates.max())} ({least})"
            text += f"{':' if len(chosen) == len(ties) else ', such as'} {listed(names)}"
        else:
            text = f"{names[0]}: {why[0]}"
        indices = [int(self.designs.known[at]) for at in chosen]
        return {"text": f"{text}.{self._driven()}", "designs": indices, "why": why}

    @property
    def _smooth(self) -> NDArray[Any]:
        """Rates of the known designs by what is known of their neighbours, too."""
        if self.designs.pooled is not None or self.effects is None:
            return self.rates[:, 0]
        return self.effects.model.rates(self.effects.parameters)[0]

    def _driven(self) -> str:
        """The driven designs of which most trials passed, with their counts."""
        passed, trials = self.designs.tried[self.designs.known].T
        driven = sorted(numpy.flatnonzero(trials).tolist(), key=lambda at: -passed[at] / trials[at])
        if not driven:
            return ""
        best = listed([f"{passed[at]} of {trials[at]} at {self._name(at)}" for at in driven[:NAMED]])
        rest = f", of {count(len(driven), 'driven design')}" if len(driven) > NAMED else ""
        return f" Trials that passed: {best}{rest}."

    def _passed(self, at: "int | numpy.integer[Any]") -> str:
        """``9 of 12 trials of 1 car passed``; "" without trials."""
        cars = self.designs.cars[int(self.designs.known[at])]
        return "" if cars is None else f"{cars.passed.sum():.0f} of {cars.text} passed"

    def _spread(self, ties: Sequence[int]) -> list[int]:
        """The first and those farthest from it and from each other, at most NAMED."""
        unit = self.unit[ties]
        if not unit.size:
            return [int(at) for at in ties[:NAMED]]
        chosen = [0]
        while len(chosen) < min(NAMED, len(ties)):
            apart = numpy.sqrt(((unit[:, None] - unit[chosen]) ** 2).sum(axis=2)).min(axis=1)
            chosen.append(int(apart.argmax()))
        return [int(ties[at]) for at in chosen]

    def learn(self) -> dict[str, Any]:
        """The designs whose trials would tell most, each with its chance to reach the threshold and why."""
        if len(self.designs.known) < 2 or not self.designs.info.success_defined or not self.unit.size:
            return {"text": "", "designs": [], "why": []}
        candidates = numpy.arange(len(self.designs.known))
        if len(candidates) > MOST_COMPARED:
            kept = numpy.linspace(0, len(candidates) - 1, MOST_COMPARED).round().astype(int)
            candidates = numpy.union1d(candidates[kept], numpy.flatnonzero(self.designs.tried[self.designs.known, 1]))
        # Neighbours are at most one value apart in every parameter.
        ranks = numpy.array([numpy.unique(column, return_inverse=True)[1] for column in self.unit[candidates].T]).T
        near = numpy.abs(ranks[:, None] - ranks[None, :]).max(axis=2) <= 1
        found = selection.choose(self.draws[:, candidates], self.threshold, ROUND_TRIALS, NAMED, near=near)
        chosen = [int(candidates[at]) for at in found]
        why = [self._why(at) for at in chosen]
        named = listed([f"{self._name(at)} ({reason})" for at, reason in zip(chosen, why, strict=True)])
        text = " ".join(filter(None, (f"{named}." if chosen else "", self._gap())))
        return {"text": text, "designs": [int(self.designs.known[at]) for at in chosen], "why": why}

    def _why(self, at: int) -> str:
        chance = float((self.draws[:, at] > self.threshold).mean())
        done = self._passed(at)
        return f"{done}{', ' if done else ''}{percent(chance)} chance to pass more than {self.limit}"

    def _gap(self) -> str:
        """The gap in a parameter's values in which simulation's side of the threshold is less sure than at any design."""
        if self.effects is None or self.designs.info.searched:
            return ""
        x, names = self.effects.parameters, [list(self.designs.values)[place] for place in self.places]
        gaps = []
        for at, name in enumerate(names):
            values = numpy.unique(x[:, at])
            steps = numpy.diff(values)
            for low, high in numpy.column_stack([values[:-1], values[1:]])[steps > WIDE * numpy.median(steps)]:
                beside = x[(x[:, at] == low) | (x[:, at] == high)].copy()
                beside[:, at] = (low + high) // 2 if (values % 1 == 0).all() else (low + high) / 2
                gaps += [(name, low, high, one) for one in numpy.unique(beside, axis=0)]
        if not gaps:
            return ""
        above = (self.effects.rates(numpy.vstack([x, *(one[-1] for one in gaps)])) > self.threshold).mean(axis=0)
        doubt = numpy.minimum(above, 1 - above)
        at = len(x) + int(doubt[len(x) :].argmax())
        if doubt[at] < max(LEAST_DOUBT, doubt[: len(x)].max()):
            return ""
        name, low, high, middle = gaps[at - len(x)]
        between = f"{label_and_unit(name)[0]} {value_text(name, low)} and {value_text(name, high)}"
        car = design_text(dict(zip(names, middle.tolist(), strict=True)))
        chance = f"a {percent(above[at])} chance to pass more than {self.limit} in {self.designs.info.simulation}"
        return f"Nothing was simulated between {between}; sweep there first: {car} has {chance}."

    def edges(self) -> list[str]:
        """Ends of ranges at which success still rises."""
        if self.effects is None or self.designs.info.searched:
            return []
        said, names = [], list(self.designs.values)
        for at, place in enumerate(self.places):
            name = names[place]
            one = self.effects.effect(at)
            if len(one.grid) < 3:
                continue
            for end, inner, rises in ((0, 1, one.rises[0]), (-1, -2, one.rises[1])):
                higher = one.mean[end] - one.mean[inner] >= LEAST_RISE and one.mean[end] == one.mean.max()
                value = float(one.grid[end])
                if higher and rises > 0.95 and self._extendable(name, value, end == -1):
                    where = f"{label_and_unit(name)[0]} {value_text(name, value)}"
                    end_name = "upper" if end else "lower"
                    said.append(
                        f"Success still rises at {where}, the range's {end_name} end: extend it if it can be built."
                    )
        return said

    def _extendable(self, name: str, value: float, upwards: bool) -> bool:
        """Whether cars with a value beyond may be asked for."""
        key = key_of(name)
        if key is None:
            return True
        found = declared(key)
        return value < found.maximum if upwards else not isinstance(found.minimum, float | int) or value > found.minimum
