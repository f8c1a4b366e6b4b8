"""Draw docs/walk.svg, README's picture: the sample walk over time, and what its files take.

    python -m tools.picture

The walk is that of ``mcz sample``, the sizes are measured on its BVH by this very run.
"""

from __future__ import annotations

import lzma
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import mcz
from mcz.kinematics.points import point_names
from mcz.sources.sample import write_samples

PICTURE = Path(__file__).parent.parent / "docs" / "walk.svg"
EVERY = 20  # frames from figure to figure
WIDTH, GROUND = 900, 236  # pixels; where the feet are
SCALE = 1.08  # pixels a centimeter
FIRST, STRIDE = 50, 73  # pixels: the first figure, and from each to the next
BAR_LEFT, BAR_WIDTH, BAR_TOP, BAR_STEP = 300, 470, 286, 27
LEFT, RIGHT, MIDDLE = "#d1495b", "#00798c", "#5f6b76"

Points = NDArray[np.float64]
Size = tuple[str, int, str]  # what, bytes, color


def sizes(folder: Path) -> list[Size]:
    """Bytes of the walk as text, packed by xz -9e, as ``.mcz``, and as a lossy one."""
    source = folder / "walk.bvh"
    text = source.read_bytes()
    packed = lzma.compress(text, preset=9 | lzma.PRESET_EXTREME)
    mcz.encode(source, folder / "walk.mcz", unit="cm")
    mcz.encode(
        source, folder / "lossy.mcz", unit="cm", codec="lossy", params={"mean_error_cm": 0.1}
    )
    return [
        ("walk.bvh, the text", len(text), "#9aa5b1"),
        ("xz -9e, every byte back", len(packed), "#9aa5b1"),
        ("walk.mcz, every byte back", (folder / "walk.mcz").stat().st_size, "#2e7d32"),
        ("walk.mcz, lossy: mean 0.1 cm off", (folder / "lossy.mcz").stat().st_size, "#66a868"),
    ]


def bones(skeleton: mcz.Skeleton) -> list[tuple[int, int, str]]:
    """The points at both ends of each line, and its color: left, right or middle."""
    place = {name: number for number, name in enumerate(point_names(skeleton))}
    found = []
    for joint in skeleton.joints:
        side = LEFT if joint.name.startswith("Left") else MIDDLE
        color = RIGHT if joint.name.startswith("Right") else side
        if joint.parent >= 0:
            parent = skeleton.joints[joint.parent].name
            found.append((place[parent], place[joint.name], color))
        if f"{joint.name} end" in place:
            found.append((place[joint.name], place[f"{joint.name} end"], color))
    return sorted(found, key=lambda line: (RIGHT, MIDDLE, LEFT).index(line[2]))


def figures(motion: mcz.Motion) -> Iterator[str]:
    """A stick figure for every so many frames, seen from its left side, walking to the right."""
    points = mcz.positions(motion)[::EVERY]  # (figures, points, x y z), y up, z ahead
    names = point_names(motion.skeleton)
    neck, top = names.index("Head"), names.index("Head end")
    floor = points[..., 1].min()
    for number, figure in enumerate(points):
        x0 = FIRST + number * STRIDE
        x = x0 + SCALE * (figure[:, 2] - figure[0, 2])
        y = GROUND - SCALE * (figure[:, 1] - floor)
        for a, b, color in bones(motion.skeleton):
            yield f'<path d="M{x[a]:.1f} {y[a]:.1f}L{x[b]:.1f} {y[b]:.1f}" stroke="{color}"/>'
        middle = f'cx="{(x[neck] + x[top]) / 2:.1f}" cy="{(y[neck] + y[top]) / 2:.1f}"'
        yield f'<circle {middle} r="11" fill="{MIDDLE}"/>'
        seconds = number * EVERY / float(motion.frame_rate or 1)
        yield f'<text x="{x0}" y="{GROUND + 20}" text-anchor="middle">{seconds:.2f} s</text>'


def bars(measured: list[Size]) -> Iterator[str]:
    """A bar for each size, its number behind it."""
    most = max(size for _, size, _ in measured)
    for place, (what, size, color) in enumerate(measured):
        y = BAR_TOP + place * BAR_STEP
        width = BAR_WIDTH * size / most
        yield f'<text x="{BAR_LEFT - 12}" y="{y + 14}" text-anchor="end">{what}</text>'
        yield f'<rect x="{BAR_LEFT}" y="{y}" width="{width:.1f}" height="18" fill="{color}"/>'
        yield f'<text x="{BAR_LEFT + width + 8:.1f}" y="{y + 14}">{size:,} bytes</text>'


def picture() -> str:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_samples(folder)
        measured = sizes(folder)
        drawn = list(figures(mcz.read(folder / "walk.bvh")))
    height = BAR_TOP + len(measured) * BAR_STEP + 10
    return "\n".join(
        [
            (
                f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" '
                'font-family="sans-serif" font-size="14" fill="#24292f">'
            ),
            "<title>Two seconds of walking, and the bytes that they take</title>",
            f'<rect width="{WIDTH}" height="{height}" fill="#ffffff"/>',
            f'<path d="M14 {GROUND + 1}H{WIDTH - 14}" stroke="#c4ccd4"/>',
            '<g stroke-width="4" stroke-linecap="round">',
            *(line for line in drawn if "stroke" in line),
            "</g>",
            *(line for line in drawn if "stroke" not in line),
            *bars(measured),
            "</svg>\n",
        ]
    )


if __name__ == "__main__":
    PICTURE.write_text(picture(), "utf-8")
    print(PICTURE)
