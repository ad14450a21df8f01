"""Bodies, cameras, transforms, and projections of a body to a camera."""
