"""`--engine`: what moves the simulated cars."""

from typing import Annotated

import typer

from foldcar.did_you_mean import did_you_mean


def _known(engine: str) -> str:
    from foldcar.simulation.engines import ENGINES, MUJOCO, SIDE_VIEW

    if engine not in ENGINES:
        told = (SIDE_VIEW, MUJOCO)
        raise typer.BadParameter(f'"{engine}" is none of {", ".join(told)}{did_you_mean(engine, told)}')
    return engine


Engine = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        callback=_known,
        help="side-view, or mujoco: three dimensions, slower (`make mujoco` builds it).",
    ),
]
