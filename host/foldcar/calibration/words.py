"""What a calibration says and cannot say, in sentences, from the numbers of its summary."""

from collections.abc import Iterator, Mapping
from typing import Any

# Shares of the prior's variance: a parameter is as unknown as before below the first, known better from the second on.
UNTOLD, TOLD = 0.1, 0.3
# Correlations from here on are told; at most this many.
CORRELATED, MOST_PAIRS = 0.25, 3
# Emulator and simulation may differ by this in the rate of a design.
TOLERATED = 0.06


def findings(summary: Mapping[str, Any]) -> list[str]:
    """The sentences; the first is whether the trials are explained."""
    return [*_fit(summary), *_parameters(summary), *_pairs(summary), *_check(summary), *_next(summary)]


def _fit(summary: Mapping[str, Any]) -> Iterator[str]:
    designs = summary["designs"]
    outside = [one for one in designs if not _inside(one["passed"] / one["counted"], one["predicted_95"])]
    if outside:
        yield (
            f"The trials of {_named(outside)} lie outside the 95 % intervals that the calibrated simulator predicts: no "
            "set of these parameters explains them."
        )
    else:
        yield f"The calibrated simulator's 95 % intervals cover the trials of all {len(designs)} designs."
    (discrepancy,) = (one for one in summary["parameters"] if one["name"] == "discrepancy")
    if discrepancy["posterior"]["median"] > 1.3 * discrepancy["prior"]["median"]:
        yield "A discrepancy larger than assumed before is needed: the simulator lacks something that the cars have."


def _parameters(summary: Mapping[str, Any]) -> Iterator[str]:
    rows = [one for one in summary["parameters"] if one["explained"] is not None]
    for one in sorted(rows, key=lambda row: -row["explained"]):
        if one["explained"] >= TOLD:
            yield f"{one['name']} is {_range(one['posterior'])} {one['unit']}, before the trials {_range(one['prior'])}."
    untold = [one["name"] for one in rows if one["explained"] < UNTOLD]
    if untold:
        yield f"The trials say next to nothing about {', '.join(untold)}: their intervals are those assumed before."


def _pairs(summary: Mapping[str, Any]) -> Iterator[str]:
    strong = [one for one in summary["correlations"] if abs(one["correlation"]) >= CORRELATED]
    for one in strong[:MOST_PAIRS]:
        first, second = one["parameters"]
        other = "lower" if one["correlation"] > 0 else "higher"
        yield (
            f"The trials cannot tell {first} and {second} apart (correlation {one['correlation']:+.2f}): lower {first} "
            f"with {other} {second} explains them as well."
        )


def _check(summary: Mapping[str, Any]) -> Iterator[str]:
    for one in summary["designs"]:
        if abs(one["checked"] - one["emulated"]) > TOLERATED:
            yield (
                f"Simulated under the calibration, {_design(one)} passes {100 * one['checked']:.0f} %, the emulator said "
                f"{100 * one['emulated']:.0f} %: take more --runs."
            )


def _next(summary: Mapping[str, Any]) -> Iterator[str]:
    found = summary["next_trials"]
    if found:
        trials = "; of ".join(_trials(one) for one in found)
        yield f"Most would be learned by {found[0]['trials']} trials of {trials}."


def _trials(one: Mapping[str, Any]) -> str:
    height = one["obstacle_height"]
    at = "" if height == 1 else f" with obstacles {100 * height:.0f} % as high"
    return f"{_design(one)}{at} ({one['bits']:.2f} bits, most about {one['parameter']})"


def design_text(design: Mapping[str, float]) -> str:
    """A design by what varies: ``width_mm 95``."""
    return ", ".join(f"{name} {value:g}" for name, value in design.items()) or "the design"


def _design(one: Mapping[str, Any]) -> str:
    return design_text(one["design"])


def _named(designs: list[Any]) -> str:
    return "; ".join(_design(one) for one in designs)


def _inside(value: float, ends: Mapping[str, float]) -> bool:
    return bool(ends["low"] <= value <= ends["high"])


def _range(ends: Mapping[str, float]) -> str:
    return f"{ends['median']:.3g} ({ends['low']:.2g} to {ends['high']:.2g})"
