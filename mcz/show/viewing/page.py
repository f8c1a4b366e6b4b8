"""The page: its text, its permissions, and a written page that has player, decoder and files in it.

A written page opens from a disk, and can be mailed.
"""

from __future__ import annotations

import base64
import io
import json
import os
import re
import shutil
import subprocess
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from mcz.codecs import choose_name, codec_by_name
from mcz.codecs.basis_models import known_model_name
from mcz.container.source import lock
from mcz.errors import AccessError, FormatError, LimitError, MczError, reason_of
from mcz.files.reading.file import File
from mcz.files.reading.file import open as mcz_open
from mcz.files.reading.sizes import models_used
from mcz.files.writing.atomic import replacing
from mcz.hints import Hint, with_hint
from mcz.kinematics.metrics.diff_document import diff_document
from mcz.model.extras import annex_bytes
from mcz.model.text_format import fields_text
from mcz.model.types import JsonObject, Params, Target
from mcz.show.viewing.file_registry import FACTS, FileRegistry, RegisteredFile, Report

PACKAGED = Path(__file__).with_name("viewer.html")  # in a wheel that was built with it
OTHER = "MCZ_VIEWER_PAGE"  # an environment variable: a page to use instead of ours
PLACE = "<!-- mcz:embedded -->"
END = "<!-- mcz:end -->"
POLICY = re.compile(r'<meta http-equiv="Content-Security-Policy" content="([^"<>]*)"')


class Page:
    """The text of the page, and ``policy``, its permissions in browsers.

    The page on disk has the tables of all codecs at ``PLACE``, which ``text`` lacks: a server has
    them, and written pages have those that their files need.
    """

    def __init__(self, text: str, name: str = "the page") -> None:
        before, separator, rest = text.partition(PLACE)
        _, end, after = rest.partition(END)
        policy = POLICY.search(before)
        if not separator or not end or PLACE in after or policy is None:
            raise FormatError(f"{name} is not a page of this version of the viewer")
        self.text = before + PLACE + END + after
        self.before, self.after, self.policy = before, after, policy[1]


def page(say: Report | None = None) -> Page:
    """The page of this installation; in a source checkout it is built if outdated.

    ``say`` gets a line for slow steps. Raises AccessError if there is none; the message explains
    how to build one.
    """
    if other := os.environ.get(OTHER):
        path = Path(other)
    else:
        path = PACKAGED if PACKAGED.is_file() else build_page(say or (lambda line: None))
    try:
        return Page(path.read_text("utf-8"), str(path))
    except OSError as error:
        raise AccessError(reason_of(error), path=path) from None
    except UnicodeDecodeError:
        raise FormatError("not a page of the viewer", path=path) from None


ROOT = Path(__file__).parents[3]
VIEWER = "tools/viewer"


def has_page() -> bool:
    """Return True if the page is there without being built."""
    paths = Path(os.environ.get(OTHER, PACKAGED)), ROOT / VIEWER / "dist" / "viewer.html"
    return any(path.is_file() for path in paths)


COMMAND = f"(cd {VIEWER} && npm ci && npm run build)"
INSTALL = ("ci", "--no-audit", "--no-fund")
SHOWN = 300  # last characters of the output of a failed program


def build_page(say: Callable[[str], None], root: Path = ROOT) -> Path:
    """The page built from the sources below ``root``; raises AccessError without one.

    npm builds it if it is older than its sources. Without npm an old one is used.
    """
    folder = root / VIEWER
    page = folder / "dist" / "viewer.html"
    if not (folder / "build.mjs").is_file():
        text = "this installation has no page of the viewer: its wheel was built without"
        raise AccessError(f"{text}; in a clone of the repository, build it with {COMMAND}")
    if page.is_file() and not _is_older(page, _sources(root)):
        return page
    npm, node = shutil.which("npm"), shutil.which("node")
    if npm is None or node is None:
        if page.is_file():
            say(f"{page} is older than its sources, and npm is not installed to rebuild it")
            return page
        raise AccessError(f"the page of the viewer is not built: install Node.js, then {COMMAND}")
    _build(folder, npm, node, say)
    return page


def _sources(root: Path) -> Iterator[Path]:
    folder = root / VIEWER
    yield from (folder / name for name in ("build.mjs", "package.json", "package-lock.json"))
    yield from (path for path in (folder / "src").rglob("*") if path.is_file())
    yield from (root / "tools" / "js").rglob("*.js")
    yield from (root / "mcz" / "annex").glob("*")


def _is_older(made: Path, sources: Iterator[Path]) -> bool:
    when = made.stat().st_mtime_ns
    return any(path.stat().st_mtime_ns > when for path in sources if path.is_file())


def _build(folder: Path, npm: str, node: str, say: Callable[[str], None]) -> None:
    (folder / "dist").mkdir(exist_ok=True)
    with (folder / "dist" / "building").open("wb") as stream:
        if not lock(stream):
            raise AccessError("another process is building the page; try again soon", path=folder)
        packages = folder / "node_modules" / ".package-lock.json"
        if not packages.is_file() or _is_older(packages, iter([folder / "package-lock.json"])):
            say(f"fetching the build tools of the page (once): npm ci in {folder}")
            _run([npm, *INSTALL], folder)
        say("building the page: node build.mjs")
        _run([node, "build.mjs"], folder)


def _run(words: list[str], folder: Path) -> None:
    done = subprocess.run(
        words, cwd=folder, capture_output=True, stdin=subprocess.DEVNULL, check=False
    )
    if done.returncode:
        message = " ".join((done.stderr or done.stdout).decode("utf-8", "replace").split())[-SHOWN:]
        command = " ".join([Path(words[0]).name, *words[1:]])
        raise AccessError(f"the page could not be built: {command} in {folder} said: {message}")


MOST_BYTES = 50 * 2**20  # of a page, by default: accepted by mail and browsers
# pairs of clips whose figures are put into the page; it computes the rest itself
MOST_COMPARED = 32


@dataclass(frozen=True, slots=True, kw_only=True)
class PageOptions:
    """Contents of a page: these clips, re-encoded if a codec is named."""

    clips: Sequence[str] = ()
    where: str | None = None
    codec: str | None = None
    effort: str | None = None
    params: Params | None = None
    max_decoded: int | None = None

    @property
    def is_coded(self) -> bool:
        return bool(self.codec or self.effort or self.params)

    @property
    def is_cut(self) -> bool:
        return bool(self.clips) or self.where is not None


@dataclass(frozen=True, slots=True)
class Embedded:
    """A file in a page: its name, its original size, the number of its clips."""

    name: str
    size: int
    n_clips: int

    __repr__ = fields_text


@dataclass(frozen=True, slots=True)
class PageWritten:
    """A written page: its size, the size of the player alone, and its files."""

    size: int
    player_size: int
    files: tuple[Embedded, ...]

    __repr__ = fields_text


def write_page(
    page: Page,
    registry: FileRegistry,
    target: Target,
    options: PageOptions,
    *,
    most: int = MOST_BYTES,
    force: bool = False,
) -> PageWritten:
    """Write ``page`` with the files of ``registry`` in it.

    The page is complete under the target's name, or not there. Raises LimitError if it would have
    more than ``most`` bytes, and MczError for files that cannot be read, cut or coded so.
    """
    initial = [file for _, file in registry.initial_files()]
    inputs = [file.source for file in initial]
    with replacing(target, force=force, inputs=inputs) as stream, ExitStack() as stack:
        contents, left = {}, most
        for number, file in enumerate(initial):
            data = _bytes_of(file, registry, options, left)
            left -= len(data) * 4 // 3
            contents[number] = data, stack.enter_context(_file(data, options.max_decoded))
        files = [file for _, file in contents.values()]
        document: JsonObject = {
            "files": [
                {"name": initial[number].name, "base64": base64.b64encode(data).decode()}
                for number, (data, _) in contents.items()
            ],
            "annex": deflate_annexes(set().union(*map(tables_for, files))),
        }
        if len(files) > 1:
            names = [file.name for file in initial]
            document["diffs"] = list(_differences(files, names, registry))
        whole = (page.before + element(document) + page.after).encode()
        if len(whole) > most:
            raise _too_large(initial[-1].name, most)
        stream.write(whole)
        entries = (
            Embedded(initial[n].name, file.size, len(file)) for n, (_, file) in contents.items()
        )
        return PageWritten(len(whole), len(page.text.encode()), tuple(entries))


def element(document: Params) -> str:
    """The element with a document; no text in it is markup, and no script in it runs."""
    text = json.dumps(document, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    return f'<script type="application/json" id="embedded">{text}</script>'


def _too_large(name: str, most: int) -> LimitError:
    return LimitError(f"the page would have more than {most:,} bytes", path=name, hint=Hint.PAGE)


def _file(data: bytes, max_decoded: int | None) -> File:
    """The file in ``data``, in salvage if it is damaged."""
    try:
        return mcz_open(data, max_decoded=max_decoded)
    except MczError:
        return mcz_open(data, salvage=True, max_decoded=max_decoded)


def _bytes_of(
    file: RegisteredFile, registry: FileRegistry, options: PageOptions, most: int
) -> bytes:
    """The bytes of an ``.mcz`` for the page; raises LimitError beyond ``most``."""
    target = file.target()
    if options.is_coded:
        return _encode_file(target, registry, options)
    facts = ", ".join(fact for fact in FACTS if registry.facts.get(fact) is not None)
    if facts and file.kind == "mcz":
        text = f"{file.name}: copied unchanged, without the given {facts}"
        registry.report(with_hint(text, Hint.NAME_CODEC, registry.hints))
    if options.is_cut:
        return _cut(target, registry, options)
    contents = file.open()
    try:
        if contents.size * 4 // 3 > most:
            raise _too_large(file.name, most)
        return b"".join(contents.pieces(0, contents.size))
    finally:
        contents.close()


def _cut(target: str, registry: FileRegistry, options: PageOptions) -> bytes:
    """Some clips of a file, copied as they are stored."""
    from mcz.files.editing.extraction import extract

    out = io.BytesIO()
    extract(
        target,
        out,
        clip=options.clips or None,
        where=options.where,
        salvage=registry.salvage,
        max_decoded=options.max_decoded,
        copies=False,
    )
    return out.getvalue()


def _encode_file(target: str, registry: FileRegistry, options: PageOptions) -> bytes:
    from mcz.container.writer import Writer
    from mcz.files.writing.clip_writer import write_plan
    from mcz.files.writing.planning import prepare, under_its_path
    from mcz.files.writing.tuning import tuned_plan

    codec, params = (
        codec_by_name(choose_name(options.codec, options.effort)),
        options.params or {},
    )
    out = io.BytesIO()
    with mcz_open(target, salvage=registry.salvage, max_decoded=options.max_decoded) as file:
        writer = Writer(out, profile=file.container.profile)
        for clip in file.select_clips(options.clips or None, options.where):
            motion = registry.with_facts(clip.motion())
            prepared = prepare(motion, codec, params, (under_its_path(motion.skeleton),))
            write_plan(writer, tuned_plan(prepared, codec, params, writer.profile))
        writer.finish()
    return out.getvalue()


def _differences(
    files: Sequence[File], names: Sequence[str], registry: FileRegistry
) -> Iterator[JsonObject]:
    """Yield ``mcz diff --by-joint --json`` of every other file against the first."""
    first, *others = files
    for other, name in zip(others, names[1:], strict=True):
        pairs = [(one, one) for one in first.clips if one in other.clips.rows]
        if len(first) == len(other) == 1:
            pairs = [(next(iter(first.clips)), next(iter(other.clips)))]
        entries, notes = [], []
        for a, b in pairs[:MOST_COMPARED]:
            try:
                original = registry.with_facts(first.clips[a].motion())
                coded = registry.with_facts(other.clips[b].motion())
                entries.append(diff_document(original, coded, by_joint=True))
            except MczError as error:
                notes.append(f"{a}: {error.describe(registry.hints)}")
        yield {"a": names[0], "b": name, "clips": entries, "notes": notes}


ALWAYS = ("words.bin",)  # the names of joints are packed with them
BASES = "pca_start.json"  # how models of bases are coded
TABLES = {
    "raw": (),
    "mrdwt": ("wavelet_start.json",),
    "qbc": ("qbc_start.json",),
    "pca": (BASES,),
    "dwt": ("wavelet_start.json",),
    "awt": ("wavelet_start.json",),
    "lsdt-frame": ("frame_start.json", BASES),
    "lsdt-clip": ("window_start.json", BASES),
    "mdtt": ("window_start.json", BASES),
    "pca-rdo": ("window_start.json", BASES),
    "online": ("online_start.json", BASES),
    "best": ("best_start.json",),
    "posewave": ("posewave_start.json", "posewave_priors.json"),
    "fast": (),
}


def tables_for(file: File) -> set[str]:
    """The names of the annexes that decoding any clip of ``file`` may need."""
    from mcz.codecs import CODECS

    names = set(ALWAYS)
    for row in file.container.directory.clips.values():
        for signal in row.signals:
            names.update(TABLES.get(CODECS.find(signal.codec, signal.preset) or "", ()))
    for clip in file:
        try:
            models = {id_ for signal in clip.signals for id_ in models_used(signal)}
        except MczError:  # a damaged clip, which the decoder cannot read either
            continue
        names.update(f"bases_{name}.bin" for id_ in models if (name := known_model_name(id_)))
    return names


def deflate_annexes(names: Iterable[str]) -> dict[str, str]:
    """These annexes by name, each raw deflate in base64."""
    texts = {}
    for name in sorted(names):
        packer = zlib.compressobj(9, zlib.DEFLATED, -15)
        data = packer.compress(annex_bytes(name)) + packer.flush()
        texts[name] = base64.b64encode(data).decode()
    return texts
