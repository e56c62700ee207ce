# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A network cable that loses frames and takes its time, for kernels without tc's netem.

`python cable.py TAP_A TAP_B LOSS DELAY`: makes two network devices, says so, and carries Ethernet
frames from the one to the other until it is ended. Each frame is lost with a probability of LOSS,
and arrives DELAY seconds later. Needs the right to make devices (CAP_NET_ADMIN).
"""
from __future__ import annotations

import fcntl
import os
import random
import select
import struct
import sys
import time
from collections import deque

TUNSETIFF = 0x400454CA  # linux/if_tun.h
IFF_TAP, IFF_NO_PI = 0x0002, 0x1000
LARGEST_FRAME = 65_535


def make_tap(name: str) -> int:
    """Make a network device; what is sent to it is read from the file returned, and the reverse."""
    file = os.open('/dev/net/tun', os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(file, TUNSETIFF, struct.pack('16sH', name.encode(), IFF_TAP | IFF_NO_PI))
    return file


def carry(one: int, other: int, loss: float, delay: float) -> None:
    """Carry frames both ways, for ever."""
    chance = random.Random(1)
    there = {one: other, other: one}
    under_way: deque[tuple[float, int, bytes]] = deque()
    while True:
        wait = max(0.0, under_way[0][0] - time.monotonic()) if under_way else None
        for end in select.select([one, other], [], [], wait)[0]:
            frame = os.read(end, LARGEST_FRAME)
            if chance.random() >= loss:
                under_way.append((time.monotonic() + delay, there[end], frame))
        while under_way and under_way[0][0] <= time.monotonic():
            _, end, frame = under_way.popleft()
            try:
                os.write(end, frame)
            except OSError:  # that end is not up (yet): a frame into an open cable is lost
                pass


if __name__ == '__main__':
    taps = [make_tap(name) for name in sys.argv[1:3]]
    print('ready', flush=True)
    carry(*taps, *map(float, sys.argv[3:5]))
