"""Khan 2016's figures beside ours: Fig. 7 and Table 4 (thresholds), Fig. 8 (resolutions).

    python tools/khan2016.py FOLDER [CLIP...]

FOLDER has CMU's .amc files with their .asf. Clips of the paper come with the paper's figures,
others without. CR counts the .amc alone, over payload and overhead.
"""

from __future__ import annotations

import io
import sys
import time
from pathlib import Path

import numpy as np

import mcz
from mcz.angles import unwrap
from mcz.sizes import clip_sizes

# Read off Fig. 7: threshold -> (CR, rms coordinate error).
PAPER = {
    "17_10": {
        10: (61.6, 0.1948),
        11: (63.3, 0.1992),
        12: (64.5, 0.2041),
        15: (67.7, 0.2086),
        20: (71.0, 0.2216),
        30: (74.6, 0.2338),
        45: (76.5, 0.2424),
        50: (76.9, 0.2567),
    },
    "15_04": {
        2: (81.5, 0.083),
        3: (99.1, 0.095),
        4: (111.8, 0.102),
        5: (121.1, 0.106),
        6: (129.3, 0.112),
        8: (140.3, 0.121),
        10: (147.9, 0.130),
        12: (153.3, 0.139),
    },
    "17_08": {
        4: (87.3, 0.129),
        5: (96.7, 0.136),
        8: (115.7, 0.146),
        10: (124.3, 0.152),
        12: (130.1, 0.159),
        14: (135.2, 0.161),
        16: (138.4, 0.166),
        18: (141.6, 0.172),
        20: (143.7, 0.174),
    },
    "85_12": {
        6: (51.0, 0.168),
        8: (54.9, 0.194),
        10: (58.1, 0.212),
        11: (59.3, 0.217),
        12: (60.5, 0.225),
        15: (63.5, 0.239),
        20: (67.7, 0.256),
        25: (70.3, 0.273),
        30: (72.4, 0.281),
    },
}
FIG_8 = {0: 0.103, 2: 0.658, 3: 4.699}  # finest levels left out -> MSE of 09_01, rfoot rx
DEFAULT_CLIPS = ("17_10", "14_02", "135_02", "13_29", "49_02", "01_01", "15_04", "17_08", "85_12")


def row(path: Path, motion: mcz.Motion, T_g: float) -> tuple[float, mcz.Comparison, float, float]:
    """CR, figures, and frames a second of writing a file and of reading it."""
    out = io.BytesIO()
    start = time.perf_counter()
    mcz.write(motion, out, codec="mrdwt", preset="khan2016", T_g=T_g)
    written = time.perf_counter()
    with mcz.open(out.getvalue()) as file:
        clip = file.only_clip()
        clip.read()
        read = time.perf_counter()
        sizes = clip_sizes(file.container, clip)
        figures = mcz.compare(motion, clip.motion())
    ratio = path.stat().st_size / (sizes.payload + sizes.overhead)
    n_frames = motion.n_frames
    return ratio, figures, n_frames / (written - start), n_frames / (read - written)


def table(path: Path) -> None:
    motion = mcz.read(path)
    print(f"\n{path.stem}: {motion.n_frames} frames, {path.stat().st_size:,} bytes")
    print("T_g   CR      paper  times   eps_d    paper   mean unit  mean cm  write f/s   read f/s")
    paper = PAPER.get(path.stem, dict.fromkeys(PAPER["17_10"], (None, None)))
    for T_g, (cr, eps) in paper.items():
        ratio, found, encode, decode = row(path, motion, T_g)
        beside = f"{cr:6.1f} {ratio / cr:6.2f}" if cr else f"{'':13}"
        error = f"{eps:7.4f}" if eps else f"{'':7}"
        print(
            f"{T_g:<5} {ratio:6.2f} {beside}  {found.rms_coordinate_error:7.5f} {error}  "
            f"{found.mean_position_error:9.4f} {found.mean_position_error_cm:8.3f} "
            f"{encode:10,.0f} {decode:10,.0f}"
        )


def figure_8(path: Path) -> None:
    motion = mcz.read(path)
    skeleton = motion.skeleton
    column = skeleton.columns(skeleton.find("rfoot"))[0]
    wanted = unwrap(motion.values, skeleton)[:, column]
    out = io.BytesIO()
    mcz.write(motion, out, codec="mrdwt", preset="khan2016", threshold_rule="flat", T_g=1)
    print(f"\n{path.stem}, rfoot rx, flat threshold 1")
    for resolution in range(4):
        with mcz.open(out.getvalue()) as file:
            clip = file.only_clip()
            before = file.container.source.n_bytes
            values = clip.read(joints=["rfoot"], resolution=resolution)[:, 0]
            joint_bytes = file.container.source.n_bytes - before
        with mcz.open(out.getvalue()) as file:
            before = file.container.source.n_bytes
            file.only_clip().read(resolution=resolution)
            all_bytes = file.container.source.n_bytes - before
        error = float(np.mean((values - wanted) ** 2))
        paper = FIG_8.get(resolution)
        beside = f"paper {paper}" if paper else ""
        print(
            f"resolution {resolution}: MSE {error:.4f} {beside}  bytes read of the joint "
            f"{joint_bytes:,}, of all joints {all_bytes:,}"
        )


def main() -> None:
    folder = Path(sys.argv[1])
    for name in sys.argv[2:] or DEFAULT_CLIPS:
        if (path := folder / f"{name}.amc").exists():
            table(path)
    if (path := folder / "09_01.amc").exists():
        figure_8(path)


if __name__ == "__main__":
    main()
