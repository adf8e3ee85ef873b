"""Campaigns of many flights: the file, Dask, the journal, and what is kept of each flight."""
