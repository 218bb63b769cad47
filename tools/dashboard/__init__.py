"""The live page: a bridge from ZeroMQ to the browser."""
