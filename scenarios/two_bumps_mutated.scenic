"""The two speed bumps with normal noise on all positions and headings."""

model model

from two_bumps import near_bump, far_bump, goal, ego

mutate near_bump, far_bump, goal, ego by 0.01
