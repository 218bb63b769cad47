"""A fault of the program itself is one line to people, and says where to begin."""

from __future__ import annotations

from daemon.fault import fault


def test_a_fault_is_one_line_with_its_place() -> None:
    try:
        [][3]
    except IndexError as error:
        told = fault("map", error)
    text = str(told)
    assert text.startswith("a fault in the map: IndexError: list index out of range (test_fault.py:")
    assert text.endswith("please report it with the log")
    assert told.exit_code == 70
    assert "\n" not in str(fault("map", ValueError("two\nlines")))
    assert "no more is known" in str(fault("acquisition", ValueError()))
