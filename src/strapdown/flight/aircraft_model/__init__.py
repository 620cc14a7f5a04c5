"""A fixed-wing aircraft as a rigid body: parameters, forces, motion, wind, trim and modes.

parameters.py holds the aircraft, forces.py what the air and the propeller do to it, dynamics.py how
it moves, wind.py the gusts it meets; trim.py finds steady flight and modes.py what small deviations
from it do. Body axes are forward-right-down; surfaces in rad, throttle 0 to 1.
"""
