"""Rendered depth images of a body."""
