"""Binary glTF: persons as skinned tapered cylinders on an animated skeleton, for Blender, browsers and game engines."""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from voodoo.drawing.ink import person_color
from voodoo.errors import VoodooError
from voodoo.export.conventions import Y_UP_LEFT, names_of
from voodoo.export.skeleton import Bone, held, mean_interval, placed_on_parents, skeleton
from voodoo.export.track import Track
from voodoo.measurements import FloatArray
from voodoo.model.body import Body
from voodoo.model.projection import limb_mesh
from voodoo.model.rotations import quaternions
from voodoo.whole import appearing_whole

_COMPONENTS = {"<f4": 5126, "<u4": 5125, "u1": 5121}
_VERTICES, _INDICES = 34962, 34963


def write_glb(path: str | Path, people: Mapping[str, tuple[Track, Body]]) -> None:
    """Write an animation of one or more persons; each appears while it is tracked.

    Axes are those of glTF: X left, Y up, Z forward; meters; time from the first frame of all. Nodes of bones have the names of
    limbs (and `extras.vrm`), below a node named after the person, which is scaled to zero in frames without a pose. At rest all
    bones have the identity rotation: they turn as `Skeleton.local` says.

    Args:
        path: .glb file.
        people: name -> track with limb poses, in a frame whose z points up, and body in the sizes it was tracked with.

    Raises:
        VoodooError: a track has no limb poses or is of another body, a body of more than 256 limbs, or stamps that do not
            increase.
        OSError: the file cannot be written.
    """
    file = _File()
    start = min((float(track.stamps[0]) for track, _ in people.values()), default=0.0)
    for number, (name, (track, body)) in enumerate(people.items(), start=1):
        color = tuple(channel / 255.0 for channel in reversed(person_color(number)))  # BGR
        file.add_person(name, track, body, color, start)
    with appearing_whole(Path(path)) as place:
        place.write_bytes(file.content())


class _File:
    """The scene, and its binary part."""

    def __init__(self) -> None:
        self._bytes = bytearray()
        self._scene: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "voodoo"},
            "scene": 0,
            "scenes": [{}],
        }
        self._animation: dict[str, Any] = {"name": "track", "samplers": [], "channels": []}

    def _add(self, kind: str, item: dict[str, Any]) -> int:
        self._scene.setdefault(kind, []).append(item)
        return len(self._scene[kind]) - 1

    def _array(self, values: npt.ArrayLike, kind: str, target: int | None = None, *, of: str = "<f4") -> int:
        """Add an accessor of numbers that are stored as `of`; `kind` is glTF's word for the shape of an element."""
        values = np.ascontiguousarray(values, dtype=of)
        view: dict[str, Any] = {"buffer": 0, "byteOffset": len(self._bytes), "byteLength": values.nbytes}
        self._bytes += values.tobytes() + b"\0" * (-values.nbytes % 4)
        accessor: dict[str, Any] = {
            "bufferView": self._add("bufferViews", view | ({"target": target} if target else {})),
            "componentType": _COMPONENTS[of],
            "count": len(values),
            "type": kind,
        }
        if kind in ("SCALAR", "VEC3") and of == "<f4":
            rows = values.reshape(len(values), -1)
            accessor |= {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
        return self._add("accessors", accessor)

    def _animate(self, node: int, path: str, times: int, values: FloatArray, *, step: bool = False) -> None:
        kind = "VEC4" if path == "rotation" else "VEC3"
        sampler = {"input": times, "output": self._array(values, kind), "interpolation": "STEP" if step else "LINEAR"}
        self._animation["samplers"].append(sampler)
        target = {"sampler": len(self._animation["samplers"]) - 1, "target": {"node": node, "path": path}}
        self._animation["channels"].append(target)

    def add_person(self, name: str, track: Track, body: Body, color: tuple[float, ...], start: float) -> None:
        """Add nodes, skin, mesh and animation of a person; `start` [s] is the time zero."""
        mean_interval(track.stamps)  # rejects stamps that do not rise
        if len(body.limbs) > 256:
            raise VoodooError(f"body: expected at most 256 limbs for .glb, found {len(body.limbs)}")
        posed = held(skeleton(track, body), track.found)
        parts = posed.bones
        offsets, still, moving = placed_on_parents(posed, track.found)
        first = len(self._scene.get("nodes", []))
        for index, bone in enumerate(parts):
            below = [first + child for child, other in enumerate(parts) if other.parent == index]
            vrm = names_of(bone.name).vrm
            node = {"name": bone.name, "translation": (Y_UP_LEFT @ still[index]).tolist()}
            extras = {"extras": {"vrm": vrm[0].lower() + vrm[1:]}} if vrm else {}
            self._add("nodes", node | extras | ({"children": below} if below else {}))
        inverse = np.tile(np.eye(4), (len(parts), 1, 1))
        inverse[:, 3, :3] = [-(Y_UP_LEFT @ bone.head) for bone in parts]  # column by column
        skin = {
            "joints": list(range(first, first + len(parts))),
            "skeleton": first,
            "inverseBindMatrices": self._array(inverse.reshape(-1, 16), "MAT4"),
        }
        visible = {"name": f"{name}_mesh", "mesh": self._mesh(body, parts, color), "skin": self._add("skins", skin)}
        person = self._add("nodes", {"name": name, "children": [first]})
        self._scene["scenes"][0].setdefault("nodes", []).extend([person, self._add("nodes", visible)])
        times = self._array(track.stamps - start, "SCALAR")
        turns = quaternions(Y_UP_LEFT @ posed.local() @ Y_UP_LEFT.T)
        for index in range(len(parts)):
            # Of the two quaternions of a rotation the one near the previous, as readers interpolate.
            ahead = np.sum(turns[1:, index] * turns[:-1, index], axis=1) < 0.0
            turns[1:, index] *= np.where(np.cumsum(ahead) % 2, -1.0, 1.0)[:, None]
            self._animate(first + index, "rotation", times, turns[:, index])
            if moving[index]:
                self._animate(first + index, "translation", times, offsets[:, index] @ Y_UP_LEFT.T)
        if not track.found.all() or track.stamps[0] > start:
            # Before and after the person's own frames, readers hold the first and the last value.
            visible_from = np.r_[0.0, track.stamps - start] if track.stamps[0] > start else track.stamps - start
            sizes = np.r_[False, track.found] if track.stamps[0] > start else track.found
            self._animate(person, "scale", self._array(visible_from, "SCALAR"), np.tile(sizes[:, None], 3), step=True)

    def _mesh(self, body: Body, bones: Sequence[Bone], color: tuple[float, ...]) -> int:
        """All limbs at rest as one mesh; each vertex follows its limb."""
        places, triangles, normals, owners = [], [], [], []
        count = 0
        for index, (limb, bone) in enumerate(zip(body.limbs, bones, strict=True)):
            vertices, faces, outward = limb_mesh(limb.shape)
            places.append((vertices - bone.head_in_limb) @ bone.rest.T + bone.head)
            normals.append(outward @ bone.rest.T)
            triangles.append(faces + count)
            owners.append(np.full(len(vertices), index, dtype=np.uint8))
            count += len(vertices)
        joints = np.zeros((count, 4), dtype=np.uint8)
        joints[:, 0] = np.concatenate(owners)
        weights = np.tile(np.array([1.0, 0.0, 0.0, 0.0]), (count, 1))
        attributes = {
            "POSITION": self._array(np.concatenate(places) @ Y_UP_LEFT.T, "VEC3", _VERTICES),
            "NORMAL": self._array(np.concatenate(normals) @ Y_UP_LEFT.T, "VEC3", _VERTICES),
            "JOINTS_0": self._array(joints, "VEC4", _VERTICES, of="u1"),
            "WEIGHTS_0": self._array(weights, "VEC4", _VERTICES),
        }
        indices = self._array(np.concatenate(triangles).reshape(-1), "SCALAR", _INDICES, of="<u4")
        surface = {"baseColorFactor": [*color, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.8}
        material = self._add("materials", {"pbrMetallicRoughness": surface})
        primitive = {"attributes": attributes, "indices": indices, "material": material}
        return self._add("meshes", {"primitives": [primitive]})

    def content(self) -> bytes:
        """The file: header, JSON, binary."""
        if self._animation["channels"]:
            self._scene["animations"] = [self._animation]
        if self._bytes:
            self._scene["buffers"] = [{"byteLength": len(self._bytes)}]
        text = json.dumps(self._scene, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text
        if self._bytes:
            chunks += struct.pack("<I4s", len(self._bytes), b"BIN\0") + self._bytes
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks
