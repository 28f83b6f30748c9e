"""How a process ended, in words for messages."""

import signal


def process_ending(return_code: int, messages: str = "") -> str:
    """``killed by SIGSEGV`` or ``exit code 3``, and in brackets the last line of ``messages``, its standard error.

    ``return_code`` is subprocess's: negative for a signal.
    """
    how = f"exit code {return_code}" if return_code >= 0 else f"killed by {_signal_name(-return_code)}"
    last = (messages.strip().splitlines() or [""])[-1][:200]
    return f"{how} ({last})" if last else how


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
