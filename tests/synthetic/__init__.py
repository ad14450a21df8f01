"""Rendered persons and recordings with exact truth, for tests, benchmarks and experiments."""
