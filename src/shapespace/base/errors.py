"""The exceptions a user can cause. Each message is one line that names the key or file, the value and the remedy."""


class InputError(ValueError):
    """What was asked for cannot be done as stated; nothing has been written.

    The message is forced onto one line, so that a value with line breaks in it cannot break the promise.
    """

    def __init__(self, message: str) -> None:
        super().__init__(" ".join(message.split()))


class StoreError(InputError):
    """A directory or file that is foreign, damaged, of another run or not writable, or a full disk."""


class WorkerError(RuntimeError):
    """Processes that compute could not be kept alive; what they finished is stored."""
