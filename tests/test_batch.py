"""Many recordings: rows, names, tables and what a worker does. What needs the extra `batch` is skipped without it, and run
with it by test_batch_cluster.py."""

import csv
import importlib.util
import io
import json
import math
import os
import sys
import time
from dataclasses import replace
from importlib.machinery import ModuleSpec
from pathlib import Path, PureWindowsPath
from types import ModuleType

import numpy as np
import pytest
from typer.testing import CliRunner

from core_fakes import T_POSE
from voodoo.batch import run as engine
from voodoo.batch import task
from voodoo.batch.run import Batch
from voodoo.batch.storage import Store, find_sources, name_of, named, on_disk
from voodoo.batch.summary import COLUMNS, DONE, FAILED, Row, read_table, write_index, write_table
from voodoo.batch.task import Job, Settings, columns_of, do, encode, note_of, row_of
from voodoo.cli import app
from voodoo.errors import RecordingError, VoodooError
from voodoo.export.track import Track
from voodoo.recordings import sample_path

needs = {name: importlib.util.find_spec(name) is not None for name in ("fsspec", "pyarrow", "distributed")}
storing = pytest.mark.skipif(not (needs["fsspec"] and needs["pyarrow"]), reason="needs the extra batch")


def track_of(stamps, offset=0.0):
    count = len(stamps)
    joints = np.array([list(T_POSE.values())] * count) + offset
    status = tuple("searching" if k == 0 else "tracking" for k in range(count))
    joints[0] = np.nan
    return Track(
        stamps=np.array(stamps), status=status, residual=np.where(np.arange(count) == 0, np.nan, 0.01),
        joint_names=tuple(T_POSE), joints=joints, limb_names=(), world_from_limb=np.empty((count, 0, 4, 4)),
        angle_names=("l_elbow_flexion",), angles=np.where(np.isnan(joints[:, :1, 0]), np.nan, 0.5),
        limb_status={"torso": tuple("" if k == 0 else "measured" for k in range(count))},
    )  # fmt: skip


def test_an_index_links_the_reports_that_there_are():
    rows = [Row("walk <1>", frames=90), Row("old", frames=3), Row("bad", status=FAILED, error="cut <off>")]
    page = write_index(rows, {"walk <1>.html"})
    assert "<a href='reports/walk%20%3C1%3E.html'>walk &lt;1&gt;</a>" in page and page.count("<a ") == 1
    assert page.index("bad") < page.index("old") < page.index("walk") and "cut &lt;off&gt;" in page


@storing
def test_a_job_writes_its_report(tmp_path):
    pytest.importorskip("plotly", reason="pip install plotly, of the extra report")
    job = Job("walk", str(sample_path()), str(tmp_path), Settings(use=("depth",)), report=True)
    row = do(job)
    assert row.status == DONE, row.error
    assert "one standard deviation" in (tmp_path / "reports" / "walk.html").read_text()
    batch = Batch([str(sample_path())], str(tmp_path), job.settings, report=True)
    batch.take(row)
    batch.save()
    assert "reports/walk.html" in (tmp_path / "index.html").read_text()


def test_a_table_of_summaries_is_read_as_it_was_written():
    rows = [
        Row("walk", frames=90, seconds=1.25, recorded_s=3.0, persons=1, tracking_share=0.5, source="/a,b/walk"),
        Row("bad", status=FAILED, error='cut off, "here"\nand there', source="s3://x/bad"),
    ]
    text = write_table(rows)
    assert text.startswith("recording,frames,seconds,status,error,")
    found = read_table(text, "summary.csv")
    assert list(found) == ["bad", "walk"]
    assert found["walk"] == replace(rows[0], joint_error_m=found["walk"].joint_error_m)
    assert math.isnan(found["walk"].joint_error_m) and found["bad"].error == rows[1].error
    plain = {row["recording"]: row for row in csv.DictReader(io.StringIO(text))}
    assert plain["walk"]["joint_error_m"] == "" and plain["bad"]["status"] == "failed"
    for wrong in ("a,b\n1,2\n", "", ",".join(COLUMNS) + "\n1,2\n", ",".join(COLUMNS) + "\nx,many" + "," * 9 + "\n"):
        with pytest.raises(VoodooError, match=r"expected"):
            read_table(wrong, "summary.csv")


def test_every_recording_has_a_name_of_its_own_and_keeps_it(monkeypatch):
    sources = ["/a/walk", "/b/walk.mcap", "s3://c/walk/", "/d/a1_s1_t1_depth.mat"]
    first = named(sources, {})
    assert [name for name, _ in first] == ["walk", "walk~2", "walk~3", "a1_s1_t1"]
    again = named(["/e/walk", *reversed(sources)], dict(first))
    assert dict(again[1:]) == dict(first) and again[0] == ("walk~4", "/e/walk")
    assert name_of("/x/y.z.bag") == "y.z"
    monkeypatch.setattr("voodoo.batch.storage.local_path", PureWindowsPath)
    assert name_of(r"C:\takes\walk.mkv") == "walk"


def test_columns_hold_every_frame_of_everybody():
    tracks = {1: track_of([0.0, 0.1, 0.2]), 2: track_of([0.1, 0.2, 0.3], offset=1.0)}
    columns = columns_of(tracks)
    assert columns["stamp_s"].tolist() == [0.0, 0.1, 0.1, 0.2, 0.2, 0.3]
    assert columns["person"].tolist() == [1, 1, 2, 1, 2, 2]
    assert columns["status"].tolist() == ["searching", "tracking", "searching", "tracking", "tracking", "tracking"]
    assert columns["torso_status"].tolist() == ["", "measured", "", "measured", "measured", "measured"]
    x = T_POSE["l_knee"][0]
    np.testing.assert_allclose(columns["l_knee_x"], [np.nan, x, np.nan, x, x + 1.0, x + 1.0], rtol=1e-6)
    assert {len(column) for column in columns.values()} == {6} and columns["l_knee_x"].dtype == np.float32
    assert list(columns_of({}))[:4] == ["stamp_s", "person", "status", "residual_m"]


@storing
def test_parts_of_a_table_are_the_whole():
    import pyarrow.parquet as pq

    def stored(parts):
        return pq.read_table(io.BytesIO(encode(parts, {})))

    whole = track_of([0.0, 0.1, 0.2, 0.3, 0.4])
    parts = [whole.of_frames(np.arange(5) // 2 == k) for k in range(3)]
    assert stored([columns_of({1: whole})]).equals(stored([columns_of({1: part}) for part in parts]))
    np.testing.assert_array_equal(task.joined(parts).joints, whole.joints)
    # What is not known of all parts is empty there.
    sure = replace(parts[1], covariance=np.tile(np.diag([4e-4, 1e-4, 1e-4]), (2, len(T_POSE), 1, 1)))
    mixed = stored([columns_of({}), columns_of({1: parts[0]}), columns_of({1: sure})])
    assert mixed["l_knee_sigma_m"].to_pylist() == [None, None, pytest.approx(2e-4**0.5), pytest.approx(2e-4**0.5)]
    assert mixed["stamp_s"].to_pylist() == [0.0, 0.1, 0.2, 0.3] and mixed["torso_status"][0].as_py() is None


@storing
def test_tables_are_one_data_set(tmp_path):
    import pyarrow.dataset as dataset

    store = Store(str(tmp_path / "out"))
    note = {"row": {"recording": "x"}, "settings": {"use": None}}
    for name in ("walk", "walk~2", "50 % of it/all"):
        store.write(store.place_of(name), encode([columns_of({1: track_of([0.0, 0.1, 0.2])})], note))
    assert store.recordings() == {"walk", "walk~2", "50 % of it/all"}
    rows = dataset.dataset(tmp_path / "out" / "frames", partitioning="hive").to_table()
    assert rows.num_rows == 9 and sorted(set(rows["recording"].to_pylist())) == ["50 % of it/all", "walk", "walk~2"]
    assert rows["l_knee_x"].null_count == 3 and rows["torso_status"].null_count == 3
    assert rows["stamp_s"].to_pylist()[:3] == [0.0, 0.1, 0.2]
    with store.opened("walk") as file:
        assert note_of(file) == note
    assert note_of(io.BytesIO(b"PAR1 and nothing else")) is None and store.opened("other") is None


@storing
def test_a_file_appears_whole_and_leaves_nothing_beside_it(tmp_path, monkeypatch):
    store = Store(str(tmp_path))
    store.write("frames/recording=a/part-0.parquet", b"old")
    place = tmp_path / "frames" / "recording=a"
    (place / ".part-0.parquet-abcd1234.voodoo").mkdir()  # of a worker that died

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(VoodooError, match="No space left"):
        store.write("frames/recording=a/part-0.parquet", b"new")
    monkeypatch.undo()
    assert [file.name for file in place.iterdir()] == ["part-0.parquet"]
    assert (place / "part-0.parquet").read_bytes() == b"old"
    store.write("frames/recording=a/part-0.parquet", b"new")
    assert (place / "part-0.parquet").read_bytes() == b"new" and store.read("nothing") is None


@storing
def test_recordings_are_found_and_fetched_by_url(tmp_path):
    import fsspec

    files = fsspec.filesystem("memory")
    for name in ("a/bag/metadata.yaml", "a/init.json", "b.mcap", "deep/c_depth.mat", "deep/d.mkv", "deep/readme.txt"):
        files.pipe_file(f"/lab/{name}", name.encode())
    found = find_sources(["memory://lab"])
    assert found == [
        "memory:///lab/a",
        "memory:///lab/b.mcap",
        "memory:///lab/deep/c_depth.mat",
        "memory:///lab/deep/d.mkv",
    ]
    assert find_sources(["memory://lab/*.mcap"]) == ["memory:///lab/b.mcap"]
    assert find_sources(["memory://lab"], only=["a"]) == ["memory:///lab/a"]
    with on_disk(found[0]) as path:
        assert (path / "bag" / "metadata.yaml").read_text() == "a/bag/metadata.yaml" and path.name == "a"
    with on_disk(found[1]) as path:
        assert path.read_text() == "b.mcap"
    assert not path.exists()
    with pytest.raises(RecordingError, match="found none"):
        find_sources(["memory://nowhere"])
    with pytest.raises(VoodooError, match="nosuchprotocol"):
        find_sources(["nosuchprotocol://x"])
    for name in ("x.mcap", "y.mcap"):
        (tmp_path / name).write_bytes(b"")
    both = [str(tmp_path / "x.mcap"), str(tmp_path / "y.mcap")]
    assert find_sources([f"file://{tmp_path}"]) == both == find_sources([str(tmp_path)])
    store = Store("memory://results")
    store.write("frames/recording=a/part-0.parquet", b"1234")
    assert store.recordings() == {"a"} and store.opened("a").read() == b"1234"


@pytest.fixture
def job(tmp_path):
    """The bundled recording by its depth, which is a second's work."""
    return Job("sample", str(sample_path()), str(tmp_path / "out"), Settings(use=("depth",), version="1"))


@storing
def test_a_recording_is_done_once(job, monkeypatch):
    import pyarrow.parquet as parquet

    row = do(job)
    assert (row.status, row.error, row.frames, row.persons) == (DONE, "", 90, 1)
    assert row.joint_error_m < 0.05 and row.tracking_share > 0.9 and row.recorded_s == pytest.approx(2.967, abs=1e-3)
    place = Path(job.out) / Store(job.out).place_of("sample")
    table = parquet.read_table(place)
    assert table.num_rows == 90 and {"l_wrist_z", "l_elbow_flexion_rad", "l_forearm_status", "l_wrist_sigma_m"} <= set(
        table.column_names
    )
    assert len(place.read_bytes()) < 200_000
    monkeypatch.setattr(task, "_track", lambda *_: pytest.fail("it was done"))
    assert do(job) == row == row_of(job)
    other = replace(job, settings=replace(job.settings, init="auto"))
    assert row_of(other) is None and row_of(replace(job, source="/elsewhere/sample")) is None
    place.write_bytes(place.read_bytes()[:5000])
    assert row_of(job) is None, "a damaged table is made anew"


@storing
def test_whatever_goes_wrong_is_a_row(job, tmp_path, monkeypatch):
    row = do(replace(job, source=str(tmp_path / "nothing")))
    assert row.status == FAILED and "found no such file or folder" in row.error and "\n" not in row.error
    monkeypatch.setattr(task, "_track", lambda *_: 1 / 0)
    row = do(job)
    assert (row.status, row.error, row.frames) == (FAILED, "ZeroDivisionError: division by zero", 0)
    assert not Store(job.out).recordings()


@storing
def test_an_interrupted_batch_goes_on_and_other_settings_do_not(tmp_path):
    out, settings = str(tmp_path / "out"), Settings(version="1")
    sources = ["/a/one", "/a/two", "/a/three", "/a/four"]
    batch = Batch(sources, out, settings)
    assert [job.name for job in batch.jobs] == ["one", "two", "three", "four"]
    store, row = Store(out), Row("one", frames=3, source="/a/one")
    whole = encode([columns_of({1: track_of([0.0, 0.1, 0.2])})], {"row": vars(row), "settings": settings.as_dict()})
    store.write(store.place_of("one"), whole)
    store.write(store.place_of("three"), whole[:-4])  # only its name is right
    batch.take(row)
    batch.take(replace(row, recording="three", source="/a/three"))
    batch.take(Row("two", status=FAILED, error="bad", source="/a/two"))
    batch.take(Row("four", frames=3, source="/a/four"))  # whose table is gone
    batch.save()
    again = Batch([*sources, "/b/one"], out, settings)
    assert [job.name for job in again.jobs] == ["two", "three", "four", "one~2"]
    assert set(again.rows) == {"one", "two"} and again.notes == []
    assert json.loads((tmp_path / "out" / "settings.json").read_text())["people"] == 1
    with pytest.raises(
        VoodooError, match=r"expected results of the same settings, found some of use None; give another --out"
    ):
        Batch(sources, out, replace(settings, use=("depth",)))
    for broken in (b"{", b"\0\0", b"\xff[]", b""):
        for name in ("settings.json", "summary.csv"):
            (tmp_path / "out" / name).write_bytes(broken)
        mended = Batch(sources, out, settings)
        assert [job.name for job in mended.jobs] == ["two", "three", "four"] and mended.rows.keys() == {"one"}
        assert len(mended.notes) == 2 and (tmp_path / "out" / "summary.csv.damaged").read_bytes() == broken
        assert json.loads((tmp_path / "out" / "settings.json").read_text())["people"] == 1


@storing
def test_a_recording_that_takes_too_long_has_failed(job, monkeypatch):
    row = do(replace(job, limit_s=0.05))
    assert row.status == FAILED and "the time limit" in row.error and not Store(job.out).recordings()
    monkeypatch.setattr(task, "_GRACE_S", 0.0)
    child = os.fork()
    if not child:  # it hangs where nothing looks at the time
        monkeypatch.setattr(task, "_track", lambda *_: time.sleep(60))
        do(replace(job, limit_s=0.1))
        os._exit(0)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 1


@pytest.mark.parametrize("missing", ["cryptography", "distributed", "fsspec", "pyarrow"])
def test_a_missing_package_is_named_before_anything_is_written(tmp_path, monkeypatch, missing):
    for name in ("cryptography", "distributed", "fsspec", "pyarrow"):
        monkeypatch.setitem(sys.modules, name, None if name == missing else ModuleType(name))
        if name != missing:
            monkeypatch.setattr(sys.modules[name], "__spec__", ModuleSpec(name, None))
    done = CliRunner().invoke(app, ["batch", str(sample_path()), "--out", str(tmp_path / "out")])
    assert done.exit_code == 1 and not list(tmp_path.iterdir())
    assert f"found no {missing}; pip install 'voodoo-tracker[batch]'" in done.stderr


def test_what_is_missing_is_reported_before_the_work(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(VoodooError, match=r"pip install 'voodoo-tracker\[batch\]'"):
        next(engine.run([], workers=1))
    monkeypatch.setitem(sys.modules, "fsspec.core", None)
    done = CliRunner().invoke(app, ["batch", str(sample_path()), "--out", str(tmp_path / "out")])
    assert done.exit_code == 1 and "pip install 'voodoo-tracker[batch]'" in done.stderr
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(VoodooError, match=r"pip install 'voodoo-tracker\[batch\]'"):
        encode([], {})
    done = CliRunner().invoke(app, ["batch", str(tmp_path / "nothing"), "--out", str(tmp_path / "out")])
    assert done.exit_code == 1 and "expected a recording or a folder of recordings" in done.stderr
