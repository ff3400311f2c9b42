"""The socket that other programs subscribe to."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from typing import Any

import pytest

from app.live.publisher import ANY_HOST, Publisher
from gelpolight_core.errors import InputError

zmq = pytest.importorskip("zmq")
PATIENCE_S = 20.0


@pytest.fixture
def publisher() -> Iterator[Publisher]:
    made = Publisher(port=0)
    yield made
    made.close()


@pytest.fixture
def subscriber(publisher: Publisher) -> Iterator[Any]:
    context = zmq.Context()
    socket = context.socket(zmq.SUB)
    socket.setsockopt(zmq.LINGER, 0)
    socket.subscribe("depth")
    socket.connect(publisher.address)
    yield socket
    socket.close()
    context.term()


def _received(publisher: Publisher, subscriber: Any, parts: list[bytes]) -> list[bytes]:
    """Send until the subscription has reached the publisher."""
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        publisher.send(parts)
        if subscriber.poll(20):
            return list(subscriber.recv_multipart())
    raise TimeoutError


def test_a_subscriber_receives_what_is_sent(publisher: Publisher, subscriber: Any) -> None:
    parts = [b"depth", b"{}", bytes(range(256)) * 1000]
    assert _received(publisher, subscriber, parts) == parts
    assert publisher.address.startswith("tcp://127.0.0.1:")


def test_a_subscriber_that_does_not_read_stops_nothing(
    publisher: Publisher, subscriber: Any
) -> None:
    _received(publisher, subscriber, [b"depth", b"first"])
    for _ in range(200):
        publisher.send([b"depth", bytes(1_000_000)])


def test_the_network_needs_a_consent_and_a_port_is_used_once(publisher: Publisher) -> None:
    with pytest.raises(InputError, match="other computers"):
        Publisher(ANY_HOST, 0)
    with pytest.raises(InputError, match="IP address"):
        Publisher("localhost", 0)
    Publisher(ANY_HOST, 0, network=True).close()
    port = int(publisher.address.rpartition(":")[2])
    with pytest.raises(InputError, match="cannot be used"):
        Publisher(port=port)


def test_without_the_package_the_remedy_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "zmq", None)
    with pytest.raises(InputError, match="pip install"):
        Publisher(port=0)
