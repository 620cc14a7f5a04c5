"""From arrays as files have them to samples and fixes: units, axes, order, gaps, what is
possible, when the vehicle stood still."""
