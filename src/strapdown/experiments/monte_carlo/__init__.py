"""Monte Carlo studies: many simulated runs of several filters in resumable campaigns, and their
summaries."""
