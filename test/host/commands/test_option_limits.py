"""Options of commands: the limits of a listing's keys, and no value that a second one silently replaces."""

from typing import Any

import pytest

SETTINGS = ("--set", "width=95", "--set", "height=50", "--set", "width=115")


@pytest.mark.parametrize(
    ("words", "limit"),
    [
        (("sweep", "l.json", "--store", "s.db", "--samples", "2000000"), "1000000"),
        (("sweep", "l.json", "--store", "s.db", "--jobs", "257"), "256"),
        (("sweep", "l.json", "--store", "s.db", "--realities", "1000001"), "1000000"),
        (("sweep", "l.json", "--store", "s.db", "--realities", "-1"), "0"),
        (("sample", "p.scenic", "-n", "1000001"), "1000000"),
        (("sample", "p.scenic", "--seed", "-1"), "0"),
        (("sample", "p.scenic", "--seed", str(2**63)), "9223372036854775807"),
        (("run", "l.json", "--experiment", "1", "--sample", "1000000"), "999999"),
        (("link", "l.json", "--experiment", "1", "--sample", str(2**63)), "999999"),
    ],
)
def test_options_have_the_limits_of_the_listing(foldcar: Any, words: tuple[str, ...], limit: str) -> None:
    answer = foldcar(*words)

    assert answer.returncode == 2
    kind = "greater" if words[-1].startswith("-") else "less"
    assert "Invalid value for '" in answer.stderr and words[-2] in answer.stderr
    assert f"{kind} than or equal to {limit}" in answer.stderr, answer.stderr


@pytest.mark.parametrize(
    "words",
    [
        ("run", "l.json", "--experiment", "1"),
        ("pattern", "l.json", "-o", "out"),
        ("model", "l.json", "--vehicle", "1", "--to", "urdf", "-o", "out"),
    ],
)
def test_a_parameter_that_is_set_twice_is_refused(listing: Any, refused: Any, words: tuple[str, ...]) -> None:
    message = refused(words[0], listing, *words[2:], *SETTINGS)

    assert message == "--set width=115: width is given twice, first as 95"


@pytest.mark.parametrize("command", [("select", "s.db"), ("report", "s.db", "-o", "r", "--threshold", "0.6")])
def test_a_threshold_reads_like_the_listings(
    write_listing: Any, listing_data: Any, refused: Any, command: tuple[str, ...]
) -> None:
    sentence = "75 is not between 0 and 1: a threshold is a fraction of runs: write 0.75 for 75 %"
    assert refused(*command, "--threshold", "75") == f"--threshold: {sentence}"
    listing_data["experiments"]["1"]["params"] = {"threshold": [0.5, 75]}
    file = write_listing(listing_data)
    assert refused("run", file, "--experiment", "1") == f"{file}: experiments.1.params.threshold: {sentence}"


def test_a_parameter_of_a_program_that_is_given_twice_is_refused(tmp_path: Any, refused: Any) -> None:
    (tmp_path / "p.scenic").write_text("model model\n")
    assert refused("sample", "p.scenic", "--param", "a=1", "--param", "a=2") == "--param a=2: a is given twice"
