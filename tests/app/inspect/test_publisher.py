"""The socket that other programs subscribe to."""

import socket
import time
from contextlib import suppress
from typing import Any

import pytest
from fake_camera import eventually

from app.inspect.depth_stream import Publisher

zmq = pytest.importorskip("zmq")
PATIENCE_S = 60.0


@pytest.fixture
def publisher():
    made = Publisher(port=0)
    yield made
    made.close()


@pytest.fixture
def subscriber(publisher):
    context = zmq.Context()
    receiver = context.socket(zmq.SUB)
    receiver.setsockopt(zmq.LINGER, 0)
    receiver.subscribe("depth")
    receiver.connect(publisher.address)
    yield receiver
    receiver.close()
    context.term()


def _received(publisher: Publisher, subscriber: Any, parts: list[bytes]) -> list[bytes]:
    """Send until the subscription has reached the publisher."""
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        publisher.send(parts)
        if subscriber.poll(20):
            return list(subscriber.recv_multipart())
    raise TimeoutError


def test_a_subscriber_that_does_not_read_stops_nothing(publisher, subscriber):
    _received(publisher, subscriber, [b"depth", b"first"])
    for _ in range(200):
        publisher.send([b"depth", bytes(1_000_000)])


def test_a_slow_receiver_works_on_new_frames(publisher):
    """As the client of docs/reference/streaming.md: it keeps one message, the sender one more."""
    context = zmq.Context()
    receiver = context.socket(zmq.SUB)
    receiver.setsockopt(zmq.LINGER, 0)
    receiver.setsockopt(zmq.RCVHWM, 1)
    receiver.subscribe("depth")
    receiver.connect(publisher.address)
    try:
        frame = bytes(9_000_000)  # more than the system's buffers hold
        _received(publisher, receiver, [b"depth", b"first", frame])
        for number in range(30):
            publisher.send([b"depth", str(number).encode(), frame])
        waiting = 0
        while receiver.poll(500):
            receiver.recv_multipart()
            waiting += 1
        assert waiting < 10
    finally:
        receiver.close()
        context.term()


@pytest.fixture
def peer(publisher):
    """Return a connection that speaks the protocol (ZMTP 3.0) as a subscriber."""
    port = int(publisher.address.rpartition(":")[2])
    greeting = b"\xff" + bytes(8) + b"\x7f\x03\x00" + b"NULL".ljust(20, b"\0") + bytes(32)
    ready = b"\x05READY\x0bSocket-Type\x00\x00\x00\x03SUB"
    with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S) as made:
        made.sendall(greeting + b"\x04" + bytes([len(ready)]) + ready)
        yield made


def _disconnected(peer: socket.socket) -> None:
    """Read until the publisher closes the connection: otherwise this ends with a time-out."""
    with suppress(ConnectionError):
        while peer.recv(4096):
            pass


def test_a_large_subscription_cannot_fill_the_memory_of_the_program(peer):
    peer.sendall(b"\x02" + (1_500_000_000).to_bytes(8, "big") + b"\x01depth")
    _disconnected(peer)


def test_many_subscriptions_cannot_fill_the_memory_of_the_program(publisher, subscriber, peer):
    """The socket keeps every topic. All are disconnected, and a usual receiver connects again."""
    _received(publisher, subscriber, [b"depth", b"first"])
    address, before = publisher.address, publisher._context
    with suppress(ConnectionError):
        for number in range(1000):
            topic = b"\x01" + number.to_bytes(200, "little")
            peer.sendall(b"\x00" + bytes([len(topic)]) + topic)

    def opened_again() -> bool:
        publisher.send([b"depth", b"again"])
        return publisher._context is not before

    eventually(opened_again)
    while subscriber.poll(0):
        subscriber.recv_multipart()
    assert _received(publisher, subscriber, [b"depth", b"again"]) == [b"depth", b"again"]
    assert publisher.address == address
    _disconnected(peer)
