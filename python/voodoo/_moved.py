"""Old module paths: each still gives the module that took its place, with a DeprecationWarning.

It is the same module object, so that classes are the same, and what was pickled by an old path can be read.
"""

from __future__ import annotations

import importlib
import sys
import warnings
from collections.abc import Sequence
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.util import spec_from_loader
from types import ModuleType

MOVED = {
    "voodoo.ablate": "voodoo.evaluation.ablation",
    "voodoo.angles": "voodoo.ik.angles",
    "voodoo.body": "voodoo.model.body",
    "voodoo.camera": "voodoo.model.camera",
    "voodoo.evaluate": "voodoo.evaluation.evaluate",
    "voodoo.ik_recording": "voodoo.pipeline.ik",
    "voodoo.inputs": "voodoo.pipeline.inputs",
    "voodoo.keypoint_layouts": "voodoo.recordings.keypoint_layouts",
    "voodoo.keypoints": "voodoo.sensors.keypoints",
    "voodoo.markers": "voodoo.sensors.markers",
    "voodoo.metrics": "voodoo.evaluation.metrics",
    "voodoo.overlay": "voodoo.visualization.overlay",
    "voodoo.overlay_inputs": "voodoo.visualization.canvas",
    "voodoo.picture_writer": "voodoo.visualization.image_writer",
    "voodoo.poses": "voodoo.model.transforms",
    "voodoo.recordings.measurements": "voodoo.measurements",
    "voodoo.rendering": "voodoo.synthetic.render",
    "voodoo.report": "voodoo.evaluation.report",
    "voodoo.results": "voodoo.export.track",
    "voodoo.running": "voodoo.pipeline.run",
    "voodoo.sensors.background": "voodoo.sensors.silhouettes.color",
    "voodoo.sensors.camera_files": "voodoo.recordings.camera_files",
    "voodoo.sensors.front_end": "voodoo.pipeline.front_end",
    "voodoo.sensors.skin_regions": "voodoo.sensors.skin.regions",
    "voodoo.silhouettes": "voodoo.sensors.silhouettes",
    "voodoo.toml_text": "voodoo.model.toml_io",
    "voodoo.view": "voodoo.visualization.rerun_viewer",
    "voodoo.views": "voodoo.model.projection",
    "voodoo.virtual": "voodoo.synthetic.sequence",
    "voodoo.walks": "voodoo.synthetic.room_walk",
    "voodoo.witness": "voodoo.evaluation.depth_agreement",
}
"""Old path -> new path."""
MOVED_ON = {
    "voodoo.evaluate": {"find_recordings": "voodoo.evaluation.search"},
    "voodoo.overlay": {"side_color": "voodoo.visualization.ink"},
    "voodoo.report": {"Summary": "voodoo.evaluation.summary"},
    "voodoo.virtual": {
        "Disturbance": "voodoo.synthetic.disturbance",
        "disturbed": "voodoo.synthetic.disturbance",
        "disturbed_image": "voodoo.synthetic.disturbance",
        "grown": "voodoo.synthetic.grown",
    },
}
"""Old path -> names of it that stand in another module than its new path."""


class _MovedFinder(MetaPathFinder):
    """Finds modules by their old paths; asked last, so that it costs nothing for any other."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """The module of the new path."""
        new = MOVED.get(fullname)
        return None if new is None else spec_from_loader(fullname, _MovedLoader(new))


class _MovedLoader(Loader):
    def __init__(self, new: str) -> None:
        self._new = new
        self._spec: ModuleSpec | None = None

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        """The very module of the new path."""
        warnings.warn(f"{spec.name} has moved to {self._new}", DeprecationWarning, stacklevel=2)
        module = importlib.import_module(self._new)
        for name, home in MOVED_ON.get(spec.name, {}).items():
            setattr(module, name, getattr(importlib.import_module(home), name))
        self._spec = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        """Nothing to run; the import system gave the module the old path's spec, which is taken back."""
        module.__spec__ = self._spec


def install() -> None:
    """Make old paths importable; once is enough."""
    if not any(isinstance(finder, _MovedFinder) for finder in sys.meta_path):
        sys.meta_path.append(_MovedFinder())
