"""A test worker that dies ends the run at once, as a failure with the test's name.

xdist by itself gives that test to the next worker, and its scheduling by files then waits for ever.
"""

import contextlib

import pytest


def pytest_configure(config):
    if getattr(config.option, "maxworkerrestart", "") is None:  # xdist is there, and nobody said otherwise
        config.option.maxworkerrestart = "0"
    config.pluginmanager.register(DeadWorkers())


class DeadWorkers:
    def __init__(self):
        self._died = False

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodeready(self, node):
        """Work sent to a worker whose death is not told yet is no internal error: xdist is told next."""
        send = node.send_runtest_some

        def send_to_the_living(indices):
            with contextlib.suppress(OSError):
                send(indices)

        node.send_runtest_some = send_to_the_living

    @pytest.hookimpl(optionalhook=True)
    def pytest_handlecrashitem(self, crashitem, report, sched):
        sched.config.hook.pytest_runtest_logreport(report=report)
        # Not shouldstop: other workers would first run what they have, which takes minutes.
        pytest.exit(f"a test worker died in {crashitem}", returncode=pytest.ExitCode.TESTS_FAILED)

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node, error):
        self._died = self._died or bool(error)

    @pytest.hookimpl(tryfirst=True)
    def pytest_sessionfinish(self, session):
        unnoticed = (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED)
        if self._died and session.exitstatus in unnoticed:  # it died beside the tests
            session.exitstatus = pytest.ExitCode.TESTS_FAILED
