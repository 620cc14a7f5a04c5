"""Tables of files: text, MATLAB and Parquet, and calendar times in them."""
