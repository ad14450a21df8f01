"""Tracks many recordings, one Dask task each; results are a Parquet data set and a table of summaries."""
