"""The command line in this process, for tests: exit status, stdout and stderr of a command."""

from typing import NamedTuple

import pytest

from shapespace.cli import main


class Answer(NamedTuple):
    status: int
    out: str
    err: str


class Shell:
    """Runs the command line in this process."""

    def __init__(self, capture: pytest.CaptureFixture[str]) -> None:
        self.capture = capture

    def __call__(self, *arguments: object) -> Answer:
        self.capture.readouterr()
        status = main([str(argument) for argument in arguments])
        return Answer(status, *self.capture.readouterr())


def one_complaint(answer: Answer, status: int = 2) -> str:
    """The only line on stderr of a command that failed; nothing may be on stdout."""
    assert answer.status == status, answer
    assert answer.out == ""
    assert answer.err.count("\n") == 1, answer.err
    assert answer.err.startswith("shapespace: ")
    return answer.err
