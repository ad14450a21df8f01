"""Synthetic depth images of the body, with exact truth."""
