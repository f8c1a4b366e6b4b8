"""Skeletons and frame rates as the lines that ``mcz info`` prints."""

from __future__ import annotations

from collections.abc import Iterator

from mcz.cli.common import plural
from mcz.model.types import JsonObject

DEEPEST = 90  # characters before a joint's name; what lies deeper is not indented further


def skeleton_lines(skeleton: JsonObject) -> Iterator[str]:
    yield ""
    unit = skeleton["unit_cm"]
    facts = [
        plural(skeleton["n_joints"], "joint"),
        plural(skeleton["n_channels"], "channel"),
        "unit unknown" if unit is None else f"1 unit = {unit:.6g} cm",
        f"angles in {skeleton['angle_unit'] or 'an unknown unit'}",
        f"{skeleton['up_axis']} up" if skeleton["up_axis"] else "up axis unknown",
    ]
    facts += [f"{skeleton['forward_axis']} forward"] if skeleton["forward_axis"] else []
    facts += [f"{skeleton['handedness']}-handed"] if skeleton["handedness"] else []
    name = f" {skeleton['name']}" if skeleton["name"] else ""
    id_ = f" ({skeleton['id'][:8]})" if "id" in skeleton else ""
    yield f"skeleton{name}{id_}: {', '.join(facts)}"
    if height := skeleton["height"]:
        yield _height(height, unit)
    if skeleton.get("base"):
        yield f"  derived from {skeleton['base'][:8]}"
    yield from _tree(skeleton["joints"])


def _height(height: float, unit_cm: float | None) -> str:
    from mcz.kinematics.rest_pose import note_on_height

    if unit_cm is None:
        return f"  height {height:.3g} units"
    text = note_on_height(height, unit_cm) or f"height {height * unit_cm:.3g} cm"
    return f"  {text}"


def _is_plain(joints: list[JsonObject]) -> bool:
    """Return whether the joints are numbers in order, all alike, as those of an array are."""
    alike = -1, joints[0]["channels"]
    return all(
        joint["name"] == str(index) and (joint["parent"], joint["channels"]) == alike
        for index, joint in enumerate(joints)
    )


def _tree(joints: list[JsonObject]) -> Iterator[str]:
    """The joints as a tree; a stack instead of recursion, since files choose the depth."""
    if len(joints) > 2 and _is_plain(joints):
        yield f"  0 to {len(joints) - 1}  {' '.join(joints[0]['channels'])}".rstrip()
        return
    children: dict[int, list[int]] = {}
    for index, joint in enumerate(joints):
        children.setdefault(joint["parent"], []).append(index)
    stack = [(root, "  ", "  ") for root in reversed(children.get(-1, []))]
    while stack:
        index, own, below = stack.pop()
        if len(below) > DEEPEST:
            own, below = f"{below} ... ", below[:DEEPEST]
        yield f"{own}{joints[index]['name']}  {' '.join(joints[index]['channels'])}".rstrip()
        for number, child in enumerate(reversed(children.get(index, []))):
            last = number == 0
            stack.append(
                (child, below + ("└─ " if last else "├─ "), below + ("   " if last else "│  "))
            )


def rate_text(clip: JsonObject) -> str:
    rate = clip["frame_rate"]
    if rate is None:
        return "at an unknown rate"
    about = "" if clip["frame_rate_exact"] else "about "
    seconds, times = clip["n_frames"] / rate, clip["times"]
    if times is not None and times["gaps"]:
        seconds = times["last"] - times["first"] + 1 / rate
    return f"at {about}{rate:g} Hz ({seconds:.2f} s)"


def time_lines(times: JsonObject | None) -> Iterator[str]:
    """The times of the frames, unless they run from 0 s on without a gap."""
    if times is None:
        return
    if times["first"] or times["gaps"]:
        gaps = f", {plural(times['gaps'], 'gap')}" if times["gaps"] else ""
        yield f"  time       {times['first']:.6g} s to {times['last']:.6g} s{gaps}"
