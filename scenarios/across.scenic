"""One obstacle, or a row of them, across the whole course: the same ground under both tracks, met straight on."""

model model

param kind = "bumps"    # bumps, round_bumps, kerb, steps, pyramids, ramp, bars or hills
param friction = Range(0.5, 0.9)
param course_y_min = -0.8
param course_y_max = 0.8

def ahead(x):
    return (x, 0)

kind = globalParameters.kind
if kind == "bumps":
    height = Range(0.006, 0.03)
    near = new Bump at ahead(Range(0.3, 0.4)), facing -90 deg, with height height
    last = new Bump ahead of near by Range(0.3, 0.4), with height height
elif kind == "round_bumps":
    height = Range(0.008, 0.05)
    near = new RoundBump at ahead(Range(0.3, 0.4)), facing -90 deg, with length Range(0.1, 0.16), with height height
    last = new RoundBump ahead of near by Range(0.3, 0.4), with length Range(0.1, 0.16), with height height
elif kind == "kerb":
    last = new Kerb at ahead(0.44), facing -90 deg,
        with length 0.5, with height Range(0.005, 0.045), with face Range(0.002, 0.02)
elif kind == "steps":
    last = new Step at ahead(0.5), facing -90 deg, with height Range(0.006, 0.045)
    upper = new Step at ahead(0.55), facing -90 deg,
        with length Range(0.1, 0.2), with height last.height + Range(0.003, 0.02)
elif kind == "pyramids":
    rise = Range(0.008, 0.032)
    near = new StepPyramid at ahead(Range(0.42, 0.48)), facing -90 deg,
        with step_height rise, with top_side Range(0.07, 0.11), with tread Range(0.03, 0.05)
    last = new StepPyramid at ahead(near.position.x + 0.45), facing -90 deg,
        with step_height rise, with top_side Range(0.07, 0.11), with tread Range(0.03, 0.05)
elif kind == "ramp":
    last = new Ramp at ahead(0.7), facing -90 deg, with width 1.2, with height Range(0.02, 0.12),
        with run_up Range(0.06, 0.3), with plateau Range(0.01, 0.15), with run_down Range(0.06, 0.3)
elif kind == "bars":
    for k in range(20):
        last = new Bump at ahead(0.25 + 0.04 * k + Range(-0.015, 0.015)), facing -90 deg,
            with length Range(0.01, 0.04), with height Range(0.002, 0.024), with allowCollisions True
elif kind == "hills":
    for k in range(8):
        last = new GaussianHill at ahead(0.35 + 0.1 * k + Range(-0.04, 0.04)), facing -90 deg,
            with sd_along Range(0.025, 0.08), with sd_across 20, with height Range(-0.04, 0.06)
else:
    raise ValueError(f"kind: no obstacle {kind}")

ego = new Robot at (0, 0), facing -90 deg
goal = new Goal at ahead(last.position.x + 0.45), facing -90 deg
