"""Edits that write a SRCE or SKEL with deflate after words."""

from __future__ import annotations

from mcz.container import payloads
from mcz.container.encodings import PACKED, words
from mcz.model.schema import deflate, inflate, parse, varint
from tools.records import build_record

BEYOND = 32768  # a distance that the words are too few for


def after_words(payload: bytes) -> bytes:
    """A SRCE whose template, deflated until now, is deflated after words."""
    fields = parse(payloads.Srce, payload, "SRCE")
    text = inflate(fields.data, fields.size, "SRCE")
    packed = {"flags": payloads.AFTER_WORDS, "data": deflate(text, words=words())}
    return build_record(payloads.Srce, vars(fields) | packed, "SRCE")


def beyond(payload: bytes) -> bytes:
    """A SRCE of 3 bytes that begin before the first byte of the words."""
    return payload[:1] + bytes((payloads.AFTER_WORDS, 3)) + copy_of_three()


def copy_of_three() -> bytes:
    """A block of kind 1: 3 bytes from ``BEYOND`` bytes before, the end."""
    bits = "1" + "10"  # the last block; its kind, lowest bit first
    bits += "0000001"  # length 3
    bits += "11101" + "1" * 13  # distance 24577 + 8191
    bits += "0000000"
    bits += "0" * (-len(bits) % 8)
    return bytes(int(bits[n : n + 8][::-1], 2) for n in range(0, len(bits), 8))


def pack_skeleton(payload: bytes, size: int | None = None) -> bytes:
    """A SKEL with its fields packed; ``size``: another one is stated."""
    at = 1 + payload[0]
    rest = payload[at + 1 :]
    stated = varint(len(rest) if size is None else size)
    flags = bytes((payload[at] | PACKED,))
    return payload[:at] + flags + stated + deflate(rest, words=words())


def too_long(payload: bytes) -> bytes:
    """A packed SKEL whose fields, an extension among them, are longer than a template may be."""
    return pack_skeleton(payload + bytes(2**26 + 1 - (len(payload) - payload[0] - 2)))
