"""examples/client.py against a scripted line: what people copy has to survive slow adapters and lost frames."""
import importlib.util
import struct
import sys
import types
import zlib
from pathlib import Path

import pytest

CLIENT = Path(__file__).parents[2] / "examples" / "client.py"


class Line:
    """A board behind a serial adapter that hands over everything that it has by one read."""

    def __init__(self, client, lose=(), dead=False):
        self.client, self.lose, self.dead = client, set(lose), dead
        self.rest, self.out, self.events, self.requests = b"", b"", {0: b"\x00\x00"}, []

    @property
    def in_waiting(self):
        return len(self.out)

    def read(self, _count):
        out, self.out = self.out, b""
        return out

    def write(self, data):
        *frames, self.rest = (self.rest + data).split(b"\0")
        for frame in filter(None, frames):
            content = self.client.cobs_decode(frame)[:-4]
            _, _, number, _, _ = struct.unpack("<BBIII", content[:14])
            self.obey(number, content[14:])

    def send(self, kind, number, body):
        content = struct.pack("<BBII", 3, kind, number, 7) + body
        self.out += b"\0" + self.client.cobs_encode(content + struct.pack("<I", zlib.crc32(content))) + b"\0"

    def event(self, body):
        number = len(self.events)
        self.events[number] = body
        if number not in self.lose:
            self.send(self.client.EVENT, number, body)

    def obey(self, number, request):
        c = self.client
        self.requests.append(request[0])
        if request[0] == c.HELLO:
            text = b"\x05board" + b"\x0210"
            self.send(c.RESPONSE, number, b"\x00\x03\x03" + b"\x01" + text + bytes(12) + b"\x07\x00\x01" + b"\x00\x04")
        elif request[0] == c.READ_EVENT:
            wanted, _ = c.read_varint(request, 1)
            if wanted in self.events:
                self.send(c.RESPONSE, number, bytes([c.EVENT_ANSWER]) + self.events[wanted])
            else:
                self.send(c.ERROR, number, bytes([c.EVENT_GONE]) + b"\x00" + c.varint(len(self.events)))
        elif request[0] == c.MOVE:
            self.send(c.RESPONSE, number, b"\x02")
            if not self.dead:
                self.event(b"\x05" + bytes([c.STILL_THERE]) + c.varint(number))
                done = bytes([c.MOVE_DONE]) + c.varint(number) + b"\x01" + c.zigzag(20_000) + c.zigzag(20_003)
                self.event(b"\x05" + done)
        else:
            self.send(c.RESPONSE, number, b"\x02")


@pytest.fixture
def client(monkeypatch):
    monkeypatch.setitem(sys.modules, "serial", types.ModuleType("serial"))
    spec = importlib.util.spec_from_file_location("example_client", CLIENT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.setattr(module, "QUIET_S", 0.05)
    return module


def rig(client, line):
    client.serial.Serial = lambda *_, **__: line
    return client.Rig("port")


def test_uses_events_that_arrive_with_the_answer(client):
    line = Line(client)
    assert rig(client, line).move_fine(20_000) == 20_003
    assert client.STATUS in line.requests, "the keep-alive is answered"


@pytest.mark.parametrize("lost", [[1], [2], [1, 2]])
def test_reads_lost_events_again(client, lost):
    assert rig(client, Line(client, lose=lost)).move_fine(20_000) == 20_003


def test_stops_a_move_that_does_not_end(client, monkeypatch):
    monkeypatch.setattr(client, "MOVE_S", 0.3)
    line = Line(client, dead=True)
    with pytest.raises(TimeoutError, match="stopped"):
        rig(client, line).move_fine(20_000)
    assert line.requests[-1] == client.STOP
