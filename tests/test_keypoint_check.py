"""Keypoints of several cameras are checked against the calibration, ordered and paired before anything is tracked."""

import json
from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest

from commands import refused, run
from test_starts import AROUND, CAMERA, images, person
from voodoo.errors import RecordingError
from voodoo.measurements import DepthImage, KeypointImage
from voodoo.recordings import open_recording
from voodoo.recordings.keypoint_check import check_keypoints, check_on_depth
from voodoo.recordings.keypoint_layouts import LAYOUTS, LIMBS, layout_by_shape
from voodoo.recordings.left_out import LeftOut

WIDTH, HEIGHT = CAMERA.width, CAMERA.height


@cache
def instants(count=6):
    """A person who walks before three cameras that stand around."""
    return [images([person((2.3 + 0.05 * index, 0.0))], AROUND, noise=1.0) for index in range(count)]


def changed(rows, change):
    seen = rows[:, 2] > 0.0
    moved = rows.copy()
    moved[seen, :2] = np.column_stack(change(rows[seen, 0], rows[seen, 1]))
    return moved


def of_pixels(change, cameras=(0, 1, 2)):
    """The instants with other pixels (u, v) in some of the cameras."""
    return [
        [
            replace(image, people=tuple(changed(rows, change) for rows in image.people)) if number in cameras else image
            for number, image in enumerate(instant)
        ]
        for instant in instants()
    ]


def of_unit(factor):
    units = np.diag([1.0, 1.0, 1.0, 1.0])
    units[:3, 3] = factor
    placed = np.where(units > 0.0, units, 1.0)
    return [
        [replace(image, root_from_sensor=image.root_from_sensor * placed) for image in instant]
        for instant in instants()
    ]


def of_other_cameras(*order):
    return [
        [replace(image, people=instant[other].people) for image, other in zip(instant, order, strict=True)]
        for instant in instants()
    ]


def test_sound_keypoints_pass_in_silence():
    assert check_keypoints("x", instants()) == ()
    assert check_keypoints("x", [instant[:1] for instant in instants()]) == ()  # one camera does not tell
    assert check_keypoints("x", []) == ()
    crowd = [images([person((2.5, 0.7)), person((2.7, -0.7))], AROUND, noise=1.0)]
    assert check_keypoints("x", crowd * 3) == ()  # the order of persons differs between the cameras


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda: of_pixels(lambda u, v: (u / 2, v / 2)), r"320x240 pixels \(0\.5 times"),
        (lambda: of_pixels(lambda u, v: (u * 1.5, v * 1.5)), r"960x720 pixels \(1\.5 times"),
        (lambda: of_pixels(lambda u, v: (WIDTH - 1 - u, v)), "of mirrored pictures"),
        (lambda: of_pixels(lambda u, v: (WIDTH - 1 - u, HEIGHT - 1 - v)), "turned by 180"),
        (lambda: of_pixels(lambda u, v: (HEIGHT - 1 - v, u)), "turned by 90 degrees clockwise"),
        (lambda: of_pixels(lambda u, v: (v, WIDTH - 1 - u)), "90 degrees counterclockwise"),
        (lambda: of_pixels(lambda u, v: (u / WIDTH, v / HEIGHT)), "shares of the picture"),
        (lambda: of_other_cameras(1, 0, 2), "cam1's for cam0, cam0's for cam1"),
        (lambda: of_other_cameras(1, 2, 0), "cam2's for cam0, cam0's for cam1, cam1's for cam2"),
        (lambda: of_unit(1000.0), "in millimeters: in meters they meet within"),
        (lambda: of_unit(100.0), "in centimeters"),
        (lambda: of_unit(0.001), "expected a calibration in meters"),
    ],
)
def test_a_mistake_is_refused_and_named(wrong, words):
    with pytest.raises(RecordingError, match=words):
        check_keypoints("x", wrong())


def test_what_nothing_explains_is_refused_too():
    generator = np.random.default_rng(5)
    with pytest.raises(RecordingError, match="belong to the same pictures"):
        check_keypoints("x", of_pixels(lambda u, v: generator.uniform(0.0, 400.0, (2, len(u)))))
    with pytest.raises(RecordingError, match="inside of their pictures, found 100%"):
        check_keypoints("x", [instant[:1] for instant in of_pixels(lambda u, v: (u + WIDTH, v))])


@pytest.mark.parametrize(
    ("times", "words"), [(2.0, r"1280x960 pixels \(2 times"), (3.0, r"1920x1440 pixels \(3 times")]
)
def test_keypoints_outside_of_their_pictures_tell_how_large_these_are(times, words):
    alone = [instant[:1] for instant in of_pixels(lambda u, v: (u * times, v * times))]
    with pytest.raises(RecordingError, match=rf"found \d+% outside; .*room in pictures of {words}"):
        check_keypoints("x", alone)


def test_keypoints_outside_of_their_pictures_are_not_of_smaller_ones():
    """The rays of level cameras side by side meet with any size."""
    beside = [np.eye(4), np.eye(4)]
    for pose, y in zip(beside, (0.0, -0.6), strict=True):
        pose[:3] = np.column_stack([(0.0, -1.0, 0.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0), (0.0, y, 1.0)])
    sound = [images([person((2.3, 0.1 * index))], beside, noise=4.0) for index in range(6)]
    larger = [
        [
            replace(image, people=tuple(changed(rows, lambda u, v: (2 * u, 2 * v)) for rows in image.people))
            for image in one
        ]
        for one in sound
    ]
    with pytest.raises(RecordingError, match=r"outside.*(1\.5|2) times"):
        check_keypoints("x", larger)


def drawn(image, rows, away, *, without=()):
    """Draw the limbs of keypoints (K, 3) at a depth [m]."""
    at = {part.site: next(iter(part.weights)) for part in LAYOUTS["body25b"].parts}
    for above, below in (pair for pair in LIMBS if pair not in without):
        ends = [tuple(int(value) for value in rows[at[end], :2].round()) for end in (above, below)]
        cv2.line(image, *ends, away, 9)


def test_of_two_sizes_by_which_keypoints_lie_on_something_the_persons_size_tells():
    rows = images([person((2.5, 0.0))], AROUND[:1])[0].people[0]
    smaller, furniture = (changed(rows, lambda u, v, by=by: (u * by, v * by)) for by in (0.5, 1.0 / 3.0))
    image = np.full((HEIGHT, WIDTH), 6.0, dtype=np.float32)
    drawn(image, rows, 2.5, without=LIMBS[:1])
    drawn(image, furniture, 2.0)  # where the keypoints would be if they were of larger pictures
    seen = KeypointImage("color", 0.0, (smaller,), "body25b", CAMERA, np.eye(4))
    depth = DepthImage("depth", 0.0, image, 1.0, CAMERA, np.eye(4))
    with pytest.raises(RecordingError, match=r"320x240 pixels \(0\.5 times"):
        check_on_depth("x", [(seen, depth)] * 8)


def test_one_camera_that_disagrees_is_said():
    (said,) = check_keypoints("x", of_pixels(lambda u, v: (u / 2, v / 2), cameras=[1])[:3] + instants()[3:])
    assert said.startswith("cam1: ")


@pytest.mark.parametrize("layout", LAYOUTS)
def test_the_shape_of_a_person_tells_the_layout(layout):
    people = []
    for image in instants()[0]:
        rows = np.zeros((LAYOUTS[layout].count, 3))
        at = {part.site: next(iter(part.weights)) for part in LAYOUTS["body25b"].parts}
        for part in LAYOUTS[layout].parts:
            if part.site in at:
                rows[list(part.weights)] = image.people[0][at[part.site]]
        for middle, a, b in LAYOUTS[layout].midpoints:
            rows[middle] = (rows[a] + rows[b]) / 2.0
        if layout in ("coco17", "body25b"):
            head = image.people[0][at["skullbase"]]
            rows[:5] = head + np.array([(0, 0, 0), (2, -3, 0), (-2, -3, 0), (5, -1, 0), (-5, -1, 0)])
        people.append(rows)
    assert layout_by_shape(people) == (layout, True)


def write_folder(path, *, names="cam_{}", folders="cam{}_json", files="{}.json", count=12):
    """A Pose2Sim folder of the instants; returns it."""
    tables = []
    for number, pose in enumerate(AROUND):
        turn, place = pose[:3, :3].T, -pose[:3, :3].T @ pose[:3, 3]
        tables += [
            f"[{names.format(number)}]", f"size = [{WIDTH}.0, {HEIGHT}.0]", f"matrix = {CAMERA.matrix.tolist()}",
            "distortions = [0.0, 0.0, 0.0, 0.0]", f"rotation = {cv2.Rodrigues(turn)[0].ravel().tolist()}",
            f"translation = {place.tolist()}",
        ]  # fmt: skip
        folder = path / "keypoints" / folders.format(number)
        folder.mkdir(parents=True)
        for index, instant in enumerate(instants(count)):
            head = np.array([(0, 0, 0), (2, -3, 0), (-2, -3, 0), (5, -1, 0), (-5, -1, 0)])
            people = [
                {"pose_keypoints_2d": (rows + np.vstack([rows[17] + head, np.zeros((20, 3))])).ravel().tolist()}
                for rows in instant[number].people
            ]
            (folder / files.format(index)).write_text(json.dumps({"people": people}))
    (path / "Calib.toml").write_text("\n".join(tables) + "\n")
    return path


def across(recording):
    """Keypoint 11 (left hip) of the first camera, frame by frame."""
    return [frame.measurements[0].people[0][11, 0] for frame in recording]


def test_files_are_in_the_order_of_their_numbers(tmp_path):
    expected = [instant[0].people[0][11, 0] for instant in instants(12)]
    for files in ("{}.json", "cam7_{:05d}_keypoints.json", "{}.5.json"):
        folder = write_folder(tmp_path / files, files=files)
        assert across(open_recording(folder)) == expected


def test_a_missing_file_shifts_no_other(tmp_path):
    folder = write_folder(tmp_path)
    (folder / "keypoints" / "cam1_json" / "4.json").unlink()
    recording = open_recording(folder)
    assert len(recording) == 12
    assert [frame.measurements[1].people == () for frame in recording] == [index == 4 for index in range(12)]
    assert "of 12 are missing: cam0_json 0, cam1_json 1" in str(recording.info())


def test_times_that_differ_between_cameras_are_taken_in_order(tmp_path):
    folder = write_folder(tmp_path)
    for number in range(3):
        for file in (folder / "keypoints" / f"cam{number}_json").iterdir():
            file.rename(
                file.with_name(f"{1700000000000 + 33 * int(file.stem) ** 2 + 34 * int(file.stem) + number}.json")
            )
    recording = open_recording(folder)
    assert across(recording) == [instant[0].people[0][11, 0] for instant in instants(12)]
    assert "they are paired in their order" in str(recording.info())
    with pytest.raises(RecordingError, match="cameras: expected some of cam_0"):
        open_recording(folder, cameras=("cam_7",))


@pytest.mark.parametrize(
    ("names", "folders", "lost"),
    [
        ("cam_{}", "CAM_0{}_json", 1),
        ("int_{}_img", "view{}_json", 0),
        ("{}_a", "0{}_json", 2),
        ("a{}0", "b{}_json", None),
    ],
)
def test_cameras_are_paired_with_folders_by_name_and_number(tmp_path, names, folders, lost):
    folder = write_folder(tmp_path, names=names, folders=folders)
    if lost is not None:  # more cameras than folders
        gone = folder / "keypoints" / folders.format(lost)
        gone.rename(folder / "unused")
    recording = open_recording(folder)
    assert [placed.name for placed in recording.cameras] == [names.format(n) for n in range(3) if n != lost]
    assert f"of keypoints/{folders.format(2 if lost != 2 else 1)}" in str(recording.info())


def test_files_of_another_number_of_keypoints_are_named(tmp_path):
    folder = write_folder(tmp_path)
    for index in (0, 5):
        people = {"people": [{"pose_keypoints_2d": [1e300, 2.0, 0.9] * 17}]}
        (folder / "keypoints" / "cam1_json" / f"{index}.json").write_text(json.dumps(people))
    recording = open_recording(folder)
    with pytest.raises(RecordingError, match=r"0\.json.*expected 25 keypoints for body25b, found 17"):
        list(recording)
    left_out = LeftOut()
    assert len(list(open_recording(folder, left_out=left_out))) == 12 and len(left_out) == 2


def test_commands_refuse_and_tell(tmp_path):
    folder = write_folder(tmp_path)
    about = run("info", folder)
    assert about.exit_code == 0 and "body25b keypoints of keypoints/cam0_json" in about.output
    asked = run("info", folder, "--layout", "body25")
    assert "as asked for, but the persons have the shape of body25b" in asked.output
    rooms = folder / "keypoints"
    (rooms / "cam0_json").rename(rooms / "x")
    (rooms / "cam1_json").rename(rooms / "cam0_json")
    (rooms / "x").rename(rooms / "cam1_json")
    for command in ("info", "track"):
        refused(run(command, folder), "cam_1's for cam_0")
