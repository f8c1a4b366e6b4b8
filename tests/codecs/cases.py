"""Settings of every codec for the contract suite, and the errors that they allow."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np

import mcz
from mcz.codecs import codec_by_name
from mcz.codecs.contract import Codec
from mcz.kinematics.angles import unwrap
from tests.codecs.lossy import Direct, markers, random_walks
from tests.motions import smooth


@dataclass(frozen=True)
class Case:
    """A codec with settings; ``error``: the most by which a value of ``smooth`` may be off."""

    name: str
    error: float = 0.0
    params: Mapping[str, Any] = field(default_factory=dict)
    segments: str = "segment_frames"  # the parameter that cuts a clip into segments
    is_free: bool = False  # values do not depend on where segments end

    @property
    def codec(self) -> Codec:
        return codec_by_name(self.name)

    @property
    def of_points(self) -> bool:
        """Return whether points are coded in place of channels."""
        return self.codec.positions and self.params.get("domain") != "channels"

    def length(self, n_frames: int) -> dict[str, Any]:
        return {self.segments: n_frames}


def wavelet(name: str, error: float, **params: Any) -> Case:
    return Case(name, error, params, is_free=True)


POINT = {"step": 0.5}
PREFIX, WINDOW = {"coder": "prefix"}, {"window": 16}
CHANNELS = {"step": 0.1, "domain": "channels"}
CASES = {
    "raw": Case("raw"),
    "fast": Case("fast"),
    "best": Case("best"),
    "overlap": Case("overlap", 1e-12, {}, "length"),
    "mrdwt": wavelet("mrdwt", 4, T_g=1.0, N=2, wavelet="db2"),
    "mrdwt-decimals": wavelet("mrdwt", 3, T_g=1.0, Q=1, N=2, wavelet="db2"),
    "mrdwt-inline": wavelet("mrdwt", 4, T_g=1.0, N=1, wavelet="coif1"),
    "mrdwt-khan2016": wavelet("mrdwt", 12, preset="khan2016"),
    "dwt": wavelet("dwt", 2, t_w=1.0, N=2, wavelet="db2"),
    "dwt-khan2014": wavelet("dwt", 4, preset="khan2014"),
    "awt": wavelet("awt", 6, a_w=8, N=2, wavelet="db2", Q=1),
    "awt-khan2014": wavelet("awt", 2, preset="khan2014"),
    "qbc": Case("qbc", 2**0.5 + 0.3, {"d2_lmt": 2.0, "delta": 6}, is_free=True),
    "qbc-decimals": Case("qbc", 1.1, {"d2_lmt": 1.0, "delta": 10, "Q": 1}, is_free=True),
    "qbc-marks": Case("qbc", 0.5, {"delta": 1}, is_free=True),
    "qbc-khan2014": Case("qbc", 2.1, {"preset": "khan2014"}, is_free=True),
    "qbc-fewest": Case("qbc", 1.1, {"breaks": "fewest", "delta": 12}, is_free=True),
    "pca": Case("pca", 4, {"q": 8}),
    "pca-decimals": Case("pca", 0.3, {"q": 99, "Q": 1}),
    "pca-khan2014": Case("pca", 4, {"preset": "khan2014", "q": 8, "Q": 1}),
    "lsdt-frame": Case("lsdt-frame", 1, POINT),
    "lsdt-frame-prefix": Case("lsdt-frame", 1, POINT | PREFIX | {"basis": "cosines"}),
    "lsdt-frame-channels": Case("lsdt-frame", 1, CHANNELS),
    "lsdt-clip": Case("lsdt-clip", 1, POINT | WINDOW),
    "lsdt-clip-prefix": Case("lsdt-clip", 1, POINT | WINDOW | PREFIX),
    "mdtt": Case("mdtt", 1, POINT | WINDOW),
    "mdtt-prefix": Case("mdtt", 1, POINT | WINDOW | PREFIX),
    "mdtt-channels": Case("mdtt", 1, CHANNELS | WINDOW),
    "pca-rdo": Case("pca-rdo", 1, POINT | WINDOW),
    "pca-rdo-prefix": Case("pca-rdo", 1, POINT | WINDOW | PREFIX),
    "online": Case("online", 1, POINT | {"gof": 5, "intra_period": 2}),
    "online-golomb": Case("online", 1, POINT | {"gof": 5, "coder": "golomb", "basis": "cosines"}),
    "online-reordered": Case("online", 1, POINT | {"gof": 5, "order": "reordered"}),
    "online-rate": Case("online", np.inf, {"preset": "rc", "bitrate": 20.0}),
    "posewave": Case("posewave", 6, {"step": 0.1, "levels": 2}),
    "posewave-fine": Case("posewave", 3, {"step": 0.05, "levels": 0}),
}


def write_case(motion: mcz.Motion, case: Case, **params: Any) -> bytes:
    out = io.BytesIO()
    mcz.write(motion, out, codec=case.name, **{**case.params, **params})
    return out.getvalue()


@cache
def write_smooth(name: str, n_frames: int = 100, length: int = 0) -> bytes:
    """``smooth`` of so many frames by a case, in segments of ``length`` (0: as the codec likes)."""
    case = CASES[name]
    return write_case(smooth(n_frames), case, **(case.length(length) if length else {}))


def expected_values(case: Case, motion: mcz.Motion) -> np.ndarray:
    """The values that a codec comes near to."""
    if case.codec.lossless or case.name == "overlap":
        return motion.values
    if case.of_points:
        return np.asarray(mcz.in_positions(motion).values)
    return unwrap(motion.values, motion.skeleton)


@cache
def small(name: str) -> Direct:
    """A clip of a few bytes, by the codec alone, in two segments."""
    case = CASES[name]
    motion = markers(20, 2) if case.of_points else random_walks(20, ["tx", "rx", "rz"])
    return Direct(case.name, motion, **{**case.params, **case.length(12)})
