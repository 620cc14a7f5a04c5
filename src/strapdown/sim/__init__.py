"""Simulation: motions as functions of time, scenarios, and the records of ideal and real sensors.

trajectory.py computes truth and increments of a motion; analytic.py, motions.py and waypoints.py
build motions; scenario_model.py defines a scenario, scenario_file.py reads it from TOML,
scenario.py finds it by name; synthesis.py makes the runs.
"""
