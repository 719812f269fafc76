"""Servers of one connection on this machine, for devices that are opened by a URL."""

from __future__ import annotations

import contextlib
import socket
import threading


@contextlib.contextmanager
def served(serve):
    """A server that does ``serve`` with its connection until that ends: its port."""
    with socket.create_server(("127.0.0.1", 0)) as server:

        def work():
            with contextlib.suppress(OSError):
                connection, _ = server.accept()
                with connection:
                    serve(connection)

        thread = threading.Thread(target=work, daemon=True)
        thread.start()
        yield server.getsockname()[1]
        thread.join(5.0)
