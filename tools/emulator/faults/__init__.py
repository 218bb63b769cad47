"""What goes wrong in an emulated dive, by script and by seed.

A script is TOML (``[[fault]]`` tables) or JSON lines (one fault a line).  A fault has a ``kind``, and a time: ``at_s``,
once, or ``every_s``, again and again at random with that mean.  Seconds are those of the dive's clock since the host
first spoke to the sonar.  It lasts for ``for_s`` and befalls the ``port`` "sonar" or "feed".

    kind         port          keys (default)        what happens
    hangup       sonar, feed   for_s (5)             the port is gone, as if unplugged; what is sent meanwhile is lost
    stall        sonar, feed   for_s (2)             nothing comes, then all of it at once
    half_frame   sonar, feed   for_s (0: one)        messages end half way
    garbage      sonar, feed   count (200)           so many random bytes
    drop         sonar, feed   rate (0.01), for_s    bytes are lost, at this rate, in both directions
    double       sonar, feed   rate (0.01), for_s    bytes come twice
    flip         sonar, feed   rate (0.01), for_s    one bit of a byte is wrong
    baud         sonar, feed   baud (9600), for_s    the device speaks at another rate than the host
    power_cut    sonar         for_s (2)             the head is dark, then boots: it centres and has no settings
    power_loss   sonar                               replies say "power was lost" until the head is set again
    motor_error  sonar         turn_deg (20)         replies say "motor error", and the image is turned, until then
    stale        feed          for_s (10)            compass and depth repeat what they last said
    jump         feed          heading_deg (0), depth_m (0), for_s (5)   they lie by so much
    clock_step   -             step_s (3600)         the host's UTC is set; see below

``for_s`` of drop, double, flip and baud is the rest of the dive where it is not told.  The emulation has no power over
the host's clock: ``clock_step`` is told as an event when it is due, and ``Calendar.utc_step_ns`` tells a test that
writes a log of a recorded dive what to add to UTC.  Recorded dives know no ports, so that a hang-up there loses bytes
and no more.

    [[fault]]
    kind = "hangup"
    port = "sonar"
    at_s = 40.0
    for_s = 6.0
"""

from __future__ import annotations

from tools.emulator.faults.calendar import Calendar, Spell
from tools.emulator.faults.script import Fault, read_faults

__all__ = ["Calendar", "Fault", "Spell", "read_faults"]
