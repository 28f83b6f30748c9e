"""The name of a sampled scene, by which `foldcar link` and `foldcar log` know whether they mean the same one.

It is the first 16 hexadecimal digits of the SHA-256 of the scene's JSON text, a slash, and the sample's number.
"""

import hashlib
import json
from collections.abc import Mapping
from typing import Any


def scene_name(scene: Mapping[str, Any], sample: int) -> str:
    """The name of sample ``sample``, whose scene (docs/carsim.md) is ``scene``, with or without an id."""
    content = {key: value for key, value in scene.items() if key != "id"}
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return f"{hashlib.sha256(text.encode()).hexdigest()[:16]}/{sample}"


def sample_in(name: str) -> int | None:
    """The sample's number in a name of :func:`scene_name`; None if it is no such name."""
    digest, _, number = name.partition("/")
    return int(number) if len(digest) == 16 and number.isascii() and number.isdecimal() else None
