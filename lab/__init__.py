"""Experiments, their record, training, comparisons with peers, and the figures; the product does not import it."""
