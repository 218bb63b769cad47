"""Codec and state machine of Tritech heads that speak the Seanet serial protocol."""
