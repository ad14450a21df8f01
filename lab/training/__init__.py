"""Makes the data of the person detector, trains it, exports its weights and measures it."""
