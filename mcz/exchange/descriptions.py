"""Metadata of a file as a record of DataCite 4.5, and as an RO-Crate 1.1.

A field comes from metadata of the file, or from a value on which all chosen clips agree; nothing is
guessed. Sources: DataCite Metadata Schema 4.5 in the JSON of its REST interface; RO-Crate 1.1.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence

from mcz.files.reading.clip import Clip
from mcz.files.reading.file import File
from mcz.model.text_format import count_text
from mcz.model.types import JsonObject

MEDIA_TYPE = "application/vnd.mcz"
CRATE = "https://w3id.org/ro/crate/1.1"
SPDX = "https://spdx.org/licenses"
_LICENCE = re.compile(r"[A-Za-z0-9.+-]+")  # one licence; an expression has spaces

# The properties that each record requires, and the metadata keys that they come from.
REQUIRED = {
    "datacite": {
        "creators": "lab",
        "titles": "title",
        "publisher": "contact",
        "publicationYear": "published",
    },
    "ro-crate": {
        "name": "title",
        "description": "description",
        "license": "licence",
        "datePublished": "published",
    },
}


def describe(file: File, clips: Sequence[Clip], form: str) -> tuple[JsonObject, dict[str, str]]:
    """A record, and the required properties that it lacks with the metadata keys they come from.

    ``form`` is "datacite" or "ro-crate".
    """
    record = FORMS[form](file, clips)
    entity = record if form == "datacite" else record["@graph"][1]
    return record, {name: key for name, key in REQUIRED[form].items() if name not in entity}


def datacite(file: File, clips: Sequence[Clip]) -> JsonObject:
    """Attributes of a DOI in the REST interface of DataCite."""
    agreed = _common_metadata(file, clips)
    days = sorted(filter(None, _values("date", file, clips)))
    licence = agreed.get("licence")
    rights = {"rights": agreed.get("rights") or licence}
    if licence and _LICENCE.fullmatch(licence):
        rights |= {"rightsIdentifier": licence, "rightsIdentifierScheme": "SPDX"}
    holder = agreed.get("rights-holder")
    record: JsonObject = {
        "doi": agreed.get("doi"),
        "creators": _parse_each(agreed.get("lab"), lambda name: {"name": name}),
        "titles": _parse_each(agreed.get("title"), lambda title: {"title": title}),
        "publisher": _parse_one(agreed.get("contact"), lambda name: {"name": name}),
        "publicationYear": _parse_one(agreed.get("published"), lambda day: day[:4]),
        "types": {"resourceType": "motion capture", "resourceTypeGeneral": "Dataset"},
        "subjects": [{"subject": word} for word in _keywords(file, clips)],
        "contributors": _parse_each(
            holder, lambda name: {"name": name, "contributorType": "RightsHolder"}
        ),
        "dates": _parse_each(_range(days), lambda day: {"date": day, "dateType": "Collected"}),
        "sizes": [f"{file.size} bytes", count_text(len(clips), "clip")],
        "formats": [MEDIA_TYPE],
        "rightsList": [rights] if rights["rights"] else [],
        "descriptions": _parse_each(
            agreed.get("description"),
            lambda text: {"description": text, "descriptionType": "Abstract"},
        ),
        "geoLocations": _parse_each(agreed.get("place"), lambda place: {"geoLocationPlace": place}),
        "schemaVersion": "http://datacite.org/schema/kernel-4",
    }
    return _without_empty(record)


def ro_crate(file: File, clips: Sequence[Clip]) -> JsonObject:
    """``ro-crate-metadata.json`` of a folder that holds the file."""
    agreed = _common_metadata(file, clips)
    licence = agreed.get("licence")
    is_listed = licence is not None and _LICENCE.fullmatch(licence)
    name = re.split(r"[/\\]", file.name)[-1] or "archive.mcz"
    parts = [f"#clip-{number}" for number in range(len(clips))]
    root = {
        "@id": "./",
        "@type": "Dataset",
        "name": agreed.get("title"),
        "description": agreed.get("description"),
        "datePublished": agreed.get("published"),
        "license": {"@id": f"{SPDX}/{licence}"} if is_listed else licence or agreed.get("rights"),
        "identifier": _parse_one(agreed.get("doi"), lambda doi: f"https://doi.org/{doi}"),
        "creditText": agreed.get("credit"),
        "hasPart": [{"@id": name}],
    }
    archive = {
        "@id": name,
        "@type": "File",
        "name": name,
        "encodingFormat": MEDIA_TYPE,
        "contentSize": str(file.size),
        "keywords": ", ".join(_keywords(file, clips)),
        "creator": _parse_one(agreed.get("lab"), lambda _: {"@id": "#lab"}),
        "copyrightHolder": _parse_one(agreed.get("rights-holder"), lambda _: {"@id": "#holder"}),
        "hasPart": [{"@id": part} for part in parts],
    }
    graph: list[JsonObject] = [
        {
            "@id": "ro-crate-metadata.json",
            "@type": "CreativeWork",
            "conformsTo": {"@id": CRATE},
            "about": {"@id": "./"},
        },
        _without_empty(root),
        _without_empty(archive),
    ]
    for identifier, key in (("#lab", "lab"), ("#holder", "rights-holder")):
        if key in agreed:
            graph.append({"@id": identifier, "@type": "Organization", "name": agreed[key]})
    if is_listed:
        graph.append({"@id": f"{SPDX}/{licence}", "@type": "CreativeWork", "name": licence})
    return {
        "@context": f"{CRATE}/context",
        "@graph": [*graph, *map(_clip_entity, parts, clips)],
    }


def _clip_entity(identifier: str, clip: Clip) -> JsonObject:
    metadata = clip.metadata
    entity: JsonObject = {
        "@id": identifier,
        "@type": "CreativeWork",
        "name": clip.name,
        "alternateName": metadata.get("title"),
        "description": metadata.get("description"),
        "dateCreated": metadata.get("date"),
        "locationCreated": metadata.get("place"),
        "license": metadata.get("licence"),
    }
    return _without_empty(entity)


def _values(key: str, file: File, clips: Iterable[Clip]) -> set[str]:
    """The values of a key: that of the file, else those of clips, "" for clips without."""
    own = file.metadata.get(key)
    return {own} if own is not None else {clip.metadata.get(key, "") for clip in clips}


def _common_metadata(file: File, clips: Sequence[Clip]) -> dict[str, str]:
    """Metadata of the file, and those that all clips have alike."""
    shared = set(clips[0].metadata.items()) if clips else set()
    for clip in clips:
        shared &= clip.metadata.items()
    return dict(shared) | dict(file.metadata)


def _keywords(file: File, clips: Iterable[Clip]) -> list[str]:
    texts = ";".join(_values("keywords", file, clips))
    return sorted({word.strip() for word in texts.split(";")} - {""})


def _range(days: Sequence[str]) -> str | None:
    if not days:
        return None
    return days[0] if days[0] == days[-1] else f"{days[0]}/{days[-1]}"


def _parse_one(text: str | None, make: Callable[[str], object]) -> object:
    return None if text is None else make(text)


def _parse_each(text: str | None, make: Callable[[str], object]) -> list[object]:
    return [] if text is None else [make(text)]


def _without_empty(entity: JsonObject) -> JsonObject:
    """An entity without its empty properties."""
    return {name: value for name, value in entity.items() if value not in (None, [], "")}


FORMS: dict[str, Callable[[File, Sequence[Clip]], JsonObject]] = {
    "datacite": datacite,
    "ro-crate": ro_crate,
}
