"""A network cable between two namespaces that is a program: it loses what it is asked to lose, and counts messages."""

import fcntl
import os
import random
import select
import struct
import subprocess
import threading
import time

TUNSETIFF = 0x400454CA
IFF_TAP, IFF_NO_PI = 0x0002, 0x1000
# A frame of so many bytes holds a LowState; what discovery says is shorter or not lost here.
MESSAGE = 1200
# How the address of a frame for an IPv4 group begins.
MULTICAST = bytes([0x01, 0x00, 0x5E])


def ip(*words, inside=()):
    subprocess.run([*inside, "ip", *words], check=True)


def tap(name):
    device = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(device, TUNSETIFF, struct.pack("16sH", name.encode(), IFF_TAP | IFF_NO_PI))
    return device


class Cable:
    """Joins `robot0` of this namespace to `pc0` of another one, in which [`inside`] runs commands."""

    def __init__(self):
        self.loss = 0.0
        self.dropped = 0
        self.multicast = True
        self.random = random.Random(7)
        self.other = subprocess.Popen(["unshare", "--net", "sleep", "infinity"])
        time.sleep(0.3)
        self.inside = ["nsenter", "--target", str(self.other.pid), "--net"]
        self.ends = [tap("robot0"), tap("pc0")]
        ip("link", "set", "pc0", "netns", str(self.other.pid))
        for name, address, inside in [("robot0", "10.77.0.1/24", ()), ("pc0", "10.77.0.2/24", self.inside)]:
            ip("link", "set", "lo", "up", inside=inside)
            ip("addr", "add", address, "dev", name, inside=inside)
            ip("link", "set", name, "up", inside=inside)
            ip("route", "add", "224.0.0.0/4", "dev", name, inside=inside)
        self.ended = False
        self.thread = threading.Thread(target=self._relay, daemon=True)
        self.thread.start()

    def _relay(self):
        # Nor does a cable wait for a processor: this thread alone, for what is tested does.
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), -20)
        here, there = self.ends
        while not self.ended:
            for end in select.select(self.ends, [], [], 0.1)[0]:
                frame = os.read(end, 65536)
                if not self.multicast and frame.startswith(MULTICAST):
                    continue
                if end == there and len(frame) >= MESSAGE and self.random.random() < self.loss:
                    self.dropped += 1
                    continue
                os.write(there if end == here else here, frame)

    def close(self):
        self.ended = True
        self.thread.join()
        for end in self.ends:
            os.close(end)
        self.other.kill()
        self.other.wait()
