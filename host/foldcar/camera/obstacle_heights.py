"""How high the obstacles of a film really are, by the car that drives over them.

Input: poses of the car in pictures, the ground as it was planned. Output: the ground with a factor for each obstacle's
height, and its standard deviation. Of each pose the corners alone tell height, pitch and roll, m, with covariance C; the
ground g(s) tells the same with covariance R. Sought are the factors s and an offset b that all pictures share (a marker
that is glued on askew, a camera that is off), most probable given

    m = g(s) + b + noise,   covariance C + R.

Errors of neighbouring pictures are alike: each counts as ALIKE of one. A car that hangs on its belly stands higher than
its wheels say: the factor takes that up, so that the path is right, but it is not the obstacle's then.
"""

from collections.abc import Sequence

import numpy

from foldcar.camera.ground import HEIGHT_ALIKE, HEIGHT_OWN, Standing
from foldcar.camera.poses import GROUND, Pose

# Standard deviations of the offset: height (m), pitch and roll (rad).
OFFSET = numpy.array([0.01, 0.03, 0.03])
STEP = 0.02
# Pictures that are farther off (χ² of three) count less: a car that tips, or is in the air.
FAR = 12.0
ALIKE, LEAST_ERROR = 0.4, 0.03
FACTORS = (0.3, 3.0)
# A factor that is known better than TOLD, and farther from 1 than it and than twice its error, is told.
TOLD = 0.1


def fit_heights(poses: Sequence[Pose], ground: Standing, pixel: float) -> Standing:
    """The ground with the obstacles' heights by these poses, whose corners are known to ``pixel``."""
    count = len(ground.factors) - 1
    none = numpy.zeros(count + 1)
    planned = ground.rescaled(none + 1, none)
    raised = [planned.rescaled(1 + STEP * (numpy.arange(count + 1) == k), none) for k in range(count + 1)]
    normal, wanted = numpy.zeros((count + 3, count + 3)), numpy.zeros(count + 3)
    normal[:count, :count] = numpy.linalg.inv(HEIGHT_OWN**2 * numpy.eye(count) + HEIGHT_ALIKE**2)
    normal[count:, count:] = numpy.diag(OFFSET**-2)
    for pose in poses:
        place = pose.values[[0, 1, 3]]
        stance = planned.at(*place)
        values, spread = pose.by_corners(pixel)
        off = values[GROUND] - stance.values
        design = numpy.zeros((3, count + 3))
        design[:, count:] = numpy.eye(3)
        middle = planned.planes(*place)[0].mean(axis=0)
        for k in planned.under(*place):
            design[:, k - 1] = (raised[k].planes(*place)[0].mean(axis=0) - middle) / STEP
        weight = numpy.linalg.inv(spread[numpy.ix_(GROUND, GROUND)] + stance.covariance)
        weight *= ALIKE / max(1.0, float(off @ weight @ off) / FAR)
        normal += design.T @ weight @ design
        wanted += design.T @ weight @ off
    covariance = numpy.linalg.inv(normal)
    factors, errors = none + 1, none.copy()
    factors[1:] = (1 + (covariance @ wanted)[:count]).clip(*FACTORS)
    errors[1:] = numpy.hypot(LEAST_ERROR, numpy.sqrt(numpy.diag(covariance)[:count]))
    return ground.rescaled(factors, errors)


def height_remarks(ground: Standing) -> list[str]:
    """A remark on each obstacle that seems not to be as high as planned."""
    remarks = []
    for k, (factor, error) in enumerate(zip(ground.factors, ground.factor_errors, strict=True)):
        if error < TOLD and abs(factor - 1) > max(TOLD, 2 * error):
            x_mm, y_mm = (1000 * at for at in ground.middle(k))
            remarks.append(
                f"the car rode as if the obstacle at {x_mm:.0f}, {y_mm:.0f} mm were {factor:.2f} ± {error:.2f} times as "
                "high as planned: measure it, unless the car hung on its belly"
            )
    return remarks
