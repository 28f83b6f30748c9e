"""The two speed bumps with every place and heading a little disturbed."""

model model

from two_bumps import near_bump, far_bump, goal, ego

mutate near_bump, far_bump, goal, ego by 0.01
