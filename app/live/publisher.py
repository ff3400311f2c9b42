"""Sends messages to other programs over ZeroMQ. Only this computer can receive them by default."""

from __future__ import annotations

import ipaddress
from collections.abc import Sequence
from typing import Any

from gelpolight_core.errors import InputError
from gelpolight_core.translation import tr

HOST, PORT = "127.0.0.1", 5557
ANY_HOST = "0.0.0.0"
"""All networks of this computer."""
WAITING = 1
"""Messages that wait for a slow receiver. It loses the ones after them; the others lose none."""
MOST_RECEIVED = 4096
"""Bytes of one message from a receiver: subscriptions to a topic, and the protocol's own."""


class Publisher:
    """A PUB socket.

    Parameters
    ----------
    host : str
        IP address to bind to.
    port : int
        Its port. 0: any that is free.
    network : bool, optional
        Consent to an address that other computers can reach.

    Attributes
    ----------
    address : str
        Where to subscribe, such as ``tcp://127.0.0.1:5557``.

    Raises
    ------
    InputError
        If pyzmq is not installed, the address is not local and there is no consent, or the address
        cannot be used.
    """

    def __init__(self, host: str = HOST, port: int = PORT, *, network: bool = False) -> None:
        if not (network or is_local(host)):
            raise InputError(
                tr("other computers can reach this address"),
                where=host,
                advice=tr("Use 127.0.0.1, or allow the network explicitly"),
            )
        self._zmq = _library()
        self._context = self._zmq.Context()
        self._socket = self._context.socket(self._zmq.PUB)
        self._socket.setsockopt(self._zmq.LINGER, 0)
        self._socket.setsockopt(self._zmq.SNDHWM, WAITING)
        self._socket.setsockopt(self._zmq.MAXMSGSIZE, MOST_RECEIVED)
        try:
            self._socket.bind(f"tcp://{host}:{port or '*'}")
        except self._zmq.ZMQError as error:
            self.close()
            raise InputError(
                tr("the address cannot be used ({reason})").format(reason=error.strerror),
                where=f"{host}:{port}",
                advice=tr("Choose another port, or close the program that uses it"),
            ) from error
        self.address: str = self._socket.getsockopt_string(self._zmq.LAST_ENDPOINT)

    def send(self, parts: Sequence[bytes]) -> None:
        """Send a message to all receivers. It never waits for them."""
        self._socket.send_multipart(parts, flags=self._zmq.NOBLOCK)

    def close(self) -> None:
        """Send nothing more, and release the port."""
        self._socket.close()
        self._context.term()


def is_local(host: str) -> bool:
    """Whether only this computer can reach an IP address.

    Raises
    ------
    InputError
        If it is not an IP address.
    """
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError as error:
        raise InputError(
            tr("it is not an IP address"), where=host, advice=tr("Enter one such as 127.0.0.1")
        ) from error


def _library() -> Any:
    try:
        import zmq
    except ImportError as error:
        raise InputError(
            tr("the package pyzmq is not installed"),
            where=tr("stream"),
            advice=tr('Install it into the environment of this program: pip install "pyzmq>=26"'),
        ) from error
    return zmq
