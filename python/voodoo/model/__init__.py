"""What is tracked and looked at: bodies, cameras, transforms, and how a body looks from a camera."""
