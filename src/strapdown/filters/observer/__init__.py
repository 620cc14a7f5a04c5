"""The nonlinear observer of Grip et al., and the eXogenous Kalman filter about it."""
