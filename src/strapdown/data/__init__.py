"""Values that all rooms share: trajectories, sources, solutions, recordings, verdicts."""
