"""What the user has to mend, in one line, and what a driver's exit status says."""
import signal
import sys
import threading

NO_RESULT = 2


class RunError(Exception):
    """What the user has to mend, in one line."""


def status_of(name, main, when_stopped="stopped"):
    """What main() returns; or NO_RESULT, after one line that says what is wrong. A stop by Ctrl-C or SIGTERM is such a line too, after
    the runs at work have been ended."""
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        return main()
    except KeyboardInterrupt:
        print(f"{name}: {when_stopped}", file=sys.stderr, flush=True)
    except RunError as e:
        print(f"{name}: {e}", file=sys.stderr, flush=True)
    except OSError as e:
        print(f"{name}: {e.filename}: {e.strerror}" if e.filename else f"{name}: {e}", file=sys.stderr, flush=True)
    return NO_RESULT


def command(name, main):
    """Ends the process with the status of a driver."""
    sys.exit(status_of(name, main))
