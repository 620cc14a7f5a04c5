"""Checks of the parts of a recording against each other, before any filter runs.

all.py runs every check; checked.py is what a check gives; motion.py has the motion as fixes tell it
and as the IMU feels it, which the others compare.
"""
