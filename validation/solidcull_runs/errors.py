"""What the user has to mend, in one line, and what a driver's exit status says."""
import sys

NO_RESULT = 2


class RunError(Exception):
    """What the user has to mend, in one line."""


def status_of(name, main):
    """What main() returns; or NO_RESULT, after one line that says what is wrong."""
    try:
        return main()
    except RunError as e:
        print(f"{name}: {e}", file=sys.stderr, flush=True)
    except OSError as e:
        print(f"{name}: {e.filename}: {e.strerror}" if e.filename else f"{name}: {e}", file=sys.stderr, flush=True)
    return NO_RESULT


def command(name, main):
    """Ends the process with the status of a driver."""
    sys.exit(status_of(name, main))
