"""A thousand recordings: each a task of its own, by Dask; results as one Parquet data set and a table of summaries."""
