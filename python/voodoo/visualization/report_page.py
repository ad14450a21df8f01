"""A result as one web page without network: the skeleton with a timeline, status, joint angles, and how sure the joints are.

Plotly is an optional extra: `pip install 'voodoo-tracker[report]'`.
"""

from __future__ import annotations

import math
from base64 import b64encode
from collections import Counter
from collections.abc import Mapping
from html import escape
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from voodoo.errors import VoodooError, installed, naming
from voodoo.export.skeleton import mean_interval
from voodoo.export.track import Track
from voodoo.measurements import ASSUMED_RATE_HZ, FloatArray
from voodoo.recordings.videos import opened_video
from voodoo.visualization.image_writer import small_film

_LINES = (
    ("humanoid_root", "vc7", "skullbase", "head_center", "skull_tip"),
    *(("vc7", *(f"{side}_{joint}" for joint in ("shoulder", "elbow", "wrist", "hand"))) for side in "lr"),
    *(("humanoid_root", *(f"{side}_{joint}" for joint in ("hip", "knee", "ankle", "toe"))) for side in "lr"),
)
"""Joints of the default humans that are drawn as lines; a body with other joints is drawn as points."""
_MOST_FRAMES = 300
"""Frames of the animation; more make the page slow."""
_MOST_PIXELS = 600_000
"""Pixels of a picture of the film: one of two cameras side by side is 480 high, which is half a screen."""
_TOGETHER = """<script>
const film = document.getElementById("film");
for (const plot of document.querySelectorAll(".js-plotly-plot"))
  plot.on("plotly_animatingframe", (shown) => { if (film.paused) film.currentTime = parseFloat(shown.name); });
</script>"""
"""The film goes with the timeline of the last person that is moved."""
_COLORS = ("#636efa", "#ef553b", "#00a878", "#ab63fa", "#e07b1f", "#0f9bb8", "#d6408b", "#6a8f1f")
_LIMB_COLORS = {"measured": "#2a9d4e", "inferred": "#f2b134", "lost": "#c0392b", "": "#eeeeee"}


def report_page(name: str, tracks: Mapping[str, Track], *, film: Path | None = None) -> str:
    """The page, with a section for each person.

    Args:
        name: title.
        tracks: name of the person -> track.
        film: of the same frames, as `--overlay` writes it; it is part of the page, and goes with the timeline.

    Raises:
        VoodooError: Plotly is not installed, stamps that do not increase, or a film that cannot be read.
    """
    installed("plotly", "a report needs Plotly, which is not installed: pip install 'voodoo-tracker[report]'")
    parts = [f"<!DOCTYPE html><html lang=en><meta charset=utf-8><title>{escape(name)}</title>"]
    parts += [f"<body style='font:15px sans-serif;margin:1.5em'><h1>{escape(name)}</h1>"]
    if film is not None:
        data = b64encode(playable(film)).decode("ascii")
        style = "display:block;max-width:100%;max-height:45vh"
        parts.append(f"<video id=film controls muted style='{style}' src='data:video/webm;base64,{data}'></video>")
    for number, (person, track) in enumerate(tracks.items()):
        figure = _figure(track).to_html(
            full_html=False, include_plotlyjs=number == 0, auto_play=False, config={"displaylogo": False}
        )
        parts.append(f"<h2>{escape(person)}</h2><p>{escape(_words(track))}</p>{figure}")
    return "\n".join([*parts, _TOGETHER if film is not None else "", "</body></html>", ""])


def playable(film: Path) -> bytes:
    """A film as a WebM, which browsers play, in the size that a page shows.

    Raises:
        VoodooError: it cannot be read, or a WebM cannot be written.
    """
    source = opened_video(film)
    readable, picture = source.read()
    if not readable:
        raise VoodooError(f"{film}: expected a film, found none that can be read")
    scale = min(1.0, math.sqrt(_MOST_PIXELS / (picture.shape[0] * picture.shape[1])))
    height, width = (max(round(scale * size / 2) * 2, 2) for size in picture.shape[:2])
    with TemporaryDirectory() as folder, naming(film, VoodooError):
        place = Path(folder) / "film.webm"
        rate = source.get(cv2.CAP_PROP_FPS) or ASSUMED_RATE_HZ
        writer = small_film(place, (height, width, 3), rate_hz=rate)
        while readable:
            small = cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA)
            writer.write(small.astype(np.uint8, copy=False))
            readable, picture = source.read()
        writer.release()
        source.release()
        return place.read_bytes()


def _words(track: Track) -> str:
    statuses = ", ".join(f"{count} {word}" for word, count in Counter(track.status).most_common())
    seconds = track.stamps[-1] - track.stamps[0]
    left_out = ", ".join(f"{count} {reason}" for reason, count in track.left_out.items()) or "nothing"
    rate = 1.0 / mean_interval(track.stamps)
    return f"{len(track)} frames in {seconds:.1f} s ({rate:.1f} a second): {statuses}. Left out: {left_out}."


def _figure(track: Track) -> Any:  # noqa: ANN401 - Plotly
    from plotly import graph_objects as go
    from plotly.subplots import make_subplots

    limbs = "limbs: measured (green), inferred (yellow), lost (red)"
    titles = (
        "",
        limbs,
        "joint angles with one standard deviation [deg]",
        "standard deviation of joints [m]",
        "residual [m]",
    )
    figure = make_subplots(
        rows=4, cols=2, column_widths=[0.45, 0.55], row_heights=[0.34, 0.26, 0.2, 0.2], vertical_spacing=0.06,
        subplot_titles=titles, specs=[[{"type": "scene", "rowspan": 4}, {}], *[[None, {}]] * 3],
    )  # fmt: skip
    times = _single(track.stamps - track.stamps[0])
    paths = _single(_paths(track))
    figure.add_trace(_drawn(paths[0]), row=1, col=1)
    words = list(_LIMB_COLORS)
    codes = [[words.index(word) if word in words else 3 for word in one] for one in track.limb_status.values()]
    scale = [[place, color] for i, color in enumerate(_LIMB_COLORS.values()) for place in (i / 4, (i + 1) / 4)]
    if codes:
        names, text = list(track.limb_status), list(track.limb_status.values())
        heatmap_style: dict[str, Any] = {"colorscale": scale, "zmin": -0.5, "zmax": 3.5, "showscale": False}
        figure.add_trace(
            go.Heatmap(x=times, y=names, z=codes, text=text, hoverinfo="x+y+text", **heatmap_style), row=1, col=2
        )
    joints = track.joint_names[: track.joint_sigma.shape[1]]
    angles, sigmas = _single(np.degrees(track.angles)), _single(np.degrees(track.angle_sigma))
    for number, (name, column) in enumerate(zip(track.angle_names, angles.T, strict=True)):
        color = _COLORS[number % len(_COLORS)]
        how: dict[str, Any] = {"mode": "lines", "showlegend": False, "line": {"color": color}}
        if sigmas.size:
            around = sigmas[:, number]
            known = np.isfinite(column) & np.isfinite(around)
            edge = np.concatenate([(column - around)[known], (column + around)[known][::-1]])
            there = np.concatenate([times[known], times[known][::-1]])
            band: dict[str, Any] = {"fill": "toself", "fillcolor": color, "opacity": 0.12, "line": {"width": 0}}
            figure.add_trace(go.Scatter(x=there, y=edge, hoverinfo="skip", showlegend=False, **band), row=2, col=2)
            how |= {"customdata": around, "hovertemplate": "%{y:.1f} ± %{customdata:.1f}"}
        figure.add_trace(go.Scatter(x=times, y=column, name=name, **how), row=2, col=2)
    for name, column in zip(joints, _single(track.joint_sigma).T, strict=True):
        figure.add_trace(go.Scatter(x=times, y=column, name=name, mode="lines", showlegend=False), row=3, col=2)
    figure.add_trace(go.Scatter(x=times, y=_single(track.residual), mode="lines", showlegend=False), row=4, col=2)
    chosen = np.unique(np.linspace(0, len(track) - 1, min(len(track), _MOST_FRAMES)).round().astype(int))
    figure.frames = [
        go.Frame(data=[_drawn(paths[index])], traces=[0], name=f"{times[index]:.2f}", layout=_cursor(times[index]))
        for index in chosen
    ]
    steps = [{"label": one.name, "method": "animate", "args": [[one.name], _how(0)]} for one in figure.frames]
    pause = 1000.0 * float(times[-1]) / max(len(chosen) - 1, 1)
    buttons = [
        {"label": "play", "method": "animate", "args": [None, _how(pause)]},
        {"label": "stop", "method": "animate", "args": [[None], _how(0)]},
    ]
    points = paths[np.isfinite(paths).all(axis=2)]
    low, high = (points.min(axis=0) - 0.1, points.max(axis=0) + 0.1) if len(points) else (np.zeros(3), np.ones(3))
    scene: dict[str, Any] = {"aspectmode": "data", "camera": {"eye": {"x": 3.0, "y": 1.8, "z": 0.6}}}
    scene |= {f"{axis}axis": {"range": [low[i], high[i]], "title": f"{axis} [m]"} for i, axis in enumerate("xyz")}
    for row in (2, 3, 4):
        figure.update_xaxes(matches="x", row=row, col=2)
    figure.update_yaxes(dtick=1, tickfont={"size": 9}, autorange="reversed", row=1, col=2)
    figure.update_layout(
        height=900, scene=scene, sliders=[{"steps": steps, "currentvalue": {"suffix": " s"}}],
        updatemenus=[{"type": "buttons", "direction": "left", "x": 0.0, "y": 1.05, "buttons": buttons}], **_cursor(0.0),
    )  # fmt: skip
    return figure


def _single(values: FloatArray) -> npt.NDArray[np.float32]:
    """Numbers of a drawing, which need half of the digits."""
    return values.astype(np.float32)


def _paths(track: Track) -> FloatArray:
    """(F, N, 3) corners of the lines, NaN between two lines."""
    index = {name: number for number, name in enumerate(track.joint_names)}
    lines = [[index[name] for name in line if name in index] for line in _LINES]
    gap = np.full((len(track), 1, 3), np.nan)
    known = [part for line in lines if len(line) > 1 for part in (track.joints[:, line], gap)]
    return np.concatenate(known, axis=1) if known else track.joints


def _drawn(path: npt.NDArray[np.float32]) -> Any:  # noqa: ANN401 - Plotly
    from plotly import graph_objects as go

    x, y, z = path.T
    style = {"line": {"width": 7, "color": "#2f6fb0"}, "marker": {"size": 3, "color": "#1d3f66"}}
    return go.Scatter3d(x=x, y=y, z=z, mode="lines+markers", showlegend=False, hoverinfo="skip", **style)


def _cursor(time: float | np.float32) -> dict[str, Any]:
    """A line at the time of the skeleton in all plots."""
    return {"shapes": [{"type": "line", "x0": time, "x1": time, "xref": "x", "yref": "paper", "y0": 0, "y1": 1}]}


def _how(pause: float) -> dict[str, Any]:
    """How Plotly goes on, `pause` [ms] a frame; 0: at once."""
    return {"mode": "immediate", "frame": {"duration": pause, "redraw": True}, "transition": {"duration": 0}}
