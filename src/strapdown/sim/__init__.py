"""Simulation: motions given as functions of time, scenarios made of them, and the records that
ideal and real sensors make of these.

trajectory.py turns a motion into truth and increments; analytic.py, motions.py and waypoints.py
build motions; scenario.py is what a run is made of, scenario_file.py reads it from TOML;
synthesis.py makes the runs. aircraft/ is an aircraft that obeys its controls; autopilot.py steers
it along a route, and flight.py flies it on the estimates of a filter, by the kernel of
flight_loop.py.
"""
