"""Work behind the tables of Kwak and Bajic: clips, settings and results."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from mcz.bench.cases import Variant
from mcz.bench.measure import Record
from mcz.bench.tasks import Runner, Task
from mcz.codecs import CODECS
from tools.papers.kwak.clips import CMU, POINTS, VIRTUAL, Clip
from tools.papers.kwak.measure import NAME, live_basis
from tools.papers.kwak.printed import PRINTED_FITS, TARGETS


@dataclass(frozen=True, slots=True)
class Method:
    """A row of the tables: parameters, and whether the post filter follows."""

    label: str
    params: tuple[tuple[str, Any], ...] = ()
    filtered: bool = False
    printed: bool = False  # with a and b of the paper
    ours: bool = False  # with the basis that is to be had live

    def variant(self, clip: Clip) -> Variant:
        a, b = PRINTED_FITS["c3d" if clip.is_markers else "bvh"]
        fit = (("a", a), ("b", b)) if self.printed else ()
        basis = (("basis", live_basis(clip)),) if self.ours else ()
        return Variant(NAME, (*self.params, *fit, *basis))

    def behind_filter(self) -> Method:
        return replace(self, label=f"{self.label} + filter", filtered=True)


MOD = Method("MOD", (("preset", "mod"),))
RC = Method("RC", (("preset", "rc"),))
RCA = Method("RCA", (("preset", "rca"),))
FIL = Method("FIL", RCA.params, True)
PRINTED = Method("RCA, a and b as printed", RCA.params, printed=True)
STEADY = Method("steady", (("preset", "mod"), ("rate_control", "steady"), ("ltr_step", 0.5)))
HELD_RATE = ("rate_control", "steady")
OURS = Method("ours", (HELD_RATE,), ours=True)
CHAINED = Method("ours, intra_period 0", (HELD_RATE, ("intra_period", 0)), ours=True)
FREE = Method("ours, one step", ours=True)
LEARNED = Method("ours, basis of the clip", (HELD_RATE, ("basis", "learned")))
PUBLISHED = (MOD, RC, RCA, FIL)
OWN = (PRINTED, STEADY, OURS, CHAINED, FREE)
ALL = (*PUBLISHED, *(m for own in OWN for m in (own, own.behind_filter())), LEARNED)
CODED = (RC, RCA, *OWN, LEARNED)  # beside MOD: what is coded, of which filters make no other bytes

# Errors against sizes of files.
OTHERS = (Variant("lsdt-frame"), Variant("lsdt-clip"), Variant("mrdwt"))
DIALED = (MOD,)
HELD = (RC, RCA, FIL, OURS, OURS.behind_filter(), LEARNED)
FILE_RATES = (2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 10.0, 15.0, 22.0, 32.0)
WITH_MARKERS = (RCA, OURS)
MARKER_RATES = (3.0, 4.0, 5.0, 6.0, 7.0, 9.0, 12.0, 16.0, 22.0, 30.0)

STUDY_KBPS = 5.0
CODER_KBPS = (3.0, 5.0, 7.0)
STUDIES = ("periods", "resets", "packets")
SPEEDS = ((RCA, (("bitrate", 5.0),)), (OURS, (("bitrate", 5.0),)), (MOD, (("step", 1.0),)))
OTHER_SPEEDS = (("lsdt-frame", (), (("step", 0.2),)), ("mrdwt", (), (("T_g", 4.0),)))


def missing_codecs() -> list[str]:
    known = {codec.name for codec in CODECS.values()}
    return [name for name in (NAME, *(v.codec for v in OTHERS)) if name not in known]


@dataclass(frozen=True, slots=True)
class Found:
    """The clips of the tables, and the results by task."""

    clips: Sequence[Clip]
    results: dict[Task, Any] = field(default_factory=dict)

    @property
    def skeletons(self) -> list[Clip]:
        return [clip for clip in self.clips if not clip.is_markers]

    @property
    def study_clips(self) -> list[Clip]:
        """Clips of CMU for studies that the paper has no table of."""
        return [clip for clip in self.clips if CMU.match(clip.stem)] or list(self.clips)[:1]

    @property
    def fastest(self) -> Clip | None:
        """The one that speeds are measured on: the last skeleton, which has 38 points here."""
        return self.skeletons[-1] if self.skeletons else None

    def get(self, task: Task | None) -> Any:
        """A result; None where there is none, or the task was refused."""
        found = self.results.get(task) if task else None
        return None if isinstance(found, dict) and "error" in found else found

    def rates(self, clip: Clip, method: Method) -> list[Record]:
        """A point for each rate; ``sqnr`` and ``cm`` are those of the method."""
        points = self.get(self.rates_task(clip, method))
        if not method.filtered:
            return points or []
        ends = ("sqnr", "cm")
        return [p | {end: p[f"{end}_filtered"] for end in ends} for p in points or []]

    def targets(self, clip: Clip) -> tuple[float, ...] | None:
        """Target rates; for markers those of MOD, as in the paper."""
        if not clip.is_markers:
            return TARGETS
        points = self.get(rates_task(clip, MOD, TARGETS))
        return tuple(round(p["kbps"], 6) for p in points) if points else None

    def rates_task(self, clip: Clip, method: Method) -> Task | None:
        targets = TARGETS if method.params == MOD.params else self.targets(clip)
        return rates_task(clip, method, targets) if targets else None

    def first(self) -> Iterator[Task]:
        """Tasks without dependencies."""
        for clip in self.clips:
            yield rates_task(clip, MOD, TARGETS)
        for clip in self.skeletons:
            for method in WITH_MARKERS:
                yield from (marker_task(clip, method, form) for form in (POINTS, VIRTUAL))
            yield from (task for _, task in curve_tasks(clip))
            yield study_task(clip, "losses", STUDY_KBPS)
        for clip in self.study_clips:
            yield study_task(clip, "coders", *CODER_KBPS)
            yield from (study_task(clip, what, STUDY_KBPS) for what in STUDIES)
        if self.fastest:
            yield speeds_task(self.fastest)

    def second(self) -> Iterator[Task | None]:
        """Tasks at the rates of MOD."""
        for clip in self.clips:
            yield from (self.rates_task(clip, method) for method in CODED)


def rates_task(clip: Clip, method: Method, targets: Sequence[float]) -> Task:
    return Task("kwak", clip.case, method.variant(clip), ("rates", clip.form, tuple(targets)))


def marker_task(clip: Clip, method: Method, form: str) -> Task:
    return rates_task(Clip(clip.case, form), method, MARKER_RATES)


def curve_tasks(clip: Clip) -> list[tuple[str, Task]]:
    """Errors against sizes of files: what is searched along a dial, and what is held to rates."""
    dialed = [(method.label, method.variant(clip)) for method in DIALED]
    dialed += [(variant.label, variant) for variant in OTHERS]
    found = [(label, _files(clip, variant, False, ())) for label, variant in dialed]
    for method in HELD:
        task = _files(clip, method.variant(clip), method.filtered, FILE_RATES)
        found.append((method.label, task))
    return found


def _files(clip: Clip, variant: Variant, filtered: bool, rates: tuple[float, ...]) -> Task:
    return Task("kwak", clip.case, variant, ("files", clip.form, filtered, rates))


def study_task(clip: Clip, what: str, *targets: float) -> Task:
    return Task("kwak", clip.case, Variant(NAME), (what, clip.form, targets))


def speeds_task(clip: Clip) -> Task:
    own = tuple((NAME, method.variant(clip).params, more) for method, more in SPEEDS)
    return Task("kwak_speeds", clip.case, arguments=(clip.form, (*own, *OTHER_SPEEDS)))


def measure(runner: Runner, clips: Sequence[Clip]) -> Found:
    found = Found(clips)
    found.results.update(runner.run(found.first()))
    found.results.update(runner.run(task for task in found.second() if task))
    return found
