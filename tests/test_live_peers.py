"""Real peers, each from the package index: rclpy, Cyclone DDS, the RealSense library, Rerun, OpenSim.

They are installed once, into environments of their own beside pytest's cache.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

PEERS = Path(__file__).resolve().parent / "peers"
ROS = (
    "numpy",
    "ros-jazzy-rclpy",
    "ros-jazzy-rmw-fastrtps-cpp",
    "ros-jazzy-sensor-msgs",
    "ros-jazzy-visualization-msgs",
)
OURS = ("cyclonedds>=11", "pyrealsense2>=2.55", "rerun-sdk>=0.24", "websocket-client")
INSTALL_S, CHECK_S = 900, 600

pytestmark = pytest.mark.long


def environment(cache, name, packages):
    """A Python with some packages; skips where they cannot be had."""
    folder = Path(cache.mkdir(f"voodoo-{name}"))
    python, done = folder / "bin" / "python", folder / "complete"
    if not done.exists():
        shutil.rmtree(folder, ignore_errors=True)
        subprocess.run([sys.executable, "-m", "venv", folder], check=True, timeout=INSTALL_S)
        found = subprocess.run(
            [python, "-m", "pip", "install", "--quiet", *packages], capture_output=True, text=True, timeout=INSTALL_S
        )
        if found.returncode:
            pytest.skip(f"{', '.join(packages)} cannot be installed here: {found.stderr[-300:]}")
        done.touch()
    return python


def check(python, name, **variables):
    paths = [str(PEERS), *(path for path in sys.path if path)]
    settings = {**os.environ, **variables, "PYTHONPATH": os.pathsep.join(paths)}
    command = [python, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", str(PEERS / name)]
    done = subprocess.run([*command, "-rs"], env=settings, capture_output=True, text=True, timeout=CHECK_S, cwd=PEERS)
    if done.returncode == pytest.ExitCode.NO_TESTS_COLLECTED:
        pytest.skip(done.stdout[-300:])
    assert done.returncode == 0, done.stdout[-6000:] + done.stderr[-2000:]


@pytest.fixture(scope="module")
def ours(request):
    return environment(
        request.config.cache, "live", ("cyclonedds>=11", "pyrealsense2>=2.55", "rerun-sdk>=0.24", "websocket-client")
    )


@pytest.fixture(scope="module")
def ros(request):
    return environment(request.config.cache, "ros", ROS)


def test_ros_2(ours, ros):
    check(ours, "check_ros2.py", VOODOO_PEER=str(ros))


def test_realsense(ours):
    check(ours, "check_realsense.py")


def test_oak_and_orbbec(request):
    # Without what pyorbbecsdk2 requires for its examples, which has no wheels for every Python.
    packages = ("--no-deps", "depthai>=3.12", "pyorbbecsdk2>=2.1")
    check(environment(request.config.cache, "cameras", packages), "check_cameras.py")


def test_view(ours):
    check(ours, "check_view.py")


def test_opensim(request):
    check(environment(request.config.cache, "opensim", ("opensim>=4.5",)), "check_opensim.py")
