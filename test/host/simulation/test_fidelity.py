"""The agreement of two engines, which docs/fidelity.md has, computed from given outcomes."""

import sys

import pytest

from conftest import PROJECT
from foldcar.errors import FoldcarError

sys.path.insert(0, str(PROJECT / "tools"))
from fidelity import DesignCounts, Run, agreement


def test_agreement_counts_runs_and_compares_success_rates() -> None:
    outcomes = [
        *(4 * [("passed", "passed")]),
        *(2 * [("passed", "stuck")]), *(2 * [("stuck", "tipped")]),
        *(3 * [("tipped", "tipped")]), ("tipped", "passed"),
    ]  # fmt: skip
    pairs = {Run("1", k // 4, k % 4): pair for k, pair in enumerate(outcomes)}
    # A run that one engine rejects is not compared.
    table = agreement(pairs | {Run("1", 0, 4): ("rejected", "passed")})

    assert (table.runs, table.alike) == (12, 9)
    assert list(table.designs.values()) == [DesignCounts(4, 4, 4), DesignCounts(4, 2, 0), DesignCounts(4, 0, 1)]
    # Rates 1, 1/2, 0 against 1, 0, 1/4: means 1/2 and 5/12, covariance 1/4, variances 1/6 and 13/72.
    covariance = ((1 - 5 / 12) * 0.5 + (0.25 - 5 / 12) * -0.5) / 3
    variances = (0.5 / 3, ((7 / 12) ** 2 + (5 / 12) ** 2 + (2 / 12) ** 2) / 3)
    assert table.correlation == pytest.approx(covariance / (variances[0] * variances[1]) ** 0.5)
    assert (table.rmse, table.bias) == pytest.approx((((0.5**2 + 0.25**2) / 3) ** 0.5, 0.25 / 3))
    one_rate = {run: pair for run, pair in pairs.items() if run.design == 0}
    assert agreement(one_rate).correlation is None
    with pytest.raises(FoldcarError, match="nothing to compare"):
        agreement({Run("1", 0, 4): ("rejected", "passed")})
