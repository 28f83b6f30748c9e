"""A success rate that is given, not learned: the log-odds are a plane over scores and one design parameter."""

import numpy

from foldcar.belief.learning import Learned
from foldcar.belief.priors import NAMES

DESIGNS = numpy.array([[0.0], [25.0], [50.0], [75.0], [100.0]])


def hand_learned(level: float = 0.0, slope: float = 0.0, **scores: float | tuple[float, float]) -> Learned:
    """Return log-odds level + slope u + sum of score times factor, where u is -1 at the first design and 1 at the last.

    A factor (a, b) stands for a + b u.
    """
    parameters = len(NAMES)
    quadratics = parameters * (parameters + 1) // 2
    # g(x) has the constant, u, u²/2 and one bump.
    products = numpy.zeros((1 + parameters, 4))
    products[0, :2] = level, slope
    for name, factor in scores.items():
        a, b = factor if isinstance(factor, tuple) else (factor, 0.0)
        products[1 + NAMES.index(name), :2] = a, b
    coefficients = numpy.concatenate([numpy.zeros(quadratics), products.ravel()])
    return Learned(DESIGNS.min(axis=0), numpy.array([100.0]), numpy.array([[0.5]]), 1.0, coefficients)
