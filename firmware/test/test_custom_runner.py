"""Tells PlatformIO how the tests went: a line `PASS name` or `FAIL name` each, as test_core/check.h prints them."""

import click
from platformio.test.result import TestCase, TestStatus
from platformio.test.runners.base import TestRunnerBase


class CustomTestRunner(TestRunnerBase):
    """Reads the program's output; PlatformIO takes its exit code into account by itself."""

    def on_testing_line_output(self, line: str) -> None:
        """Take one line of output."""
        verdict, _, name = line.strip().partition(" ")
        statuses = {"PASS": TestStatus.PASSED, "FAIL": TestStatus.FAILED}
        if verdict in statuses:
            self.test_suite.add_case(TestCase(name=name, status=statuses[verdict]))
        click.echo(line, nl=False)
