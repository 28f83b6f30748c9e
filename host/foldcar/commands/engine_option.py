"""`--engine`: what moves the simulated cars."""

from typing import Annotated

import typer

from foldcar.did_you_mean import did_you_mean


def _known(engine: str) -> str:
    from foldcar.simulation.engines import ENGINES, TOLD

    if engine not in ENGINES:
        raise typer.BadParameter(f'"{engine}" is none of {", ".join(TOLD)}{did_you_mean(engine, TOLD)}')
    return engine


Engine = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        callback=_known,
        help="side-view (Box2D: quick, the same ground under both tracks), multibody (six degrees of freedom), or mujoco "
        "(slow, `make mujoco` builds it).",
    ),
]
