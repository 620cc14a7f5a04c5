"""Display of recordings, solutions and results in a notebook, and their conversion for pandas,
xarray and plotly."""
