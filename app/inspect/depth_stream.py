"""Streams the live depth to other programs over ZeroMQ, and the dialog for it."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from PySide6.QtCore import QObject
from PySide6.QtWidgets import QWidget

from app.live.frame_processor import FrameResult
from app.live.live_depth import LiveDepth
from app.program.context import AppContext
from app.widgets.actions import Slot, push_button
from app.widgets.dialog import Dialog, ask
from app.widgets.forms import Form
from app.widgets.label import PlainLabel
from app.widgets.text_roles import named_label, set_text_role
from gelpolight_core.base.errors import InputError, Remedy, not_installed
from gelpolight_core.base.form_fields import choice, number
from gelpolight_core.output.live_message import encode_message

_LOG = logging.getLogger(__name__)

HOST, PORT = "127.0.0.1", 5557
ANY_HOST = "0.0.0.0"
"""All networks of this computer."""
REACH = {
    False: "Programs on this computer",
    True: "Other computers of the network, too",
}
WAITING = 1
"""Messages that wait for a slow receiver. It loses the ones after them; the others lose none."""
MOST_RECEIVED = 512
"""Bytes of one message from a receiver: subscriptions to a topic, and the protocol's own."""
MOST_SUBSCRIPTIONS = 100
"""To different topics; only one is sent. Each byte of a topic takes about 50 bytes of memory."""


class DepthStream(QObject):
    """Sends depth, normals, flags and health of every new frame. Off at the start of the program.

    Parameters
    ----------
    depth : LiveDepth
        Computes the frames.
    owner : QWidget
        The page.
    on_changed : callable
        Called when it was started or stopped.
    context : AppContext
        Shared by all pages.
    """

    def __init__(
        self, depth: LiveDepth, owner: QWidget, on_changed: Slot, *, context: AppContext
    ) -> None:
        super().__init__(owner)
        self._on_changed = on_changed
        self._depth, self._owner, self._context = depth, owner, context
        self._publisher: Publisher | None = None
        self._dialog: StreamDialog | None = None
        self._sent = -1
        depth.shown.connect(self._send)
        depth.live.switched.connect(self._on_switched)

    @property
    def on(self) -> bool:
        """Whether frames are sent."""
        return self._publisher is not None

    @property
    def address(self) -> str:
        """Address for subscribers. Empty while nothing is sent."""
        return "" if self._publisher is None else self._publisher.address

    @property
    def text(self) -> str:
        """State of the stream in a few words. Empty while nothing is sent."""
        if self._publisher is None:
            return ""
        if self._publisher.network:
            return f"streaming to the NETWORK: {self.address}"
        return f"streaming: {self.address}"

    def show_dialog(self) -> None:
        """Show the dialog."""
        if self._dialog is None:
            self._dialog = StreamDialog(self, self._owner)
        self._dialog.refresh()
        self._dialog.show()
        self._dialog.raise_()

    def start(self, port: int = PORT, *, network: bool = False) -> None:
        """Send from now on: to this computer only, or with `network` to all that can reach it.

        Raises
        ------
        InputError
            If the address cannot be used, or pyzmq is not installed.
        """
        self.stop()
        self._publisher = Publisher(port, network=network)
        self._sent = -1
        self._changed()

    def stop(self) -> None:
        """Send nothing more."""
        publisher, self._publisher = self._publisher, None
        if publisher is not None:
            publisher.close()
            self._changed()

    def _changed(self) -> None:
        if self._dialog is not None:
            self._dialog.refresh()
        self._on_changed()

    def close(self) -> None:
        """Stop at the end of the program."""
        self.stop()
        if self._dialog is not None:
            self._dialog.close()

    def _on_switched(self) -> None:
        self._sent = -1  # numbers of another stream start again

    def _send(self, result: FrameResult) -> None:
        """Send a frame once, as reconstructed. A frozen image is computed many times."""
        heightmap, frame = result.raw, result.frame
        if self._publisher is None or heightmap is None or frame.number == self._sent:
            return
        if heightmap.normals is None:
            return  # it was computed before the stream was started
        used = self._depth.live_reconstructor
        serial = "" if used is None else used.calibration.serial
        parts = encode_message(heightmap, frame=frame.number, time_s=frame.time_s, serial=serial)
        with self._context.toasts.errors():
            self._publisher.send(parts)
            self._sent = frame.number
            return
        self.stop()


@dataclass(frozen=True, slots=True)
class StreamAddress:
    """Address of the stream: receivers and port."""

    reach: bool = choice(False, "&Receivers", REACH)
    port: int = number(PORT, "&Port", 1024, 65535)


class StreamDialog(Dialog):
    """Lets the user start and stop the stream. The network needs an explicit consent."""

    def __init__(self, stream: DepthStream, parent: QWidget) -> None:
        super().__init__(parent, "stream", "Stream the live depth")
        self._stream = stream
        self.setMinimumWidth(440)
        about = PlainLabel(
            (
                "Depth, normals, flags and health of the live frames are sent over ZeroMQ while "
                "the Inspect page is visible. The guide has a client of ten lines."
            ),
            wrap=True,
        )
        self.form = Form(StreamAddress(), "stream")
        self.state = named_label("stream.state", "State of the stream")
        self.button = push_button(
            "stream.start", "", self._toggle, accessible="Start or stop the stream"
        )
        self.fill(about, self.form, self.state, add=(self.button,))
        self.refresh()

    def refresh(self) -> None:
        """Show whether it sends."""
        on = self._stream.on
        self.button.setText("Stop" if on else "Start")
        self.form.setEnabled(not on)
        self._say(self._stream.text or "Nothing is sent.", "pass" if on else "muted")

    def _say(self, text: str, meaning: str) -> None:
        self.state.setText(text)
        set_text_role(self.state, meaning)

    def _toggle(self) -> None:
        if self._stream.on:
            self._stream.stop()
        elif self.form.value.reach:
            ask(
                self,
                "Open to the network",
                (
                    "Everybody on a network of this computer can then receive the depth, without a "
                    "password and not encrypted. Nobody can change anything in this program."
                ),
                ("Stream to the network", lambda: self._start(network=True)),
            )
        else:
            self._start(network=False)

    def _start(self, *, network: bool) -> None:
        try:
            self._stream.start(self.form.value.port, network=network)
        except InputError as error:
            self._say(str(error), "fail")


class Publisher:
    """A PUB socket of ZeroMQ that sends messages to subscribers.

    Parameters
    ----------
    port : int
        Port of the socket. 0: any free port.
    network : bool, optional
        Whether other computers can reach it.

    Attributes
    ----------
    address : str
        Address for subscribers, such as ``tcp://127.0.0.1:5557``.
    network : bool
        Whether other computers can reach it.

    Raises
    ------
    InputError
        If pyzmq is not installed, or the address cannot be used.
    """

    def __init__(self, port: int, *, network: bool = False) -> None:
        self._zmq, self.network = _library(), network
        self._open(f"{ANY_HOST if network else HOST}:{port or '*'}")

    def _open(self, place: str) -> None:
        """Open the socket, which tells what receivers subscribe to."""
        self._subscriptions = 0
        self._context = self._zmq.Context()
        self._socket = self._context.socket(self._zmq.XPUB)
        self._socket.setsockopt(self._zmq.LINGER, 0)
        self._socket.setsockopt(self._zmq.SNDHWM, WAITING)
        self._socket.setsockopt(self._zmq.RCVHWM, WAITING)
        self._socket.setsockopt(self._zmq.MAXMSGSIZE, MOST_RECEIVED)
        try:
            self._socket.bind(f"tcp://{place}")
        except self._zmq.ZMQError as error:
            self.close()
            raise InputError(
                f"the address cannot be used ({error.strerror})",
                place,
                Remedy.CLOSE_PROGRAM,
            ) from error
        self.address: str = self._socket.getsockopt_string(self._zmq.LAST_ENDPOINT)

    def send(self, parts: Sequence[bytes]) -> None:
        """Send a message to all receivers. It never waits for them.

        Each subscription takes memory. When there are too many the socket is opened again, and
        receivers connect and subscribe again by themselves.

        Raises
        ------
        InputError
            If another program has taken the address meanwhile.
        """
        while self._socket.poll(0):
            self._socket.recv()
            self._subscriptions += 1
            if self._subscriptions > MOST_SUBSCRIPTIONS:
                _LOG.warning("There are too many subscriptions; all receivers were disconnected")
                self.close()
                self._open(self.address.removeprefix("tcp://"))
        self._socket.send_multipart(parts, flags=self._zmq.NOBLOCK)

    def close(self) -> None:
        """Send nothing more, and release the port."""
        self._socket.close()
        self._context.term()


def _library() -> Any:
    try:
        import zmq
    except ImportError as error:
        raise not_installed("pyzmq", "stream", "stream") from error
    return zmq
