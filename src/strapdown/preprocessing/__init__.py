"""Samples and fixes from the arrays of files: units, axes, order, gaps, checks of possible values,
and standstills of the vehicle."""
