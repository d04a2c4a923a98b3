#!/usr/bin/env python3
"""A client for a farnear rig, real or emulated, written from docs/protocol.md: moves the piezo and prints where it
is. It repeats requests that get no answer, reads lost events again, answers the keep-alive, and stops the move at a deadline.

    farnear-sim run                      # prints {"port": "/dev/pts/3", ...}
    python3 examples/client.py /dev/pts/3 20000
"""
import collections
import secrets
import struct
import sys
import time
import zlib

import serial  # pip install pyserial

VERSION = 3
REQUEST, RESPONSE, ERROR, EVENT = 1, 2, 3, 4
HELLO, STATUS, MOVE, STOP, READ_EVENT, OPEN_SESSION = 0, 1, 3, 4, 7, 30  # places in the table of requests
EVENT_ANSWER, EVENT_GONE = 3, 9  # places in the tables of answers and errors
STARTED, HOMED, MOVE_DONE, FAILED, STILL_THERE = 0, 1, 2, 5, 9  # places in the table of events
SENSOR_FINE = 1
QUIET_S, MOVE_S = 1.0, 30.0  # without an event so long, one may be lost; longest time for a move
REPLY_S, ATTEMPTS = 2.0, 4  # a real board answers within 50 ms; an emulated one takes what the computer takes


def cobs_encode(data):
    out = bytearray()
    for block in data.split(b"\0"):
        while len(block) >= 254:
            out += b"\xff" + block[:254]
            block = block[254:]
        out += bytes([len(block) + 1]) + block
    return bytes(out)


def cobs_decode(data):
    out, at = bytearray(), 0
    while at < len(data):
        code = data[at]
        out += data[at + 1:at + code]
        at += code
        if code < 255 and at < len(data):
            out.append(0)
    return bytes(out)


def varint(value):
    out = bytearray()
    while value > 127:
        out.append(value & 127 | 128)
        value >>= 7
    return bytes(out + bytes([value]))


def zigzag(value):
    return varint(value * 2 if value >= 0 else -value * 2 - 1)


def read_varint(body, at):
    value, shift = 0, 0
    while True:
        byte, at = body[at], at + 1
        value, shift = value | (byte & 127) << shift, shift + 7
        if byte < 128:
            return value, at


def read_zigzag(body, at):
    value, at = read_varint(body, at)
    return (value >> 1) ^ -(value & 1), at


class Refused(RuntimeError):
    def __init__(self, body):
        super().__init__(f"refused: variant {body[0]}, {body[1:].hex()}")
        self.body = body


class Rig:
    def __init__(self, port):
        self.line = serial.Serial(port, 2_000_000, timeout=0.05, exclusive=True)
        self.boot, self.session, self.last_id, self.rest = 0, 0, 0, b""
        self.waiting = collections.deque()  # frames that were received and not used yet
        self.events, self.due = {}, None  # events by number, and the number that is due
        hello = self.ask(bytes([HELLO]))
        # variant, two versions, schema key, board and firmware as texts, unique id: then comes the boot number.
        _, at = read_varint(hello, 3)
        self.board = hello[at + 1:at + 1 + hello[at]].decode()
        at += 1 + hello[at]
        at += 1 + hello[at] + 12
        self.boot, at = read_varint(hello, at)
        self.emulated = bool(hello[at + 1])  # behind the reset's cause
        # The last two numbers are the largest id so far and how many requests may be outstanding.
        last = len(hello) - 2
        while last > 0 and hello[last - 1] & 128:
            last -= 1
        self.last_id, _ = read_varint(hello, last)
        self.session = secrets.randbelow(2**32 - 1) + 1
        self.ask(bytes([OPEN_SESSION]))
        self.due = self.read_event(2**32 - 1)  # the next event's number

    def ask(self, request):
        """Sends a request, the same bytes again where no answer comes; gives the answer's body."""
        self.last_id += 1
        content = struct.pack("<BBIII", VERSION, REQUEST, self.last_id, self.boot, self.session) + request
        frame = b"\0" + cobs_encode(content + struct.pack("<I", zlib.crc32(content))) + b"\0"
        for _ in range(ATTEMPTS):
            self.line.write(frame)
            until = time.monotonic() + REPLY_S
            while time.monotonic() < until:
                self.receive()
                # One read may hold an answer and events after it: unused bytes stay in the queue.
                while self.waiting:
                    kind, number, body = self.waiting.popleft()
                    if kind == EVENT:
                        self.events[number] = body
                    elif number == self.last_id and kind == ERROR:
                        raise Refused(body)
                    elif number == self.last_id and kind == RESPONSE:
                        return body
        raise TimeoutError("the board does not answer")

    def receive(self):
        """Reads the received bytes and queues the valid frames: kind, id and body."""
        self.rest += self.line.read(max(1, self.line.in_waiting))
        *frames, self.rest = self.rest.split(b"\0")
        for frame in frames:
            content = cobs_decode(frame)
            if len(content) >= 14 and zlib.crc32(content[:-4]) == struct.unpack("<I", content[-4:])[0]:
                _, kind, number, _ = struct.unpack("<BBII", content[:10])
                self.waiting.append((kind, number, content[10:-4]))

    def read_event(self, number):
        """Reads an event again, which is queued if the board has it; gives the number of the event after the last one."""
        try:
            body = self.ask(bytes([READ_EVENT]) + varint(number))
        except Refused as refused:
            if refused.body[0] != EVENT_GONE:
                raise
            oldest, at = read_varint(refused.body, 1)
            if self.due is not None and number < oldest:
                raise RuntimeError(f"event {number} is lost: the board remembers {oldest} and later ones") from None
            return read_varint(refused.body, at)[0]
        if body[0] == EVENT_ANSWER:
            self.events[number] = body[1:]
        return number + 1

    def next_event(self, until):
        """The next event, in order and without a gap; stops the rig where none comes until then."""
        quiet_since = time.monotonic()
        while self.due not in self.events:
            now = time.monotonic()
            if now >= until:
                self.ask(bytes([STOP]))
                raise TimeoutError("the move did not end in time; the rig was stopped")
            self.receive()
            while self.waiting:
                kind, number, body = self.waiting.popleft()
                if kind == EVENT:
                    self.events[number] = body
            lost = any(number > self.due for number in self.events) or now - quiet_since > QUIET_S
            if self.due not in self.events and lost:
                self.read_event(self.due)
                quiet_since = now
        self.due += 1
        return self.events.pop(self.due - 1)

    def move_fine(self, target_nm):
        """Moves the piezo; gives the measured position in nanometres."""
        self.ask(bytes([MOVE, SENSOR_FINE]) + zigzag(target_nm) + varint(10_000_000))
        request, until = self.last_id, time.monotonic() + MOVE_S
        while True:
            body = self.next_event(until)
            _, at = read_varint(body, 0)  # the board's time
            kind, at = body[at], at + 1
            if kind == STILL_THERE:
                self.ask(bytes([STATUS]))
            elif kind in (MOVE_DONE, FAILED):
                named, at = read_varint(body, at)
                if named == request and kind == FAILED:
                    raise RuntimeError(f"the move failed: {body[at:].hex()}")
                if named == request:
                    _, at = read_zigzag(body, at + 1)  # the axis, and the target
                    return read_zigzag(body, at)[0]


if __name__ == "__main__":
    rig = Rig(sys.argv[1])
    print(f"{rig.board}, boot {rig.boot}, {'emulated' if rig.emulated else 'real'}")
    print(f"the piezo is at {rig.move_fine(int(sys.argv[2]))} nm")
