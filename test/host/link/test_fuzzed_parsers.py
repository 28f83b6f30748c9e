"""Whatever a file holds, each parser accepts it or refuses it by a FoldcarError whose message is one line."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from foldcar.car.design import compose
from foldcar.errors import FoldcarError
from foldcar.link.tlog import messages_of, records_of
from foldcar.study.listing_file import read_listing
from foldcar.trials.csv_import import read_trials

LOG = Path(__file__).parents[1] / "data" / "trial.tlog"
PUBLISHED = Path(__file__).resolve().parents[3] / "scenarios" / "published_trials.csv"
# The same examples on every machine.
BOUNDED = settings(
    max_examples=60, derandomize=True, deadline=None, database=None, suppress_health_check=list(HealthCheck)
)
LEAVES = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8)
JSON = st.recursive(
    LEAVES, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=6), inner, max_size=3)
)


@pytest.fixture(scope="module")
def recorded_log() -> bytes:
    return LOG.read_bytes()


def accepts_or_says_why(parse: Callable[[], Any]) -> None:
    """Any other exception is a defect."""
    try:
        parse()
    except FoldcarError as error:
        assert str(error).strip()
        assert "Traceback" not in str(error)


@st.composite
def changed(draw: st.DrawFn, data: Any) -> Any:
    """The JSON value with one place replaced, removed, or given another name."""
    if draw(st.integers(0, 3)) == 0 or not isinstance(data, (dict, list)) or not data:
        return draw(JSON)
    if isinstance(data, dict):
        key = draw(st.sampled_from(sorted(data)))
        rest = {name: value for name, value in data.items() if name != key}
        match draw(st.integers(0, 6)):
            case 0:
                return rest
            case 1:
                return {**rest, draw(st.text(max_size=6)): data[key]}
        return {**data, key: draw(changed(data[key]))}
    index = draw(st.integers(0, len(data) - 1))
    return [*data[:index], draw(changed(data[index])), *data[index + 1 :]]


@st.composite
def damaged(draw: st.DrawFn, content: bytes) -> bytes:
    """The bytes with a few replaced, removed or inserted, or cut off."""
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, len(content)))
        content = content[:at] + draw(st.binary(max_size=6)) + content[at + draw(st.integers(0, 6)) :]
        if draw(st.integers(0, 9)) == 0:
            content = content[:at]
    return content


@given(data=st.data())
@BOUNDED
def test_listings(tmp_path_factory: Any, listing_data: Any, data: st.DataObject) -> None:
    file = tmp_path_factory.mktemp("listing") / "l.json"
    file.write_text(json.dumps(data.draw(changed(listing_data))), encoding="utf-8")
    accepts_or_says_why(lambda: read_listing(file))


@given(text=st.text(max_size=40))
@BOUNDED
def test_listings_of_any_text(tmp_path_factory: Any, text: str) -> None:
    file = tmp_path_factory.mktemp("listing") / "l.json"
    file.write_bytes(text.encode("utf-8", "surrogatepass"))
    accepts_or_says_why(lambda: read_listing(file))


@given(
    kind=st.text("WB_+=hingefllm0123456789.,-", max_size=16) | st.sampled_from(["W_B_W", "W_B_B_W", "W_B_W+film=0.19"]),
    values=st.dictionaries(st.sampled_from(["width", "height", "radius", "x"]), st.floats() | st.integers(), max_size=3),
)
@BOUNDED
def test_designs(kind: str, values: dict[str, float]) -> None:
    accepts_or_says_why(lambda: compose(kind, values))


@given(data=st.data())
@BOUNDED
def test_trials_as_csv(tmp_path_factory: Any, data: st.DataObject) -> None:
    file = tmp_path_factory.mktemp("trials") / "t.csv"
    lines = PUBLISHED.read_bytes().splitlines(keepends=True)
    file.write_bytes(data.draw(damaged(b"".join(lines[: data.draw(st.integers(1, 4))]))))
    accepts_or_says_why(lambda: read_trials(file, None))


@given(data=st.data())
@BOUNDED
def test_logs(recorded_log: bytes, data: st.DataObject) -> None:
    content = data.draw(damaged(recorded_log[: data.draw(st.integers(0, 400))]) | st.binary(max_size=60))
    accepts_or_says_why(lambda: list(messages_of(records_of(content)[0])))
