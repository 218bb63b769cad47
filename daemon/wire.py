"""Snapshots as ZeroMQ frames ``[topic, header, payload...]`` and back; for publishers and subscribers alike.

The header is JSON.  ``v`` is the format's version: a reader ignores fields that it does not know and refuses a newer
major.  ``seq`` counts the messages of a topic, ``session`` changes when everything starts anew.  Arrays follow as
little-endian bytes, described by ``names``, ``enc``, ``dtype`` and ``shape``: three strings and a list where there is
one array, lists of those where there are several.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import zstandard
from numpy.typing import NDArray

from config.errors import DataError, FrameError
from daemon.snapshots import Snapshot
from drivers.records import Json

VERSION: Final = "1.0"
TOPICS: Final = ("ping", "station", "grid/key", "grid/delta", "fill", "mesh", "guide", "health", "event")

_RAW_BYTES: Final = 1024
"""Arrays up to this size go raw: compressing a beam saves less than its frame costs."""
_LARGEST_BYTES: Final = 1 << 28
_DTYPES: Final = frozenset({"u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f4", "f8"})
_OURS: Final = ("v", "seq", "session", "t_ns", "utc_ns", "names", "enc", "dtype", "shape")


@dataclass(frozen=True, slots=True)
class Message:
    """A snapshot as it came over the wire, with its number among those of its topic and its session."""

    seq: int
    session: str
    snapshot: Snapshot


def encode(snapshot: Snapshot, seq: int, session: str) -> list[bytes]:
    """Return the frames of ``snapshot``."""
    header: dict[str, Json] = {
        "v": VERSION,
        "seq": seq,
        "session": session,
        "t_ns": snapshot.t_ns,
        "utc_ns": snapshot.utc_ns,
        **{name: value for name, value in snapshot.fields.items() if name not in _OURS},
    }
    packed = [_pack(array) for array in snapshot.arrays.values()]
    if packed:
        header |= _described(list(snapshot.arrays), packed)
    return [snapshot.topic.encode(), _dump(header), *(data for _, _, _, data in packed)]


def decode(frames: Sequence[bytes]) -> Message:
    """Return the message in ``frames``.

    Raises DataError where a newer program wrote it, FrameError where it is not such a message.
    """
    topic, header = head(frames)
    try:
        seq, session = int(header["seq"]), str(header["session"])
        t_ns, utc_ns = int(header["t_ns"]), int(header["utc_ns"])
        arrays = _arrays(header, frames[2:])
    except (KeyError, TypeError, ValueError, OverflowError, zstandard.ZstdError) as error:
        raise FrameError(f"a '{topic}' message is damaged ({error}); it is left out") from None
    fields = {name: value for name, value in header.items() if name not in _OURS}
    return Message(seq, session, Snapshot(topic, t_ns, utc_ns, fields, arrays))


def head(frames: Sequence[bytes]) -> tuple[str, dict[str, Any]]:
    """Return topic and header of ``frames``; raises as ``decode`` does."""
    try:
        topic = bytes(frames[0]).decode()
        header = json.loads(bytes(frames[1]))
        major = int(str(header["v"]).split(".", maxsplit=1)[0])
    except (IndexError, KeyError, TypeError, ValueError, RecursionError):
        raise FrameError("a message has no readable header; it is left out") from None
    if major > int(VERSION.split(".", maxsplit=1)[0]):
        raise DataError(f"the sender speaks version {header['v']}, this program {VERSION}; update this program")
    return topic, header


def numbered(frames: Sequence[bytes], seq: int, session: str, base: dict[str, Json] | None = None) -> list[bytes]:
    """Return ``frames`` under another ``seq`` and ``session`` (and ``base``, where a delta's is given)."""
    topic, header = head(frames)
    header |= {"seq": seq, "session": session}
    if base is not None:
        header["base"] = base
    return [topic.encode(), _dump(header), *frames[2:]]


def _pack(array: NDArray[Any]) -> tuple[str, str, list[int], bytes]:
    code = array.dtype.str[1:]
    if code not in _DTYPES:
        raise TypeError(f"arrays of {array.dtype} have no place on the wire")
    data = np.ascontiguousarray(array, dtype=f"<{code}").tobytes()
    if len(data) <= _RAW_BYTES:
        return "raw", code, list(array.shape), data
    return "zstd", code, list(array.shape), zstandard.ZstdCompressor(level=1).compress(data)


def _described(names: list[str], packed: list[tuple[str, str, list[int], bytes]]) -> dict[str, Json]:
    encs, codes, shapes = [p[0] for p in packed], [p[1] for p in packed], [p[2] for p in packed]
    if len(packed) == 1:
        return {"names": names[0], "enc": encs[0], "dtype": codes[0], "shape": [*shapes[0]]}
    return {"names": [*names], "enc": [*encs], "dtype": [*codes], "shape": [[*shape] for shape in shapes]}


def _arrays(header: dict[str, Any], payloads: Sequence[bytes]) -> dict[str, NDArray[Any]]:
    if not payloads:
        return {}
    alone = isinstance(header["enc"], str)
    keys = ("names", "enc", "dtype", "shape")
    names, encs, codes, shapes = ([header[key]] if alone else header[key] for key in keys)
    parts = zip(names, encs, codes, shapes, payloads, strict=True)
    return {str(name): _unpack(enc, code, shape, data) for name, enc, code, shape, data in parts}


def _unpack(enc: str, code: str, shape: list[int], data: bytes) -> NDArray[Any]:
    if code not in _DTYPES or enc not in ("raw", "zstd"):
        raise ValueError(f"unknown array of {code!r} in {enc!r}")
    if any(not isinstance(side, int) or side < 0 for side in shape):
        raise ValueError(f"shape {shape!r}")
    size = math.prod(shape) * int(code[1:])
    if size > _LARGEST_BYTES:
        raise ValueError(f"an array of {size} bytes")
    if enc == "zstd":
        # The size in the frame is checked first: decompress() would allocate whatever it claims.
        if zstandard.frame_content_size(data) != size:
            raise ValueError("a compressed array of another size")
        data = zstandard.ZstdDecompressor().decompress(data, max_output_size=size)
    if len(data) != size:
        raise ValueError("an array of another size")
    array = np.frombuffer(data, dtype=f"<{code}").reshape(shape)
    return array if sys.byteorder == "little" else array.astype(code)


def _dump(header: dict[str, Json]) -> bytes:
    return json.dumps(header, separators=(",", ":"), allow_nan=False).encode()
