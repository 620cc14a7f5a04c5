"""What recordings, solutions and results show of themselves in a notebook, and hand to pandas, xarray
and plotly."""
