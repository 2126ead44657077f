"""Exit codes of the command line, as docs and scripts know them."""

__all__ = ["BAD_INPUT", "DONE", "FAILED", "INTERRUPTED", "UNHEALTHY"]

DONE, FAILED, BAD_INPUT, UNHEALTHY, INTERRUPTED = 0, 1, 2, 3, 130
