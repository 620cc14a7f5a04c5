"""Simulation: motions given as functions of time, scenarios made of them, and the records that
ideal and real sensors make of these.

trajectory.py turns a motion into truth and increments; analytic.py, motions.py and waypoints.py
build motions; scenario_model.py is what a run is made of, scenario_file.py reads it from TOML,
scenario.py finds it by name; synthesis.py makes the runs.
"""
