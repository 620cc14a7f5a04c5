"""Tables of files: text, MATLAB and Parquet, and what is written by the calendar in them."""
