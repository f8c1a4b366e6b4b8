"""Properties of the readers of source files: what is read can be kept, and comes back whole."""

from __future__ import annotations

import io
import pickle
import tempfile
import zlib
from contextlib import suppress
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

import mcz
from mcz.files.reading.faults import validate
from mcz.model.motion import Motion, Skeleton
from mcz.sources import FORMATS
from mcz.sources.sample import acclaim_walk, bvh_walk, marker_walk
from mcz.sources.text import asf
from mcz.sources.text.source import Floats
from tools.fuzz.guard import hold
from tools.fuzz.seeds import sources
from tools.vectors.build import table_files
from tools.vectors.build.mvnx_files import MvnxFile
from tools.vectors.build.pickle_files import tensor_file

FRAMES = 3  # of a sample, as a seed
STORED = 3  # one of so many motions that are read is stored, too, which takes long

WORDS = {
    "bvh": (
        "HIERARCHY ROOT JOINT OFFSET CHANNELS MOTION Frames: Xposition Yposition Zposition "
        "Xrotation Yrotation Zrotation { } 0.0 -0 1e-3 1e300 nan inf 16777217 -1.#IND 1,5 "
        "0.30000000000000004 End|Site Frame|Time:|.0083333 \\x0d\\x0a \\x09 \\xef\\xbb\\xbf"
    ),
    "asf": (
        ":version :name :units :documentation :root :bonedata :hierarchy begin end id name "
        "direction length axis dof limits order position orientation mass angle deg rad rx ry rz "
        "tx ty tz l XYZ ZYX TX RZ root (-inf inf) # 1e-014 nan \\x0d\\x0a"
    ),
    "amc": (
        ":FULLY-SPECIFIED :DEGREES :RADIANS #!OML:ASF root lowerback lfemur 1 2 3 -0 1e-014 "
        "nan 1e300 0.30000000000000004 \\x0d\\x0a \\x09"
    ),
    "npy": (
        "\\x93NUMPY descr fortran_order shape True False '<f8' '>f4' '|O' '<i8' '|b1' (3,2) (6,) "
        "() \\x00\\x00\\x00\\x00\\x00\\x00\\xf8\\x7f"
    ),
    "npz": (
        "PK\\x03\\x04 PK\\x01\\x02 PK\\x05\\x06 PK\\x06\\x06 PK\\x06\\x07 PK\\x07\\x08 "
        "poses.npy trans.npy root_orient.npy times.npy mocap_framerate.npy "
        "\\xff\\xff\\xff\\xff \\x01\\x00\\x10\\x00"
    ),
    "torch": "PK\\x03\\x04 PK\\x01\\x02 ctorch._utils\\x0a_rebuild_tensor_v2\\x0a FloatStorage Q",
    "pickle": (
        "\\x80\\x04 \\x8c\\x05numpy ccopyreg _reconstruct\\x0a NumpyArrayWrapper dof_pos fps "
        "C\\x10 K\\x03 \\x85 \\x86 \\x94 R b h\\x01 ( t }( u ] e \\x93 "
        "\\x95\\x00\\x01\\x00\\x00\\x00\\x00\\x00\\x00"
    ),
    "c3d": (
        "POINT ANALOG USED SCALE RATE DATA_START FRAMES LABELS LABELS2 DESCRIPTIONS UNITS OFFSET "
        "GEN_SCALE FORMAT UNSIGNED SIGNED TRIAL ACTUAL_START_FIELD ACTUAL_END_FIELD EVENT "
        "\\x02\\x50 \\x54 \\x55 \\x56 \\xff\\xff \\x00\\x80 \\x00\\x00\\x80\\x3f"
    ),
    "mvnx": (
        "<!DOCTYPE|mvnx|[<!ENTITY|a|'b'>]> <mvnx> <subject|frameRate='60'> <segments> <frames> "
        "</frames> <frame|type='normal'> </frame> <orientation> </orientation> <position> "
        "</position> <![CDATA[ ]]> <!-- --> <?a?> &a; &#48; index='7' time='17' tc='10:00:00;01' "
        "label='Pelvis' nan \\x0d\\x0a"
    ),
    "trc": (
        "PathFileType DataRate CameraRate NumFrames NumMarkers Units Frame# Time X1 Y1 Z1 mm m "
        "\\x09 \\x0d\\x0a \\x0a\\x0a NaN nan -2.73E-01 1e300 599.793890 0.008 1547.538452148438 1,5"
    ),
    "mot": (
        "version=1 nRows= nColumns= datarows inDegrees=yes endheader time \\x09 \\x0d\\x0a nan NaN "
        "0.50170000000000003000 \\x09|||||| 9.669363727051634438e-03 1e300 -0 1,2,3 ;"
    ),
    "sto": (
        "DataType=Vec3 DataType=Quaternion DataRate=100 version=3 endheader time \\x09 , 0,0,0 "
        "0.8304999999999999 nan \\x0a\\x0a -1 1e-320 1e300 \\x00 \\x01 \\x03"
    ),
    "csv": (
        "Format|Version,1.21 Rotation|Type,XYZ Length|Units,Meters Coordinate|Space,Local "
        "Frame,Time Frame,Sub|Frame Devices Trajectories Segments Model|Outputs Rotation Position "
        "Marker|Quality ,X,Y,Z ,,,, ; \\x09 \\x0d\\x0a \\x0a\\x0a \\x22 \\x22\\x22 "
        "NA nan 1,5 -0 1e300 1e-320 time_ms frame \\xef\\xbb\\xbf"
    ),
}


def words(name: str) -> list[str]:
    """Words of the format ``name`` that mutations put in."""
    return [word.replace("|", " ") for word in WORDS[name].split()]


def seeds(name: str) -> dict[str, bytes]:
    """Small files of the format ``name``: a few frames of the samples, and what vectors restore."""
    return {f"{name}-sample": _sample(name)} | sources(name)


def _sample(name: str) -> bytes:
    if name in ("npy", "npz", "pickle", "torch"):
        return _array_sample(name)
    if name == "asf":
        return asf.write(acclaim_walk().skeleton)
    if name == "csv":
        return table_files.VICON
    if name == "mvnx":
        return MvnxFile(n_frames=FRAMES).text()
    walk = {"amc": acclaim_walk, "c3d": marker_walk, "trc": marker_walk}.get(name, bvh_walk)()
    signal = walk.signals[0]
    mask = None if signal.mask is None else signal.mask[:FRAMES]
    cut = replace(signal, values=signal.values[:FRAMES], mask=mask)
    return FORMATS[name].write(replace(walk, signals=(cut,), source=None))


def _array_sample(name: str) -> bytes:
    numbers = np.arange(12.0).reshape(FRAMES, 4) / 7
    buffer = io.BytesIO()
    if name == "npy":
        np.save(buffer, numbers)
    elif name == "pickle":
        pickle.dump({"dof_pos": numbers, "fps": 30}, buffer, protocol=4)
    elif name == "torch":
        buffer.write(tensor_file(numbers.astype("<f4")))
    else:
        np.savez(buffer, poses=numbers, fps=30, times=np.arange(FRAMES) / 30)
    return buffer.getvalue()


def check_npy(data: bytes) -> bool:
    return _check("npy", data)


def check_npz(data: bytes) -> bool:
    return _check("npz", data)


def check_pickle(data: bytes) -> bool:
    return _check("pickle", data)


def check_torch(data: bytes) -> bool:
    return _check("torch", data)


def check_bvh(data: bytes) -> bool:
    return _check("bvh", data)


def check_c3d(data: bytes) -> bool:
    return _check("c3d", data)


def check_trc(data: bytes) -> bool:
    return _check("trc", data)


def check_mot(data: bytes) -> bool:
    return _check("mot", data)


def check_sto(data: bytes) -> bool:
    return _check("sto", data)


def check_mvnx(data: bytes) -> bool:
    return _check("mvnx", data)


def check_csv(data: bytes) -> bool:
    return _check("csv", data)


def check_amc(data: bytes) -> bool:
    """Check an AMC alone, and with the first skeleton that fits."""
    for bones in _bones():
        with suppress(mcz.SourceError):
            return _check("amc", data, bones)
    return _check("amc", data)


@cache
def _bones() -> list[Skeleton]:
    return [asf.read(data, "bones") for data in seeds("asf").values()]


def _check(name: str, data: bytes, *skeleton: Skeleton) -> bool:
    read = FORMATS[name].read
    rows = _parse_rows(name, data, *skeleton)
    motion: Motion = read(data, "fuzz", *skeleton)
    hold(same(motion, read(data, "fuzz", *skeleton)), "read twice, it differs")
    hold(FORMATS[name].write(motion) == data, "written again, it differs")
    if rows is not None:
        hold(np.array_equal(rows, motion.values, equal_nan=True), "line by line, it differs")
    if zlib.crc32(data) % STORED:
        return True
    out = io.BytesIO()
    mcz.write(motion, out)
    with mcz.open(out.getvalue()) as file:
        clip = file.only_clip()
        hold(clip.source_bytes() == data, "restored, it differs")
        hold(same(motion, clip.motion()), "stored, the motion differs")
        hold(not validate(file), "stored, the file is not valid")
    return True


def _parse_rows(name: str, data: bytes, *skeleton: Skeleton) -> Floats | None:
    """The rows of a text that is read line by line, None where it cannot be."""
    arrive = FORMATS[name].arrive
    if arrive is None:
        return None
    try:
        arriving = arrive(iter(io.BytesIO(data)), *skeleton)
        rows = [row for _, row in arriving.frames]
    except mcz.MczError:
        return None
    return np.array(rows).reshape(len(rows), arriving.skeleton.n_channels)


def check_asf(data: bytes) -> bool:
    """By way of a file, as a skeleton is kept under its own name."""
    skeleton = asf.read(data, "fuzz")
    hold(skeleton == asf.read(data, "fuzz"), "read twice, it differs")
    hold(asf.write(skeleton) == data, "written again, it differs")
    out = io.BytesIO()
    with tempfile.TemporaryDirectory(prefix="mcz-fuzz-") as folder:
        path = Path(folder, "fuzz.asf")
        path.write_bytes(data)
        mcz.encode(path, out)
    with mcz.open(out.getvalue()) as file:
        ((id_, stored),) = file.skeletons
        hold(file.skeleton_bytes(id_) == data, "restored, it differs")
        hold(stored.joints == skeleton.joints, "stored, the joints differ")
        hold(not validate(file), "stored, the file is not valid")
    return True


def same(one: Motion, other: Motion) -> bool:
    """True if two motions agree in all facts, each value to the bit."""
    facts = [
        (m.frame_rate, m.frame_rate_exact, m.metadata, m.skeleton.joints) for m in (one, other)
    ]
    numbers = [m.frame_numbers if m.frame_numbers is not None else () for m in (one, other)]
    return (
        facts[0] == facts[1]
        and np.array_equal(*numbers)
        and len(one.signals) == len(other.signals)
        and all(map(_same_signal, one.signals, other.signals))
    )


def _same_signal(one: mcz.Signal, other: mcz.Signal) -> bool:
    masks = [np.ones(s.values.shape, bool) if s.mask is None else s.mask for s in (one, other)]
    return (
        one.values.dtype == other.values.dtype
        and one.values.shape == other.values.shape
        and one.values.tobytes() == other.values.tobytes()
        and np.array_equal(*masks)
        and (one.name, one.samples_per_frame) == (other.name, other.samples_per_frame)
    )
