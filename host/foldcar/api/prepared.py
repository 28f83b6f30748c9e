"""What the simulator is given for a call from Python: the texts of cars and settings, checked as a listing's.

Texts are kept for the last designs: to compile one takes some 10 ms, as long as a run.
"""

import json
from collections.abc import Mapping
from functools import cache, lru_cache
from pathlib import Path

from pydantic import ValidationError

from foldcar.api.environment import simulator
from foldcar.api.whole import whole
from foldcar.car.body import body_json
from foldcar.car.car_file import TableRow
from foldcar.car.design import Design, compose
from foldcar.car.variation import draw, spread_named, vary_body
from foldcar.errors import FoldcarError
from foldcar.store.writer import canonical_json
from foldcar.study.experiments import Experiment
from foldcar.study.family import Family
from foldcar.study.limits import GREATEST_SEED
from foldcar.study.listing import ExperimentParams

# What a listing calls these arguments.
LISTED = {"timeout_s": "timeout", "speed_m_s": "speed", "yaw_rate_rad_s": "yaw_rate"}
KEPT_DESIGNS = 1000


def prepared(design: Design, timeout_s: float, speed_m_s: float | None, yaw_rate_rad_s: float) -> tuple[str, str]:
    """Body and settings of the design's runs as JSON. FoldcarError if an argument is beyond its limits."""
    arguments = {"timeout_s": timeout_s, "speed_m_s": speed_m_s, "yaw_rate_rad_s": yaw_rate_rad_s}
    for name, value in arguments.items():
        if isinstance(value, bool) or not isinstance(value, int | float | None):
            raise FoldcarError(f"{name}: {value!r} is not a number")
    return _prepared(design.type, tuple(design.values.items()), *arguments.values())


def built_cars(
    body: str, count: int, spread: str | Mapping[str, float], seed: int
) -> dict[str, str]:
    """The bodies of ``count`` built cars by name, in order, as a listing's ``variation`` makes them. FoldcarError."""
    chosen = spread_named(spread, "variation")
    number = whole("variation_seed", seed, 0, GREATEST_SEED)
    nominal, limits = json.loads(body), simulator().carsim.limits().numbers
    return {
        f"car {k}": canonical_json(vary_body(nominal, draw(chosen, number, k), limits)) for k in range(count)
    }


@lru_cache(KEPT_DESIGNS)
def _prepared(
    type_string: str, values: tuple[tuple[str, float], ...], *arguments: float | None
) -> tuple[str, str]:
    design = compose(type_string, dict(values))
    body = body_json(design)
    return canonical_json(body), canonical_json(_experiment(design, arguments).settings(design, body, _table()))


def _experiment(design: Design, arguments: tuple[float | None, ...]) -> Experiment:
    """The experiment of a listing with the same settings."""
    given = {key: float(one) for key, one in zip(LISTED.values(), arguments, strict=True) if one is not None}
    try:
        params = ExperimentParams.model_validate(given)
    except ValidationError as error:
        first = error.errors()[0]
        name = {listed: name for name, listed in LISTED.items()}[str(first["loc"][0])]
        raise FoldcarError(f"{name}: {first['input']:g}: {first['msg'].lower()}") from None
    given_values = {key: (value,) for key, value in design.values.items()}
    family = Family("", design.composition, given_values, {}, Path(), "", parts=design.choices)
    return Experiment(
        id="", family=family, environment="", program=Path(), program_name="", scenic_params={}, seed=0, condition=None,
        environments=1, thresholds=(), timeout_s=params.timeout, speed_m_s=params.speed, yaw_rate_rad_s=params.yaw_rate,
        variation={}, variation_seed=0, place="simulation",
    )  # fmt: skip


@cache
def _table() -> dict[str, TableRow]:
    return simulator().carsim.parameter_table()
