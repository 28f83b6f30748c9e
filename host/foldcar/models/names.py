"""Names of exported cars and files, different for different cars, environments and samples.

Letters, digits and underscores only, as PROTO names and models' names consist of them.
"""

import hashlib
import re
from collections.abc import Mapping


def identifier(text: str) -> str:
    """``text`` with other characters replaced; then its hash keeps it apart from another one that reads the same."""
    plain = re.sub("[^A-Za-z0-9]+", "_", text)
    return plain if plain == text else f"{plain}_{hashlib.sha256(text.encode()).hexdigest()[:8]}"


def car_name(vehicle: str, values: Mapping[str, float | str]) -> str:
    """The name of the listing's vehicle with these parameters (mm, degrees) and parts: ``Foldcar1_width95``."""
    return "_".join([f"Foldcar{identifier(vehicle)}", *(f"{_letters(key)}{_number(values[key])}" for key in values)])


def scene_name(environment: str, sample: int) -> str:
    """The name of a sampled environment: ``env1_sample3``."""
    return f"env{identifier(environment)}_sample{sample}"


def _letters(key: str) -> str:
    return key.replace(".", "_")


def _number(value: float | str) -> str:
    if isinstance(value, str):
        return f"_{value.replace('.', 'p')}"
    return f"{value:.9g}".replace(".", "p").replace("-", "m").replace("+", "")
