"""From what sensors deliver to the measurements of a Frame."""
