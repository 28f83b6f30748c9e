"""Trials of built cars: where things stand, how a trial is driven and told, what it is compared with."""
