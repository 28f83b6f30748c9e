"""A smooth path through poses of single pictures: a Rauch-Tung-Striebel smoother.

Each of the six values has a rate that changes by white noise of the density q (unit² / s³): over a step dt

    F = [[1, dt], [0, 1]],   Q = q [[dt³/3, dt²/2], [dt²/2, dt]].

A pose that is farther from where the path was going than GATE standard deviations is left out: a reflection, a wrong
reading. If that goes on for LOST_S, the car did go there.
"""

import numpy

from foldcar.camera.detection import Floats

# Of x, y, z (m²/s³) and heading, pitch, roll (rad²/s³): a wheel against an edge stops or lifts a car within 0.1 s.
DENSITY = numpy.array([2.0, 2.0, 1.0, 30.0, 30.0, 30.0])
GATE = 36.0
LOST_S = 0.15
FIRST_RATE = numpy.array([0.5, 0.5, 0.2, 2.0, 2.0, 2.0])


def smooth(times_s: Floats, poses: Floats, covariances: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Poses (n, 6), their rates (n, 6) and covariances (n, 6, 6), and which were used (n).

    Headings go on beyond half turns. Times ascend.
    """
    poses = poses.copy()
    poses[:, 3:] = numpy.unwrap(poses[:, 3:], axis=0)
    n = len(times_s)
    states, spreads = numpy.zeros((n, 12)), numpy.zeros((n, 12, 12))
    before, before_spreads = numpy.zeros((n, 12)), numpy.zeros((n, 12, 12))
    moves = numpy.zeros((n, 12, 12))
    used = numpy.zeros(n, dtype=bool)
    state = numpy.concatenate([poses[0], numpy.zeros(6)])
    spread = numpy.zeros((12, 12))
    spread[:6, :6], spread[6:, 6:] = covariances[0] + 1e-12 * numpy.eye(6), numpy.diag(FIRST_RATE**2)
    last_used_s = times_s[0]
    for k in range(n):
        dt = times_s[k] - times_s[k - 1] if k else 0.0
        move, noise = numpy.eye(12), numpy.zeros((12, 12))
        move[:6, 6:] = dt * numpy.eye(6)
        noise[:6, :6], noise[6:, 6:] = numpy.diag(DENSITY * dt**3 / 3), numpy.diag(DENSITY * dt)
        noise[:6, 6:] = noise[6:, :6] = numpy.diag(DENSITY * dt**2 / 2)
        state, spread = move @ state, move @ spread @ move.T + noise
        before[k], before_spreads[k], moves[k] = state, spread, move
        innovation = poses[k] - state[:6]
        innovation[3:] = [numpy.remainder(a + numpy.pi, 2 * numpy.pi) - numpy.pi for a in innovation[3:]]
        weight = numpy.linalg.inv(spread[:6, :6] + covariances[k])
        if k == 0 or innovation @ weight @ innovation <= GATE or times_s[k] - last_used_s > LOST_S:
            gain = spread[:, :6] @ weight if k else numpy.zeros((12, 6))
            state = state + gain @ innovation
            spread = spread - gain @ spread[:6]
            spread = (spread + spread.T) / 2
            used[k], last_used_s = True, times_s[k]
        states[k], spreads[k] = state, spread
    for k in range(n - 2, -1, -1):
        gain = spreads[k] @ moves[k + 1].T @ numpy.linalg.pinv(before_spreads[k + 1], hermitian=True)
        states[k] += gain @ (states[k + 1] - before[k + 1])
        spreads[k] += gain @ (spreads[k + 1] - before_spreads[k + 1]) @ gain.T
    return states[:, :6], states[:, 6:], spreads[:, :6, :6], used
