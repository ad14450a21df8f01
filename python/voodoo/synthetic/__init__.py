"""Synthetic images and recordings of the body with exact ground truth."""
