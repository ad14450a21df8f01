import sys
from pathlib import Path

import av
import cv2
import numpy as np
import pytest

from core_fakes import BASE_FROM_CAMERA, CAMERA, T_POSE, FakeRecording, depth_of, pose, scan_at, searching
from voodoo.errors import VoodooError
from voodoo.model.projection import CameraView, TopView, limb_silhouette
from voodoo.recordings import ColorImage, RecordedFrame
from voodoo.visualization import image_writer as film_module
from voodoo.visualization.body_drawing import side_color
from voodoo.visualization.image_writer import PictureWriter
from voodoo.visualization.overlay import Overlay, in_rows

STILL = RecordedFrame(0.0, (depth_of(T_POSE),))


def draw(recorded=STILL, joints=T_POSE):
    class Pictured(FakeRecording):
        def __iter__(self):
            yield recorded

    return Overlay(Pictured()).draw(recorded, *pose(joints), index=0)


def scale_of(picture):
    return picture.shape[0] // CAMERA.height


def distance_to(color, pixel):
    return float(np.abs(pixel.astype(float) - color).sum())


def test_limbs_are_drawn_where_they_project_in_their_colors():
    picture = draw()
    scale = scale_of(picture)
    for side in "lr":
        middle = np.mean([T_POSE[f"{side}_knee"], T_POSE[f"{side}_hip"]], axis=0)
        pixels, _ = CameraView(CAMERA, BASE_FROM_CAMERA, scale).project(middle[None])
        column, row = pixels[0].round().astype(int)
        colors = {name: distance_to(side_color(name), picture[row, column]) for name in ("l_thigh", "r_thigh")}
        assert min(colors, key=colors.get) == f"{side}_thigh"


def test_the_persons_left_is_on_the_right_of_the_picture():
    pixels, _ = CameraView(CAMERA, BASE_FROM_CAMERA).project(np.array([T_POSE["l_wrist"], T_POSE["r_wrist"]]))
    assert pixels[0, 0] > pixels[1, 0]


def test_nothing_is_drawn_far_from_body_and_caption():
    picture = draw()
    bare = draw(joints={name: np.add(position, (-10.0, 0.0, 0.0)) for name, position in T_POSE.items()})
    corner = (slice(-60, None), slice(-60, None))
    assert np.array_equal(picture[corner], bare[corner])
    assert not np.array_equal(picture, bare)


def test_a_body_behind_the_camera_has_no_contour():
    body, estimate = pose({name: np.add(position, (-3.0, 0.0, 0.0)) for name, position in T_POSE.items()})
    torso = next(limb for limb in body.limbs if limb.name == "torso")
    assert limb_silhouette(torso.shape, estimate.world_from_limb["torso"], CameraView(CAMERA, BASE_FROM_CAMERA)) is None


def test_enlarging_keeps_pixel_centers():
    point = np.array([[3.0, 0.2, 1.3]])
    small, _ = CameraView(CAMERA, BASE_FROM_CAMERA, 1).project(point)
    large, _ = CameraView(CAMERA, BASE_FROM_CAMERA, 4).project(point)
    assert large == pytest.approx(4.0 * small + 1.5)


def test_without_images_the_body_is_visible_from_above():
    picture = draw(RecordedFrame(0.0, (scan_at(0.0),)))
    assert picture.shape == (720, 720, 3)
    view = TopView((3.0, 0.0, 1.0), 6.0 / 720, 720)
    pixels, _ = view.project(np.array([[4.0, 0.0, 1.0], [3.0, 1.0, 1.0]]))
    assert pixels[0] == pytest.approx([359.5, 359.5 - 120])  # forward is up
    assert pixels[1] == pytest.approx([359.5 - 120, 359.5])  # left is left


@pytest.mark.parametrize("depth", [True, False])
def test_while_nobody_is_found_no_body_is_drawn(depth):
    recorded = STILL if depth else RecordedFrame(0.0, (scan_at(0.0),))
    body, _ = pose(T_POSE)
    overlay = Overlay(FakeRecording(frames=1, depth=depth))
    picture = overlay.draw(recorded, body, searching(0.0), index=0)
    with_body = overlay.draw(recorded, *pose(T_POSE), index=0)
    assert picture.shape == with_body.shape
    blue = np.array(side_color("l_wrist"))
    near = [np.abs(image.astype(float) - blue).sum(axis=2).min() for image in (picture, with_body)]
    assert near[1] < 20 < near[0]


def test_color_is_the_background_when_there_is_no_depth():
    image = np.full((60, 80, 3), (10, 200, 30), np.uint8)
    picture = draw(RecordedFrame(0.0, (ColorImage("color", 0.0, lambda: image, CAMERA, BASE_FROM_CAMERA),)))
    assert picture[-1, -1].tolist() == [10, 200, 30]
    assert image[0, 0].tolist() == [10, 200, 30]


def read_back(path, count, codec):
    """The first picture of a film of `count` pictures, read by PyAV."""
    with av.open(str(path)) as film:
        frames = list(film.decode(video=0))
        (track,) = film.streams
        assert (track.codec_context.name, len(frames), track.average_rate) == (codec, count, 30)
        assert [frame.time for frame in frames] == pytest.approx(np.arange(count) / 30.0)
        assert track.codec_context.pix_fmt == "yuv420p"
    return frames[0].to_ndarray(format="bgr24")


@pytest.mark.parametrize("codec", ["h264", "vp9"])
def test_a_film_is_one_that_browsers_play(tmp_path, monkeypatch, codec):
    if codec == "vp9":
        others = {name: how for name, how in film_module._CODECS.items() if name != "libx264"}
        monkeypatch.setattr(film_module, "_CODECS", others)  # an item that comes back would be the last one
    with PictureWriter(tmp_path / "look.mp4", rate_hz=30.0) as writer:
        for _ in range(7):
            writer.write(draw()[:-1, :-1])
    assert writer.failure is None and writer.note == "" and [tmp_path / "look.mp4"] == list(tmp_path.iterdir())
    picture = read_back(tmp_path / "look.mp4", 7, codec)
    height, width = (size // 2 * 2 for size in draw()[:-1, :-1].shape[:2])
    assert np.abs(picture.astype(int) - draw()[:height, :width]).mean() < 12
    content = (tmp_path / "look.mp4").read_bytes()
    assert content.index(b"moov") < content.index(b"mdat"), "it plays while it is loaded"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no /dev/full")
def test_a_film_on_a_full_disk_is_released():
    """FFmpeg died of it: SIGSEGV."""
    made = film_module.film(Path("/dev/full"), (64, 64, 3), rate_hz=30.0)
    with pytest.raises(OSError, match="No space left"):
        for number in range(40):
            made.write(np.random.default_rng(number).integers(0, 255, (64, 64, 3)).astype(np.uint8))
    made.release()


def test_without_pyav_a_film_is_mpeg_4_and_says_what_to_install(tmp_path, monkeypatch):
    with monkeypatch.context() as without:
        without.setitem(sys.modules, "av", None)
        with PictureWriter(tmp_path / "look.mp4", rate_hz=30.0) as writer:
            writer.write(draw())
            writer.write(draw())
    assert "look.mp4 is MPEG-4" in writer.note and "voodoo-tracker[film]" in writer.note
    read_back(tmp_path / "look.mp4", 2, "mpeg4")


def test_folder_of_pictures(tmp_path):
    with PictureWriter(tmp_path / "new" / "look", rate_hz=30.0) as writer:
        writer.write(draw())
        writer.write(draw())
    assert sorted(path.name for path in (tmp_path / "new" / "look").iterdir()) == [
        "frame_000000.png",
        "frame_000001.png",
    ]
    assert np.array_equal(cv2.imread(str(tmp_path / "new" / "look" / "frame_000001.png")), draw())


def test_other_films_and_blocked_folders_are_refused(tmp_path):
    with pytest.raises(VoodooError, match=r"\.mp4, found '\.avi'"):
        PictureWriter(tmp_path / "look.avi", rate_hz=30.0)
    (tmp_path / "file").touch()
    with pytest.raises(VoodooError, match="expected a folder, found a file"):
        PictureWriter(tmp_path / "file", rate_hz=30.0)


def test_pictures_are_placed_row_by_row():
    pictures = [np.full((30, 40, 3), value, np.uint8) for value in (10, 20, 30, 40)]
    sheet = in_rows(pictures, columns=3)
    assert sheet.shape == (60, 120, 3)
    assert [sheet[15, x, 0] for x in (20, 60, 100)] == [10, 20, 30]
    assert [sheet[45, x, 0] for x in (20, 60, 100)] == [40, 0, 0]
