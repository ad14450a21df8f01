"""Skin color as a cue for head and hands (K06 III-A)."""
