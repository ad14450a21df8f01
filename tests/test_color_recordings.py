"""Recordings of pictures alone: bags with several color topics, folders of videos, pictures of the empty scene."""

import json
import shutil
from dataclasses import replace

import cv2
import numpy as np
import pytest

import color_scene as scene
from bag_writer import write_bag
from voodoo.errors import RecordingError
from voodoo.measurements import ColorImage, KeypointImage
from voodoo.model.camera import Camera
from voodoo.pipeline.pairing import paired
from voodoo.recordings import open_recording
from voodoo.recordings.empty_scene import pictures_of
from voodoo.recordings.joined import Joined, WithKeypoints
from voodoo.recordings.left_out import LeftOut
from voodoo.recordings.together import in_turn, together
from voodoo.sensors.pinhole import Pinhole
from voodoo.sensors.settings import FrontEndSettings

FRAMES = 4
TOPICS = [f"/cam_{n}/image_raw/compressed" for n in range(4)]


def image(sensor, stamp):
    return ColorImage(sensor, stamp, lambda: np.zeros((3, 4, 3), np.uint8), scene.CAMERA, np.eye(4))


def cameras_of(recording):
    return [sensor.name for sensor in recording.info().sensors]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The bag with all that lies beside it."""
    return scene.write_color_bag(tmp_path_factory.mktemp("bags") / "walk", FRAMES, later=0.004)


@pytest.fixture(scope="module")
def films(tmp_path_factory):
    return scene.write_videos(tmp_path_factory.mktemp("films") / "walk", FRAMES)


def test_a_picture_belongs_to_the_frame_it_is_nearest_to():
    chance = np.random.default_rng(3)
    items = [image("first", 0.1 * k) for k in range(30) if k != 12]
    for other in ("a", "b"):
        items += [image(other, float(t)) for t in np.sort(chance.uniform(-0.2, 3.2, 70))]
    items.sort(key=lambda item: item.stamp)
    frames = list(together(items, "first"))
    assert [frame.stamp for frame in frames] == [item.stamp for item in items if item.sensor == "first"]
    shot = set()
    for frame in frames:
        *others, last = frame.measurements
        assert last.sensor == "first" and len({item.sensor for item in others}) == len(others)
        for item in others:
            near = [abs(other.stamp - frame.stamp) for other in items if other.sensor == item.sensor]
            assert abs(item.stamp - frame.stamp) == min(near) <= 0.05 + 1e-9
            assert id(item) not in shot
            shot.add(id(item))
        for other in ("a", "b"):
            near = min(abs(item.stamp - frame.stamp) for item in items if item.sensor == other)
            assert (near < 0.05) == any(item.sensor == other for item in frame.measurements)


class InTurn:
    complete = False

    def __init__(self, *items):
        self.items = items

    def __iter__(self):
        return in_turn(iter(sorted(self.items, key=lambda item: item.stamp)), "depth")


def test_the_last_picture_belongs_to_the_last_frame_if_it_follows_soon():
    depths = [image("depth", 0.1 * k) for k in range(3)]
    colors = [image("color", 0.1 * k + 0.006) for k in range(3)]
    fast = [image("fast", 0.008 * k) for k in range(27)]
    frames = list(paired(InTurn(*depths, *colors, *fast, image("late", 0.215), image("color", 0.22))))
    assert [frame.stamp for frame in frames] == [0.0, 0.1, 0.2]
    for frame, color in zip(frames, colors, strict=True):
        assert [item for item in frame.measurements if item.sensor == "color"] == [color]
    assert frames[-1].measurements[-1] is depths[-1]
    assert {item.sensor for item in frames[-1].measurements} == {"depth", "color", "fast"}
    assert all(item.stamp < 0.2 for item in frames[-1].measurements if item.sensor == "fast")
    (alone,) = paired(InTurn(depths[0], colors[0]))
    assert set(alone.measurements) == {depths[0], colors[0]}


def test_frames_before_damage_are_read():
    def damaged():
        yield image("depth", 0.0)
        raise RecordingError("cut off")

    frames = in_turn(damaged(), "depth")
    assert next(frames).stamp == 0.0
    with pytest.raises(RecordingError, match="cut off"):
        next(frames)


def test_one_picture_and_rare_ones():
    (frame,) = together([image("a", 0.9), image("first", 1.0), image("b", 1.3)], "first")
    assert [item.sensor for item in frame.measurements] == ["a", "first"], "a quarter of a second at most"
    frames = list(together([image("first", 0.0), image("a", 4.0), image("first", 10.0)], "first"))
    assert [len(frame.measurements) for frame in frames] == [1, 1]


def test_all_color_topics_are_used_where_there_is_nothing_else(folder):
    recording = open_recording(folder)
    assert cameras_of(recording) == TOPICS and recording.root_frame == "world" and len(recording) == FRAMES
    frames = list(paired(recording))
    assert [frame.stamp for frame in frames] == pytest.approx([scene.START + k / scene.RATE for k in range(FRAMES)])
    for frame in frames:
        assert [item.sensor for item in frame.measurements] == [*TOPICS[1:], TOPICS[0]]
        delays = [item.stamp - frame.stamp for item in frame.measurements]
        assert delays == pytest.approx([0.004, 0.008, 0.012, 0.0], abs=1e-6)
    one = frames[2].measurements[1]
    np.testing.assert_allclose(one.root_from_sensor, scene.pose(2), atol=1e-9)
    assert one.image.shape == (scene.CAMERA.height, scene.CAMERA.width, 3)
    truth = scene.sequence(FRAMES).truth(0.0)[1]
    np.testing.assert_allclose(recording.start["joints"]["l_knee"], truth["l_knee"], atol=1e-9)
    assert recording.reference.exact and len(recording.reference.stamps) == FRAMES


def test_cameras_can_be_chosen(folder):
    assert cameras_of(open_recording(folder, color_topic=TOPICS[2])) == [TOPICS[2]]
    recording = open_recording(folder, color_topic=[TOPICS[3], TOPICS[1]])
    assert [item.sensor for item in next(iter(recording)).measurements] == [TOPICS[1], TOPICS[3]]


def test_natural_order_and_what_is_no_camera_of_its_own(tmp_path):
    entries = [scene.transforms(range(2))]
    for k in range(2):
        stamp = scene.START + k / scene.RATE
        for topic, frame in (("/c10", 0), ("/c9", 1)):
            entries.append((f"{topic}/camera_info", stamp, scene.info_of(stamp, frame)))
            picture = scene.M.image(stamp, scene.wall(frame), "bgr8", frame=f"cam_{frame}_optical_frame")
            entries += [(f"{topic}/image_raw", stamp, picture), (f"{topic}/image_rect", stamp, picture)]
        entries.append(("/lone/image_raw", stamp, scene.M.image(stamp, scene.wall(0), "bgr8", frame="lone")))
    recording = open_recording(write_bag(tmp_path / "b", entries))
    assert cameras_of(recording) == ["/c9/image_raw", "/c10/image_raw"]
    message = dict(recording.info().unused)
    assert "camera of /c9/image_raw" in message["/c9/image_rect"] and "camera_info" in message["/lone/image_raw"]
    assert any("/lone/image_raw" in words for words in recording.assumed)


def test_gray_cameras_count_where_none_sees_colors(tmp_path):
    entries = [scene.transforms(range(2))]
    for n in range(2):
        gray = scene.wall(n)[:, :, 0]
        entries.append((f"/g_{n}/camera_info", scene.START, scene.info_of(scene.START, n)))
        entries.append(
            (
                f"/g_{n}/image_raw",
                scene.START,
                scene.M.image(scene.START, gray, "mono8", frame=f"cam_{n}_optical_frame"),
            )
        )
    frame = next(iter(open_recording(write_bag(tmp_path / "b", entries))))
    assert [item.sensor for item in frame.measurements] == ["/g_1/image_raw", "/g_0/image_raw"]
    assert np.ptp(frame.measurements[0].image, axis=2).max() == 0


def test_cameras_without_transforms_between_them_are_no_cameras_of_one_scene(tmp_path):
    entries = [entry for entry in scene.bag_entries(2, 2) if entry[0] != "/tf_static"]
    path = write_bag(tmp_path / "b", entries)
    with pytest.raises(RecordingError, match=r"expected transforms between the cameras.*--topic color=NAME"):
        open_recording(path)
    assert cameras_of(open_recording(path, color_topic=TOPICS[1])) == [TOPICS[1]]
    partly = [scene.transforms(range(2)), *(entry for entry in scene.bag_entries(2, 3) if entry[0] != "/tf_static")]
    recording = open_recording(write_bag(tmp_path / "c", partly))
    assert cameras_of(recording) == TOPICS[:2] and TOPICS[2] in recording.assumed[0]


def test_beside_depth_an_ambiguous_color_stays_left_out(tmp_path):
    depth = np.full((scene.CAMERA.height, scene.CAMERA.width), 2000, np.uint16)
    entries = scene.bag_entries(2, 2)
    for k in range(2):
        stamp = scene.START + k / scene.RATE
        entries.append(("/d/depth/camera_info", stamp, scene.info_of(stamp, 0)))
        entries.append(("/d/depth/image", stamp, scene.M.image(stamp, depth, "16UC1", frame="cam_0_optical_frame")))
    path = write_bag(tmp_path / "b", entries)
    assert cameras_of(open_recording(path)) == ["/d/depth/image"]
    pictures = open_recording(path, use=("color",))
    assert cameras_of(pictures) == TOPICS[:2], "pictures alone were asked for"
    assert "color" in FrontEndSettings.of(pictures).use and "skin" not in FrontEndSettings.of(pictures).use
    assert "color" not in FrontEndSettings.of(open_recording(path)).use
    # A picture joined to depth, or depth to pictures, is paired by time again.
    assert not Joined(pictures, [open_recording(path)]).complete


def test_pictures_of_the_empty_scene(folder, tmp_path):
    recording = open_recording(folder)
    found = recording.empty_scene()
    assert {topic: len(pictures) for topic, pictures in found.items()} == dict.fromkeys(TOPICS, 2)
    np.testing.assert_array_equal(found[TOPICS[3]][1], scene.wall(3))
    assert "background: /cam_0" in str(recording.info())
    assert set(FrontEndSettings.of(recording).empty_scene) == set(TOPICS)
    assert FrontEndSettings.of(recording, use=("skin",)).empty_scene == {}
    other = tmp_path / "empty"
    (other / "cam_1").mkdir(parents=True)
    cv2.imwrite(str(other / "cam_1" / "any.png"), scene.wall(1))
    assert set(open_recording(folder, background=other).empty_scene()) == {TOPICS[1]}
    assert set(open_recording(folder, bare=True).empty_scene()) == set(TOPICS), "it is no truth"
    with pytest.raises(RecordingError, match=r"expected pictures NAME.png.*cam_0.*found none"):
        open_recording(folder, background=tmp_path)
    cv2.imwrite(str(other / "cam_0_1.png"), scene.wall(0)[:20])
    with pytest.raises(RecordingError, match=r"cam_0_1.png: expected 240x180"):
        open_recording(folder, background=other).empty_scene()
    left_out = LeftOut()
    assert set(open_recording(folder, background=other, left_out=left_out).empty_scene()) == {TOPICS[1]}
    assert left_out.counts == {"pictures of the empty scene": 1}


def test_whose_picture_goes_by_the_longest_name(tmp_path):
    for name in ("cam_1.png", "cam_1_0.jpg", "cam_10_0.jpg", "cam_11.txt", "image_raw_0.png"):
        (tmp_path / name).write_bytes(b"")
    found = pictures_of(tmp_path, {"a": ("cam_1", "image_raw"), "b": ("cam_10", "image_raw")})
    assert {sensor: [file.name for file in files] for sensor, files in found.items()} == {
        "a": ["cam_1.png", "cam_1_0.jpg"],
        "b": ["cam_10_0.jpg"],
    }


def test_a_folder_of_videos(films):
    recording = open_recording(films)
    assert recording.info().loader == "videos" and recording.root_frame == "world"
    assert cameras_of(recording) == [f"videos/cam{n}.avi" for n in range(4)]
    frames = list(recording)
    assert [frame.stamp for frame in frames] == pytest.approx([k / scene.RATE for k in range(FRAMES)])
    truth = scene.pictures(FRAMES, 4, 0.0)
    for k in (0, 3, 1):  # in any order
        item = next(item for item in frames[k].measurements if item.sensor == "videos/cam2.avi")
        np.testing.assert_allclose(item.root_from_sensor, scene.pose(2), atol=1e-9)
        assert np.abs(item.image.astype(int) - truth[k][2]).mean() < 4.0
    assert recording.start["height_m"] == 1.75 and recording.reference.exact
    assert len(recording.empty_scene()) == 4
    assert open_recording(films, bare=True).reference is None
    chosen = open_recording(films, color_topic=["cam_3", "cam1"], rate=15.0)
    assert cameras_of(chosen) == ["videos/cam3.avi", "videos/cam1.avi"] and chosen.info().rate_hz == pytest.approx(15.0)
    with pytest.raises(RecordingError, match=r"color_topic: expected some of cam_0, .*found cam_7"):
        open_recording(films, color_topic="cam_7")


@pytest.fixture
def copy(films, tmp_path):
    return shutil.copytree(films, tmp_path / "copy")


def test_videos_without_a_calibration_report_what_is_needed(copy):
    (copy / "Calib_scene.toml").unlink()
    with pytest.raises(
        RecordingError, match=r"expected one Calib\*\.toml, the calibration of the cameras, found none"
    ) as message:
        open_recording(copy)
    assert "[cam0]" in message.value.hint and "translation" in message.value.hint
    with pytest.raises(RecordingError, match=r"films of several cameras and their calibration"):
        open_recording(copy / "videos" / "cam0.avi")
    (copy / "calibration").mkdir()
    (copy / "calibration" / "Calib_a.toml").write_text(scene.calibration(4))
    assert len(cameras_of(open_recording(copy))) == 4
    (copy / "calibration" / "Calib_b.toml").write_text(scene.calibration(4))
    with pytest.raises(RecordingError, match=r"expected one Calib.*found 2"):
        open_recording(copy)


def test_videos_and_cameras_belong_together_by_name_else_in_order(copy):
    (copy / "videos" / "cam1.avi").unlink()
    recording = open_recording(copy)
    assert cameras_of(recording) == ["videos/cam0.avi", "videos/cam2.avi", "videos/cam3.avi"]
    np.testing.assert_allclose(next(iter(recording)).measurements[0].root_from_sensor, scene.pose(2), atol=1e-9)
    (copy / "Calib_scene.toml").write_text(scene.calibration(4, names="int_{}"))
    assert [sensor.frame for sensor in open_recording(copy).info().sensors] == ["int_0", "int_2", "int_3"]
    (copy / "Calib_scene.toml").write_text(scene.calibration(4, names="int_{}0"))
    with pytest.raises(RecordingError, match=r"expected a video for each camera.*int_00.*found cam0\.avi"):
        open_recording(copy)
    (copy / "Calib_scene.toml").write_text(scene.calibration(3, names="int_{}0"))
    assert [sensor.frame for sensor in open_recording(copy).info().sensors] == ["int_00", "int_10", "int_20"]


def test_image_folders(copy):
    shutil.rmtree(copy / "videos")
    for n in range(2):
        room = copy / "images" / f"cam_{n}"
        room.mkdir(parents=True)
        for k, row in enumerate(scene.pictures(FRAMES, 4, 0.0)):
            cv2.imwrite(str(room / f"frame_{k + 7:04d}.png"), row[n])
    recording = open_recording(copy, rate=30.0)
    assert cameras_of(recording) == ["images/cam_0", "images/cam_1"]
    frames = list(recording)
    assert [frame.stamp for frame in frames] == pytest.approx([(7 + k) / 30.0 for k in range(FRAMES)])
    np.testing.assert_array_equal(frames[2].measurements[-1].image, scene.pictures(FRAMES, 4, 0.0)[2][0])
    (copy / "images" / "cam_1" / "other_0007.png").write_bytes(
        (copy / "images" / "cam_1" / "frame_0007.png").read_bytes()
    )
    with pytest.raises(
        RecordingError, match=r"images/cam_1: expected a number or stamp for each picture, found one twice"
    ):
        open_recording(copy)


def test_keypoints_of_a_faster_camera_stay_with_their_pictures(tmp_path):
    """Every second picture of the faster camera is in no frame."""
    (tmp_path / "Calib_scene.toml").write_text(scene.calibration(2))
    blank, files = np.zeros((scene.CAMERA.height, scene.CAMERA.width, 3), np.uint8), tmp_path / "files"
    for n in range(2):
        scene.write_video(tmp_path / "videos" / f"cam{n}.avi", [blank] * 4 * (n + 1), scene.RATE * (n + 1))
    files.mkdir()
    for k in range(8):
        person = {"pose_keypoints_2d": [100.0 + k, 50.0, 0.9] * 17}
        (files / f"{k}.json").write_text(json.dumps({"people": [person]}))
    for left_out in (None, LeftOut()):
        recording = open_recording(tmp_path, left_out=left_out)
        joined = WithKeypoints(recording, {"videos/cam1.avi": files}, layout="coco17", left_out=left_out)
        found = [item for frame in joined for item in frame.measurements if isinstance(item, KeypointImage)]
        assert [item.people[0][0, 0] for item in found] == [100.0, 102.0, 104.0, 106.0]


def test_a_video_of_another_size_and_one_that_is_damaged(copy):
    rows = scene.pictures(FRAMES, 4, 0.0)
    small = [np.ascontiguousarray(row[0][:, :-8]) for row in rows]
    scene.write_video(copy / "videos" / "cam0.avi", small)
    item = next(iter(open_recording(copy))).measurements[-1]
    assert (item.camera.width, item.camera.cx) == (232, scene.CAMERA.cx), "cut at the right by its coder"
    assert item.image.shape[1] == 232
    scene.write_video(copy / "videos" / "cam0.avi", [cv2.resize(row[0], None, fx=0.5, fy=0.5) for row in rows])
    with pytest.raises(
        RecordingError, match=r"videos/cam0.avi: expected 240x180 px, as cam_0 is calibrated, found 120x90"
    ):
        open_recording(copy)
    (copy / "videos" / "cam0.avi").write_bytes(b"RIFF")
    with pytest.raises(RecordingError, match=r"cam0.avi: expected a video that FFmpeg reads"):
        open_recording(copy)


@pytest.mark.parametrize("distortion", [(), (-0.25, 0.08, 0.001, -0.002)])
def test_a_pinhole_sees_points_where_the_picture_shows_them(distortion):
    """Dots drawn where the lens projects points are found where the pinhole projects them, reduced or not."""
    camera = Camera(320, 240, 250.0, 252.0, 161.0, 118.0, distortion)
    points = np.array([[x, y, 2.0] for x in (-0.9, 0.0, 0.8) for y in (-0.6, 0.0, 0.55)])
    for most in (320 * 240, 160 * 120):
        lens = Pinhole(camera, most=most)
        assert lens.camera.width * lens.camera.height <= most and not lens.camera.distorted
        for point in points:
            picture = np.zeros((240, 320, 3), np.uint8)
            u, v = camera.project(point[None])[0]
            cv2.circle(picture, (round(16 * u), round(16 * v)), 6 << 4, (255, 255, 255), -1, cv2.LINE_AA, 4)
            shot = lens.apply(picture)[..., 0].astype(float)
            found = np.array([(shot.sum(axis=axis) @ np.arange(shot.shape[1 - axis])) for axis in (0, 1)]) / shot.sum()
            np.testing.assert_allclose(found, lens.camera.project(point[None])[0], atol=0.25)


def test_a_picture_without_distortion_stays_as_it_is():
    picture = np.arange(4 * 6 * 3, dtype=np.uint8).reshape(4, 6, 3)
    lens = Pinhole(replace(scene.CAMERA, width=6, height=4))
    assert lens.apply(picture) is picture and lens.camera == lens.original
