"""The table of requests in docs/firmware.md is that of the firmware's supervisor."""

import re
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[3]
SOURCE = PROJECT / "firmware" / "lib" / "supervisor" / "supervisor.cpp"
# The page's words for requests.
REQUESTS = {
    "arm": "arm", "disarm": "disarm", "start": "start", "drive": "the stick moves", "test": "test an output",
    "acknowledge": "acknowledge",
}  # fmt: skip


def test_requests_are_accepted_in_the_states_that_the_page_names() -> None:
    table = SOURCE.read_text(encoding="utf-8").partition("kRefusals[][8] = {")[2].partition("};")[0]
    states = re.findall(r"\w+", table.partition("//")[2].partition("\n")[0])
    accepted = {
        request: [state for state, refusal in zip(states, re.findall(r"k\w+", row), strict=True) if refusal == "kNone"]
        for request, row in re.findall(r"/\* (\w+) \*/ \{(.*?)\}", table, re.DOTALL)
    }
    page = (PROJECT / "docs" / "firmware.md").read_text(encoding="utf-8")
    rows = dict(re.findall(r"^\|([^|]+)\|([^|]+)\|", page.partition("## States")[2].partition("## ")[0], re.MULTILINE))

    for request, words in REQUESTS.items():
        cell = rows[words]
        named = [state for state in states if state != "fault"] if cell == "all but fault" else cell.split(", ")
        assert sorted(named) == sorted(accepted[request]), request


def test_the_page_has_the_patterns_of_the_led() -> None:
    source = (PROJECT / "firmware" / "lib" / "led" / "led.cpp").read_text(encoding="utf-8")
    page = (PROJECT / "docs" / "firmware.md").read_text(encoding="utf-8").partition("### What the LED shows")[2]

    patterns = re.findall(r'\{\w+, "([#.]+)"\}', source)

    assert len(patterns) == 6 and re.findall(r"^\|`([#.]+)`\|", page, re.MULTILINE) == patterns
