"""Priors of the simulator's parameters, and what their values do to a run."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import halfnorm, lognorm, norm

from foldcar.belief.priors import NAMES, NOMINAL, PARAMETERS, built_priors
from foldcar.belief.reality import drawn_reality
from foldcar.car.variation import draw, workshop_spreads


def test_a_standard_normal_score_has_the_declared_prior() -> None:
    scores = np.array([-2.5, -1.0, 0.0, 0.7, 3.0])
    for parameter in PARAMETERS:
        prior: Any = {
            "log-normal": lognorm(parameter.sd, scale=parameter.middle or 1),
            "normal": norm(parameter.middle, parameter.sd),
            "half-normal": halfnorm(scale=parameter.sd),
        }[parameter.prior]
        values = parameter.value(scores)
        assert values == pytest.approx(prior.ppf(norm.cdf(scores)))
        assert [parameter.score(value) for value in values] == pytest.approx(list(scores))


def test_a_reality_has_the_values_and_random_parts_that_all_values_share() -> None:
    values = {**NOMINAL, "friction": 0.5, "servo_torque": 0.7, "servo_speed": 1.2, "obstacle_height": 1.5}
    values |= {"com_height_m": 0.01, "track_m": 0.016}

    reality = drawn_reality(values, {}, 1, 2, 2)

    assert {name: reality[name] for name in ("friction", "obstacle_height", "com_z_m", "track_m")} == {
        "friction": 0.5, "obstacle_height": 1.5, "com_z_m": 0.01, "track_m": 0.016,
    }  # fmt: skip
    assert reality["servo_torque"] == pytest.approx([-0.3] * 8) and reality["servo_speed"] == pytest.approx([0.2] * 8)
    assert (reality["start_x_m"], reality["start_heading_rad"]) == (0, 0)
    wide = {**values, "start_position_sd_m": 0.02, "start_heading_sd_rad": 0.1, "wheel_spread": 2.0}
    starts = [drawn_reality(wide, {}, 5, k, k) for k in range(2000)]
    names = ("start_x_m", "start_y_m", "start_heading_rad")
    assert [np.std([start[name] for start in starts]) for name in names] == pytest.approx([0.02, 0.02, 0.1], rel=0.08)
    half = drawn_reality({**wide, "start_heading_sd_rad": 0.05}, {}, 5, 7, 7)
    assert half["start_heading_rad"] == pytest.approx(starts[7]["start_heading_rad"] / 2)
    assert half["start_x_m"] == starts[7]["start_x_m"]
    # The listing's own spreads of the whole car stay, those of wheels give way.
    varied = drawn_reality(wide, {"mass": 0.03, "tyre_grip": 0.5}, 5, 7, 7)
    doubled = draw(
        {name: 2 * workshop_spreads()[name].sd for name in ("tyre_grip", "servo_torque")} | {"mass": 0.03}, 5, 7
    )
    assert varied["tyre_grip"] == pytest.approx(doubled["tyre_grip"]) and varied["mass"] == doubled["mass"]
    # A servo has its own part of what all servos have.
    torques = [1 + difference for difference in varied["servo_torque"]]
    assert torques == pytest.approx([0.7 * (1 + difference) for difference in doubled["servo_torque"]])


def test_named_cells_narrow_what_stands_for_the_supply() -> None:
    assert built_priors("W_B_W", False) == {}

    priors = built_priors("W_B_W+cells=nimh", False)

    assert [NAMES[index] for index in priors] == ["servo_torque", "servo_speed"]
    for (index, prior), middle, sd in zip(priors.items(), (0.95, 1.0), (0.28, 0.12), strict=True):
        z = np.random.default_rng(1).standard_normal(20_000)
        logs = np.log(PARAMETERS[index].value(prior.mean + prior.sd * z))
        assert np.exp(logs.mean()) == pytest.approx(middle, rel=0.01) and logs.std() == pytest.approx(sd, rel=0.02)


def test_only_cars_that_were_built_from_the_sheets_have_their_prior() -> None:
    index = NAMES.index("com_height_m")
    sheets = built_priors("W_B_W", True)[index]

    # 0 ± 3 mm instead of 10 ± 12 mm.
    assert PARAMETERS[index].value(sheets.mean) == pytest.approx(0) and sheets.sd == pytest.approx(0.25)
    assert index not in built_priors("W_B_W", False)


def test_the_page_has_the_priors() -> None:
    """In docs/realities.md a row has median and standard deviation; a half-normal one has its scale only."""
    page = (Path(__file__).resolve().parents[3] / "docs" / "realities.md").read_text(encoding="utf-8")
    cells = [line.split("|")[1:4] for line in page.splitlines() if line.startswith("|`")]
    priors = {name.strip("`"): [float(number) for number in re.findall(r"[0-9.]+", text)] for name, _, text in cells}

    assert list(priors) == list(NAMES)
    for parameter in PARAMETERS:
        half_normal = parameter.prior == "half-normal"
        assert priors[parameter.name] == ([parameter.sd] if half_normal else [parameter.middle, parameter.sd])
