"""Lens models of tests and experiments: model and coefficients by name."""

AZURE = (
    0.5479397774,
    -0.0209713709,
    2.0557534e-5,
    -7.2104158e-5,
    -0.0026522316,
    0.8896790743,
    0.0861302093,
    -0.0139103848,
)
"""The depth camera of an Azure Kinect."""
LENSES = {
    "none": ("plumb_bob", ()),
    "plumb_bob": ("plumb_bob", (-0.24, 0.06, 0.0008, -0.0006, -0.006)),
    "four": ("plumb_bob", (-0.24, 0.06, 0.0008, -0.0006)),
    "pincushion": ("plumb_bob", (0.12, -0.03, 0.001, 0.002, 0.004)),
    "azure": ("rational_polynomial", AZURE),
    "prism": ("rational_polynomial", (*AZURE, 0.002, -0.001, 0.0015, 0.0005)),
    "tilted": ("rational_polynomial", (*AZURE, 0.002, -0.001, 0.0015, 0.0005, 0.03, -0.02)),
    "fisheye": ("equidistant", (0.02, -0.01, 0.003, -0.001)),
    "equidistant": ("equidistant", ()),
}
