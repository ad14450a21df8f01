"""Networks that find keypoints in color images: with depth, of several cameras, live; stubs of libraries, and the real ones."""

import importlib.util
import os
import sys
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

import color_scene as scene
import dot_networks
import voodoo
from commands import run
from live_rig import Rig, arrival_of
from measurement_data import data_folder
from test_track_inputs import COLOR, Short, errors_of
from voodoo.errors import ConfigError, MeasurementError, RecordingError, VoodooError
from voodoo.export.track import Track
from voodoo.live import Follower, Live
from voodoo.live.session import Output, Session
from voodoo.live.sources.played import PlayedSource
from voodoo.measurements import ColorImage, DepthImage, KeypointImage
from voodoo.pipeline.inputs import Detected, keypoint_words
from voodoo.pipeline.run import track
from voodoo.pipeline.start import start_tracker
from voodoo.recordings import open_recording, sample_path
from voodoo.recordings.keypoint_layouts import layout_of
from voodoo.recordings.left_out import LeftOut
from voodoo.sensors.keypoints.networks import KeypointNetwork, network_of
from voodoo.sensors.pixels import in_sensor
from voodoo.sensors.settings import FrontEndSettings


def color_images(recording):
    return [item for frame in recording for item in frame.measurements if isinstance(item, ColorImage)]


def rows_at(item, reference, layout):
    """Keypoints (K, 3) of the true joints at the time of an image."""
    rows = np.zeros((layout_of(layout).count, 3))
    row = int(np.argmin(np.abs(reference.stamps - item.stamp)))
    for part in layout_of(layout).parts:
        if part.site in reference.names and len(part.weights) == 1:
            place = reference.positions[row, reference.names.index(part.site)]
            rows[next(iter(part.weights))] = (*item.camera.project(in_sensor(item.root_from_sensor, [place]))[0], 0.9)
    return rows


def key_of(image):
    return image.tobytes()[::97]


def stub_of(recording, layout="body25b"):
    """A function that knows the images of a recording: what a perfect network would find."""
    known = {key_of(item.image): rows_at(item, recording.reference, layout) for item in color_images(recording)}
    return lambda image: [known[key_of(image)]]


def test_a_network_beside_depth_makes_wrists_better():
    recording = Short(open_recording(sample_path()))
    found = {}
    for name, source in {
        "alone": recording,
        "fused": Detected(recording, KeypointNetwork("stub", stub_of(recording), "body25b")),
    }.items():
        settings = FrontEndSettings.of(source, use=("depth", "keypoints") if name == "fused" else ("depth",))
        steps = list(track(source, start_tracker(source), settings=settings))
        used = [
            step.estimate.sources[f"{COLOR}/keypoints"]
            for step in steps
            if f"{COLOR}/keypoints" in step.estimate.sources
        ]
        found[name] = Track.of([step.estimate for step in steps])
    assert len(used) >= 3 and min(matched for _, matched, _ in used) >= 8
    for side in "lr":
        name = f"{side}_wrist"
        assert errors_of(found["fused"], name).mean() < errors_of(found["alone"], name).mean()


def test_a_network_on_several_cameras_is_triangulated_from_the_search_on(tmp_path):
    films = open_recording(scene.write_videos(tmp_path / "films", 8, background=False))
    source = Detected(films, KeypointNetwork("stub", stub_of(films), "body25b"))
    assert [sensor.kind for sensor in source.info().sensors] == ["color"] * 4 + ["keypoints"] * 4
    tracker = start_tracker(source, init="auto")
    settings = FrontEndSettings.of(source)
    assert "keypoints" in settings.use
    result = Track.of([step.estimate for step in track(source, tracker, settings=settings)])
    names = [name for name in films.reference.names if name in result.joint_names]
    errors = [
        result.joints[result.found, result.joint_names.index(name)]
        - films.reference.positions[: len(result)][result.found, films.reference.names.index(name)]
        for name in names
    ]
    assert result.found.sum() >= 6 and np.linalg.norm(errors, axis=2).mean() < 0.04
    # and live
    steps = []

    class Keeps(Output):
        name, waiting, publish = "keeps", 1000, lambda self, step: steps.append(step)

    follower = Follower(voodoo.Tracker(voodoo.Body.human()), settings=FrontEndSettings(use=("keypoints",)))
    with Live([PlayedSource(films, rate=0.5)], network=KeypointNetwork("stub", stub_of(films), "body25b")) as live:
        session = Session(live, lambda _: follower, outputs=[Keeps()])
        while session.wait(0.05):
            pass
        session.finish()
    (estimate,) = steps[-1].estimates.values()
    row = int(np.argmin(np.abs(films.reference.stamps - steps[-1].stamp)))
    away = [
        np.linalg.norm(estimate.joints[name] - films.reference.positions[row, films.reference.names.index(name)])
        for name in names
    ]
    assert np.mean(away) < 0.04


@pytest.fixture
def own_network(tmp_path, monkeypatch):
    """A module in the current folder whose function `find` knows the images of the bundled recording."""
    monkeypatch.chdir(tmp_path)
    recording = open_recording(sample_path())
    known = {key_of(item.image): rows_at(item, recording.reference, "coco17") for item in color_images(recording)}
    np.savez("known.npz", keys=np.array([hash_of(key) for key in known]), rows=np.array(list(known.values())))
    (tmp_path / "own_network_of_a_test.py").write_text(
        "import zlib\nimport numpy as np\nknown = np.load('known.npz')\n"
        "rows = dict(zip(known['keys'].tolist(), known['rows']))\n"
        "def find(image):\n    return [rows[zlib.crc32(image.tobytes()[::97])]]\n"
        "find.layout = 'coco17'\nnumber = 3\ndef bare(image):\n    return ()\n"
    )
    yield "own_network_of_a_test"
    sys.modules.pop("own_network_of_a_test", None)


def hash_of(key):
    import zlib

    return zlib.crc32(key)


def test_a_function_of_the_users_own_by_one_option_from_a_recording_and_live(own_network):
    for command in (("track", sample_path()), ("live", sample_path(), "--rate", 6)):
        output = f"{command[0]}.npz"
        done = run(
            *command,
            "--keypoints",
            f"{own_network}:find",
            "--use",
            "depth,keypoints",
            "--init",
            "auto",
            "--out",
            output,
        )
        assert done.exit_code == 0, done.stderr
        result = Track.load(output)
        assert result.found.sum() > 0.8 * len(result)
    for words, message in {
        f"{own_network}:number": "found int",
        f"{own_network}:missing": "AttributeError",
        "no_such_module_at_all:find": "ModuleNotFoundError",
        f"{own_network}:bare": "--layout",
        "yolo": "expected SENSOR=FOLDER, mediapipe, rtmpose or MODULE:FUNCTION, found 'yolo'",
    }.items():
        done = run("track", sample_path(), "--keypoints", words)
        assert done.exit_code == 1 and message in " ".join(done.stderr.split()), done.stderr
    assert network_of(f"{own_network}:bare", layout="coco17").layout == "coco17"
    done = run("live", sample_path(), "--keypoints", f"{COLOR}=.")
    assert done.exit_code == 1 and "expected a network, found a folder" in done.stderr


def test_what_is_not_possible_is_refused(tmp_path):
    with pytest.raises(VoodooError, match="expected one network, found mediapipe, rtmpose"):
        keypoint_words(["mediapipe", "rtmpose"], None)
    recording = open_recording(sample_path())
    (item, *_) = color_images(Short(recording, 2))
    for detect, words in {
        (lambda image: [np.zeros((5, 3))]): r"stub: keypoints: expected shape \(17, 3\) for coco17, found \(5, 3\)",
        (lambda image: 1 / 0): "stub: ZeroDivisionError: division by zero",
    }.items():
        with pytest.raises(MeasurementError, match=words):
            KeypointNetwork("stub", detect, "coco17").keypoints(item)
    done = run("track", scene.write_color_bag(tmp_path / "bag", 2), "--keypoints", "rtmpose:no.onnx")
    assert done.exit_code == 1 and "rtmpose" in done.stderr

    class DepthOnly(Short):
        def info(self):
            about = super().info()
            return type(about)(**{**vars(about), "sensors": tuple(one for one in about.sensors if one.kind == "depth")})

    with pytest.raises(RecordingError, match=r"expected color images for stub, found .*depth"):
        Detected(DepthOnly(recording), KeypointNetwork("stub", lambda image: (), "coco17"))


def test_a_network_may_return_one_array_for_all_persons_and_images():
    (item, *_) = color_images(Short(open_recording(sample_path()), 2))
    reused = np.zeros((17, 3))

    def detect(image):
        for _ in range(2):
            reused[:] += 1.0
            yield reused

    network = KeypointNetwork("stub", detect, "coco17")
    found = [network.keypoints(item) for _ in range(2)]
    assert [rows[0, 0] for one in found for rows in one.people] == [1.0, 2.0, 3.0, 4.0]


def damaged(item):
    def decode():
        raise RecordingError("a damaged image")

    return ColorImage(item.sensor, item.stamp, decode, item.camera, item.root_from_sensor)


def test_live_frames_have_keypoints_and_a_damaged_image_is_counted():
    recording = open_recording(sample_path())
    rig = Rig()
    network = KeypointNetwork("stub", stub_of(Short(recording)), "body25b")
    rig.live = Live(rig.live.sources, clock=rig.clock, on_message=rig.messages.append, network=network, eager=False)
    for number, frame in enumerate(list(Short(recording, 4))):
        images = [item for item in frame.measurements if isinstance(item, ColorImage)][-1:]
        depth = next(item for item in frame.measurements if isinstance(item, DepthImage))
        if number == 3:
            images = [damaged(item) for item in images]
        rig.deliver(*(arrival_of(item, drives=False) for item in images), arrival_of(depth))
        rig.wait(1 / 30)
    found = [[type(item) for item in frame.measurements] for frame in rig.frames]
    assert sum(KeypointImage in kinds for kinds in found) >= 2
    assert all(kinds.index(KeypointImage) + 1 == kinds.index(ColorImage) for kinds in found if KeypointImage in kinds)
    assert rig.live.kinds[f"{COLOR}/keypoints"] == "keypoints" and rig.counts["damaged picture"] == 1


def test_a_damaged_image_of_a_recording_is_left_out_or_an_error():
    class Damaged(Short):
        def __iter__(self):
            for number, frame in enumerate(super().__iter__()):
                items = [
                    damaged(item) if number == 2 and isinstance(item, ColorImage) else item
                    for item in frame.measurements
                ]
                yield type(frame)(frame.stamp, tuple(items))

    source, network = Damaged(open_recording(sample_path()), 5), KeypointNetwork("stub", lambda image: (), "coco17")
    with pytest.raises(RecordingError, match="a damaged image"):
        list(Detected(source, network))
    left_out = LeftOut()
    frames = list(Detected(source, network, left_out=left_out))
    assert len(frames) == 5 and len(left_out) == len(color_images(source)) - len(color_images(frames)) > 0


# Libraries: stubs with their interface


def mark(x, y, visibility):
    return SimpleNamespace(x=x, y=y, z=0.0, visibility=visibility)


def test_mediapipe_by_the_network_it_ships_by_a_file_and_without_either(monkeypatch, tmp_path):
    seen = []

    class Pose:
        def __init__(self, *, static_image_mode):
            assert static_image_mode  # images of several cameras

        def process(self, image):
            seen.append(image)
            landmarks = None if not image.any() else SimpleNamespace(landmark=[mark(0.5, 0.25, 0.8)] * 33)
            return SimpleNamespace(pose_landmarks=landmarks)

    pose = SimpleNamespace(pose=SimpleNamespace(Pose=Pose))
    monkeypatch.setitem(sys.modules, "mediapipe", SimpleNamespace(solutions=pose))
    network = network_of("mediapipe")
    image = np.zeros((40, 60, 3), np.uint8)
    assert list(network.detect(image)) == []
    image[:] = (10, 20, 30)
    (rows,) = network.detect(image)
    assert network.layout == "blazepose33" and rows.shape == (33, 3)
    np.testing.assert_allclose(rows[0], [29.5, 9.5, 0.67 * 0.8])  # the center of the first pixel is (0, 0)
    assert tuple(seen[-1][0, 0]) == (30, 20, 10)  # RGB
    # As of the versions without `solutions`.
    vision = SimpleNamespace(
        PoseLandmarkerOptions=lambda **how: how,
        PoseLandmarker=SimpleNamespace(
            create_from_options=lambda how: SimpleNamespace(
                detect=lambda image: SimpleNamespace(pose_landmarks=[[mark(0.1, 0.1, None)] * 33] * how["num_poses"])
            )
        ),
    )
    package = SimpleNamespace(__version__="1.2", Image=lambda **how: how, ImageFormat=SimpleNamespace(SRGB=1))
    monkeypatch.setitem(sys.modules, "mediapipe", package)
    monkeypatch.setitem(sys.modules, "mediapipe.tasks", SimpleNamespace())
    tasks = SimpleNamespace(BaseOptions=lambda **how: how, vision=vision)
    monkeypatch.setitem(sys.modules, "mediapipe.tasks.python", tasks)
    with pytest.raises(ConfigError, match=r"expected mediapipe:FILE.task, .*MediaPipe 1.2 ships no network"):
        network_of("mediapipe")
    with pytest.raises(ConfigError, match=r"none.task: expected a pose landmarker"):
        network_of("mediapipe:none.task")
    (tmp_path / "some.task").write_bytes(b"network")
    assert len(list(network_of(f"mediapipe:{tmp_path / 'some.task'}").detect(image))) == 6
    monkeypatch.setitem(sys.modules, "mediapipe", None)
    with pytest.raises(ConfigError, match=r"pip install 'voodoo-tracker\[mediapipe\]'"):
        network_of("mediapipe")


def rtmlib_stub(count, boxes, made):
    """rtmlib with a pose network of `count` keypoints at the centers of boxes."""

    def shapes(inputs, outputs):
        return SimpleNamespace(
            get_inputs=lambda: [SimpleNamespace(shape=inputs)], get_outputs=lambda: [SimpleNamespace(shape=outputs)]
        )

    class Pose:
        session = shapes(["batch", 3, 384, 288], ["batch", count, 576])

        def __call__(self, image, bboxes):
            assert len(bboxes)
            centers = np.array([(box[:2] + box[2:]) / 2 for box in bboxes])
            return np.repeat(centers[:, None], count, axis=1), np.full((len(bboxes), count), 1.2)

    class Persons:
        session = shapes([1, 3, 416, 416], [1])

        def __call__(self, image):
            return boxes

    def body(**how):
        print("load it")
        made.append(SimpleNamespace(det_model=Persons(), pose_model=Pose(), how=how))
        return made[-1]

    return SimpleNamespace(BodyWithFeet=body)


def test_rtmpose_by_a_mode_by_files_and_without_either(monkeypatch, tmp_path, capsys):
    made, image = [], np.zeros((40, 60, 3), np.uint8)
    boxes = np.array([[10.0, 10.0, 20.0, 40.0], [30.0, 0.0, 50.0, 40.0]])
    monkeypatch.setitem(sys.modules, "rtmlib", rtmlib_stub(26, boxes, made))
    network = network_of("rtmpose")
    assert network.layout == "halpe26" and made[-1].how == {
        "backend": "onnxruntime",
        "device": "cpu",
        "mode": "balanced",
    }
    assert capsys.readouterr().out == ""  # stdout may be a result
    assert made[-1].pose_model.model_input_size == (288, 384) and made[-1].det_model.model_input_size == (416, 416)
    first, second = network.detect(image)
    np.testing.assert_allclose(first[0], [15.0, 25.0, 1.0])
    np.testing.assert_allclose(second[25], [40.0, 20.0, 1.0])
    monkeypatch.setitem(sys.modules, "rtmlib", rtmlib_stub(17, boxes[:0], made))
    files = [tmp_path / name for name in ("yolox.onnx", "pose.onnx")]
    for file in files:
        file.write_bytes(b"")
    network = network_of(f"rtmpose:{files[0]},{files[1]}")
    assert network.layout == "coco17" and list(network.detect(image)) == []
    assert made[-1].how["det"] == str(files[0]) and made[-1].how["pose"] == str(files[1])
    with pytest.raises(ConfigError, match="expected lightweight, balanced, performance or the files"):
        network_of("rtmpose:fast")
    monkeypatch.setitem(sys.modules, "rtmlib", rtmlib_stub(133, boxes, made))
    with pytest.raises(ConfigError, match="17 or 26 keypoints, found 133"):
        network_of("rtmpose")

    def unreachable(**how):
        raise OSError("no host")

    monkeypatch.setitem(sys.modules, "rtmlib", SimpleNamespace(BodyWithFeet=unreachable))
    with pytest.raises(ConfigError, match=r"downloaded or read, found OSError: no host; rtmpose:DETECTOR"):
        network_of("rtmpose")
    monkeypatch.setitem(sys.modules, "rtmlib", None)
    with pytest.raises(ConfigError, match=r"pip install 'voodoo-tracker\[rtmpose\]'"):
        network_of("rtmpose")


@pytest.mark.parametrize("chosen", [True, False])
def test_the_real_rtmlib_finds_dots_where_they_are(chosen, tmp_path):
    """Its own scaling, boxes and decoding, with networks that find colored dots."""
    for library in ("rtmlib", "onnxruntime", "onnx"):
        pytest.importorskip(library, reason="pip install rtmlib onnxruntime onnx")
    files = tmp_path / "persons.onnx", tmp_path / "pose.onnx"
    dot_networks.write_persons(files[0], chosen=chosen)
    dot_networks.write_pose(files[1])
    network = network_of(f"rtmpose:{files[0]},{files[1]}")
    assert network.layout == "halpe26"
    image = np.full((480, 640, 3), dot_networks.GRAY, np.uint8)
    assert list(network.detect(image)) == []
    chance, people = np.random.default_rng(4), {}
    for middle in ((160.0, 260.0), (468.0, 210.0)):
        cells = [(column, row) for column in range(-2, 3) for row in range(-3, 4) if (column, row) != (0, 0)]
        places = 30.0 * np.array(cells)[chance.permutation(len(cells))[:26]] + chance.uniform(-6, 6, (26, 2))
        people[middle] = places + middle
        for place, code in zip(people[middle], dot_networks.CODES, strict=True):
            dot_networks.dot(image, place, code, 9.0)
        dot_networks.dot(image, middle, dot_networks.PERSON, 12.0)
    found = sorted(network.detect(image), key=lambda rows: rows[:, 0].mean())
    assert len(found) == 2
    for rows, places in zip(found, people.values(), strict=True):
        away = np.linalg.norm(rows[:, :2] - places, axis=1)
        assert away.max() < 1.3, away  # a pixel of the crop
        assert (rows[:, 2] > 0.3).all() and (rows[:, 2] <= 1.0).all()


# The real ones, where their weights are


def real_networks():
    """MediaPipe if it ships its network, and those of VOODOO_NETWORKS: "mediapipe:FILE.task rtmpose:PERSONS.onnx,POSE.onnx"."""
    shipped = importlib.util.find_spec("mediapipe") and importlib.util.find_spec("mediapipe.modules.pose_landmark")
    return ["mediapipe"] * bool(shipped) + os.environ.get("VOODOO_NETWORKS", "").split()


@pytest.mark.parametrize("words", real_networks() or ["none"])
def test_a_real_network_finds_rendered_people(words, voodoo_data):
    if words == "none":
        pytest.skip("no weights of a real network: mediapipe<0.10.30 ships some, VOODOO_NETWORKS names others")
    recording = open_recording(data_folder(voodoo_data, "rendered") / "dev_08_jump_l515_cmu")
    network, away = network_of(words), []
    for item in color_images(Short(recording, 12)):
        (rows,) = network.keypoints(item).people
        truth = rows_at(item, recording.reference, network.layout)
        used = (truth[:, 2] > 0.0) & (rows[:, 2] > 0.3)
        assert used.sum() >= 8
        away += np.linalg.norm(rows[used, :2] - truth[used, :2], axis=1).tolist()
    assert np.median(away) < 4.0 and cv2.__version__  # pixels of an image 320 pixels wide
