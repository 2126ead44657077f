"""`python -m granulcal`: the command line."""

from granulcal.cli import console

raise SystemExit(console())
