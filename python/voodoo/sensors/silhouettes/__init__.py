"""Masks of the person in depth and color pictures, for voodoo.ik."""
