"""Recordings: the measurements of sensors as frames with stamps, calibrations and poses in one root frame."""

from voodoo.lazily import lazily

# Imported on first use, so that the command line lists the loaders without NumPy.
__all__, __getattr__, __dir__ = lazily(__name__)
