"""The command `proprio`: that of the Rust program, in this process."""

import sys

from ._proprio import run_command


def main() -> int:
    """Run the command with this process' arguments; its exit status."""
    return run_command(["proprio", *sys.argv[1:]])
