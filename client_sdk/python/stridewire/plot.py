"""Pictures of recorded walks. Notebooks display the result of `plot_walk` automatically."""

from __future__ import annotations

import numpy as np

from ._types import EventType, Foot, Recording

_MARGIN_M = 0.5
_PIXELS_PER_M = 120.0


class Picture:
    """An SVG picture."""

    def __init__(self, svg: str) -> None:
        self.svg = svg

    def _repr_svg_(self) -> str:
        return self.svg

    def save(self, path: str) -> None:
        """Writes the picture to a file."""
        with open(path, "w", encoding="utf-8") as file:
            file.write(self.svg)


def plot_walk(recording: Recording) -> Picture:
    """Draws the path of the root and the positions where feet landed, seen from above.

    +z is to the right and +x is up, so a figure with heading 0 walks to the right.
    """
    strikes = [event for event in recording.events if event.type == EventType.FOOT_STRIKE]
    path = recording.root_positions_m[:, [2, 0]].astype(np.float64)
    marks = np.array([[event.position_m[2], event.position_m[0]] for event in strikes])
    points = np.concatenate([path, marks.reshape(-1, 2)])
    if len(points) == 0:
        raise ValueError("the recording is empty")
    low = points.min(axis=0) - _MARGIN_M
    size = (points.max(axis=0) + _MARGIN_M - low) * _PIXELS_PER_M

    def at(point: np.ndarray) -> tuple[float, float]:
        right, up = (point - low) * _PIXELS_PER_M
        return round(float(right), 1), round(float(size[1] - up), 1)

    line = " ".join(f"{x},{y}" for x, y in map(at, path))
    feet = "".join(
        '<circle cx="{}" cy="{}" r="5" fill="{}"/>'.format(
            *at(mark), "#c2410c" if event.foot == Foot.LEFT else "#1d4ed8")
        for event, mark in zip(strikes, marks))
    return Picture(
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{size[0]:.0f}" height="{size[1]:.0f}">'
        '<rect width="100%" height="100%" fill="white"/>'
        f'<polyline points="{line}" fill="none" stroke="#525252" stroke-width="2"/>{feet}</svg>')
