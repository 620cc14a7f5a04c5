"""Checks of the parts of a recording against each other, before any filter runs.

all.py runs every check; finding.py has the result of a check; motion.py has the motion by the fixes
and by the IMU, which the others compare.
"""
