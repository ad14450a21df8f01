"""Kinds of live sources, one a file."""
