"""`--engine`: what moves the simulated cars."""

from typing import Annotated

import typer

from foldcar.did_you_mean import did_you_mean


def _known(engine: str) -> str:
    from foldcar.simulation.engines import ENGINES, MUJOCO, MULTIBODY

    if engine not in ENGINES:
        told = (MULTIBODY, MUJOCO)
        raise typer.BadParameter(f'"{engine}" is none of {", ".join(told)}{did_you_mean(engine, told)}')
    return engine


Engine = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        callback=_known,
        help="multibody, or mujoco: three times slower (`make mujoco` builds it).",
    ),
]
