"""Pictures, films and Rerun: what the tracker sees and finds."""
