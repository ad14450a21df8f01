"""Old module paths go on working: the same objects, a warning, and pickles that were made by them."""

import ast
import importlib
import pickle
import subprocess
import sys
import warnings
from pathlib import Path

import pytest

import voodoo
from voodoo._moved import MOVED, MOVED_ON

DOCUMENTED = {
    "voodoo.angles": ["angle_names", "joint_angles"],
    "voodoo.camera": ["Camera"],
    "voodoo.evaluate": ["compare", "evaluate"],
    "voodoo.export": ["write_bag", "write_bvh", "write_trc"],
    "voodoo.keypoints": ["LAYOUTS", "KeypointSensor", "layout_of", "nearest_person", "read_openpose_json"],
    "voodoo.markers": ["Z_UP_FROM_Y_UP", "add_markers", "body_with_markers", "marker_offset", "read_markers"],
    "voodoo.overlay": ["Overlay", "contact_sheet", "draw_body"],
    "voodoo.recordings": ["DepthImage", "LaserScan", "RecordedFrame", "Recording", "open_recording", "sample_path"],
    "voodoo.recordings.measurements": ["DepthImage", "RecordedFrame"],
    "voodoo.results": ["Track"],
    "voodoo.running": ["Init", "start_tracker", "track"],
    "voodoo.sensors.background": ["Silhouettes", "StillBackground"],
    "voodoo.sensors.camera_files": ["read_camera_toml"],
    "voodoo.sensors.depth": ["DepthFilter"],
    "voodoo.sensors.front_end": ["INPUTS", "FrontEnd", "FrontEndSettings", "paired"],
    "voodoo.sensors.skin": ["SkinSettings", "SkinTracker"],
    "voodoo.silhouettes": ["StillScene", "filled", "from_depth", "surroundings"],
    "voodoo.view": ["Viewer"],
    "voodoo.views": ["CameraView", "TopView", "limb_outline"],
    "voodoo.virtual": ["CAMERA", "VirtualFrame", "VirtualSequence"],
    "voodoo.walks": ["Stop", "Walk"],
}
"""What README, docs and examples of before the move import."""


def forget(path):
    """As if nobody had imported an old path yet."""
    sys.modules.pop(path, None)
    parent, _, name = path.rpartition(".")
    vars(sys.modules[parent]).pop(name, None)


@pytest.mark.parametrize(("old", "new"), MOVED.items())
def test_an_old_path_gives_the_same_module_and_says_where_it_is(old, new):
    importlib.import_module(old.rpartition(".")[0])
    forget(old)
    with pytest.warns(DeprecationWarning, match=rf"{old} has moved to {new}"):
        module = importlib.import_module(old)
    assert module is importlib.import_module(new) is sys.modules[old]
    assert module.__name__ == module.__spec__.name == new
    forget(old)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        parent, _, name = old.rpartition(".")
        assert getattr(importlib.import_module(parent), name, module) is module


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.parametrize(("path", "names"), DOCUMENTED.items())
def test_documented_names_are_there(path, names):
    module = importlib.import_module(path)
    assert [name for name in names if not hasattr(module, name)] == []


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.parametrize(("old", "names"), MOVED_ON.items())
def test_names_that_stand_elsewhere_are_there_by_the_old_path(old, names):
    forget(old)
    module = importlib.import_module(old)
    for name, home in names.items():
        assert getattr(module, name) is getattr(importlib.import_module(home), name)


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.parametrize(
    ("old", "value"),
    [
        ("voodoo.body", voodoo.Joint(name="elbow")),
        ("voodoo.body", voodoo.Place(position=(1.0, 2.0, 3.0))),
        ("voodoo.camera", voodoo.Camera(4, 3, 5.0, 5.0, 1.5, 1.0)),
        ("voodoo.body", voodoo.Body.human(1.7)),
        ("voodoo.config", voodoo.Config(max_steps=3)),
        ("voodoo.rendering", voodoo.RenderedDepth),
    ],
)
def test_pickles_that_name_the_old_path_can_be_read(old, value):
    kind = value if isinstance(value, type) else type(value)
    data = pickle.dumps(value, protocol=2)
    named = data.replace(f"c{kind.__module__}\n".encode(), f"c{old}\n".encode())
    assert old.encode() in named
    if old in MOVED:
        forget(old)
    again = pickle.loads(named)
    assert again == value


def test_nobody_here_uses_an_old_path():
    here = Path(__file__).resolve().parent
    folders = [Path(voodoo.__file__).parent, here, here.parent / "examples", here.parent / "benches"]
    used = set()
    for path in (path for folder in folders for path in folder.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [alias.name for alias in getattr(node, "names", ()) if isinstance(alias, ast.alias)]
            if isinstance(node, ast.ImportFrom):
                names = [str(node.module), *(f"{node.module}.{name}" for name in names)]
            used |= {(path.name, name) for name in names if name in MOVED}
    assert used == set()


def test_attributes_of_the_package_are_imported_when_they_are_asked_for():
    code = (
        "import sys, voodoo\n"
        "assert 'numpy' not in sys.modules and 'voodoo.recordings.loaders' not in sys.modules\n"
        "print(voodoo.recordings.open_recording is voodoo.open_recording, voodoo.ik.Chain.__name__)\n"
        "print(voodoo.body.Body is voodoo.Body)\n"
        "try:\n    voodoo.nothing\nexcept AttributeError as error:\n    print(error)\n"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout == "True Chain\nTrue\nmodule 'voodoo' has no attribute 'nothing'\n"
    assert set(voodoo.__all__) <= set(dir(voodoo))
