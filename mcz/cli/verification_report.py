"""A report of a verification, to be filed with an archive: the checks, and the contents."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable

from mcz.container import payloads
from mcz.container.source import ByteSource
from mcz.errors import MczError
from mcz.files.reading.clip import Clip
from mcz.files.reading.file import Attachment, File
from mcz.files.reading.source_files import source_facts
from mcz.model.schema import parse
from mcz.model.text_format import count_text, printable
from mcz.model.types import JsonObject, Params

BLOCK = 1024 * 1024  # bytes that are hashed at a time
CHECKED = {
    "quick": ("every checksum of the file", "the index against what is there"),
    "full": (
        "every checksum of the file",
        "the structure of the file, and the index against what is there",
        "every value decoded, and compared with its SHA-256",
        "every source file and attachment restored, and compared with its SHA-256",
    ),
    "unopened": ("whether the file can be opened",),
}
NOT_CHECKED = {
    "quick": ("values were not decoded, source files were not restored",),
    "full": (),
    "unopened": ("all else, for the file cannot be opened",),
}

Part = Params  # kind, name and problems of a part, as in ``mcz verify --json``


def bytes_facts(source: ByteSource) -> JsonObject:
    """Name, size and SHA-256 of a file of any content."""
    digest = hashlib.sha256()
    for at in range(0, source.size, BLOCK):
        digest.update(source.read(at, min(BLOCK, source.size - at)))
    return {"file": source.name, "file_bytes": source.size, "sha256": digest.hexdigest()}


def contents(file: File) -> JsonObject:
    """List the contents of a file without decoding."""
    clips = [_clip(clip) for clip in file]
    skeletons = [_skeleton(file, id_) for id_, _ in file.skeletons]
    attachments = [_attachment(file, attachment) for attachment in file.attachments.values()]
    aliases = [
        {"name": name, "of": kind, "target": target}
        for name, (kind, target) in ((name, file.alias_of(name)) for name in file.aliases)
    ]
    files = _files(clips, skeletons, attachments, aliases)
    return {
        **file.header,
        "totals": {
            "clips": len(clips),
            "frames": sum(row["n_frames"] for row in clips),
            "skeletons": len(skeletons),
            "attachments": len(attachments),
            "aliases": len(aliases),
            "files": len(files),
            "files_bytes": sum(files.values()),
        },
        "clips": clips,
        "skeletons": skeletons,
        "attachments": attachments,
        "aliases": aliases,
    }


def _files(
    clips: list[JsonObject],
    skeletons: list[JsonObject],
    attachments: list[JsonObject],
    aliases: list[JsonObject],
) -> dict[str, int]:
    """The files that ``unpack`` writes, and their sizes."""
    sizes = {("clip", row["name"]): row["source_bytes"] or 0 for row in clips}
    sizes |= {("skeleton", row["id"]): row["source_bytes"] or 0 for row in skeletons}
    sizes |= {("attachment", row["name"]): row["bytes"] for row in attachments}
    files = {row["source_path"]: row["source_bytes"] for row in clips if row["source_path"]}
    files |= {row["name"]: row["bytes"] for row in attachments}
    return files | {row["name"]: sizes.get((row["of"], row["target"]), 0) for row in aliases}


def _clip(clip: Clip) -> JsonObject:
    try:
        source = clip.source
    except MczError:  # already among the problems
        source = None
    return {"name": clip.name, "n_frames": clip.n_frames, **source_facts(source)}


def _skeleton(file: File, id_: bytes) -> JsonObject:
    try:
        skeleton = file.skeleton(id_, with_source=True)
    except MczError:
        return {"name": id_.hex(), "id": id_.hex(), **source_facts(None)}
    return {"name": skeleton.name or id_.hex(), "id": id_.hex(), **source_facts(skeleton.source)}


def _attachment(file: File, attachment: Attachment) -> JsonObject:
    part = file.container.directory.attachments[attachment.name].parts[0]
    try:
        sha256 = parse(payloads.Atta, file.container.payload(part), part.label).sha256.hex()
    except MczError:
        sha256 = None
    return {"name": attachment.name, "bytes": attachment.size, "sha256": sha256}


def report(
    facts: Params,
    parts: Iterable[Part],
    *,
    tool: str,
    date: str | None = None,
    quick: bool = False,
    chosen: str | None = None,
) -> JsonObject:
    """The report as a document, ready for JSON; docs/reference/scripts.md lists its keys.

    ``facts``: those of ``bytes_facts``, and of ``contents`` if the file could be opened. ``parts``:
    the result of each part. ``chosen``: the query of the clips that a full check decoded, None for
    all of them.
    """
    mode, rows = "quick" if quick else "full", list(parts)
    done = mode if quick or "format_version" in facts else "unopened"
    faults: dict[tuple[str, str], list[str]] = {}
    for row in rows:  # skeletons may have one name
        faults.setdefault((row["kind"], row["name"]), []).extend(row["problems"])
    document = {
        "verified": not any(faults.values()),
        "mode": mode,
        "checked": list(CHECKED[done]),
        "not_checked": list(NOT_CHECKED[done]),
        "tool": tool,
        "date": date,
        **{key: value for key, value in facts.items() if not isinstance(value, list)},
    }
    if chosen is not None:
        document["not_checked"].append(f"values and sources of clips other than {chosen}")
    document["problems"] = [
        f"{row['kind']} {row['name']}".strip() + f": {text}"
        for row in rows
        for text in row["problems"]
    ]
    for kind in ("clip", "skeleton", "attachment"):
        document[f"{kind}s"] = [
            {**fact, "result": _result(faults.get((kind, fact["name"])), quick)}
            for fact in facts.get(f"{kind}s", ())
        ]
    document["aliases"] = list(facts.get("aliases", ()))
    return document


def _result(problems: list[str] | None, quick: bool) -> str:
    if problems:
        return "damaged"
    return "not decoded" if quick or problems is None else "verified"


def text_lines(document: Params) -> list[str]:
    """The report as text, each name on one line and without control characters."""
    lines = [_fact("size", f"{document['file_bytes']:,} bytes")]
    lines.append(_fact("SHA-256", document["sha256"]))
    if "format_version" in document:
        needs = f"needs a reader of {document['needs_version']}, profile {document['profile']}"
        lines.append(_fact("format", f"MCZ {document['format_version']}, {needs}"))
    lines += _tool_and_date(document)
    lines += [_fact("checked", text) for text in document["checked"]]
    lines += [_fact("not checked", text) for text in document["not_checked"]]
    if "totals" in document:
        totals = document["totals"]
        kinds = ("clip", "frame", "skeleton", "attachment")
        counts = [count_text(totals[f"{kind}s"], kind) for kind in kinds]
        lines.append(_fact("holds", f"{', '.join(counts)}, {totals['aliases']} further names"))
        text = f"{count_text(totals['files'], 'file')}, {totals['files_bytes']:,} bytes"
        lines.append(_fact("gives back", text))
    lines += _problems(document)
    for kind in ("clips", "skeletons", "attachments"):
        lines += _rows(kind, document[kind])
    if document["aliases"]:
        lines += ["", "Further names: name, and of what"]
        lines += [f"  {row['name']}  {row['of']} {row['target']}" for row in document["aliases"]]
    return _under_title(document["file"], document, lines)


def bag_lines(document: Params) -> list[str]:
    """The report of a bag as text, without those of the archives in it."""
    lines = _tool_and_date(document)
    version, algorithms = document["bagit_version"], ", ".join(document["algorithms"])
    lines.append(_fact("checked", f"each file against the manifests: {algorithms}"))
    lines.append(_fact("format", f"BagIt {version}"))
    count = count_text(document["payload_files"], "file")
    lines.append(_fact("payload", f"{count}, {document['payload_bytes']:,} bytes"))
    lines += [_fact(name, value) for name, value in document["info"].items()]
    return _under_title(f"the bag {document['bag']}", document, lines + _problems(document))


def _under_title(of: str, document: Params, lines: list[str]) -> list[str]:
    verdict = "VERIFIED" if document["verified"] else "NOT VERIFIED"
    return [printable(line) for line in (f"Verification of {of}: {verdict}", "", *lines)]


def _tool_and_date(document: Params) -> list[str]:
    date = [_fact("date", document["date"])] if document["date"] else []
    return [_fact("checked by", document["tool"]), *date]


def _problems(document: Params) -> list[str]:
    problems = document["problems"]
    return ["", f"Problems: {len(problems) or 'none'}", *(f"  {text}" for text in problems)]


def _fact(name: str, text: str) -> str:
    return f"{name:<12} {text}"


def _rows(kind: str, rows: list[JsonObject]) -> list[str]:
    if not rows:
        return []
    if kind == "attachments":
        lines = [
            f"  {row['result']}  {row['sha256'] or 'unknown':64}  {row['bytes']:,} bytes  "
            f"{row['name']}"
            for row in rows
        ]
        return ["", "Attachments: result, SHA-256, size, name", *lines]
    lines = [
        f"  {row['result']}  {row['source_sha256'] or 'no source':64}  "
        f"{_size(row)}  {row['name']}  {row['source_path'] or row.get('id', '')}".rstrip()
        for row in rows
    ]
    last = "path of the source" if kind == "clips" else "id"
    heading = f"{kind.capitalize()}: result, SHA-256 of the source file, size, name, {last}"
    return ["", heading, *lines]


def _size(row: Params) -> str:
    frames = [f"{row['n_frames']:,} frames"] if "n_frames" in row else []
    sizes = [] if row["source_bytes"] is None else [f"{row['source_bytes']:,} bytes"]
    return ", ".join(frames + sizes) or "-"
