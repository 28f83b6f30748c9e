"""A pytest plugin: tests run in the order of their times in the file TEST_TIMES, which it writes if it is missing."""

import json
import os
from collections import defaultdict
from pathlib import Path

TIMES = Path(os.environ["TEST_TIMES"])
# By test: seconds of fixtures, of the test itself, and after it.
taken_s = defaultdict(dict)


def pytest_collection_modifyitems(items):
    """A fixture that many share counts for each of them, as any may be the first."""
    if not TIMES.is_file():
        return
    known = json.loads(TIMES.read_text(encoding="utf-8"))
    needs = {item.nodeid: set(item.fixturenames) for item in items}

    def time_s(item):
        shared = (known[other]["setup"] for other in known if needs[other] <= needs[item.nodeid])
        return known[item.nodeid].get("call", 0.0) + max(shared)

    items.sort(key=time_s)


def pytest_runtest_logreport(report):
    """Keep its time."""
    taken_s[report.nodeid][report.when] = report.duration


def pytest_sessionfinish():
    """Write the times, once."""
    if not TIMES.is_file():
        TIMES.write_text(json.dumps(taken_s), encoding="utf-8")
