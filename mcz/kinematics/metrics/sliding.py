"""Foot sliding during the original's contacts. docs/guides/contacts.md has the definitions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mcz.kinematics.contacts import Contact, Contacts, FootTracks
from mcz.kinematics.metrics.sums import Number, mean_of
from mcz.model.text_format import brief
from mcz.model.types import Floats

MM = 10.0  # of a cm


@dataclass(frozen=True, slots=True)
class ContactSlide:
    """One contact: the distance of the decoded foot from the original's place.

    ``mean_mm`` and ``max_mm`` are differences of both feet's displacements from the first frame,
    over the later frames. ``path_mm`` is the length of the decoded foot's path,
    ``path_original_mm`` of the original's. None where no position is known.
    """

    joint: str
    first: int
    n_frames: int
    mean_mm: Number
    max_mm: Number
    path_mm: Number
    path_original_mm: Number


@dataclass(frozen=True, slots=True)
class Sliding:
    """All contacts of the original, and the same figures over all of them.

    ``where`` is the frame and joint of the greatest difference; ``slides`` are in the order of
    ``contacts.runs``.
    """

    contacts: Contacts
    slides: tuple[ContactSlide, ...]
    mean_mm: Number = None
    max_mm: Number = None
    where: tuple[int, str] | None = None
    path_mm: Number = None
    path_original_mm: Number = None

    __repr__ = brief

    def entries(self) -> dict[str, float | int | str | None]:
        """The figures by the metric ids of SPEC.md."""
        frame, joint = self.where or (None, None)
        return {
            "contacts": len(self.slides),
            "contact_frames": sum(slide.n_frames for slide in self.slides),
            "slide_mean_mm": self.mean_mm,
            "slide_max_mm": self.max_mm,
            "slide_max_frame": frame,
            "slide_max_joint": joint,
            "slide_path_mm": self.path_mm,
            "slide_path_original_mm": self.path_original_mm,
        }


@dataclass(frozen=True, slots=True)
class _ContactDistances:
    """Distances of a contact after its first frame, NaN where unknown, and both path lengths."""

    run: Contact
    apart: Floats
    path: float
    path_original: float
    steps: int  # of the paths

    def slide(self) -> ContactSlide:
        known = self.apart[np.isfinite(self.apart)]
        return ContactSlide(
            joint=self.run.joint,
            first=self.run.first,
            n_frames=self.run.n_frames,
            mean_mm=mean_of(float(known.sum()), len(known)),
            max_mm=mean_of(float(known.max(initial=0.0)), min(1, len(known))),
            path_mm=mean_of(self.path, min(1, self.steps)),
            path_original_mm=mean_of(self.path_original, min(1, self.steps)),
        )


def sliding(contacts: Contacts, ours: FootTracks, theirs: FootTracks) -> Sliding:
    """The figures of ``theirs``, the decoded feet, in the ``contacts`` of ``ours``.

    Both have the same joints in length units of the original; ``contacts`` may be of fewer.
    """
    with np.errstate(all="ignore"):  # overflow is no figure
        measured = list(_measure_contacts(contacts, ours, theirs))
        slides = tuple(each.slide() for each in measured)
        apart = [each.apart[np.isfinite(each.apart)] for each in measured]
        n_known = sum(map(len, apart))
        steps = min(1, sum(each.steps for each in measured))
        return Sliding(
            contacts,
            slides,
            mean_mm=mean_of(float(sum(each.sum() for each in apart)), n_known),
            max_mm=max((s.max_mm for s in slides if s.max_mm is not None), default=None),
            where=_worst_frame(measured),
            path_mm=mean_of(sum(each.path for each in measured), steps),
            path_original_mm=mean_of(sum(each.path_original for each in measured), steps),
        )


def _measure_contacts(
    contacts: Contacts, ours: FootTracks, theirs: FootTracks
) -> Iterator[_ContactDistances]:
    to_mm = ours.unit_cm * MM
    for run in contacts.runs:
        foot = ours.joints.index(run.joint)
        frames = slice(run.first, run.first + run.n_frames)
        a, b = ours.feet[foot, frames] * to_mm, theirs.feet[foot, frames] * to_mm
        apart = _lengths((b - b[:1]) - (a - a[:1]))[1:]
        original, decoded = (_lengths(np.diff(places, axis=0)) for places in (a, b))
        known = np.isfinite(original) & np.isfinite(decoded)
        yield _ContactDistances(
            run, apart, float(decoded[known].sum()), float(original[known].sum()), int(known.sum())
        )


def _worst_frame(measured: list[_ContactDistances]) -> tuple[int, str] | None:
    """Frame and joint of the greatest difference; ties: the first frame, then joint."""
    worst: list[tuple[float, int, str]] = []
    for each in measured:
        known = np.where(np.isfinite(each.apart), each.apart, -1.0)
        if known.max(initial=-1.0) >= 0:
            at = int(known.argmax())
            worst.append((-float(known[at]), each.run.first + 1 + at, each.run.joint))
    return min(worst, key=lambda one: one[:2])[1:] if worst else None


def _lengths(vectors: Floats) -> Floats:
    x, y, z = vectors.T
    result: Floats = np.sqrt(x * x + y * y + z * z)
    return result
