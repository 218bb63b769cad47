"""What a key may hold, in words, read off the schema so that it can never differ from it."""

from __future__ import annotations

import difflib
from typing import Any, Final

from config.schema import Config

_SCHEMA: Final[dict[str, Any]] = Config.model_json_schema()
_TYPES: Final = {"integer": "a whole number", "number": "a number", "string": "text", "boolean": "true or false"}
_BOUNDS: Final = {
    "minimum": " of at least {}",
    "exclusiveMinimum": " above {}",
    "maximum": " of at most {}",
    "exclusiveMaximum": " below {}",
    "pattern": " like {}",
    "minLength": " of at least {} character",
}

Place = tuple[int | str, ...]


def expected(place: Place) -> str:
    """Return what the key at ``place`` may hold: type, range, choices."""
    node = _node(place)
    return _words(node) if node else "a known key"


def nearest(place: Place) -> tuple[str, str]:
    """Return what is offered beside an unknown key and a hint: the nearest key here, or where that key belongs."""
    *parent, last = place
    keys = list((_node(tuple(parent)) or {}).get("properties", {}))
    close = difflib.get_close_matches(str(last), keys, n=1, cutoff=0.6)
    if close:
        return _section_name(parent), f"did you mean '{close[0]}'?"
    homes = [name for name, node in _sections().items() if str(last) in node.get("properties", {})]
    hint = f"'{last}' belongs to [{homes[0]}]" if homes else ""
    return "one of " + ", ".join(keys), hint


def _section_name(parent: list[int | str]) -> str:
    return f"a key of [{parent[0]}]" if parent else "a known section"


def _sections() -> dict[str, dict[str, Any]]:
    return {name: _node((name,)) or {} for name in _SCHEMA["properties"]}


def _node(place: Place) -> dict[str, Any] | None:
    """Return the schema at ``place``, or None where the schema has no such key; a list's name leads to its items."""
    node: dict[str, Any] = _SCHEMA
    for step in place:
        inside = node.get("items") if isinstance(step, int) else _resolved(node).get("properties", {}).get(step)
        node = inside or {}
        if not node:
            return None
    return _resolved(node)


def _resolved(node: dict[str, Any]) -> dict[str, Any]:
    """Follow references, single-member unions with null, and lists of sections."""
    while "$ref" in node:
        node = _SCHEMA["$defs"][node["$ref"].rsplit("/", 1)[1]]
    return node


def _words(node: dict[str, Any]) -> str:
    node = _resolved(node)
    if "anyOf" in node:
        return " or ".join(_words(each) for each in node["anyOf"] if each.get("type") != "null")
    if "enum" in node or "const" in node:
        return " or ".join(f"'{each}'" for each in node.get("enum", [node.get("const")]))
    if node.get("type") == "array":
        return _array(node)
    if node.get("type") == "object":
        return "a section of keys"
    return _TYPES.get(node.get("type", ""), "another value") + _bounds(node)


def _array(node: dict[str, Any]) -> str:
    if "prefixItems" in node:
        return f"a list of {len(node['prefixItems'])} numbers"
    item = _resolved(node.get("items", {}))
    return "[[...]] sections" if item.get("type") == "object" else f"a list of {_words(item)}"


def _bounds(node: dict[str, Any]) -> str:
    if "minimum" in node and "maximum" in node:
        return f" from {node['minimum']} to {node['maximum']}"
    return "".join(words.format(node[key]) for key, words in _BOUNDS.items() if key in node)
