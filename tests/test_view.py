"""The Rerun file, verified by Rerun's own command line, and the geometry that is shown."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import voodoo
from made_up import two_people
from voodoo.drawing.surfaces import bands, nearest_limb, rounded_millimeters
from voodoo.errors import VoodooError
from voodoo.model.projection import limb_mesh
from voodoo.people import PeopleEstimate
from voodoo.pipeline.front_end import FrontEnd, nobody
from voodoo.pipeline.pairing import paired
from voodoo.pipeline.run import track
from voodoo.recordings import open_recording, sample_path
from voodoo.sensors.settings import FrontEndSettings
from voodoo.visualization import rerun_viewer as view
from voodoo.visualization.rerun_viewer import Viewer


@pytest.fixture
def steps():
    recording = open_recording(sample_path())
    tracker = voodoo.Tracker(voodoo.Body.human(height=recording.start["height_m"]))
    tracker.reset(joints=recording.start["joints"], fit_sizes=True)
    front_end = FrontEnd(tracker, settings=FrontEndSettings(ground_z=0.0))
    return tracker, front_end, [recorded for recorded, _ in zip(paired(recording), range(4), strict=False)]


@pytest.mark.parametrize("most", [40_000, 5_000])
def test_file_holds_everything(tmp_path, steps, monkeypatch, most):
    """Also the silhouette of images with more pixels than are shown as points."""
    monkeypatch.setattr(view, "_MOST_POINTS", most)
    pytest.importorskip("rerun", reason="Rerun is not installed")
    tracker, front_end, frames = steps
    path = tmp_path / "track.rrd"
    with Viewer(save=path) as viewer:
        for recorded in frames:
            estimate = front_end.step(recorded)
            viewer.log(estimate, tracker.body, recorded=recorded, front_end=front_end, seconds=0.01)
    command = Path(sys.executable).with_name("rerun")
    verified = subprocess.run([command, "rrd", "verify", path], capture_output=True, text=True, check=False)
    assert verified.returncode == 0, verified.stderr
    displayed = subprocess.run([command, "rrd", "print", path], capture_output=True, text=True, check=True).stdout
    for entity in (
        "/world/body/limbs/l_forearm", "/world/body/joints", "/world/body/bands", "/world/rays", "/world/laser/scan",
        "/world/points/camera_depth_image_rect_raw", "/world/cameras/camera_color_image_raw_compressed/picture",
        "/world/cameras/camera_color_image_raw_compressed/picture/model",
        "/world/cameras/camera_depth_image_rect_raw/picture/silhouette",
        "/plots/residual_mm", "/plots/steps", "/plots/step_ms", "/plots/sources/scan/matched",
    ):  # fmt: skip
        assert entity in displayed, entity


def test_a_file_takes_less_than_fifty_kilobytes_a_frame(tmp_path):
    """Depth is rounded below its noise, pictures are compressed, of meshes what changed is sent, and chunks are large."""
    pytest.importorskip("rerun", reason="Rerun is not installed")
    recording = open_recording(sample_path())
    tracker = voodoo.Tracker(voodoo.Body.human(height=recording.start["height_m"]))
    tracker.reset(joints=recording.start["joints"], fit_sizes=True)
    front_end = FrontEnd(tracker)
    (tmp_path / "track.rrd").write_text("old")
    with pytest.raises(KeyboardInterrupt), Viewer(save=tmp_path / "track.rrd"):
        raise KeyboardInterrupt
    assert (tmp_path / "track.rrd").read_text() == "old"
    with Viewer(save=tmp_path / "track.rrd") as viewer:
        for recorded, _ in zip(paired(recording), range(45), strict=False):
            viewer.log(front_end.step(recorded), tracker.body, recorded=recorded, front_end=front_end)
    assert (tmp_path / "track.rrd").stat().st_size < 45 * 50_000


@pytest.mark.parametrize(("unit", "kind"), [(0.001, np.uint16), (0.00025, np.uint16), (1.0, np.float32)])
def test_depth_is_rounded_by_a_quarter_of_a_percent_and_holes_stay(unit, kind):
    meters = np.random.default_rng(3).uniform(0.1, 12.0, (40, 50))
    meters[:4] = 0.0
    image = (meters / unit).astype(kind)
    if kind == np.float32:
        image[1], image[2] = np.nan, -1.0
    rounded = rounded_millimeters(image, unit)
    assert (rounded[:4] == 0).all() and rounded.dtype == np.uint16
    measured = 1000.0 * unit * image[4:].astype(np.float64)
    assert (np.abs(rounded[4:] - measured) <= 0.0026 * measured + 0.5).all()


def test_ellipsoids_are_the_covariances_that_are_known(tmp_path, steps):
    pytest.importorskip("rerun", reason="Rerun is not installed")
    tracker, front_end, frames = steps
    estimate = front_end.step(frames[0])
    drawn = {}
    with Viewer(save=tmp_path / "x.rrd") as viewer:
        log = viewer._stream.log
        viewer._stream.log = lambda path, item, **how: (drawn.setdefault(path, item), log(path, item, **how))
        viewer.log(estimate, tracker.body)
    displayed = drawn["world/body/uncertainty"]
    sizes, turns, centers = (
        np.array(part.as_arrow_array().to_pylist())
        for part in (displayed.half_sizes, displayed.quaternions, displayed.centers)
    )
    axes = Rotation.from_quat(turns).as_matrix()
    found = np.einsum("nij,nj,nkj->nik", axes, sizes**2, axes)
    np.testing.assert_allclose(found, estimate.joint_covariances, atol=1e-8)
    np.testing.assert_allclose(centers, estimate.joint_positions, atol=1e-5)


def test_a_body_that_is_gone_is_cleared_and_sent_again(tmp_path, steps):
    pytest.importorskip("rerun", reason="Rerun is not installed")
    tracker, front_end, frames = steps
    path = tmp_path / "track.rrd"
    with Viewer(save=path) as viewer:
        for index, recorded in enumerate(frames[:3]):
            estimate = front_end.step(recorded)
            gone = index == 1
            viewer.log(
                nobody(recorded.stamp) if gone else estimate, tracker.body, front_end=None if gone else front_end
            )
    command = Path(sys.executable).with_name("rerun")
    displayed = subprocess.run([command, "rrd", "print", path], capture_output=True, text=True, check=True).stdout
    rows = re.findall(r"with (\d+) rows .* - (/world/body\S*) - .*\[(\S+?)[\] ]", displayed)
    counts = {(entity, column): int(count) for count, entity, column in rows}
    assert counts["/world/body", "Clear:is_recursive"] == 1
    assert counts["/world/body/limbs/l_forearm", "Mesh3D:albedo_factor"] == 2


def test_everybody_has_a_body_of_their_own_and_is_cleared_when_they_go(tmp_path):
    pytest.importorskip("rerun", reason="Rerun is not installed")
    people, bodies, steps = voodoo.People(), {}, []
    for step in track(two_people(), people):
        bodies |= {person.id: people.body(person.id) for person in step.estimate}
        steps.append(step)
    path = tmp_path / "people.rrd"
    with Viewer(save=path) as viewer:
        for step in steps[-2:]:
            viewer.log(step.estimate, bodies, recorded=step.recorded, seconds=step.seconds)
        viewer.log(PeopleEstimate(9.0, ()), bodies)
    command = Path(sys.executable).with_name("rerun")
    displayed = subprocess.run([command, "rrd", "print", path], capture_output=True, text=True, check=True).stdout
    rows = re.findall(r"with (\d+) rows .* - (/world/people\S*) - .*\[(\S+?)[\] ]", displayed)
    counts = {(entity, column): int(count) for count, entity, column in rows}
    for one in (1, 2):
        assert counts[f"/world/people/{one}", "Clear:is_recursive"] == 1
        assert f"/world/people/{one}/limbs/l_forearm" in displayed
        assert f"/world/people/{one}/number" in displayed
    for entity in ("/world/cameras/camera_depth/picture", "/plots/people", "/plots/status/1"):
        assert entity in displayed, entity


def test_without_rerun_the_message_reports_what_to_install(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(VoodooError, match=r"pip install 'voodoo-tracker\[view\]'"):
        Viewer(save=tmp_path / "x.rrd")


@pytest.mark.parametrize("display", ["", ":9"])
def test_a_viewer_that_cannot_open_reports_so(monkeypatch, display):
    rerun = pytest.importorskip("rerun")

    def fail(self, *args, **kwargs):
        raise RuntimeError("no viewer\nlong story")

    monkeypatch.setattr(rerun.RecordingStream, "spawn", fail)
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.setenv("DISPLAY", display)
    monkeypatch.setenv("WAYLAND_DISPLAY", "")
    with pytest.raises(VoodooError, match="no viewer" if display else "screen") as caught:
        Viewer()
    assert "--save" in str(caught.value) and "long story" not in str(caught.value)


def test_wrong_suffix(tmp_path):
    pytest.importorskip("rerun")
    with pytest.raises(VoodooError, match=r"\.rrd"):
        Viewer(save=tmp_path / "x.mp4")


def test_limb_mesh_is_closed_and_faces_outwards():
    shape = voodoo.TaperedEllipticCylinder(0.4, 0.1, 0.08, 0.05, 0.06)
    vertices, triangles, normals = limb_mesh(shape)
    corners = vertices[triangles].astype(float)
    # The divergence theorem gives the volume of a closed surface that looks outwards.
    volume = np.einsum("ni,ni->n", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6.0
    t = np.linspace(0, 1, 1001)
    exact = np.pi * 0.4 * np.mean((0.1 - 0.05 * t) * (0.08 - 0.02 * t))
    assert volume == pytest.approx(exact, rel=0.02)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-5)
    distances = shape.closest_points(vertices.astype(np.float64)).signed_distance
    assert np.abs(distances[: 4 * 24]).max() < 1e-4


def test_points_are_colored_by_their_limb(steps):
    tracker, _, _ = steps
    estimate, body = tracker.estimate, tracker.body
    middle = (estimate.joints["l_knee"] + estimate.joints["l_ankle"]) / 2
    found = nearest_limb(middle + np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 5.0]]), estimate, body)
    assert body.limb_names[found[0]] == "l_calf"
    assert found[1] == len(body.limbs)
    assert len(bands(estimate, body)) == len(body.limbs) - 1
