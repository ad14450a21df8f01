"""Evaluation of the tracker on recordings with ground truth or a reference. The rest of the package does not import it."""
