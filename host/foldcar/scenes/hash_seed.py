"""Refuses programs whose samples depend on the order of a set, in a Python process that orders sets of texts at random.

The command foldcar and its workers fix Python's hash seed (foldcar/__main__.py). Who imports foldcar into another Python
gets the same samples, or this error: a program that has sets is sampled in a process with that hash seed too.
"""

import json
import os
import re
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from foldcar.errors import FoldcarError
from foldcar.python_command import python_command

if TYPE_CHECKING:
    from foldcar.scenes.source import SceneSource

SAMPLES = 8
TEXTS_AND_COMMENTS = re.compile(r"'''.*?'''|\"\"\".*?\"\"\"|'[^'\n]*'|\"[^\"\n]*\"|#[^\n]*", re.DOTALL)
SETS = re.compile(r"\b(?:frozen)?set\(|\{[^{}:]+\}")


def refuse_hash_dependence(source: "SceneSource", condition: Mapping[str, Any] | None) -> None:
    """Raise FoldcarError if ``source`` gives other samples here than where sets have their fixed order."""
    if not (sys.flags.hash_randomization and _has_sets(source.program.parent)):
        return
    opening = [str(source.program), source.params, source.seed, condition]
    done = subprocess.run(
        python_command("foldcar.scenes.hash_seed"),
        input=json.dumps(opening),
        env={**os.environ, "PYTHONHASHSEED": "0"},
        stdout=subprocess.PIPE,
        text=True,
        check=False,
    )
    if done.returncode != 0 or json.loads(done.stdout) != _drawn(source):
        raise FoldcarError(
            f"{source.program}: its samples depend on the order of a set, which differs from one Python to the next: "
            "take `sorted(…)` of the set, or start Python with PYTHONHASHSEED=0, as the command foldcar does"
        )


def main() -> None:
    """In the other process: the program on standard input, its samples on standard output."""
    from foldcar.scenes.source import open_environment

    program, *rest = json.load(sys.stdin)
    print(json.dumps(_drawn(open_environment(Path(program), *rest))))


def _has_sets(folder: Path) -> bool:
    """Whether a program of the folder, or Python beside it, has sets, by the look of it."""
    texts = (file.read_text(errors="replace") for file in folder.iterdir() if file.suffix in (".scenic", ".py"))
    return any(SETS.search(TEXTS_AND_COMMENTS.sub("", text)) for text in texts)


def _drawn(source: "SceneSource") -> list[Any]:
    """The first samples; what fails says why."""
    drawn: list[Any] = []
    for k in range(SAMPLES):
        try:
            drawn.append(source.sample(k))
        except FoldcarError as error:
            drawn.append(str(error))
    return drawn
