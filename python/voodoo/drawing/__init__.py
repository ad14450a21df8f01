"""What measurements are drawn into: the pictures of an overlay, and Rerun."""
