"""The header of a segment: the metadata record ``lacuna`` that makes a log readable without anything else.

MCAP guards chunks with a CRC but not metadata, and a flipped bit in the configuration would change the map without a
word; therefore the record carries a CRC of its own, and the writer writes it twice.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from pydantic import ValidationError

from config.errors import DataError
from config.schema import Config

FORMAT: Final = 1
"""Version of the log's layout; raised when an older reader would misread it."""

_CRC: Final = "crc32"


@dataclass(frozen=True, slots=True)
class LogHeader:
    """What a segment says about itself: effective configuration, versions, its place among its session's segments.

    ``segment`` counts from 1; ``previous`` is the file name of the segment before, or None.
    """

    config: Config
    versions: dict[str, str]
    session: str
    segment: int = 1
    previous: str | None = None

    def metadata(self) -> dict[str, str]:
        """Return the header as the strings of an MCAP metadata record, with their CRC."""
        return signed(
            {
                "format": str(FORMAT),
                "session": self.session,
                "segment": str(self.segment),
                "previous": self.previous or "",
                "config": self.config.model_dump_json(),
                "versions": json.dumps(self.versions, sort_keys=True),
            }
        )


def signed(metadata: Mapping[str, str]) -> dict[str, str]:
    """Return ``metadata`` with its CRC entered (an old one is replaced)."""
    plain = {key: value for key, value in metadata.items() if key != _CRC}
    return plain | {_CRC: _crc(plain)}


def is_intact(metadata: Mapping[str, str]) -> bool:
    """Say whether the CRC in ``metadata`` is that of its other entries."""
    plain = {key: value for key, value in metadata.items() if key != _CRC}
    return metadata.get(_CRC) == _crc(plain)


def check_format(metadata: Mapping[str, str], name: str) -> None:
    """Raise DataError where the log called ``name`` is of a layout that this version does not know."""
    written = metadata.get("format", "")
    if not written.isdecimal() or int(written) > FORMAT:
        raise DataError(
            f"{name} was written by a newer lacuna (log format {written or 'absent'}, this one reads up to {FORMAT}); "
            "update lacuna"
        )


def header_of(metadata: Mapping[str, str], name: str) -> LogHeader:
    """Read the header of the log called ``name``; raise DataError where it is newer or its configuration is invalid."""
    check_format(metadata, name)
    try:
        return LogHeader(
            config=Config.model_validate_json(metadata["config"]),
            versions={str(key): str(value) for key, value in json.loads(metadata["versions"]).items()},
            session=metadata["session"],
            segment=int(metadata["segment"]),
            previous=metadata["previous"] or None,
        )
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        raise DataError(
            f"{name}: its configuration no longer validates ({key}: {first['msg']}); give a configuration with --config"
        ) from error
    except (KeyError, ValueError, AttributeError) as error:
        raise DataError(f"{name}: its header is incomplete; give a configuration with --config") from error


def _crc(plain: Mapping[str, str]) -> str:
    return f"{zlib.crc32(json.dumps(plain, sort_keys=True).encode()):08x}"
