"""Measuring the tracker on recordings with truth or a reference; nothing of the product imports it."""
